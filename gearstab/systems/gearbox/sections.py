"""The section ``system`` of a gearbox: rotors, shafts and meshes of any connected train."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Field

from gearstab.config.document.problems import Path, nearest
from gearstab.config.document.yaml import Document
from gearstab.config.model.conflicts import Conflict, items, within_each
from gearstab.config.model.fields import (
    AngularFrequency,
    Choice,
    Flag,
    Inertia,
    Length,
    Mass,
    NameText,
    NonNegative,
    NonNegativeLength,
    Number,
    Positive,
    Quantity,
    Section,
    Stiffness,
    ToothCount,
    TorsionalStiffness,
)
from gearstab.system import GearSystem
from gearstab.systems.base import Start, System
from gearstab.systems.gearbox.build import build
from gearstab.systems.gearbox.feasibility import check_train
from gearstab.systems.gearbox.mesh import LUBRICATED, GearboxMesh
from gearstab.systems.gearbox.missing import missing_of_teeth
from gearstab.systems.gearbox.train import Train
from gearstab.systems.parts.mesh import Named, ToothMesh

if TYPE_CHECKING:
    from gearstab.config.model.axes import Grid

Torque = Annotated[float, Field(gt=0), Quantity("N m")]
PressureAngle = Annotated[float, Field(gt=0, lt=0.7853), Quantity("rad")]
Pressure = Annotated[float, Field(gt=0), Quantity("Pa")]

OF_TEETH = ("module", "pressure_angle", "addendum", "dedendum", "face_width")
"""What all gears of a train share unless a gear has its own."""


class Support(Section):
    """Springs that hold the centre of a rotor, the same in both directions."""

    stiffness: Stiffness = Field(title="lateral stiffness", description="Of shaft and bearings together (N/m).")
    damping_ratio: NonNegative = Field(
        default=0.0, title="damping ratio of the support", description="zeta, c = 2 zeta sqrt(k m) (1)."
    )


class Teeth(Section):
    """Basic profile and width of gears."""

    module: Length | None = Field(default=None, title="module", description="m (m).")
    pressure_angle: PressureAngle | None = Field(
        default=None, title="pressure angle", description='alpha of the rack; in rad, or with a unit: "20 deg".'
    )
    addendum: Positive | None = Field(default=None, title="addendum", description="h_a/m; 1 without (1).")
    dedendum: Positive | None = Field(default=None, title="dedendum", description="h_f/m; 1.25 without (1).")
    face_width: Length | None = Field(default=None, title="face width", description="b (m).")


class Rotor(Teeth, Named):
    """A rigid body that turns: a gear, which has teeth, or a plain inertia."""

    teeth: ToothCount | None = Field(
        default=None, title="number of teeth", description="z; a rotor without teeth is no gear."
    )
    internal: Flag = Field(default=False, title="internal gear", description="A ring with teeth inside.")
    profile_shift: Number = Field(default=0.0, title="profile shift", description="x, in modules (1).")
    inertia: Inertia | None = Field(
        default=None,
        title="moment of inertia",
        description="J (kg m^2); that of a disc of the face width and body_radius without.",
    )
    mass: Mass | None = Field(
        default=None, title="mass", description="Of a supported rotor (kg); that of the same disc without."
    )
    body_radius: Length | None = Field(
        default=None, title="radius of the body", description="Of the disc (m); the pitch radius without."
    )
    bore_radius: NonNegativeLength | None = Field(
        default=None,
        title="radius of the bore",
        description="Of the body (m); without, the disc is solid and the teeth stand on a body of bore 0.4 root radii.",
    )
    support: Support | None = Field(
        default=None, title="lateral support", description="With it the rotor moves in its plane too."
    )

    @classmethod
    def conflicts(cls, raw: dict[str, Any]) -> Iterator[Conflict]:
        """Inertia, and mass where it is supported, of what is no disc; teeth where there is what belongs to them."""
        geared = raw.get("teeth") is not None
        if not geared and raw.get("body_radius") is None:
            if raw.get("inertia") is None:
                yield (
                    ("inertia",),
                    "missing",
                    "is missing",
                    "add inertia (kg m^2), or face_width and body_radius of its disc",
                )
            if raw.get("support") is not None and raw.get("mass") is None:
                yield ("mass",), "missing", "is missing", "add mass (kg), or face_width and body_radius of its disc"
        if not geared:
            for key in (*OF_TEETH[:-1], "profile_shift", "internal"):
                if raw.get(key) not in (None, False):
                    yield (key,), "not_applicable", "belongs to a gear", "give the rotor teeth, or remove it"


class Shaft(Named):
    """A torsional spring between two rotors that turn at the same speed."""

    between: Annotated[list[NameText], Field(min_length=2, max_length=2)] = Field(
        title="ends of the shaft", description="Names of its two rotors."
    )
    stiffness: TorsionalStiffness | None = Field(
        default=None, title="torsional stiffness", description="k (N m/rad); or give diameter and length."
    )
    diameter: Length | None = Field(default=None, title="diameter", description="d of a round shaft (m).")
    bore: NonNegativeLength | None = Field(
        default=None, title="bore", description="Diameter of the hole of a hollow shaft (m)."
    )
    length: Length | None = Field(default=None, title="length", description="l of a round shaft (m).")
    damping_ratio: NonNegative = Field(
        default=0.0,
        title="damping ratio of the shaft",
        description="zeta, c = 2 zeta sqrt(k J_e), J_e = J1 J2/(J1 + J2) (1).",
    )

    @classmethod
    def conflicts(cls, raw: dict[str, Any]) -> Iterator[Conflict]:
        """A stiffness, or the dimensions that give it."""
        if raw.get("stiffness") is None and raw.get("diameter") is None and raw.get("length") is None:
            yield ("stiffness",), "missing", "is missing", "add stiffness (N m/rad), or diameter and length"
            return
        for key in ("diameter", "length"):
            if raw.get("stiffness") is not None and raw.get(key) is not None:
                yield (key,), "already_given", "stiffness is given already", "keep one of stiffness and the dimensions"
            elif raw.get("stiffness") is None and raw.get(key) is None:
                yield (key,), "missing", "is missing", f"add {key}, or give stiffness instead"


class Material(Section):
    """What gears and shafts are made of; steel without."""

    young: Pressure | None = Field(default=None, title="Young's modulus", description="E (Pa); 206.8 GPa without.")
    poisson: Annotated[float, Field(gt=-1, lt=0.5), Quantity()] | None = Field(
        default=None, title="Poisson's ratio", description="nu (1); 0.3 without."
    )
    density: Annotated[float, Field(gt=0), Quantity("kg/m^3")] | None = Field(
        default=None, title="density", description="rho (kg/m^3); 7850 without."
    )
    shear: Pressure | None = Field(default=None, title="shear modulus of shafts", description="G (Pa); 80 GPa without.")


class Input(Section):
    """What drives the train."""

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
    meshes: Annotated[list[GearboxMesh], Field(min_length=1)] = Field(
        title="meshes", description="Pairs of gears, the driver first."
    )
    input: Input = Field(title="input", description="The rotor that drives the train.")
    outputs: list[Output] = Field(default=[], title="outputs", description="The rotors that are loaded.")

    damping_factor: NonNegative = Field(
        default=1.0, title="damping factor", description="On the damping of meshes, shafts and supports (1)."
    )

    @classmethod
    def build(cls, p: dict[str, Any]) -> GearSystem:
        """See :func:`gearstab.systems.gearbox.build.build`."""
        return build(p)

    @classmethod
    def train(cls, p: dict[str, Any]) -> Train:
        return Train(p)

    @classmethod
    def check_feasible(cls, document: Document, grid: Grid) -> None:
        """See :func:`gearstab.systems.gearbox.feasibility.check_train`."""
        check_train(document, grid)

    @classmethod
    def size(cls, raw: dict[str, Any]) -> int | None:
        rotors = [rotor for _, rotor in items(raw.get("rotors"))]
        if not rotors or len(rotors) < len(raw["rotors"]):
            return None
        return len(rotors) + 2 * sum(rotor.get("support") is not None for rotor in rotors)

    @classmethod
    def turning(cls, raw: dict[str, Any]) -> list[bool] | None:
        size, rotors = cls.size(raw), raw.get("rotors")
        return None if size is None or not rotors else [k < len(rotors) for k in range(size)]

    @classmethod
    def cycles_of_input(cls, raw: dict[str, Any]) -> float | None:
        """Teeth times speed of the first mesh's driver over that of the input."""
        train = Train(raw)
        try:
            return float(train.motions[0].frequency(train.speeds))
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
        yield from missing_of_teeth(raw, shared)
        yield from _lubricated(raw)
        yield from _torques(raw)


def _names(raw: dict[str, Any]) -> Iterator[Conflict]:
    """Each rotor and shaft has a name of its own; shafts, meshes, input and outputs name rotors that exist."""
    for section in ("rotors", "shafts"):
        names = Counter(item.get("name") for _, item in items(raw.get(section)))
        for i, item in items(raw.get(section)):
            if item.get("name") is not None and names[item["name"]] > 1:
                names[item["name"]] = 0
                message = f"two {section} are called '{item['name']}'"
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


def _lubricated(raw: dict[str, Any]) -> Iterator[Conflict]:
    """The friction of lubricated teeth depends on speed and load."""
    driving = raw.get("input") or {}
    for i, mesh in items(raw.get("meshes")):
        kind = (mesh.get("friction") or {}).get("kind")
        if kind not in LUBRICATED:
            continue
        if driving.get("speed") is None:
            message = f"{kind} friction depends on the speed, which is missing"
            yield ("meshes", i, "friction"), "needs_other", message, "add speed to input, or choose constant friction"
        outputs = [item.get("torque") for _, item in items(raw.get("outputs"))]
        if driving.get("torque") is None and all(torque is None for torque in outputs):
            message = f"{kind} friction depends on the load, and there are no torques"
            yield (
                ("meshes", i, "friction"),
                "needs_other",
                message,
                "add torques to input or outputs, or choose constant friction",
            )


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
    if driving is not None and not outputs:
        yield ("outputs",), "missing", "are missing", "name the rotors that take the torque"
