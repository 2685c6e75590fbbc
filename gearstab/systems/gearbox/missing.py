"""Whether the gears of a gearbox have the module, pressure angle and face width that something depends on."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from gearstab.config.model.conflicts import Conflict, items
from gearstab.config.model.reading import known
from gearstab.systems.gearbox.bodies import Rotor
from gearstab.systems.gearbox.mesh import GearboxMesh, needs_width
from gearstab.systems.gearbox.rotors import moves, slides
from gearstab.systems.gearbox.set_sections import PlanetarySet

MOST = 4
"""Things that a message lists."""


def missing_of_teeth(box: Any) -> Iterator[Conflict]:
    """Yield a conflict for each number that no gear has, else one for each gear."""
    rotors = dict(items(box.rotors))
    geared = [i for i, rotor in rotors.items() if rotor.teeth is not None]
    for key in ("module", "pressure_angle"):
        lacking = [i for i in geared if rotors[i][key] is None and box.gears[key] is None]
        if len(lacking) == len(geared) > 1:
            yield ("gears", key), "missing", "is missing", f"add {key} to gears, which holds for all, or to each gear"
            continue
        for i in lacking:
            hint = f"add {key} to this gear, or to gears, which holds for all"
            yield ("rotors", i, key), "missing", "is missing", hint
    if box.gears.face_width is None:
        yield from known(_widths(box, rotors, geared))


def _widths(box: Any, rotors: dict[int, Rotor], geared: list[int]) -> Iterator[Conflict]:
    narrow = {i: rotor for i, rotor in rotors.items() if rotor.face_width is None}
    uses = [use for i, rotor in narrow.items() for use in known(_of_disc(i, rotor))]
    uses += _of_meshes(box, narrow)
    lacking = sorted({i for i, _, _ in uses})
    if len(lacking) > 1 and all(i in narrow for i in geared):
        yield ("gears", "face_width"), "missing", *_said(uses, "to gears, which holds for all")
        return
    for i in lacking:
        yield ("rotors", i, "face_width"), "missing", *_said([use for use in uses if use[0] == i], "to this rotor")


def _said(uses: list[tuple[int, str, str]], where: str) -> tuple[str, str]:
    """Message and remedy for a face width on which things depend: (rotor, what, key to give instead or "")."""
    what = list(dict.fromkeys(text for _, text, _ in uses))
    listed = ", ".join(what[:MOST]) + ", ..." * (len(what) > MOST)
    instead = list(dict.fromkeys(key for _, _, key in uses))
    otherwise = "" if "" in instead else f", or give {' and '.join(instead)} instead"
    return f"is missing, needed for {listed}", f"add face_width {where}{otherwise}"


def _of_disc(i: int, rotor: Rotor) -> Iterator[tuple[int, str, str]]:
    """Inertia and mass, where they are those of a disc."""
    if rotor.teeth is None and rotor.body_radius is None:
        return
    if rotor.inertia is None:
        yield i, f"the inertia of {rotor.name}", "inertia"
    if (moves(rotor.support) or slides(rotor.support)) and rotor.mass is None:
        yield i, f"the mass of {rotor.name}", "mass"


def _of_meshes(box: Any, narrow: dict[int, Rotor]) -> Iterator[tuple[int, str, str]]:
    """Overlap of helical gears, stiffness and lubrication that follow from the teeth."""
    for i, rotor in narrow.items():
        yield from known(_of_overlap(box, i, rotor))
    for _, mesh in items(box.meshes):
        yield from known(_of_mesh(mesh, narrow))
    for _, item in items(box.planetary_sets):
        yield from known(_of_set(item, narrow))


def _of_overlap(box: Any, i: int, rotor: Rotor) -> Iterator[tuple[int, str, str]]:
    if rotor.teeth is not None and (rotor.helix_angle or box.gears.helix_angle):
        yield i, f"the overlap ratio of {rotor.name}", ""


def _of_mesh(mesh: GearboxMesh, narrow: dict[int, Rotor]) -> Iterator[tuple[int, str, str]]:
    if not needs_width(mesh):
        return
    stiff = not needs_width(mesh.model_copy(update={"mean_stiffness": 1.0}))
    what, key = ("stiffness", "mean_stiffness") if stiff else ("friction", "")
    for i, rotor in narrow.items():
        if rotor.teeth is not None and rotor.name in mesh.gears:
            yield i, f"the {what} of mesh {mesh.name}", key


def _of_set(item: PlanetarySet, narrow: dict[int, Rotor]) -> Iterator[tuple[int, str, str]]:
    for i, rotor in narrow.items():
        for name, member in (("sun", item.sun), ("ring", item.ring)):
            if rotor.name in (item.sun, member) and needs_width(item.meshes[name]):
                yield i, f"the stiffness of the {name}'s meshes of {item.name}", "mean_stiffness"
