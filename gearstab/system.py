"""The one abstraction of the package: a linear gear system with periodic mesh stiffness.

    M q'' + C(t) q' + K(t) q = f(t),
    K(t) = K0 + sum_i k_i(t) g_i g_i^T + sum_j a_j(t) u_j v_j^T,    k_i(t) = k_gi + k_vi(t)
    C(t) = C + sum_j c_j(t) u_j v_j^T

and, with speeds of rotation W, W G q' + (W H + W^2 K) q besides (:mod:`gearstab.mesh`),

with one direction g_i a tooth mesh and, where something else varies or is not symmetric (friction, a mesh damping that
follows the mesh stiffness), periodic terms.

Systems (``gearstab.systems``) build it, methods (Floquet, perturbation, response) read it, and neither knows
about the other. Every array may carry leading *batch* dimensions, one entry per grid row, so that a
whole slab of a sweep is built and solved with a handful of array operations.

At the end the features of a system are compared with those that a theory supports; the default is to refuse.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from fractions import Fraction
from functools import cached_property
from math import gcd, lcm, prod

import numpy as np

from gearstab.errors import NotPossible
from gearstab.mesh import Connection, Mesh, PeriodicForce, PeriodicTerm, Rotation

Array = np.ndarray

ASYMMETRIC = 1e-12
"""Part of the largest entry by which a matrix and its transpose may differ by rounding."""


class Feature(Enum):
    """Property of a system that a theory must support; a method declares those that it does and refuses others."""

    PERIODIC_TERMS = "periodic terms besides the mesh stiffness"
    UNSYMMETRIC_DAMPING = "a damping matrix that is not symmetric"
    ROTATION = "matrices that act with a speed of rotation"
    IRRATIONAL_RATIO = "mesh frequencies of irrational ratio"
    FOLLOWS_ROTATION = "a mesh stiffness that follows the rotation"


@dataclass(frozen=True)
class Cyclic:
    """Cyclic symmetry of the mean system: turned by 2 pi/N it is the same.

    Parameters
    ----------
    order: N.
    turn: ``(n, n)``, R with R^T M R = M and R^T K R = K: the displacement R q is q turned by 2 pi/N. It is 1 on
        coordinates that are not of the part that has the symmetry.
    types: what modes are called that a turn by 2 pi/N takes into cos(2 pi T/N) of themselves, from T = 0 on; the last
        name is that of all further T.
    still: what modes without mesh deflection are called.
    name: of the part of the system that has the symmetry, "" for all of it.
    """

    order: int
    turn: Array
    types: tuple[str, ...]
    still: str = "no mesh deflection"
    name: str = ""


@dataclass(frozen=True)
class GearSystem:
    """M, C, K0 and the meshes.

    Parameters
    ----------
    mass, stiffness: ``(..., n, n)``, symmetric; ``stiffness`` is K0, everything but the meshes.
    damping: ``(..., n, n)`` or None for an undamped system; its antisymmetric part is gyroscopic.
    meshes: at least one.
    coordinates: names of the n coordinates.
    terms: further periodic parts of K(t) and C(t), which need not be symmetric.
    load: ``(..., n)``, the constant part of f(t), or None. Stability does not depend on f(t).
    forces: the periodic parts of f(t).
    rotations: speeds of rotation, and the gyroscopic, circulatory and centripetal matrices that act with them.
    connections: bearings and shafts, parts of K0 and C whose forces responses give.
    symmetries: of the mean system, each of another part. They name modes, and modes of different types are taken as
        uncoupled where the mesh stiffnesses of every moment and the damping have them as well, which is looked at.
    units: SI unit of each coordinate, ``m`` or ``rad``; without any all are m. Results and figures say it, nothing
        relies on it.
    deflection_unit: SI unit of the mesh deflections g_i^T q, ``m``, or ``rad`` where the mesh stiffness is torsional.
    dimensionless: which of ``mass``, ``length`` and ``time`` have no unit; results say that.
    drawing: what pictures of the modes need besides, by name; attributes of the group ``/modes``.
    """

    mass: Array
    stiffness: Array
    meshes: tuple[Mesh, ...]
    damping: Array | None = None
    coordinates: tuple[str, ...] = ()
    symmetries: tuple[Cyclic, ...] = ()
    terms: tuple[PeriodicTerm, ...] = ()
    load: Array | None = None
    forces: tuple[PeriodicForce, ...] = ()
    rotations: tuple[Rotation, ...] = ()
    connections: tuple[Connection, ...] = ()
    units: tuple[str, ...] = ()
    deflection_unit: str = "m"
    dimensionless: tuple[str, ...] = ()
    drawing: Mapping[str, Array] = field(default_factory=dict)

    @property
    def coordinate_units(self) -> tuple[str, ...]:
        """The unit of each of the n coordinates."""
        if "length" in self.dimensionless:
            return ("1",) * self.size
        return self.units or ("m",) * self.size

    @property
    def formulations(self) -> tuple[str, ...]:
        """The formulations of its motion, where there are others than the linear one."""
        return ()

    @property
    def damping_matrix(self) -> Array:
        """C, ``(..., n, n)``, zero for an undamped system."""
        return np.zeros((self.size, self.size)) if self.damping is None else self.damping

    @property
    def damped(self) -> bool:
        """Whether it has a damping matrix."""
        return self.damping is not None

    @property
    def size(self) -> int:
        """n, the number of coordinates."""
        return int(np.shape(self.mass)[-1])

    @cached_property
    def batch(self) -> tuple[int, ...]:
        """The common leading shape of all arrays; ``()`` for a single system."""
        shapes = [np.shape(self.mass)[:-2], np.shape(self.stiffness)[:-2]]
        if self.damping is not None:
            shapes.append(np.shape(self.damping)[:-2])
        for mesh in self.meshes:
            shapes += [np.shape(mesh.direction)[:-1], np.shape(mesh.mean_stiffness)]
            shapes += [np.shape(mesh.epsilon), np.shape(mesh.lag), mesh.waveform.batch]
            if mesh.transmission_error is not None:
                shapes.append(mesh.transmission_error.batch)
            shapes += [error.profile.batch for error in mesh.revolution_errors]
        if self.load is not None:
            shapes.append(np.shape(self.load)[:-1])
        shapes += [term.batch for term in self.terms] + [force.batch for force in self.forces]
        shapes += [rotation.batch for rotation in self.rotations]
        return np.broadcast_shapes(*shapes)

    @cached_property
    def rows(self) -> int:
        """The number of rows of the flattened batch; 1 for a single system."""
        return prod(self.batch)

    def flat(self, values: Array | float, core: int = 0) -> Array:
        """Return values ``(..., *core)`` as ``(rows, *core)``, one entry for each row of the flattened batch.

        core: the number of trailing dimensions that are not of the batch.
        """
        found = np.asarray(values, dtype=float)
        tail = found.shape[found.ndim - core :]
        return np.broadcast_to(found, (*self.batch, *tail)).reshape(self.rows, *tail)

    def operating_points(self, mesh_frequency: Array) -> Array:
        """Return Omega ``(rows, P)`` from mesh frequencies ``(P,)`` for all rows or ``(rows, P)``."""
        omega = np.atleast_1d(np.asarray(mesh_frequency, dtype=float))
        return np.broadcast_to(omega, (self.rows, omega.shape[-1]))

    @property
    def piecewise_constant(self) -> bool:
        """Whether K(t) and C(t) are constant between their jumps."""
        profiles = [profile for term in self.terms for profile in term.profiles]
        return all(part.piecewise_constant for part in (*(mesh.waveform for mesh in self.meshes), *profiles))

    @cached_property
    def features(self) -> frozenset[Feature]:
        """The features that a theory of this system must support."""
        present = {
            Feature.PERIODIC_TERMS: bool(self.terms),
            Feature.UNSYMMETRIC_DAMPING: self.damping is not None and not _symmetric(self.damping),
            Feature.ROTATION: bool(self.rotations),
            Feature.IRRATIONAL_RATIO: not self.commensurate,
        }
        return frozenset(feature for feature, has in present.items() if has)

    @property
    def forced(self) -> bool:
        """Whether anything drives it: a load, forces or transmission errors."""
        errors = any(mesh.transmission_error is not None or mesh.revolution_errors for mesh in self.meshes)
        return self.load is not None or bool(self.forces) or errors

    @property
    def commensurate(self) -> bool:
        """Whether all that varies in K(t) and C(t) has a common period."""
        return all(isinstance(ratio, Fraction) for ratio in self.frequency_ratios)

    @property
    def frequency_ratios(self) -> list[Fraction | float]:
        """Frequency ratios of the meshes, then of the terms."""
        return [mesh.frequency_ratio for mesh in self.meshes] + [term.frequency_ratio for term in self.terms]

    @property
    def all_ratios(self) -> list[Fraction | float]:
        """Frequency ratios of all that varies or drives: meshes, terms, forces, then errors of revolutions."""
        own = [error.frequency_ratio for mesh in self.meshes for error in mesh.revolution_errors]
        return [*self.frequency_ratios, *(force.frequency_ratio for force in self.forces), *own]

    @cached_property
    def whole_meshes(self) -> tuple[Mesh, ...]:
        """The meshes without their parts, which come last."""
        return tuple(mesh for mesh in self.meshes if not mesh.part_of)

    @cached_property
    def wholes(self) -> Array | None:
        """S ``(meshes, whole meshes)``: column j has 1 for mesh j and for its parts; None where no mesh has parts."""
        names = [mesh.name for mesh in self.whole_meshes]
        if len(names) == len(self.meshes):
            return None
        return np.array([[float(name in (mesh.name, mesh.part_of)) for name in names] for mesh in self.meshes])

    def over(self, batch: tuple[int, ...]) -> GearSystem:
        """The same system with the given batch shape, carried by its mass: what varies or not no longer decides it."""
        return replace(self, mass=np.broadcast_to(self.mass, (*batch, self.size, self.size)))

    def mapped(self, matrix: Callable[[Array], Array], vector: Callable[[Array], Array]) -> GearSystem:
        """Return the system with all its matrices ``(..., n, n)`` and all directions and loads ``(..., n)`` mapped."""
        return replace(
            self,
            mass=matrix(self.mass),
            stiffness=matrix(self.stiffness),
            damping=None if self.damping is None else matrix(self.damping),
            meshes=tuple(replace(mesh, direction=vector(mesh.direction)) for mesh in self.meshes),
            terms=tuple(replace(term, left=vector(term.left), right=vector(term.right)) for term in self.terms),
            load=None if self.load is None else vector(self.load),
            forces=tuple(replace(force, direction=vector(force.direction)) for force in self.forces),
            rotations=tuple(rotation.mapped(matrix) for rotation in self.rotations),
            connections=tuple(item.mapped(vector) for item in self.connections),
        )

    def projected(self, basis: Array, coordinates: tuple[str, ...] = ()) -> GearSystem:
        """Return the system with q = B y (Galerkin): M' = B^T M B and so on, g_i' = B^T g_i.

        basis: ``(..., n, m)``. coordinates: names of y. Exact where nothing couples the subspace to what is left out.
        Symmetry, units and pictures of the coordinates q are not those of y.
        """
        back = np.swapaxes(basis, -1, -2)

        def matrix(full: Array) -> Array:
            product = back @ full @ basis
            return 0.5 * (product + np.swapaxes(product, -1, -2)) if _symmetric(full) else product

        mapped = self.mapped(matrix, lambda full: np.einsum("...ip,...i->...p", basis, full))
        return replace(mapped, coordinates=coordinates, symmetries=(), units=(), drawing={})

    def scaled(self, mass: Array, stiffness: Array) -> GearSystem:
        """Return the system in units of a mass and a stiffness ``(...)``, so of sqrt(mass/stiffness) for time."""
        drag = np.sqrt(mass * stiffness)
        meshes = [
            replace(mesh, mean_stiffness=mesh.mean_stiffness / stiffness, damping=mesh.damping / drag)
            for mesh in self.meshes
        ]
        parts = [(replace(term, damping=None), stiffness) for term in self.terms if term.stiffness is not None]
        parts += [(replace(term, stiffness=None), drag) for term in self.terms if term.damping is not None]
        return replace(
            self,
            mass=self.mass / mass[..., None, None],
            stiffness=self.stiffness / stiffness[..., None, None],
            damping=None if self.damping is None else self.damping / drag[..., None, None],
            meshes=tuple(meshes),
            terms=tuple(replace(term, left=term.left / unit[..., None]) for term, unit in parts),
            load=None if self.load is None else self.load / stiffness[..., None],
            forces=tuple(replace(force, direction=force.direction / stiffness[..., None]) for force in self.forces),
            rotations=tuple(rotation.scaled(mass, stiffness) for rotation in self.rotations),
            connections=tuple(item.scaled(mass, stiffness) for item in self.connections),
            dimensionless=("mass", "time"),
        )

    def averaged(self, ratio: Fraction | float | None = None) -> GearSystem:
        """Return the system with the means of all that varies, but for what varies with r Omega, ``ratio`` r."""
        meshes = [mesh if mesh.frequency_ratio == ratio else mesh.averaged() for mesh in self.meshes]
        terms = [term if term.frequency_ratio == ratio else term.averaged() for term in self.terms]
        return replace(self, meshes=tuple(meshes), terms=tuple(terms))

    def only_meshes(self) -> GearSystem:
        """Return the system without damping and without anything else that acts besides K0 and the meshes."""
        return replace(self, damping=None, terms=(), rotations=())

    def undriven(self) -> GearSystem:
        """Return the system with nothing that drives it."""
        meshes = tuple(replace(mesh, transmission_error=None, revolution_errors=()) for mesh in self.meshes)
        return replace(self, load=None, forces=(), meshes=meshes)

    def mean_stiffness_matrix(self) -> Array:
        """K0 + sum_i k_gi g_i g_i^T, ``(..., n, n)``."""
        return self.stiffness_matrix([mesh.mean_stiffness for mesh in self.meshes])

    def stiffness_matrix(self, levels: list[Array]) -> Array:
        """K0 + sum_i k_i g_i g_i^T for the given stiffness of each mesh."""
        total = np.asarray(self.stiffness, dtype=float)
        for mesh, level in zip(self.meshes, levels, strict=True):
            total = total + np.asarray(level)[..., None, None] * mesh.outer
        return total

    def common_period(self) -> tuple[Fraction, tuple[int, ...]]:
        """The period that all mesh stiffnesses and terms share.

        Returns (N, (N_1, N_2, ...)): the common period is N 2 pi/Omega and holds N_i whole cycles of mesh i, those of
        the terms after those of the meshes. Raises NotPossible where there is none.
        """
        return shared_period(self.frequency_ratios)


def of_wholes(forces: Array, wholes: Array | None) -> Array:
    """Return the forces of whole meshes from those of all meshes and parts; see :attr:`GearSystem.wholes`."""
    return forces if wholes is None else forces @ wholes


def _symmetric(matrix: Array) -> bool:
    """Whether matrices ``(..., n, n)`` are symmetric but for rounding."""
    asymmetry = np.abs(matrix - np.swapaxes(matrix, -1, -2)).max(axis=(-2, -1), initial=0.0)
    return bool(np.all(asymmetry <= ASYMMETRIC * np.abs(matrix).max(axis=(-2, -1), initial=0.0)))


def shared_period(ratios: list[Fraction | float]) -> tuple[Fraction, tuple[int, ...]]:
    """(N, cycles of each in N 2 pi/Omega), the shortest period common to frequencies r Omega.

    Raises NotPossible where there is none.
    """
    exact = [ratio for ratio in ratios if isinstance(ratio, Fraction)]
    if len(exact) < len(ratios):
        raise NotPossible("mesh frequencies of irrational ratio have no common period")
    common = Fraction(
        gcd(*(r.numerator * lcm(*(s.denominator for s in exact)) // r.denominator for r in exact)),
        lcm(*(r.denominator for r in exact)),
    )
    return 1 / common, tuple(int(r / common) for r in exact)


ANY_LINEAR = frozenset({Feature.PERIODIC_TERMS, Feature.IRRATIONAL_RATIO})
"""The features of linear systems."""
WHIRLING = frozenset({Feature.ROTATION, Feature.UNSYMMETRIC_DAMPING})
"""The features of systems whose motions are no real modes, and may go with the mesh frequency."""
ONLY_MESHES = frozenset({Feature.IRRATIONAL_RATIO, Feature.FOLLOWS_ROTATION})
"""The features of systems with symmetric damping of which only the mesh stiffness varies, with time or, where it
follows the rotation, as in the classical formulation."""

_MESSAGES = {
    Feature.PERIODIC_TERMS: "supports only periodic mesh stiffness, and this system also has {terms}",
    Feature.UNSYMMETRIC_DAMPING: "needs a symmetric damping matrix, and that of this system is not",
    Feature.ROTATION: "does not support gyroscopic and other matrices that act with a speed of rotation",
    Feature.IRRATIONAL_RATIO: "mesh frequencies of irrational ratio have no common period",
    Feature.FOLLOWS_ROTATION: "supports only linear systems, and the mesh stiffness of this pair follows its rotation",
}
_REMEDIES = {
    Feature.PERIODIC_TERMS: "use floquet, which takes these too",
    Feature.UNSYMMETRIC_DAMPING: "use floquet or boundaries, which take it too",
    Feature.ROTATION: "use floquet or boundaries, which take these too",
    Feature.IRRATIONAL_RATIO: "remove it, or give exact ratios",
    Feature.FOLLOWS_ROTATION: "set formulation: classical",
}


def unsupported(
    system: GearSystem, supports: Collection[Feature], remedies: Mapping[Feature, str] | None = None
) -> tuple[str, str] | None:
    """Return why a theory does not apply to a system and what to do, or None if it does.

    supports: the features that the theory takes. remedies: what to do about others, where the usual one does not fit.
    """
    for feature in Feature:
        if feature in system.features and feature not in supports:
            message = _MESSAGES[feature].format(terms=", ".join(term.name for term in system.terms))
            return message, {**_REMEDIES, **(remedies or {})}[feature]
    return None


def whirls(system: GearSystem) -> bool:
    """Return whether the motions of a system are no real modes: modes of its symmetric part say little of them."""
    return bool(system.features & WHIRLING)


def require(system: GearSystem, supports: Collection[Feature], theory: str) -> None:
    """Raise NotPossible where a theory, given by its name, does not apply to a system."""
    if found := unsupported(system, supports):
        raise NotPossible(f"{theory} {found[0]}", found[1])
