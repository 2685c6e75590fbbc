"""The section ``system`` of a gearbox: rotors, shafts and meshes of any connected train."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Field

from gearstab.config.document.problems import Path, nearest
from gearstab.config.document.tree import mapping
from gearstab.config.document.yaml import Document
from gearstab.config.model.conflicts import Conflict, below, items, within_each
from gearstab.config.model.fields import (
    AngularFrequency,
    Choice,
    NameText,
    NonNegative,
    Quantity,
    Section,
)
from gearstab.system import GearSystem
from gearstab.systems.base import Start, System
from gearstab.systems.gearbox.bodies import Material, Rotor, Shaft, Teeth
from gearstab.systems.gearbox.build import build
from gearstab.systems.gearbox.feasibility import check_train
from gearstab.systems.gearbox.mesh import LUBRICATED, GearboxMesh
from gearstab.systems.gearbox.missing import missing_of_teeth
from gearstab.systems.gearbox.rotors import moves, slides, turns
from gearstab.systems.gearbox.set_sections import PlanetarySet, complete_angles, set_fault_conflicts
from gearstab.systems.gearbox.set_sections import conflicts as set_conflicts
from gearstab.systems.gearbox.train import Train
from gearstab.systems.parts.faults import fault_conflicts
from gearstab.systems.parts.mesh import ToothMesh
from gearstab.systems.planetary.feasibility import MOST_PLANETS, whole

if TYPE_CHECKING:
    from gearstab.config.model.axes import Grid

Torque = Annotated[float, Field(gt=0), Quantity("N m")]


class Input(Section):
    """Input of the train."""

    rotor: NameText = Field(
        title="input rotor", description="Name of the rotor that drives the train, where power enters it."
    )
    torque: Torque | None = Field(
        default=None, title="input torque", description="On the input rotor (N m); follows from the outputs' without."
    )
    speed: AngularFrequency | None = Field(
        default=None,
        title="nominal speed",
        description='Of the input rotor, for friction (rad/s, "1500 rpm"); sweeps set it by the axis input_speed.',
    )
    sense: Annotated[str, Choice("sense", ("counter-clockwise", "clockwise"))] = Field(
        default="counter-clockwise", title="sense of rotation", description="Of the input rotor, seen along z."
    )


class Output(Section):
    """Where power leaves the train."""

    rotor: NameText = Field(title="output rotor", description="Name of the rotor that is loaded.")
    torque: Torque | None = Field(
        default=None,
        title="output torque",
        description="It takes (N m); without, the outputs share the input's power equally.",
    )


class Gearbox(System):
    """A train of rotors, shafts and meshes: rotations, and displacements where rotors have a support."""

    mesh_model: ClassVar[type[ToothMesh]] = GearboxMesh
    needs_units: ClassVar[bool] = True

    start: ClassVar[Start | None] = Start(
        "A two-stage gearbox, from its teeth",
        {
            "kind": "gearbox", "damping_ratio": 0.005,
            "gears": {"module": "2 mm", "pressure_angle": "20 deg", "face_width": "20 mm"},
            "rotors": [
                {"name": "motor", "inertia": 0.01}, {"name": "pinion", "teeth": 20}, {"name": "wheel", "teeth": 60},
                {"name": "second pinion", "teeth": 20, "module": "2.5 mm", "face_width": "30 mm"},
                {"name": "second wheel", "teeth": 80, "module": "2.5 mm", "face_width": "30 mm"},
                {"name": "machine", "inertia": 0.2},
            ],
            "shafts": [
                {"name": "input", "between": ["motor", "pinion"], "stiffness": 1.0e4},
                {"name": "middle", "between": ["wheel", "second pinion"], "stiffness": 5.0e4},
                {"name": "output", "between": ["second wheel", "machine"], "stiffness": 8.0e4},
            ],
            "meshes": [
                {"name": "first", "gears": ["pinion", "wheel"]},
                {"name": "second", "gears": ["second pinion", "second wheel"]},
            ],
            "input": {"rotor": "motor", "torque": 20.0}, "outputs": [{"rotor": "machine"}],
        },
        {"input_speed": ({"start": "300 rpm", "stop": "9000 rpm", "num": 301}, "of the motor")},
    )  # fmt: skip

    kind: Literal["gearbox"] = Field(title="kind of system", description="A multistage gearbox, from its teeth.")
    gears: Teeth = Field(
        default=Teeth(), title="gears", description="What all gears share: basic profile and face width."
    )
    material: Material = Field(default=Material(), title="material", description="Of gears and shafts.")
    rotors: Annotated[list[Rotor], Field(min_length=2)] = Field(title="rotors", description="Gears and inertias.")
    shafts: list[Shaft] = Field(default=[], title="shafts", description="Torsional springs between rotors.")
    planetary_sets: list[PlanetarySet] = Field(
        default=[], title="planetary sets", description="A sun, planets on a carrier and a ring each."
    )
    meshes: list[GearboxMesh] = Field(
        default=[], title="meshes", description="Pairs of gears, the driver first; optional with planetary sets."
    )
    input: Input = Field(title="input", description="The rotor that drives the train.")
    outputs: list[Output] = Field(default=[], title="outputs", description="The rotors that are loaded.")

    damping_factor: NonNegative = Field(
        default=1.0, title="damping factor", description="On the damping of meshes, shafts and supports (1)."
    )

    def equations(self) -> GearSystem:
        """See :func:`gearstab.systems.gearbox.build.build`."""
        return build(self)

    def train(self) -> Train:
        return Train(self)

    @classmethod
    def mesh_places(cls, raw: dict[str, Any]) -> Iterator[tuple[Path, dict[str, Any]]]:
        """Yield those of the sets, which may be described by their teeth alone, too."""
        for k, item in items(raw.get("planetary_sets")):
            for name in ("sun", "ring"):
                yield ("planetary_sets", k, "meshes", name), mapping(mapping(mapping(item).get("meshes")).get(name))
        yield from super().mesh_places(raw)

    @classmethod
    def complete(cls, document: Document, raw: dict[str, Any], size: int | None) -> None:
        """Write out the angles of planets that are to be assembled."""
        complete_angles(document, raw)

    def check_feasible(self, document: Document, grid: Grid[Any]) -> None:
        """See :func:`gearstab.systems.gearbox.feasibility.check_train`."""
        check_train(document, grid)

    @classmethod
    def size(cls, raw: dict[str, Any]) -> int | None:
        turning = cls.turning(raw)
        return None if turning is None else len(turning)

    @classmethod
    def turning(cls, raw: dict[str, Any]) -> list[bool] | None:
        rotors, sets = ([item for _, item in items(raw.get(key))] for key in ("rotors", "planetary_sets"))
        if not rotors or len(rotors) < len(raw["rotors"]):
            return None
        held = {item.get(str(item.get("held"))) for item in sets}
        found = [True for rotor in rotors if turns(rotor, rotor.get("name") in held)]
        found += [False for rotor in rotors if moves(rotor) for _ in "xy"]
        found += [False for rotor in rotors if slides(rotor)]
        for planets in (item.get("planets") or {} for item in sets):
            if not whole(planets.get("count"), 3, MOST_PLANETS):
                return None
            each = [True] if planets.get("support") is None else [True, False, False]
            found += each * int(planets["count"])
        return found

    @classmethod
    def cycles_of_input(cls, raw: dict[str, Any]) -> float | None:
        """Teeth times speed of the first mesh's driver over that of the input."""
        train = Train(raw)
        try:
            return float(train.cycles)
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError):
            return 1.0  # something is wrong with the train, which is reported

    @classmethod
    def follow_speed(cls, raw: dict[str, Any]) -> list[Path]:
        """The speed of ``input``, where the friction of lubricated teeth depends on it."""
        laws = [mesh.get("friction") or {} for _, mesh in items(raw.get("meshes"))]
        lubricated = any(law.get("kind") in LUBRICATED for law in laws)
        return [("input", "speed")] if lubricated and raw.get("input") else []

    @classmethod
    def conflicts(cls, raw: dict[str, Any]) -> Iterator[Conflict]:
        """Names that exist, gears that can mesh, a train that hangs together and turns."""
        yield from super().conflicts(raw)
        if raw.get("units") == "none":
            yield ("units",), "not_applicable", "a gearbox is computed from its teeth, in SI units", "remove it"
        shared = {key for key, value in (raw.get("gears") or {}).items() if value is not None}
        yield from within_each(raw, "rotors", Rotor.conflicts)
        yield from within_each(raw, "shafts", Shaft.conflicts)
        yield from _names(raw)
        yield from set_conflicts(raw)
        yield from missing_of_teeth(raw, shared)
        yield from _loaded(raw)
        yield from _torques(raw)
        yield from _faults(raw)


def _names(raw: dict[str, Any]) -> Iterator[Conflict]:
    """Each rotor and shaft has a name of its own; shafts, meshes, input and outputs name rotors that exist."""
    if not raw.get("meshes") and not raw.get("planetary_sets"):
        yield ("meshes",), "missing", "is missing", "add a mesh of two gears, or planetary_sets"
    for section in ("rotors", "shafts", "planetary_sets"):
        names = Counter(item.get("name") for _, item in items(raw.get(section)))
        for i, item in items(raw.get(section)):
            if item.get("name") is not None and names[item["name"]] > 1:
                names[item["name"]] = 0
                message = f"two {section.replace('_', ' ')} are called '{item['name']}'"
                yield (section, i, "name"), "repeated_name", message, "give each a name of its own"
    rotors = {rotor["name"]: rotor for _, rotor in items(raw.get("rotors")) if isinstance(rotor.get("name"), str)}
    if not rotors or len(rotors) < len(items(raw.get("rotors"))):
        return  # one of two equal names was meant otherwise, which others may refer to
    named: list[tuple[Path, Any, bool]] = [(("input", "rotor"), (raw.get("input") or {}).get("rotor"), False)]
    named += [(("outputs", i, "rotor"), item.get("rotor"), False) for i, item in items(raw.get("outputs"))]
    for section, key in (("shafts", "between"), ("meshes", "gears")):
        for i, item in items(raw.get(section)):
            ends = item.get(key)
            named += [((section, i, key, k), name, section == "meshes") for k, name in items(ends)]
            if ends and len(ends) == 2 and ends[0] == ends[1]:
                yield (section, i, key), "inconsistent", f"joins '{ends[0]}' to itself", "name two different rotors"
    for path, name, geared in named:
        if isinstance(name, str) and name not in rotors:
            yield path, "unknown_name", f"there is no rotor '{name}'", nearest(name, rotors)
        elif isinstance(name, str) and geared and rotors[name].get("teeth") is None:
            yield path, "not_applicable", f"rotor '{name}' has no teeth", "name a gear, or give the rotor teeth"


def _faults(raw: dict[str, Any]) -> Iterator[Conflict]:
    """Weak teeth that there are, of gears that are in the mesh."""
    counts = {rotor.get("name"): rotor.get("teeth") for _, rotor in items(raw.get("rotors"))}
    for i, mesh in items(raw.get("meshes")):
        gears = [name for _, name in items(mesh.get("gears"))]
        yield from below("meshes", below(i, fault_conflicts(mesh, gears, counts)))
    for i, item in items(raw.get("planetary_sets")):
        planets = item.get("planets") or {}
        teeth = {gear: counts.get(item.get(gear)) for gear in ("sun", "ring")} | {"planet": planets.get("teeth")}
        yield from below("planetary_sets", below(i, set_fault_conflicts(item, teeth, planets.get("count"))))


def _loaded(raw: dict[str, Any]) -> Iterator[Conflict]:
    """The friction of lubricated teeth depends on speed and load, relief on the load."""
    driving = raw.get("input") or {}
    torques = [item.get("torque") for item in (driving, *(item for _, item in items(raw.get("outputs"))))]
    unloaded = all(torque is None for torque in torques)
    for place, mesh in Gearbox.mesh_places(raw):
        kind = (mesh.get("friction") or {}).get("kind")
        if kind in LUBRICATED and driving.get("speed") is None:
            message = f"{kind} friction depends on the speed, which is missing"
            yield (*place, "friction"), "needs_other", message, "add speed to input, or choose constant friction"
        if kind in LUBRICATED and unloaded:
            message = f"{kind} friction depends on the load, and there are no torques"
            remedy = "add torques to input or outputs, or choose constant friction"
            yield (*place, "friction"), "needs_other", message, remedy
        if mesh.get("relief") is not None and unloaded:
            message = "what relief does depends on the load, and there are no torques"
            yield (*place, "relief"), "needs_other", message, "add a torque to input, and outputs, or remove relief"


def _torques(raw: dict[str, Any]) -> Iterator[Conflict]:
    """Torques that balance: of all outputs, or of the input alone."""
    outputs = [(i, item.get("torque")) for i, item in items(raw.get("outputs"))]
    given = [i for i, torque in outputs if torque is not None]
    driving = (raw.get("input") or {}).get("torque")
    if given and len(given) < len(outputs):
        missing = next(i for i, torque in outputs if torque is None)
        yield ("outputs", missing, "torque"), "missing", "is missing", "give every output a torque, or none"
    if given and driving is not None:
        message = "follows from the torques of the outputs"
        yield ("input", "torque"), "already_given", message, "remove it, or the torques of the outputs"
    seen = {(raw.get("input") or {}).get("rotor"): "the input"}
    for i, item in items(raw.get("outputs")):
        name = item.get("rotor")
        if name is not None and name in seen:
            message = f"rotor '{name}' is {seen[name]} already"
            yield ("outputs", i, "rotor"), "already_given", message, "name another rotor, or add the torques up"
        seen.setdefault(name, "an output")
    for i, item in items(raw.get("planetary_sets")):
        name = item.get(str(item.get("held")))
        if name is not None and name in seen:
            message = f"rotor '{name}' is {seen[name]}, which turns"
            yield ("planetary_sets", i, "held"), "inconsistent", message, "hold another member"
    if driving is not None and not outputs:
        yield ("outputs",), "missing", "are missing", "name the rotors that take the torque"
