"""Whether the gears of a gearbox have the module, pressure angle and face width that something depends on."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from gearstab.config.model.conflicts import Conflict, items
from gearstab.systems.gearbox.mesh import needs_width
from gearstab.systems.gearbox.rotors import moves, slides

MOST = 4
"""Things that a message lists."""


def missing_of_teeth(raw: dict[str, Any], shared: set[str]) -> Iterator[Conflict]:
    """Conflicts of a section ``system`` as written: one for each number that no gear has, else one for each gear.

    shared: what ``gears`` gives for all.
    """
    rotors = dict(items(raw.get("rotors")))
    geared = [i for i, rotor in rotors.items() if rotor.get("teeth") is not None]
    for key in ("module", "pressure_angle"):
        lacking = [i for i in geared if rotors[i].get(key) is None and key not in shared]
        if len(lacking) == len(geared) > 1:
            yield ("gears", key), "missing", "is missing", f"add {key} to gears, which holds for all, or to each gear"
            continue
        for i in lacking:
            yield (
                ("rotors", i, key),
                "missing",
                "is missing",
                f"add {key} to this gear, or to gears, which holds for all",
            )
    if "face_width" not in shared:
        yield from _widths(raw, rotors, geared)


def _widths(raw: dict[str, Any], rotors: dict[int, dict[str, Any]], geared: list[int]) -> Iterator[Conflict]:
    narrow = {i: rotor for i, rotor in rotors.items() if rotor.get("face_width") is None}
    uses = [use for i, rotor in narrow.items() for use in _of_disc(i, rotor)] + list(_of_meshes(raw, narrow))
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


def _of_disc(i: int, rotor: dict[str, Any]) -> Iterator[tuple[int, str, str]]:
    """Inertia and mass, where they are those of a disc."""
    if rotor.get("teeth") is None and rotor.get("body_radius") is None:
        return
    name = rotor.get("name", i)
    if rotor.get("inertia") is None:
        yield i, f"the inertia of {name}", "inertia"
    if (moves(rotor) or slides(rotor)) and rotor.get("mass") is None:
        yield i, f"the mass of {name}", "mass"


def _of_meshes(raw: dict[str, Any], narrow: dict[int, dict[str, Any]]) -> Iterator[tuple[int, str, str]]:
    """Overlap of helical gears, stiffness and lubrication that follow from the teeth."""
    shared = (raw.get("gears") or {}).get("helix_angle")
    for i, rotor in narrow.items():
        if rotor.get("teeth") is not None and (rotor.get("helix_angle") or shared):
            yield i, f"the overlap ratio of {rotor.get('name', i)}", ""
    for k, mesh in items(raw.get("meshes")):
        if not needs_width(mesh):
            continue
        stiff = not needs_width(mesh | {"mean_stiffness": 1.0})
        what, key = ("stiffness", "mean_stiffness") if stiff else ("friction", "")
        for i, rotor in narrow.items():
            if rotor.get("teeth") is not None and rotor.get("name") in (mesh.get("gears") or ()):
                yield i, f"the {what} of mesh {mesh.get('name', k)}", key
    for k, item in items(raw.get("planetary_sets")):
        meshes = item.get("meshes") or {}
        for i, rotor in narrow.items():
            for name in ("sun", "ring"):
                mesh = meshes.get(name) or {}
                if rotor.get("name") in (item.get("sun"), item.get(name)) and needs_width(mesh):
                    yield i, f"the stiffness of the {name}'s meshes of {item.get('name', k)}", "mean_stiffness"
