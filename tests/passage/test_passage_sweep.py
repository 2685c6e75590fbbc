"""Sweeps with ``methods.passage``."""

from dataclasses import replace
from fractions import Fraction
from importlib import import_module

import numpy as np
import pytest
from driven import integrated_along, train
from scenes import REDUCER, TRAIN, problems, read, result_of, scene_data, scene_text

import gearstab as gs
from gearstab.config import load
from gearstab.floquet import solve
from gearstab.mesh import Rotation
from gearstab.passage.propagator import growth, motion
from gearstab.propagation.path import Path
from gearstab.sweep import plan
from gearstab.systems import build

DAMPED = REDUCER.replace("teeth: 63", "teeth: 40").replace("gearbox\n", "gearbox\n  damping_ratio: 0.001\n")


GRID = scene_text("passage_sweep_grid")


def test_blocks_change_nothing(tmp_path, monkeypatch):
    planning = import_module("gearstab.sweep.plan")
    whole = result_of(tmp_path, TRAIN + GRID, "passage")
    assert whole["growth"].dims == ("damping_ratio", "meshes.second.phasing", "rate")
    assert whole["growth_by_tongue"].dims == ("tongue", "damping_ratio", "meshes.second.phasing", "rate")
    assert whole["slowest_rate"].dims == ("damping_ratio", "meshes.second.phasing")
    assert list(whole["rate"]) == [0.03, 1.0, -0.1]
    monkeypatch.setattr(planning, "MOST", 1)
    monkeypatch.setattr(import_module("gearstab.methods.base").Method, "fewest", 1)
    planned = plan(read(tmp_path, TRAIN + GRID))
    assert planned.layouts[0].count == 6
    parts = result_of(tmp_path, TRAIN + GRID, "passage")
    assert sorted(parts["label"].values) == sorted(whole["label"].values)
    for name in ("growth", "growth_exact", "growth_error", "growth_through", "slowest_rate", "status"):
        # Edges are those of a search that begins at the row before, each right to 1e-10.
        np.testing.assert_allclose(parts[name], whole[name], rtol=1e-9, atol=1e-9, err_msg=name)
    for label in set(whole["label"].values):
        one, other = (np.sort(found["growth_by_tongue"].values[found["label"].values == label], axis=0)
                      for found in (whole, parts))  # fmt: skip
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9)
    # More damping, less growth; the phasing of one half closes the primary regions.
    assert np.all(np.diff(whole["growth"].values, axis=0) <= 1e-12)
    assert np.all(whole["growth"].values[:, 1] < whole["growth"].values[:, 0])


def test_the_slowest_rate_passes_with_the_amplification(tmp_path):
    text = (
        TRAIN
        + """
sweep: {mesh_frequency: [1.5, 6.0], damping_ratio: [0.0, 0.01]}
methods: {passage: {rate: [0.1], amplification: 100}}
"""
    )
    found = result_of(tmp_path, text, "passage")
    for ratio, rate in zip((0.0, 0.01), found["slowest_rate"].values, strict=True):
        again = result_of(
            tmp_path, text.replace("[0.1]", f"[{float(rate)!r}]").replace("[0.0, 0.01]", f"[{ratio}]"), "passage"
        )
        assert float(again["growth"][0, 0]) == pytest.approx(np.log(100), rel=1e-9)


def test_at_the_slowest_rate_the_exact_motion_gains_the_amplification(tmp_path):
    text = TRAIN + "sweep: {mesh_frequency: [3.0, 6.0]}\nmethods: {passage: {rate: [-0.1], amplification: 10}}\n"
    found = result_of(tmp_path, text, "passage")
    rate = float(found["slowest_rate_exact"])
    assert rate > 0
    exact = result_of(tmp_path, text.replace("[-0.1]", f"[{-rate!r}, {-1.5 * rate!r}]"), "passage")["growth_exact"]
    # The rate is found to one part in a thousand, and growth goes about as its inverse.
    assert float(exact[0]) == pytest.approx(np.log(10), rel=3e-3)
    assert float(exact[1]) < np.log(10)


def test_where_nothing_grows_every_rate_passes(tmp_path):
    text = TRAIN + "sweep: {mesh_frequency: [3.0, 3.2]}\nmethods: {passage: {rate: [0.1], amplification: 100}}\n"
    found = result_of(tmp_path, text.replace("damping_ratio: 0", "damping_ratio: 0.3"), "passage")
    assert float(found["slowest_rate"]) == float(found["slowest_rate_exact"]) == 0.0


def test_the_exact_motion_alone_where_regions_are_not_looked_for(tmp_path, monkeypatch):
    rate = "rate: [0.03, -0.1]"
    text = f"{TRAIN}sweep: {{mesh_frequency: [1.5, 6.0]}}\nmethods: {{passage: {{{rate}}}}}\n"
    whole = result_of(tmp_path, text, "passage")
    monkeypatch.setattr(import_module("gearstab.passage"), "boundaries", None)
    found = result_of(tmp_path, text.replace(rate, f"{rate}, regions: false"), "passage")
    for name in ("growth_exact", "growth_through"):
        assert np.array_equal(found[name], whole[name])
        assert np.all(np.isfinite(found[name]))
    for name in ("growth", "growth_error", "slowest_rate", "slowest_rate_exact"):
        assert np.all(np.isnan(found[name]))
    assert found.sizes["tongue"] == 0
    assert np.all(found["status"] == 0)


def test_rates_of_an_input_speed_are_those_of_the_input(tmp_path):
    speeds = 'sweep: {input_speed: ["900 rpm", "6000 rpm"]}\n'
    found = result_of(tmp_path, DAMPED + speeds + 'methods: {passage: {rate: ["3000 rpm/s", -2000]}}\n', "passage")
    assert found["rate"].values == pytest.approx([3000 * 2 * np.pi / 60, -2000.0])
    factor = 20 * 2 * np.pi / 60
    low, high = 900 * factor, 6000 * factor
    rates = [3000 * factor, -2000 * 20]
    mesh = f"sweep: {{mesh_frequency: [{low}, {high}]}}\nmethods: {{passage: {{rate: {rates}}}}}\n"
    other = result_of(tmp_path, DAMPED + mesh, "passage")
    assert found["growth"].values == pytest.approx(other["growth"].values, rel=1e-6, abs=1e-9)
    assert found["growth_exact"].values == pytest.approx(other["growth_exact"].values, rel=1e-6, abs=1e-9)
    assert 3 < float(found["growth_exact"][0]) < 30
    assert found["slowest_rate"].values * 20 == pytest.approx(other["slowest_rate"].values, rel=1e-6)


def test_a_measured_table_of_speed_over_time(tmp_path):
    sweep = "sweep: {mesh_frequency: [1.5, 6.0]}\n"
    (tmp_path / "run_up.csv").write_text("time, speed\n0, 1.5\n10, 3.0\n# it dwells\n15, 3.0\n25, 6.0\n")
    found = result_of(tmp_path, TRAIN + sweep + "methods: {passage: {table: run_up.csv}}\n", "passage")
    other = result_of(
        tmp_path, TRAIN + sweep + "methods: {passage: {path: [[0, 1.5], [10, 3], [15, 3], [25, 6]]}}\n", "passage"
    )
    assert found.identical(other)
    assert float(found["rate"][0]) == pytest.approx(4.5 / 25)
    ramp = result_of(tmp_path, TRAIN + sweep + "methods: {passage: {path: [[0, 1.5], [30, 6.0]]}}\n", "passage")
    rate = result_of(tmp_path, TRAIN + sweep + "methods: {passage: {rate: 0.15}}\n", "passage")
    assert ramp["growth_exact"].values == pytest.approx(rate["growth_exact"].values, rel=1e-12)


def test_units_in_the_header_of_a_table(tmp_path):
    sweep = "sweep: {mesh_frequency: [1.5, 6.0]}\nmethods: {passage: {table: run_up.csv}}\n"
    (tmp_path / "run_up.csv").write_text("speed [rpm], time [min]\n60, 0\n90, 1.5\n")
    path = read(tmp_path, TRAIN + sweep).methods.passage.path
    np.testing.assert_allclose(path, [[0, 2 * np.pi], [90, 3 * np.pi]], rtol=1e-15)
    (tmp_path / "run_up.csv").write_text("t, n\n0, 1\n90, 2\n")
    (found,) = problems(tmp_path, TRAIN + sweep)
    assert 'the header "t, n" names no column time and speed' in found.message


def test_a_path_too_long_to_follow_is_flagged(tmp_path, monkeypatch):
    monkeypatch.setattr(import_module("gearstab.passage"), "MOST", 100)
    text = TRAIN + "sweep: {mesh_frequency: [1.5, 3.0]}\nmethods: {passage: {rate: [0.01, 100.0]}}\n"
    found = result_of(tmp_path, text, "passage")
    assert found["status"].values.tolist() == [1, 0]
    assert np.isnan(found["growth_exact"].values).tolist() == [True, False]
    assert np.isfinite(found["growth"].values).all()


def test_units_of_a_rate():
    from gearstab.config.model.units import to_si

    assert to_si("300 rpm/s", ("rad/s^2",)) == pytest.approx(10 * np.pi)
    assert to_si("2 Hz/s", ("rad/s^2",)) == pytest.approx(4 * np.pi)
    assert to_si("60 rpm/min", ("rad/s^2",)) == pytest.approx(2 * np.pi / 60)
    assert to_si("5 deg/s^2", ("rad/s^2",)) == pytest.approx(np.deg2rad(5))


# --- run-ups and tolerances of systems with matrices that act with a speed of rotation


GYROSCOPIC = np.array([[0.0, 0.6, -0.2], [-0.6, 0.0, 0.4], [0.2, -0.4, 0.0]])


def test_exact_growth_is_that_of_integration() -> None:
    # A quick ramp: the Euler force takes 0.028 away.
    turning = Rotation(
        Fraction(-1, 2), gyroscopic=GYROSCOPIC, circulatory=0 * GYROSCOPIC, centripetal=-0.03 * np.eye(3)
    )
    system, path = replace(train().undriven(), rotations=(turning,)), Path.ramp(1.2, 2.4, 0.05)
    expected = integrated_along(system, path, np.array([0.0, path.time[-1]]), np.eye(6))[-1]
    weight = np.zeros((6, 6))
    weight[:3, :3] = np.linalg.cholesky(system.mean_stiffness_matrix()).T
    weight[3:, 3:] = np.linalg.cholesky(system.mass).T
    through = float(np.log(np.linalg.norm(weight @ expected @ np.linalg.inv(weight), 2)))
    # Magnus steps work to about 1e-9.
    assert growth(motion(system), path).through == pytest.approx(through, abs=1e-7)


def test_the_rate_changes_at_the_knots_of_a_path() -> None:
    turning = Rotation(Fraction(-1, 2), gyroscopic=GYROSCOPIC)
    system = replace(train().undriven(), rotations=(turning,))
    bent = Path(np.array([0.0, 3.3, 7.1]), np.array([1.2, 1.9, 1.5]))
    whole = growth(motion(system), bent).through
    fine = Path(np.linspace(0.0, 7.1, 72), np.interp(np.linspace(0.0, 7.1, 72), bent.time, bent.mesh_frequency))
    # 3.3 and 7.1 are among the knots of the other one, whose rates are the same.
    assert growth(motion(system), fine).through == pytest.approx(whole, abs=1e-7)


SYSTEM = scene_data("passage_rotor")
SWEEP = {"mesh_frequency": {"start": 3.4, "stop": 3.9, "num": 6}}


def test_a_slow_passage_gains_the_integral_of_the_growth_rate() -> None:
    found = gs.sweep(load({"system": SYSTEM, "sweep": SWEEP, "methods": {"passage": {"rate": 2e-4}}}), jobs=1)[
        "passage"
    ]
    gained = float(np.ravel(found["growth"])[0])
    omega = np.linspace(3.4, 3.9, 2001)
    rate = solve(build(load({"system": SYSTEM}).system), omega)
    integral = np.trapezoid(np.maximum(rate.growth_rate[0], 0.0), omega) / 2e-4
    # The trapezoidal rule is off by the roots at both edges.
    assert gained == pytest.approx(integral, rel=1e-3)
    assert abs(float(np.ravel(found["growth_exact"])[0]) - gained) <= float(np.ravel(found["growth_error"])[0])


def test_tolerances_are_those_of_samples() -> None:
    parameters = {"meshes.0.epsilon": {"uniform": [0.02, 0.2]}}
    options = {"samples": 64, "sobol": False, "parameters": parameters}
    whole = {"system": SYSTEM, "sweep": SWEEP, "methods": {"tolerance": options, "floquet": {}}}
    found = gs.sweep(load(whole), jobs=1)
    wide, narrow = (
        solve(build(load({"system": SYSTEM | {"meshes": [SYSTEM["meshes"][0] | {"epsilon": e}]}}).system),
              np.linspace(3.4, 3.9, 6)).stable[0]
        for e in (0.2, 0.02)
    )  # fmt: skip
    probability = np.ravel(found["tolerance"]["probability"])
    assert np.all(probability[wide == 1] == 0)
    assert np.all(probability[narrow == 0] == 1)
    assert np.any((probability > 0.1) & (probability < 0.9))
