"""Periodic orbits of gear pairs and their stability."""

from __future__ import annotations

from dataclasses import replace
from math import tau
from typing import Any

import numpy as np
import pytest
from energy_pair_reference import KAPPA, REFERENCE, W0, M, complex_of, pair
from hypothesis import given
from hypothesis import strategies as st
from scenes import CONFIGS

from gearstab.config import load
from gearstab.floquet import STATUS_FLAGS, solve
from gearstab.response.rotating_pair import InitialState, orbit, respond
from gearstab.response.rotating_pair.motion import Arc, Law
from gearstab.response.rotating_pair.orbit import PeriodicProblem
from gearstab.response.rotating_pair.stability import (
    FLAGS,
    held,
    monodromy,
    multipliers,
    saltation,
    section_map,
    stability,
)
from gearstab.rotating_pair import RotatingPair
from gearstab.systems import build

MODELS = ("rigid_kinematic", "energy_conserving")


def problem(model: str, load: Any, zeta: Any, omega: Any) -> PeriodicProblem:
    load, zeta, omega = np.broadcast_arrays(*(np.atleast_1d(np.asarray(v, float)) for v in (load, zeta, omega)))
    one = np.ones(load.shape)
    kappa = (KAPPA[0] * one, KAPPA[1] * one)
    return PeriodicProblem(M * one, zeta, kappa, 1.73 * one, load, omega, model == "energy_conserving")


def solved(p: PeriodicProblem) -> np.ndarray:
    x, found = orbit.solve(p)
    assert found.all()
    return x


def reference(model: str) -> list[dict[str, Any]]:
    return [item for item in REFERENCE["multipliers"] if item["model"] == model]


@pytest.mark.parametrize("model", MODELS)
def test_orbits_are_those_of_the_reference(model: str) -> None:
    items = reference(model)
    x = solved(problem(model, *([item[key] for item in items] for key in ("load", "zeta", "omega"))))
    np.testing.assert_allclose(x[:, :3], [item["orbit"] for item in items], rtol=0, atol=1e-12)
    np.testing.assert_allclose(x[:, orbit.DRIVE], [item["eta"] for item in items], rtol=0, atol=1e-14)


@pytest.mark.parametrize("model", MODELS)
def test_multipliers_are_those_of_the_reference(model: str) -> None:
    items = reference(model)
    p = problem(model, *([item[key] for item in items] for key in ("load", "zeta", "omega")))
    x = solved(p)
    logs, own, coupled = multipliers(p, x, section_map(p, x))
    assert not coupled.any()
    for i, item in enumerate(items):
        found = np.sort_complex(np.append(np.exp(logs[i]), np.exp(own[i])))
        np.testing.assert_allclose(found, complex_of(item["multipliers"]), rtol=0, atol=1e-12)
        if not item["zeta"] or model == "rigid_kinematic":
            # Orbits of neighbouring speeds: an exact 1.
            assert own[i] == 0.0


@pytest.mark.parametrize("model", MODELS)
def test_edges_of_tongues_are_those_of_the_reference(model: str) -> None:
    """At an edge the parametric multipliers meet at -1: the trace of the section map is 1 - 2."""
    items = [item for item in REFERENCE["tongue_edges"] if item["model"] == model]
    load, omega = (np.array([item[key] for item in items]) for key in ("load", "omega"))

    def trace(shift: float) -> np.ndarray:
        p = problem(model, load, 0.0, omega + shift)
        return np.trace(section_map(p, solved(p)), axis1=1, axis2=2) - 1

    slope = (trace(1e-6) - trace(-1e-6)) / 2e-6
    # The edge of the same map by one Newton step; 1e-10 is what the reference's root finding leaves.
    np.testing.assert_allclose((trace(0.0) + 2) / slope, 0.0, atol=1e-9)


def test_edges_of_odd_tongues_differ_from_hills_by_the_square_of_the_load() -> None:
    """-0.0995 and +0.1067 phi_s^2 at 2.0 and 2.28 w0 for the energy-conserving formulation."""
    for classical, curvature in ((1.9978764672326184, -0.0995), (2.2802808408020554, 0.1067)):
        items = [i for i in REFERENCE["tongue_edges"] if i["model"] == MODELS[1] and i["classical"] == classical]
        for item in items:
            if item["load"] <= 0.02:
                found = (item["omega"] - classical) / item["load"] ** 2
                # Four digits of the coefficient, and the next order in the load.
                assert found == pytest.approx(curvature, rel=2e-2 if item["load"] < 0.005 else 5e-3)


def start_of(x: np.ndarray) -> np.ndarray:
    return np.array([x[0], x[1], 0.0, x[2]])


def returned(p: PeriodicProblem, x: np.ndarray, start: np.ndarray) -> np.ndarray:
    """(phi, phi', theta') at the next crossing of the section, by the integrator that makes time responses."""
    from gearstab.response.rotating_pair.integrate import Crossing, Goal, Run, integrate

    law = Law(
        float(p.m[0]), float(p.zeta[0]), float(p.load[0]), (KAPPA[0], KAPPA[1]), (0.0, 1.73, tau), float(p.m[0]),
        p.impulsive, float(x[orbit.DRIVE]),
    )  # fmt: skip
    items = list(integrate(law, (start[0], start[1], 0.0, start[2]), Goal(cycles=1), Run()))
    last = [item for item in items if isinstance(item, Crossing)][-1]
    return np.array([last.after[0], last.after[1], last.after[3]])


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize(
    ("load", "zeta", "omega"), [(0.01, 0.0, 0.3), (0.03, 0.05, 0.75852), (0.05, 0.1, 1.6), (0.03, 0.0, 2.0)]
)
def test_the_section_map_is_what_differences_of_trajectories_give(
    model: str, load: float, zeta: float, omega: float
) -> None:
    """Central differences with Richardson's extrapolation, to 1e-8."""
    p = problem(model, load, zeta, omega)
    x = solved(p)
    here = np.array([x[0, 0], x[0, 1], x[0, 2]])
    np.testing.assert_allclose(returned(p, x[0], here), here, rtol=1e-11, atol=1e-13)

    def column(j: int, h: float) -> np.ndarray:
        shift = h * np.eye(3)[j]
        return (returned(p, x[0], here + shift) - returned(p, x[0], here - shift)) / (2 * h)

    h = 2e-4 * load
    matrix = np.stack([(4 * column(j, h / 2) - column(j, h)) / 3 for j in range(3)], axis=-1)
    expected = section_map(p, x)[0]
    np.testing.assert_allclose(matrix, expected, rtol=0, atol=1e-8 * max(1.0, np.abs(expected).max()))


def test_saltation_matrices_have_the_form_that_was_derived() -> None:
    """DR, and (phi', phi) = -m dkappa phi/w+, (phi', w) = m (w-/w+ - 1), (w, phi) = -dkappa phi/w+, (w, w) = w-/w+."""
    p = problem(MODELS[1], [0.01, 0.05], [0.0, 0.05], [0.3, 1.6])
    x = solved(p)
    motion = orbit.cycle(p, x)
    for region in (0, 1):
        change = (KAPPA[1] - KAPPA[0]) * (1 if region == 0 else -1)
        before, after = motion.legs[region].end, motion.after[region]
        jump = motion.jumps[region]
        np.testing.assert_allclose(jump[:, 1, 0], -M * change * before[:, 0] / after[:, 3], rtol=1e-14)
        np.testing.assert_allclose(jump[:, 1, 3], M * (before[:, 3] / after[:, 3] - 1), atol=1e-15)
        np.testing.assert_allclose(jump[:, 3, 0], -change * before[:, 0] / after[:, 3], rtol=1e-14)
        np.testing.assert_allclose(jump[:, 3, 3], before[:, 3] / after[:, 3], rtol=1e-14)
        s = saltation(p, region, motion, x[:, orbit.DRIVE])
        np.testing.assert_allclose(np.linalg.det(s), 1.0, rtol=1e-12)
        np.testing.assert_allclose(s[:, :, [0, 1, 3]], jump[:, :, [0, 1, 3]], rtol=0, atol=0)


@pytest.mark.parametrize("model", MODELS)
def test_the_determinant_is_that_of_the_damping(model: str) -> None:
    zeta, omega = np.array([0.0, 0.0, 0.02, 0.05]), np.array([0.3, 2.0, 0.75852, 1.6])
    p = problem(model, 0.03, zeta, omega)
    x = solved(p)
    expected = np.exp(-2 * zeta * tau / omega)
    np.testing.assert_allclose(np.linalg.det(monodromy(p, x)), expected, rtol=1e-12)
    np.testing.assert_allclose(np.linalg.det(section_map(p, x)), expected, rtol=1e-12)


def test_without_damping_the_monodromy_matrix_is_symplectic() -> None:
    """In the momenta of T = [(phi' - m theta')^2/(1 - m^2) + theta'^2]: M^T J M = J."""
    p = problem(MODELS[1], [0.01, 0.03, 0.08], 0.0, [0.3, 0.75852, 2.0])
    matrix = monodromy(p, solved(p))
    mass = np.array([[1.0, -M], [-M, 1.0]]) / (1 - M**2)
    form = np.zeros((4, 4))
    # d(phi) ^ d(p_phi) + d(theta) ^ d(p_theta), in the order phi, phi', theta, theta'.
    place, rate = np.array([0, 2]), np.array([1, 3])
    form[np.ix_(place, rate)], form[np.ix_(rate, place)] = mass, -mass
    defect = np.swapaxes(matrix, 1, 2) @ form @ matrix - form
    size = np.abs(matrix).max(axis=(1, 2), keepdims=True) ** 2
    assert np.abs(defect / size).max() < 1e-12


@pytest.mark.parametrize("model", MODELS)
def test_without_load_the_stability_is_hills(model: str) -> None:
    omega = np.linspace(0.4, 2.5, 60) * W0
    for zeta in (0.0, 0.03):
        found = stability(pair(model, torque=0.0, damping_ratio=zeta), omega)
        hill = solve(pair("classical", torque=0.0, damping_ratio=zeta), omega)
        # Growth a period, of multipliers accurate to 1e-12; at an edge of a tongue it is a square root.
        np.testing.assert_allclose(found.growth_rate, hill.growth_rate, rtol=0, atol=1e-9 * W0)
        np.testing.assert_array_equal(found.stable, hill.stable)


@pytest.mark.parametrize("model", MODELS)
def test_a_small_load_changes_little(model: str) -> None:
    """Multipliers at phi_s = 1e-5 are Hill's but for the square of it, away from the forced resonances."""
    for omega in (0.3, 0.75852, 1.6, 2.0):
        items = [i for i in reference(model) if i["omega"] == omega and i["zeta"] == 0]
        p = problem(model, 1e-5, 0.0, omega)
        logs, _, _ = multipliers(p, x := solved(p), section_map(p, x))
        np.testing.assert_allclose(
            np.sort_complex(np.exp(logs[0])), complex_of(items[0]["classical"]), rtol=0, atol=1e-6
        )


@pytest.mark.parametrize("case", REFERENCE["lines"], ids=lambda c: f"{c['omega_over_wd']}-{c['load']}")
def test_lines_of_the_spectrum_at_held_speed_are_those_of_the_reference(case: dict[str, Any]) -> None:
    """|c_n| of phi over one period of the orbit, from exact samples of both legs."""
    omega = case["omega_over_wd"] * np.sqrt(1 - 0.05**2)
    p = problem(MODELS[1], case["load"], 0.05, omega)
    x = solved(p)[0]
    assert x[orbit.DRIVE] == pytest.approx(case["eta"], rel=1e-10)
    motion = orbit.cycle(p, x[None])
    count = 16384
    t = np.arange(count) * tau / omega / count
    first = t < x[orbit.TIME]
    arcs = [
        Arc((x[0], x[1], 0.0, x[2]), KAPPA[0], 0.05, case["load"], M, x[orbit.DRIVE]),
        Arc(tuple(motion.after[0][0]), KAPPA[1], 0.05, case["load"], M, x[orbit.DRIVE]),
    ]
    phi = np.concatenate([arcs[0].samples(t[first])[0], arcs[1].samples(t[~first] - x[orbit.TIME])[0]])
    lines = 2 * np.abs(np.fft.rfft(phi)[: len(case["energy_conserving"])]) / count / case["load"]
    # Twice the mean too, as the reference has it; its samples lie on the jumps of phi' or beside them.
    np.testing.assert_allclose(lines, case["energy_conserving"], rtol=1e-6)


def test_the_response_from_the_orbit_repeats_itself() -> None:
    """The drive holds the speed: ten cycles by the event-driven integrator, from the orbit that shooting found."""
    system = pair(damping_ratio=0.05)
    omega = 1.6 * W0
    x = solved(problem(MODELS[1], 0.01, 0.05, 1.6))[0]
    found = respond(
        system, InitialState(x[2] * W0, x[0], x[1] * W0), tau / omega / 50, cycles=10, drive=x[orbit.DRIVE] * 2105.0
    )
    np.testing.assert_allclose(found.sections.time, tau / omega * np.arange(1, 11), rtol=1e-11)
    np.testing.assert_allclose(found.sections.phi, x[0], rtol=1e-10)
    held = stability(system, np.array([omega]))
    assert held.drive.item() == pytest.approx(x[orbit.DRIVE], rel=1e-10)
    # 4 pi eta is the loss of a cycle over k0.
    power = 4 * 0.05 * W0 * found.phi_dot**2 / system.numbers.m2
    loss = np.mean(power[:500]) * tau / omega
    assert loss / 2105.0 == pytest.approx(4 * np.pi * x[orbit.DRIVE], rel=1e-2)


def test_the_growth_rate_is_that_of_a_disturbed_response() -> None:
    """In the main tongue, from the orbit with a deflection 1e-9 off: ln of the growth over the time."""
    system = pair()
    omega = 2.1 * W0
    held = stability(system, np.array([omega]))
    assert held.stable.item() == 0
    x = solved(problem(MODELS[1], 0.01, 0.0, 2.1))[0]
    found = respond(system, InitialState(x[2] * W0, x[0] + 1e-9, x[1] * W0), tau / omega, cycles=60)
    off = np.abs(found.sections.phi - x[0])
    rate = np.log(off[49] / off[19]) / (30 * tau / omega)
    # Grown from 1e-9 to 1e-5 of 1e-2: nonlinear terms and the decaying part are a thousandth.
    assert rate == pytest.approx(held.growth_rate.item(), rel=2e-3)


def test_where_no_orbit_is_found_the_status_says_so() -> None:
    """Near a forced resonance, where the gears all but turn back, a heavy load leaves no orbit."""
    found = stability(pair(torque=168.4), np.array([7750.0, 20000.0]))
    assert found.stable.tolist() == [[-1, 1]]
    assert found.status.tolist() == [[FLAGS["no_periodic_orbit"], 0]]
    assert np.isnan(found.growth_rate[0, 0])


def test_a_batch_is_its_rows() -> None:
    omega = np.array([5000.0, 12000.0, 31000.0])
    torque, zeta = np.array([10.0, 21.05, 60.0]), np.array([0.0, 0.03, 0.05])
    whole = stability(pair(torque=torque, damping_ratio=zeta), omega)
    for i in range(3):
        one = stability(pair(torque=torque[i], damping_ratio=zeta[i]), omega)
        np.testing.assert_allclose(whole.growth_rate[i], one.growth_rate[0], rtol=1e-9, atol=1e-9 * W0)
        np.testing.assert_array_equal(whole.status[i], one.status[0])
    rows = stability(pair(torque=torque, damping_ratio=zeta), np.stack([omega, omega, omega]))
    np.testing.assert_allclose(rows.growth_rate, whole.growth_rate, rtol=1e-12, atol=1e-12 * W0)


def test_flags_do_not_overlap_those_of_floquet_analysis() -> None:
    masks = [*STATUS_FLAGS.values(), *FLAGS.values()]
    assert sum(masks) == np.bitwise_or.reduce(masks)
    assert max(masks) < 2**15


def test_the_classical_formulation_is_left_to_floquet_analysis() -> None:
    with pytest.raises(ValueError, match="classical"):
        stability(pair("classical"), np.array([1.0]))


@given(omega=st.floats(0.5, 3.0), load=st.floats(0.0, 0.03), zeta=st.floats(0.0, 0.1))
def test_an_orbit_solves_its_equations(omega: float, load: float, zeta: float) -> None:
    for model in MODELS:
        p = problem(model, load, zeta, omega)
        x, found = orbit.solve(p)
        if found.all():
            residual, _, _ = orbit.equations(p, x)
            assert np.abs(residual).max() < 1e-12
            # No loss, no drive; with loss it is positive.
            assert x[0, orbit.DRIVE] > -1e-15


def test_where_the_speed_couples_with_the_deflection_the_growth_is_that_of_all_three() -> None:
    """In the second tongue, whose forced resonance changes the speed much."""
    system = pair(torque=65.255, damping_ratio=0.01)
    found = stability(system, np.array([15225.0]))
    assert found.status.item() & FLAGS["speed_coupled"]
    assert np.isnan(found.speed_exponent.item())
    p = problem(MODELS[1], 65.255 / 2105, 0.01, 15225.0 / W0)
    values = np.linalg.eigvals(section_map(p, solved(p))[0])
    assert np.abs(values.imag).max() > 1e-3
    largest = np.log(np.abs(values).max()) / (tau / 15225.0)
    assert found.growth_rate.item() == pytest.approx(largest, rel=1e-6)


def test_a_held_motion_has_all_its_samples_however_it_is_rounded() -> None:
    """Small differences grow some thousand times in 120 cycles; the end is a sample all the same."""
    system = load(CONFIGS / "oh_grosh_barber_2005" / "fig4a.yaml", ("torque=84.2",)).system
    gears, omega = build(system), 24 * tau * 10
    assert isinstance(gears, RotatingPair)
    start, drive = held(gears, omega)
    for change in (-1e-11, 0.0, 1e-11):
        begin = replace(start, phi=(start.phi or 0.0) * (1 + change))
        found = respond(gears, begin, tau / omega / 40, cycles=120, drive=drive)
        assert found.time.size == 120 * 40 + 1
        assert abs(found.end * omega / tau - 120) < 1e-5
