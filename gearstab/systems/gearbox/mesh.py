"""A mesh of a gearbox: two gears, what their teeth are worth as a spring, and how they rub."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

from pydantic import Field

from gearstab.config.document.problems import nearest
from gearstab.config.model.conflicts import Conflict, at_most_one, below, items, within
from gearstab.config.model.fields import (
    Choice,
    Length,
    NameText,
    NonNegative,
    NonNegativeLength,
    Quantity,
    Section,
)
from gearstab.systems.parts.faults import Fault
from gearstab.systems.parts.forcing import GearError, TransmissionError
from gearstab.systems.parts.mesh import Lag, NamedToothMesh, StiffnessOfTeeth, following_conflicts, given_by_teeth
from gearstab.waveforms import WAVEFORMS
from gearstab.waveforms.section import has_own_mean, shape_conflicts

MEAN, VARIATION, CONTACT_RATIO, WAVE = "mean", "variation", "contact_ratio", "wave"
"""Parts of a mesh stiffness that may follow from the teeth."""
FRICTIONS = {
    "constant": ("coefficient",),
    "xu_kahraman": ("viscosity", "roughness"),
    "benedict_kelley": ("viscosity", "roughness"),
}
"""Laws of friction and the keys they need."""
LUBRICATED = ("xu_kahraman", "benedict_kelley")
"""Laws of friction that depend on speed and load."""


POWERS = {"linear": 1, "parabolic": 2}
"""Forms of profile relief, and how its depth grows with the distance from where it begins."""
NOT_WITH_RELIEF = (
    "mean_stiffness", "max_stiffness", "stiffness_per_width", "epsilon", "amplitude", "contact_ratio", "variation",
    "friction", "backlash",
)  # fmt: skip
"""Keys of a mesh whose place relief takes, or for which it is not computed."""


class ProfileRelief(Section):
    """Material taken off the tips, or the roots, of both gears of a mesh."""

    amount: Length = Field(title="amount of relief", description='C_a, at the end of the flank (m, "20 um").')
    length: Length = Field(
        title="length of relief", description='l, along the path of contact from the end of the flank (m, "2 mm").'
    )
    form: Annotated[str, Choice("form", tuple(POWERS))] = Field(
        default="linear", title="form of relief", description="C_a (s/l)^p beyond its start: linear p = 1, parabolic 2."
    )


class MeshRelief(Section):
    """Profile relief, which makes the stiffness of a mesh depend on its load."""

    tip: ProfileRelief | None = Field(default=None, title="tip relief", description="Of both gears.")
    root: ProfileRelief | None = Field(default=None, title="root relief", description="Of both gears.")


class TrainMeshKeys(StiffnessOfTeeth):
    """What a mesh of two gears and those of a planetary set take alike."""

    damping_ratio: NonNegative | None = Field(
        default=None,
        title="damping ratio of the mesh",
        description="zeta, c = 2 zeta sqrt(k m_e), m_e = J1 J2/(r1^2 J2 + r2^2 J1) (1); or give damping.",
    )
    stiffness_per_width: Annotated[float, Field(gt=0), Quantity("N/m^2")] | None = Field(
        default=None,
        title="mesh stiffness per face width",
        description='c_gamma, the mean over the common face width (N/m^2, "20 N/(mm um)"); or give mean_stiffness.',
    )
    relief: MeshRelief | None = Field(
        default=None,
        title="profile relief",
        description="Stiffness, of the teeth, and transmission error are those under the given torques; none without.",
    )


def relief_conflicts(raw: dict[str, Any]) -> Iterator[Conflict]:
    """Yield what does not go with the relief of a mesh."""
    relief = raw.get("relief")
    if relief is None:
        return
    if isinstance(relief, dict) and not {"tip", "root"} & {key for key, value in relief.items() if value is not None}:
        yield ("relief",), "missing", "takes nothing off", "add tip or root: {amount: 20 um, length: 2 mm}"
    for key in NOT_WITH_RELIEF:
        if raw.get(key) is not None:
            yield (key,), "not_applicable", "is not available with relief", f"remove {key} or relief"
    if raw.get("double_contact_factor") not in (None, 1):
        message = "is not available with relief, which needs the stiffness of each pair by itself"
        yield ("double_contact_factor",), "not_applicable", message, "remove it, or relief"
    wave = (raw.get("waveform") or {}).get("kind", "rectangular")
    if wave not in ("rectangular", "tooth"):
        message = f"relief changes the wave of the teeth, which {wave} is none of"
        yield ("waveform", "kind"), "not_applicable", message, "choose tooth or rectangular, or remove relief"


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


class GearboxMesh(NamedToothMesh, TrainMeshKeys):
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
    reduction: Annotated[str, Choice("reduction", ("levels", "peak-to-peak", "first harmonic"))] = Field(
        default="levels",
        title="reduction of the teeth's stiffness",
        description="What a rectangular wave keeps of it: levels, the mean with fewer and with more pairs in contact; "
        "its peak-to-peak; or its first harmonic.",
    )
    friction: Friction | None = Field(default=None, title="friction", description="Between the teeth; none without.")
    faults: list[Fault] = Field(default=[], title="faults", description="Weak teeth of either gear.")
    revolution_errors: list[GearError] = Field(
        default=[], title="errors of revolutions", description="Eccentricity and pitch errors of either gear."
    )

    @classmethod
    def conflicts(cls, raw: dict[str, Any]) -> Iterator[Conflict]:
        """Each quantity once; a wave that is complete where the teeth do not give it."""
        yield from at_most_one(raw, ("mean_stiffness", "max_stiffness", "stiffness_per_width"))
        yield from at_most_one(raw, ("epsilon", "amplitude"))
        yield from at_most_one(raw, ("damping", "damping_ratio"))
        yield from shape_conflicts(raw)
        yield from given_by_teeth(raw)
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
        yield from revolution_conflicts(raw)
        yield from relief_conflicts(raw)


def revolution_conflicts(raw: dict[str, Any]) -> Iterator[Conflict]:
    """Yield errors of gears that are not in the mesh, without harmonics, and what does not go with them."""
    gears = [name for _, name in items(raw.get("gears")) if isinstance(name, str)]
    for k, item in items(raw.get("revolution_errors")):
        gear = item.get("gear")
        if isinstance(gear, str) and gear not in gears:
            message, place = f"'{gear}' is no gear of this mesh", ("revolution_errors", k, "gear")
            yield place, "unknown_name", message, nearest(gear, gears)
        waves = {key: value for key, value in item.items() if key != "gear"}
        yield from below("revolution_errors", below(k, GearError.conflicts(waves)))
        for key in ("friction", "backlash", "relief", "damping_follows_stiffness"):
            if raw.get(key):
                yield (key,), "not_applicable", "is not available with revolution_errors", "keep one of the two"


def from_teeth(p: Any) -> frozenset[str]:
    """Return which of MEAN, VARIATION, CONTACT_RATIO, WAVE the teeth of a mesh with these parameters give."""
    wave = WAVEFORMS[(p.get("waveform") or {}).get("kind", "rectangular")]
    if wave.of_teeth:
        return frozenset((MEAN, VARIATION, CONTACT_RATIO, WAVE))
    found = set()
    own = has_own_mean(p) or p.get("mean_stiffness") is not None or p.get("max_stiffness") is not None
    if not own or p.get("stiffness_per_width") is not None:
        found.add(MEAN)
    if not wave.own_variation and p.get("epsilon") is None and p.get("amplitude") is None:
        found.add(VARIATION)
    if wave.has_contact_ratio and p.get("contact_ratio") is None:
        found.add(CONTACT_RATIO)
    return frozenset(found)


def needs_width(p: Any) -> bool:
    """Whether the face widths of the gears of a mesh matter."""
    rubs = (p.get("friction") or {}).get("kind", "constant") != "constant"
    measured = p.get("single_pair_stiffness") is not None and p.get("stiffness_per_width") is None
    return rubs or (MEAN in from_teeth(p) and not measured)
