"""A period as a chain of constant generators in real modal coordinates, for damped systems.

x' = A_d x in each state d, x = (u, u', r') as in :mod:`gearstab.floquet.kernel.damped`. In the real modes of A_d, one
column a real eigenvalue and two a pair a +- ib, A_d consists of the numbers a and the blocks [[a, b], [-b, a]], and a
segment acts as exp(a t) and rotations by b t. The coordinates change where the state does.

Lengths are measured by the *action*: sum_j w_j u_j^2 + u_j'^2/w_j over the modes w_j of the mean system (coordinates of
the pattern). It hardly changes in time without damping, and damping mu_j takes it from each mode at the rate 2 mu_j.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from gearstab.floquet.kernel.damped import Generators, generators
from gearstab.floquet.segments.pattern import Pattern
from gearstab.system import Array

ROUNDING = 1e-13
"""What a proof allows for errors of a segment's propagator, relative: those of rounding."""


EXPONENTIAL = 12.0
"""Products that the exponential of a matrix takes."""
PREPARATION, CHANGING = 500.0, 2e5
"""Products, and multiplications besides, in the time that a proof takes for a segment whose modes are found anew."""


@dataclass(frozen=True)
class Chain:
    """r rows of S segments over D states of dimension m.

    cycles: N; the common period is N 2 pi/Omega. fractions ``(r, S)``, states ``(S,)``: as of a pattern.
    generator: the matrices A_d. values: ``(r, D, m)`` complex, their eigenvalues, real ones first, of each pair that
        above the real axis first. basis, inverse: ``(r, D, m, m)``, the real modes in columns.
    change: ``(r, Q, m, m)``, distinct changes of coordinates; index: ``(S,)``, which of them follows each segment.
    frequencies, rates: ``(r, n)``, w_j (NaN where the mean system has no stiffness along a coordinate) and mu_j, then
        those of rigid velocities, without frequency.
    weight: ``(r, D, m, m)``, the rate at which damping takes action, a quadratic form in the coordinates of the state.
    sound: ``(r,)``, whether all states may be diagonalised; if not, the real modes are meaningless.
    rounding: relative error of a segment's propagator that a proof allows for.
    following: where generators change with the mesh frequency; then :meth:`at` makes the chain of each point, and all
        else is that of the middle of the range. span: which segments are there.
    slope: ``(r, D, m, m)`` of a chain of points, dA/d ln Omega in the coordinates of each state; bend: ``(r, D)``, the
        size of the second derivative.
    lightest: ``(r, K)``, the smallest damping ratio at mesh frequencies of the range, where ``rates`` do not tell it.
    """

    cycles: float
    fractions: Array
    states: Array
    generator: Generators
    values: Array
    basis: Array
    inverse: Array
    change: Array
    index: Array
    frequencies: Array
    rates: Array
    weight: Array
    sound: Array
    rounding: float = ROUNDING
    following: Generators | None = None
    span: slice = field(default_factory=lambda: slice(None))
    slope: Array | None = None
    bend: Array | None = None
    lightest: Array | None = None

    @property
    def size(self) -> int:
        """m."""
        return int(self.values.shape[-1])

    @property
    def exponential(self) -> float:
        """Work of the generator's own exponential in a segment, in products, where no modes serve all points."""
        return 0.0 if self.following is None else EXPONENTIAL

    @property
    def preparation(self) -> float:
        """The same of what a proof has to find out anew at every point."""
        return 0.0 if self.following is None else PREPARATION + CHANGING / self.size**3

    def period(self, cycle: Array) -> Array:
        """T at 1/Omega = ``cycle``."""
        return 2 * np.pi * self.cycles * cycle

    def part(self, segments: slice) -> Chain:
        """Some segments in a row: no period."""
        if self.following is not None:
            return replace(self, span=segments)
        return replace(
            self, fractions=self.fractions[:, segments], states=self.states[segments], index=self.index[segments]
        )

    def at(self, row: Array, cycle: Array, slopes: bool = False) -> tuple[Chain, Array]:
        """Return a chain that holds at points (row, 1/Omega) ``(P,)``, and which of its rows each of them is.

        slopes: whether it is to know how the generators change.
        """
        if self.following is None:
            return self, row
        speed = 1 / np.asarray(cycle)[:, None]
        given = self.following.subset(row)
        matrix = Generators(given.at(speed)[:, 0])
        where = self.cycles, self.fractions[row], self.states
        own = replace(linked(*where, matrix, self.frequencies[row], self.rates[row]), rounding=self.rounding)
        if slopes:
            first, second = (own.inverse @ part @ own.basis for part in given.slopes(speed))
            own = replace(own, slope=first, bend=np.linalg.norm(second, axis=(-2, -1)))
        return own.part(self.span), np.arange(len(row))


def chain(pattern: Pattern) -> Chain:
    """The chain of a pattern, with the uniform damping that was taken out of its stiffness put back."""
    pattern = pattern.unshifted()
    elastic = pattern.elastic
    time = np.zeros(pattern.stiffness.shape[:2])
    for s, state in enumerate(pattern.states):
        time[:, state] += pattern.fractions[:, s]
    squared = np.einsum("rd,rdii->ri", time, pattern.stiffness)
    diagonal = [elastic.damping_matrix, elastic.rigid_damping[..., pattern.size :]]
    rates = [0.5 * np.einsum("rii->ri", matrix) for matrix in diagonal]
    with np.errstate(invalid="ignore"):
        frequencies = np.sqrt(squared)
    where = (pattern.cycles, pattern.fractions, pattern.states)
    return linked(*where, generators(pattern), frequencies, np.concatenate(rates, axis=1))


def linked(
    cycles: float, fractions: Array, states: Array, generator: Generators, frequencies: Array, rates: Array
) -> Chain:
    """The chain of any generators; see :class:`Chain`."""
    n = frequencies.shape[1]
    known = np.where(frequencies > 0, frequencies, 1.0)
    length = np.concatenate([known, 1 / known, np.ones_like(rates[:, n:])], axis=1)
    loss = length * np.concatenate([rates[:, :n], rates], axis=1)
    values, basis, inverse = generator.real_modes
    # Columns of mean length 1, with the same factor for both of a pair.
    square = np.einsum("rdij,ri->rdj", basis**2, length)
    partner = np.where(values.imag > 0, np.roll(square, -1, axis=-1), np.roll(square, 1, axis=-1))
    factor = 1 / np.sqrt(np.where(values.imag != 0, 0.5 * (square + partner), square))
    basis, inverse = basis * factor[..., None, :], inverse / factor[..., None]
    pairs, index = np.unique(np.stack([np.roll(states, -1), states]), axis=1, return_inverse=True)
    change = inverse[:, pairs[0]] @ basis[:, pairs[1]]
    weight = np.swapaxes(basis, -1, -2) @ (loss[:, None, :, None] * basis)
    return Chain(
        cycles, fractions, states, generator, values, basis, inverse, change, np.ravel(index), frequencies, rates,
        0.5 * (weight + np.swapaxes(weight, -1, -2)), generator.well_conditioned,
    )  # fmt: skip
