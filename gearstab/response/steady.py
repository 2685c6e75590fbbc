"""Motions over the common period: steady states of many operating points at once, and a single motion period by period.

Over the common period T of everything that varies and drives, x(T) = M x(0) + b, so that the steady state begins with

    x(0) = (I - M)^-1 b.

It attracts every motion where the system is asymptotically stable. Elsewhere it exists all the same, but is not what
would be seen, and at a multiplier 1 (an edge of an instability region, an undamped resonance) there is none.

A single motion begins its periods with the states that follow from x -> M x + b; then every interval between edges is
treated for all periods at once, with the maps from its beginning to the samples in it. Of a large system whose
functions vary smoothly such a map costs far more than one motion does: a few periods are then followed by a Runge-Kutta
method.

Source: Friedmann 1986, section 4 (response of linear periodic systems from the transition matrix of a period).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np

from gearstab.errors import NotPossible
from gearstab.floquet.kernel.c_points import chained
from gearstab.propagation.bundles import Bundle, bundles
from gearstab.propagation.equation import Equation, Excitation, excitation
from gearstab.propagation.first_order import FirstOrder, ModalMatrices, bases
from gearstab.propagation.intervals import SteadyPoints, followed, intervals
from gearstab.propagation.magnus import ORDER, StepControl, remainder
from gearstab.response.panels import fastest
from gearstab.system import Array, GearSystem

STATUS_FLAGS = {
    "unstable": 1, "undamped": 2, "ill_conditioned": 4, "separation": 8, "unresolved": 16, "unbalanced": 32,
    "failed": 64,
}  # fmt: skip
"""Bits of ``status``: the steady state repels; nothing makes motions decay towards it; rounding errors are amplified by
more than 1e6 (near an edge, or of a strongly growing system); a loaded mesh's force changes sign, where teeth would
separate; the samples are too few for its fastest vibration; the load accelerates the train as a whole, and a steady
state leaves that part of it out; no finite result."""

ILL_CONDITIONED, SINGULAR = 1e6, 1e14
"""Amplification of rounding errors that is worth a word, and that leaves nothing of sixteen digits."""
UNSTABLE = 1e-9
"""Excess of the largest |lambda| over 1 that is no rounding error."""
MOST_ENTRIES = 2**21
"""Entries of the largest array of a chunk of points: 16 MB."""
TOLERANCE = 1e-9
"""Error of the map over a period where functions vary smoothly, relative to its largest entry, by default."""
BALANCED = 1e-6
"""A load is balanced if its part along a rigid-body mode is below this part of its size."""


@dataclass(frozen=True)
class SteadyStart:
    """Steady states of K points at t = 0.

    x: ``(K, m)``; status: ``(K,)`` int, bits of STATUS_FLAGS.
    """

    points: SteadyPoints
    x: Array
    status: Array


def starts(
    system: GearSystem, omega: Array, tolerance: float = TOLERANCE, samples: int = 1
) -> Iterator[tuple[Array, Array, SteadyStart]]:
    """Steady states at mesh frequencies ``(rows, P)``, in chunks: (rows (K,), columns (K,), start).

    samples: how many of a cycle of the first mesh are looked at, for the size of chunks.
    tolerance: of the monodromy matrix where functions vary smoothly, relative to its largest entry.

    Raises NotPossible for systems without a common period, or with a free rotation that a speed changes.
    """
    check_held(system)
    whole = excitation(system)
    for basis in bases(system):
        drive = whole.subset(basis.rows)
        equation = Equation(basis, drive)
        row, column = np.divmod(np.arange(len(basis.rows) * omega.shape[1]), omega.shape[1])
        frequency = omega[basis.rows[row], column]
        steps = 1 if drive.exact else resolution(equation, row, frequency, tolerance)
        longest = float(np.diff(drive.schedule.edges, axis=1).max())
        # Numbers kept for each point: states at the samples, and about ten more for every mesh.
        nodes = samples * drive.counts[0] * longest * (basis.size + 10 * len(drive.counts))
        widest = max((basis.size + drive.width) ** 2, int(nodes))
        step = max(1, MOST_ENTRIES // widest)
        for i in range(0, len(row), step):
            part = slice(i, i + step)
            points = SteadyPoints.of(equation, row[part], frequency[part], steps)
            yield basis.rows[row[part]], column[part], start(points)


def check_held(system: GearSystem) -> None:
    """Raise NotPossible where vibration changes the speed of a free rotation, so that a load lets it run away."""
    if any(np.any(term.matrix) for term in ModalMatrices.of(system).drift):
        raise NotPossible(
            "nothing holds the speed of a gear that turns freely, which its vibration changes where the carrier turns",
            "hold the sun or the carrier: supports.sun_rotation or supports.carrier_rotation",
        )


def start(points: SteadyPoints) -> SteadyStart:
    """The steady states of the points at t = 0."""
    with np.errstate(over="ignore", invalid="ignore"):
        matrix, shift = period_map(points)
    size = points.basis.size
    finite = np.isfinite(matrix).all(axis=(1, 2)) & np.isfinite(shift).all(axis=1)
    matrix = np.where(finite[:, None, None], matrix, 0.0)
    difference = np.eye(size) - matrix
    amplified = amplification(matrix, difference)
    solvable = finite & (amplified < SINGULAR)
    regular = np.where(solvable[:, None, None], difference, np.eye(size))
    x = np.linalg.solve(regular, np.where(solvable[:, None], shift, np.nan)[..., None])[..., 0]
    largest = np.abs(np.linalg.eigvals(matrix)).max(axis=-1, initial=0.0)
    status = np.zeros(len(x), dtype=int)
    status[largest > 1 + UNSTABLE] |= STATUS_FLAGS["unstable"]
    status[np.abs(largest - 1) <= UNSTABLE] |= STATUS_FLAGS["undamped"]
    status[amplified > ILL_CONDITIONED] |= STATUS_FLAGS["ill_conditioned"]
    status[unbalanced(points.excitation, points.basis)[points.at]] |= STATUS_FLAGS["unbalanced"]
    status[~solvable] |= STATUS_FLAGS["failed"]
    return SteadyStart(points, x, status)


def amplification(matrix: Array, difference: Array) -> Array:
    """``(K,)``: max(1, |M|) max(1, |M|, 1/s), s the least singular value of I - M.

    An error of M, eps |M|, is multiplied by 1/s in x(0), and one of x(0) by |M| on its way through a period.
    """
    if not matrix.shape[-1]:
        return np.ones(len(matrix))
    least = np.linalg.svd(difference, compute_uv=False)[:, -1]
    size = np.maximum(1.0, np.linalg.norm(matrix, axis=(1, 2)))
    with np.errstate(divide="ignore", over="ignore"):
        return np.asarray(size * np.maximum(size, 1 / least))


def period_map(points: SteadyPoints) -> tuple[Array, Array]:
    """M ``(K, m, m)`` and b ``(K, m)``."""
    m, count = points.basis.size, len(points.at)
    known = monodromy(points)
    matrix, shift = np.tile(np.eye(m), (count, 1, 1)), np.zeros((count, m))
    for part in bundles(points):
        if isinstance(part, Bundle):
            shift = part.through(shift)[1]
        else:
            p, push = part.across()
            matrix, shift = p @ matrix, np.einsum("kij,kj->ki", p, shift) + push
    return matrix if known is None else known, shift


def monodromy(points: SteadyPoints) -> Array | None:
    """M ``(K, m, m)`` by the compiled kernel; None where a state has no eigenvectors."""
    equation, q = points.equation, points.equation.occupied
    eigen = equation.states.eigen if equation.drive.exact and equation.form.size else None
    if eigen is None:
        return None
    fractions = np.diff(equation.edges, axis=1)[:, q]
    values, vectors, inverse = (np.swapaxes(part, 0, 1) for part in (eigen.values, eigen.vectors, eigen.inverse))
    cycles = equation.drive.cycles
    cycle = points.period / (2 * np.pi * cycles)
    return chained(cycles, fractions, equation.states.of[q], values, vectors, inverse, points.at, cycle)


def unbalanced(drive: Excitation, basis: FirstOrder) -> Array:
    """``(r,)``: whether the load accelerates a rigid-body mode that nothing holds back."""
    load = drive.fixed[:, :, 0]
    along = np.abs(np.einsum("rnk,rn->rk", basis.undamped_rigid, load))
    size = np.einsum("rnk,rn->rk", np.abs(basis.undamped_rigid), np.abs(load))
    return np.any(along > BALANCED * size, axis=1)


def balanced(system: GearSystem, basis: FirstOrder) -> GearSystem:
    """The system without the part of its load that would accelerate rigid-body modes that nothing holds back.

    M r (r^T f0) for every such mode r of unit modal mass: what is left acts on elastic modes alone, as it did.
    """
    if system.load is None:
        return system
    rigid = basis.undamped_rigid[0]
    return replace(system, load=system.load - np.asarray(system.mass) @ rigid @ (rigid.T @ system.load))


def _samples(at: Array, omega: Array) -> Array:
    """Positions of TRIED points from the slowest to the fastest, and of the slowest point of as many rows."""
    spread = np.argsort(omega, kind="stable")[:: max(1, len(omega) // TRIED)][:TRIED]
    order = np.lexsort((omega, at))
    slowest = order[np.flatnonzero(np.diff(at[order], prepend=-1))]
    some = np.linspace(0, len(slowest) - 1, TRIED).astype(int)
    return np.unique(np.concatenate([spread, slowest[some]]))


FEWEST, MOST = 2, 4096
"""Magnus steps in an interval between edges."""
SLOW = 5000
"""Vibrations in a common period that are still followed in steps."""
REACH = 3.0
"""Radians that the fastest mode may turn by in a step from which a search for the number of steps begins."""
TRIED = 6
"""Points on which the number of steps is tried."""


def resolution(equation: Equation, at: Array, omega: Array, tolerance: float) -> int:
    """The number of steps that reaches the tolerance at some of the points, the slowest of many rows among them.

    Raises NotPossible where MOST are not enough.
    """
    chosen = _samples(at, omega)
    points = SteadyPoints.of(equation, at[chosen], omega[chosen])
    longest, turns = float(np.diff(points.edges, axis=1).max()), fastest(points)
    if turns > SLOW:
        raise NotPossible(
            f"the mesh frequency is too low for waves that vary smoothly: the fastest mode vibrates {turns:.3g} times "
            f"in a common period, more than {SLOW}"
        )
    rough = NotPossible(
        f"mesh stiffness too rough for the tolerance {tolerance:g}: {MOST} steps per interval are not enough"
    )
    fewest = max(FEWEST, int(np.ceil(2 * np.pi * turns * longest / REACH)))
    if fewest > MOST:
        raise rough

    @cache
    def found(doublings: int) -> Array:
        # Too few steps may overflow; more follow.
        with np.errstate(over="ignore", invalid="ignore"):
            matrix, shift = period_map(replace(points, steps=fewest * 2**doublings))
        return np.concatenate([matrix, shift[:, :, None]], axis=2)

    control = StepControl(np.array([1]), int(np.log2(2 * MOST / fewest)), tolerance, ORDER)
    for doublings, _ in control:
        fine, coarse = found(doublings), found(doublings - 1)
        size = np.abs(fine).max(axis=1, keepdims=True)
        with np.errstate(invalid="ignore"):
            error = np.max(np.abs(fine - coarse) / np.where(size > 0, size, 1.0)) * remainder(ORDER)
        control.judge(error if np.isfinite(error) else np.inf)
    if not np.isfinite(fine).all():
        return MOST  # beyond double precision, which the status will say
    if not error <= tolerance:
        raise rough
    return int(fewest * 2**doublings)


FEW = 4
"""Periods that are followed one by one, state by state, instead of by the map to each sample."""
MAPS = 2e4
"""Following one motion for as many periods as m^3 over this costs what the maps of one period cost: a period of 41
intervals at m = 72 takes 0.1 s, its maps some 2 s."""
ON_A_JUMP = 1e-9
"""A sample closer to a jump than this part of the sampling step is taken as lying on it, with the stiffness just after;
position and velocity do not jump, so that only the force and the energy depend on it."""


@dataclass(frozen=True)
class Driven:
    """A single system at one mesh frequency, ready to be followed.

    whole: the equation at any mesh frequency, of all modes, rigid-body ones included. omega: Omega.
    """

    whole: Equation
    omega: float

    @cached_property
    def points(self) -> SteadyPoints:
        """The operating point."""
        return SteadyPoints.of(self.whole, np.zeros(1, dtype=int), np.array([self.omega]))

    @property
    def drive(self) -> Excitation:
        """Coefficients and excitation."""
        return self.points.excitation

    @property
    def basis(self) -> FirstOrder:
        """The first-order form at this mesh frequency."""
        return self.points.basis

    @cached_property
    def resolved(self) -> SteadyPoints:
        """The operating point with as many Magnus steps as TOLERANCE asks for."""
        if self.drive.exact:
            return self.points
        steps = resolution(self.points.equation, self.points.at, self.points.omega, TOLERANCE)
        return replace(self.points, steps=steps)

    @property
    def period(self) -> float:
        """The common period."""
        return 2 * np.pi * self.drive.cycles / self.omega

    def state(self, displacement: Array, velocity: Array) -> Array:
        """x ``(m,)`` from q and dq/dt ``(n,)``."""
        n = self.basis.size // 2
        # The modal matrix is square: all modes are there.
        position = np.linalg.solve(self.basis.outlet[0, :, :n], displacement)
        return np.concatenate([position, np.linalg.solve(self.basis.speed[0, :, n:], velocity)])

    def physical(self, x: Array) -> tuple[Array, Array]:
        """q and dq/dt ``(..., n)``."""
        return x @ self.basis.outlet[0].T, x @ self.basis.speed[0].T

    def history(self, start: Array, samples: int, grid: int) -> Array:
        """x at all samples, ``(samples, m)``, ``grid`` of them in a common period; start: x at t = 0."""
        periods = max(1, -(-samples // grid))
        if not self.drive.exact and periods * MAPS <= len(start) ** 3:
            return self._followed(start, samples, grid, periods)
        columns = np.empty((len(start), periods))
        columns[:, 0] = start
        if periods > 1:
            matrix, shift = (part[0] for part in period_map(self.resolved))
            for k in range(1, periods):
                columns[:, k] = matrix @ columns[:, k - 1] + shift
        table = np.full((grid, len(start), periods), np.nan)
        for (_, inside, fractions), interval in zip(
            self._samples(min(samples, grid), grid), intervals(self.resolved), strict=False
        ):
            if periods <= FEW:
                for k in range(periods):
                    states = interval.through(columns[None, :, k], fractions)
                    table[inside, :, k] = [x[0] for x in states] if len(inside) else 0.0
            else:
                for sample, (p, push) in zip(inside, interval.at(fractions), strict=True):
                    table[sample] = p[0] @ columns + push[0][:, None]
            p, push = interval.across()
            columns = p[0] @ columns + push[0][:, None]
        return np.moveaxis(table, -1, 0).reshape(grid * periods, -1)[:samples]

    def _followed(self, start: Array, samples: int, grid: int, periods: int) -> Array:
        """The same, one interval after the other from the first to the last sample."""
        table, x = np.empty((samples, len(start))), start
        for k in range(periods):
            for q, inside, fractions in self._samples(min(grid, samples - k * grid), grid):
                states, x = followed(self.points, q, x, fractions)
                table[k * grid + inside] = states
        return table

    def _samples(self, samples: int, grid: int) -> Iterator[tuple[int, Array, Array]]:
        """Intervals of a common period: number, which of its first samples lie in it, and at which fractions of it."""
        edges = self.points.edges[0] * grid
        # The first sample at or after each edge.
        first = np.ceil(edges - ON_A_JUMP).astype(int)
        for q in self.points.equation.occupied:
            if first[q] >= samples:
                break
            inside = np.arange(first[q], min(first[q + 1], samples))
            yield q, inside, np.clip((inside - edges[q]) / (edges[q + 1] - edges[q]), 0.0, 1.0)

    def momentary(self, grid: int) -> tuple[Array, Array]:
        """``(grid, meshes)``, the mesh stiffnesses and the transmission errors at the samples of a common period."""
        return self.points.equation.momentary(np.arange(grid) / grid, ON_A_JUMP / grid)


def driven(system: GearSystem, mesh_frequency: float) -> Driven:
    """Prepare a single system. Raises ValueError without a common period."""
    (form,) = bases(system, whole=True)
    return Driven(Equation(form, excitation(system)), float(mesh_frequency))
