"""Excitation of a system: transmission errors of its meshes, a constant load, periodic forces."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Annotated, Any

import numpy as np
from pydantic import Field, GetJsonSchemaHandler

from gearstab.config.model.axes import given, vector
from gearstab.config.model.conflicts import Conflict, no_direction
from gearstab.config.model.fields import ExactRatio, NameText, Section, Turns, Vector, optional
from gearstab.config.model.units import Quantity
from gearstab.mesh import PeriodicForce
from gearstab.system import GearSystem
from gearstab.waveforms import Fourier

ErrorAmplitude = Annotated[float, Quantity("m", ("rad",), entry=True)]
ForceAmplitude = Annotated[float, Quantity("N", ("N m",), entry=True)]
Load = list[ForceAmplitude]
"""Constant generalised forces, one per coordinate."""


@dataclass(frozen=True)
class OneAsWell:
    """Lets the schema of a list admit its one entry by itself, which ``complete`` of a system makes a list.

    only: whether the list has no more than that one.
    """

    only: bool = False

    def __get_pydantic_json_schema__(self, schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        plain = handler(schema)
        return {"anyOf": [plain["items"], plain | ({"minItems": 1, "maxItems": 1} if self.only else {})]}


LoadOfOne = Annotated[Load, OneAsWell(only=True)]
"""Load of a system of one coordinate."""

MOST_HARMONICS = 100


class TransmissionError(Section):
    """The unloaded static transmission error of a mesh as a Fourier series over its period."""

    sin: list[ErrorAmplitude] = Field(
        default=[], max_length=MOST_HARMONICS, title="sine amplitudes of the transmission error"
    )
    """a_s of sin s x, s = 1, 2, ..., x = Omega_i t - 2 pi lag (m, or rad where the mesh turns)."""
    cos: list[ErrorAmplitude] = Field(
        default=[], max_length=MOST_HARMONICS, title="cosine amplitudes of the transmission error"
    )
    """b_s of cos s x, s = 1, 2, ... (m, or rad where the mesh turns)."""

    def conflicts(self) -> Iterator[Conflict]:
        """Yield a conflict without any harmonic."""
        yield from no_harmonics(self, "m")


class GearError(TransmissionError):
    """A transmission error that repeats with the revolution of a gear, as a Fourier series over it."""

    gear: NameText
    """Name of the gear that has it."""


class Force(Section):
    """A periodic external force, given by its Fourier series."""

    name: NameText | None = optional("name of the force")
    """Name of the force in messages."""
    direction: Vector = Field(title="direction of the force")
    """u, the force acts as u times its value: one number per coordinate, or {coordinate: value} (1)."""
    sin: list[ForceAmplitude] = Field(default=[], max_length=MOST_HARMONICS, title="sine amplitudes of the force")
    """Amplitudes of sin s x, s = 1, 2, ..., x = r Omega t - 2 pi lag (N, or N m of a rotation)."""
    cos: list[ForceAmplitude] = Field(default=[], max_length=MOST_HARMONICS, title="cosine amplitudes of the force")
    """Amplitudes of cos s x, s = 1, 2, ... (N, or N m of a rotation)."""
    frequency_ratio: ExactRatio = Field(default=Fraction(1), title="frequency ratio of the force")
    """r, its frequency over the mesh frequency of the sweep, exact: 1, 0.5 or "1/2"."""
    lag: Turns = Field(default=0.0, title="lag of the force")
    """It begins this fraction of its own period late (1)."""

    def conflicts(self, size: int | None) -> Iterator[Conflict]:
        """Yield conflicts without any harmonic, and of a direction that is zero or not of the size of the system."""
        yield from no_harmonics(self, "N")
        yield from no_direction(self, "direction", size, "let the force act on at least one coordinate")


def no_harmonics(series: TransmissionError | Force, unit: str) -> Iterator[Conflict]:
    """A conflict where neither sin nor cos has an entry, nor an unknown key stands for them."""
    if series.model_fields_set <= {*Force.model_fields, *GearError.model_fields} and not series.sin and not series.cos:
        yield (), "missing", "has no harmonics", f"add sin: [..] or cos: [..], amplitudes of the harmonics ({unit})"


def with_forcing(system: GearSystem, p: Any) -> GearSystem:
    """The system with what drives it.

    ``load``: constant generalised forces, one per coordinate; ``forces``: periodic ones, each a ``direction`` and a
    Fourier series ``sin``, ``cos`` with ``frequency_ratio`` and ``lag``; ``transmission_error`` of a mesh: ``sin``,
    ``cos``. A transmission error acts through the mesh's own damping too. ``backlash`` of a mesh, 2 b, and its
    ``backlash_zero``, which only the response heeds, come with it.
    """
    meshes = tuple(
        replace(
            item,
            transmission_error=None if part.transmission_error is None else Fourier.build(part.transmission_error),
            damping=np.asarray(part.damping, dtype=float) if _constant_damping(part) else 0.0,
            backlash=np.asarray(part.backlash, dtype=float) if given(part.backlash) else 0.0,
            backlash_zero=part.backlash_zero,
        )
        for part, item in zip(p.meshes, system.meshes, strict=True)
    )
    forces = tuple(
        PeriodicForce(
            part.name or f"force{i + 1}", vector(part.direction), Fourier.build(part),
            part.frequency_ratio, np.asarray(part.lag, dtype=float),
        )
        for i, part in enumerate(getattr(p, "forces", ()))
    )  # fmt: skip
    load = None if getattr(p, "load", None) is None else vector(p.load)
    return replace(system, meshes=meshes, forces=forces, load=load)


def _constant_damping(mesh: Any) -> bool:
    return given(mesh.damping) and not mesh.damping_follows_stiffness
