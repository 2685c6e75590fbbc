"""No tongue of random undamped trains is missed, and edges are right: against rasters and forty digits.

Before a tongue opens, two neighbouring phases of multipliers approach each other: on a raster their distance has a
local minimum, however narrow the tongue. These minima are pursued by golden section, with matrices of the NumPy kernel
and eigenvalues of LAPACK, on rasters of twice as many points until no new unstable interval appears. The search itself
counts passages of multipliers and uses nothing of this.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import numpy_kernel
import oracle
import pytest
from random_trains import conservative_train
from tongues import inside, near_edge

from gearstab.floquet import solve
from gearstab.floquet.boundaries import Boundaries, boundaries
from gearstab.floquet.segments.pattern import Pattern, prepare
from gearstab.system import GearSystem

GOLDEN = (np.sqrt(5) - 1) / 2
ROUNDS = 28
SHARP = 1e-13
"""Growth rates above this are no rounding in forty digits, where two multipliers that meet lose half of them."""


def distances(pattern: Pattern, cycle: np.ndarray) -> np.ndarray:
    """Distances of neighbouring phases in [0, pi], and of the outer ones from their images, ``(n + 1, P)``."""
    matrix = np.moveaxis(numpy_kernel.propagate(pattern, 0, 1 / cycle)[0], -1, 0)
    n = pattern.size
    a, b, c, d = matrix[:, :n, :n], matrix[:, :n, n:], matrix[:, n:, :n], matrix[:, n:, n:]
    turned = [np.swapaxes(part, 1, 2) for part in (a, b, c, d)]
    inverse = np.block([[turned[3], -turned[1]], [-turned[2], turned[0]]])
    # Each root of M + M^-1 is double: one of each two neighbours in the order of their real parts.
    roots = np.sort(np.linalg.eigvals(matrix + inverse).real, axis=1)[:, ::2]
    phase = np.sort(np.arccos(np.clip(0.5 * roots, -1, 1)), axis=1)
    ends = np.zeros((len(cycle), 1)), np.full((len(cycle), 1), np.pi)
    return np.diff(np.hstack([ends[0], phase, ends[1]]), axis=1).T


def pursued(system: GearSystem, start: float, stop: float, points: int) -> np.ndarray:
    """A raster in Omega, uniform in the period, and the local minima of all distances."""
    (pattern,) = prepare(system)
    cycle = np.linspace(1 / stop, 1 / start, points) * pattern.elastic.rate[0]
    every = distances(pattern, cycle)
    which, k = np.nonzero((every[:, 1:-1] <= every[:, :-2]) & (every[:, 1:-1] <= every[:, 2:]) & (every[:, 1:-1] > 0))
    a, b, each = cycle[k], cycle[k + 2], np.arange(len(k))
    for _ in range(ROUNDS if len(k) else 0):
        x, y = b - GOLDEN * (b - a), a + GOLDEN * (b - a)
        both = distances(pattern, np.concatenate([x, y])).reshape(len(every), 2, -1)
        left = both[which, 0, each] < both[which, 1, each]
        a, b = np.where(left, a, x), np.where(left, y, b)
    return np.unique(pattern.elastic.rate[0] / np.concatenate([cycle[1:-1], 0.5 * (a + b)]))


def contradictions(system: GearSystem, found: Boundaries, start: float, stop: float) -> list[float]:
    """Mesh frequencies at which refined rasters contradict the regions by more than the width floor."""
    points, runs = 1000, -1
    while True:
        omega = pursued(system, start, stop, points)
        unstable = solve(system, omega).stable[0] != 1
        wrong = omega[(inside(found, 0, omega) != unstable) & ~near_edge(found, 0, omega, 1e-9)]
        changes = int((np.diff(unstable.astype(int)) != 0).sum())
        if changes <= runs or len(wrong):
            return [float(x) for x in wrong if _wide(system, float(x), found.width_floor)]
        points, runs = 2 * points, changes


def _wide(system: GearSystem, omega: float, floor: float) -> bool:
    """Whether what is found at a point is also found a floor beside it."""
    around = solve(system, omega * np.array([1 - floor, 1.0, 1 + floor])).stable[0]
    return bool(around[0] == around[1] or around[2] == around[1])


def check(seeds: Iterable[int]) -> int:
    """Number of regions of some trains, none of which has contradictions."""
    regions = 0
    for seed in seeds:
        system, start, stop = conservative_train(seed)
        found = boundaries(system, start, stop)
        assert contradictions(system, found, start, stop) == [], seed
        regions += len(found.row)
    return regions


def edge_errors(seed: int) -> list[str]:
    """Verdicts wrong in forty digits 1e-10 inside and outside of a region of a train, the narrowest of every other."""
    system, start, stop = conservative_train(seed)
    found = boundaries(system, start, stop)
    whole = np.flatnonzero(~found.cut.any(axis=1))
    width, plain = found.upper / found.lower - 1, oracle.plain(system)
    k = int(whole[width[whole].argmin()] if seed % 2 else whole[seed % len(whole)])
    wrong = []
    for edge, outwards in ((found.lower[k], -1e-10), (found.upper[k], 1e-10)):
        grows = [oracle.solve(plain, edge * (1 + side * outwards)).growth_rate > SHARP for side in (-1, 1)]
        if grows != [True, False]:
            wrong.append(f"train {seed}: {edge!r} of a region of width {width[k]:.2g}: {grows}")
    return wrong


def test_random_trains_against_a_refined_raster() -> None:
    assert check((0, 3, 6)) > 100


def test_the_raster_notices_a_narrow_tongue_that_is_left_out() -> None:
    system, start, stop = conservative_train(2)
    found = boundaries(system, start, stop)
    narrow = (found.upper / found.lower).argmin()
    left = np.arange(len(found.row)) != narrow
    assert found.upper[narrow] / found.lower[narrow] - 1 < 2e-6
    less = replace(found, row=found.row[left], lower=found.lower[left], upper=found.upper[left])
    assert len(contradictions(system, less, start, stop)) > 0


def test_edges_of_a_random_train_in_forty_digits() -> None:
    assert edge_errors(0) == []


@pytest.mark.slow
@pytest.mark.parametrize("part", range(10))
def test_no_tongue_is_missed_in_five_hundred_random_trains(part: int) -> None:
    assert check(range(50 * part, 50 * part + 50)) > 200


@pytest.mark.slow
@pytest.mark.parametrize("part", range(10))
def test_edges_of_fifty_random_trains_in_forty_digits(part: int) -> None:
    assert [line for seed in range(5 * part, 5 * part + 5) for line in edge_errors(seed)] == []
