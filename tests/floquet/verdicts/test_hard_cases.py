"""Hard cases: results are right, others converge to them, and what is reported about them is honest."""

import numpy as np
import oracle
import pytest
import systems

from gearstab.floquet import STATUS_FLAGS, solve
from gearstab.modal import mean_modes

CASES = {case.name: case for case in systems.HARD_CASES}
SETTLED = [
    pytest.param(name, marks=pytest.mark.slow if case.tags & {"many", "long"} else ())
    for name, case in CASES.items()
    if "large" not in case.tags
]


def edge_of_tongue(system, low, high):
    """Bisect our own verdict to neighbouring doubles."""
    left = solve(system, np.array([low])).stable[0, 0]
    while np.nextafter(low, high) < high:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        low, high = (middle, high) if solve(system, np.array([middle])).stable[0, 0] == left else (low, middle)
    return low


@pytest.mark.parametrize("name", SETTLED)
def test_exponents_agree_with_forty_digits(name):
    """To 1e-12 of the largest exponent, and the flag is what high precision says."""
    item = CASES[name]
    found = solve(item.system, np.array(item.omega), exponents=True)
    plain = oracle.plain(item.system)
    for k, omega in enumerate(item.omega):
        reference = oracle.solve(plain, omega)
        # A semisimple multiple multiplier of a degenerate scene is computed to the rounding error of M, as any other.
        # A mode of frequency w cannot be known better than its rounding error, eps w.
        fastest = np.nanmax(mean_modes(item.system).natural_frequency)
        atol = max(1e-12, 4 * np.finfo(float).eps * fastest)
        oracle.assert_exponents_match(found.exponents[0, k], reference.all_exponents(), reference.period, atol=atol)
        assert (found.stable[0, k] == 1) == (
            oracle.verdict(plain, omega) if item.system.damping is None else reference.growth_rate <= 0
        )


@pytest.mark.parametrize("name", CASES)
def test_status_says_what_happened(name):
    item = CASES[name]
    found = solve(item.system, np.array(item.omega))
    assert np.all(np.isfinite(found.growth_rate))
    for status in found.status[0]:
        reported = {flag for flag, bit in STATUS_FLAGS.items() if status & bit}
        assert item.flags <= reported
        assert reported <= item.flags | {"eigenvalues", "krein"}


@pytest.mark.parametrize(("low", "high"), [(5.0, 5.4), (5.45, 5.8), (1.9, 2.0), (2.6, 2.71)])
def test_flags_next_to_a_boundary(low, high):
    """At relative distances down to 1e-12 from an edge of a tongue the flag is the one of high precision."""
    system = systems.train(0.1)
    if solve(system, np.array([low])).stable[0, 0] == solve(system, np.array([high])).stable[0, 0]:
        pytest.fail("no edge in this range")
    edge = edge_of_tongue(system, low, high)
    plain = oracle.plain(system)
    for distance in (1e-6, 1e-9, 1e-12):
        for side in (-1, 1):
            omega = edge * (1 + side * distance)
            assert (solve(system, np.array([omega])).stable[0, 0] == 1) == oracle.verdict(plain, omega)
