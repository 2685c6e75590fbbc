"""Free response of linear systems: exact between the jumps of the mesh stiffness."""

from fractions import Fraction
from typing import Any

import mpmath as mp
import numpy as np
import oracle
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp, trapezoid
from scipy.linalg import eigh
from systems import pair, point_a, unequal

from gearstab.floquet import solve
from gearstab.response import Response, free_response
from gearstab.system import GearSystem
from gearstab.systems import build

START = np.array([0.1, 0.1, 0.1])
REST = np.zeros(3)


def train(*args: Any, **changes: Any) -> GearSystem:
    return build(unequal(*args, **changes))


def states(found: Response) -> np.ndarray:
    return np.concatenate([found.displacement, found.velocity], axis=1)


def exact_state(system: GearSystem, omega: float, start: np.ndarray, turns: Fraction) -> np.ndarray:
    """(q, q') at t = ``turns`` 2 pi/Omega in 40 digits, by matrix exponentials over exact segments."""
    p = oracle.plain(system)
    inverse = oracle.inverse_of(oracle.exact(p.mass))
    n = len(p.mass)
    damping = oracle.exact(p.damping) if p.damping else [[Fraction(0)] * n] * n
    drag = oracle.multiply(inverse, damping)
    pieces = oracle.segments(p)
    left, k = turns, 0
    with mp.workdps(60):
        x = mp.matrix([float(value) for value in start])
        cycle = 2 * mp.pi / mp.mpf(omega)
        while left > 0:
            duration, levels = pieces[k % len(pieces)]
            spring = oracle.multiply(inverse, oracle.stiffness_at(p, levels))
            upper = [[Fraction(int(j == n + i)) for j in range(2 * n)] for i in range(n)]
            lower = [[-value for value in spring[i] + drag[i]] for i in range(n)]
            x = oracle.exponential(upper + lower, oracle.number(min(duration, left)) * cycle) * x
            left, k = left - duration, k + 1
    return np.array([float(value) for value in x])


def broken_at_the_jumps(system: GearSystem, omega: float, start: np.ndarray, times: np.ndarray) -> np.ndarray:
    """(q, q') at the times by DOP853, restarted at every jump."""
    p = oracle.plain(system)
    inverse = np.linalg.inv(system.mass)
    drag = np.zeros(inverse.shape) if system.damping is None else inverse @ system.damping
    n, x, begin, k = len(inverse), start, 0.0, 0
    pieces, table = oracle.segments(p), np.empty((len(times), 2 * len(inverse)))
    passed = Fraction(0)
    while begin <= times[-1]:
        duration, levels = pieces[k % len(pieces)]
        passed, k = passed + duration, k + 1
        end = float(passed) * 2 * np.pi / omega
        spring = inverse @ np.array(oracle.stiffness_at(p, levels), dtype=float)
        inside = (times >= begin) & (times < end)

        def rate(_: float, y: np.ndarray, spring: np.ndarray = spring) -> np.ndarray:
            return np.concatenate([y[n:], -spring @ y[:n] - drag @ y[n:]])

        wanted = np.append(times[inside], end)
        solution = solve_ivp(rate, (begin, end), x, "DOP853", t_eval=wanted, rtol=1e-13, atol=1e-15)
        table[inside], x, begin = solution.y.T[:-1], solution.y[:, -1], end
    return table


CASES: dict[str, tuple[GearSystem, float]] = {
    "undamped": (train(), 2.03),
    "unequal frequencies": (train(Fraction(2, 3)), 1.31),
    "modal damping": (train(Fraction(1, 2), damping_ratio=0.05), 2.03),
    "full damping": (train(damping={"matrix": [[0.1, 0.02, 0], [0.02, 0.1, -0.03], [0, -0.03, 0.2]]}), 0.83),
    "negative stiffness": (train(epsilon=1.4), 2.9),
    "negative stiffness, damped": (train(epsilon=1.4, damping_ratio=0.1), 2.9),
    "stiff shaft": (train(input_shaft_stiffness=1e8), 2.03),
    "stiff shaft, damped": (train(input_shaft_stiffness=1e8, damping_ratio=0.01), 2.03),
    "free in space": (train(input_shaft_stiffness=0.0), 1.7),
    "free in space, damped": (train(input_shaft_stiffness=0.0, damping_ratio=0.1), 1.7),
}


@pytest.mark.parametrize("name", CASES)
def test_samples_against_forty_digits(name: str) -> None:
    system, omega = CASES[name]
    start = np.array([0.1, -0.05, 0.2, 0.03, 0.1, -0.07])
    period, (cycles, *_) = system.common_period()
    found = free_response(system, omega, start[:3], start[3:], 3.4 * float(period) * 2 * np.pi / omega, 8)
    fastest = np.sqrt(np.max(np.linalg.eigvals(np.linalg.inv(system.mass) @ system.mean_stiffness_matrix()).real))
    # Every sample is a whole multiple of 1/8 of the first mesh's period: exact as a fraction of a turn.
    for k in (0, 1, 5, 8 * cycles, len(found.time) - 1):
        expected = exact_state(system, omega, start, Fraction(k, 8))
        # Rounding of a few thousand operations and of the phase of the fastest mode (1e5 radians with the stiff shaft),
        # relative to the largest of the history so far.
        scale = np.max(np.abs(states(found)[: k + 1]))
        atol = max(1e-13, 1e-15 * fastest * found.time[k]) * scale
        np.testing.assert_allclose(states(found)[k], expected, rtol=0, atol=atol)
        assert found.time[k] == pytest.approx(k / 8 * 2 * np.pi / omega, rel=1e-15)


@pytest.mark.parametrize("name", ["unequal frequencies", "modal damping", "full damping"])
def test_every_sample_against_an_integrator_restarted_at_the_jumps(name: str) -> None:
    system, omega = CASES[name]
    found = free_response(system, omega, START, REST, 6 * 2 * np.pi / omega, 37)
    expected = broken_at_the_jumps(system, omega, np.concatenate([START, REST]), found.time)
    # DOP853's own tolerance of 1e-13 a step over some hundreds of steps.
    np.testing.assert_allclose(states(found), expected, rtol=0, atol=1e-10 * np.max(np.abs(expected)))


def test_constant_stiffness_is_modal_superposition() -> None:
    system = train(epsilon=0.0)
    velocity = np.array([0.0, 0.3, -0.1])
    found = free_response(system, 1.0, START, velocity, 50.0, 25)
    squared, modes = eigh(system.mean_stiffness_matrix(), system.mass)
    w, t = np.sqrt(squared), found.time[:, None]
    position, rate = modes.T @ system.mass @ START, modes.T @ system.mass @ velocity
    expected = (position * np.cos(w * t) + rate * np.sin(w * t) / w) @ modes.T
    # Phases up to 140 rad, in double precision.
    np.testing.assert_allclose(found.displacement, expected, rtol=0, atol=1e-13)
    np.testing.assert_allclose(found.energy, found.energy[0], rtol=1e-13)


def test_energy_is_constant_between_jumps_and_jumps_with_the_stiffness() -> None:
    system, omega, samples = build(pair()), 1.3, 40
    found = free_response(system, omega, np.array([0.1]), np.array([0.0]), 5 * 2 * np.pi / omega, samples)
    halves = found.energy[:-1].reshape(-1, samples // 2)
    # Sample 0 and sample 20 of a cycle lie on the jumps and belong to the segment that begins there.
    np.testing.assert_allclose(halves, halves[:, :1] * np.ones(samples // 2), rtol=1e-13)
    # At a jump the position does not move: the energy changes by (k_after - k_before) x^2/2, here -+ 0.6 x^2/2.
    jump = np.diff(halves[:, 0])
    x = found.displacement[:-1, 0].reshape(-1, samples // 2)[1:, 0]
    np.testing.assert_allclose(jump, np.where(np.arange(len(jump)) % 2 == 0, -0.3, 0.3) * x**2, rtol=1e-11, atol=1e-15)
    np.testing.assert_allclose(found.mesh_deflection[:, 0], found.displacement[:, 0])
    np.testing.assert_allclose(found.mesh_force[:20, 0], 1.3 * found.displacement[:20, 0])
    np.testing.assert_allclose(found.mesh_force[20:40, 0], 0.7 * found.displacement[20:40, 0])


def test_energy_of_a_damped_system_is_lost_as_the_damping_says() -> None:
    """Between jumps dE/dt = -q'^T C q'; the trapezoidal rule over fine samples recovers it."""
    system = train(damping_ratio=0.05)
    found = free_response(system, 0.5, START, REST, 2 * np.pi / 0.5 * 0.25, 20000)
    power = np.einsum("ti,ij,tj->t", found.velocity, system.damping, found.velocity)
    loss = trapezoid(power, found.time)
    # The second mesh (lead 0.2) jumps at 0.37, the first at 0.47 of a cycle, both after the end of this history.
    # Trapezoidal rule with steps of 6e-4: h^2 w^2/3 ~ 1e-6 of the loss.
    assert found.energy[0] - found.energy[-1] == pytest.approx(loss, rel=1e-5)


def test_point_a_of_lin_and_parker_grows_without_phasing_and_is_bounded_with_it() -> None:
    """Lin & Parker 2002, Fig. 9: Omega = 4.2, k_a = 0.3, x = 0.1, x' = 0; h = 0 grows, h = 0.4 does not."""
    omega = 4.2
    system = build(point_a(0.0))
    found = free_response(system, omega, START, REST, 200 * 2 * np.pi / omega, 20)
    growth = float(solve(system, np.array([omega])).growth_rate.item())
    assert growth > 0.2
    assert found.growth_rate == growth
    # Long after the start the largest multiplier alone is left: the norm at equal phases grows by exactly its factor.
    norms = np.linalg.norm(states(found)[::20], axis=1)
    rate = np.log(norms[150] / norms[100]) / (found.time[3000] - found.time[2000])
    assert rate == pytest.approx(growth, rel=1e-11)
    bounded = free_response(build(point_a(0.4)), omega, START, REST, 2000 * 2 * np.pi / omega, 20)
    assert bounded.growth_rate == 0
    peaks = np.max(np.abs(bounded.displacement.reshape(-1, 3)[:-1].reshape(20, -1, 3)), axis=(1, 2))
    # Quasi-periodic: the peak of every tenth of the history stays within a factor of the first.
    assert np.max(peaks) < 1.5 * peaks[0]
    assert bounded.status == "complete"


@pytest.mark.parametrize("changes", [{}, {"damping_ratio": 0.02}])
def test_a_history_can_be_continued(changes: dict[str, Any]) -> None:
    """From the state after one common period the same samples follow, for waves that begin anywhere."""
    system, omega = train(Fraction(2, 3), **changes), 1.7
    period = float(system.common_period()[0]) * 2 * np.pi / omega
    whole = free_response(system, omega, START, REST, 2 * period, 50)
    half = (len(whole.time) - 1) // 2
    rest = free_response(system, omega, whole.displacement[half], whole.velocity[half], period, 50)
    np.testing.assert_allclose(states(whole)[half:], states(rest), rtol=0, atol=1e-13)
    np.testing.assert_allclose(whole.mesh_force[half:], rest.mesh_force, rtol=0, atol=1e-13)


@given(
    samples=st.integers(1, 60),
    contact_ratio=st.floats(1.0, 3.0),
    lag=st.floats(-1.0, 1.0),
    omega=st.floats(0.3, 6.0),
    damped=st.booleans(),
)
def test_the_samples_do_not_depend_on_their_number(
    samples: int, contact_ratio: float, lag: float, omega: float, damped: bool
) -> None:
    """However coarse the samples and wherever the jumps, also where both coincide."""
    meshes = [{"name": "mesh", "mean_stiffness": 1.0, "epsilon": 0.2, "contact_ratio": contact_ratio, "lag": lag}]
    parameters = {"kind": "matrices", "mass": [[1.0]], "stiffness": [[0.2]], "meshes": meshes}
    meshes[0] |= {"direction": [1.0], "frequency_ratio": Fraction(1)}
    system = build(parameters | ({"damping_ratio": 0.05} if damped else {}))
    q, v, duration = np.array([1.0]), np.array([0.5]), 4 * 2 * np.pi / omega
    coarse = free_response(system, omega, q, v, duration, samples)
    fine = free_response(system, omega, q, v, duration, 3 * samples)
    np.testing.assert_allclose(states(coarse), states(fine)[::3], rtol=0, atol=1e-12 * np.max(np.abs(states(fine))))


def test_critical_damping_has_no_eigenvectors_to_rely_on() -> None:
    """Constant stiffness, zeta = 1: x = (x0 + (v0 + w x0) t) exp(-w t)."""
    found = free_response(
        build(pair({"epsilon": 0.0}, damping_ratio=1.0)), 1.0, np.array([1.0]), np.array([-0.2]), 20.0, 30
    )
    expected = (1.0 + 0.8 * found.time) * np.exp(-found.time)
    np.testing.assert_allclose(found.displacement[:, 0], expected, rtol=0, atol=1e-14)


def test_a_train_that_is_free_in_space_drifts_uniformly() -> None:
    system = train(input_shaft_stiffness=0.0)
    rigid = np.array([1.0, -1.0, 1.0])
    found = free_response(system, 1.7, REST, 0.3 * rigid, 1000.0, 5)
    np.testing.assert_allclose(found.displacement, 0.3 * found.time[:, None] * rigid, rtol=0, atol=1e-11)
    np.testing.assert_allclose(found.mesh_deflection, 0.0, atol=1e-11)
    # A general start: momentum along the rigid mode is kept.
    mixed = free_response(system, 1.7, START, np.array([0.0, 0.2, 0.0]), 100.0, 5)
    momentum = mixed.velocity @ system.mass @ rigid
    np.testing.assert_allclose(momentum, momentum[0], rtol=0, atol=1e-12 * np.max(np.abs(mixed.velocity)))


def test_a_softer_level_of_zero_is_free_flight() -> None:
    """epsilon = 1, c = 1.5: stiffness 2 for half a cycle, then none."""
    found = free_response(build(pair({"epsilon": 1.0})), 1.1, np.array([0.2]), np.array([0.0]), 2 * np.pi / 1.1, 10)
    speed = found.velocity[5:11, 0]
    np.testing.assert_allclose(speed, speed[0], rtol=1e-14)
    expected = found.displacement[5, 0] + speed[0] * (found.time[5:] - found.time[5])
    np.testing.assert_allclose(found.displacement[5:, 0], expected, rtol=1e-13)


@pytest.mark.parametrize(("omega", "grows"), [(1.5, False), (2.0, True), (2.7, False)])
def test_only_growth_is_said_to_be_unstable(omega: float, grows: bool) -> None:
    """Multipliers leave the circle where |trace| > 2; the stiffness is 1.3 and 0.7 for half a cycle each."""
    system = build(pair({"epsilon": 0.3}))
    rates = np.sqrt([1.3, 0.7])
    (c, other_c), (s, other_s) = np.cos(rates * np.pi / omega), np.sin(rates * np.pi / omega)
    trace = 2 * c * other_c - (rates[0] / rates[1] + rates[1] / rates[0]) * s * other_s
    assert bool(abs(trace) > 2) is grows
    found = free_response(system, omega, np.array([0.1]), np.array([0.0]), 10.0, 10)
    assert ("unstable" in found.findings) is grows


@pytest.mark.parametrize("changes", [{}, {"damping_ratio": 0.02}])
def test_growth_beyond_double_precision_ends_the_history(changes: dict[str, Any]) -> None:
    system = build(point_a(0.0, **changes))
    found = free_response(system, 4.2, START, REST, 4000.0, 10)
    assert found.status == "overflow"
    assert found.time[-1] < 4000.0
    assert np.isfinite(states(found)).all()
    assert np.isfinite(found.energy).all()
    # The energy, a square, overflows first.
    assert found.energy[-1] > 1e300
    # Within a single segment and a single period, too.
    violent = free_response(train(epsilon=3.0, **changes), 0.002, START, REST, 2 * np.pi / 0.002, 50)
    assert violent.status == "overflow"
    assert violent.largest_multiplier == np.inf
    assert 0 < len(violent.time) < 50


def test_what_is_not_a_single_finite_problem_is_refused() -> None:
    system = train()
    with pytest.raises(ValueError, match="3 finite numbers"):
        free_response(system, 1.0, np.ones(2), REST, 1.0)
    with pytest.raises(ValueError, match="velocity: 3 finite numbers"):
        free_response(system, 1.0, START, np.array([0.0, np.nan, 0.0]), 1.0)
    with pytest.raises(ValueError, match="duration"):
        free_response(system, 1.0, START, REST, 0.0)
    with pytest.raises(ValueError, match="mesh frequency"):
        free_response(system, -1.0, START, REST, 1.0)
    with pytest.raises(ValueError, match="batch"):
        free_response(train(input_shaft_stiffness=np.array([0.5, 0.6])), 1.0, START, REST, 1.0)
