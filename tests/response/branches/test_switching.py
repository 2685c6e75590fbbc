"""Branches that leave others: of symmetric systems one of every symmetry type, at doublings and at branch points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from backlash_pairs import CASES, pair
from scipy.integrate import solve_ivp

from gearstab.response.backlash.branches import BranchSearch, Starts
from gearstab.response.backlash.continuation import BRANCHING, DOUBLING, FOLD, StepLimits
from gearstab.response.backlash.sections import SectionMap
from gearstab.response.backlash.switching import directions
from gearstab.system import GearSystem

Array = np.ndarray
OWN = CASES[0]["parameters"]


def two(coupling: float) -> GearSystem:
    """Two equal pairs with a spring between them."""
    one = pair(CASES[0])
    mesh = one.meshes[0]
    meshes = tuple(replace(mesh, name=name, direction=g) for name, g in zip("ab", np.eye(2), strict=True))
    spring = coupling * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return replace(
        one, mass=np.eye(2), stiffness=spring, damping=2 * OWN["zeta"] * np.eye(2), load=np.full(2, OWN["load_F"]),
        meshes=meshes, coordinates=("a", "b"),
    )  # fmt: skip


def searched(coupling: float, low: float, high: float, start: float) -> BranchSearch:
    found = BranchSearch(SectionMap(two(coupling)), StepLimits(low, high, most=400), {DOUBLING, BRANCHING})
    found.run(Starts((start,)))
    return found


def test_one_branch_of_every_type_leaves_a_double_doubling() -> None:
    """By one pair alone, or by both; by the other alone, or by both in opposite step, are the same by a symmetry."""
    found = searched(0.0, 1.7, 2.0, 1.75).found
    (doubling,) = [motion for motion in found[0].motions if motion.kind == DOUBLING]
    assert doubling.parameter == pytest.approx(1.831451230890225, abs=1e-11)
    assert doubling.multiplicity == 2
    doubled = [branch for branch in found if branch.parent == 0]
    lost = [tuple(branch.motions[3].cycle.contact_loss > 0) for branch in doubled]
    assert sorted(map(sum, lost)) == [1, 2]
    (both,) = [branch for branch, apart in zip(doubled, lost, strict=True) if all(apart)]
    assert np.ptp(both.motions[3].cycle.rms) < 1e-9


@pytest.mark.parametrize(("coupling", "kind"), [(0.0, FOLD), (0.02, BRANCHING)])
def test_motions_out_of_step_leave_at_a_branch_point(coupling: float, kind: str) -> None:
    """Without a spring at the fold itself, where two multipliers are 1; with one, which is lost to both, beside it. One
    branch of two that mirror each other, and its motions are those of an integration from the definition.
    """
    found = searched(coupling, 0.72, 0.85, 0.74)
    (leaving,) = [branch for branch in found.found if branch.parent == 0]
    at = found.found[0].motions[leaving.leaves]
    assert (at.kind, at.multiplicity) == (kind, 2 if kind == FOLD else 1)
    assert leaving.ends[0] == "branch_point"
    assert np.ptp(at.cycle.rms) < 1e-6
    assert leaving.motions[0].parameter == pytest.approx(at.parameter, abs=1e-5)
    motion = leaving.motions[12]
    assert np.ptp(motion.cycle.rms) > 0.03
    physical = np.concatenate(found.laps.at(motion.parameter).physical(), axis=1)
    state = motion.x @ physical
    np.testing.assert_allclose(integrated(coupling, motion.parameter, state), state, atol=1e-7)


def integrated(coupling: float, omega: float, state: Array) -> Array:
    """(q, q') of two pairs after a period of the mesh, by scipy."""
    period, stiff = 2 * np.pi / omega, OWN["contact_ratio"] - 1
    for part, level in ((stiff, 1 - stiff), (1 - stiff, -stiff)):
        k = 1 + 2 * OWN["epsilon"] * level

        def rate(t: float, y: Array, k: float = k) -> Array:
            q, v, b = y[:2], y[2:], OWN["half_backlash_b"]
            gap = np.where(q > b, q - b, np.where(q < -b, q + b, 0.0))
            return np.append(v, OWN["load_F"] - 2 * OWN["zeta"] * v - k * gap - coupling * (q - q[::-1]))

        state = solve_ivp(rate, (0, period * part), state, "DOP853", rtol=1e-10, atol=1e-11, max_step=0.05).y[:, -1]
    return np.asarray(state)


def test_directions_of_three_equal_parts() -> None:
    """Where three parts move without their mean, branches leave along (0, 1, -1) and along (2, -1, -1): both types."""
    space = np.linalg.qr(np.array([[1.0, 1.0], [-1.0, 1.0], [0.0, -2.0]]))[0]
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    found = [np.sort(np.abs(v)) for v in directions(space @ turn, space @ turn)]
    for pattern in ([0.0, 1.0, 1.0], [1.0, 1.0, 2.0]):
        expected = np.array(pattern) / np.linalg.norm(pattern)
        assert sum(np.abs(v - expected).max() < 1e-9 for v in found) == 3
