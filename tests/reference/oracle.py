"""High-precision reference for Floquet problems with rectangular mesh stiffness, independent of the package.

    M q'' + C q' + [K0 + sum_i k_i(t) g_i g_i^T] q = 0

All inputs are taken as the exact rational numbers that the doubles stand for. Segments, stiffness levels, rigid modes
and their elimination are exact (``fractions``); only matrix exponentials, their product and its eigenvalues are
rounded, in mpmath arithmetic whose precision follows the conditioning of the product, so that the smallest multiplier
has as many right digits as the largest. Nothing of ``gearstab.floquet`` is used. Slow for more than five coordinates.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise
from math import floor, gcd, lcm

import mpmath as mp
import numpy as np
from scipy.optimize import linear_sum_assignment

from gearstab.system import GearSystem
from gearstab.waveforms import Rectangular

Exact = list[list[Fraction]]


@dataclass(frozen=True)
class PlainMesh:
    """Stiff for the fraction d = c - floor(c) of its period, from ``lag`` on.

    k(t) = mean [1 + 2 epsilon (1 - d)] there and mean [1 - 2 epsilon d] elsewhere.
    """

    direction: Sequence[float]
    mean_stiffness: float
    epsilon: float
    contact_ratio: float
    lag: float = 0.0
    frequency_ratio: Fraction = Fraction(1)

    @property
    def stiff_fraction(self) -> Fraction:
        return Fraction(self.contact_ratio) - floor(self.contact_ratio)

    def level(self, turns: Fraction) -> Fraction:
        """The stiffness at t = ``turns`` 2 pi/Omega."""
        d, x = self.stiff_fraction, self.frequency_ratio * turns - Fraction(self.lag)
        wave = 1 - d if x - floor(x) < d else -d
        return Fraction(self.mean_stiffness) * (1 + 2 * Fraction(self.epsilon) * wave)


@dataclass(frozen=True)
class Plain:
    """A system as plain numbers: nested sequences of floats."""

    mass: Sequence[Sequence[float]]
    stiffness: Sequence[Sequence[float]]
    meshes: Sequence[PlainMesh]
    damping: Sequence[Sequence[float]] | None = None


def plain(system: GearSystem, row: int | None = None) -> Plain:
    """The plain numbers of a single system, or of one row of a batch of shape (rows,)."""
    batch = system.batch
    index = () if row is None else (row,)
    if len(batch) != len(index):
        raise ValueError(f"row {row} of a system of batch shape {batch}")

    def pick(value: object, core: int) -> list:
        array = np.asarray(value, dtype=float)
        return np.broadcast_to(array, batch + array.shape[array.ndim - core :])[index].tolist()

    meshes = []
    for mesh in system.meshes:
        if not isinstance(mesh.waveform, Rectangular):
            raise TypeError("the oracle knows rectangular waves only")
        numbers = [pick(v, 0) for v in (mesh.mean_stiffness, mesh.epsilon, mesh.waveform.contact_ratio, mesh.lag)]
        meshes.append(PlainMesh(pick(mesh.direction, 1), *numbers, mesh.frequency_ratio))
    damping = None if system.damping is None else pick(system.damping, 2)
    return Plain(pick(system.mass, 2), pick(system.stiffness, 2), meshes, damping)


# ---- exact part: rational numbers only


def exact(rows: Sequence[Sequence[float]]) -> Exact:
    return [[Fraction(value) for value in row] for row in rows]


def multiply(a: Exact, b: Exact) -> Exact:
    columns = list(zip(*b, strict=True))
    return [[sum((x * y for x, y in zip(row, column, strict=True)), Fraction(0)) for column in columns] for row in a]


def transpose(a: Exact) -> Exact:
    return [list(column) for column in zip(*a, strict=True)]


def null_space(a: Exact) -> Exact:
    """Columns that span the null space, by exact elimination; a list of n empty rows when there is none."""
    rows, n = [list(row) for row in a], len(a[0])
    pivots: list[int] = []
    for column in range(n):
        found = next((i for i in range(len(pivots), len(rows)) if rows[i][column] != 0), None)
        if found is None:
            continue
        top = len(pivots)
        rows[top], rows[found] = rows[found], rows[top]
        rows[top] = [value / rows[top][column] for value in rows[top]]
        for i in range(len(rows)):
            if i != top and rows[i][column] != 0:
                rows[i] = [x - rows[i][column] * y for x, y in zip(rows[i], rows[top], strict=True)]
        pivots.append(column)
    free = [column for column in range(n) if column not in pivots]
    basis = [[Fraction(int(i == column)) for column in free] for i in range(n)]
    for i, pivot in enumerate(pivots):
        basis[pivot] = [-rows[i][column] for column in free]
    return basis


def common_period(p: Plain) -> Fraction:
    """In units of 2 pi/Omega: the least common multiple of the periods 1/r_i."""
    periods = [1 / Fraction(mesh.frequency_ratio) for mesh in p.meshes]
    return Fraction(lcm(*(t.numerator for t in periods)), gcd(*(t.denominator for t in periods)))


def segments(p: Plain) -> list[tuple[Fraction, tuple[Fraction, ...]]]:
    """(duration in units of 2 pi/Omega, stiffness of each mesh) from t = 0 over the common period."""
    period = common_period(p)
    edges = {Fraction(0), period}
    for mesh in p.meshes:
        for phase in (Fraction(0), mesh.stiff_fraction):
            for cycle in range(int(period * mesh.frequency_ratio)):
                edge = (Fraction(mesh.lag) + phase + cycle) / mesh.frequency_ratio
                edges.add(edge - floor(edge / period) * period)
    ordered = sorted(edges)
    return [
        (stop - start, tuple(mesh.level((start + stop) / 2) for mesh in p.meshes)) for start, stop in pairwise(ordered)
    ]


def stiffness_at(p: Plain, levels: Sequence[Fraction]) -> Exact:
    total = exact(p.stiffness)
    for mesh, level in zip(p.meshes, levels, strict=True):
        g = [Fraction(value) for value in mesh.direction]
        total = [[total[i][j] + level * g[i] * g[j] for j in range(len(g))] for i in range(len(g))]
    return total


def rigid_modes(p: Plain) -> Exact:
    """Columns r with K(t) r = 0 at all times: K0 r = 0 and every mesh deflection g_i^T r = 0."""
    return null_space(exact(p.stiffness) + [[Fraction(v) for v in mesh.direction] for mesh in p.meshes])


@dataclass(frozen=True)
class FirstOrder:
    """y' = A_s y on the segments without the rigid modes; ``eliminated`` exponents are exactly zero."""

    generators: list[tuple[Exact, Fraction]]
    eliminated: int
    period: Fraction


def first_order(p: Plain) -> FirstOrder:
    """State matrices [[0, I], [-M^-1 K, -M^-1 C]] without the defective multiplier 1 of the rigid modes R.

    C R = 0: restrict to the M-orthogonal complement of R (both exponents of a rigid mode are 0). Otherwise only the
    rigid *displacement* drops out (one exponent 0 a mode); the rigid velocity decays or couples and stays.
    """
    n = len(p.mass)
    mass, rigid = exact(p.mass), rigid_modes(p)
    count = len(rigid[0])
    damping = exact(p.damping) if p.damping is not None else [[Fraction(0)] * n for _ in range(n)]
    whole = [[Fraction(int(i == j)) for j in range(n)] for i in range(n)]
    elastic = null_space(multiply(transpose(rigid), mass)) if count else whole
    free = count > 0 and not any(any(row) for row in multiply(damping, rigid) + multiply(transpose(rigid), damping))
    speeds = elastic if free or not count else whole
    # q = elastic y (+ rigid z, which acts on nothing) and v = speeds w; y' is the elastic part of v.
    left, inertia = transpose(speeds), multiply(multiply(transpose(speeds), mass), speeds)
    project = inverse_of(multiply(multiply(transpose(elastic), mass), elastic))
    shift = multiply(multiply(multiply(project, transpose(elastic)), mass), speeds)
    inverse = inverse_of(inertia)
    drag = multiply(inverse, multiply(multiply(left, damping), speeds))
    generators = []
    for duration, levels in segments(p):
        spring = multiply(inverse, multiply(multiply(left, stiffness_at(p, levels)), elastic))
        upper = [[Fraction(0)] * len(elastic[0]) + row for row in shift]
        lower = [[-v for v in a] + [-v for v in b] for a, b in zip(spring, drag, strict=True)]
        generators.append((upper + lower, duration))
    return FirstOrder(generators, 2 * n - len(generators[0][0]), common_period(p))


def inverse_of(a: Exact) -> Exact:
    """The inverse, by exact elimination: the null space of [A, -I] holds the columns (X, I) with A X = I."""
    n = len(a)
    joined = [list(row) + [Fraction(-int(i == j)) for j in range(n)] for i, row in enumerate(a)]
    return null_space(joined)[:n]


# ---- rounded part: mpmath


def number(value: Fraction) -> mp.mpf:
    return mp.mpf(value.numerator) / value.denominator


def exponential(generator: Exact, time: mp.mpf) -> mp.matrix:
    return mp.expm(mp.matrix([[number(value) for value in row] for row in generator]) * time)


def digits_lost(system: FirstOrder, omega: float) -> int:
    """Decimal digits between the largest and the smallest multiplier, at most: the sum over the segments of log10 of
    the condition number of exp(A t)."""
    with mp.workdps(30):
        cycle = 2 * mp.pi / mp.mpf(omega)
        total = mp.mpf(0)
        for generator, duration in system.generators:
            time = number(duration) * cycle
            total += mp.log10(mp.mnorm(exponential(generator, time), 1) * mp.mnorm(exponential(generator, -time), 1))
    return int(mp.ceil(total))


def monodromy(system: FirstOrder, omega: float, digits: int) -> tuple[mp.matrix, int]:
    """The product of segment exponentials, first segment rightmost, and the working digits it took.

    The relative error of the smallest multiplier is at most about the product of all condition numbers times the
    rounding unit; the precision makes up for it.
    """
    working = digits + 20 + digits_lost(system, omega)
    with mp.workdps(working):
        cycle = 2 * mp.pi / mp.mpf(omega)
        total = mp.eye(len(system.generators[0][0]))
        for generator, duration in system.generators:
            total = exponential(generator, number(duration) * cycle) * total
    return total, working


@dataclass(frozen=True)
class Reference:
    """Multipliers and exponents (mpc), largest first, of the common period T (mpf).

    The ``rigid`` exponents of rigid modes, exact zeros, are not listed. ``elastic`` lacks the decays of rigid
    velocities that no damping couples to the elastic modes as well.
    """

    multipliers: list[mp.mpc]
    exponents: list[mp.mpc]
    elastic: list[mp.mpc]
    rigid: int
    period: mp.mpf
    monodromy: mp.matrix
    digits: int

    def all_exponents(self) -> np.ndarray:
        """In double precision, with the zeros of the rigid modes: 2 n of them."""
        return np.array([complex(value) for value in self.exponents] + [0j] * self.rigid)

    @property
    def growth_rate(self) -> float:
        """The largest real part of the characteristic exponents; rigid modes take no part."""
        return float(max(value.real for value in self.elastic))


def solve(p: Plain, omega: float, digits: int = 40) -> Reference:
    """Floquet multipliers and exponents log(lambda)/T, imaginary part in (-pi/T, pi/T], to ``digits`` digits."""
    system = first_order(p)
    matrix, working = monodromy(system, omega, digits)
    with mp.workdps(working):
        period = number(system.period) * 2 * mp.pi / mp.mpf(omega)
        values = mp.eig(matrix, left=False, right=False) if matrix.rows > 1 else [matrix[0, 0]]
        values = sorted((mp.mpc(value) for value in values), key=lambda value: -abs(value))
        exponents = [mp.mpc(mp.log(value)) / period for value in values]
    elastic = list(exponents)
    for decay in rigid_decays(p) if system.eliminated == len(rigid_modes(p)[0]) else []:
        elastic.remove(min(elastic, key=lambda value: abs(value + decay)))
    return Reference(values, exponents, elastic, system.eliminated, period, matrix, working)


def rigid_decays(p: Plain) -> list[float]:
    """Decay a of a rigid velocity that stays by itself, C r = a M r within the rounding of C; one rigid mode only."""
    rigid = rigid_modes(p)
    if not rigid[0]:
        return []
    r, mass, damping = (np.array(a, dtype=float) for a in (rigid, p.mass, p.damping))
    if r.shape[1] > 1:
        raise NotImplementedError("several rigid modes with damping")
    force, decay = damping @ r, float((r.T @ damping @ r / (r.T @ mass @ r))[0, 0])
    if np.max(np.abs(force - decay * mass @ r)) > 1e-13 * np.max(np.abs(damping)):
        return []
    return [decay]


def verdict(p: Plain, omega: float, digits: int = 100) -> bool:
    """True when all solutions (rigid modes apart) stay bounded, settled in ``digits`` digits.

    Bounded: no multiplier outside the unit circle, and those on it semisimple, which is tested by the minimal
    polynomial: the product of (M - lambda) over the *distinct* multipliers on the circle and over all inside vanishes
    exactly then. Multipliers that agree to a quarter of the digits count as one (rounding splits a defective pair by
    half of the digits, a fourfold one by a quarter).
    """
    reference = solve(p, omega, digits)
    with mp.workdps(reference.digits):
        near = mp.mpf(10) ** (-digits // 4)
        if abs(reference.multipliers[0]) > 1 + near:
            return False
        inside = [value for value in reference.multipliers if abs(value) < 1 - near]
        groups: list[list[mp.mpc]] = []
        for value in reference.multipliers[: len(reference.multipliers) - len(inside)]:
            group = next((g for g in groups if abs(g[0] - value) < near), None)
            if group is None:
                groups.append([value])
            else:
                group.append(value)
        identity = mp.eye(reference.monodromy.rows)
        product, scale = identity, mp.mpf(1)
        for factor in inside + [mp.fsum(group) / len(group) for group in groups]:
            product *= reference.monodromy - factor * identity
            scale *= mp.mnorm(reference.monodromy, 1) + abs(factor)
        remainder = mp.mnorm(product, 1) / scale
    if near**2 < remainder < near:
        raise ArithmeticError(f"undecided at {digits} digits: remainder {mp.nstr(remainder, 3)}")
    return bool(remainder <= near**2)


# ---- comparison


def assert_exponents_match(
    ours: np.ndarray, reference: np.ndarray, period: float, rtol: float = 1e-12, atol: float = 1e-12
) -> float:
    """The two sets agree modulo 2 pi i/T, each pair to max(atol, rtol max|reference|); returns the largest distance."""
    ours, reference = np.asarray(ours, dtype=complex).ravel(), np.asarray(reference, dtype=complex).ravel()
    assert ours.shape == reference.shape, f"{ours.size} exponents against {reference.size}"
    assert np.all(np.isfinite(ours)), f"exponents that are not finite: {ours}"
    width = 2 * np.pi / float(period)
    gap = ours[:, None] - reference[None, :]
    gap = gap.real + 1j * (gap.imag - width * np.round(gap.imag / width))
    pairs = linear_sum_assignment(np.abs(gap))
    worst = float(np.max(np.abs(gap)[pairs]))
    allowed = max(atol, rtol * float(np.max(np.abs(reference))))
    lines = (f"{ours[i]:.17g} against {reference[j]:.17g}: {abs(gap[i, j]):.2e}" for i, j in zip(*pairs, strict=True))
    detail = "\n".join(lines)
    assert worst <= allowed, f"exponents differ by {worst:.2e}, allowed {allowed:.2e}:\n{detail}"
    return worst
