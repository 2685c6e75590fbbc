"""No tongue is missed: against a raster whose local minima are pursued by a method of its own.

For n = 3 the polynomial p of rho = lambda + 1/lambda has the discriminant D, and p(2), p(-2); where all roots are real
and inside (-2, 2) these are positive, and a tongue, however narrow, shows as a minimum that dips below zero. The
minima on a raster are refined by golden section and their flags compared. The discriminant's dip is as deep as the
square of the width, so that rounding hides tongues below some 1e-6: those are settled in forty digits elsewhere.
"""

import numpy as np
import numpy_kernel
import pytest
from tongues import inside, near_edge, train

from gearstab.floquet import solve
from gearstab.floquet.boundaries import boundaries
from gearstab.floquet.segments.pattern import Pattern, prepare
from gearstab.system import GearSystem

EPSILONS = np.array([0.005, 0.01, 0.03, 0.1, 0.2, 0.3, 0.4, 0.5])
START, STOP = 0.5, 7.0
RASTER = 65_000
GOLDEN = (np.sqrt(5) - 1) / 2


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


def check(system: GearSystem) -> int:
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
    assert check(train(epsilon=(np.array([0.1]), np.array([0.1])))) > 25


@pytest.mark.slow
@pytest.mark.parametrize(
    ("contact_ratio", "phasing", "tooth_ratio"),
    [((1.5, 1.5), 0.0, "1"), ((1.5, 1.5), 0.5, "1"), ((1.1, 1.9), 0.9, "1"), ((1.37, 1.62), 0.2, "1"),
     ((1.5, 1.5), 0.0, "2/3"), ((1.3, 1.8), 0.15, "1/2"), ((1.5, 1.5), 0.0, "3/5")],
)  # fmt: skip
def test_lin_parker(contact_ratio: tuple[float, float], phasing: float, tooth_ratio: str) -> None:
    system = train(contact_ratio, phasing, tooth_ratio, (EPSILONS, EPSILONS))
    assert check(system) > 150


@pytest.mark.slow
def test_strong_variation_of_long_periods() -> None:
    epsilon = np.array([0.6, 0.7, 0.8, 0.9])
    for tooth_ratio in ("3/5", "2/3"):
        assert check(train((1.5, 1.5), 0.0, tooth_ratio, (epsilon, epsilon))) > 40
