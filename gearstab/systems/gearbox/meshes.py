"""Sections of the meshes and planetary sets of a gearbox: how their teeth make a spring and rub; what does not fit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import Annotated, Any, ClassVar

from pydantic import Field

from gearstab.config.document import Document, mapping, nearest, sequence
from gearstab.config.model.conflicts import Conflict, below, items, within, within_each, wrong_length
from gearstab.config.model.fields import (
    Choice,
    Count,
    Inertia,
    Length,
    Mass,
    NameText,
    NonNegative,
    NonNegativeLength,
    Number,
    Quantity,
    Section,
    ToothCount,
    Turns,
    Whole,
    also,
    optional,
)
from gearstab.config.model.reading import WRONG, known, told
from gearstab.systems.forcing import GearError
from gearstab.systems.gearbox.bodies import Rotor, Support, Teeth
from gearstab.systems.gearbox.faults import Fault, absent_gear, excluded, fault_conflicts
from gearstab.systems.mesh import MEANS, Lag, Named, NamedToothMesh, StiffnessOfTeeth, ToothMesh
from gearstab.systems.planetary.parts import RULES
from gearstab.systems.planetary.planets import ASSEMBLE, MOST_PLANETS, assemble, assembly
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
MEMBERS = ("sun", "ring", "carrier")
"""Members of a planetary set, each a rotor."""
FAULTY = ("sun", "planet", "ring")
"""Gears of a planetary set."""
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


class Planets(Teeth):
    """The equal planets of a set; what is not given of their teeth is that of the sun's."""

    count: Annotated[Fraction, Count(of="planets"), Field(le=MOST_PLANETS)] = Field(title="number of planets")
    """N >= 3, equally spaced without angles."""
    teeth: ToothCount = Field(title="teeth of a planet")
    """z_p."""
    angles: list[Annotated[float, Quantity("rad")]] | None = optional(
        "angle of a planet", json_schema_extra=also({"const": ASSEMBLE})
    )
    """psi_n (rad, or with a unit), or assemble: the nearest to equal ones at which the teeth fit."""
    profile_shift: Number | None = None
    """x, in modules (1); closes the backlash without."""
    mass: Mass | None = optional("mass of a planet")
    """(kg); that of its disc without."""
    inertia: Inertia | None = optional("moment of inertia of a planet")
    """(kg m^2); that of its disc without."""
    bore_radius: NonNegativeLength | None = optional("radius of the bore")
    """Radius of the bore of a planet's disc (m)."""
    support: Support | None = optional("planet bearing")
    """Between each planet and the carrier; without, the planets' centres are fixed on it."""


class SetMesh(ToothMesh, TrainMeshKeys):
    """The meshes of the sun, or of the ring, with the planets. What is not given follows from the teeth."""

    misplaced: ClassVar[dict[str, str]] = {
        "name": "the meshes of a set are called NAME.sun.1, ... and NAME.ring.1, ...",
        "lag": "lags of a set follow from its teeth; give phases: {sun_ring: ..} to the set for that of the ring",
    }


class SetMeshes(Section):
    """Both kinds of meshes of a set."""

    sun: SetMesh = Field(default=SetMesh(), title="sun's meshes")
    """Each planet with the sun."""
    ring: SetMesh = Field(default=SetMesh(), title="ring's meshes")
    """Each planet with the ring."""


class SetPhases(Section):
    """The lag of the ring's meshes behind the sun's; the others follow from the teeth."""

    sun_ring: Turns | None = optional("phase of the ring's meshes")
    """gamma_sr (1); from teeth by the rule without."""
    rule: Annotated[str, Choice("rule", tuple(RULES))] | None = optional("rule of the ring's lag")
    """gamma_sr from entry to entry, the default, or from pitch_point to pitch_point."""


class SetFault(Fault):
    """A weak tooth of a gear of a set."""

    gear: Annotated[str, Choice("gear of a set", FAULTY)]
    """sun, planet or ring."""
    planet: Annotated[int, Field(ge=1), Whole] | None = optional("number of the planet")
    """Number of the planet with the weak tooth, from 1; 1 without."""
    flank: Annotated[str, Choice("mesh", ("sun", "ring"))] | None = optional("flank with the pit")
    """Mesh whose flank has the pit: the sun's or the ring's; sun without."""

    def of_planets(self, count: Fraction) -> Iterator[Conflict]:
        """A planet and a flank only of teeth of planets, of which there are ``count``."""
        for key in ("planet", "flank"):
            if self[key] is not None and self.gear != "planet":
                yield (key,), "not_applicable", f"a tooth of the {self.gear} has none", "remove it"
        if self.gear == "planet" and self.flank is not None and self.kind == "crack":
            yield ("flank",), "not_applicable", "a crack weakens both flanks", "remove it, or kind: pit"
        if self.planet is not None and self.planet > count:
            yield ("planet",), "out_of_range", f"there are {count} planets", f"write 1 to {count}"


class PlanetarySet(Named):
    """A sun, planets on a carrier and a ring; each member is a rotor of the train."""

    sun: NameText
    """Name of its rotor, an external gear."""
    ring: NameText
    """Name of its rotor, an internal gear."""
    carrier: NameText
    """Name of its rotor."""
    held: Annotated[str, Choice("held member", MEMBERS)] | None = optional("held member")
    """sun, ring or carrier, if one of them does not turn."""
    planets: Planets
    """Equal planets on the carrier."""
    centre_distance: Length | None = None
    """a (m); that of the profile shifts of sun and planet, else m (z_s + z_r)/4 without."""
    meshes: SetMeshes = SetMeshes()
    """Meshes of the sun and of the ring."""
    carrier_speed: Annotated[str, Choice("carrier speed", ("from_teeth",))] | None = None
    """from_teeth: with the gyroscopic and centripetal terms of the turning carrier; none without."""
    phases: SetPhases | None = optional("mesh phases")
    """How far the ring's meshes lag the sun's."""
    faults: list[SetFault] = Field(default=[])
    """Weak teeth of sun, planets and ring."""


def by_name(box: Any) -> dict[str, Rotor] | None:
    """Return the rotors by name; None where there are none, one has no name, or two have the same."""
    rotors = {rotor.name: rotor for _, rotor in items(box.rotors) if isinstance(rotor.name, str)}
    return rotors if len(rotors) == len(items(box.rotors)) > 0 else None


def set_conflicts(box: Any) -> Iterator[Conflict]:
    """Yield what contradicts itself in the planetary sets."""
    rotors = by_name(box)
    for k, item in items(box.planetary_sets):
        found = [*(() if rotors is None else known(_members(item, rotors))), *_meshes(item)]
        if not found and rotors is not None:
            found = list(known(_teeth(item, rotors)))
        yield from below("planetary_sets", below(k, found))


def _members(item: PlanetarySet, rotors: dict[str, Rotor]) -> Iterator[Conflict]:
    """Three different rotors, an external and an internal gear among them."""
    seen: dict[str, str] = {}
    for member in MEMBERS:
        name = item[member]
        if not isinstance(name, str):
            continue
        if name in seen:
            yield (member,), "inconsistent", f"'{name}' is the {seen[name]} already", "name another rotor"
        elif name not in rotors:
            yield (member,), "unknown_name", f"there is no rotor '{name}'", nearest(name, rotors)
        elif member != "carrier" and rotors[name].teeth is None:
            yield (member,), "not_applicable", f"rotor '{name}' has no teeth", "name a gear, or give the rotor teeth"
        elif member != "carrier" and rotors[name].internal != (member == "ring"):
            kind = "an internal" if member == "ring" else "an external"
            yield (member,), "inconsistent", f"rotor '{name}' is not {kind} gear", "set or remove internal: true there"
        seen[name] = member


def _meshes(item: PlanetarySet) -> Iterator[Conflict]:
    for name, mesh in items(item.meshes):
        yield from below("meshes", below(name, [*known(mesh.conflicts(True)), *known(relief_conflicts(mesh))]))
    phases = item.phases
    if phases is not None and phases is not WRONG and phases.rule is not None and phases.sun_ring is not None:
        yield ("phases", "rule"), "already_given", "sun_ring is given already", "keep one of sun_ring and rule"


def _teeth(item: PlanetarySet, rotors: dict[str, Rotor]) -> Iterator[Conflict]:
    """Yield what keeps planets of known teeth from being assembled."""
    planets = item.planets
    yield from below("planets", wrong_length(planets, "angles", int(planets.count), "planet"))
    if "support" in planets.model_fields_set and (planets.support is None or planets.support.stiffness is None):
        yield ("planets", "support", "stiffness"), "missing", "is missing", "add stiffness (N/m), or remove support"
    sun, ring = rotors[item.sun].teeth, rotors[item.ring].teeth
    if planets.angles is not None or sun is None or ring is None:
        return  # the fit of given angles is looked at where the train is built
    for path, code, message, hint in assembly(int(sun), int(planets.teeth), int(ring), planets.count):
        yield ("planets", path[-1] if path[-1] == "angles" else "teeth"), code, message, hint


def set_fault_conflicts(item: PlanetarySet, teeth: Mapping[str, Fraction | None]) -> Iterator[Conflict]:
    """Yield what contradicts itself in the ``faults`` of a set. teeth: of the rotors, by name."""
    counts = {
        "sun": told(lambda: teeth.get(item.sun)),
        "planet": told(lambda: item.planets.teeth),
        "ring": told(lambda: teeth.get(item.ring)),
    }
    yield from fault_conflicts(item, FAULTY, counts)
    yield from within_each(item, "faults", lambda fault: fault.of_planets(item.planets.count))


def complete_angles(document: Document, raw: dict[str, Any]) -> None:
    """Write out the angles that are to be assembled, in the section as written."""
    teeth = {str(item.get("name")): item.get("teeth") for item in map(mapping, sequence(raw.get("rotors")))}
    for k, item in enumerate(map(mapping, sequence(raw.get("planetary_sets")))):
        planets = mapping(item.get("planets"))
        place = ("system", "planetary_sets", k, "planets", "angles")
        sun, ring = (teeth.get(str(item.get(gear))) for gear in ("sun", "ring"))
        hint = "give count, and rotors for sun and ring their teeth"
        assemble(document, place, planets, (sun, ring, planets.get("count")), hint)
