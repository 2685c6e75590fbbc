"""The section ``methods``."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field

from gearstab.config.model.fields import (
    Choice,
    Flag,
    NonNegative,
    Quantity,
    Section,
    Whole,
    wrong,
)

Tolerance = Annotated[float, Field(gt=0, lt=1), Quantity()]
Harmonics = Annotated[int, Field(ge=1, le=1000), Whole()]
ModeNumber = Annotated[int, Field(ge=1), Whole()]


def _each_once(modes: list[int]) -> list[int]:
    """Ascending; raises a pydantic error where a mode is named twice."""
    if len(set(modes)) < len(modes):
        raise wrong("modes", "names a mode twice", "name each mode once")
    return sorted(modes)


def _deflection_type(value: Any) -> Any:
    """T or a name; raises a pydantic error."""
    if isinstance(value, bool) or not isinstance(value, int | str) or (isinstance(value, int) and value < 0):
        raise wrong("deflection_type", "must be a type of mesh deflection", "write T = 0, 1, 2, ... or a type's name")
    return value


DeflectionType = Annotated[int | str, BeforeValidator(_deflection_type)]


class LyapunovOptions(Section):
    """The largest Lyapunov exponent, for mesh frequencies without a common period."""

    cycles: Annotated[float, Field(ge=20, le=1e7), Quantity()] = Field(
        default=500, title="cycles", description="Length of the window in periods of the slowest mesh (1)."
    )
    confidence: Annotated[float, Field(gt=0.5, lt=1), Quantity()] = Field(
        default=0.95, title="confidence", description="Of the interval of the growth rate (1)."
    )
    seed: Annotated[int, Field(ge=0, le=2**32), Whole()] = Field(
        default=0, title="seed", description="Of the random part of the start vectors."
    )


class FloquetOptions(Section):
    """Exact stability at every point of the grid."""

    exponents: Flag = Field(
        default=False, title="exponents", description="Store all characteristic exponents, not only the growth rate."
    )
    tolerance: Tolerance = Field(
        default=1e-9,
        title="tolerance",
        description="Of the multipliers, for waves that are not piecewise constant (1).",
    )
    block: DeflectionType | None = Field(
        default=None,
        title="block",
        description="Restrict the system to one type of mesh deflection, of a system with cyclic symmetry: "
        "T = 0, 1, 2, ... or its name; default all.",
    )
    modes: Annotated[list[ModeNumber], AfterValidator(_each_once)] | None = Field(
        default=None,
        min_length=1,
        title="modes",
        description="Restrict the system to these modes, numbered from 1 by ascending natural frequency; default all.",
    )
    frequencies: Annotated[str, Choice("way", ("auto", "common_period", "per_mesh", "lyapunov"))] = Field(
        default="auto",
        title="many mesh frequencies",
        description="common_period: exact; per_mesh: one frequency at a time, the others at their mean; lyapunov: "
        "largest Lyapunov exponent with a confidence interval; auto: exact while affordable.",
    )
    affordable_segments: Annotated[int, Field(ge=1, le=10_000_000), Whole()] = Field(
        default=20_000,
        title="affordable segments",
        description="A common period of more segments is not the automatic choice.",
    )
    lyapunov: LyapunovOptions = Field(
        default=LyapunovOptions(), title="lyapunov", description="How Lyapunov exponents are estimated."
    )


class PerturbationOptions(Section):
    """Instability boundaries by perturbation theory."""

    order: Annotated[int, Choice("order", (1, 2))] = Field(
        default=1,
        title="order",
        description="Order of the expansion in epsilon: 1 gives straight boundaries; 2 also shifts and curves them, "
        "opens tongues by products of harmonics, and estimates the error.",
    )
    harmonics: Harmonics = Field(default=3, title="harmonics", description="Up to which harmonic of each mesh.")


class UncoupledOptions(Section):
    """Uncoupled Mathieu equations (Benton & Seireg 1980), to compare with."""

    harmonics: Harmonics = Field(
        default=3, title="harmonics", description="Up to which harmonic of the mesh stiffness."
    )


class BoundariesOptions(Section):
    """Edges of all instability regions over the range of the mesh frequency, by root finding."""

    tolerance: Tolerance = Field(
        default=1e-10, title="tolerance", description="Of an edge, relative to the mesh frequency (1)."
    )
    width_floor: Tolerance = Field(
        default=1e-6,
        title="width floor",
        description="Regions narrower than this, relative to the mesh frequency, may be left out (1).",
    )


class ResponseOptions(Section):
    """The periodic steady state of a driven system at every point of the grid."""

    samples_per_cycle: Annotated[int, Field(ge=8, le=100_000), Whole()] = Field(
        default=100,
        title="samples per cycle",
        description="Samples in a period of the first mesh, between which a polynomial gives the extremes.",
    )
    tolerance: Tolerance = Field(
        default=1e-9,
        title="tolerance",
        description="Of the motion over a period, for waves that are not piecewise constant (1).",
    )
    continuation: Annotated[str, Choice("direction", ("up", "down"))] | None = Field(
        default=None,
        title="continuation",
        description="With backlash: up or down in the mesh frequency, every motion beginning where the one before led.",
    )
    cycles: Annotated[float, Field(gt=0, le=1e6), Quantity()] | None = Field(
        default=None,
        title="cycles",
        description="With backlash: how long every motion is followed, in periods of the first mesh (1).",
    )
    discard: NonNegative | None = Field(
        default=None,
        title="cycles left out",
        description="With backlash: how many of the cycles are left for the motion to settle; default half of them.",
    )


class RequiredDampingOptions(Section):
    """The smallest damping that makes every point of the grid stable."""

    of: Annotated[str, Choice("kind of damping", ("damping_ratio", "factor"))] = Field(
        default="damping_ratio",
        title="of",
        description="damping_ratio: one modal damping ratio for all modes, in place of the damping given; factor: on "
        "the damping given.",
    )
    largest: Annotated[float, Field(gt=0, le=1e6), Quantity()] | None = Field(
        default=None,
        title="largest damping",
        description="Where the search ends (1); default a damping ratio of 0.5, or a factor of 100.",
    )
    tolerance: Tolerance = Field(default=1e-6, title="tolerance", description="Of the required damping, relative (1).")
    frequencies: Annotated[str, Choice("way", ("auto", "common_period", "per_mesh"))] = Field(
        default="auto",
        title="many mesh frequencies",
        description="common_period: exact; per_mesh: one frequency at a time, the others at their mean; auto: exact "
        "while affordable.",
    )


class Methods(Section):
    """What is computed at every point of the grid; a method that is not named is not run."""

    floquet: FloquetOptions | None = Field(
        default=None, title="floquet", description="Exact stability at every point of the grid."
    )
    perturbation: PerturbationOptions | None = Field(
        default=None, title="perturbation", description="Boundaries by perturbation theory."
    )
    uncoupled: UncoupledOptions | None = Field(
        default=None, title="uncoupled", description="Uncoupled Mathieu equations, to compare with."
    )
    required_damping: RequiredDampingOptions | None = Field(
        default=None, title="required damping", description="The smallest damping that makes every point stable."
    )
    boundaries: BoundariesOptions | None = Field(
        default=None, title="boundaries", description="Edges of all instability regions."
    )
    response: ResponseOptions | None = Field(
        default=None, title="response", description="Peaks and load factors of the steady state of a driven system."
    )

    @property
    def chosen(self) -> tuple[str, ...]:
        """Names of the methods to run."""
        return tuple(name for name in type(self).model_fields if getattr(self, name) is not None)
