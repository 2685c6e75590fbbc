"""Modes of the mean system, rigid-body modes, modal mesh deflections; the static equilibrium under a constant load."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab import ckernel
from gearstab.system import Array, GearSystem, of_wholes

RIGID_TOLERANCE = 1e-11
"""A mode is rigid when its squared frequency is below this part of the largest one: an eigensolver in double
precision leaves n eps ~ 1e-14 of the largest on an exact zero, while real gear trains stay above 1e-9."""

CANCELLED = 1e-2
"""A squared frequency below this part of the stiffness that cancels in it tells little of how fast the mode moves."""

SMALL = 12
"""Largest order for which Jacobi rotations on many matrices at once are faster than LAPACK on one after the other."""
GRADED = 1e3
"""Above this ratio of the largest to the smallest eigenvalue the small ones are refined."""


def symmetric_eigen(matrix: Array) -> tuple[Array, Array]:
    """Eigenvalues ``(..., n)`` ascending and orthonormal eigenvectors ``(..., n, n)`` of symmetric matrices.

    An eigensolver is right to eps times the *largest* eigenvalue: beside a shaft 1e8 times stiffer than the teeth the
    slow modes would keep eight digits. Jacobi rotations of the solver's basis give each eigenvalue the accuracy
    that the entries of the matrix allow (Demmel & Veselic 1992). Small matrices are diagonalised by Jacobi
    rotations alone.
    """
    if matrix.shape[-1] <= SMALL:
        return ckernel.symmetric_eigen(matrix)
    values, vectors = np.linalg.eigh(matrix)
    size = np.abs(values)
    graded = size.max(axis=-1, initial=0.0) > GRADED * size.min(axis=-1, initial=np.inf)
    if np.any(graded):
        values, vectors = values.copy(), vectors.copy()
        values[graded], vectors[graded] = _refined(matrix[graded], vectors[graded])
    # LAPACK's are orthonormal but for a few eps of a preferred sign, which a product of hundreds of changes of modes
    # adds up until multipliers of identical parts seem to leave the unit circle.
    return values, vectors - 0.5 * vectors @ (np.swapaxes(vectors, -1, -2) @ vectors - np.eye(matrix.shape[-1]))


def _refined(matrix: Array, vectors: Array) -> tuple[Array, Array]:
    """Jacobi rotations of an almost diagonalising basis, where they are needed; two or three sweeps do."""
    for _ in range(4):
        a = np.swapaxes(vectors, -1, -2) @ matrix @ vectors
        diagonal = np.abs(np.diagonal(a, axis1=-2, axis2=-1))
        scale = np.sqrt(diagonal[..., :, None] * diagonal[..., None, :])
        large = np.abs(np.triu(a, 1)) > 4 * np.finfo(float).eps * scale
        if not large.any():
            break
        vectors = vectors @ ckernel.symmetric_eigen(0.5 * (a + np.swapaxes(a, -1, -2)))[1]
    values = np.diagonal(np.swapaxes(vectors, -1, -2) @ matrix @ vectors, axis1=-2, axis2=-1)
    order = np.argsort(values, axis=-1)
    return np.take_along_axis(values, order, -1), np.take_along_axis(vectors, order[..., None, :], -1)


def mass_factor(mass: Array) -> Array:
    """L^-T of the Cholesky factorisation M = L L^T, ``(..., n, n)``: its columns are M-orthonormal."""
    lower = np.linalg.cholesky(np.asarray(mass, dtype=float))
    return np.swapaxes(np.linalg.inv(lower), -1, -2)


def eigenmodes(mass: Array, stiffness: Array) -> tuple[Array, Array]:
    """Solve K phi = lambda M phi; eigenvalues ``(..., n)`` ascending, modes ``(..., n, n)`` with Phi^T M Phi = I."""
    factor = mass_factor(mass)
    scaled = np.swapaxes(factor, -1, -2) @ stiffness @ factor
    values, vectors = symmetric_eigen(0.5 * (scaled + np.swapaxes(scaled, -1, -2)))
    return values, factor @ vectors


def rounded(squared: Array, magnitude: Array | float = 0.0) -> Array:
    """Return squared frequencies ``(..., n)`` with those that are rounding errors set to exactly 0.

    magnitude: ``(..., n)``, the stiffness that cancels in each, see :class:`Modes`.
    """
    size = np.abs(squared)
    largest = np.max(np.maximum(size, magnitude), axis=-1, keepdims=True)
    return np.where(size <= RIGID_TOLERANCE * largest, 0.0, squared)


def natural_scale(squared: Array, magnitude: Array) -> Array:
    """Return the squared frequency ``(..., n)`` that the motion along each mode goes with: |w_p^2|, or the magnitude of
    what cancels in it; 0 for rigid-body modes.
    """
    size = np.abs(squared)
    magnitude = rounded(magnitude)
    return np.where(size < CANCELLED * magnitude, magnitude, size)


@dataclass(frozen=True)
class Modes:
    """Modes of the mean system: (K0 + sum_i k_gi g_i g_i^T) phi_p = w_p^2 M phi_p, Phi^T M Phi = I.

    squared_frequency: ``(..., n)``, w_p^2 ascending; exactly 0 for rigid-body modes, and where stiffnesses cancel.
    shapes: ``(..., n, n)``, column p is phi_p; the largest entry of a column is positive.
    mesh_deflection: ``(..., n, meshes)``, delta_ip = g_i^T phi_p.
    magnitude: ``(..., n)``, |phi_p^T K0 phi_p| + sum_i (|k_gi| + |k_ai|) delta_ip^2, which may be far above w_p^2 where
        stiffnesses are negative.
    """

    squared_frequency: Array
    shapes: Array
    mesh_deflection: Array
    magnitude: Array

    @property
    def natural_frequency(self) -> Array:
        """w_p; NaN where the mean stiffness is negative along a mode."""
        return np.sqrt(np.where(self.squared_frequency >= 0, self.squared_frequency, np.nan))

    @property
    def rigid(self) -> Array:
        """``(..., n)``, True for rigid-body modes: of zero frequency and without mesh deflection."""
        return (self.squared_frequency == 0) & _undeflected(self.mesh_deflection)

    @property
    def natural_scale(self) -> Array:
        """``(..., n)``, what :func:`natural_scale` makes of the squared frequencies."""
        return natural_scale(self.squared_frequency, self.magnitude)

    @property
    def rate(self) -> Array:
        """``(...)``, the frequency of all modes together, the unit of 1/time in computations."""
        mean = np.mean(self.natural_scale, axis=-1)
        return np.asarray(np.sqrt(np.where(mean > 0, mean, 1.0)))


def mean_modes(system: GearSystem) -> Modes:
    """Return the basis in which motions are computed: modes of the mean system. Source: Lin & Parker 2002, (5).

    What results show as natural frequencies and modes is :func:`gearstab.symmetry.natural_modes`.
    """
    values, shapes = eigenmodes(system.mass, system.mean_stiffness_matrix())
    deflection = _deflections(system, shapes)
    magnitude = _magnitude(system, shapes, deflection)
    values = rounded(values, magnitude)
    zero = values == 0
    several = np.sum(zero, axis=-1) > 1
    if np.any(several) and np.any((zero & ~_undeflected(deflection))[several]):
        shapes = _rigid_apart(zero, shapes, deflection)
        deflection = _deflections(system, shapes)
        magnitude = _magnitude(system, shapes, deflection)
    leading = np.take_along_axis(shapes, np.argmax(np.abs(shapes), axis=-2)[..., None, :], axis=-2)
    sign = np.where(leading < 0, -1.0, 1.0)
    return Modes(values, shapes * sign, deflection * np.swapaxes(sign, -1, -2), magnitude)


def _deflections(system: GearSystem, shapes: Array) -> Array:
    return np.stack([mesh_deflection(shapes, mesh.direction) for mesh in system.meshes], axis=-1)


def _magnitude(system: GearSystem, shapes: Array, deflection: Array) -> Array:
    total = np.abs(np.sum(shapes * (system.stiffness @ shapes), axis=-2))
    for i, mesh in enumerate(system.meshes):
        level = np.abs(mesh.mean_stiffness) + np.abs(mesh.amplitude)
        total = total + level[..., None] * deflection[..., i] ** 2
    return np.asarray(total)


def _rigid_apart(zero: Array, shapes: Array, deflection: Array) -> Array:
    """Turn modes of zero frequency, ``zero`` (..., n), so that as few of them as possible deflect a mesh; the others,
    of rigid bodies, come first.
    """
    shape = np.broadcast_shapes(zero.shape, shapes.shape[:-1])
    zero, shapes = np.broadcast_to(zero, shape), np.broadcast_to(shapes, (*shape, shape[-1])).copy()
    deflection = np.broadcast_to(deflection, (*shape, deflection.shape[-1]))
    for row in np.ndindex(shape[:-1]):
        at = np.flatnonzero(zero[row])
        size = np.abs(deflection[row]).max(axis=0)
        turn = np.linalg.svd(deflection[row][at] / np.where(size > 0, size, 1.0))[0]
        shapes[row][:, at] = shapes[row][:, at] @ turn[:, ::-1]
    return shapes


def _undeflected(deflection: Array) -> Array:
    """``(..., n)``: modes that deflect no mesh, of deflections ``(..., n, meshes)``.

    Eigenvectors of rigid-body modes deflect meshes by the square root of eps at most, and elastic ones by far more.
    """
    size = np.max(np.abs(deflection), axis=(-1, -2), keepdims=True)
    return np.asarray(np.all(np.abs(deflection) <= 1e-7 * size, axis=-1))


def mesh_deflection(shapes: Array, direction: Array) -> Array:
    """g^T phi_p for every mode, ``(..., n)``."""
    return np.einsum("...ip,...i->...p", shapes, direction)


MODE_TYPES = ("elastic", "rigid-body", "no mesh deflection", "negative stiffness", "no mean stiffness")
"""Types of modes that :func:`mode_types` distinguishes; a mode without mesh deflection is elastic, and no mesh excites
it."""

NO_DEFLECTION = 1e-12
"""A mesh deflection below this part of sqrt(sum_p delta_ip^2) is the rounding error of an eigenvector."""


SEPARATED = 1e-8
"""Squared frequencies closer than this, relative, belong to modes of which any mixture is one."""
MIXED = 32
"""The solver's mixture of neighbours in units of the rounding error of one operation: sums over the coordinates."""


def significant_deflection(modes: Modes) -> Array:
    """``(..., n, meshes)``, whether a modal mesh deflection is more than rounding.

    The natural scale is sum_p delta_ip^2 = g_i^T M^-1 g_i. Besides, the solver leaves a part of every mode q in a
    mode p, about eps w_p w_q/|w_p^2 - w_q^2|, which counts where a mode without mesh deflection has close neighbours.
    """
    size = np.abs(modes.mesh_deflection)
    scale = np.sqrt(np.sum(size**2, axis=-2, keepdims=True))
    values = np.abs(modes.squared_frequency)
    gap = np.abs(values[..., :, None] - values[..., None, :])
    mean = np.sqrt(values[..., :, None] * values[..., None, :])
    part = np.where(gap > SEPARATED * mean, mean / np.where(gap > 0, gap, 1.0), 0.0)
    return size > np.maximum(NO_DEFLECTION * scale, MIXED * np.finfo(float).eps * (part @ size))


def mode_types(modes: Modes) -> Array:
    """``(..., n)``, one of MODE_TYPES for every mode."""
    still = ~np.any(significant_deflection(modes), axis=-1)
    conditions = [modes.squared_frequency < 0, modes.rigid, modes.squared_frequency == 0, still]
    return np.select(conditions, [MODE_TYPES[k] for k in (3, 1, 4, 2)], MODE_TYPES[0])


def mesh_energy_shares(system: GearSystem, modes: Modes) -> Array:
    """The part of each mode's strain energy that is in each mesh, k_gi delta_ip^2/w_p^2 ``(..., n, meshes)``.

    NaN for modes without positive stiffness. The width of a mode's tongues goes with it: Lin & Parker 2002, below (20).
    """
    stiffness = np.stack(np.broadcast_arrays(*[mesh.mean_stiffness for mesh in system.meshes]), axis=-1)
    squared = np.where(modes.squared_frequency > 0, modes.squared_frequency, np.nan)
    return stiffness[..., None, :] * modes.mesh_deflection**2 / squared[..., None]


def modal_damping_ratios(system: GearSystem, modes: Modes) -> Array:
    """zeta_p = phi_p^T C phi_p/(2 w_p), ``(..., n)``; NaN for modes without positive stiffness."""
    squared = np.where(modes.squared_frequency > 0, modes.squared_frequency, np.nan)
    rate = np.einsum("...ip,...ij,...jp->...p", modes.shapes, system.damping_matrix, modes.shapes)
    return rate / (2 * np.sqrt(squared))


def modal_damping_matrix(mass: Array, mean_stiffness: Array, ratios: Array) -> Array:
    """C = M Phi diag(2 zeta_p w_p) Phi^T M, the viscous damping with the given ratio in every mode of the mean system.

    ratios: ``(...)`` for one ratio for all modes or ``(..., n)``, ordered by ascending natural frequency.
    """
    values, shapes = eigenmodes(mass, mean_stiffness)
    weighted = mass @ shapes
    # The square root would turn a rounding error of 1e-17 in a rigid mode into a damping of 1e-9.
    rate = 2 * np.asarray(ratios) * np.sqrt(np.maximum(rounded(values), 0.0))
    return (weighted * rate[..., None, :]) @ np.swapaxes(weighted, -1, -2)


def static_equilibrium(system: GearSystem) -> Array:
    """q ``(..., n)`` with (K0 + sum k_gi g_i g_i^T) q = f0, the part of f0 that rigid-body modes take up left out.

    Terms of K(t) besides the meshes (friction) and mean forces of other shapes play no part. NaN where the mean
    stiffness is negative or zero along a mode.
    """
    if system.load is None:
        return np.zeros((*system.batch, system.size))
    modes = mean_modes(system)
    force = np.einsum("...np,...n->...p", modes.shapes, system.load)
    squared = modes.squared_frequency
    inverse = np.where(squared > 0, 1 / np.where(squared > 0, squared, 1.0), np.where(modes.rigid, 0.0, np.nan))
    return np.einsum("...np,...p->...n", modes.shapes, inverse * force)


def static_mesh_force(system: GearSystem) -> Array:
    """k_gi g_i^T q of the static equilibrium, ``(..., meshes)``, of whole meshes."""
    q = static_equilibrium(system)
    forces = [mesh.mean_stiffness * np.einsum("...n,...n->...", mesh.direction, q) for mesh in system.meshes]
    return of_wholes(np.stack(np.broadcast_arrays(*forces), axis=-1), system.wholes)
