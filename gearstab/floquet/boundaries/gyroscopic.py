"""All intervals of instability of undamped systems with gyroscopic terms, however narrow, by covering the range.

The speeds of matrices that act with a rotation may follow the mesh. Every point has a stretch around it on which its
verdict cannot change. Points are added where stretches leave gaps. Towards a collision of two multipliers, or an edge,
the end of a stretch is known to second order in the distance, so that gaps shrink quadratically: where they are below
the width floor and the verdict on both sides is the same nothing as wide is hidden, and where it is not there is an
edge, which points on both sides confirm.

Theory. Let P(x) be symplectic, x = ln(1/Omega), K = -i J the Krein form. In a basis Y of eigenvectors with Y^H K Y =
S = diag(1, .., -1, ..) the speed of P is a Hermitian matrix E, P^-1 dP/dx = i Y S E Y^-1, and a multiplier exp(i theta)
of sign s moves at dtheta/dx = s E_ii. Stability is lost only where multipliers of opposite signs meet. Of a positive
one i and a negative one j, at a distance d, on the span of both and to first order in h = x - x0

    ln P = i [[theta_i + h E_ii, h E_ij], [-h conj(E_ij), theta_j - h E_jj]],

so that they cannot have met before d = |h| (c + 2 |E_ij|), c the speed at which they approach. A pair that is off the
circle has ln |lambda| = +-g and eigenvectors v of lambda, w of 1/conj(lambda); in the basis (v +- w)/2^(1/2) of signs
+-1 its logarithm is i theta + g [[0, 1], [1, 0]], and it stays off as long as |h (E_ii + E_jj)| < 2 |g + i h E_ij|.

What this leaves out are other multipliers k, by which each of the two moves no more than min(|h E_ik|, h^2
|E_ik|^2/d_ik), and the change of E. With B = P^-1 P' the sum of B_s, what the segments s contribute, seen from the
beginning of the period, B' = sum over s < t of [B_s, B_t] besides the direct dependence on the speed, so that E changes
by no more than (sum |E_s|)^2 |h|. For this stands DRIFT e^2 |h|, with e a bound of the norm of E.

The dependence of the generators on the speed is in dP/dx, so it is in E. Where nothing moves with the speed E > 0
(:mod:`~gearstab.floquet.boundaries.counting.krein`); here nothing is said of its sign.

Sources: Krein 1950; Gelfand & Lidskii 1955; Yakubovich & Starzhinskii 1975, ch. III.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.floquet.boundaries.counting.krein import spectrum
from gearstab.floquet.boundaries.counting.pairs import KreinSpectrum
from gearstab.floquet.boundaries.damped.proof import running_maximum
from gearstab.floquet.boundaries.damped.search import SearchResult, Stretches
from gearstab.floquet.boundaries.parts import Intervals, paired, verdicts_at_ends
from gearstab.floquet.general.exact import CanonicalPeriods
from gearstab.grouping import Columns, numbered
from gearstab.interrupts import heed
from gearstab.system import Array

DRIFT = 2.0
"""Change of E over e^2 |h|, at most: four times what random systems need, of which 0.05 loses regions."""
FAR = 1.0
"""Radius over 1/e that is relied on at most."""
DEEP = 4.0
"""ln |lambda| from which on the inverse of P is lost in rounding, so that the largest multiplier tells the radius."""
PART = 0.5
"""Radians of the fastest motion in that radius; some DEEP of them take a pair back to the circle."""
NEAR = 1 - 4.0 ** -np.arange(1, 14)
"""Parts of a first-order radius that are tried with all terms, besides halves."""


@dataclass(frozen=True)
class KreinPhases:
    """Multipliers at P points in the basis Y, the n positive ones first.

    phase, depth ``(P, 2n)``: ln lambda = depth + i phase, depth 0 on the circle. speed ``(P, 2n, 2n)``: E. partner
    ``(P, 2n)``: of one off the circle the other one of its pair, else -1. known ``(P,)``: whether there are n of each
    sign. deep ``(P,)``: a radius by the largest multiplier, 0 where it is not far from the circle.
    """

    phase: Array
    depth: Array
    speed: Array
    partner: Array
    known: Array
    deep: Array

    @property
    def unstable(self) -> Array:
        """``(P,)``."""
        return np.asarray((self.partner >= 0).any(axis=1))

    @classmethod
    def of(cls, matrix: Array, slope: Array, radian: Array) -> KreinPhases:
        """From P and dP/dx ``(P, 2n, 2n)``; radian ``(P,)``: of the fastest motion over the period, in x."""
        points, n, each = len(matrix), matrix.shape[-1] // 2, np.arange(len(matrix))[:, None]
        found = spectrum(matrix)
        outside = np.abs(found.values) > 1
        positive = np.where(found.off, outside, found.sign > 0)
        order = np.argsort(~positive, axis=1, kind="stable")
        place = np.argsort(order, axis=1, kind="stable")
        values, off = found.values[each, order], found.off[each, order]
        partner = np.where(off, place[each, found.mirror[each, order]], -1)
        vectors = np.take_along_axis(found.vectors, order[:, None, :], axis=2)
        with np.errstate(all="ignore"):
            basis = _normal(vectors, values, off, partner)
            basis = np.concatenate([_orthonormal(basis[:, :, :n], 1.0), _orthonormal(basis[:, :, n:], -1.0)], axis=2)
            inverse = np.concatenate([-_rotated(matrix)[:, n:], _rotated(matrix)[:, :n]], axis=1)
            speed = np.swapaxes(basis.conj(), 1, 2) @ _krein(inverse @ slope @ basis)
        speed = -0.5j * (speed - np.swapaxes(speed.conj(), 1, 2))
        known = (positive.sum(axis=1) == n) & np.isfinite(speed).all(axis=(1, 2))
        pairs = np.where(off, np.take_along_axis(partner, np.maximum(partner, 0), axis=1) == np.arange(2 * n), True)
        known &= pairs.all(axis=1)
        phase, depth = np.angle(values), np.where(off, np.log(np.abs(values)), 0.0)
        speed = np.where(known[:, None, None], speed, np.zeros((points, 1, 1)))
        return cls(phase, depth, speed, partner, known, np.where(_growth(found) > DEEP, PART * radian, 0.0))

    def radii(self) -> Array:
        """``(P, 2)``: how far down and up in x the verdict is the same; 0 where nothing is known."""
        result = np.repeat(self.deep[:, None], 2, axis=1)
        for chosen, radius in ((~self.unstable, _apart), (self.unstable, _off)):
            k = np.flatnonzero(chosen & self.known & (self.deep == 0))
            if len(k):
                own = KreinPhases(*(part[k] for part in vars(self).values()))
                result[k] = np.stack([radius(own, -1.0), radius(own, 1.0)], axis=1)
        return result


def _growth(found: KreinSpectrum) -> Array:
    """``(P,)``: ln of the largest multiplier off the circle."""
    return np.log(np.where(found.off, np.abs(found.values), 1.0).max(axis=1))


def _rotated(matrix: Array) -> Array:
    """(P^T J) ``(P, 2n, 2n)``, of which J times it is the inverse of a symplectic P but for its sign."""
    n = matrix.shape[-1] // 2
    turned = np.swapaxes(matrix, 1, 2)
    return np.concatenate([-turned[:, :, n:], turned[:, :, :n]], axis=2)


def _krein(vectors: Array) -> Array:
    """K y of columns ``(P, 2n, k)``."""
    n = vectors.shape[1] // 2
    return np.concatenate([-1j * vectors[:, n:], 1j * vectors[:, :n]], axis=1)


def _normal(vectors: Array, values: Array, off: Array, partner: Array) -> Array:
    """Eigenvectors ``(P, 2n, 2n)`` with a Krein form of 1 or -1, and (v +- w)/2^(1/2) of pairs off the circle."""
    size = np.abs(np.einsum("pik,pik->pk", vectors.conj(), _krein(vectors)))
    result = vectors / np.sqrt(np.where(off, 1.0, size))[:, None, :]
    p, k = np.nonzero(off & (np.abs(values) > 1))
    if len(p):
        j = partner[p, k]
        v, w = vectors[p, :, k], vectors[p, :, j]
        w = w / np.einsum("pi,pi->p", v.conj(), _krein(w[:, :, None])[:, :, 0])[:, None]
        ratio = np.sqrt(np.linalg.norm(w, axis=1) / np.linalg.norm(v, axis=1))[:, None]
        v, w = v * ratio, w / ratio
        result[p, :, k], result[p, :, j] = (v + w) / np.sqrt(2), (v - w) / np.sqrt(2)
    return result


def _orthonormal(vectors: Array, sign: float) -> Array:
    """The same of one sign, of which nearly equal multipliers have vectors that are not orthogonal as computed."""
    form = sign * np.swapaxes(vectors.conj(), 1, 2) @ _krein(vectors)
    n = form.shape[-1]
    size = np.abs(form - np.eye(n)).max(axis=(1, 2))
    result = vectors.copy()
    k = np.flatnonzero(size > 1e-9)
    if len(k):
        values, frame = np.linalg.eigh(np.where(np.isfinite(form[k]), form[k], 0.0))
        root = np.sqrt(np.where(values > 0, values, np.nan))
        result[k] = vectors[k] @ (frame / root[:, None, :]) @ np.swapaxes(frame.conj(), 1, 2)
    return result


def _turns(angle: Array) -> Array:
    """Distance of two angles on the circle."""
    return np.abs((angle + np.pi) % (2 * np.pi) - np.pi)


def _norm(speed: Array) -> Array:
    """A bound of the norm of Hermitian matrices ``(P, 2n, 2n)``: their largest sum along a row."""
    return np.abs(speed).sum(axis=2).max(axis=1)


def _mixing(found: KreinPhases, radius: Array) -> Array:
    """``(P, 2n, 2n)``: how fast k may move i within a radius ``(P,)``; 0 on the diagonal."""
    size, m = np.abs(found.speed), found.phase.shape[1]
    apart = _turns(found.phase[:, :, None] - found.phase[:, None, :])
    apart = np.hypot(apart, found.depth[:, :, None] - found.depth[:, None, :])
    with np.errstate(divide="ignore", invalid="ignore"):
        second = np.where(apart > 0, radius[:, None, None] * size**2 / apart, np.inf)
    moved: Array = np.minimum(size, second)
    moved[:, np.arange(m), np.arange(m)] = 0.0
    return moved


def _apart(found: KreinPhases, side: float) -> Array:
    """Radii ``(P,)`` of stable points."""
    n, speed = found.phase.shape[1] // 2, found.speed
    own = np.einsum("pii->pi", speed).real
    turning = side * (own[:, :n, None] + own[:, None, n:])
    ahead = (found.phase[:, :n, None] - found.phase[:, None, n:]) % (2 * np.pi)
    coupling, size = 2 * np.abs(speed[:, :n, n:]), _norm(speed)
    drift = (DRIFT * size**2)[:, None, None]

    def radius(moved: Array | float) -> Array:
        least = FAR / size
        for distance, closing in ((ahead, -turning), (2 * np.pi - ahead, turning)):
            b = closing + coupling + moved
            first = 2 * distance / (b + np.sqrt(b**2 + 4 * drift * distance))
            least = np.minimum(least, first.min(axis=(1, 2)))
        return np.asarray(least)

    mixing = _mixing(found, radius(0.0))
    total = mixing.sum(axis=2)
    others = total[:, :n, None] + total[:, None, n:] - 2 * mixing[:, :n, n:]
    return radius(others)


def _off(found: KreinPhases, side: float) -> Array:
    """Radii ``(P,)`` of unstable points: of the pair that has the largest."""
    result, size = np.zeros(len(found.phase)), _norm(found.speed)
    p, i = np.nonzero(found.depth > 0)
    j, g, own = found.partner[p, i], found.depth[p, i], found.speed[p]
    each = np.arange(len(p))
    # The logarithm of a product, to first order in the second factor, for a pair so far apart.
    factor = 2 * g / -np.expm1(-2 * g)
    turning = factor * (own[each, i, i] + own[each, j, j]).real
    coupling = factor * own[each, i, j]
    b, a = 8 * side * g * coupling.imag, turning**2 - 4 * np.abs(coupling) ** 2
    with np.errstate(all="ignore"):
        root = np.sqrt(b**2 + 16 * a * g**2)
        first = np.where(b + root > 0, 8 * g**2 / (b + root), np.inf)
        first = np.minimum(np.where(np.isnan(first), np.inf, first), FAR / size[p])
    mixing = _mixing(found, np.zeros(len(result)) + FAR / size)
    total = mixing.sum(axis=2)
    others = total[p, i] + total[p, j] - 2 * mixing[p, i, j]
    parts = np.concatenate([2.0 ** -np.arange(8, 1, -1), NEAR])
    radius = first[:, None] * parts
    left = 2 * np.abs(g[:, None] + 1j * side * radius * coupling[:, None]) - np.abs(turning)[:, None] * radius
    left -= others[:, None] * radius + DRIFT * (size[p, None] * radius) ** 2
    good = np.logical_and.accumulate(left > 0, axis=1)
    best = np.where(good, radius, 0.0).max(axis=1)
    np.maximum.at(result, p, best)
    return result


FEWEST = 16
"""First points of a row."""
SHARE = 0.25
"""Part of the width floor to which gaps are closed."""
CLOSE = 0.1
"""Part of the tolerance to which an edge is closed in, before points on both sides confirm it."""
REACH = 2.2
"""Distance of new points in radii of the neighbours."""
AT_ONCE = 16
"""New points of a gap in one round, at most."""
ROUNDS = 60
MOST = 50_000
"""Points of a row, at most."""


def search(periods: CanonicalPeriods, first: Array, last: Array, tolerance: float, floor: float) -> SearchResult:
    """Find the intervals of all rows between the cycles ``first`` and ``last`` ``(r,)``; tolerance, floor: relative.

    Rows in which a gap is left open are not counted; their step is the widest one.
    """
    found = VerdictCover(periods, np.log(first), np.log(last))
    count = len(first)
    found.add(np.repeat(np.arange(count), FEWEST), np.linspace(found.first, found.last, FEWEST, axis=1).ravel())
    for _ in range(ROUNDS):
        gaps = found.gaps()
        row, x = gaps.wanted(gaps.open(tolerance, floor) & (found.evaluations < MOST)[gaps.row])
        if len(row) == 0:
            break
        found.add(row, x)
    gaps = found.gaps()
    left = gaps.open(tolerance, floor)
    step, none = np.zeros(count), np.empty(0)
    np.maximum.at(step, gaps.row[left], gaps.width[left])
    closed = ~gaps.differ & ~found.unstable[gaps.before] & ~left
    edges = gaps.chosen(gaps.differ)
    intervals = found.intervals(edges, *found.confirmed(edges, tolerance), floor)
    k = np.flatnonzero(step == 0)
    return SearchResult(
        intervals, [none for _ in intervals], found.evaluations, Stretches(none.astype(int), none, none),
        Stretches(k, first[k], last[k]), step, step > 0, np.bincount(gaps.row[closed], minlength=count),
    )  # fmt: skip


@dataclass(frozen=True)
class VerdictGaps(Columns):
    """Gaps that stretches leave between neighbouring points ``before`` and ``before + 1``: left..right, and whether the
    verdicts differ; radius: the mean one of both.
    """

    row: Array
    before: Array
    left: Array
    right: Array
    differ: Array
    radius: Array

    @property
    def width(self) -> Array:
        """right - left."""
        return self.right - self.left

    def open(self, tolerance: float, floor: float) -> Array:
        """Return which are too wide."""
        return np.asarray(self.width > np.where(self.differ, CLOSE * tolerance, SHARE * floor))

    def wanted(self, chosen: Array) -> tuple[Array, Array]:
        """Return points (row, x) to look at in the chosen ones."""
        k = np.flatnonzero(chosen)
        width = self.width[k]
        count = np.ceil(width / (REACH * np.maximum(self.radius[k], width / (REACH * AT_ONCE)))).astype(int)
        chosen_of, number = numbered(count)
        owner = k[chosen_of]
        return self.row[owner], self.left[owner] + self.width[owner] * (number + 0.5) / count[chosen_of]


class VerdictCover:
    """Points of rows in order of (row, x), x = ln(1/Omega): their verdicts, and the stretches on which these hold."""

    def __init__(self, periods: CanonicalPeriods, first: Array, last: Array) -> None:
        self.periods, self.first, self.last = periods, first, last
        self.row, self.unstable = np.empty(0, dtype=int), np.empty(0, dtype=bool)
        self.x, self.low, self.high = np.empty((3, 0))
        self.evaluations = np.zeros(len(first), dtype=np.int64)
        self.fastest = periods.radians(0.5 * (np.exp(-first) + np.exp(-last)))

    def look(self, row: Array, x: Array) -> KreinPhases:
        """Compute points."""
        heed()
        self.evaluations += np.bincount(row, minlength=len(self.first))
        cycle = np.exp(x)
        return KreinPhases.of(*self.periods.with_slope(row, cycle), 1 / (self.fastest[row] * cycle))

    def add(self, row: Array, x: Array) -> None:
        """Take in further points."""
        found = self.look(row, x)
        radius = found.radii()
        new = row, x, x - radius[:, 0], x + radius[:, 1], found.unstable
        own = (self.row, self.x, self.low, self.high, self.unstable)
        columns = [np.concatenate(pair) for pair in zip(own, new, strict=True)]
        order = np.lexsort((columns[1], columns[0]))
        self.row, self.x, self.low, self.high, self.unstable = (column[order] for column in columns)

    def gaps(self) -> VerdictGaps:
        """All of them."""
        change = (np.diff(self.row) > 0) | (self.unstable[1:] != self.unstable[:-1])
        run = np.append(0, np.cumsum(change))
        reach = running_maximum(run, self.high)
        back = -running_maximum(run[-1] - run[::-1], -self.low[::-1])[::-1]
        k = np.flatnonzero(np.diff(self.row) == 0)
        left, right, differ = reach[k], back[k + 1], self.unstable[k + 1] != self.unstable[k]
        # Where stretches of different verdicts overlap none of them is believed.
        wrong = differ & (np.maximum(left, self.x[k]) >= np.minimum(right, self.x[k + 1]))
        left, right = np.where(wrong, self.x[k], left), np.where(wrong, self.x[k + 1], right)
        radius = np.sqrt((self.high - self.x)[k] * (self.x - self.low)[k + 1])
        every = VerdictGaps(self.row[k], k, left, right, differ, radius)
        return every.chosen((right > left) & (self.x[k + 1] > self.x[k]))

    def confirmed(self, edges: VerdictGaps, tolerance: float) -> tuple[Array, Array]:
        """Where the edges are, and the widths of brackets of points on both sides ``(E,)``."""
        middle, before = 0.5 * (edges.left + edges.right), self.unstable[edges.before]
        low, high = self.x[edges.before], self.x[edges.before + 1]
        inner = np.stack([np.maximum(middle - 0.5 * tolerance, low), np.minimum(middle + 0.5 * tolerance, high)])
        while True:
            wide = np.flatnonzero(high - low > 1.01 * tolerance)
            if len(wide) == 0:
                break
            row = edges.row[wide]
            for x in inner[:, wide]:
                # One of the two halves otherwise.
                beyond = self.look(row, x).unstable != before[wide]
                high[wide[beyond]] = np.minimum(high[wide[beyond]], x[beyond])
                low[wide[~beyond]] = np.maximum(low[wide[~beyond]], x[~beyond])
            inner = 0.5 * (low + high)[None]
        return 0.5 * (low + high), high - low

    def intervals(self, edges: VerdictGaps, place: Array, width: Array, floor: float) -> Intervals:
        """Pair the edges of each row."""
        cycle, ends = np.exp(place), np.exp(np.stack([self.first, self.last]))
        return paired(ends, edges.row, cycle, width * cycle, verdicts_at_ends(self.row, self.unstable), floor)
