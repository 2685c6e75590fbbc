"""Branches of motions with backlash: folds and doublings known to 1e-8, both sides of unstable motions, the linear
limit, and a smoothed gap by another program.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from backlash_pairs import CASES, MOTIONS, pair, sorted_multipliers
from scipy.integrate import solve_ivp

from gearstab.response.backlash.branches import BranchSearch, Starts
from gearstab.response.backlash.continuation import DOUBLING, FOLD, StepLimits
from gearstab.response.backlash.motions import GRAZING, Branch
from gearstab.response.backlash.sections import SectionMap
from gearstab.response.speeds import speed_response

Array = np.ndarray
ALWAYS, CONTACT = CASES


@cache
def searched(number: int) -> BranchSearch:
    low, high = CASES[number]["branch_from_to"]
    found = BranchSearch(SectionMap(pair(CASES[number])), StepLimits(low, high, most=1500), {DOUBLING})
    found.run(Starts((0.7, 1.2)))
    return found


def special(branch: Branch, *kinds: str) -> Array:
    return np.sort([motion.parameter for motion in branch.motions if motion.kind in kinds])


@pytest.mark.parametrize("number", [0, 1])
def test_known_folds_and_doublings(number: int) -> None:
    """The reference is given to 1e-8 and agrees to 1e-12; the multipliers to 1e-6 near folds."""
    branch, known = searched(number).found[0], CASES[number]["special_points"]
    for kind, name in ((FOLD, "fold"), (DOUBLING, "period doubling")):
        expected = np.sort([point["mesh_frequency"] for point in known if point["kind"] == name])
        np.testing.assert_allclose(special(branch, kind), expected, rtol=0, atol=1e-11)
    for point in known:
        motion = min(branch.motions, key=lambda m: (abs(m.parameter - point["mesh_frequency"]), m.kind == "none"))
        multipliers = np.sort(np.abs(motion.stability.multipliers))
        np.testing.assert_allclose(multipliers, np.sort(np.abs(point["multipliers"])), atol=1e-6)
    assert branch.ends == ("range_end", "range_end")


def test_the_doubled_branch_begins_where_it_grazes() -> None:
    """Both leave at edges of the region of teeth in contact, straight up to the first touch; no folds are told."""
    found = searched(0)
    doubled = [branch for branch in found.found if branch.parent == 0]
    assert [branch.periods for branch in doubled] == [2, 2]
    np.testing.assert_allclose([b.motions[0].parameter for b in doubled], [1.83145123089, 2.15558135351], atol=1e-10)
    assert [branch.motions[0].kind for branch in doubled] == [GRAZING, GRAZING]
    # Flanks that are left by 1e-10 of the deflection are apart for the root of that, 1e-5 of a period and some.
    assert all(
        branch.motions[0].cycle.contact_loss[0] < 1e-3 < branch.motions[2].cycle.contact_loss[0] for branch in doubled
    )
    np.testing.assert_allclose(special(doubled[1], FOLD), [1.368382818244891], atol=1e-11)
    # With both flanks struck the motion is the linear one again, which nothing bounds.
    assert {branch.ends for branch in doubled} == {("doubling", "unbounded")}


def test_random_states_lead_to_a_branch_apart() -> None:
    """The linear motion at 1.5 leads to none but its own branch; random states also to two motions of two cycles, on
    branches that hang together with it nowhere in the range. The fold of one is that of the reference.
    """
    laps = SectionMap(pair(ALWAYS))
    (main,) = BranchSearch(laps, StepLimits(1.3, 1.7, most=200)).run(Starts((1.5,), kinds=("linear",)))
    starts = Starts((1.5,), kinds=("linear", "random"), states=6, cycles=150, seed=1)
    found = BranchSearch(laps, StepLimits(1.3, 1.7, most=200)).run(starts)
    assert [(branch.periods, branch.parent) for branch in found] == [(1, -1), (2, -1), (2, -1)]
    assert special(main, FOLD).size == special(found[1], FOLD).size == 0
    np.testing.assert_allclose(special(found[2], FOLD), [1.368382818244891], atol=1e-11)


def test_known_motions_are_on_the_branches() -> None:
    found = searched(0)
    for _, motion in MOTIONS[:19]:
        omega, periods = motion["mesh_frequency"], motion["periods"]
        x, v = motion["state_at_start_of_stiff_phase"]
        point = found.curve(periods).at(found.laps.at(omega).state(np.array([x]), np.array([v])), omega)
        place = found.place(point, periods)
        assert place is not None, motion
        here = found.found[place[0]].motions[place[1]]
        assert abs(here.parameter - omega) < 0.1
        own = sorted_multipliers(motion)
        np.testing.assert_allclose(np.abs(point.visit.multipliers), np.abs(own), atol=1e-9)


def test_jumps_lead_to_where_motions_go() -> None:
    """In falling speed down at 0.6164, in rising speed up at 0.7915, from one stable motion to another."""
    found = searched(0)
    for (number, k), (sign, landing) in found.jumps.items():
        here = found.found[number].motions[k]
        if landing is None:
            continue
        there = found.found[landing[0]].motions[landing[1]]
        assert there.stability.stable
        assert abs(there.parameter - here.parameter) < 0.06
        if abs(here.parameter - 0.61636) < 1e-4:
            assert sign == -1
            assert there.cycle.rms[0] < 0.25 * here.cycle.rms[0]
        if abs(here.parameter - 0.79147) < 1e-4:
            assert sign == 1
            assert there.cycle.rms[0] > 1.5 * here.cycle.rms[0]
    assert {round(found.found[n].motions[k].parameter, 4) for n, k in found.jumps} >= {0.6164, 0.7915, 0.6828, 0.7586}


def test_unstable_motions_part_two_stable_ones() -> None:
    """From both sides of the unstable motion at 0.64, between the folds, the motion goes to a stable one each."""
    system, omega = pair(ALWAYS), 0.64
    laps = SectionMap(system)
    known = [m for _, m in MOTIONS[:19] if m["mesh_frequency"] == omega]
    (unstable,) = [m for m in known if not m["stable"]]
    x = np.array(unstable["state_at_start_of_stiff_phase"])
    values, vectors = np.linalg.eig(np.array(unstable["map_jacobian"]))
    away = vectors[:, np.argmax(np.abs(values))].real
    ends = []
    for sign in (1, -1):
        end = integrated(ALWAYS, omega, x + sign * 1e-4 * away, 60)
        lap = laps.lap(laps.at(omega).state(end[:1], end[1:]), omega)
        assert np.abs(lap.end - lap.start).max() < 1e-5
        ends.append(end)
    stable = np.array([m["state_at_start_of_stiff_phase"] for m in known if m["stable"]])
    nearest = [int(np.abs(stable - end).sum(axis=1).argmin()) for end in ends]
    assert sorted(nearest) == [0, 1]
    assert max(np.abs(stable[k] - end).max() for k, end in zip(nearest, ends, strict=True)) < 1e-4


def gap(x: float, width: float) -> float:
    return x - width if x > width else x + width if x < -width else 0.0


def integrated(case: dict[str, Any], omega: float, state: Array, periods: int) -> Array:
    """(x, x') after some periods of the mesh, by scipy from the definition."""
    own, period = case["parameters"], 2 * np.pi / omega
    stiff = own["contact_ratio"] - 1
    for k in range(2 * periods):
        value = 1 + 2 * own["epsilon"] * ((1 - stiff) if k % 2 == 0 else -stiff)

        def rate(t: float, y: Array, value: float = value) -> list[float]:
            force = own["load_F"] - 2 * own["zeta"] * y[1] - value * gap(y[0], own["half_backlash_b"])
            return [y[1], force]

        length = period * (stiff if k % 2 == 0 else 1 - stiff)
        state = solve_ivp(rate, (0, length), state, "DOP853", rtol=1e-9, atol=1e-10, max_step=0.3).y[:, -1]
    return np.asarray(state)


def test_without_loss_of_contact_the_branch_is_the_linear_steady_state() -> None:
    """To 1e-10, with the load tenfold so that the teeth never part above 1.3."""
    case = ALWAYS | {"parameters": ALWAYS["parameters"] | {"load_F": 5.0}}
    found = BranchSearch(SectionMap(pair(case)), StepLimits(1.3, 1.7, most=100))
    (branch,) = found.run(Starts((1.5,)))
    assert len(branch.motions) > 5
    omega = np.array([motion.parameter for motion in branch.motions])
    linear = speed_response(pair(case), omega, 200)
    assert all(motion.cycle.contact_loss[0] == 0 for motion in branch.motions)
    rms = [motion.cycle.rms[0] for motion in branch.motions]
    peak = [motion.cycle.force_peak[0] for motion in branch.motions]
    np.testing.assert_allclose(rms, linear.transmission_error_rms[0, :, 0], rtol=1e-10)
    np.testing.assert_allclose(peak, linear.mesh_force_peak[0, :, 0], rtol=1e-8)


class Smoothed:
    """The pair with a smooth gap: the force k (x - b) of the upper flank is k s ln(1 + exp((x - b)/s)), its own
    shooting, arclength and folds.
    """

    def __init__(self, case: dict[str, Any], smoothing: float) -> None:
        self.own, self.s = case["parameters"], smoothing

    def force(self, x: float) -> tuple[float, float]:
        total, slope, s, b = 0.0, 0.0, self.s, self.own["half_backlash_b"]
        for sign in (1, -1):
            u = (sign * x - b) / s
            total += sign * s * np.logaddexp(0.0, u)
            slope += 1 / (1 + np.exp(-u)) if u > -500 else 0.0
        return float(total), float(slope)

    def image(self, x: Array, omega: float) -> tuple[Array, Array]:
        """The state after a period and its derivatives with respect to the state and the period's scale of time."""
        own, period = self.own, 2 * np.pi / omega
        stiff = own["contact_ratio"] - 1
        y = np.concatenate([x, np.eye(2).ravel(), np.zeros(2)])
        for k, part in ((0, stiff), (1, 1 - stiff)):
            value = 1 + 2 * own["epsilon"] * ((1 - stiff) if k == 0 else -stiff)

            def rate(tau: float, y: Array, value: float = value) -> Array:
                elastic, slope = self.force(y[0])
                f = np.array([y[1], own["load_F"] - 2 * own["zeta"] * y[1] - value * elastic])
                a = np.array([[0, 1], [-value * slope, -2 * own["zeta"]]])
                # In t = tau/omega; the last two entries are the derivative with respect to omega.
                return np.concatenate(
                    [f, (a @ y[2:6].reshape(2, 2)).ravel(), a @ y[6:] - f / omega]
                ) * (period / (2 * np.pi))  # fmt: skip

            y = solve_ivp(rate, (0, 2 * np.pi * part), y, "LSODA", rtol=1e-10, atol=1e-11).y[:, -1]
        return y[:2], np.column_stack([y[2:6].reshape(2, 2) - np.eye(2), y[6:]])

    def folds(self, u: Array, count: int) -> list[float]:
        """Follow u = (x, x', omega), upwards at first, through some folds; omega there, by secants on the tangent."""
        u, step = self.newton(u, np.array([0.0, 0.0, 1.0])), 0.05
        tangent, found = self.tangent(u, np.array([0.0, 0.0, 1.0])), []
        while len(found) < count:
            ahead = self.newton(u + step * tangent, tangent)
            following = self.tangent(ahead, tangent)
            if following[2] * tangent[2] < 0:
                found.append(self.turn(u, tangent, step, following[2]))
            u, tangent = ahead, following
        return found

    def turn(self, base: Array, along: Array, high: float, right: float) -> float:
        low, left = 0.0, along[2]
        for _ in range(12):
            middle = low + (high - low) * left / (left - right)
            u = self.newton(base + middle * along, along)
            value = self.tangent(u, along)[2]
            if abs(value) < 1e-7:
                break
            low, high, left, right = (middle, high, value, right) if value * left > 0 else (low, middle, left, value)
        return float(u[2])

    def newton(self, u: Array, normal: Array) -> Array:
        for _ in range(12):
            end, matrix = self.image(u[:2], u[2])
            residual = end - u[:2]
            if np.abs(residual).max() < 1e-9:
                return u
            u = u - np.linalg.solve(np.vstack([matrix, normal]), np.append(residual, 0.0))
        raise AssertionError("no fixed point")

    def tangent(self, u: Array, along: Array) -> Array:
        found = np.linalg.svd(self.image(u[:2], u[2])[1])[2][-1]
        return found if found @ along > 0 else -found


@pytest.mark.slow
def test_folds_of_a_smoothed_gap_go_to_ours() -> None:
    """Three folds, of both jumps of the resonance and of both flanks: the error falls as the square of the smoothing,
    and its limit is ours to 1e-5, what the next order leaves. The second motion is 0.012 deep in the other flank, not
    more than the smoothing: a force of that size for its root in time falls as the power 3/2, and as the square only
    below, so that the limit is less exact.
    """
    known = [point["mesh_frequency"] for point in ALWAYS["special_points"] if point["kind"] == "fold"]
    ours = np.array([min(known, key=lambda w: abs(w - near)) for near in (0.79147, 0.61636, 0.75861)])
    start = np.array([1.6942168458436024, -0.17539252890860915, 0.7])
    smoothing = (0.02, 0.01, 0.005)
    folds = np.array([Smoothed(ALWAYS, s).folds(start, 3) for s in smoothing])
    differences = np.abs(folds - ours)
    assert (differences[2] < differences[1]).all()
    assert (differences[1] < differences[0]).all()
    order = np.log2(np.abs((folds[0] - folds[1]) / (folds[1] - folds[2])))
    np.testing.assert_allclose(order, [2, 1.5, 2], atol=0.05)
    limit = folds[2] + (folds[2] - folds[1]) / (2**order - 1)
    assert (np.abs(limit - ours) < [1e-5, 5e-5, 1e-5]).all()


def test_motions_that_graze_are_where_the_linear_force_vanishes() -> None:
    """The first loss of contact is where the least mesh force of teeth that stick to each other is 0: found without any
    contact. Within 1e-5 of a step, 1e-6 of the mesh frequency, near folds
    more of the force.
    """
    branch = searched(0).found[0]
    first = [m for m in branch.motions if m.kind == GRAZING and m.cycle.contact_loss[0] < 1e-2]
    # Two that lie within one step cancel each other's contacts.
    assert len(first) >= 3
    assert all(motion.grazing for motion in first)
    omega = np.array([motion.parameter for motion in first])
    least = speed_response(pair(ALWAYS), omega, 400).mesh_force_min[0, :, 0]
    np.testing.assert_allclose(least, 0, atol=5e-5)
    # Two more are in the other flank, which the motion is 2 away from.
    others = [m for m in branch.motions if m.kind == GRAZING and m.cycle.contact_loss[0] > 0.1]
    assert others
    assert all(motion.cycle.peak_to_peak[0] > 2 for motion in others)
