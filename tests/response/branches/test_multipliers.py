"""Floquet multipliers of motions that lose contact: known ones, differences of the section map, integrated motions."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from backlash_pairs import CASES, MOTIONS, pair, sorted_multipliers
from driven import ERROR, FORCE, SMOOTH, integrated_with_backlash, train, with_waves
from scipy.integrate import solve_ivp

from gearstab.response.backlash.branches import BranchSearch, Starts
from gearstab.response.backlash.continuation import BRANCHING, DOUBLING, FOLD, StepLimits
from gearstab.response.backlash.dynamics import APART, play
from gearstab.response.backlash.motions import LOSSES, of_settled, speed_cycles, stability
from gearstab.response.backlash.sections import Lap, SectionMap
from gearstab.response.backlash.switching import directions
from gearstab.system import GearSystem
from gearstab.systems import build

Array = np.ndarray


def loose(system: GearSystem, *widths: float) -> GearSystem:
    meshes = [replace(mesh, backlash=width) for mesh, width in zip(system.meshes, widths, strict=True)]
    return replace(system, meshes=tuple(meshes))


def sorted_like(values: Array) -> Array:
    return values[np.lexsort((-values.imag, -np.round(np.abs(values), 9)))]


@pytest.mark.parametrize(("case", "motion"), MOTIONS)
def test_known_motions(case: dict[str, Any], motion: dict[str, Any]) -> None:
    """The reference is known to 3e-13; what is reported as the error is not below the true one."""
    laps, omega = SectionMap(pair(case)), motion["mesh_frequency"]
    x, v = motion["state_at_start_of_stiff_phase"]
    lap = laps.lap(laps.at(omega).state(np.array([x]), np.array([v])), omega, motion["periods"])
    found = stability(laps, lap, omega)
    difference = np.abs(sorted_like(found.multipliers) - sorted_multipliers(motion)).max()
    assert difference < 1e-12
    assert difference < found.error + 3e-13 < 1e-11
    assert found.residual < 1e-12
    assert found.stable == motion["stable"]
    if not motion["stable"]:
        assert found.loss == LOSSES["fold" if found.multipliers[0].real > 0 else "period_doubling"]


def random_system(rng: np.random.Generator) -> GearSystem:
    """A train or a pair of one or two meshes with play, damped always or in contact, driven in some ways."""
    second = {"name": "second", "mean_stiffness": rng.uniform(0.6, 1.5), "epsilon": 0.3, "contact_ratio": 1.57,
              "phasing": rng.uniform(), "damping": rng.choice([0.0, 0.1]),
              "damping_follows_stiffness": bool(rng.integers(2))}  # fmt: skip
    if not second["damping"]:
        del second["damping_follows_stiffness"], second["damping"]
    first = {"name": "first", "mean_stiffness": 1.0, "epsilon": rng.uniform(0.1, 0.4), "contact_ratio": 1.5,
             "damping": rng.choice([0.0, 0.2])}  # fmt: skip
    if rng.integers(2):
        first["transmission_error"] = ERROR
    system = train(meshes=[first, second], damping_ratio=rng.choice([0.0, 0.1]))
    if rng.integers(2):
        system = replace(system, forces=(FORCE,))
    if rng.integers(3) == 0:
        system = with_waves(system, *SMOOTH)
    return loose(system, rng.uniform(0.2, 1.0), rng.choice([0.0, 0.5]))


def quotient(laps: SectionMap, lap: Lap, omega: float) -> Array:
    """The derivative of the section map by central differences of two steps, extrapolated."""
    found = []
    for step in (2e-5, 1e-5):
        columns = [
            (laps.lap(lap.start + step * e, omega).end - laps.lap(lap.start - step * e, omega).end) / (2 * step)
            for e in np.eye(len(lap.start))
        ]
        found.append(np.stack(columns, axis=1))
    return np.asarray((4 * found[1] - found[0]) / 3)


def test_derivatives_are_differences_of_the_section_map() -> None:
    """1e-7 in 50 random motions that lose contact: differences of 1e-5 leave 1e-15/1e-5 by rounding."""
    rng, met = np.random.default_rng(37), 0
    while met < 50:
        laps, omega = SectionMap(random_system(rng)), rng.uniform(0.7, 3.0)
        start = 0.7 * rng.standard_normal(len(laps.at(omega).state(np.zeros(3), np.zeros(3))))
        lap = laps.lap(start, omega)
        speeds = np.abs(lap.track.speed[lap.track.mesh >= 0])
        # A grazing touch is a kink of the derivative, which differences smear.
        if lap.grazing or not (lap.track.contact == APART).any() or speeds.min(initial=1.0) < 0.02:
            continue
        met += 1
        expected = quotient(laps, lap, omega)
        np.testing.assert_allclose(lap.derivative, expected, atol=1e-7 * max(1.0, np.abs(expected).max()))
        own = np.sort(np.abs(np.linalg.eigvals(expected)))[::-1]
        np.testing.assert_allclose(np.abs(lap.multipliers)[0], own[0], rtol=1e-7)


@pytest.mark.parametrize("seed", [1, 4])
def test_derivatives_are_those_of_integrated_motions(seed: int) -> None:
    """By DOP853 in physical coordinates, from the definition: differences of 1e-4 leave 1e-8 and the integrator's."""
    system = random_system(np.random.default_rng(seed))
    teeth, laps, omega = play(system), SectionMap(system), 1.3
    q = np.random.default_rng(seed).standard_normal(2 * system.size)
    limits = np.stack([teeth.low, teeth.high], axis=1)
    period = laps.at(omega).model.motion.period

    def image(start: Array) -> Array:
        (end,), _ = integrated_with_backlash(system, limits, omega, start, np.array([period]))
        return laps.at(omega).state(end[: system.size], end[system.size :])

    lap = laps.lap(laps.at(omega).state(q[: system.size], q[system.size :]), omega)
    step, direction = 1e-4, np.random.default_rng(0).standard_normal(len(q))
    expected = (image(q + step * direction) - image(q - step * direction)) / (2 * step)
    along = laps.at(omega).state(direction[: system.size], direction[system.size :])
    np.testing.assert_allclose(image(q), lap.end, atol=1e-9)
    np.testing.assert_allclose(lap.derivative @ along, expected, atol=1e-6 * np.abs(expected).max())


def test_determinant_is_that_of_the_damping() -> None:
    """det DP = exp(-integral of tr M^-1 C), with the damping of a mesh counted while it is in contact."""
    case = CASES[1]
    laps, omega = SectionMap(pair(case)), 0.75
    lap = laps.lap(np.array([1.5, 1.0]), omega)
    closed = lap.track.length[lap.track.contact[:, 0] != APART].sum()
    assert 0 < closed < 2 * np.pi / omega
    assert np.prod(lap.multipliers).real == pytest.approx(np.exp(-0.1 * closed), rel=1e-12)


def test_small_multipliers_are_not_lost_beside_large_ones() -> None:
    """Multipliers from about 1 down to 1e-40: of the product itself all below 1e-16 would be rounding errors."""
    stiff = {"kind": "gear_pair", "units": "none", "equivalent_mass": 1.0, "damping_ratio": 20.0, "load": [0.5],
             "meshes": [{"name": "mesh", "mean_stiffness": 1.0, "epsilon": 0.0, "contact_ratio": 1.5,
                         "backlash": 2.0}]}  # fmt: skip
    laps = SectionMap(build(stiff))
    lap = laps.lap(laps.at(2.5).state(np.array([1.5]), np.array([0.0])), 2.5)
    rates = np.array([-20 + np.sqrt(399), -20 - np.sqrt(399)])
    np.testing.assert_allclose(np.log(lap.multipliers.real), rates * 2 * np.pi / 2.5, rtol=1e-12)


def test_settled_motions_over_speed_have_their_stability() -> None:
    """A run-down of the pair: at speeds of the reference the known multipliers, and none where nothing repeats."""
    system = pair(CASES[0])
    found = speed_cycles(system, np.array([0.64, 1.2, 1.7, 1.9]), down=True, cycles=150)
    known = {(m["mesh_frequency"], m["periods"]): sorted_multipliers(m) for _, m in MOTIONS[:19] if m["stable"]}
    for k, omega in enumerate((0.64, 1.2, 1.7, 1.9)):
        own = found["multiplier_real"][k] + 1j * found["multiplier_imag"][k]
        candidates = [v for (w, p), v in known.items() if (w, p) == (omega, found["period"][k])]
        assert min(np.abs(np.abs(own) - np.abs(v)).max() for v in candidates) < 1e-10
        assert found["motion_stable"][k] == 1
    laps = SectionMap(system)
    assert of_settled(laps, np.array([5.0, 5.0]), 1.2, 1) is None


# --- branches that leave others: of symmetric systems one of every symmetry type, at doublings and at branch points


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
