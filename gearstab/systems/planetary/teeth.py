"""Masses, inertias, pressure angles and mesh stiffness of a planetary gear from its teeth, as ``gearbox`` has them.

Sun and planets are discs of the pitch radius, the ring an annulus from its pitch circle to 1.2 root radii. Of centre
distance and profile shifts, what ``teeth`` does not give is chosen such that the meshes have no backlash.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError
from pydantic_core import PydanticCustomError

from gearstab.config.document.codes import code_of
from gearstab.config.document.tree import mapping, names_set
from gearstab.config.document.yaml import Document
from gearstab.config.model.fields import Quantity
from gearstab.config.model.introspection import as_parameters
from gearstab.config.model.validation import validate
from gearstab.errors import NotPossible
from gearstab.systems.gearbox.sections import Teeth
from gearstab.systems.planetary.feasibility import shifted_too_far
from gearstab.systems.planetary.meshes import ToothNumbers
from gearstab.systems.planetary.phasing import Turning

if TYPE_CHECKING:
    from gearstab.gears.pair import Pair
    from gearstab.systems.gearbox.teeth import MeshTeeth

MEASURED = {"single_pair_stiffness": "N/m", "double_contact_factor": "1", "variation": "1"}
"""Keys of a mesh that say how its teeth are to be taken, and their units."""
NEEDED = ("module", "pressure_angle", "face_width")
STAND_INS = {"mean_stiffness": 1.0, "epsilon": 0.0, "contact_ratio": 1.5}
"""Numbers of a mesh in a configuration whose teeth are refused, lest it be said to lack them, too."""
RIVALS = {"mean_stiffness": "max_stiffness", "epsilon": "amplitude"}


def fill(document: Document, raw: dict[str, Any]) -> None:
    """Write what the teeth give into the section as written, where it does not give it itself; report what they cannot.

    ``gears`` and the keys of MEASURED have then done their work, and are removed.
    """
    teeth, given = raw.get("teeth"), raw.pop("gears", None)
    if given is None:
        return
    document.data["system"]["gears"] = given
    found = validate(document, Teeth, ("system", "gears"))
    del document.data["system"]["gears"]
    shared = {} if found is None else as_parameters(found)
    for key in NEEDED if found is not None else ():
        if key not in shared:
            document.report(("system", "gears", key), "missing", "is missing", f"add {key}, which all gears share")
    for place in (("sweep",), ("design", "variables")):
        for name, spec in mapping(document.get(place)).items():
            if any(one.startswith("teeth.") for one in names_set(name, spec)):
                message = "sets numbers of teeth, and gears gives the numbers of those in system alone"
                remedy = "remove it, or give masses and stiffness instead of gears"
                document.report((*place, name), "not_applicable", message, remedy, at_key=True)
    counts = mapping(teeth)
    whole = all(type(counts.get(body)) is int and counts[body] > 3 for body in ("sun", "planet", "ring"))
    if not whole:
        document.report(
            ("system", "gears"),
            "needs_other",
            "needs the numbers of teeth",
            "add teeth: {sun: .., planet: .., ring: ..}",
        )
    numbers = _as_numbers(teeth) if whole and set(NEEDED) <= set(shared) else None
    if numbers is None or shifted_too_far(counts["sun"], counts["planet"], counts["ring"]):
        _stand_in(document, raw)
        return
    try:
        _fill(document, raw, shared, numbers)
    except NotPossible as error:
        document.report(("system", "gears"), "impossible", error.message, error.remedy or "change the teeth")
        _stand_in(document, raw)


def _as_numbers(teeth: Any) -> dict[str, Any] | None:
    """The section ``teeth`` as numbers; None where something is wrong with it, which is reported when all is read."""
    try:
        return as_parameters(ToothNumbers.model_validate(teeth))
    except ValidationError:
        return None


def _stand_in(document: Document, raw: dict[str, Any]) -> None:
    """Fill in what the teeth would have given, had they not been refused."""
    bodies = dict.fromkeys(("sun", "planet", "ring"), 1.0)
    _put(document, ("masses",), bodies)
    _put(document, ("inertias",), bodies)
    _put(document, ("pressure_angles",), dict.fromkeys(("sun", "ring"), 0.3))
    for name, mesh in mapping(raw.get("meshes")).items():
        if name in ("sun", "ring") and isinstance(mesh, dict):
            for key in MEASURED:
                mesh.pop(key, None)
            _put(document, ("meshes", name), {key: STAND_INS[key] for key in _lacking(mesh)})


def _fill(document: Document, raw: dict[str, Any], shared: dict[str, Any], teeth: dict[str, Any]) -> None:
    from gearstab.gears.geometry import Gear
    from gearstab.systems.gearbox import rotors
    from gearstab.systems.gearbox.teeth import MeshTeeth
    from gearstab.systems.gearbox.train import STEEL

    gears, centre = _cut(shared, teeth)
    ring = gears["ring"]
    rim = Gear(ring["teeth"], **{key: value for key, value in ring.items() if key != "teeth"})
    bodies = gears | {"ring": ring | {"body_radius": rim.bore, "bore_radius": rim.radius}}
    numbers: dict[str, dict[str, float]] = {"masses": {}, "inertias": {}, "pressure_angles": {}}
    for body, rotor in bodies.items():
        numbers["masses"][body] = float(rotors.mass(rotor, STEEL["density"]))
        numbers["inertias"][body] = float(rotors.inertia(rotor, STEEL["density"]) / rotors.base_radius(rotor) ** 2)
    moving = Turning.of(raw, teeth["sun"], teeth["ring"])
    pairs = {}
    for name, pair in (("sun", (gears["sun"], gears["planet"])), ("ring", (gears["planet"], ring))):
        section = mapping(raw.get("meshes")).get(name, {})
        if not isinstance(section, dict):
            continue
        mesh = MeshTeeth(pair, _measured(document, name, section) | {"centre_distance": centre}, STEEL)
        pairs[name] = mesh.pairs[0]
        # Under a clockwise torque on the sun the other flanks carry.
        numbers["pressure_angles"][name] = pairs[name].pressure_angle * (1 if moving is None else moving.torque)
        if isinstance(raw.get("meshes"), dict):
            _fill_mesh(document, name, section, mesh)
    for key, values in numbers.items():
        _put(document, (key,), values)
    _put(document, ("teeth",), {"centre_distance": centre})
    _put(document, ("teeth", "profile_shift"), {body: gear["profile_shift"] for body, gear in gears.items()})
    if moving is not None and len(pairs) == 2:
        _fill_lag(document, raw, pairs, moving)


def _cut(shared: dict[str, Any], teeth: dict[str, Any]) -> tuple[dict[str, dict[str, Any]], float]:
    """Gears with profile shifts and shortened tips, and their centre distance."""
    from gearstab.gears.planet_set import closing_shifts, halfway
    from gearstab.systems.gearbox.teeth import MeshTeeth
    from gearstab.systems.gearbox.train import STEEL

    counts = {body: int(teeth[body]) for body in ("sun", "planet", "ring")}
    given, tips = teeth.get("profile_shift", {}), teeth.get("tip_radius", {})
    gears = {body: shared | {"teeth": z, "internal": body == "ring"} for body, z in counts.items()}
    module, centre = shared["module"], teeth.get("centre_distance")
    if centre is None and {"sun", "planet"} <= given.keys():
        pair = tuple(gears[body] | {"profile_shift": given[body]} for body in ("sun", "planet"))
        centre = MeshTeeth((pair[0], pair[1]), {}, STEEL).pairs[0].centre
    elif centre is None:
        centre = halfway(module, counts["sun"], counts["ring"])
    shifts = closing_shifts(counts, module, shared["pressure_angle"], centre, given)
    moved = centre / module - (counts["sun"] + counts["planet"]) / 2
    shortening = max(round(shifts["sun"] + shifts["planet"] - moved, 12), 0.0)
    for body, gear in gears.items():
        gear |= {"profile_shift": shifts[body], "tip_shortening": 0.0 if body == "ring" else shortening}
        if body in tips:
            above = (tips[body] / module - counts[body] / 2 - shifts[body]) * (-1 if body == "ring" else 1)
            gear["tip_shortening"] = shared.get("addendum", 1.0) - above
    return gears, centre


def _fill_lag(document: Document, raw: dict[str, Any], pairs: dict[str, Pair], moving: Turning) -> None:
    """Lag of the ring's meshes behind the sun's, and by which rule."""
    from gearstab.gears.planet_set import PlanetSet

    planet = PlanetSet(*(replace(pairs[name], wheel_drives=not moving.sun_drives) for name in ("sun", "ring")))
    phases = mapping(raw.get("phases"))
    rule = phases.get("rule") or "entry"
    if phases.get("sun_ring") is None:
        lag = planet.pitch_lag if rule == "pitch_point" else planet.entry_lag
        _put(document, ("phases",), {"rule": rule, "sun_ring": lag})
    elif "rule" in phases:
        path, remedy = ("system", "phases", "rule"), "keep one of sun_ring and rule"
        document.report(path, "already_given", "sun_ring is given already", remedy, at_key=True)


def _measured(document: Document, name: str, section: dict[str, Any]) -> dict[str, Any]:
    """The parameters of a mesh for its teeth; those of MEASURED are taken out of the section."""
    found = {key: value for key, value in section.items() if key not in MEASURED}
    for key, unit in MEASURED.items():
        value = section.pop(key, None)
        if value is None:
            continue
        try:
            found[key] = Quantity(unit).number(value)
        except PydanticCustomError as error:
            context = error.context or {}
            path = ("system", "meshes", name, key)
            document.report(path, code_of(error.type), str(context["message"]), str(context["hint"]), value=value)
            found[key] = 1.0
    return found


def _fill_mesh(document: Document, name: str, section: dict[str, Any], mesh: MeshTeeth) -> None:
    """Mean stiffness, epsilon and contact ratio of a rectangular wave."""
    try:
        filled = mesh.filled()
    except NotPossible as error:
        remedy = f"{error.remedy or 'change the teeth'}, or mean_stiffness and epsilon"
        document.report(("system", "meshes", name), "impossible", error.message, remedy)
        filled = STAND_INS
    _put(document, ("meshes", name), {key: float(filled[key]) for key in _lacking(section) if key in filled})


def _lacking(section: dict[str, Any]) -> list[str]:
    """What a mesh needs of its teeth."""
    return [key for key in STAND_INS if section.get(key) is None and section.get(RIVALS.get(key, key)) is None]


def _put(document: Document, path: tuple[str, ...], values: Mapping[str, float | str]) -> None:
    """Set what is not given in a section, which is made where there is none; not in what is no section."""
    place = document.where(("system", "teeth"))
    document.fill(("system", *path), {}, place)
    for key, value in values.items():
        document.fill(("system", *path, key), value, place)
