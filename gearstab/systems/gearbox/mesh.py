"""A mesh of a gearbox: two gears, what their teeth are worth as a spring, and how they rub."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

from pydantic import Field

from gearstab.config.model.conflicts import Conflict, at_most_one, within
from gearstab.config.model.fields import (
    Choice,
    Length,
    NameText,
    NonNegative,
    NonNegativeLength,
    Quantity,
    Section,
    Stiffness,
)
from gearstab.systems.parts.faults import Fault
from gearstab.systems.parts.forcing import TransmissionError
from gearstab.systems.parts.mesh import Lag, NamedToothMesh, following_conflicts
from gearstab.waveforms import WAVEFORMS
from gearstab.waveforms.section import has_own_mean, shape_conflicts, wave_of

MEAN, VARIATION, CONTACT_RATIO, WAVE = "mean", "variation", "contact_ratio", "wave"
"""What of a mesh stiffness may follow from the teeth."""
FRICTIONS = {
    "constant": ("coefficient",),
    "xu_kahraman": ("viscosity", "roughness"),
    "benedict_kelley": ("viscosity", "roughness"),
}
"""Laws of friction and the keys they need."""
LUBRICATED = ("xu_kahraman", "benedict_kelley")
"""Those that depend on speed and load."""


class Friction(Section):
    """Sliding friction between the teeth of a mesh."""

    kind: Annotated[str, Choice("law of friction", tuple(FRICTIONS))] = Field(
        default="constant",
        title="law of friction",
        description="constant; xu_kahraman (2007) and benedict_kelley (1961) for lubricated teeth.",
    )
    coefficient: NonNegative | None = Field(
        default=None, title="coefficient of friction", description="constant: mu (1)."
    )
    viscosity: Annotated[float, Field(gt=0), Quantity("Pa s")] | None = Field(
        default=None, title="viscosity", description='Dynamic, of the oil at the inlet (Pa s, "10 mPa s").'
    )
    roughness: NonNegativeLength | None = Field(
        default=None, title="roughness", description='Of the flanks, root mean square (m, "0.4 um").'
    )

    @classmethod
    def conflicts(cls, raw: dict[str, Any]) -> Iterator[Conflict]:
        """The keys of its law and no others."""
        kind = raw.get("kind", "constant")
        needed = FRICTIONS.get(kind)
        if needed is None:
            return
        for key in needed:
            if raw.get(key) is None:
                yield (key,), "missing", "is missing", f"add {key}, which {kind} friction needs"
        for key in ("coefficient", "viscosity", "roughness"):
            if raw.get(key) is not None and key not in needed:
                yield (key,), "not_applicable", f"{kind} friction takes no {key}", "remove it, or choose another law"


class GearboxMesh(NamedToothMesh):
    """A mesh of two gears. What is not given of its stiffness follows from the teeth."""

    misplaced: ClassVar[dict[str, str]] = {"phasing": "give a lag, the opposite of a lead: lag = -phasing"}

    gears: Annotated[list[NameText], Field(min_length=2, max_length=2)] = Field(
        title="gears", description="Names of the driver and of the driven gear."
    )
    position: Annotated[float, Quantity("rad")] = Field(
        default=0.0,
        title="position of the driven gear",
        description="psi: angle of the line from the driver's centre to the driven gear's (rad, \"90 deg\").",
    )
    centre_distance: Length | None = Field(
        default=None, title="centre distance", description="C (m); that of a mesh without backlash, if not given."
    )
    lag: Lag = Field(
        default=0.0, title="mesh lag", description="A pair of teeth enters this fraction of the mesh period late (1)."
    )
    damping_ratio: NonNegative | None = Field(
        default=None,
        title="damping ratio of the mesh",
        description="zeta, c = 2 zeta sqrt(k m_e), m_e = J1 J2/(r1^2 J2 + r2^2 J1) (1); or give damping.",
    )
    reduction: Annotated[str, Choice("reduction", ("levels", "peak-to-peak", "first harmonic"))] = Field(
        default="levels",
        title="reduction of the teeth's stiffness",
        description="What a rectangular wave keeps of it: levels, the mean with fewer and with more pairs in contact; "
        "its peak-to-peak; or its first harmonic.",
    )
    double_contact_factor: Annotated[float, Field(gt=0.5, le=1), Quantity()] = Field(
        default=1.0,
        title="double contact factor",
        description="Stiffness of two pairs over the sum of theirs (1): teeth on one body deflect each other.",
    )
    single_pair_stiffness: Stiffness | None = Field(
        default=None, title="measured stiffness of a pair", description="In contact at the pitch point (N/m)."
    )
    variation: NonNegative | None = Field(
        default=None, title="measured variation", description="(max k - min k)/mean k of the mesh stiffness (1)."
    )
    friction: Friction | None = Field(default=None, title="friction", description="Between the teeth; none without.")
    faults: list[Fault] = Field(default=[], title="faults", description="Weak teeth of either gear.")

    @classmethod
    def conflicts(cls, raw: dict[str, Any]) -> Iterator[Conflict]:
        """Each quantity once; a wave that is complete where the teeth do not give it."""
        yield from at_most_one(raw, ("mean_stiffness", "max_stiffness"))
        yield from at_most_one(raw, ("epsilon", "amplitude"))
        yield from at_most_one(raw, ("damping", "damping_ratio"))
        yield from shape_conflicts(raw)
        wave = wave_of(raw.get("waveform"))
        if wave is not None and wave.of_teeth:
            for key in ("mean_stiffness", "max_stiffness", "epsilon", "amplitude", "contact_ratio"):
                if raw.get(key) is not None:
                    remedy = "remove it, or choose waveform: {kind: rectangular}; measured values are "
                    yield (key,), "already_given", "the teeth give it", f"{remedy}single_pair_stiffness and variation"
        yield from following_conflicts(
            raw, ("damping", "damping_ratio"), "add damping_ratio or damping, the mean of the damping that follows"
        )
        yield from within(raw, "transmission_error", TransmissionError.conflicts)
        if raw.get("friction") is not None and raw.get("backlash"):
            yield (
                ("backlash",),
                "not_applicable",
                "is not available with friction between the teeth",
                "keep one of the two",
            )
        yield from within(raw, "friction", Friction.conflicts)


def from_teeth(p: Any) -> frozenset[str]:
    """Return which of MEAN, VARIATION, CONTACT_RATIO, WAVE the teeth of a mesh with these parameters give."""
    wave = WAVEFORMS[(p.get("waveform") or {}).get("kind", "rectangular")]
    if wave.of_teeth:
        return frozenset((MEAN, VARIATION, CONTACT_RATIO, WAVE))
    found = set()
    if not has_own_mean(p) and p.get("mean_stiffness") is None and p.get("max_stiffness") is None:
        found.add(MEAN)
    if not wave.own_variation and p.get("epsilon") is None and p.get("amplitude") is None:
        found.add(VARIATION)
    if wave.has_contact_ratio and p.get("contact_ratio") is None:
        found.add(CONTACT_RATIO)
    return frozenset(found)


def needs_width(p: Any) -> bool:
    """Whether the face widths of the gears of a mesh matter."""
    rubs = (p.get("friction") or {}).get("kind", "constant") != "constant"
    return rubs or (MEAN in from_teeth(p) and p.get("single_pair_stiffness") is None)
