"""The section ``system`` of a gearbox: rotors, shafts and meshes of any connected train."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path as FilePath
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from gearstab.config.document import Document, Path, nearest
from gearstab.config.model import Axis, Grid
from gearstab.config.model.conflicts import Conflict, items, repeated_names, within_each
from gearstab.config.model.fields import NonNegative
from gearstab.config.model.reading import WRONG, known, told
from gearstab.system import Array, GearSystem
from gearstab.systems.base import Start, System
from gearstab.systems.gearbox.bodies import Material, Rotor, Shaft, Teeth, moves, slides, turns
from gearstab.systems.gearbox.build import build
from gearstab.systems.gearbox.faults import fault_conflicts
from gearstab.systems.gearbox.feasibility import check_train, missing_of_teeth
from gearstab.systems.gearbox.loads import Input, Output, TorqueLaw, torque_of
from gearstab.systems.gearbox.meshes import (
    LUBRICATED,
    Friction,
    GearboxMesh,
    PlanetarySet,
    by_name,
    complete_angles,
    set_conflicts,
    set_fault_conflicts,
)
from gearstab.systems.gearbox.train import Train
from gearstab.systems.mesh import ToothMesh

CHANGING = ("passage",)
"""Methods that let the speed of a system change."""
OVER_SPEED = ("boundaries", "tongue_probability")
"""Methods that search the speeds of a system by themselves."""


class Gearbox(System):
    """A train of rotors, shafts and meshes: rotations, and displacements where rotors have a support."""

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

    kind: Literal["gearbox"] = Field(title="kind of system")
    """A multistage gearbox, from its teeth."""
    gears: Teeth = Teeth()
    """Basic profile and face width that all gears share."""
    material: Material = Material()
    """Material of gears and shafts."""
    rotors: Annotated[list[Rotor], Field(min_length=2)]
    """Gears and inertias."""
    shafts: list[Shaft] = Field(default=[])
    """Torsional springs between rotors."""
    planetary_sets: list[PlanetarySet] = Field(default=[])
    """A sun, planets on a carrier and a ring each."""
    meshes: list[GearboxMesh] = Field(default=[])
    """Pairs of gears, the driver first; optional with planetary sets."""
    input: Input
    """The rotor that drives the train."""
    outputs: list[Output] = Field(default=[])
    """The rotors that are loaded."""

    damping_factor: NonNegative = 1.0
    """On the damping of meshes, shafts and supports (1)."""

    def equations(self) -> GearSystem:
        """See :func:`gearstab.systems.gearbox.build.build`."""
        return build(self)

    def train(self) -> Train:
        return Train(self)

    def mesh_places(self) -> Iterator[tuple[Path, ToothMesh]]:
        """Yield those of the sets, which may be described by their teeth alone, too."""
        for k, item in items(self.planetary_sets):
            for name, mesh in items(item.meshes):
                yield ("planetary_sets", k, "meshes", name), mesh
        yield from super().mesh_places()

    @classmethod
    def complete(cls, document: Document, source: FilePath) -> dict[str, Array]:
        """Write out the angles of planets that are to be assembled."""
        complete_angles(document, document.data["system"])
        return super().complete(document, source)

    def check_feasible(self, document: Document, grid: Grid[Any]) -> None:
        """See :func:`gearstab.systems.gearbox.feasibility.check_train`."""
        check_train(document, grid)

    def size(self) -> int | None:
        return len(self.turning())

    def turning(self) -> list[bool]:
        held = {item[str(item.held)] for item in self.planetary_sets if item.held is not None}
        found = [True for rotor in self.rotors if turns(rotor.support, rotor.name in held)]
        found += [False for rotor in self.rotors if moves(rotor.support) for _ in "xy"]
        found += [False for rotor in self.rotors if slides(rotor.support)]
        for item in self.planetary_sets:
            found += ([True] if item.planets.support is None else [True, False, False]) * int(item.planets.count)
        return found

    def cycles_of_input(self) -> float | None:
        """Teeth times speed of the first mesh's driver over that of the input."""
        try:
            return float(Train(self).cycles)
        except (ArithmeticError, LookupError, TypeError, ValueError):
            return 1.0  # something is wrong with the train, which is reported

    def follow_speed(self) -> list[Path]:
        """The speed of ``input``, where the friction of lubricated teeth or a torque depends on it."""
        laws = [mesh.friction for _, mesh in items(self.meshes) if mesh.friction is not None]
        depends = any(law.kind in LUBRICATED for law in laws) or any(True for _ in self._laws())
        return [("input", "speed")] if depends else []

    def held_frequency(self) -> float | None:
        """The mesh frequency at the speed of ``input``, where a torque depends on it."""
        speed, cycles = self.input.speed, self.cycles_of_input()
        return None if speed is None or not any(True for _ in self._laws()) else float(speed) * float(cycles or 1.0)

    def unfit(self, axes: Sequence[Axis], methods: Sequence[str]) -> Iterator[Conflict]:
        """Yield methods over a mesh frequency at which torques that depend on the speed are not taken."""
        yield from super().unfit(axes, methods)
        names = {axis.name for axis in axes if axis.size > 1}
        if "input_speed" in names and told(lambda: bool(self.follow_speed())):
            for name in (name for name in methods if name in OVER_SPEED):
                message = "is over the speed of one system, and its friction or torque depends on the speed"
                yield (name,), "not_applicable", message, "map it with methods.floquet, or make both constant"
        place = told(lambda: next((".".join(map(str, place)) for place, _ in self._laws()), None))
        for name in methods if place is not None else ():
            if name in CHANGING or "mesh_frequency" in names:
                message = f"the torque of {place} depends on the speed, which changes here"
                remedy = f"remove {name}, or give a constant torque" if name in CHANGING else "sweep over input_speed"
                yield (name,), "not_applicable", message, remedy

    def _laws(self) -> Iterator[tuple[Path, TorqueLaw]]:
        """Yield the torques that depend on the speed, and where they are."""
        ends: list[tuple[Path, Any]] = [] if self.input is WRONG else [(("input",), self.input)]
        ends += [(("outputs", k), item) for k, item in items(self.outputs)]
        for place, item in ends:
            if item.torque_law is not None and item.torque_law is not WRONG:
                yield (*place, "torque_law"), item.torque_law

    def conflicts(self) -> Iterator[Conflict]:
        """Names that exist, gears that can mesh, a train that hangs together and turns."""
        yield from super().conflicts()
        if self.units == "none":
            yield ("units",), "not_applicable", "a gearbox is computed from its teeth, in SI units", "remove it"
        yield from within_each(self, "rotors", Rotor.conflicts)
        yield from within_each(self, "shafts", Shaft.conflicts)
        if not self.meshes and not self.planetary_sets:
            yield ("meshes",), "missing", "is missing", "add a mesh of two gears, or planetary_sets"
        for section, one in (("rotors", "rotor"), ("shafts", "shaft"), ("planetary_sets", "set")):
            yield from known(repeated_names(self, section, one))
        rules = (self._named_rotors, lambda: set_conflicts(self), lambda: missing_of_teeth(self))
        for rule in (*rules, self._loaded, self._torques, self._speed_of_laws, self._faults):
            yield from known(rule())

    def _named_rotors(self) -> Iterator[Conflict]:
        """Shafts, meshes, input and outputs name rotors that exist."""
        rotors = by_name(self)
        if rotors is None:
            return  # one of two equal names was meant otherwise, which others may refer to
        named: list[tuple[Path, Any, bool]] = (
            [] if self.input is WRONG else [(("input", "rotor"), self.input.rotor, False)]
        )
        named += [(("outputs", i, "rotor"), item.rotor, False) for i, item in items(self.outputs)]
        for section, key in (("shafts", "between"), ("meshes", "gears")):
            for i, item in items(self[section]):
                ends = items(item[key])
                named += [((section, i, key, k), name, section == "meshes") for k, name in ends]
                if len(ends) == 2 and ends[0][1] == ends[1][1]:
                    hint = "name two different rotors"
                    yield (section, i, key), "inconsistent", f"joins '{ends[0][1]}' to itself", hint
        for path, name, geared in named:
            if isinstance(name, str) and name not in rotors:
                yield path, "unknown_name", f"there is no rotor '{name}'", nearest(name, rotors)
            elif isinstance(name, str) and geared and rotors[name].teeth is None:
                yield path, "not_applicable", f"rotor '{name}' has no teeth", "name a gear, or give the rotor teeth"

    def _loaded(self) -> Iterator[Conflict]:
        """The friction of lubricated teeth depends on speed and load, relief on the load."""
        torques = [torque_of(self.input), *(torque_of(item) for _, item in items(self.outputs))]
        unloaded = all(torque is None for torque in torques)
        for place, mesh in self.mesh_places():
            friction, relief = (getattr(mesh, key, None) for key in ("friction", "relief"))
            if friction is not None:
                for path, code, message, hint in known(self._lubricated(friction, unloaded)):
                    yield (*place, *path), code, message, hint
            if relief is not None and unloaded:
                message = "what relief does depends on the load, and there are no torques"
                yield (*place, "relief"), "needs_other", message, "add a torque to input, and outputs, or remove relief"

    def _speed_of_laws(self) -> Iterator[Conflict]:
        """Yield laws of several forms, beside a constant torque, or without a speed at which they are taken."""
        for place, law in self._laws():
            for path, code, message, hint in known(law.conflicts()):
                yield (*place, *path), code, message, hint
            end = self.input if place[0] == "input" else self.outputs[int(place[1])]
            if end.torque is not None:
                yield place, "already_given", "torque is given already", "keep one of torque and torque_law"
            if self.input.speed is None:
                message = "depends on the speed, which is missing"
                yield place, "needs_other", message, "add speed to input; sweeps set it by the axis input_speed"

    def _faults(self) -> Iterator[Conflict]:
        """Weak teeth that there are, of gears that are in the mesh."""
        counts = {rotor.name: rotor.teeth for _, rotor in items(self.rotors) if isinstance(rotor.name, str)}
        yield from within_each(self, "meshes", lambda mesh: fault_conflicts(mesh, mesh.gears, counts))
        yield from within_each(self, "planetary_sets", lambda item: set_fault_conflicts(item, counts))

    def _lubricated(self, friction: Friction, unloaded: bool) -> Iterator[Conflict]:
        kind = friction.kind
        if kind in LUBRICATED and self.input.speed is None:
            message = f"{kind} friction depends on the speed, which is missing"
            yield ("friction",), "needs_other", message, "add speed to input, or choose constant friction"
        if kind in LUBRICATED and unloaded:
            message = f"{kind} friction depends on the load, and there are no torques"
            hint = "add torques to input or outputs, or choose constant friction"
            yield ("friction",), "needs_other", message, hint

    def _torques(self) -> Iterator[Conflict]:
        """Torques that balance: of all outputs, or of the input alone."""
        outputs = items(self.outputs)
        given = [i for i, item in outputs if torque_of(item) is not None]
        if given and len(given) < len(outputs):
            missing = next(i for i, item in outputs if torque_of(item) is None)
            yield ("outputs", missing, "torque"), "missing", "is missing", "give every output a torque, or none"
        if given and torque_of(self.input) is not None:
            message = "follows from the torques of the outputs"
            key = "torque" if self.input.torque is not None else "torque_law"
            yield ("input", key), "already_given", message, "remove it, or the torques of the outputs"
        if torque_of(self.input) is not None and not outputs:
            yield ("outputs",), "missing", "are missing", "name the rotors that take the torque"
        seen = {self.input.rotor: "the input"}
        for i, item in outputs:
            if item.rotor in seen:
                message = f"rotor '{item.rotor}' is {seen[item.rotor]} already"
                yield ("outputs", i, "rotor"), "already_given", message, "name another rotor, or add the torques up"
            seen.setdefault(item.rotor, "an output")
        for i, item in items(self.planetary_sets):
            if item.held is not None and item[str(item.held)] in seen:
                message = f"rotor '{item[str(item.held)]}' is {seen[item[str(item.held)]]}, which turns"
                yield ("planetary_sets", i, "held"), "inconsistent", message, "hold another member"
