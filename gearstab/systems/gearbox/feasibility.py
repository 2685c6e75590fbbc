"""Whether the gearboxes of a grid can be built: trains that turn, gears that mesh, stiffness that stays positive.

What keeps teeth from being computed is a conflict, what is wrong with teeth that mesh all the same a flag.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice, product
from typing import Any

import numpy as np

from gearstab.config.document import Document, Path
from gearstab.config.model import MESH_FREQUENCY, Array, Axis, Grid
from gearstab.config.model.conflicts import Conflict, items
from gearstab.config.model.reading import known
from gearstab.systems.gearbox.bodies import Rotor, moves, slides
from gearstab.systems.gearbox.meshes import GearboxMesh, PlanetarySet, needs_width
from gearstab.systems.gearbox.teeth import OF_GEAR
from gearstab.systems.gearbox.train import Train
from gearstab.systems.kinematics import TrainError

MOST_CORNERS = 32
"""Most corners of the grid that are looked at."""
MOST_TEETH = 96
"""Computations of a tooth stiffness along an axis, some 8 ms each."""
MOST_PAIRS = 4096
"""Geometries of a pair of gears along an axis, some 0.1 ms each."""

Found = tuple[Path, str, str]
"""Path below ``system``, message, remedy."""
Question = Callable[[Grid[Any], dict[str, Any]], Found | None]
"""Function that finds a mistake at points of a grid, given by their indices on some axes."""


def check_points(document: Document, grid: Grid[Any], questions: Sequence[tuple[Question, int]]) -> None:
    """Report the first point at which a question finds a mistake.

    Looked at are the corners of the grid, or the base values, with the first question, and every axis by itself from
    end to end: all of its points as far as the number given with each question allows, else as many, evenly spread.
    """
    axes = [axis for axis in grid.axes if any(item.path != MESH_FREQUENCY for item in axis.assignments)]
    for corner in islice(product(*(sorted({0, axis.size - 1}) for axis in axes)), MOST_CORNERS):
        at = dict(zip((a.name for a in axes), corner, strict=True))
        if _reported(document, grid, at, questions[0][0]):
            return
    for axis in axes:
        for question, most in questions:
            points = _spread(axis, max(most, 2))
            at_once = not any(item.structural for item in axis.assignments)
            if at_once and question(grid, {axis.name: points}) is None:
                continue
            if any(_reported(document, grid, {axis.name: int(k)}, question) for k in points):
                return


def check_train(document: Document, grid: Grid[Any]) -> None:
    """Report the first point at which there is no such train."""
    meshes = len(grid.system.meshes) + 2 * len(grid.system.planetary_sets)
    check_points(document, grid, ((built, MOST_TEETH // meshes), (_meshing, MOST_PAIRS // meshes)))


def _spread(axis: Axis, most: int) -> Array:
    """Indices of the points of an axis, or of so many of them."""
    return np.unique(np.linspace(0, axis.size - 1, min(most, axis.size)).round().astype(int))


def _reported(document: Document, grid: Grid[Any], at: dict[str, int], question: Question) -> bool:
    """Whether a question finds a mistake at a point, which is then reported."""
    found = question(grid, {name: np.array(k) for name, k in at.items()})
    if found is None:
        return False
    values = [f"{a.name} = {a.values[at[a.name]]}" for a in grid.axes if _matters(grid, at, a, found, question)]
    path, message, remedy = found
    where = f" (at {', '.join(values)})" if values else ""
    document.report(("system", *path), "impossible", f"{message}{where}", remedy, at_key=True)
    return True


def _matters(grid: Grid[Any], at: dict[str, int], axis: Axis, found: Found, question: Question) -> bool:
    """Whether the mistake found at a point is another, or none, at the other end of an axis."""
    if axis.name not in at or axis.size == 1:
        return False
    other = at | {axis.name: 0 if at[axis.name] else axis.size - 1}
    return question(grid, {name: np.array(k) for name, k in other.items()}) != found


def _meshing(grid: Grid[Any], at: dict[str, Any]) -> Found | None:
    """Whether the gears of all meshes fit together."""
    train = Train(grid.at(at))
    try:
        for k in range(len(train.pairs)):
            train.push(k)
        for item in train.sets:
            with item.told():
                item.teeth.lag("entry", True)
    except TrainError as error:
        return error.where, error.message, error.remedy
    return None


def built(grid: Grid[Any], at: dict[str, Any]) -> Found | None:
    """Ask whether the system can be built, with mesh stiffnesses that stay positive."""
    try:
        system = grid.at(at).build()
    except TrainError as error:
        return error.where, error.message, error.remedy
    for mesh in system.meshes if not grid.system.allow_negative_stiffness else ():
        lowest = float(np.min(mesh.lowest_stiffness))
        if not lowest > 0:
            message = f"the softer level {lowest:.6g} of the stiffness of mesh '{mesh.name}' is <= 0"
            remedy = "reduce epsilon, or set system.allow_negative_stiffness: true"
            return _place(grid.system, mesh.name), message, remedy
    return None


def _place(p: Any, name: str) -> Path:
    """The section that describes a mesh of a system."""
    if not isinstance(p.meshes, list):
        return ("meshes", name.rstrip("0123456789"))
    for k, item in enumerate(p.planetary_sets):
        if name.startswith(f"{item.name}."):
            return ("planetary_sets", k, "meshes", name.split(".")[-2])
    return ("meshes", [mesh.name for mesh in p.meshes].index(name))


@dataclass(frozen=True)
class NoticeWords:
    """A notice in a result, and in words: its bit, what teeth do in a note, what a gear is told, and what a map says.

    detail: of the gear, with the numbers of a notice. short: "" where maps do not show it.
    """

    bit: int
    teeth: str
    detail: str
    short: str = ""


NOTICES = {
    "undercut": NoticeWords(
        1, "are undercut", "undercut, the profile shift is {number:.4g} and should be at least {limit:.4g}", "undercut"
    ),
    "top_land": NoticeWords(
        2, "are pointed", "its teeth are {number:.3g} modules thick at the tip, less than {limit:.3g}"
    ),
    "interference": NoticeWords(
        4, "interfere, so that contact is cut off", "interference, the contact is cut off: its tip would reach the "
        "mate {beyond:.3g} mm beyond the end of the mate's involute", "interference",
    ),
    "fillet_contact": NoticeWords(
        8, "touch inside of a fillet", "the mate's tip touches it at the radius {number_mm:.4f} mm, inside its fillet, "
        "which ends at {limit_mm:.4f} mm",
    ),
    "contact_ratio": NoticeWords(
        16, "lose contact (contact ratio below 1)", "contact breaks off, the contact ratio is {number:.4g}",
        "contact breaks off",
    ),
    "tip_clearance": NoticeWords(
        32, "come too close to a root", "its tip is {number:.3g} modules off the root of its mate, less than "
        "{limit:.3g}",
    ),
    "backlash": NoticeWords(
        64, "are too thick for the centre distance", "the teeth are too thick for the centre distance by {beyond:.3g} "
        "mm",
    ),
    "trochoid_interference": NoticeWords(
        128, "collide outside of the path of contact", "the tips collide outside of the path of contact, by "
        "{beyond_angle:.3g} rad", "interference",
    ),
    "trimming": NoticeWords(
        256, "cannot be put in radially", "the pinion cannot be put in radially, for {beyond_angle:.3g} rad"
    ),
}  # fmt: skip
"""By the names of :class:`gearstab.gears.pair.Notice`."""
NOTICE_FLAGS = {name: words.bit for name, words in NOTICES.items()}

GEOMETRY = frozenset({*OF_GEAR, "helix_angle", "teeth", "centre_distance"})
"""Parameters that the notices depend on, by their own names."""


def notice_flags(p: Any) -> Array:
    """Return ``(..., meshes)`` flags for the parameters of a gearbox, whose batch is that of its teeth."""
    found = [
        mesh.each(lambda pair: sum(NOTICE_FLAGS[name] for name in {notice.name for notice in pair.notices}))
        for mesh in (mesh.teeth for mesh in Train(p).meshes)
    ]
    return np.stack(np.broadcast_arrays(*found), axis=-1).astype(np.int16)


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
