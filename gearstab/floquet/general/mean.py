"""Motions of the mean system as a whole, and over the speed: its damping and the means of its periodic terms included.

    M q'' + [C + sum_j mean(c_j) u_j v_j^T] q' + [K0 + sum_i k_gi g_i g_i^T + sum_j mean(a_j) u_j v_j^T] q = 0

and what acts with speeds of rotation besides.

The natural frequencies of :func:`gearstab.modal.mean_modes` are those of its symmetric part without damping. Cross
coupling and negative damping may let the whole grow by itself, without any variation of the mesh stiffness.

In a Campbell diagram motions are followed by their shapes. From one speed W to the next, motions p and q are compared
by the modal assurance criterion in state space,

    MAC_pq = |(l_p^T r_q) (l_q^T r_p)|,

with left vectors l and right vectors r of unit l_p^T r_p at either speed; it is 1 where motions agree, and tells a
forward from a backward motion of the same displacements. Where a motion has no partner above SURE the step is halved.
Sources: Allemang 2003 (Sound Vib. 37, 14-23) for the criterion; Genta 2005, Dynamics of Rotating Systems, for whirl.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.propagation.elastic import ElasticRows, mean_levels, single_rows
from gearstab.system import Array, GearSystem

SURE = 0.8
"""A criterion from which on two motions are one."""
HALVINGS = 12
"""Least part of a step between two speeds: motions that exchange their shapes within 1/4096 of it cross."""
EQUAL = 1e-7
"""Exponents closer than this part of the largest one have no vectors of their own."""
PAIRED = 1e-9
"""Part of the largest entry of a gyroscopic matrix from which on it couples two coordinates."""
MOVING = 1e-3
"""Part of the kinetic energy of a motion from which on the orbit of a body counts."""
ROUND = 1e-3
"""Ellipticity of an orbit, from -1 to 1, below which it is a straight line."""
SWAPPED = 0.2
"""Part of its shape that a motion takes over from another where both veer apart."""
APART = 3.0
"""Times the least distance of two exponents, where their shapes are compared before and after."""
ROUNDING = 1e-11
"""A growth rate below this part of the largest exponent is rounding: an eigensolver leaves n eps ~ 1e-14 of it."""


@dataclass(frozen=True)
class WhirlMotions:
    """Motions over mesh frequencies, ``(P, n)`` each, as they are numbered at the first one by ascending frequency.

    natural_frequency: damped, rad per unit time, 0 of motions that do not oscillate. growth_rate: 1/time, exactly 0
    where only rounding is left. damping_ratio: NaN of motions that do not oscillate. whirl: 1 where all bodies orbit in
    the sense of the rotation, -1 against it, 0 for neither. veering: 1 where a motion is nearest to another one with
    which it exchanges its shape.
    """

    natural_frequency: Array
    growth_rate: Array
    damping_ratio: Array
    whirl: Array
    veering: Array


@dataclass(frozen=True)
class _Motions:
    """The oscillating ones at one speed, ``k``: exponents, right and left vectors; real exponents ``(j,)``, falling."""

    exponents: Array
    right: Array
    left: Array
    real: Array

    @classmethod
    def at(cls, own: ElasticRows, level: Array, speed: float) -> _Motions:
        """Return those of a single row, in which all that varies has its mean ``level`` (J,)."""
        rate = float(own.form.rate[0])
        values, right = np.linalg.eig(own.form.generator(level[None], np.array([speed]))[0])
        left = np.linalg.inv(right)
        swinging = np.flatnonzero(values.imag > 0)
        swinging = swinging[np.lexsort((-values[swinging].real, values[swinging].imag))]
        real = np.sort(np.append(rate * values[values.imag == 0].real, own.rigid_exponents[0]))[::-1]
        return cls(rate * values[swinging], right[:, swinging], left[swinging], real)

    def aligned(self, other: _Motions) -> _Motions:
        """Return the same with vectors of equal exponents, which are free, as near to the other's as they can be."""
        right, left = self.right.copy(), self.left.copy()
        begin, size = 0, np.abs(self.exponents).max(initial=0.0)
        for end in range(1, len(self.exponents) + 1):
            if end < len(self.exponents) and abs(self.exponents[end] - self.exponents[end - 1]) < EQUAL * size:
                continue
            if end - begin > 1:
                part = slice(begin, end)
                shares = np.sum(np.abs((left[part] @ other.right) * (other.left @ right[:, part]).T), axis=0)
                nearest = np.argsort(-shares, kind="stable")[: end - begin]
                turn = left[part] @ other.right[:, nearest]
                if len(nearest) == end - begin and np.linalg.cond(turn) < 1 / EQUAL:
                    right[:, part], left[part] = right[:, part] @ turn, np.linalg.solve(turn, left[part])
            begin = end
        return _Motions(self.exponents, right, left, self.real)

    def criterion(self, other: _Motions) -> Array:
        """MAC ``(k, k')``."""
        return np.abs((self.left @ other.right) * (other.left @ self.right).T)


class _Follower:
    """Follows the motions of a single system from speed to speed."""

    def __init__(self, system: GearSystem) -> None:
        (self.row,), (self.level,) = single_rows(system), mean_levels(system)

    def at(self, speed: float) -> _Motions:
        return _Motions.at(self.row, self.level, speed)

    def partners(self, first: _Motions, second: _Motions, low: float, high: float, halvings: int = HALVINGS) -> Array:
        """``(k,)``: which motion of the second speed is that of the first, -1 where it no longer oscillates."""
        from scipy.optimize import linear_sum_assignment  # takes as long to load as a small sweep to run

        mac = first.aligned(second).criterion(second.aligned(first))
        found = np.full(len(first.exponents), -1)
        rows, columns = linear_sum_assignment(mac, maximize=True)
        found[rows] = columns
        if not halvings or (len(rows) == len(found) == len(second.exponents) and (mac[rows, columns] > SURE).all()):
            return found
        middle = 0.5 * (low + high)
        between = self.at(middle)
        there = self.partners(first, between, low, middle, halvings - 1)
        on = self.partners(between, second, middle, high, halvings - 1)
        return np.where(there >= 0, np.append(on, -1)[there], -1)


def whirl_motions(system: GearSystem, mesh_frequency: Array) -> WhirlMotions:
    """Follow the motions of a single system over mesh frequencies ``(P,)``, in ascending order."""
    follower, n = _Follower(system), system.size
    motions = [follower.at(float(speed)) for speed in mesh_frequency]
    slots = _slots(follower, motions, mesh_frequency, n)
    exponents = np.zeros((len(motions), n), dtype=complex)
    whirl, sense = np.zeros((len(motions), n), dtype=np.int8), _Orbits(system)
    for k, (own, slot) in enumerate(zip(motions, slots, strict=True)):
        swings = slot >= 0
        exponents[k, swings] = own.exponents[slot[swings]]
        # Of two real exponents the larger one tells the growth.
        exponents[k, ~swings] = own.real[::2][: n - int(swings.sum())]
        shapes = (follower.row.form.speed[0] @ own.right) / own.exponents
        whirl[k, swings] = sense.whirl(shapes.T)[slot[swings]]
    growth = exponents.real.copy()
    growth[np.abs(growth) <= ROUNDING * np.abs(exponents).max(axis=1, initial=0.0)[:, None]] = 0.0
    frequency, size = exponents.imag, np.abs(exponents)
    ratio = np.where(frequency > 0, -growth / np.where(size > 0, size, 1.0), np.nan)
    return WhirlMotions(frequency, growth, ratio, whirl, _veering(motions, slots, exponents))


def _slots(follower: _Follower, motions: list[_Motions], speeds: Array, n: int) -> Array:
    """``(P, n)``: the number of each followed motion among those that oscillate at each speed, -1 where it rests."""
    slots = np.full((len(motions), n), -1)
    first = len(motions[0].exponents)
    slots[0, n - first :] = np.arange(first)
    for k in range(1, len(motions)):
        found = follower.partners(motions[k - 1], motions[k], float(speeds[k - 1]), float(speeds[k]))
        slots[k] = np.where(slots[k - 1] >= 0, np.append(found, -1)[slots[k - 1]], -1)
        new = np.setdiff1d(np.arange(len(motions[k].exponents)), slots[k])
        slots[k, np.flatnonzero(slots[k] < 0)[::-1][: len(new)]] = new[::-1]
    return slots


def _veering(motions: list[_Motions], slots: Array, exponents: Array) -> Array:
    """``(P, n)``: where two motions are nearest to each other and exchange shapes from before to after."""
    found = np.zeros(slots.shape, dtype=np.int8)
    for p in range(slots.shape[1]):
        for q in range(p):
            distance = np.abs(exponents[:, p] - exponents[:, q])
            inner = np.flatnonzero((distance[1:-1] <= distance[:-2]) & (distance[1:-1] < distance[2:])) + 1
            for k in inner:
                far = np.flatnonzero(distance > APART * distance[k])
                before, after = far[far < k].max(initial=-1), far[far > k].min(initial=len(motions))
                ends = [max(before, 0), min(after, len(motions) - 1)]
                own = slots[ends][:, [p, q]]
                if (own < 0).any():
                    continue
                mac = motions[ends[0]].criterion(motions[ends[1]])
                if max(mac[own[0, 0], own[1, 1]], mac[own[0, 1], own[1, 0]]) > SWAPPED:
                    found[k, [p, q]] = 1
    return found


class _Orbits:
    """Which coordinates are the two of a plane, and the sense of the rotation that they belong to.

    A pair (X, Y), in the order of the coordinates, is what the skew part of a gyroscopic or circulatory matrix couples
    with each other and with nothing else; positive from X to Y.
    """

    def __init__(self, system: GearSystem) -> None:
        self.pairs: list[tuple[int, int, int]] = []
        self.mass = np.diagonal(np.asarray(system.mass), axis1=-2, axis2=-1).reshape(-1, system.size)[0]
        for rotation in system.rotations:
            speed = rotation.speed_ratio if rotation.speed_ratio is not None else np.ravel(rotation.speed)[0]
            for given in (rotation.gyroscopic, rotation.circulatory):
                if given is None:
                    continue
                matrix = np.asarray(given).reshape(-1, system.size, system.size)[0]
                skew = np.abs(matrix - matrix.T)
                coupled = skew > PAIRED * np.abs(matrix).max(initial=0.0)
                for x, y in zip(*np.nonzero(np.triu(coupled)), strict=True):
                    if coupled[x].sum() == coupled[y].sum() == 1:
                        self.pairs.append((int(x), int(y), -1 if speed < 0 else 1))

    def whirl(self, shapes: Array) -> Array:
        """1, -1 or 0 for motions ``(k, n)``."""
        energy = self.mass * np.abs(shapes) ** 2
        least = MOVING * energy.sum(axis=1)
        forward, backward = np.zeros((2, len(shapes)), dtype=bool)
        for x, y, sense in self.pairs:
            ahead, behind = (np.abs(shapes[:, x] + sign * 1j * shapes[:, y]) for sign in (sense, -sense))
            ellipticity = (ahead - behind) / np.maximum(ahead + behind, np.finfo(float).tiny)
            counts = energy[:, x] + energy[:, y] > least
            forward |= counts & (ellipticity > -ROUND)
            backward |= counts & (ellipticity < ROUND)
        return forward.astype(np.int8) - backward.astype(np.int8)


@dataclass(frozen=True)
class MeanMotions:
    """Motions of the mean system, ``(rows, n)`` each, by ascending frequency.

    frequency: |Im| of a pair of exponents, rad per unit time, 0 for motions that do not oscillate. growth_rate: its
    real part, the larger one of two real exponents, 1/time; exactly 0 where only rounding is left. mode: position of
    the mode of the symmetric mean system that a motion resembles most; each mode has one motion.
    """

    frequency: Array
    growth_rate: Array
    mode: Array

    @property
    def unstable(self) -> Array:
        """``(rows, n)``, whether a motion grows by itself."""
        return self.growth_rate > 0


def mean_motions(system: GearSystem, mesh_frequency: Array | float = 0.0) -> MeanMotions:
    """Return the motions of the mean system of every row of the flattened batch: one eigenproblem each.

    mesh_frequency: ``()`` or ``(rows,)``, which speeds of rotation follow; they are at rest at 0.
    """
    speed = np.broadcast_to(np.asarray(mesh_frequency, dtype=float), (system.rows,))
    given = zip(single_rows(system), mean_levels(system), speed, strict=True)
    rows = [_row(own, level, omega, system.size) for own, level, omega in given]
    frequency, growth, mode = (np.stack(values) for values in zip(*rows, strict=True))
    return MeanMotions(frequency, growth, mode)


def frequencies_beyond_modes(system: GearSystem) -> Array:
    """``(rows, n)``: damped natural frequencies of the whole mean system in the order of the modes of its symmetric
    part, for systems beyond modes (:func:`~gearstab.floquet.dispatch.in_modes`).
    """
    found = mean_motions(system)
    return np.take_along_axis(found.frequency, np.argsort(found.mode, axis=1), 1)


def _row(own: ElasticRows, level: Array, speed: float, size: int) -> tuple[Array, Array, Array]:
    """(frequency, growth rate, mode) of one row's pairs of exponents: conjugate ones, or two real ones, the largest
    ones first.
    """
    from scipy.optimize import linear_sum_assignment  # takes as long to load as a small sweep to run

    rate = float(own.form.rate[0])
    values, vectors = np.linalg.eig(own.form.generator(level[None], np.array([speed]))[0])
    swinging = values.imag > 0
    exponents = np.concatenate([rate * values, own.rigid_exponents[0]])
    real = np.sort(exponents[exponents.imag == 0].real)[::-1][::2]
    frequency = np.concatenate([np.zeros(len(real)), rate * values[swinging].imag])
    growth = np.concatenate([real, rate * values[swinging].real])
    shares = np.zeros((size, size))
    along = np.abs(vectors[: len(own.elastic), swinging].T) ** 2
    shares[len(real) :, own.elastic] = along / along.sum(axis=1, keepdims=True)
    order = np.lexsort((-growth, frequency))
    mode = linear_sum_assignment(shares[order], maximize=True)[1]
    rounding = ROUNDING * np.abs(exponents).max(initial=0.0)
    return frequency[order], np.where(np.abs(growth) <= rounding, 0.0, growth)[order], mode
