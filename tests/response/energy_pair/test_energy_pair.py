"""The time response of a gear pair whose mesh stiffness depends on its rotation."""

from __future__ import annotations

from itertools import pairwise
from math import inf, tau
from typing import Any

import numpy as np
import pytest
from energy_pair_reference import K0, KAPPA, REFERENCE, W0, M, pair, theta_dot, tolerance
from scipy.integrate import solve_ivp

from gearstab.response.rotating_pair import STATUS, InitialState, PairResponse, respond
from gearstab.response.rotating_pair.integrate import (
    CHATTER,
    Crossing,
    Goal,
    Run,
    TimedArc,
    integrate,
)
from gearstab.response.rotating_pair.motion import Law, law_of
from gearstab.response.spectra import spectrum
from gearstab.rotating_pair import FORMULATIONS

CASES = REFERENCE["cases"]


def name_of(case: dict[str, Any]) -> str:
    return f"{case['model']}-{case['T0_Nm']}-{case['zeta']}"


def computed(case: dict[str, Any], step: float = 1e-5, **goal: float) -> PairResponse:
    system = pair(case["model"], torque=case["T0_Nm"], damping_ratio=case["zeta"])
    return respond(system, InitialState(theta_dot(case["rpm"])), step, **goal)


def law(load: float = 0.01, zeta: float = 0.05, **changes: Any) -> Law:
    whole = {"m": M, "zeta": zeta, "load": load, "kappa": KAPPA, "edges": (0.0, 1.73, tau)}
    return Law(**(whole | {"follows": M, "impulsive": True} | changes))


def run(one: Law, start: tuple[float, float, float, float], goal: Goal) -> tuple[list[TimedArc | Crossing], Run]:
    how = Run()
    return list(integrate(one, start, goal, how)), how


@pytest.mark.parametrize("case", CASES, ids=name_of)
def test_states_at_the_sections_are_those_of_50_digits(case: dict[str, Any]) -> None:
    last = max(map(int, case["states_after_cycles"]))
    found = computed(case, cycles=last).sections
    assert found.cycle[-1] == last
    for cycle, state in case["states_after_cycles"].items():
        (i,) = np.flatnonzero((found.cycle == int(cycle)) & (found.direction == 1))
        # A deflection and its rate have one scale, that of the motion.
        size = max(abs(state["phi"]), abs(state["phidot"]) / W0)
        assert found.time[i] == pytest.approx(state["t"], rel=1e-10)
        assert found.phi[i] == pytest.approx(state["phi"], abs=tolerance(size))
        assert found.phi_dot[i] == pytest.approx(state["phidot"], abs=tolerance(size * W0))
        assert found.theta_dot[i] == pytest.approx(state["thetadot"], rel=1e-10)
        assert found.energy[i] == pytest.approx(state["U"], rel=1e-10)
        assert found.theta[i] == tau * int(cycle)


@pytest.mark.parametrize("case", CASES, ids=name_of)
def test_first_events_are_those_of_50_digits(case: dict[str, Any]) -> None:
    found = computed(case, cycles=2).events
    for i, event in enumerate(case["first_events"]):
        assert found.pairs_before[i] == event["from_region"]
        assert found.time[i] == pytest.approx(event["t"], rel=1e-10)
        assert found.phi[i] == pytest.approx(event["phi"], rel=1e-10)
        rate = tolerance(event["phi"] * W0)
        assert found.phi_dot_before[i] == pytest.approx(event["phidot_before"], abs=rate)
        assert found.phi_dot_after[i] == pytest.approx(event["phidot_after"], abs=rate)
        assert found.theta_dot_before[i] == pytest.approx(event["thetadot_before"], rel=1e-10)
        assert found.theta_dot_after[i] == pytest.approx(event["thetadot_after"], rel=1e-10)


@pytest.mark.parametrize("case", CASES, ids=name_of)
def test_samples_are_those_of_50_digits(case: dict[str, Any]) -> None:
    for state in case["energy_at_times"]:
        # One sample at the time itself.
        found = computed(case, step=state["t"], duration=state["t"])
        assert found.energy[-1] == pytest.approx(state["U"], rel=1e-10)
        assert found.theta[-1] == pytest.approx(state["theta"], rel=1e-10)
        assert found.theta_dot[-1] == pytest.approx(state["thetadot"], rel=1e-10)
        size = max(abs(state["phi"]), abs(state["phidot"]) / W0)
        assert found.phi[-1] == pytest.approx(state["phi"], abs=tolerance(size))


@pytest.mark.parametrize("torque", [21.05, 42.1])
def test_without_damping_the_energy_is_constant(torque: float) -> None:
    """To 1e-12 over 100 cycles, reflections and backward crossings included."""
    found = respond(pair(torque=torque), InitialState(theta_dot(600)), 1e-5, duration=100 * tau / theta_dot(600))
    assert len(found.events.time) > 190
    assert np.ptp(found.energy) < 1e-12 * found.energy[0]
    assert np.abs(found.events.energy_change).max() < 1e-12 * found.energy[0]


def test_with_damping_the_energy_falls() -> None:
    found = respond(pair(damping_ratio=0.1), InitialState(theta_dot(300)), 2e-5, cycles=100)
    # Rounding of a sum of 25 J.
    assert np.diff(found.energy).max() < 1e-13 * found.energy[0]
    assert found.energy[-1] < 0.9 * found.energy[0]


def test_the_energy_falls_by_what_the_damper_takes() -> None:
    """dU/dt = -4 zeta w0 phi'^2/M2, integrated numerically over many samples."""
    system = pair(damping_ratio=0.05, torque=42.1)
    found = respond(system, InitialState(theta_dot(1500)), 2e-7, cycles=2)
    power = 4 * 0.05 * W0 * found.phi_dot**2 / system.numbers.m2
    lost = np.sum(0.5 * (power[1:] + power[:-1])) * 2e-7
    # The trapezoidal rule across eight kinks and jumps of phi'.
    assert found.energy[0] - found.energy[-1] == pytest.approx(lost, rel=1e-4)


@pytest.mark.parametrize("formulation", ["rigid_kinematic", "classical"])
@pytest.mark.parametrize("zeta", [0.0, 0.1])
def test_the_energy_jumps_by_dk_phi_squared_where_the_terms_in_dk_are_left_out(formulation: str, zeta: float) -> None:
    found = respond(pair(formulation, damping_ratio=zeta), InitialState(theta_dot(600)), 1e-5, cycles=15)
    change = np.where(found.events.pairs_after == 2, 1350.0, -1350.0)
    expected = change * found.events.phi**2
    # Energies of 100 J are subtracted.
    assert np.abs(found.events.energy_change - expected).max() < 1e-12 * found.energy[0]


def test_the_formulations_agree_without_load() -> None:
    """phi stays 0: nothing is stored, nothing jumps."""
    for formulation in FORMULATIONS:
        found = respond(pair(formulation, torque=0.0), InitialState(theta_dot(600)), 1e-4, cycles=3)
        np.testing.assert_array_equal(found.phi, 0.0)
        np.testing.assert_allclose(found.theta_dot, theta_dot(600), rtol=1e-15)


def smooth(t: float, y: np.ndarray, one: Law, width: float) -> list[float]:
    """Equations (2) and (3) with damping in both, the stiffness changing linearly over ``width``."""
    phi, rate, theta, speed = y
    local = theta % tau
    low, high = one.kappa
    slope = 0.0
    kappa = low if local < 1.73 else high
    if abs(local - 1.73) < width / 2:
        slope = (high - low) / width
        kappa = 0.5 * (low + high) + slope * (local - 1.73)
    force = one.load - kappa * phi - 2 * one.zeta * rate
    jump = 0.5 * slope * phi**2
    return [rate, force - one.m * jump, speed, one.m * force - jump]


def test_the_jump_is_the_limit_of_a_steep_change() -> None:
    """Against the smooth equations (2), (3): the difference falls as the width, and is nothing at width 0."""
    one = law(load=0.05, zeta=0.02)
    start = (0.08, 0.01, 1.2, 0.4)
    events, _ = run(one, start, Goal(time=4.0))
    piece = [item for item in events if isinstance(item, TimedArc)][-1]
    exact = np.array(piece.arc.at(4.0 - piece.begin))
    errors = []
    for width in (0.02, 0.01):
        found = solve_ivp(
            smooth, (0, 4), start, args=(one, width), method="DOP853", rtol=1e-11, atol=1e-13, max_step=2e-3
        )
        errors.append(found.y[:, -1] - exact)
    first, second = errors
    assert np.abs(second).max() < 2e-4
    # Extrapolated to width 0, beside errors of 1e-4; the next order is the square of the width.
    assert np.abs(2 * second - first).max() < 5e-6


def test_a_slow_gear_is_reflected() -> None:
    case = REFERENCE["reflection"]
    one = law(load=case["phis"], zeta=case["zeta"])
    events, how = run(one, tuple(map(float, case["start"])), Goal(time=2.0))
    (event,) = [item for item in events if isinstance(item, Crossing)]
    assert not event.passed
    assert event.time == pytest.approx(case["tau"], rel=1e-12)
    assert event.before[1] == pytest.approx(case["phidot_before"], abs=1e-15)
    assert event.after == pytest.approx((case["phi"], case["phidot_after"], 1.73, case["thetadot_after"]), rel=1e-12)
    assert how.status & STATUS["reflected"]
    last = [item for item in events if isinstance(item, TimedArc)][-1]
    assert last.region == 0
    # theta' changes sign, and the kinetic energy is kept.
    assert one.energy(0, event.after) == pytest.approx(one.energy(0, event.before), rel=1e-14)


def test_the_gears_stall_where_the_load_and_damping_trap_them() -> None:
    found = respond(pair(damping_ratio=0.1, torque=42.1), InitialState(theta_dot(60)), 1e-7)
    assert found.status & STATUS["stalled"]
    assert "stalled" in found.status_text
    assert found.end == found.stalled < inf
    # Just enough energy is left to get over the boundary at the deflection where that takes least.
    assert found.energy[-1] == pytest.approx(-(42.1**2) / 2780, rel=1e-2)
    assert np.all(found.energy >= -(42.1**2) / 2780)


def test_stalled_gears_never_leave_again() -> None:
    system = pair(damping_ratio=0.1, torque=42.1)
    stalled = respond(system, InitialState(theta_dot(60)), 1e-4)
    longer = respond(system, InitialState(theta_dot(60)), 1e-4, duration=20 * stalled.end)
    assert longer.status & STATUS["stalled"]
    assert longer.stalled == pytest.approx(stalled.stalled, rel=1e-12)
    assert not longer.events.passed[longer.events.time > stalled.stalled].any()
    # They come to rest under the static load, with one pair in contact, in ever smaller bounces.
    rest = -(42.1**2) / 1430
    spare = longer.energy - rest
    assert spare.min() > 0
    assert spare[-1] < 1e-3 * spare[stalled.time.size - 1]


def test_a_run_over_cycles_ends_where_the_gears_stall() -> None:
    found = respond(pair(damping_ratio=0.1, torque=42.1), InitialState(theta_dot(60)), 1e-4, cycles=1000)
    assert found.status & STATUS["stalled"]
    assert found.end == found.stalled


def test_without_enough_energy_the_gears_are_stalled_from_the_start() -> None:
    found = respond(pair(torque=42.1), InitialState(1.0), 1e-4, cycles=1)
    assert found.stalled == 0.0
    assert found.end == 0.0
    assert len(found.time) == 1


def test_chatter_is_cut() -> None:
    """A heavily loaded gear held against the boundary bounces in ever shorter hops."""
    one = law(load=0.5, zeta=0.0)
    events, how = run(one, (0.1, 0.0, 1.73 - 1e-9, 1e-6), Goal(time=1e4))
    assert how.status & STATUS["chatter"]
    assert sum(isinstance(item, Crossing) for item in events) > CHATTER


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_a_run_in_two_parts_is_the_run(formulation: str) -> None:
    system = pair(formulation, damping_ratio=0.05)
    whole = respond(system, InitialState(theta_dot(600)), 1e-5, cycles=7)
    half = respond(system, InitialState(theta_dot(600)), 1e-5, cycles=3.3)
    assert half.theta[0] == 0.0
    rest = respond(
        system,
        InitialState(whole.sections.theta_dot[2], whole.sections.phi[2], whole.sections.phi_dot[2]),
        1e-5,
        cycles=4,
    )
    np.testing.assert_allclose(rest.sections.phi, whole.sections.phi[3:], rtol=1e-11)
    np.testing.assert_allclose(rest.sections.time + whole.sections.time[2], whole.sections.time[3:], rtol=1e-12)
    assert half.sections.cycle.tolist() == [1, 2, 3]
    # The samples of the shorter run are those of the longer one.
    np.testing.assert_allclose(half.phi, whole.phi[: len(half.phi)], rtol=1e-12)
    assert 3.3 * tau - 1e-5 * 2 * theta_dot(600) < half.theta[-1] <= 3.3 * tau


def test_a_run_may_begin_anywhere_and_counts_cycles_from_there() -> None:
    system = pair(damping_ratio=0.05)
    for theta in (0.5, 1.73, 5.0, 2 * tau + 0.5, -3.0):
        found = respond(system, InitialState(theta_dot(600), theta=theta), 1e-5, cycles=2)
        assert found.theta[0] == pytest.approx(theta, abs=1e-14)
        assert found.events.theta[0] > theta
        assert found.end * W0 > 0
        local = theta % tau
        assert found.phi[0] == pytest.approx(21.05 / (1430 if local < 1.73 else 2780))
        np.testing.assert_allclose(np.diff(found.sections.theta), tau)
        assert found.sections.cycle[0] == np.floor(theta / tau) + 1


def test_gears_that_turn_back_across_a_boundary() -> None:
    """Rigid kinematic, undamped, unstable: against the Runge-Kutta method with k(theta), blind to the boundaries."""
    system = pair("rigid_kinematic", torque=42.1)
    found = respond(system, InitialState(theta_dot(600)), 1e-5, duration=0.0625)
    (back,) = np.flatnonzero(found.events.direction < 0)
    assert found.status == STATUS["reversed"]
    assert found.events.pairs_before[back] == 2
    assert found.events.theta[back] == pytest.approx(14 * tau + 1.73, rel=1e-14)
    assert found.events.theta[back + 1] == found.events.theta[back]
    first = int(np.searchsorted(found.time, found.sections.time[13]))
    state = np.array([found.phi[first], found.phi_dot[first] / W0, found.theta[first], found.theta_dot[first] / W0])
    load, step = 42.1 / K0, 1e-5 * W0 / 64

    def slope(y: np.ndarray) -> np.ndarray:
        force = load - KAPPA[0 if y[2] % tau < 1.73 else 1] * y[0]
        return np.array([y[1], force, y[3], M * force])

    for _ in range(64 * (len(found.time) - 1 - first)):
        k1 = slope(state)
        k2 = slope(state + step / 2 * k1)
        k3 = slope(state + step / 2 * k2)
        k4 = slope(state + step * k3)
        state = state + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    # A step that straddles a boundary is wrong in the first order, 0.002.
    assert state[0] == pytest.approx(found.phi[-1], rel=2e-3)
    assert state[2] == pytest.approx(found.theta[-1], rel=1e-5)


def test_sections_that_are_crossed_backwards_say_so() -> None:
    system = pair("rigid_kinematic", torque=42.1)
    found = respond(system, InitialState(theta_dot(600)), 1e-5, duration=0.09).sections
    (back,) = np.flatnonzero(found.direction < 0)[:1]
    # Into cycle c, out of it and into it again: three times theta = 2 pi c.
    assert found.cycle[back - 1 : back + 2].tolist() == [found.cycle[back]] * 3
    assert found.direction[back - 1 : back + 2].tolist() == [1, -1, 1]
    assert np.all(np.sign(found.theta_dot) == found.direction)


def test_a_sample_on_a_change_of_stiffness_is_just_after_it() -> None:
    """The classical pair turns uniformly: sample 200 c is on theta = 2 pi c."""
    system = pair("classical")
    found = respond(system, InitialState(theta_dot(600)), tau / theta_dot(600) / 200, cycles=3)
    assert found.stiffness[[0, 200, 400, 600]].tolist() == [1430.0, 1430.0, 1430.0, 1430.0]
    assert found.stiffness[[199, 399]].tolist() == [2780.0, 2780.0]


def test_pieces_follow_each_other() -> None:
    items, how = run(law(), (0.015, 0.0, 0.0, 0.1), Goal(cycles=20))
    pieces = [item for item in items if isinstance(item, TimedArc)]
    for first, second in pairwise(pieces):
        assert second.begin == first.begin + first.duration
        assert second.arc.start[0] == pytest.approx(first.arc.at(first.duration)[0], rel=1e-15)
    assert how.status == 0


def test_a_batch_has_no_response() -> None:
    with pytest.raises(ValueError, match="single system"):
        law_of(pair(torque=np.array([1.0, 2.0])))


def test_the_mesh_force_needs_a_length() -> None:
    with_module = respond(pair(module=6.35e-3), InitialState(theta_dot(600)), 1e-5, cycles=1)
    with_radii = respond(pair(radii=[0.0762, 0.3048]), InitialState(theta_dot(600)), 1e-5, cycles=1)
    without = respond(pair(), InitialState(theta_dot(600)), 1e-5, cycles=1)
    np.testing.assert_allclose(with_module.mesh_force, with_radii.mesh_force, rtol=1e-15)
    np.testing.assert_allclose(without.mesh_force, without.stiffness * without.phi)
    # F r1 = N1 k phi, the torque on the driving gear.
    np.testing.assert_allclose(with_module.mesh_force * 0.0762, 24 * without.stiffness * without.phi, rtol=1e-14)


def test_a_spectrum_holds_the_variance_and_finds_its_lines() -> None:
    step, count = 0.01, 2000
    t = np.arange(count) * step
    # Whole periods: 40 and 130 of them.
    history = 3.0 + 2.0 * np.sin(tau * 2.0 * t) + 0.5 * np.cos(tau * 6.5 * t)
    found = spectrum(history, step, "boxcar", 2)
    assert np.sum(found.density) * found.frequency[1] == pytest.approx(2.0 + 0.125, rel=1e-12)
    np.testing.assert_allclose(found.frequency[found.peaks], tau * np.array([2.0, 6.5]), rtol=1e-12)
    with pytest.raises(ValueError, match="8 samples"):
        spectrum(history[:7], step)


def test_the_loads_scale_out_of_the_classical_formulation() -> None:
    """It is linear in phi: twice the torque, twice the deflection."""
    first = respond(pair("classical", damping_ratio=0.05), InitialState(theta_dot(600)), 1e-5, cycles=3)
    second = respond(pair("classical", damping_ratio=0.05, torque=42.1), InitialState(theta_dot(600)), 1e-5, cycles=3)
    np.testing.assert_allclose(second.phi, 2 * first.phi, rtol=1e-12)
    assert pytest.approx(2105.0) == K0
