"""Hard cases: results are right, others converge to them, and what is reported about them is honest."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import oracle
import pytest
import systems
from driven import monodromy
from scipy.integrate import solve_ivp
from systems import KINDS, SMOOTH_OMEGA, Smooth, smooth_train, star, system, train

from gearstab.floquet import STATUS_FLAGS, frequencies, solve
from gearstab.floquet.frequencies import lyapunov
from gearstab.mesh import Mesh, PeriodicTerm
from gearstab.modal import mean_modes, modal_damping_matrix
from gearstab.system import GearSystem
from gearstab.waveforms import Rectangular

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


# --- no wrong flag: more than 100,000 points, generic and degenerate, whose doubtful ones are settled in high precision
#
# The judge is the product of matrix exponentials in physical coordinates and its eigenvalues. Where these leave the
# unit circle by more than 1e-4 or by less than 1e-11 there is no doubt; in between the oracle decides with 100 digits.


CLEARLY_OFF, CLEARLY_ON = 1e-4, 1e-11


def twins(epsilon, contact, coupling=0.0):
    """Two identical pairs, apart or joined by a spring: two equal modes, or a symmetric and an antisymmetric one."""
    g = np.eye(2)
    spring = coupling * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return GearSystem(
        np.eye(2), spring, tuple(Mesh(str(i), g[i], 1.0, epsilon, Rectangular(contact)) for i in range(2))
    )


def judge(system, omega):
    """The true flags, and how many of them the oracle had to settle."""
    excess = np.abs(np.linalg.eigvals(monodromy(system, omega))).max(axis=1) - 1
    truth = excess < CLEARLY_ON
    doubtful = np.flatnonzero((excess >= CLEARLY_ON) & (excess <= CLEARLY_OFF))
    for k in doubtful:
        truth[k] = oracle.verdict(oracle.plain(system), float(omega[k]))
    return truth, len(doubtful)


def collisions(system, harmonics=4):
    """The mesh frequencies at which two multipliers of the system without variation meet: (w_p + w_q)/s."""
    w = mean_modes(system).natural_frequency
    sums = (w[:, None] + w[None, :])[np.triu_indices(len(w))]
    return np.sort((sums[:, None] / np.arange(1, harmonics + 1)).ravel())


def generic(rng, rows, points):
    for _ in range(rows):
        ratio = [Fraction(1), Fraction(1, 2), Fraction(2, 3)][rng.integers(3)]
        system = train(
            rng.uniform(0.05, 0.45),
            tuple(rng.uniform(1, 2, 2)),
            rng.uniform(),
            ratio,
            inertias=rng.uniform(0.3, 4, 3),
            shaft=rng.uniform(0.1, 2),
        )
        yield system, rng.uniform(0.3, 7, points)


def near_edges(rng, rows):
    """Points at distances of 1e-3 to 1e-9 from the edges of real tongues: where a rounding error could flip a flag."""
    for _ in range(rows):
        system = train(rng.uniform(0.1, 0.4), tuple(rng.uniform(1.1, 1.9, 2)), rng.uniform())
        grid = np.linspace(0.8, 6, 300)
        stable = np.abs(np.linalg.eigvals(monodromy(system, grid))).max(axis=1) - 1 < 1e-6
        k = rng.choice(np.flatnonzero(stable[:-1] != stable[1:]))
        low, high = grid[k], grid[k + 1]
        for _ in range(34):
            middle = 0.5 * (low + high)
            same = (np.abs(np.linalg.eigvals(monodromy(system, np.array([middle])))).max() - 1 < 1e-6) == stable[k]
            low, high = (middle, high) if same else (low, middle)
        offsets = np.array([1e-3, 1e-5, 1e-7, 1e-9])
        yield system, low * (1 + np.concatenate([offsets, -offsets]))


def degenerate(rng, points):
    """Identical twins, stars, no variation on collisions: where sign tests alone fail on every second point."""
    for epsilon in (0.0, 0.1, 0.3, 0.49):
        for contact in (1.5, 1.3):
            yield twins(epsilon, contact), np.concatenate([rng.uniform(0.3, 4, points), 2 / np.arange(1.0, 6)])
            yield twins(epsilon, contact, 1e-9), rng.uniform(0.3, 4, points)
            yield star(epsilon, contact, (0, 0, 0)), rng.uniform(0.4, 5, points)
            yield star(epsilon, contact, (0, 1 / 3, 2 / 3)), rng.uniform(0.4, 5, points)
    for _ in range(20):
        system = train(0.0, (1.5, 1.5), inertias=rng.uniform(0.3, 4, 3), shaft=rng.uniform(0.1, 2))
        yield system, collisions(system)
        yield (
            replace(system, meshes=tuple(replace(m, epsilon=1e-9) for m in system.meshes)),
            rng.uniform(0.5, 6, points),
        )


def count_wrong(cases):
    points = wrong = settled = 0
    failures = []
    for item, omega in cases:
        truth, doubtful = judge(item, omega)
        ours = solve(item, omega).stable[0] == 1
        points, settled = points + len(omega), settled + doubtful
        wrong += int(np.sum(ours != truth))
        failures += [(item, w) for w in omega[ours != truth]]
    return points, settled, wrong, failures


def test_a_sample_of_flags():
    rng = np.random.default_rng(1)
    cases = [*generic(rng, 6, 200), *near_edges(rng, 4), *degenerate(rng, 20)]
    points, settled, wrong, failures = count_wrong(cases)
    assert points > 2000
    assert settled > 3
    assert wrong == 0, failures[:3]


@pytest.mark.slow
def test_a_hundred_thousand_flags():
    rng = np.random.default_rng(2)
    cases = [*generic(rng, 160, 500), *near_edges(rng, 60), *degenerate(rng, 450)]
    points, settled, wrong, failures = count_wrong(cases)
    assert points >= 100_000
    assert settled > 50
    assert wrong == 0, failures[:3]


# --- growth rate, verdict and exponents agree in sign, whatever computes them


RATIOS = (None, 0.0, 1e-14, 1e-12, 1e-10, 1e-3, -1e-12)
"""Damping ratios of all modes; at the smallest, growth a period is of the size of rounding errors."""


def lightly_damped(item, ratio):
    if ratio is None:
        return item
    return replace(item, damping=modal_damping_matrix(item.mass, item.mean_stiffness_matrix(), np.array([ratio])))


def assert_signs(found):
    known = found.stable >= 0
    assert known.any()
    np.testing.assert_array_equal((found.growth_rate > 0)[known], (found.stable == 0)[known])
    if found.exponents is not None:
        assert np.all(found.exponents.real[found.stable == 1] <= 0)


@pytest.mark.parametrize("ratio", RATIOS)
def test_exact(ratio):
    omega = np.linspace(0.3, 6.0, 150)
    for item in (train(0.0), train(), train(0.9), star(0.3)):
        assert_signs(solve(lightly_damped(item, ratio), omega, exponents=ratio == 1e-12))


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind(kind):
    for n in (1, 2, 3, 5):
        for damping in (0.0, 1e-13):
            item = system(n, kind, 7)
            item = replace(item, damping=damping * item.mass) if damping else item
            assert_signs(solve(item, np.linspace(0.3, 6.0, 60), exponents=True))


@pytest.mark.parametrize("ratio", RATIOS)
def test_smooth(ratio):
    from systems import TRAPEZOID, WAVE

    item = lightly_damped(smooth_train(TRAPEZOID, WAVE, 0.3), ratio)
    assert_signs(solve(item, SMOOTH_OMEGA, exponents=True))
    # Nothing varies.
    assert_signs(solve(lightly_damped(smooth_train(TRAPEZOID, WAVE, 0.0), ratio), SMOOTH_OMEGA, exponents=True))


@pytest.mark.parametrize("ratio", RATIOS)
def test_terms(ratio):
    end = np.array([1.0, 0.5, 0.0])
    term = PeriodicTerm("term", end, end, stiffness=Smooth(0.1, 0.05))
    assert_signs(solve(replace(lightly_damped(train(), ratio), terms=(term,)), SMOOTH_OMEGA[::3], exponents=True))


@pytest.mark.parametrize("ratio", RATIOS)
def test_several_frequencies(ratio):
    item, omega = lightly_damped(train(0.2, ratio="3/2"), ratio), np.linspace(0.8, 6.0, 12)
    assert_signs(lyapunov.solve(item, omega, cycles=20))
    assert_signs(frequencies.solve(item, omega, solve))


def test_rigid_motion_that_grows_by_rounding_only():
    # Damping of minus 1e-15 on a free rotation.
    item = train(shaft=0.0)
    for size in (-1e-15, -1e-3, 1e-15):
        assert_signs(solve(replace(item, damping=size * item.mass), np.linspace(0.3, 6.0, 20), exponents=True))
