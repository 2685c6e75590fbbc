"""The periodic steady state of many operating points at once: one linear solve on the monodromy matrix each.

Over the common period T of everything that varies and drives, x(T) = M x(0) + b, so that the steady state begins with

    x(0) = (I - M)^-1 b.

It attracts every motion where the system is asymptotically stable. Elsewhere it exists all the same, but is not what
would be seen, and at a multiplier 1 (an edge of an instability region, an undamped resonance) there is none.

Source: Friedmann 1986, section 4 (response of linear periodic systems from the transition matrix of a period).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from gearstab.errors import NotPossible
from gearstab.floquet.kernel.c_points import chained
from gearstab.propagation.bundles import Bundle, bundles
from gearstab.propagation.equation import Equation, Excitation, excitation
from gearstab.propagation.first_order import FirstOrder, ModalMatrices, bases
from gearstab.propagation.intervals import SteadyPoints
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
    system: GearSystem, omega: Array, tolerance: float = 1e-9, samples: int = 1
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
