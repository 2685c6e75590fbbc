"""What drives a system: transmission errors of its meshes, a constant load, periodic forces."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

from pydantic import Field, GetJsonSchemaHandler
from pydantic_core import core_schema

from gearstab.config.document.problems import Path
from gearstab.config.model.fields import (
    ExactRatio,
    NameText,
    Number,
    Quantity,
    Section,
    Turns,
)

Conflict = tuple[Path, str, str]
"""What contradicts itself: path below the section, message, remedy."""

ErrorAmplitude = Annotated[float, Quantity("m", ("rad",), entry=True)]
ForceAmplitude = Annotated[float, Quantity("N", ("N m",), entry=True)]
Load = list[ForceAmplitude]
"""Constant generalised forces, one a coordinate."""


class OneAsWell:
    """Lets the schema of a list admit its one entry by itself, which :mod:`gearstab.config.loading` makes a list."""

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        plain = handler(schema)
        return {"anyOf": [plain["items"], plain | {"minItems": 1, "maxItems": 1}]}


LoadOfOne = Annotated[Load, OneAsWell()]
"""That of a system of one coordinate."""

MOST_HARMONICS = 100


class TransmissionError(Section):
    """The unloaded static transmission error of a mesh as a Fourier series over its period."""

    sin: list[ErrorAmplitude] = Field(
        default=[],
        max_length=MOST_HARMONICS,
        title="sine amplitudes of the transmission error",
        description="a_s of sin s x, s = 1, 2, ..., x = Omega_i t - 2 pi lag (m, or rad where the mesh turns).",
    )
    cos: list[ErrorAmplitude] = Field(
        default=[],
        max_length=MOST_HARMONICS,
        title="cosine amplitudes of the transmission error",
        description="b_s of cos s x, s = 1, 2, ... (m, or rad where the mesh turns).",
    )

    @classmethod
    def conflicts(cls, raw: Any) -> Iterator[Conflict]:
        """At least one harmonic."""
        yield from no_harmonics(raw, "m")


class Force(Section):
    """A periodic external force, given by its Fourier series."""

    name: NameText | None = Field(default=None, title="name of the force", description="What messages call it.")
    direction: list[Number] = Field(
        title="direction of the force",
        min_length=1,
        description="u, the force acts as u times its value: one number a coordinate (1).",
    )
    sin: list[ForceAmplitude] = Field(
        default=[],
        max_length=MOST_HARMONICS,
        title="sine amplitudes of the force",
        description="Of sin s x, s = 1, 2, ..., x = r Omega t - 2 pi lag (N, or N m of a rotation).",
    )
    cos: list[ForceAmplitude] = Field(
        default=[],
        max_length=MOST_HARMONICS,
        title="cosine amplitudes of the force",
        description="Of cos s x, s = 1, 2, ... (N, or N m of a rotation).",
    )
    frequency_ratio: ExactRatio = Field(
        default=1,
        title="frequency ratio of the force",
        validate_default=True,
        description='r, its frequency over the mesh frequency of the sweep, exact: 1, 0.5 or "1/2".',
    )
    lag: Turns = Field(
        default=0.0, title="lag of the force", description="It begins this fraction of its own period late (1)."
    )

    @classmethod
    def conflicts_of_size(cls, raw: Any, size: int | None) -> Iterator[Conflict]:
        """At least one harmonic, and a direction of the size of the system that is not zero."""
        yield from no_harmonics(raw, "N")
        direction = raw.get("direction") if isinstance(raw, dict) else None
        if not isinstance(direction, list):
            return
        if size is not None and len(direction) != size:
            yield ("direction",), f"has {len(direction)} entries", f"give {size}, one a coordinate"
        elif direction and all(entry == 0 for entry in direction):
            yield ("direction",), "has only zeros", "let the force act on at least one coordinate"


def no_harmonics(raw: Any, unit: str) -> Iterator[Conflict]:
    """A conflict where neither sin nor cos has an entry, nor an unknown key stands for them."""
    if not isinstance(raw, dict) or not set(raw) <= set(Force.model_fields):
        return
    if not raw.get("sin") and not raw.get("cos"):
        yield (), "has no harmonics", f"add sin: [..] or cos: [..], amplitudes of the harmonics ({unit})"


def wrong_load(load: Any, size: int | None) -> Iterator[Conflict]:
    """A conflict unless a load has one number a coordinate."""
    if isinstance(load, list) and size is not None and len(load) != size:
        yield ("load",), f"has {len(load)} entries", f"give {size}, one a coordinate"
