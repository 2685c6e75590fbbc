"""A mesh of a gearbox: two gears, what their teeth are worth as a spring, and how they rub."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

from pydantic import Field

from gearstab.config.model.conflicts import Conflict, below, items, within
from gearstab.config.model.fields import (
    Choice,
    Length,
    NameText,
    NonNegative,
    NonNegativeLength,
    Quantity,
    Section,
    optional,
)
from gearstab.config.model.reading import WRONG, known
from gearstab.systems.parts.faults import Fault, absent_gear, excluded
from gearstab.systems.parts.forcing import GearError
from gearstab.systems.parts.mesh import MEANS, Lag, NamedToothMesh, StiffnessOfTeeth
from gearstab.waveforms import WAVEFORMS
from gearstab.waveforms.section import has_own_mean

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
    *MEANS, "epsilon", "amplitude", "contact_ratio", "variation",
    "friction", "backlash",
)  # fmt: skip
"""Keys of a mesh whose place relief takes, or for which it is not computed."""


class ProfileRelief(Section):
    """Material taken off the tips, or the roots, of both gears of a mesh."""

    amount: Length = Field(title="amount of relief")
    """C_a, at the end of the flank (m, "20 um")."""
    length: Length = Field(title="length of relief")
    """l, along the path of contact from the end of the flank (m, "2 mm")."""
    form: Annotated[str, Choice("form", tuple(POWERS))] = Field(default="linear", title="form of relief")
    """C_a (s/l)^p beyond its start: linear p = 1, parabolic 2."""


class MeshRelief(Section):
    """Profile relief, which makes the stiffness of a mesh depend on its load."""

    tip: ProfileRelief | None = optional("tip relief")
    """Tip relief of both gears."""
    root: ProfileRelief | None = optional("root relief")
    """Root relief of both gears."""


class TrainMeshKeys(StiffnessOfTeeth):
    """Keys that a mesh of two gears and those of a planetary set share."""

    damping_ratio: NonNegative | None = optional("damping ratio of the mesh")
    """zeta, c = 2 zeta sqrt(k m_e), m_e = J1 J2/(r1^2 J2 + r2^2 J1) (1); or give damping."""
    stiffness_per_width: Annotated[float, Field(gt=0), Quantity("N/m^2")] | None = optional(
        "mesh stiffness per face width"
    )
    """c_gamma, the mean over the common face width (N/m^2, "20 N/(mm um)"); or give mean_stiffness."""
    relief: MeshRelief | None = optional("profile relief")
    """Stiffness, of the teeth, and transmission error are those under the given torques; none without."""


def relief_conflicts(mesh: Any) -> Iterator[Conflict]:
    """Yield what does not go with the relief of a mesh."""
    relief = mesh.relief
    if relief is None:
        return
    if relief is not WRONG and relief.tip is None and relief.root is None:
        yield ("relief",), "missing", "takes nothing off", "add tip or root: {amount: 20 um, length: 2 mm}"
    for key in NOT_WITH_RELIEF:
        if getattr(mesh, key, None) is not None:
            yield (key,), "not_applicable", "is not available with relief", f"remove {key} or relief"
    factor = mesh.double_contact_factor
    if factor is not WRONG and factor not in (None, 1):
        message = "is not available with relief, which needs the stiffness of each pair by itself"
        yield ("double_contact_factor",), "not_applicable", message, "remove it, or relief"
    wave = mesh.waveform.kind
    if wave not in ("rectangular", "tooth"):
        message = f"relief changes the wave of the teeth, which {wave} is none of"
        yield ("waveform", "kind"), "not_applicable", message, "choose tooth or rectangular, or remove relief"


class Friction(Section):
    """Sliding friction between the teeth of a mesh."""

    kind: Annotated[str, Choice("law of friction", tuple(FRICTIONS))] = Field(
        default="constant", title="law of friction"
    )
    """constant; xu_kahraman (2007) and benedict_kelley (1961) for lubricated teeth."""
    coefficient: NonNegative | None = optional("coefficient of friction")
    """constant: mu (1)."""
    viscosity: Annotated[float, Field(gt=0), Quantity("Pa s")] | None = None
    """Dynamic, of the oil at the inlet (Pa s, "10 mPa s")."""
    roughness: NonNegativeLength | None = None
    """Roughness of the flanks, root mean square (m, "0.4 um")."""

    def conflicts(self) -> Iterator[Conflict]:
        """The keys of its law and no others."""
        kind = self.kind
        needed = FRICTIONS[kind]
        for key in needed:
            if self[key] is None:
                yield (key,), "missing", "is missing", f"add {key}, which {kind} friction needs"
        for key in ("coefficient", "viscosity", "roughness"):
            if self[key] is not None and key not in needed:
                yield (key,), "not_applicable", f"{kind} friction takes no {key}", "remove it, or choose another law"


class GearboxMesh(NamedToothMesh, TrainMeshKeys):
    """A mesh of two gears. What is not given of its stiffness follows from the teeth."""

    misplaced: ClassVar[dict[str, str]] = {"phasing": "give a lag, the opposite of a lead: lag = -phasing"}

    gears: Annotated[list[NameText], Field(min_length=2, max_length=2)]
    """Names of the driver and of the driven gear."""
    position: Annotated[float, Quantity("rad")] = Field(default=0.0, title="position of the driven gear")
    """psi: angle of the line from the driver's centre to the driven gear's (rad, "90 deg")."""
    centre_distance: Length | None = None
    """C (m); that of a mesh without backlash, if not given."""
    lag: Lag = Field(default=0.0, title="mesh lag")
    """A pair of teeth enters this fraction of the mesh period late (1)."""
    reduction: Annotated[str, Choice("reduction", ("levels", "peak-to-peak", "first harmonic"))] = Field(
        default="levels", title="reduction of the teeth's stiffness"
    )
    """Feature of the stiffness that a rectangular wave keeps: levels, the mean with fewer and with more pairs in
    contact; its peak-to-peak; or its first harmonic."""
    friction: Friction | None = None
    """Between the teeth; none without."""
    faults: list[Fault] = Field(default=[])
    """Weak teeth of either gear."""
    revolution_errors: list[GearError] = Field(default=[], title="errors of revolutions")
    """Eccentricity and pitch errors of either gear."""

    def conflicts(self, from_teeth: bool = True) -> Iterator[Conflict]:
        """Friction, errors and relief, besides what every mesh has."""
        yield from super().conflicts(from_teeth)
        if self.friction is not None and self.backlash:
            hint = "keep one of the two"
            yield ("backlash",), "not_applicable", "is not available with friction between the teeth", hint
        yield from within(self, "friction", Friction.conflicts)
        yield from known(self._of_revolutions())
        yield from relief_conflicts(self)

    def _of_revolutions(self) -> Iterator[Conflict]:
        """Errors of revolutions of gears that are in the mesh, with harmonics, and what goes with them."""
        errors = items(self.revolution_errors)
        for k, item in errors:
            rules = (*known(absent_gear(item, self.gears)), *known(item.conflicts()))
            yield from below("revolution_errors", below(k, rules))
        if errors:
            keys = ("friction", "backlash", "relief", "damping_follows_stiffness")
            yield from excluded(self, keys, "revolution_errors")


def per_width(p: Any) -> Any:
    """Return the given stiffness per face width of a mesh, None also of a mesh that takes none."""
    return getattr(p, "stiffness_per_width", None)


def from_teeth(p: Any) -> frozenset[str]:
    """Return which of MEAN, VARIATION, CONTACT_RATIO, WAVE the teeth of a mesh with these parameters give."""
    wave = WAVEFORMS[p.waveform.kind]
    if wave.of_teeth:
        return frozenset((MEAN, VARIATION, CONTACT_RATIO, WAVE))
    found = set()
    own = has_own_mean(p) or p.mean_stiffness is not None or p.max_stiffness is not None
    if not own or per_width(p) is not None:
        found.add(MEAN)
    if not wave.own_variation and p.epsilon is None and p.amplitude is None:
        found.add(VARIATION)
    if wave.has_contact_ratio and p.contact_ratio is None:
        found.add(CONTACT_RATIO)
    return frozenset(found)


def needs_width(p: Any) -> bool:
    """Whether the face widths of the gears of a mesh matter."""
    rubs = getattr(p, "friction", None) is not None and p.friction.kind != "constant"
    measured = p.single_pair_stiffness is not None and per_width(p) is None
    return rubs or (MEAN in from_teeth(p) and not measured)
