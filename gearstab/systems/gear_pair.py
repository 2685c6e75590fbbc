"""Gear pairs on rigid shafts: one degree of freedom, the dynamic transmission error or the deflection of the teeth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import isclose, tau
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from gearstab import rotating_pair
from gearstab.config.document import Document
from gearstab.config.model import Axis
from gearstab.config.model.conflicts import Conflict, at_most_one, exactly_one, wrong_length
from gearstab.config.model.fields import (
    Choice,
    Inertia,
    Length,
    Mass,
    NonNegative,
    Quantity,
    Teeth,
    TorsionalStiffness,
    optional,
)
from gearstab.config.model.reading import known
from gearstab.mesh import Mesh as MeshOfSystem
from gearstab.rotating_pair import CLASSICAL, FORMULATIONS, PairNumbers
from gearstab.system import Array, GearSystem
from gearstab.systems.assembly import Assembly, Coordinates, Element, MeshElement
from gearstab.systems.base import START_MESH, Start, System
from gearstab.systems.forcing import LoadOfOne
from gearstab.systems.mesh import NamedToothMesh
from gearstab.waveforms import Rectangular

if TYPE_CHECKING:
    from gearstab.systems.respond import PairRespond


OF_GEARS = ("teeth", "inertias", "torsional_stiffness", "single_contact_angle", "torque", "module", "radii")
"""Keys of a pair that is given by its gears, and not by an equivalent mass and a mesh."""

DECISIVE = ("torsional_stiffness", "single_contact_angle", "torque")
"""Fields that a pair given by an equivalent mass and a mesh can have no use for."""
LEAVE_OUT = "leave it out: equivalent_mass and meshes say all; kind: gearbox computes them from teeth and module"

TOGETHER = f"two gears are given by {', '.join(OF_GEARS[:3])}, single_contact_angle or contact_ratio, torque"

Formulation = Annotated[str, Choice("formulation", FORMULATIONS, axis=True)]


class GearPair(System):
    """A gear pair on rigid shafts: one degree of freedom, the dynamic transmission error."""

    mesh_names: ClassVar[tuple[str, ...]] = ("mesh",)
    misplaced: ClassVar[dict[str, str]] = dict.fromkeys(
        ("module", "radii", "inertias", "face_width", "pressure_angle", "profile_shift"), LEAVE_OUT
    )

    start: ClassVar[Start | None] = Start(
        "A gear pair: the dynamic transmission error is its only coordinate",
        {
            "kind": "gear_pair", "equivalent_mass": 0.5, "damping_ratio": 0.02,
            "meshes": [{"name": "mesh", **START_MESH}],
        },
        {
            "mesh_frequency": ({"start": 5000.0, "stop": 50000.0, "num": 301}, "rad/s; or rpm: \"3000 rpm\""),
            "epsilon": ({"start": 0.0, "stop": 0.4, "num": 41}, "of the mesh"),
        },
    )  # fmt: skip

    kind: Literal["gear_pair"] = Field(title="kind of system")
    """A gear pair on rigid shafts."""
    formulation: Annotated[str, Choice("formulation", (CLASSICAL,))] = CLASSICAL
    """classical: mesh stiffness as a function of time."""
    equivalent_mass: Mass
    """m = 1/(r1^2/J1 + r2^2/J2), along the line of action (kg)."""
    meshes: tuple[NamedToothMesh]
    """Exactly one tooth mesh, such as [{mean_stiffness: 2e8, epsilon: 0.2, contact_ratio: 1.6}]."""
    load: LoadOfOne | None = None
    """The static force along the line of action (N)."""
    teeth: tuple[Teeth, Teeth] | None = optional("numbers of teeth")
    """[N1, N2], for input_speed alone: that of the first gear, which drives."""

    def size(self) -> int:
        return 1

    @classmethod
    def complete(cls, document: Document, source: FilePath) -> dict[str, Array]:
        """The load as a number by itself."""
        if isinstance(document.data["system"].get("load"), int | float | str):
            document.nest(("system", "load"), 0)
        return super().complete(document, source)

    def conflicts(self) -> Iterator[Conflict]:
        """A load of one number."""
        yield from super().conflicts()
        yield from wrong_length(self, "load", 1)

    @classmethod
    def variant(cls, raw: dict[str, Any]) -> type[System]:
        """Two gears, where they are given by their numbers or where the formulation needs them."""
        formulation = raw.get("formulation", CLASSICAL)
        # With an equivalent mass or a mesh the teeth serve the input speed only.
        keys = DECISIVE if "equivalent_mass" in raw or "meshes" in raw else OF_GEARS
        by_gears = any(key in raw for key in keys) or (formulation in FORMULATIONS and formulation != CLASSICAL)
        return RotatingGearPair if by_gears else cls

    def equations(self) -> GearSystem:
        """m x'' + c x' + k(t) x = f(t).

        Parameters: ``equivalent_mass`` m (kg), one mesh, damping. x is the deflection along the line of action.
        """
        load = None if self.load is None else {"x": self.load[0]}
        gear = Element({"x": 1.0}, mass=self.equivalent_mass)
        mesh = MeshElement(self.meshes[0], {"x": 1.0})
        return Assembly(Coordinates({"x": "m"}), [gear], [mesh]).system(self, load)


class RotatingGearPair(System):
    """Two gears whose mesh stiffness depends on their rotation (Oh, Grosh & Barber 2005)."""

    misplaced: ClassVar[dict[str, str]] = {
        "equivalent_mass": TOGETHER,
        "meshes": TOGETHER,
        "speed": "it belongs to the section respond; in a sweep vary mesh_frequency",
    }

    kind: Literal["gear_pair"] = Field(title="kind of system")
    """A gear pair on rigid shafts."""
    formulation: Formulation = CLASSICAL
    """classical: k(Omega t); rigid_kinematic: k(theta); energy_conserving: with the terms in dk/dtheta."""
    teeth: tuple[Teeth, Teeth] = Field(title="numbers of teeth")
    """[N1, N2]; the first gear drives."""
    inertias: tuple[Inertia, Inertia] = Field(title="moment of inertia")
    """[I1, I2] (kg m^2)."""
    torsional_stiffness: tuple[TorsionalStiffness, TorsionalStiffness] = Field(title="torsional mesh stiffness")
    """[k1, k2] with one and with two pairs of teeth in contact; the strain energy is k phi^2 (N m)."""
    single_contact_angle: Annotated[float, Field(gt=0, lt=tau), Quantity("rad")] | None = optional(
        "angle of single contact"
    )
    """Part of the 2 pi of a mesh cycle in theta, from its beginning on (rad); or give contact_ratio."""
    contact_ratio: Annotated[float, Field(gt=1, lt=2), Quantity()] | None = None
    """1 < c < 2: one pair for 2 - c of a mesh cycle, two for c - 1; or give single_contact_angle."""
    torque: Annotated[float, Quantity("N m")]
    """T0: N1 T0 drives the first gear, N2 T0 loads the second one (N m)."""
    damping_ratio: NonNegative | None = None
    """zeta, of w0 = sqrt(M2 (k1 + k2)/2); it acts on phi' in both equations (1)."""
    module: Length | None = None
    """For mesh forces on the pitch circles in newtons (m); or give radii."""
    radii: tuple[Length, Length] | None = optional("radius")
    """[r1, r2] of the circles on which mesh forces act, in the ratio of the teeth (m); or give module."""

    def size(self) -> int:
        return 1

    @classmethod
    def respond_model(cls) -> type[PairRespond]:
        from gearstab.systems.respond import PairRespond

        return PairRespond

    def conflicts(self) -> Iterator[Conflict]:
        """One way to say when one pair is in contact; two pairs stiffer than one; radii that fit the teeth."""
        yield from known(self._incomplete())
        yield from exactly_one(self, ("single_contact_angle", "contact_ratio"))
        if self.damping is not None:
            yield ("damping",), "not_applicable", "is not defined for a pair given by its gears", "give damping_ratio"
        if self.allow_negative_stiffness:
            message = "both stiffnesses are given and positive"
            yield ("allow_negative_stiffness",), "not_applicable", message, "remove it"
        yield from known(self._softer())
        yield from at_most_one(self, ("module", "radii"))
        if self.radii is None or self.module is not None:
            return
        (r1, r2), (n1, n2) = self.radii, self.teeth
        if not isclose(r1 * n2, r2 * n1, rel_tol=1e-6):
            hint = f"make r1/r2 = N1/N2 = {n1}/{n2}"
            yield ("radii",), "inconsistent", "are not in the ratio of the numbers of teeth", hint

    def _softer(self) -> Iterator[Conflict]:
        levels = self.torsional_stiffness  # not always two while values are wrong
        if len(levels) == 2 and levels[1] < levels[0]:
            hint = "give [one pair, two pairs]"
            yield ("torsional_stiffness",), "inconsistent", "two pairs of teeth are softer than one", hint

    def _incomplete(self) -> Iterator[Conflict]:
        """Yield the fields that must be given and those that may be left out, where numbers of teeth stand there and
        something is missing.
        """
        needed = ("inertias", "torsional_stiffness", "torque")
        missing = [key for key in needed if key not in self.model_fields_set]
        if self.contact_ratio is None and self.single_contact_angle is None:
            missing.append("contact_ratio")
        if not missing or "teeth" not in self.model_fields_set or self.formulation != CLASSICAL:
            return
        yield (
            ("teeth",),
            "needs_other",
            f"describe two gears, of which {', '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing",
            "give teeth, inertias, torsional_stiffness, contact_ratio (or single_contact_angle) and torque; module, "
            "radii and damping_ratio may be left out. Or give equivalent_mass and meshes: beside these teeth may be "
            "left out, too, and serve input_speed alone. Or set kind: gearbox, which computes inertias and stiffness "
            "from teeth, module and face_width",
        )

    def unfit(self, axes: Sequence[Axis], methods: Sequence[str]) -> Iterator[Conflict]:
        """Only Floquet theory knows formulations in which the mesh stiffness depends on the rotation."""
        values = {self.formulation}
        for axis in axes:
            values |= {v for item in axis.assignments if item.path == ("formulation",) for v in item.values}
        other = sorted(values - {CLASSICAL})
        for name in methods:
            if other and name != "floquet":
                message = f"does not apply to the formulation {' and '.join(other)}"
                yield (name,), "not_applicable", message, "remove it: floquet alone tells the stability of its orbits"

    def equations(self) -> rotating_pair.RotatingPair:
        """phi''/M2 + (2 zeta w0/M2) phi' + k phi = T0, with k of Omega t or, in other formulations, of the rotation.

        Parameters: ``formulation``, ``teeth``, ``inertias``, ``torsional_stiffness``, ``single_contact_angle`` or
        ``contact_ratio``, ``torque``, ``damping_ratio``, and ``module`` or ``radii`` where lengths are known.
        One pair of teeth is in contact from the beginning of a mesh cycle on. Source: Oh, Grosh & Barber 2005, (1)-(6).
        """
        numbers = _numbers(self)
        batch = numbers.batch
        soft, stiff = (np.asarray(level, dtype=float) for level in numbers.stiffness)
        part = numbers.single_part
        mean = part * soft + (1 - part) * stiff
        # The wave is stiff first; the cycle begins with one pair.
        wave = Rectangular(np.asarray(2 - part))
        mesh = MeshOfSystem("mesh", np.ones(1), mean, (stiff - soft) / (2 * mean), wave, lag=part)
        mass = np.broadcast_to(1 / numbers.m2, batch)[..., None, None]
        damping = 2 * np.asarray(numbers.zeta) * numbers.w0 / numbers.m2
        return rotating_pair.RotatingPair(
            mass=mass,
            stiffness=np.zeros((1, 1)),
            meshes=(mesh,),
            damping=damping[..., None, None] if np.any(damping) else None,
            coordinates=("phi",),
            units=("rad",),
            deflection_unit="rad",
            load=np.asarray(numbers.torque)[..., None],
            formulation=self.formulation,
            numbers=numbers,
        )


def _numbers(p: RotatingGearPair) -> PairNumbers:
    def pair(values: Any) -> tuple[Array, Array]:
        first, second = values
        return np.asarray(first, dtype=float), np.asarray(second, dtype=float)

    single: Any = p.single_contact_angle
    if single is None:
        single = tau * (2 - np.asarray(p.contact_ratio, dtype=float))
    lever = None
    if p.module is not None:
        lever = 0.5 * np.asarray(p.module, dtype=float)
    elif p.radii is not None:
        lever = np.asarray(p.radii[0], dtype=float) / p.teeth[0]
    return PairNumbers(
        teeth=p.teeth,
        inertias=pair(p.inertias),
        stiffness=pair(p.torsional_stiffness),
        single=np.asarray(single, dtype=float),
        torque=np.asarray(p.torque, dtype=float),
        zeta=np.asarray(0.0 if p.damping_ratio is None else p.damping_ratio, dtype=float),
        lever=lever,
    )
