"""Masses, inertias, pressure angles and mesh stiffness of a planetary gear from its teeth, as ``gearbox`` has them.

Sun and planets are discs of the pitch radius, the ring an annulus from its pitch circle to 1.2 root radii; the planets'
centres are where sun and planet mesh without backlash, and the ring meshes with them at that distance.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from pydantic_core import PydanticCustomError

from gearstab.config.document.codes import code_of
from gearstab.config.document.tree import mapping, names_set
from gearstab.config.document.yaml import Document
from gearstab.config.model.fields import Quantity
from gearstab.config.model.introspection import as_parameters
from gearstab.config.model.validation import validate
from gearstab.errors import NotPossible
from gearstab.systems.gearbox.sections import Teeth

if TYPE_CHECKING:
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
    for name, spec in mapping(document.get(("sweep",))).items():
        if not any(one.startswith("teeth.") for one in names_set(name, spec)):
            continue
        message = "sets numbers of teeth, and gears gives the numbers of those in system alone"
        document.report(
            ("sweep", name),
            "not_applicable",
            message,
            "remove it, or give masses and stiffness instead of gears",
            at_key=True,
        )
    counts = mapping(teeth)
    whole = all(type(counts.get(body)) is int and counts[body] > 3 for body in ("sun", "planet", "ring"))
    if not whole:
        document.report(
            ("system", "gears"),
            "needs_other",
            "needs the numbers of teeth",
            "add teeth: {sun: .., planet: .., ring: ..}",
        )
    if whole and set(NEEDED) <= set(shared):
        try:
            _fill(document, raw, {body: shared | {"teeth": counts[body]} for body in ("sun", "planet", "ring")})
        except NotPossible as error:
            document.report(("system", "gears"), "impossible", error.message, error.remedy or "change the teeth")
            whole = False
    if not (whole and set(NEEDED) <= set(shared)):
        _stand_in(document, raw)


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


def _fill(document: Document, raw: dict[str, Any], gears: Mapping[str, dict[str, Any]]) -> None:
    from gearstab.gears.geometry import Gear
    from gearstab.systems.gearbox import rotors
    from gearstab.systems.gearbox.build import STEEL
    from gearstab.systems.gearbox.teeth import MeshTeeth

    ring = gears["ring"] | {"internal": True}
    rim = Gear(ring["teeth"], **{key: value for key, value in ring.items() if key != "teeth"})
    bodies = {"sun": gears["sun"], "planet": gears["planet"],
              "ring": ring | {"body_radius": rim.bore, "bore_radius": rim.radius}}  # fmt: skip
    numbers: dict[str, dict[str, float]] = {"masses": {}, "inertias": {}, "pressure_angles": {}}
    for body, rotor in bodies.items():
        numbers["masses"][body] = float(rotors.mass(rotor, STEEL["density"]))
        numbers["inertias"][body] = float(rotors.inertia(rotor, STEEL["density"]) / rotors.base_radius(rotor) ** 2)
    centre = MeshTeeth((gears["sun"], gears["planet"]), {}, STEEL).pairs[0].centre
    for name, pair in (("sun", (gears["sun"], gears["planet"])), ("ring", (gears["planet"], ring))):
        section = mapping(raw.get("meshes")).get(name, {})
        if not isinstance(section, dict):
            continue
        mesh = MeshTeeth(pair, _measured(document, name, section) | {"centre_distance": centre}, STEEL)
        numbers["pressure_angles"][name] = float(mesh.pairs[0].pressure_angle)
        if isinstance(raw.get("meshes"), dict):
            _fill_mesh(document, name, section, mesh)
    for key, values in numbers.items():
        _put(document, (key,), values)


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


def _put(document: Document, path: tuple[str, ...], values: Mapping[str, float]) -> None:
    """Set what is not given in a section, which is made where there is none; not in what is no section."""
    place = document.where(("system", "teeth"))
    document.fill(("system", *path), {}, place)
    for key, value in values.items():
        document.fill(("system", *path, key), value, place)
