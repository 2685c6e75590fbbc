"""Motion of a gear pair with constant stiffness, jumps, and when the rotation leaves its region."""

from __future__ import annotations

from math import inf, tau
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from energy_pair_reference import KAPPA, W0, pair, theta_dot
from hypothesis import given
from hypothesis import strategies as st

from gearstab.response.rotating_pair import STATUS, InitialState, respond
from gearstab.response.rotating_pair.integrate import LOST, Crossing, Goal, Run, TimedArc, growth, integrate
from gearstab.response.rotating_pair.motion import Arc, Law, State, first_exit, free_basis, law_of
from gearstab.rotating_pair import FORMULATIONS


@given(
    phi=st.floats(-0.5, 0.5), rate=st.floats(-0.5, 0.5), speed=st.floats(0.01, 1.0),
    direction=st.sampled_from([-1, 1]), region=st.sampled_from([0, 1]), m=st.floats(-0.99, 0.99),
)  # fmt: skip
def test_a_jump_takes_exactly_the_strain_energy(
    phi: float, rate: float, speed: float, direction: int, region: int, m: float
) -> None:
    one = Law(m, 0.05, 0.01, KAPPA, (0.0, 1.73, tau), m, True)
    before = (phi, rate, 1.73, direction * speed)
    new_rate, new_speed, passed = one.cross(region, before, direction)
    after = (phi, new_rate, 1.73, new_speed)
    beyond = 1 - region if passed else region
    size = 1 / (1 - m**2)
    assert one.energy(beyond, after) == pytest.approx(one.energy(region, before), abs=4e-15 * size)
    # phi' - m theta' is kept where the gears pass, and theta' goes on in its direction.
    if passed:
        assert new_rate - m * new_speed == pytest.approx(rate - m * before[3], abs=1e-15)
        assert new_speed * direction >= 0
    else:
        assert new_speed == -before[3]
        assert speed**2 <= abs(KAPPA[1] - KAPPA[0]) * phi**2 * (1 + 1e-14)


@given(
    kappa=st.floats(0.3, 2.0), zeta=st.floats(0.0, 2.0), t=st.floats(0.0, 30.0), phi=st.floats(-1, 1),
    rate=st.floats(-1, 1), speed=st.floats(-1, 1), drive=st.floats(-0.1, 0.1),
)  # fmt: skip
def test_the_motion_is_the_exponential_of_its_matrix(
    kappa: float, zeta: float, t: float, phi: float, rate: float, speed: float, drive: float
) -> None:
    """Over- and underdamped, with and without drive: against scipy's matrix exponential of the first-order system."""
    from scipy.linalg import expm

    load, m = 0.02, 0.6
    matrix = np.array([
        [0, 1, 0, 0, 0],
        [-kappa, -2 * zeta, 0, 0, load + m * drive],
        [0, 0, 0, 1, 0],
        [-m * kappa, -2 * m * zeta, 0, 0, m * load + drive],
        [0, 0, 0, 0, 0],
    ])  # fmt: skip
    expected = (expm(matrix * t) @ [phi, rate, 0.3, speed, 1.0])[:4]
    arc = Arc((phi, rate, 0.3, speed), kappa, zeta, load, m, drive)
    # The exponential scales by the norm of the matrix times t, some 100.
    np.testing.assert_allclose(arc.at(t), expected, atol=1e-11 * max(1.0, t**2))
    np.testing.assert_allclose(np.ravel(arc.samples(np.array([t]))), arc.at(t), rtol=1e-12, atol=1e-13)
    assert arc.turned(t) == pytest.approx(expected[2] - 0.3, abs=1e-11 * max(1.0, t**2))
    assert arc.speed(t) == pytest.approx(expected[3], abs=1e-11 * max(1.0, t))
    acceleration = (matrix[3] @ [*expected, 1.0]).item()
    assert arc.acceleration(t) == pytest.approx(acceleration, abs=1e-11 * max(1.0, t))


def test_the_basis_of_critical_damping() -> None:
    s, c, u = free_basis(np.array([2.0]), np.array([1.44]), np.array([1.2]))
    decay = np.exp(-2.4)
    assert s == pytest.approx(2 * decay)
    assert c == pytest.approx(decay * (1 - 2.4))
    assert u == pytest.approx((1 - decay * (1 + 2.4)) / 1.44)


@given(
    zeta=st.sampled_from([0.0, 0.01, 0.3, 1.5]), rate=st.floats(-2, 2), speed=st.floats(-1, 1),
    phi=st.floats(-1, 1), begin=st.floats(0.02, 0.98), drive=st.sampled_from([0.0, 0.0, 0.003, -0.02]),
)  # fmt: skip
def test_no_exit_is_missed(zeta: float, rate: float, speed: float, phi: float, begin: float, drive: float) -> None:
    """Against a dense table: theta has not been outside before the exit, and is on the boundary there."""
    arc = Arc((phi, rate, 0.0, speed), 0.7, zeta, 0.02, 0.88, drive)
    lower, upper = -begin * 0.5, (1 - begin) * 0.5
    found = first_exit(arc, lower, upper, 200.0)
    end = 200.0 if found is None else found.time
    times = np.linspace(0, end, 4001)
    turned = np.array([arc.turned(float(t)) for t in times])
    assert np.all((turned >= lower - 1e-12) & (turned <= upper + 1e-12))
    if found is not None:
        boundary = upper if found.direction > 0 else lower
        assert arc.turned(found.time) == pytest.approx(boundary, abs=1e-12)
        assert arc.speed(found.time) * found.direction >= -1e-7


def test_a_short_excursion_beyond_the_boundary_is_seen() -> None:
    """theta touches the boundary for one part in a million of a period only."""
    arc = Arc((0.0, 0.3, 0.0, 0.3 * 0.88 + 0.01), 1.0, 0.0, 0.0, 0.88)
    times = np.linspace(1.0, 3.0, 200_001)
    top = max(arc.turned(float(t)) for t in times)
    found = first_exit(arc, -1.0, top - 1e-13, 10.0)
    assert found is not None
    assert found.time < 3.0
    assert first_exit(arc, -1.0, top + 1e-9, 3.0) is None


def test_a_gear_that_all_but_stands_still_leaves_after_a_long_time() -> None:
    """Without damping theta swings for a million periods while it drifts; the exit is found without counting them."""
    speed = 1e-7
    arc = Arc((0.02, 0.0, 0.0, speed), 1.0, 0.0, 0.01, 0.88)
    found = first_exit(arc, -1.0, 1.0)
    assert found is not None
    # 1 less the swing, 0.88 (cos t - 1)/100 <= 0, over the drift.
    assert 1 / speed <= found.time <= 1 / speed + 10 * tau
    assert arc.turned(found.time) == pytest.approx(1.0, abs=1e-9)


# --- how errors grow along the history of a gear pair, against disturbed starts and against 80 digits


mp.mp.dps = 80


def run(law: Law, start: State, time: float) -> tuple[list[TimedArc], list[Crossing]]:
    found = list(integrate(law, start, Goal(time), Run()))
    return [item for item in found if isinstance(item, TimedArc)], [
        item for item in found if isinstance(item, Crossing)
    ]


def chaotic(seed: int) -> tuple[Law, State]:
    """A slow gear under torque, which is reflected again and again."""
    rng = np.random.default_rng(seed)
    law = law_of(pair(damping_ratio=[0.0, 0.001][seed % 2], torque=float(rng.uniform(20, 60))))
    speed = theta_dot(float(rng.uniform(20, 120))) / W0
    return law, (float(law.load * rng.uniform(-1, 3) / law.kappa[0]), 0.0, 0.0, speed)


def at_time(law: Law, pieces: list[TimedArc], number: int, time: float) -> np.ndarray:
    """The state at a time, on the piece after an event or on the continuation of that; theta without its cycles."""
    piece = pieces[number + 1]
    return np.array(piece.arc.at(time - piece.begin)) + np.array([0, 0, tau * piece.cycle, 0])


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("zeta", [0.0, 0.03])
def test_the_amplification_is_that_of_disturbed_starts(formulation: str, zeta: float) -> None:
    law = law_of(pair(formulation, damping_ratio=zeta, torque=45.0))
    start = (0.8 * law.load, 0.001, 0.4, theta_dot(110.0) / W0)
    pieces, events = run(law, start, 400.0)
    count = min(len(events), 6)
    assert count >= 2
    found = growth(law, pieces, events).amplification
    step = 1e-7
    for k in range(count):
        columns = []
        for j in range(4):
            ends = []
            for sign in (1, -1):
                disturbed = list(start)
                disturbed[j] += sign * step
                others, _ = run(law, tuple(disturbed), 410.0)
                ends.append(at_time(law, others, k, events[k].time))
            columns.append((ends[0] - ends[1]) / (2 * step))
        assert found[k] == pytest.approx(np.linalg.norm(columns), rel=1e-4)
    if formulation == "energy_conserving":
        assert not all(event.passed for event in events[:count])


def followed(law: Law, start: State, pieces: list[TimedArc], events: list[Crossing]) -> list[float]:
    """|phi| after each event less that of 80 digits, as long as both meet the same boundaries."""
    state, errors = [mp.mpf(value) for value in start], []
    kappa = [mp.mpf(value) for value in law.kappa]
    zeta, load, m = mp.mpf(law.zeta), mp.mpf(law.load), mp.mpf(law.m)
    for piece, event in zip(pieces, events, strict=False):
        own = kappa[event.region]
        w = mp.sqrt(own - zeta**2)

        def at(time: mp.mpf, own: mp.mpf = own, w: mp.mpf = w, state: list[mp.mpf] = state) -> list[mp.mpf]:
            s = mp.exp(-zeta * time) * mp.sin(w * time) / w
            c = mp.exp(-zeta * time) * mp.cos(w * time) - zeta * s
            u = (1 - c - 2 * zeta * s) / own
            rest = load - own * state[0]
            step, rate = state[1] * s + rest * u, state[1] * c + rest * s
            theta = state[2] + m * (step - state[1] * time) + state[3] * time
            return [state[0] + step, rate, theta, state[3] + m * (rate - state[1])]

        time, edge = mp.mpf(piece.duration), mp.mpf(event.before[2])
        for _ in range(60):
            _, _, theta, speed = at(time)
            change = (edge - theta) / speed
            time += change
            if abs(change) < mp.mpf(10) ** -70:
                break
        phi, rate, _, speed = at(time)
        squared = speed**2 - (kappa[1 - event.region] - own) * phi**2
        if event.passed != (squared > 0):
            break
        after = event.direction * mp.sqrt(squared) if event.passed else -speed
        errors.append(abs(float(phi - event.after[0])))
        # An edge in double precision is the same edge: what lies between two of them is one cycle of 2 pi in doubles.
        begin = mp.mpf(tau - event.after[2]) if event.passed and event.after[2] in (0.0, tau) else edge
        state = [phi, rate + m * (after - speed), begin, after]
    return errors


@pytest.mark.parametrize("seed", range(6))
def test_rounding_errors_are_as_predicted(seed: int) -> None:
    law, start = chaotic(seed)
    pieces, events = run(law, start, 4000.0)
    pieces, events = pieces[:41], events[:40]
    found = growth(law, pieces, events)
    errors = followed(law, start, pieces, events)
    size = np.maximum.accumulate([max(abs(event.before[0]), law.load) for event in events])
    relative = np.array(errors) / size[: len(errors)]
    predicted = found.error[: len(errors)]
    # A standard deviation of worst cases: hardly ever below the truth, and not far above.
    certain = predicted < LOST
    assert np.all(relative[certain] < 5 * predicted[certain])
    assert np.median(predicted[certain] / np.maximum(relative[certain], 1e-18)) < 1e3
    # As long as the history is called certain it is the true one.
    first = found.first_lost
    assert np.all(relative[:first] < 3 * LOST)
    if found.error[-1] == 1.0:
        assert first is not None
        assert first >= 5


def test_a_regular_run_stays_certain() -> None:
    """2,000 cycles above all boundaries: errors grow as a power of the time."""
    law = law_of(pair("rigid_kinematic", torque=21.05))
    pieces, events = run(law, (law.load, 0.0, 0.0, theta_dot(1600.0) / W0), 2000 * tau / (theta_dot(1600.0) / W0))
    found = growth(law, pieces, events)
    assert found.first_lost is None
    assert found.error[-1] < 1e-8
    assert found.amplification[-1] < 1e6


def test_without_load_there_is_nothing_to_lose() -> None:
    law = law_of(pair(torque=0.0))
    pieces, events = run(law, (0.0, 0.0, 0.0, 0.1), 500.0)
    np.testing.assert_array_equal(growth(law, pieces, events).error, 0.0)
    assert growth(law, pieces[:1], []).first_lost is None


@pytest.mark.parametrize("torque", [2.1e4, 2.1e7, 2.1e10, 2.1e13])
def test_variances_stay_positive_where_directions_differ_by_many_digits(torque: float) -> None:
    """A torque that turns the gears back within a cycle: a variance lost to rounding would be called certain."""
    law = law_of(pair("rigid_kinematic", damping_ratio=0.05, torque=torque))
    pieces, events = run(law, (law.load / law.kappa[0], 0.0, 0.0, theta_dot(4500.0) / W0), 60.0)
    found = growth(law, pieces, events)
    assert len(found.error) > 1
    assert np.all(np.isfinite(found.error))
    assert np.all((found.error > 0) & (found.error <= 1))


def test_a_meeting_at_rest_leaves_nothing_certain() -> None:
    law = law_of(pair(torque=21.05))
    pieces, events = run(law, (law.load, 0.0, 0.0, theta_dot(600.0) / W0), 60.0)
    still = [event._replace(before=(*event.before[:3], 0.0)) for event in events[:1]]
    found = growth(law, pieces, [*still, *events[1:]])
    np.testing.assert_array_equal(found.error, 1.0)
    assert found.first_lost == 0


def test_the_response_says_from_when_on(tmp_path: Path) -> None:
    system = pair(torque=42.1)
    slow = respond(system, InitialState(theta_dot(80.0)), 1e-4, duration=1.0)
    assert slow.status & STATUS["unpredictable"]
    assert "unpredictable" in slow.status_text
    assert 0 < slow.predictable < slow.end
    number = int(np.argmax(slow.events.rounding_error > LOST))
    assert slow.predictable == slow.events.time[number]
    # Two runs that differ by the last digit agree until then, and not for long after it.
    other = respond(system, InitialState(theta_dot(80.0) * (1 + 3e-16)), 1e-4, duration=1.0)
    before = slow.time < slow.predictable
    size = np.abs(slow.phi).max()
    assert np.abs(slow.phi - other.phi)[before].max() < 0.1 * size
    assert np.abs(slow.phi - other.phi)[~before].max() > 0.3 * size
    fast = respond(system, InitialState(theta_dot(600.0)), 1e-5, cycles=20)
    assert fast.predictable == inf
    assert fast.status == 0
