"""Results of the teeth of a mesh: geometry, stiffness and friction, one pair of gears for each entry of the batch."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from math import tan
from typing import Any

import numpy as np

from gearstab.config.model.reading import held
from gearstab.gears.friction import BenedictKelley, ConstantFriction, FrictionLaw, XuKahraman, mesh_friction
from gearstab.gears.geometry import Gear
from gearstab.gears.loaded import loaded_mesh
from gearstab.gears.mesh_stiffness import MeshStiffness, StiffnessModel, contact_stiffness, mesh_stiffness
from gearstab.gears.pair import Pair
from gearstab.gears.relief import FlankRelief, LoadedMesh, Relief
from gearstab.system import Array
from gearstab.systems.gearbox.bodies import number
from gearstab.systems.gearbox.meshes import CONTACT_RATIO, MEAN, POWERS, VARIATION, WAVE, from_teeth, per_width
from gearstab.waveforms import WAVEFORMS, Fourier, Helical, Tooth
from gearstab.waveforms.tooth import Piecewise, stacked

Numbers = dict[tuple[str, str], float]

OF_GEAR = {"module": None, "pressure_angle": None, "face_width": None, "profile_shift": 0.0, "addendum": 1.0,
           "dedendum": 1.25, "bore_radius": None, "tip_shortening": 0.0}  # fmt: skip
OF_MATERIAL = ("young", "poisson", "density")


def entries_of(table: Mapping[tuple[str, str], Any]) -> tuple[tuple[int, ...], list[Numbers]]:
    """Return the shape to which numbers broadcast, and all of them, by name, for each of its entries."""
    arrays = np.broadcast_arrays(*(np.asarray(value, dtype=float) for value in table.values()))
    rows = zip(*(array.ravel().tolist() for array in arrays), strict=True)
    return arrays[0].shape, [dict(zip(table, row, strict=True)) for row in rows]


@dataclass(frozen=True)
class MeshTeeth:
    """The teeth of one mesh.

    gears: parameters of driver and driven gear; p: of the mesh; material: of both gears. load: returns the normal
    force, N, where it is known; it may raise TrainError.
    """

    gears: tuple[dict[str, Any], dict[str, Any]]
    p: Any
    material: dict[str, Any]
    load: Callable[[], Array] | None = None

    @cached_property
    def _inputs(self) -> tuple[tuple[int, ...], list[Numbers]]:
        """Batch shape, and for each of its entries all numbers that matter, by name."""
        table: dict[tuple[str, str], Array] = {}
        for side, gear in zip(("driver", "driven"), self.gears, strict=True):
            table[side, "helix_angle"] = number(gear.get("helix_angle"))
            for name, default in OF_GEAR.items():
                if gear.get(name) is not None or default is not None:
                    table[side, name] = number(gear.get(name), default or 0.0)
        for name in OF_MATERIAL:
            table["material", name] = np.asarray(self.material[name], dtype=float)
        for name in ("centre_distance", "double_contact_factor", "single_pair_stiffness", "variation"):
            if getattr(self.p, name, None) is not None:
                table["mesh", name] = number(self.p[name])
        if self.relieved:
            table["mesh", "force"] = self.force
            for flank, part in self._flanks.items():
                table |= {(flank, key): number(part[key]) for key in ("amount", "length")}
        return entries_of(table)

    @property
    def batch(self) -> tuple[int, ...]:
        return self._inputs[0]

    @cached_property
    def pairs(self) -> list[Pair]:
        """One for each entry of the batch. Raises ValueError for gears that cannot mesh."""
        return [self._pair(numbers) for numbers in self._inputs[1]]

    def _pair(self, numbers: Numbers) -> Pair:
        material = {name: numbers["material", name] for name in OF_MATERIAL}
        driver, driven = (
            Gear(
                teeth=int(gear["teeth"]),
                internal=bool(gear.get("internal")),
                **{name: numbers[side, name] for name in OF_GEAR if (side, name) in numbers},
                helix_angle=abs(numbers[side, "helix_angle"]) * (-1 if gear.get("hand") == "left" else 1),
                **material,
            )
            for side, gear in zip(("driver", "driven"), self.gears, strict=True)
        )
        centre = numbers.get(("mesh", "centre_distance"))
        # The pinion of an internal pair is the external gear, whichever of the two drives.
        return Pair(driven, driver, centre, wheel_drives=True) if driver.internal else Pair(driver, driven, centre)

    @property
    def _flanks(self) -> dict[str, Any]:
        """The sections of relief, of ``tip`` and ``root``."""
        return held(getattr(self.p, "relief", None))

    @property
    def relieved(self) -> bool:
        """Whether the teeth have relief."""
        return bool(self._flanks)

    @cached_property
    def force(self) -> Array:
        """The normal force, N. Raises TrainError where it is not known."""
        assert self.load is not None, "only meshes of a train are loaded"
        return self.load()

    @property
    def helical(self) -> bool:
        """Whether a gear has a helix angle."""
        return any(np.any(number(gear.get("helix_angle"))) for gear in self.gears)

    @property
    def lead(self) -> Array:
        """tan beta_b of the driver, positive of a right-handed one."""
        return self.each(lambda pair: tan(pair.pinion.base_helix))

    @cached_property
    def models(self) -> list[StiffnessModel]:
        return [
            StiffnessModel(
                double_contact_factor=numbers.get(("mesh", "double_contact_factor"), 1.0),
                single_pair_stiffness=numbers.get(("mesh", "single_pair_stiffness")),
                variation=numbers.get(("mesh", "variation")),
            )
            for numbers in self._inputs[1]
        ]

    @cached_property
    def stiffness(self) -> list[MeshStiffness]:
        """Over the mesh cycle, the tangent one of teeth with relief. Raises ValueError where it cannot be computed."""
        if self.relieved:
            return [*self.loaded]
        return [mesh_stiffness(pair, model) for pair, model in zip(self.pairs, self.models, strict=True)]

    @cached_property
    def loaded(self) -> list[LoadedMesh]:
        """Under the force of the mesh. Raises NotPossible where it cannot be computed or is not known."""
        forces = np.broadcast_to(self.force, self.batch).ravel() if not self.relieved else None
        found: list[LoadedMesh] = []
        for k, numbers in enumerate(self._inputs[1]):
            force = numbers["mesh", "force"] if forces is None else float(forces[k])
            found.append(loaded_mesh(self.pairs[k], self.models[k], self._relief(numbers), force))
        return found

    def _relief(self, numbers: Numbers) -> Relief:
        """Relief of both gears alike."""
        flanks = {
            f"{gear}_{flank}": FlankRelief(numbers[flank, "amount"], numbers[flank, "length"], POWERS[part.form])
            for flank, part in self._flanks.items()
            for gear in ("pinion", "wheel")
        }
        return Relief(**flanks)

    @property
    def error(self) -> Piecewise:
        """The static transmission error of teeth with relief, m, over the mesh cycle."""
        return stacked([mesh.error for mesh in self.loaded], self.batch)

    @property
    def start(self) -> Array:
        """The phase at which a rectangular wave begins; 0 of other waves, and where contact does not depend on load."""
        if not self.relieved or self.p.waveform.kind != "rectangular":
            return np.zeros(())
        return self.of_stiffness(lambda mesh: mesh.start)

    def each(self, value: Callable[[Pair], float]) -> Array:
        """A number of every pair, as an array of the batch."""
        return np.reshape([value(pair) for pair in self.pairs], self.batch)

    def of_stiffness(self, value: Callable[[MeshStiffness], float]) -> Array:
        """A number of every mesh stiffness, as an array of the batch."""
        return np.reshape([value(mesh) for mesh in self.stiffness], self.batch)

    @property
    def contact_ratio(self) -> Array:
        """In the transverse section; of teeth with relief, under load."""
        if self.relieved:
            return self.of_stiffness(lambda mesh: mesh.contact_ratio)
        return self.each(lambda pair: pair.contact_ratio)

    def filled(self) -> Any:
        """Return the section of the mesh with what the teeth give: mean stiffness, epsilon, contact ratio and wave."""
        p: dict[str, Any] = {}
        wanted = from_teeth(self.p)
        kind = self.p.waveform.kind
        rectangular = WAVEFORMS[kind].has_contact_ratio
        if per_width(self.p) is not None:
            p["mean_stiffness"] = number(per_width(self.p)) * self.each(lambda pair: pair.face_width)
        elif MEAN in wanted:
            p["mean_stiffness"] = self.of_stiffness(lambda mesh: mesh.mean)
        if CONTACT_RATIO in wanted and rectangular:
            p["contact_ratio"] = self.contact_ratio
        if VARIATION in wanted:
            keep: Any = getattr(self.p, "reduction", "levels")
            p["epsilon"] = self.of_stiffness(lambda mesh: (mesh.rectangular(keep) if rectangular else mesh).epsilon)
        if kind == "rectangular" and self.helical:
            ratio = p.get("contact_ratio", self.p.contact_ratio)
            p["wave"] = Helical(ratio, self.each(lambda pair: pair.overlap_ratio))
        elif WAVE in wanted:
            p["wave"] = self.wave()
        return self.p.model_copy(update=p)

    def wave(self) -> Tooth | Fourier:
        """The wave of the computed stiffness, or its first harmonics."""
        harmonics = self.p.waveform.harmonics
        ratio = None if self.relieved else self.each(lambda pair: pair.total_contact_ratio)
        whole = Tooth(stacked([mesh.curve for mesh in self.stiffness], self.batch), ratio)
        if harmonics is None:
            return whole
        pairs = [whole.fourier(s) for s in range(1, int(harmonics) + 1)]
        return Fourier(*(np.stack([pair[side] for pair in pairs], axis=-1) for side in (0, 1)))

    def given_contact_ratio(self, p: Any) -> Array:
        """Return the contact ratio that a mesh with these parameters gives, else that of the teeth."""
        given = p.contact_ratio
        return self.each(lambda pair: pair.contact_ratio) if given is None else np.asarray(given, dtype=float)

    def one_pair(self, x: Array, cycle: Array) -> Array:
        """The computed stiffness of a pair of teeth, x mesh periods after it entered, ``(..., *batch)``."""
        found = np.empty(np.broadcast_shapes(np.shape(x), self.batch))
        x, cycle = np.broadcast_to(x, found.shape), np.broadcast_to(cycle, found.shape).astype(int)
        for k, index in enumerate(np.ndindex(*self.batch)):
            of = (..., *index)
            every = contact_stiffness(self.pairs[k], x[of], self.models[k])[1]
            found[of] = np.take_along_axis(every, cycle[of][..., None], axis=-1)[..., 0]
        return found

    def friction(self, law: Any, speed: Array, force: Array) -> Rubbing:
        """Its functions of the mesh phase, at the driver's |speed| (rad/s) under the static mesh |force| (N)."""
        shape = np.broadcast_shapes(
            self.batch, np.shape(speed), np.shape(force), *(np.shape(value) for _, value in law)
        )
        speeds, forces = (np.broadcast_to(np.abs(value), shape).ravel() for value in (speed, force))
        index = np.broadcast_to(np.arange(len(self.pairs)).reshape(self.batch), shape).ravel()
        laws = list(_laws(law, shape))
        found = []
        for k, at in enumerate(index):
            pair = self.pairs[at]
            pinion_speed = float(speeds[k]) * (pair.ratio if pair.wheel_drives else 1.0)
            found.append(mesh_friction(pair, laws[k], pinion_speed, float(forces[k]), self.models[at]))
        length = np.reshape([item.length for item in found], shape)
        shares = (stacked([getattr(item, name) for item in found], shape) for name in ("share", "share_arm"))
        return Rubbing(length, found[0].wheel_sign, *shares)


def _laws(law: Any, shape: tuple[int, ...]) -> Iterator[FrictionLaw]:
    """The law of friction for each entry of a batch; oil in cP and roughness in um, as the regressions have them."""

    def flat(name: str, unit: float = 1.0) -> Array:
        return np.broadcast_to(number(law[name]) / unit, shape).ravel()

    if law.kind == "constant":
        yield from (ConstantFriction(float(level)) for level in flat("coefficient"))
        return
    kind = XuKahraman if law.kind == "xu_kahraman" else BenedictKelley
    for viscosity, roughness in zip(flat("viscosity", 1e-3), flat("roughness", 1e-6), strict=True):
        yield kind(float(viscosity), float(roughness))


@dataclass(frozen=True)
class Rubbing:
    """Friction of a mesh over a batch; see :class:`~gearstab.gears.friction.MeshFriction`.

    length: L, between the tangent points of the line of action, m. share: sum sigma mu k_p/k.
    share_arm: sum sigma mu s_p k_p/k, m.
    """

    length: Array
    wheel_sign: int
    share: Piecewise
    share_arm: Piecewise
