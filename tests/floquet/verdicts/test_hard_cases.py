"""Hard cases: results are right, others converge to them, and what is reported about them is honest."""

import numpy as np
import oracle
import pytest
import systems
from scipy.integrate import solve_ivp

from gearstab.floquet import STATUS_FLAGS, solve
from gearstab.modal import mean_modes

CASES = {case.name: case for case in systems.HARD_CASES}
SETTLED = [
    pytest.param(name, marks=pytest.mark.slow if case.tags & {"many", "long"} else ())
    for name, case in CASES.items()
    if "large" not in case.tags
]


INTEGRATED = [name for name, case in CASES.items() if not case.tags & {"stiff", "negative", "slow", "many"}]


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


@pytest.mark.parametrize("name", INTEGRATED)
def test_integration_converges_to_the_result(name):
    """DOP853 broken at the jumps: its distance from our growth falls with its tolerance, down to its own rounding."""
    item = CASES[name]
    omega = item.omega[-1]
    growth = solve(item.system, np.array([omega]), exponents=True)
    period = 2 * np.pi * float(item.system.common_period()[0]) / omega
    distances = [
        integrated_distance(item.system, omega, growth.exponents[0, 0] * period, rtol) for rtol in (1e-5, 1e-8, 1e-11)
    ]
    assert distances[2] < 1e-2 * distances[0] or distances[2] < 1e-9
    assert distances[2] < 1e-7


def integrated_distance(system, omega, logs, rtol):
    """The largest distance of a multiplier of the integrated monodromy matrix from ours, over the largest of them."""
    n = system.size
    plain = oracle.plain(system)
    inverse = np.linalg.inv(system.mass)
    drag = np.zeros((n, n)) if system.damping is None else inverse @ system.damping
    state = np.eye(2 * n)
    for duration, levels in oracle.segments(plain):
        stiffness = inverse @ system.stiffness_matrix([float(level) for level in levels])
        a = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -drag]])
        span = float(duration) * 2 * np.pi / omega
        if span > 0:
            run = solve_ivp(
                lambda _, y, a=a: (a @ y.reshape(2 * n, -1)).ravel(),
                (0, span),
                state.ravel(),
                "DOP853",
                rtol=rtol,
                atol=rtol / 10,
            )
            state = run.y[:, -1].reshape(2 * n, 2 * n)
    theirs, ours = np.linalg.eigvals(state), np.exp(logs)
    # A rigid mode's defective multiplier 1 scatters by the square root of the error; the others tell.
    ours = ours[np.abs(logs) > 1e-12]
    return np.abs(ours[:, None] - theirs).min(axis=1).max() / np.abs(ours).max()


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
