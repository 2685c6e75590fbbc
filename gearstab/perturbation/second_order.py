"""Second-order instability boundaries, for any gear system."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gearstab.perturbation.harmonics import HIGHEST, ROUNDING, Excited, Family, families, table
from gearstab.perturbation.multiple_scales import Group, ModalQuantities, first_order, modal_rows, partitions
from gearstab.perturbation.reduced import Reduced, adjoint, edges, second_threshold
from gearstab.perturbation.response import Pairs, limit, nearest_resonance, second_order_coupling
from gearstab.perturbation.tongues import ParametricExcitation, Tongues, excitations, products
from gearstab.system import Array, Feature, GearSystem, unsupported

SUPPORTS = frozenset({Feature.IRRATIONAL_RATIO})
"""The features of systems that second order takes."""

CLOSEST = 1e-12
"""A distance from another resonance below this part of the frequency is as good as none."""
ALIKE = 12
"""Rows whose epsilons are proportional to this many digits share their second-order couplings."""
BLOCK = 200_000
"""Rows are taken together up to this many entries of a mode matrix times meshes."""
MOST_ROWS = 1000
"""And no more than this many, for the sake of the Fourier coefficients."""
NOT_CONVERGED, CLOSED, ENDLESS, COINCIDENT = 1, 2, 4, 8
STATUS_FLAGS = {
    "not_converged": NOT_CONVERGED,
    "closed_by_damping": CLOSED,
    "no_boundary": ENDLESS,
    "coincident_tongues": COINCIDENT,
}
"""``not_converged``: the estimate of the third-order terms is as large as the second-order ones. ``closed_by_damping``:
stable at every mesh frequency near the root. ``no_boundary``: one mode of two is damped, and the region has no end in
theory. ``coincident_tongues``: another resonance of the same modes is nearer than its coupling is strong; no boundary
is given."""
SAFETY = 3.0
"""On the estimate of the error. Of 2500 tongues of random two-stage trains at epsilon = 0.02 ... 0.2, nine in ten are
then nearer to Floquet's than estimated, and half of them six times."""


def second_order(system: GearSystem, harmonics: int, modes: Sequence[int] | None = None) -> Tongues:
    """Second-order boundaries of all instability regions, with an estimate of their error.

    All modes and all harmonics of all meshes that are not in resonance are eliminated to second order in epsilon
    (:mod:`gearstab.perturbation.response`), and the amplitude equations of those that are
    (:mod:`gearstab.perturbation.reduced`) are solved. Tongues shift and bend, and those that first order closes open by
    products of harmonics. Boundaries are wrong by the order of epsilon^3.

    Parameters
    ----------
    system: with any batch of rows; only ``waveform.fourier`` is used of the waves, of any number of harmonics.
    harmonics: excitation frequencies up to this harmonic of each mesh, and sums and differences s_i r_i +- s_j r_j of
        meshes of different, commensurate frequencies with s_i + s_j up to this.
    modes: numbers (from 1) of the modes to pair; default all that are not rigid-body modes in at least one row. All
        modes take part in the elimination.

    Returns
    -------
    Tongues with ``boundary_frequency``, ``half_width`` and ``threshold`` of second order and with
    ``first_order_boundary``, ``boundary_error`` and ``status``. ``center_frequency`` remains the root; the middle of a
    region is the mean of its boundaries. The threshold of damped groups of equal frequencies is that of first order.

    Tongues are taken one by one. A further resonance of the same solution (a mode r and a harmonic k with w_p + k Omega
    near +-w_r: another tongue of a mode of this one nearly at the same Omega, or a difference of natural frequencies)
    has a small divisor: ``boundary_error`` grows, and ``status`` says ``not_converged`` where it decides. Where the
    coupling is stronger than the distance, ``status`` says ``coincident_tongues`` and the boundaries are NaN.

    ``boundary_error`` is three times theta times the sum R of the magnitudes of all second-order terms of the boundary,
    theta being the largest ratio of amplitudes that the expansion takes as small: that of the mode and harmonic that
    mix most with the two in resonance, or half-width over natural frequency; to which is added the change of the
    nearest resonance's contribution across the tongue. It has the size of the third-order terms, but is no bound.

    Raises ValueError for a system with other features than SUPPORTS.

    Source: the method is the elimination known as Lyapunov-Schmidt reduction; the terms of first order are those of
    :func:`first_order`.
    """
    if refused := unsupported(system, SUPPORTS):
        raise ValueError(refused[0])
    more = products(system, harmonics)
    first = first_order(system, harmonics, modes, more)
    modal = modal_rows(system)
    place = {(t.frequency_ratio, t.mode_p - 1, t.mode_q - 1): k for k, t in enumerate(first.index)}
    shape = (len(first.index), len(modal.frequency))
    found = np.full((6, *shape), np.nan)
    found[4], found[5] = first.threshold.reshape(shape), 0
    chosen = {p - 1 for p in modes} if modes is not None else {p for _, p, _ in place} | {q for _, _, q in place}
    for rows, groups in partitions(modal.frequency):
        kept = [g for g in groups if g[0] in chosen]
        pairs = [(P, Q) for k, P in enumerate(kept) for Q in kept[k:]]
        for block in _blocks(system, modal, rows, groups):
            for force in (*excitations(system, harmonics), *more):
                for alike in _by_shape(pairs):
                    where = np.array([place[float(force.ratio), P[0], Q[0]] for P, Q in alike])
                    own = block.solve(force, alike, first, where)
                    found[:, where[:, None], block.members] = np.swapaxes(own, 1, 2)
    lower, upper, half, error, threshold, status = found.reshape(6, *first.center_frequency.shape)
    boundary = np.stack([lower, upper], axis=1)
    return replace(
        first, half_width=half, boundary_frequency=boundary, threshold=threshold,
        first_order_boundary=first.boundary_frequency, status=status.astype(np.int16),
        boundary_error=np.where(np.isnan(boundary), np.nan, error[:, None]),
    )  # fmt: skip


def _by_shape(pairs: list[tuple[Group, Group]]) -> list[list[tuple[Group, Group]]]:
    """Pairs of groups by the numbers of their modes."""
    shapes = dict.fromkeys((len(P), len(Q)) for P, Q in pairs)
    return [[(P, Q) for P, Q in pairs if (len(P), len(Q)) == shape] for shape in shapes]


@dataclass(frozen=True)
class _Block:
    """Rows of one structure and, for each, the one whose second-order couplings are its own but for a factor.

    groups: of equal frequencies, of all these rows. members: numbers of the rows. modal: of the rows. excited: of the
    representatives, with strengths of at most 1.
    source: ``(rows,)``, the representative; scale: ``(rows,)``, the factor on its strengths.
    """

    system: GearSystem
    groups: list[Group]
    members: Array
    modal: ModalQuantities
    representative: ModalQuantities
    excited: Excited
    source: Array
    scale: Array

    def solve(
        self, force: ParametricExcitation, pairs: list[tuple[Group, Group]], first: Tongues, where: Array
    ) -> Array:
        """Both boundaries, half-widths, errors, thresholds and status ``(6, rows, pairs)``."""
        ratio = float(force.ratio)
        half = first.half_width.reshape(len(first.index), -1)[np.ix_(where, self.members)].T * ratio
        problem, near = self._reduced(force, pairs, half)
        sigma = np.stack(edges(problem))
        root = problem.frequency_p + problem.frequency_q
        threshold = first.threshold.reshape(len(first.index), -1)[np.ix_(where, self.members)].T
        if problem.single:
            threshold = second_threshold(problem)
        terms, third = _sizes(problem, near)
        endless, coincident = np.isinf(sigma[1]), near[1] > near[2]
        closed = np.isnan(sigma[0])
        status = NOT_CONVERGED * (third >= terms) * (terms > 0) + CLOSED * closed + ENDLESS * endless
        status = status + COINCIDENT * coincident
        # Not from the boundaries, whose last digits a narrow region would be made of.
        width = np.where(closed, 0.0, 0.5 * (sigma[1] - sigma[0]) / ratio)
        sigma[:, endless | coincident] = np.nan
        width[coincident & ~endless] = np.nan
        return np.stack([*(root + sigma) / ratio, width, SAFETY * third / ratio, threshold, status])

    def _reduced(
        self, force: ParametricExcitation, pairs: list[tuple[Group, Group]], half: Array
    ) -> tuple[Reduced, tuple[Array, Array, Array, Array]]:
        """The amplitude equations of all pairs; the size of their second-order terms, and the nearest resonance."""
        couplings = _Couplings(self.system, self.excited, self.representative, self.groups, force, pairs)
        scale = self.scale[:, None]
        w_p, w_q = (a[self.source] for a in (couplings.w_p, couplings.w_q))
        norm, one, two = 2 * np.sqrt(w_p * w_q), scale, scale**2
        through, shift_p, shift_q = couplings.through(), couplings.shift("p"), couplings.shift("q")
        damping_p, damping_q, moved_p, moved_q, skew = self._damping(force, pairs, w_p, w_q)
        problem = Reduced(
            w_p,
            w_q,
            first=_times(couplings.direct()[self.source], one / norm),
            second=_times(through[0][self.source], two / norm),
            shift_p=_times(shift_p[0][self.source], 0.5 * two / w_p) + moved_p,
            shift_q=_times(shift_q[0][self.source], 0.5 * two / w_q) + moved_q,
            half_width=half,
            damping_p=damping_p,
            damping_q=damping_q,
            skew=skew / norm[..., None, None],
        )
        size = 2 * through[1][self.source] / norm + 0.5 * (
            shift_p[1][self.source] / w_p + shift_q[1][self.source] / w_q
        )
        strength, distance, motion = (a[self.source] for a in couplings.nearest())
        return problem, (size * two, strength * scale, distance, motion)

    def _damping(
        self, force: ParametricExcitation, pairs: list[tuple[Group, Group]], w_p: Array, w_q: Array
    ) -> tuple[Array, Array, Array, Array, Array]:
        """D_P, D_Q and, where damping couples modes, its effects of second order: shifts of both groups, and 2 sqrt(w_P
        w_Q) J.
        """
        damping, squared = self.modal.damping, self.modal.squared_frequency
        p, q = (np.array([pair[k] for pair in pairs]) for k in (0, 1))
        own, shifts, through = [], [], []
        for group, w in ((p, w_p), (q, w_q)):
            outside = np.ones((len(pairs), squared.shape[-1]), dtype=bool)
            np.put_along_axis(outside, group, False, axis=1)
            gap = squared[:, None, :] - (w**2)[..., None]
            inverse = np.divide(1.0, gap, out=np.zeros(gap.shape), where=outside & (squared != 0)[:, None, :])
            rate = 2 * w[..., None, None] * damping[:, group]
            weighted = rate * inverse[:, :, None, :]
            own.append(damping[:, group[:, :, None], group[:, None, :]])
            shifts.append(-weighted @ np.swapaxes(rate, -1, -2) / (2 * w)[..., None, None])
            through.append(1j * weighted)
        b = self._direct_matrix(force)
        skew = through[0] @ np.swapaxes(b[:, q], -1, -2) - b[:, p] @ np.swapaxes(through[1], -1, -2)
        return own[0], own[1], shifts[0], shifts[1], skew

    def _direct_matrix(self, force: ParametricExcitation) -> Array:
        """B of the excitation between all modes, ``(rows, n, n)``."""
        family, number = _family_of(self.system, force)
        found: Array = self.excited.matrices(family, np.array([number]))[:, :, 0]
        return found[self.source] * self.scale[:, None, None]


def _family_of(system: GearSystem, force: ParametricExcitation) -> tuple[Family, int]:
    """The family that an excitation belongs to, and its number there."""
    family = next(family for family in families(system) if family.holds(force))
    return family, family.number(force)


def _times(matrix: Array, factor: Array) -> Array:
    """A factor on every matrix."""
    return np.asarray(matrix * factor[..., None, None])


class _Couplings:
    """Couplings of pairs of groups under one excitation, of the representatives."""

    def __init__(
        self,
        system: GearSystem,
        excited: Excited,
        modal: ModalQuantities,
        groups: list[Group],
        force: ParametricExcitation,
        pairs: list[tuple[Group, Group]],
    ) -> None:
        self.groups = groups
        self.excited, self.squared, self.families = excited, modal.squared_frequency, families(system)
        self.family, self.number = _family_of(system, force)
        self.p, self.q = (np.array([pair[k] for pair in pairs]) for k in (0, 1))
        self.w_p, self.w_q = (modal.frequency[:, g].mean(axis=-1) for g in (self.p, self.q))
        self.unit = (self.w_p + self.w_q) / float(force.ratio)
        self.longest = limit(len(pairs), self.squared.shape[-1])

    def direct(self) -> Array:
        """B ``(rows, pairs, P, Q)``."""
        b = self.excited.matrices(self.family, np.array([self.number]))[:, :, 0]
        size = np.abs(self.excited.deflection) @ np.swapaxes(
            np.abs(self.excited.deflection) * self.excited.strength[:, None], -1, -2
        )
        b = np.where(np.abs(b) > ROUNDING * size, b, 0.0)
        return b[:, self.p[:, :, None], self.q[:, None, :]]

    def through(self) -> tuple[Array, Array]:
        """T ``(rows, pairs, P, Q)``, through all other modes and products of harmonics, and the size of its terms."""
        return self._matrix(self.family, self.p, self.q, self.w_p, self.number, self.q)

    def shift(self, side: str) -> tuple[Array, Array]:
        """S of one of the groups, Hermitian (that of Q for its vibration at -w_Q), and the size of its terms."""
        group, w, other = (self.p, self.w_p, self.q) if side == "p" else (self.q, self.w_q, self.p)
        parts = [self._matrix(family, group, group, w, 0, other) for family in self.families]
        total = np.sum([part[0] for part in parts], axis=0)
        total, size = 0.5 * (total + adjoint(total)), np.sum([part[1] for part in parts], axis=0)
        return (total if side == "p" else np.conj(total)), size

    def nearest(self) -> tuple[Array, Array, Array]:
        """See :func:`nearest_resonance`; of all modes of both groups and all families, the one that mixes most."""
        nu = self.w_p + self.w_q
        alike = np.zeros(2 * (self.squared.shape[-1],))
        for members in self.groups:
            alike[np.ix_(members, members)] = 1.0
        own = np.sqrt(np.maximum(self.squared, 0.0)) @ (alike / np.maximum(alike.sum(axis=0), 1.0))
        best = np.stack([np.zeros(nu.shape), np.ones(nu.shape), np.ones(nu.shape)])
        for group, w, other in ((self.p, self.w_p, self.q), (self.q, self.w_q, self.p)):
            for family in self.families:
                pairs = self._pairs(family, group[:, 0], group[:, 0], w, 0, other)
                near = nearest_resonance(self.excited, family, own, alike, group, pairs, nu)
                found = np.stack(near)
                best = np.where(found[0] * best[1] > best[0] * found[1], found, best)
        return best[0], best[1], best[2]

    def _pairs(self, family: Family, p: Array, q: Array, w: Array, number: int, other: Array) -> Pairs:
        resonant = np.zeros((len(other), self.squared.shape[-1]), dtype=bool)
        np.put_along_axis(resonant, other, True, axis=1)
        meeting = self.number if family == self.family else None
        return Pairs(p, q, w, self.unit, number, meeting, resonant)

    def _matrix(
        self, family: Family, left: Array, right: Array, w: Array, number: int, other: Array
    ) -> tuple[Array, Array]:
        """The second-order couplings of all modes of one group with all of another, and the size of their terms."""
        found, sizes = np.zeros((2, len(w), *left.shape, right.shape[1]), dtype=complex)
        for a in range(left.shape[1]):
            for b in range(right.shape[1]):
                pairs = self._pairs(family, left[:, a], right[:, b], w, number, other)
                coupling = second_order_coupling(self.excited, family, self.squared, pairs, self.longest)
                found[:, :, a, b], sizes[:, :, a, b] = coupling
        if left is right:
            # Whatever the basis: terms of one sign add up to the trace.
            return found, np.trace(sizes.real, axis1=-2, axis2=-1)
        single = sizes.shape[-2:] == (1, 1)
        return found, sizes[..., 0, 0].real if single else np.linalg.norm(found, axis=(-2, -1))


def _sizes(problem: Reduced, around: tuple[Array, Array, Array, Array]) -> tuple[Array, Array]:
    """(sum of the magnitudes of the second-order terms, estimate of the third-order ones), ``(rows, pairs)``."""
    size, strength, distance, motion = around
    w_p, w_q = problem.frequency_p, problem.frequency_q
    g = np.linalg.norm(problem.coupling, axis=(-2, -1))
    terms = size + 0.5 * g**2 * (1 / w_p + 1 / w_q)
    rates = [np.linalg.norm(d, axis=(-2, -1)) for d in (problem.damping_p, problem.damping_q)]
    terms = terms + rates[0] ** 2 / (2 * w_p) + rates[1] ** 2 / (2 * w_q)
    half = 2 * g + terms
    distance = np.maximum(distance, CLOSEST * (w_p + w_q))
    mixing = np.maximum(strength / distance, half / (2 * np.minimum(w_p, w_q)))
    return terms, terms * mixing + strength**2 / distance * (half * motion / distance)


def _blocks(system: GearSystem, modal: ModalQuantities, rows: Array, groups: list[Group]) -> Iterator[_Block]:
    """Rows of one structure in blocks of bounded size, those of proportional epsilons under one representative."""
    n, meshes = modal.deflection.shape[1:]
    step = int(np.clip(BLOCK // (n * n * meshes), 1, MOST_ROWS))
    tables = [table(mesh, HIGHEST) for mesh in system.meshes]
    for start in range(0, len(rows), step):
        members = rows[start : start + step]
        strength = _of_rows([np.asarray(m.amplitude)[..., None] for m in system.meshes], modal.batch, members)
        amplitude = np.concatenate(strength, axis=-1)
        scale = np.abs(amplitude).max(axis=-1)
        unit = np.divide(amplitude, scale[:, None], out=np.zeros(amplitude.shape), where=scale[:, None] > 0)
        varying = _of_rows([z for z in tables if z.ndim > 1], modal.batch, members)
        part = modal.rows(members)
        keys: dict[bytes, int] = {}
        source = np.zeros(len(members), dtype=int)
        for k in range(len(members)):
            values = [np.round(unit[k], ALIKE), part.squared_frequency[k], part.deflection[k], *(z[k] for z in varying)]
            source[k] = keys.setdefault(b"".join(np.ascontiguousarray(v).tobytes() for v in values), len(keys))
        chosen = np.unique(source, return_index=True)[1]
        own = iter(varying)
        waves = (next(own)[chosen] if z.ndim > 1 else np.broadcast_to(z, (len(chosen), *z.shape)) for z in tables)
        excited = Excited(unit[chosen], part.deflection[chosen], tuple(waves))
        yield _Block(system, groups, members, part, part.rows(chosen), excited, source, scale)


def _of_rows(arrays: list[Array], batch: tuple[int, ...], rows: Array) -> list[Array]:
    """Arrays ``(..., m)`` brought to the rows ``(rows, m)`` of the flattened batch."""
    wide = [np.broadcast_to(a, (*batch, a.shape[-1])) for a in arrays]
    return [a.reshape(-1, a.shape[-1])[rows] if a.ndim > 1 else a[None] for a in wide]
