"""General damping: propagation in the complex modes of each state.

With the state vector x = (w u, u', r') -- elastic coordinates, their velocities, and the velocities of rigid
coordinates that damping couples to them -- each segment has a constant generator A_d, x' = A_d x. It is
diagonalised once per state, A_d = X L X^-1, and serves all mesh frequencies: exp(A_d t) = X exp(L t) X^-1. Where X is
nearly singular (critical damping) the exponential is formed by scaling and squaring instead.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gearstab import ckernel
from gearstab.floquet.segments.pattern import Pattern, Succession
from gearstab.mesh import speed_factors
from gearstab.propagation.first_order import FirstOrder
from gearstab.propagation.segment import ILL_CONDITIONED
from gearstab.system import Array

SYMMETRIC = 1e-14
"""Part of the largest entry by which symmetric matrices may depart from symmetry."""


@dataclass(frozen=True)
class Generators:
    """The generators of a damped pattern, ``(r, D, m, m)`` with m = 2 n + (number of coupled rigid velocities).

    by_speed ``(r, K, m, m)``, laws ``(r, K, 3)``: what goes with the mesh frequency besides, as of
    :class:`gearstab.propagation.first_order.FirstOrder`, in the pattern's units; None where nothing does. Without it
    the states have modes. symplectic: whether multipliers are inverse in pairs, as those of gyroscopic systems.
    """

    matrix: Array
    by_speed: Array | None = None
    laws: Array | None = None
    symplectic: bool = False

    @classmethod
    def of(cls, form: FirstOrder, levels: Array, symplectic: bool = False) -> Generators:
        """Return those of rows at the levels ``(r, D, J)`` of their varying functions, in units of their rates."""
        # Values of rows run along the second axis from the right there.
        matrix = np.swapaxes(replace(form, by_speed=None).generator(np.swapaxes(levels, 0, 1)), 0, 1)
        return cls(matrix, form.by_speed, form.scaled_laws, symplectic)

    @cached_property
    def _diagonal(self) -> tuple[Array, Array, Array, Array]:
        """:attr:`eigen`, and which states ``(r, D)`` may be diagonalised."""
        shape = self.matrix.shape
        matrix = self.matrix.reshape(-1, *shape[2:])
        values, vectors, inverse, found = _light(matrix)
        rest = np.flatnonzero(~found)
        if len(rest):
            values[rest], vectors[rest], inverse[rest] = _diagonalised(matrix[rest])
        values, vectors, inverse = values.reshape(shape[:3]), vectors.reshape(shape), inverse.reshape(shape)
        # The condition number in the Frobenius norm, which is never below the one that counts and far cheaper.
        # That of a defective matrix overflows where rounding makes its eigenvectors nearly parallel.
        with np.errstate(over="ignore"):
            size = np.linalg.norm(vectors, axis=(-2, -1)) * np.linalg.norm(inverse, axis=(-2, -1))
        sound = size < ILL_CONDITIONED
        sound[~sound] = _invertible(vectors[~sound])
        return values, vectors, inverse, sound

    @property
    def eigen(self) -> tuple[Array, Array, Array]:
        """(values ``(r, D, m)``, X, X^-1) of each state; X^-1 is meaningless where X is ill-conditioned."""
        return self._diagonal[:3]

    @property
    def well_conditioned(self) -> Array:
        """``(r,)``: whether all states of a row may be diagonalised."""
        return np.asarray(np.all(self._diagonal[3], axis=-1))

    @property
    def real_modes(self) -> tuple[Array, Array, Array]:
        """Result of :func:`real_modes` for :attr:`eigen`."""
        return real_modes(*self.eigen)

    def row(self, index: int) -> Generators:
        """One of the rows; of a single one all that is known of it."""
        return self if len(self.matrix) == 1 else self.subset(np.array([index]))

    def subset(self, index: Array) -> Generators:
        """Some of the rows, by position."""
        if self.by_speed is None or self.laws is None:
            return replace(self, matrix=self.matrix[index])
        return replace(self, matrix=self.matrix[index], by_speed=self.by_speed[index], laws=self.laws[index])

    def at(self, omega: Array) -> Array:
        """A_d ``(r, P, D, m, m)`` at mesh frequencies ``(r, P)``."""
        if self.by_speed is None or self.laws is None:
            return np.broadcast_to(self.matrix[:, None], (*omega.shape, *self.matrix.shape[1:]))
        ratio, power, softening = np.moveaxis(self.laws[:, None], -1, 0)
        moving = np.einsum("rpk,rkij->rpij", speed_factors(ratio * omega[..., None], power, softening), self.by_speed)
        return np.asarray(self.matrix[:, None] + moving[:, :, None])

    def slopes(self, omega: Array) -> tuple[Array, Array]:
        """First and second derivatives of A by ln Omega ``(r, P, m, m)`` at mesh frequencies ``(r, P)``, of all states.

        f = W^p/(1 - u) with u = a W^2 has f' = f (p + 2 u/(1 - u)).
        """
        assert self.by_speed is not None
        assert self.laws is not None
        ratio, power, softening = np.moveaxis(self.laws[:, None], -1, 0)
        speed = ratio * omega[..., None]
        soft = softening * speed**2 / (1 - softening * speed**2)
        first = speed_factors(speed, power, softening) * (power + 2 * soft)
        second = first * (power + 2 * soft) + speed_factors(speed, power, softening) * 4 * soft * (1 + soft)
        return np.einsum("rpk,rkij->rpij", first, self.by_speed), np.einsum("rpk,rkij->rpij", second, self.by_speed)


def real_modes(values: Array, vectors: Array, inverse: Array) -> tuple[Array, Array, Array]:
    """(values ``(r, D, m)`` complex, V, V^-1 real), real eigenvalues first, from values, X and X^-1.

    A real eigenvalue has its eigenvector as a column of V, a pair a +- ib of eigenvectors u +- iv, the member of
    positive imaginary part first, has the columns u, v: A_d u = a u - b v, A_d v = b u + a v.
    """
    if np.any(values.imag == 0):
        # Then pairs begin at even places where m is even, as the fast path of the compiled kernel wants them.
        order = np.argsort(values.imag != 0, axis=-1, kind="stable")
        values = np.take_along_axis(values, order, axis=-1)
        vectors = np.take_along_axis(vectors, order[..., None, :], axis=-1)
        inverse = np.take_along_axis(inverse, order[..., None], axis=-2)
    second = (values.imag < 0)[..., None, :]
    basis = np.where(second, -vectors.imag, vectors.real)
    inner = np.swapaxes(second, -1, -2)
    paired = np.where((values.imag == 0)[..., None], inverse.real, 2 * inverse.real)
    # With X^-1 x = (z, conj z) on a pair, x = 2 Re(z) u - 2 Im(z) v.
    return values, basis, np.where(inner, 2 * inverse.imag, paired)


def _light(matrix: Array) -> tuple[Array, Array, Array, Array]:
    """(values ``(B, m)``, X, X^-1, found ``(B,)``) of lightly damped states (u, u') of symmetric stiffness and damping;
    those not found mean nothing.
    """
    count, m = matrix.shape[:2]
    n = m // 2
    damping, stiffness = -matrix[:, n:, n:], -matrix[:, n:, :n]
    # Of velocities in other units, as generators have them that are weighted, these would not be the eigenvalues.
    plain = m % 2 == 0 and bool(np.all(matrix[:, :n] == np.eye(n, m, n)))
    if m == 0 or not plain or not (_symmetric(stiffness) and _symmetric(damping)):
        nothing = np.zeros((count, m, m), dtype=complex)
        return np.zeros((count, m), dtype=complex), nothing, nothing.copy(), np.zeros(count, dtype=bool)
    squared, shapes = ckernel.symmetric_eigen(stiffness)
    turned = np.swapaxes(shapes, 1, 2) @ damping @ shapes
    # Right and left eigenvectors come from one symmetric matrix.
    return ckernel.light_modes(squared, shapes, 0.5 * (turned + np.swapaxes(turned, 1, 2)))


def _symmetric(matrix: Array) -> bool:
    """Whether all matrices are symmetric but for rounding."""
    return bool(np.all(np.abs(matrix - np.swapaxes(matrix, 1, 2)) <= SYMMETRIC * np.abs(matrix).max(initial=0.0)))


def _diagonalised(matrix: Array) -> tuple[Array, Array, Array]:
    """(values, X, X^-1) of any matrices; X^-1 is meaningless where X is ill-conditioned."""
    values, vectors = np.linalg.eig(matrix)
    values, vectors = values.astype(complex), vectors.astype(complex)
    try:
        inverse = np.linalg.inv(vectors)
    except np.linalg.LinAlgError:
        sound = _invertible(vectors)
        inverse = np.linalg.inv(np.where(sound[..., None, None], vectors, np.eye(vectors.shape[-1])))
    return values, vectors, inverse


def _invertible(vectors: Array) -> Array:
    singular = np.linalg.svd(vectors, compute_uv=False)
    return np.asarray(singular[..., 0] < ILL_CONDITIONED * singular[..., -1])


def generators(pattern: Pattern) -> Generators:
    """x = (w u, u', r'): u'' = -K u - C u' - C_er r', r'' = -C_re u' - C_rr r'; w = 1 in the pattern's units."""
    elastic, n = pattern.elastic, pattern.size
    rows, states = pattern.stiffness.shape[:2]
    a = np.zeros((rows, states, elastic.state_size, elastic.state_size))
    a[..., :n, n : 2 * n] = np.eye(n)
    a[..., n : 2 * n, :n] = -pattern.stiffness
    a[..., n : 2 * n, n : 2 * n] = -elastic.damping_matrix[:, None]
    a[..., 2 * n :, n:] = -elastic.rigid_damping[:, None]
    a[..., n : 2 * n, 2 * n :] = -np.swapaxes(elastic.rigid_damping[..., :n], -1, -2)[:, None]
    return Generators(a)


def factors(
    generator: Generators, pattern: Succession, row: int, omega: Array, spread: float = np.inf
) -> tuple[list[Array], Array]:
    """exp(A_s t_s) of one row, first segment first, without their growth.

    With a finite ``spread`` segments are subdivided until their growth and decay differ by at most exp(spread).
    Returns: the factors, ``(P, m, m)`` each and of size one, and the logarithm ``(P,)`` of what was taken out of all.
    """
    values, durations = generator.eigen[0][row], pattern.durations(row, omega)
    result, scale = [], np.zeros(len(omega))
    for s, state in enumerate(pattern.states):
        real = values[state].real
        pieces = max(1, int(np.ceil((real.max() - real.min()) * durations[s].max(initial=0.0) / spread)))
        result += [exponential(generator, row, int(state), durations[s] / pieces)] * pieces
        scale += real.max() * durations[s]
    return result, scale


def exponential(generator: Generators, row: int, state: int, duration: Array) -> Array:
    """exp((A_d - a) t) ``(P, m, m)`` for durations ``(P,)``; a is the largest real part of an eigenvalue of A_d."""
    values, vectors, inverse = (part[row, state] for part in generator.eigen)
    values = values - values.real.max()
    if not generator.well_conditioned[row]:
        shifted = generator.matrix[row, state] - generator.eigen[0][row, state].real.max() * np.eye(len(values))
        return ckernel.exponentials(shifted * duration[:, None, None])
    return ((vectors * np.exp(values * duration[:, None])[:, None, :]) @ inverse).real
