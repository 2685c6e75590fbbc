"""Models of a tooth mesh: its stiffness, how much it varies, and when."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

from pydantic import Field

from gearstab.config.fields import Choice, ContactRatio, ExactRatio, NameText, NonNegative, Number, Quantity, Section
from gearstab.config.forcing import TransmissionError
from gearstab.config.problems import Path

Conflict = tuple[Path, str, str]
"""What contradicts itself: path below the section, message, remedy."""

MeshStiffness = Annotated[float, Field(gt=0), Quantity("N/m", ("N m",))]
"""Of a model in coordinates of its own, where a mesh may deflect as an angle."""


class Waveform(Section):
    """The shape of the mesh stiffness over its period."""

    kind: Annotated[str, Choice("waveform", ("rectangular",), ("trapezoidal", "fourier", "sampled", "tooth"))] = Field(
        default="rectangular",
        title="kind of waveform",
        description="rectangular: stiff for the fraction c - floor(c) of the period",
    )


class Named(Section):
    """Something in a list that is called by a name."""

    name: NameText = Field(title="name", description="What paths, labels and messages call the mesh; unique.")


class ToothMesh(Section):
    """A tooth mesh: a spring whose stiffness alternates between floor(c) and floor(c) + 1 pairs of teeth."""

    mean_stiffness: Annotated[float, Field(gt=0), Quantity("N/m")] | None = Field(
        default=None, title="mean mesh stiffness", description="Mean stiffness k_g, kept (N/m); or give max_stiffness."
    )
    max_stiffness: Annotated[float, Field(gt=0), Quantity("N/m")] | None = Field(
        default=None,
        title="stiffer level of the mesh stiffness",
        description="The stiffer level k_max, kept (N/m), so that k_g falls as k_a grows; or give mean_stiffness.",
    )
    epsilon: NonNegative | None = Field(
        default=None,
        title="relative mesh stiffness variation",
        description="epsilon = k_a/k_g, where 2 k_a is the peak-to-peak of the variation (1); or give amplitude.",
    )
    amplitude: Annotated[float, Field(ge=0), Quantity("N/m")] | None = Field(
        default=None,
        title="mesh stiffness amplitude",
        description="k_a, half the peak-to-peak of the variation (N/m); or give epsilon.",
    )
    contact_ratio: ContactRatio = Field(
        title="contact ratio",
        description="c >= 1: floor(c) + 1 pairs of teeth carry for the fraction c - floor(c) of the period (1).",
    )
    waveform: Waveform = Field(
        default=Waveform(kind="rectangular"),
        title="waveform",
        description="The shape of the variation over a mesh period.",
    )
    damping: Annotated[float, Field(ge=0), Quantity("N s/m")] | None = Field(
        default=None, title="mesh damping", description="Viscous damping along the line of action (N s/m)."
    )
    transmission_error: TransmissionError | None = Field(
        default=None,
        title="transmission error",
        description="Unloaded static transmission error e: the mesh is without force where its deflection is e (m).",
    )

    @classmethod
    def conflicts(cls, raw: dict[str, Any]) -> Iterator[Conflict]:
        """Exactly one of the two ways to give the stiffness, and of the two to give its variation."""
        for pair in (("mean_stiffness", "max_stiffness"), ("epsilon", "amplitude")):
            yield from exactly_one(raw, pair)
        for path, message, hint in TransmissionError.conflicts(raw.get("transmission_error")):
            yield ("transmission_error", *path), message, hint


class Mesh(ToothMesh, Named):
    """A tooth mesh with a name of its own."""

    misplaced: ClassVar[dict[str, str]] = {
        "phasing": "only the second mesh of a two_stage train has a phasing; in matrices give a lag",
        "lag": "only a mesh of matrices has a lag; the second mesh of a two_stage train has a phasing (a lead)",
    }


class SecondMesh(Mesh):
    """The second mesh of a two-stage train."""

    misplaced: ClassVar[dict[str, str]] = {"lag": "give a phasing, which is a lead: phasing = -lag"}

    phasing: Number = Field(
        default=0.0,
        title="mesh phasing",
        description="h: this mesh leads the first one by h of its own period (1; Lin & Parker 2002).",
    )


class MatrixMesh(Mesh):
    """A tooth mesh of a model given as matrices."""

    misplaced: ClassVar[dict[str, str]] = {"phasing": "give a lag, the opposite of a lead: lag = -phasing"}

    mean_stiffness: MeshStiffness | None = Field(
        default=None,
        title="mean mesh stiffness",
        description="Mean stiffness k_g, kept (N/m, or N m/rad of an angle); or give max_stiffness.",
    )
    max_stiffness: MeshStiffness | None = Field(
        default=None,
        title="stiffer level of the mesh stiffness",
        description="The stiffer level k_max, kept (N/m, N m/rad), so that k_g falls with k_a; or give mean_stiffness.",
    )
    amplitude: Annotated[float, Field(ge=0), Quantity("N/m", ("N m",))] | None = Field(
        default=None,
        title="mesh stiffness amplitude",
        description="k_a, half the peak-to-peak of the variation (N/m or N m/rad); or give epsilon.",
    )
    damping: Annotated[float, Field(ge=0), Quantity("N s/m", ("N m s",))] | None = Field(
        default=None, title="mesh damping", description="Viscous damping of the mesh deflection (N s/m or N m s/rad)."
    )
    direction: list[Annotated[float, Quantity("m")]] = Field(
        title="direction",
        min_length=1,
        description="g, the mesh deflection is g . q: 1 for a translation, a base radius (m) for a rotation.",
    )
    frequency_ratio: ExactRatio = Field(
        default=1,
        title="mesh frequency ratio",
        validate_default=True,
        description='Frequency of this mesh over that of the sweep, exact: 1, 0.5 or "1/2".',
    )
    lag: Number = Field(
        default=0.0, title="mesh lag", description="The wave begins this fraction of its own period late (1)."
    )


def exactly_one(raw: dict[str, Any], names: tuple[str, ...], what: str = "") -> Iterator[Conflict]:
    """A conflict unless exactly one of the keys is given."""
    given = [name for name in names if raw.get(name) is not None]
    either = " or ".join(names)
    if not given:
        yield (), f"{either} is missing", what or f"add {either}"
    for extra in given[1:]:
        yield (extra,), f"{given[0]} is given already", f"keep one of {', '.join(names)}"
