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
from random_trains import conservative_train, light_contradictions, light_train
from tongues import inside, near_edge, train

from gearstab.floquet import solve
from gearstab.floquet.boundaries import BOUNDARY_FLAGS, Boundaries, boundaries
from gearstab.floquet.boundaries.regions import sampled
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


# --- no tongue is missed: against a raster whose local minima are pursued by a method of its own
#
# For n = 3 the polynomial p of rho = lambda + 1/lambda has the discriminant D, and p(2), p(-2); where all roots are
# real and inside (-2, 2) these are positive, and a tongue, however narrow, shows as a minimum that dips below zero. The
# minima on a raster are refined by golden section and their flags compared. The discriminant's dip is as deep as the
# square of the width, so that rounding hides tongues below some 1e-6: those are settled in forty digits elsewhere.


EPSILONS = np.array([0.005, 0.01, 0.03, 0.1, 0.2, 0.3, 0.4, 0.5])
START, STOP = 0.5, 7.0
RASTER = 65_000


def functions(pattern: Pattern, row: int, cycle: np.ndarray) -> np.ndarray:
    """p(2), -p(-2) and D, ``(3, P)``."""
    matrix, _ = numpy_kernel.propagate(pattern, row, 1 / cycle)
    s1, s2, s3 = numpy_kernel.coefficients(matrix)
    at = [((x - s1) * x + s2) * x - s3 for x in (2.0, -2.0)]
    discriminant = s1**2 * s2**2 - 4 * s2**3 - 4 * s1**3 * s3 + 18 * s1 * s2 * s3 - 27 * s3**2
    return np.stack([at[0], -at[1], discriminant])


def minima(pattern: Pattern, row: int, cycle: np.ndarray) -> np.ndarray:
    """All local minima of the three functions on a raster, refined."""
    found = []
    for which, f in enumerate(functions(pattern, row, cycle)):
        k = np.flatnonzero((f[1:-1] <= f[:-2]) & (f[1:-1] <= f[2:])) + 1
        a, b = cycle[k - 1], cycle[k + 1]
        for _ in range(48):
            x, y = b - GOLDEN * (b - a), a + GOLDEN * (b - a)
            left = functions(pattern, row, x)[which] < functions(pattern, row, y)[which]
            a, b = np.where(left, a, x), np.where(left, y, b)
        found.append(0.5 * (a + b))
    return np.concatenate(found)


def compared_with_a_raster(system: GearSystem) -> int:
    found = boundaries(system, START, STOP)
    assert found.evaluations.max() <= RASTER / 40
    cycle = np.linspace(1 / STOP, 1 / START, RASTER)
    grid = 1 / cycle[1:-1]
    flags = solve(system, grid).stable
    for pattern in prepare(system):
        for k, row in enumerate(pattern.rows):
            extra = pattern.elastic.rate[k] / minima(pattern, k, pattern.elastic.rate[k] * cycle)
            stable = np.concatenate([flags[row], solve(system, extra).stable[row]]) == 1
            omega = np.concatenate([grid, extra])
            wrong = (inside(found, row, omega) == stable) & ~near_edge(found, row, omega, 1e-9)
            # An unstable point outside all regions lies in one below the floor: 1e-6 away all is stable.
            outside = omega[wrong & ~stable]
            for point in outside:
                around = solve(system, point * np.array([1 - 1e-6, 1 + 1e-6])).stable[row]
                assert around.tolist() == [1, 1]
            assert not (wrong & stable).any()
    middle = 0.5 * (found.lower + found.upper)
    for k, row in enumerate(found.row):
        assert solve(system, middle[k : k + 1]).stable[row] == 0 or len(found.members[k]) > 1
    return len(middle)


def test_lin_parker_at_one_epsilon() -> None:
    assert compared_with_a_raster(train(epsilon=(np.array([0.1]), np.array([0.1])))) > 25


@pytest.mark.slow
@pytest.mark.parametrize(
    ("contact_ratio", "phasing", "tooth_ratio"),
    [((1.5, 1.5), 0.0, "1"), ((1.5, 1.5), 0.5, "1"), ((1.1, 1.9), 0.9, "1"), ((1.37, 1.62), 0.2, "1"),
     ((1.5, 1.5), 0.0, "2/3"), ((1.3, 1.8), 0.15, "1/2"), ((1.5, 1.5), 0.0, "3/5")],
)  # fmt: skip
def test_lin_parker(contact_ratio: tuple[float, float], phasing: float, tooth_ratio: str) -> None:
    system = train(contact_ratio, phasing, tooth_ratio, (EPSILONS, EPSILONS))
    assert compared_with_a_raster(system) > 150


@pytest.mark.slow
def test_strong_variation_of_long_periods() -> None:
    epsilon = np.array([0.6, 0.7, 0.8, 0.9])
    for tooth_ratio in ("3/5", "2/3"):
        assert compared_with_a_raster(train((1.5, 1.5), 0.0, tooth_ratio, (epsilon, epsilon))) > 40


# --- no tongue and no stable gap is missed where damping is light and terms are periodic: against rasters
#
# Rasters come from products of exponentials and LAPACK; they look at extrema of the growth rate and about the regions
# of the same system without damping, which another search counts. The search itself pursues meetings of multipliers.


HARD = (16, 20, 27, 34, 38, 1010, 2114, 2234, 2296, 2604, 2674, 3004, 3015, 3450, 3777)
"""Gaps where multipliers meet inside of a region or change their kind; a tongue in part kept stable by damping; a
tongue of 2e-5 at 3e-4 beside a wide one, one of whose multipliers it shares; a gap some widths beside a meeting, where
both grow equally; a tongue about which two phases turn at a rate of their own; a gap where three multipliers meet; a
gap and a tongue beside a meeting, where a complex coupling has the least and the most growth;
tongues within the phases that they lock, where the modes are damped strongly; growth barely above zero between samples,
steep on one side only; a gap in a corner whose branches fall faster than their lines."""


def check_light(seeds: Iterable[int]) -> tuple[int, int]:
    """Numbers of raster points and of regions of some trains, none of which has contradictions."""
    points = regions = 0
    for seed in seeds:
        system, start, stop = light_train(seed)
        found = boundaries(system, start, stop)
        count, wrong = light_contradictions(system, found, start, stop)
        assert wrong == [], seed
        points, regions = points + count, regions + len(found.row)
    return points, regions


def test_no_region_of_lightly_damped_trains_is_missed() -> None:
    assert check_light(HARD)[1] > 50


def test_the_raster_notices_a_region_that_is_left_out() -> None:
    system, start, stop = light_train(34)
    found = boundaries(system, start, stop)
    kept = found.row[1:]
    less = replace(found, row=kept, lower=found.lower[1:], upper=found.upper[1:])
    assert len(light_contradictions(system, less, start, stop)[1]) > 0


def test_what_the_budget_does_not_cover_is_said() -> None:
    system, start, stop = light_train(34)
    whole, part = (boundaries(system, start, stop, budget=budget) for budget in (4e9, 1e4))
    assert not whole.coarse[0]
    assert part.coarse[0]
    # The range over the fewest samples of a scan.
    assert part.sampled_step[0] == pytest.approx(4.3e-3, rel=0.02)
    for found, name in ((whole, "sampled"), (part, "coarse")):
        flags = found.arranged().flags
        assert (flags & BOUNDARY_FLAGS[name] > 0).all()
        assert not (flags & (BOUNDARY_FLAGS["sampled"] | BOUNDARY_FLAGS["coarse"]) == 192).any()


def test_one_line_says_what_is_not_covered() -> None:
    system, start, stop = light_train(34)
    whole, part = (boundaries(system, start, stop, budget=budget) for budget in (4e9, 1e4))
    words = "100 % of the stable mesh frequencies are neither proved nor counted: sampled where two multipliers meet"
    assert str(whole.uncovered()).startswith(words)
    assert "equal steps" not in str(whole.uncovered())
    assert "to a step of 0.0043 of them; those in equal steps only" in str(part.uncovered())
    assert "2 of 3 systems" in sampled(0.1, 2, 3)
    # Without damping all is counted.
    assert boundaries(replace(system, damping=None, terms=()), start, stop).uncovered() is None


@pytest.mark.slow
@pytest.mark.parametrize("part", range(10))
def test_no_region_is_missed_in_three_hundred_lightly_damped_trains(part: int) -> None:
    points, regions = check_light(range(30 * part, 30 * part + 30))
    assert points > 50_000
    assert regions > 50
