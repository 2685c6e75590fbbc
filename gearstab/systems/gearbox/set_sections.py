"""Sections of the planetary sets of a gearbox, and what contradicts itself in them."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import Annotated, Any, ClassVar

from pydantic import Field

from gearstab.config.document.problems import Path, nearest
from gearstab.config.document.tree import mapping, sequence
from gearstab.config.document.yaml import Document
from gearstab.config.model.conflicts import Conflict, at_most_one, below, items, wrong_length
from gearstab.config.model.fields import (
    Choice,
    Count,
    Inertia,
    Length,
    Mass,
    NameText,
    NonNegativeLength,
    Number,
    Quantity,
    Section,
    ToothCount,
    Turns,
    Whole,
    also,
)
from gearstab.systems.gearbox.bodies import Support, Teeth
from gearstab.systems.gearbox.mesh import TrainMeshKeys, relief_conflicts
from gearstab.systems.parts.faults import Fault, fault_conflicts
from gearstab.systems.parts.mesh import Named, ToothMesh
from gearstab.systems.planetary import angles
from gearstab.systems.planetary.angles import ASSEMBLE
from gearstab.systems.planetary.feasibility import MOST_PLANETS, assembly, whole
from gearstab.systems.planetary.phasing import RULES

MEMBERS = ("sun", "ring", "carrier")
"""Members of a set, each a rotor."""
FAULTY = ("sun", "planet", "ring")
"""Gears of a set."""


class Planets(Teeth):
    """The equal planets of a set; what is not given of their teeth is that of the sun's."""

    count: Annotated[Fraction, Count(of="planets"), Field(le=MOST_PLANETS)] = Field(
        title="number of planets", description="N >= 3, equally spaced without angles."
    )
    teeth: ToothCount = Field(title="teeth of a planet", description="z_p.")
    angles: list[Annotated[float, Quantity("rad")]] | None = Field(
        default=None,
        title="angle of a planet",
        description="psi_n (rad, or with a unit), or assemble: the nearest to equal ones at which the teeth fit.",
        json_schema_extra=also({"const": ASSEMBLE}),
    )
    profile_shift: Number | None = Field(
        default=None, title="profile shift", description="x, in modules (1); closes the backlash without."
    )
    mass: Mass | None = Field(default=None, title="mass of a planet", description="(kg); that of its disc without.")
    inertia: Inertia | None = Field(
        default=None, title="moment of inertia of a planet", description="(kg m^2); that of its disc without."
    )
    bore_radius: NonNegativeLength | None = Field(
        default=None, title="radius of the bore", description="Of a planet's disc (m)."
    )
    support: Support | None = Field(
        default=None,
        title="planet bearing",
        description="Between each planet and the carrier; without, the planets' centres are fixed on it.",
    )


class SetMesh(ToothMesh, TrainMeshKeys):
    """The meshes of the sun, or of the ring, with the planets. What is not given follows from the teeth."""

    misplaced: ClassVar[dict[str, str]] = {
        "name": "the meshes of a set are called NAME.sun.1, ... and NAME.ring.1, ...",
        "lag": "lags of a set follow from its teeth; give phases: {sun_ring: ..} to the set for that of the ring",
    }


class SetMeshes(Section):
    """Both kinds of meshes of a set."""

    sun: SetMesh = Field(default=SetMesh(), title="sun's meshes", description="Each planet with the sun.")
    ring: SetMesh = Field(default=SetMesh(), title="ring's meshes", description="Each planet with the ring.")


class SetPhases(Section):
    """The lag of the ring's meshes behind the sun's; the others follow from the teeth."""

    sun_ring: Turns | None = Field(
        default=None, title="phase of the ring's meshes", description="gamma_sr (1); from teeth by the rule without."
    )
    rule: Annotated[str, Choice("rule", tuple(RULES))] | None = Field(
        default=None,
        title="rule of the ring's lag",
        description="gamma_sr from entry to entry, the default, or from pitch_point to pitch_point.",
    )


class SetFault(Fault):
    """A weak tooth of a gear of a set."""

    gear: Annotated[str, Choice("gear of a set", FAULTY)] = Field(title="gear", description="sun, planet or ring.")
    planet: Annotated[int, Field(ge=1), Whole] | None = Field(
        default=None, title="number of the planet", description="Of a weak tooth of a planet, from 1; 1 without."
    )
    flank: Annotated[str, Choice("mesh", ("sun", "ring"))] | None = Field(
        default=None, title="flank with the pit", description="That in the sun's mesh or the ring's; sun without."
    )


class PlanetarySet(Named):
    """A sun, planets on a carrier and a ring; each member is a rotor of the train."""

    sun: NameText = Field(title="sun", description="Name of its rotor, an external gear.")
    ring: NameText = Field(title="ring", description="Name of its rotor, an internal gear.")
    carrier: NameText = Field(title="carrier", description="Name of its rotor.")
    held: Annotated[str, Choice("held member", MEMBERS)] | None = Field(
        default=None, title="held member", description="sun, ring or carrier, if one of them does not turn."
    )
    planets: Planets = Field(title="planets", description="Equal planets on the carrier.")
    centre_distance: Length | None = Field(
        default=None,
        title="centre distance",
        description="a (m); that of the profile shifts of sun and planet, else m (z_s + z_r)/4 without.",
    )
    meshes: SetMeshes = Field(default=SetMeshes(), title="meshes", description="Of the sun and of the ring.")
    carrier_speed: Annotated[str, Choice("carrier speed", ("from_teeth",))] | None = Field(
        default=None,
        title="carrier speed",
        description="from_teeth: with the gyroscopic and centripetal terms of the turning carrier; none without.",
    )
    phases: SetPhases | None = Field(
        default=None, title="mesh phases", description="How far the ring's meshes lag the sun's."
    )
    faults: list[SetFault] = Field(default=[], title="faults", description="Weak teeth of sun, planets and ring.")


def conflicts(raw: dict[str, Any]) -> Iterator[Conflict]:
    """Yield what contradicts itself in the ``planetary_sets`` of a section ``system``."""
    rotors = {rotor["name"]: rotor for _, rotor in items(raw.get("rotors")) if isinstance(rotor.get("name"), str)}
    known = len(rotors) == len(items(raw.get("rotors"))) > 0
    for k, item in items(raw.get("planetary_sets")):
        found = [*(_members(item, rotors) if known else ()), *_meshes(item)]
        if not found:
            found = list(_teeth(item, rotors))
        yield from below("planetary_sets", below(k, found))


def _members(item: dict[str, Any], rotors: dict[str, dict[str, Any]]) -> Iterator[Conflict]:
    """Three different rotors, an external and an internal gear among them."""
    seen: dict[Any, str] = {}
    for member in MEMBERS:
        name = item.get(member)
        if not isinstance(name, str):
            continue
        if name in seen:
            yield (member,), "inconsistent", f"'{name}' is the {seen[name]} already", "name another rotor"
        elif name not in rotors:
            yield (member,), "unknown_name", f"there is no rotor '{name}'", nearest(name, rotors)
        elif member != "carrier" and rotors[name].get("teeth") is None:
            yield (member,), "not_applicable", f"rotor '{name}' has no teeth", "name a gear, or give the rotor teeth"
        elif member != "carrier" and bool(rotors[name].get("internal")) != (member == "ring"):
            kind = "an internal" if member == "ring" else "an external"
            yield (member,), "inconsistent", f"rotor '{name}' is not {kind} gear", "set or remove internal: true there"
        seen[name] = member


def _meshes(item: dict[str, Any]) -> Iterator[Conflict]:
    meshes = item.get("meshes") or {}
    for name in ("sun", "ring"):
        if (mesh := meshes.get(name)) is not None:
            place: Path = ("meshes", name)
            wrong = [*SetMesh.conflicts_of(mesh, True), *at_most_one(mesh, ("damping", "damping_ratio"))]
            wrong += at_most_one(mesh, ("mean_stiffness", "max_stiffness", "stiffness_per_width"))
            wrong += relief_conflicts(mesh)
            yield from (((*place, *path), code, message, hint) for path, code, message, hint in wrong)
    phases = item.get("phases") or {}
    if phases.get("rule") is not None and phases.get("sun_ring") is not None:
        yield ("phases", "rule"), "already_given", "sun_ring is given already", "keep one of sun_ring and rule"


def _teeth(item: dict[str, Any], rotors: dict[str, dict[str, Any]]) -> Iterator[Conflict]:
    """Yield what keeps planets of known teeth from being assembled."""
    planets = item.get("planets") or {}
    count: Any = planets.get("count")
    psi = planets.get("angles")
    if whole(count, 3, MOST_PLANETS) and isinstance(psi, list):
        yield from below("planets", wrong_length(planets, "angles", int(count), "planet"))
    numbers: list[Any] = [rotors.get(item.get(name, ""), {}).get("teeth") for name in ("sun", "ring")]
    numbers.append(planets.get("teeth"))
    if "support" in planets and (planets["support"] or {}).get("stiffness") is None:
        yield ("planets", "support", "stiffness"), "missing", "is missing", "add stiffness (N/m), or remove support"
    if not all(whole(number, 4, 10**6) for number in numbers):
        return
    sun, ring, planet = map(int, numbers)
    if psi is not None:
        return  # their units are read later
    for path, code, message, hint in assembly(sun, planet, ring, count):
        yield ("planets", path[-1] if path[-1] == "angles" else "teeth"), code, message, hint


def set_fault_conflicts(raw: dict[str, Any], teeth: dict[str, Any], count: Any) -> Iterator[Conflict]:
    """Yield what contradicts itself in the ``faults`` of a set. teeth: by gear; count: of planets."""
    yield from fault_conflicts(raw, FAULTY, teeth)
    for k, item in items(raw.get("faults")):
        of_planet, planet = item.get("gear") == "planet", item.get("planet")
        for key in ("planet", "flank"):
            if item.get(key) is not None and not of_planet:
                yield ("faults", k, key), "not_applicable", f"a tooth of the {item.get('gear')} has none", "remove it"
        if of_planet and item.get("flank") is not None and item.get("kind", "crack") == "crack":
            yield ("faults", k, "flank"), "not_applicable", "a crack weakens both flanks", "remove it, or kind: pit"
        if type(planet) is int and whole(count, 1, MOST_PLANETS) and planet > int(count):
            yield ("faults", k, "planet"), "out_of_range", f"there are {int(count)} planets", f"write 1 to {int(count)}"


def complete_angles(document: Document, raw: dict[str, Any]) -> None:
    """Write out the angles that are to be assembled, in the section as written."""
    teeth = {str(item.get("name")): item.get("teeth") for item in map(mapping, sequence(raw.get("rotors")))}
    for k, item in enumerate(map(mapping, sequence(raw.get("planetary_sets")))):
        planets = mapping(item.get("planets"))
        if planets.get("angles") != ASSEMBLE:
            continue
        place = ("system", "planetary_sets", k, "planets", "angles")
        numbers: list[Any] = [planets.get("count"), *(teeth.get(str(item.get(gear))) for gear in ("sun", "ring"))]
        if not all(type(number) is int and number > 0 for number in numbers):
            hint = "give count, and rotors for sun and ring their teeth"
            document.report(place, "needs_other", "needs the numbers of teeth", hint)
            del planets["angles"]
        elif sum(numbers[1:]) % numbers[0]:
            document.put(place, angles.nearest(numbers[1], numbers[2], numbers[0]), document.where(place))
        else:
            del planets["angles"]  # equal ones, which leave the set its symmetry
