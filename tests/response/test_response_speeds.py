"""Steady states over the mesh frequency, many points at once, against one after the other."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from driven import CASES, force_peaks, pair, train, with_waves
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import ROOT, plain, ran, scene_data, scene_text, written

import gearstab as gs
from gearstab.config import load
from gearstab.floquet import solve
from gearstab.modal import static_mesh_force
from gearstab.propagation import bundles
from gearstab.propagation.equation import excitation
from gearstab.propagation.segment import States
from gearstab.response import harmonics, steady_state
from gearstab.response.panels import NODES, extremes
from gearstab.response.speeds import SpeedResponse, speed_response
from gearstab.response.steady import STATUS_FLAGS
from gearstab.results import open_result
from gearstab.system import Array
from gearstab.systems import build
from gearstab.waveforms import Trapezoidal

SPEEDS = np.array([0.83, 1.4, 2.63, 4.4])


@pytest.mark.parametrize("name", CASES)
def test_measures_are_those_of_the_histories(name: str) -> None:
    system, _ = CASES[name]
    smooth = not excitation(system).exact
    speeds, samples = (SPEEDS[1:2], 200) if smooth else (SPEEDS, 2000)
    found = speed_response(system, speeds, 200)
    for k, omega in enumerate(speeds):
        history = steady_state(system, omega, samples)
        force, deflection = history.mesh_force[:-1], history.mesh_deflection[:-1]
        # Samples miss smooth extremes by (pi h/samples)^2/2, and those just before a jump, and jumps, by a step.
        near = {"rtol": 2e-3, "atol": 2e-4}
        np.testing.assert_allclose(found.mesh_force_peak[0, k], np.abs(force).max(axis=0), **near)
        np.testing.assert_allclose(found.transmission_error_peak_to_peak[0, k], np.ptp(deflection, axis=0), **near)
        np.testing.assert_allclose(found.transmission_error_rms[0, k], deflection.std(axis=0), rtol=1e-6)
        np.testing.assert_allclose(found.mesh_force_rms[0, k], force.std(axis=0), rtol=1e-2 if smooth else 3e-3)
        np.testing.assert_allclose(found.mesh_force_mean[0, k], force.mean(axis=0), rtol=1e-2, atol=1e-3)
        assert bool(found.status[0, k] & STATUS_FLAGS["separation"]) == ("separation" in history.findings)
    static = static_mesh_force(system)
    np.testing.assert_allclose(found.dynamic_load_factor, found.mesh_force_peak / np.abs(static), rtol=1e-14)


@pytest.mark.parametrize("name", ["piecewise constant", "unequal frequencies", "smooth waves"])
def test_peaks_are_those_of_the_continuous_motion(name: str) -> None:
    """At a speed where vibrations are short: between the samples, and on both sides of jumps."""
    system, _ = CASES[name]
    begin = steady_state(system, 0.8, 20)
    state = np.concatenate([begin.displacement[0], begin.velocity[0]])
    low, high = force_peaks(system, 0.8, state, begin.common_period)
    found = speed_response(system, np.array([0.8]), 100)
    # The reference's interpolation and search: 1e-9; smooth waves are followed to 1e-9 a period.
    near = {"rtol": 2e-8, "atol": 2e-9}
    np.testing.assert_allclose(found.mesh_force_peak[0, 0], np.maximum(np.abs(low), np.abs(high))[0], **near)
    np.testing.assert_allclose(found.mesh_force_min[0, 0], low[0], **near)
    np.testing.assert_allclose(found.transmission_error_peak_to_peak[0, 0], (high - low)[1], **near)
    assert not found.status[0, 0] & STATUS_FLAGS["unresolved"]


@pytest.mark.parametrize("name", CASES)
def test_what_is_not_called_unresolved_is_right(name: str) -> None:
    """Few samples against many: what is flagged may be wrong, what is not has right extremes."""
    system, _ = CASES[name]
    speeds = np.array([0.31, 0.8])
    few, more, many = (speed_response(system, speeds, count) for count in (24, 100, 400))
    for found, tolerance in ((few, 3e-6), (more, 1e-7)):
        known = found.status[0] & STATUS_FLAGS["unresolved"] == 0
        for part in ("mesh_force_peak", "mesh_force_min", "transmission_error_peak_to_peak"):
            values, scale = getattr(many, part)[0], many.mesh_force_peak[0]
            error = np.abs(getattr(found, part)[0] - values) / np.maximum(scale, np.abs(values))
            assert np.all(error[known] < tolerance), (part, error, known)
    assert many.status[0, 1] & STATUS_FLAGS["unresolved"] == 0


@given(st.lists(st.tuples(st.floats(-1, 1), st.floats(0, 2), st.floats(-3, 3)), min_size=1, max_size=4))
@settings(deadline=None, max_examples=50)
def test_extremes_between_samples(waves: list[tuple[float, float, float]]) -> None:
    """Sums of cosines of up to two radians a panel, on three panels, the ends included."""

    def value(t: np.ndarray, order: int = 0) -> np.ndarray:
        return sum((a * w**order * np.cos(w * t + c + order * np.pi / 2) for a, w, c in waves), np.zeros(t.shape))

    nodes = np.arange(3)[:, None] + NODES
    low, high, _ = extremes(value(nodes), value(nodes, 1))
    # 3e5 points miss a peak by (2 rad * 5e-6)^2/2 at most; the polynomials by 2^10/4e10 = 2.5e-8 a wave.
    values = value(np.linspace(0.0, 3.0, 300_001))
    size = sum(abs(a) for a, _, _ in waves)
    assert abs(low - values.min()) <= 3e-8 * size + 1e-12
    assert abs(high - values.max()) <= 3e-8 * size + 1e-12
    assert low <= value(nodes).min()
    assert high >= value(nodes).max()


def test_extremes_of_what_is_constant_and_of_what_is_not_known() -> None:
    values = np.stack([np.full((4, 5), 2.5), np.full((4, 5), np.nan), np.zeros((4, 5))], axis=-1)
    low, high, doubt = extremes(values, np.zeros(values.shape))
    np.testing.assert_array_equal(low, [2.5, np.nan, 0.0])
    np.testing.assert_array_equal(high, low)
    np.testing.assert_allclose(doubt[[0, 2]], 0.0, atol=1e-14)


def test_root_mean_squares_are_parseval_sums() -> None:
    """Root mean squares of the transmission error, whose series converges as h^-3: to 1e-8, from Fourier integrals."""
    system = train()
    found = speed_response(system, np.array([1.4]), 400)
    amplitude = np.abs(harmonics(system, 1.4, 200).mesh_deflection[1:])
    np.testing.assert_allclose(found.transmission_error_rms[0, 0], np.sqrt((amplitude**2).sum(axis=0) / 2), rtol=1e-8)


def test_rows_of_a_batch_are_the_single_systems() -> None:
    """Rows differ in amplitude, contact ratio, load, rigid-body modes and damping."""
    epsilon, stiffness = np.array([0.0, 0.2, 0.3, 0.1]), np.array([0.5, 0.0, 0.2, 0.0])
    mesh = {"mean_stiffness": 1.0, "epsilon": epsilon, "contact_ratio": np.array([1.5, 1.4, 2.0, 1.7])}
    meshes = [mesh | {"name": "first", "transmission_error": {"sin": [0.1]}}, mesh | {"name": "second", "phasing": 0.2}]
    load = [0.2, 0.0, np.array([0.5, -0.2, 0.1, 0.3])]
    ratio = np.array([0.1, 0.05, 0.2, 0.1])
    batch = train(meshes=meshes, load=load, input_shaft_stiffness=stiffness, damping_ratio=ratio)
    found = speed_response(batch, SPEEDS)
    for row in range(4):
        own = [m | {"epsilon": epsilon[row], "contact_ratio": mesh["contact_ratio"][row]} for m in meshes]
        single = train(
            meshes=own, load=[0.2, 0.0, load[2][row]], input_shaft_stiffness=stiffness[row], damping_ratio=ratio[row]
        )
        alone = speed_response(single, SPEEDS)
        # Panels are those of the row that needs most of them.
        np.testing.assert_allclose(found.mesh_force_peak[row], alone.mesh_force_peak[0], rtol=1e-5)
        np.testing.assert_allclose(found.transmission_error_rms[row], alone.transmission_error_rms[0], rtol=1e-6)
        np.testing.assert_array_equal(found.status[row], alone.status[0])
    assert (found.status[3] & STATUS_FLAGS["unbalanced"]).all()
    assert not (found.status[1] & STATUS_FLAGS["unbalanced"]).any()


def test_the_flag_of_instability_is_floquets() -> None:
    system = train(damping_ratio=0.01)
    speeds = np.linspace(0.8, 6.0, 120)
    found, stability = speed_response(system, speeds, 8), solve(system, speeds)
    unstable = found.status & STATUS_FLAGS["unstable"] != 0
    assert unstable.any()
    np.testing.assert_array_equal(unstable, stability.stable == 0)


def test_undamped_resonances_have_no_steady_state() -> None:
    system = pair(mesh={"transmission_error": {"sin": [0.1]}})
    found = speed_response(system, np.array([1.3, 2.0, 2.0 + 1e-9]))
    failed, undamped, sensitive = (found.status[0] & STATUS_FLAGS[f] for f in ("failed", "undamped", "ill_conditioned"))
    assert failed.astype(bool).tolist() == [False, True, False]
    assert np.isnan(found.mesh_force_peak[0, 1, 0])
    assert undamped[0]
    assert sensitive.astype(bool).tolist() == [False, True, True]
    # x = k e/(k - m nu^2) sin nu t
    assert found.transmission_error_peak_to_peak[0, 0, 0] == pytest.approx(2 * 0.4 / (4 - 1.69), rel=1e-7)


def test_too_few_samples_for_the_fastest_vibration_are_flagged() -> None:
    system = pair(load=[1.0], damping_ratio=0.005, mesh={"epsilon": 0.2})
    slow = np.array([0.02])  # 100 vibrations in a cycle of the mesh
    assert speed_response(system, slow, 100).status[0, 0] & STATUS_FLAGS["unresolved"]
    assert not speed_response(system, slow, 4000).status[0, 0] & STATUS_FLAGS["unresolved"]


def test_steep_ramps_approach_jumps() -> None:
    system = train()
    ramps = with_waves(system, *(Trapezoidal(mesh.waveform.contact_ratio, 1e-7) for mesh in system.meshes))
    exact, smooth = speed_response(system, SPEEDS), speed_response(ramps, SPEEDS)
    np.testing.assert_allclose(smooth.transmission_error_rms, exact.transmission_error_rms, rtol=1e-6)


def test_rows_of_a_batch_get_the_steps_that_the_hardest_needs() -> None:
    """The first row is constant; at the slowest speed the last one needs the most steps."""
    wave = Trapezoidal(1.5, 0.2)
    epsilon = np.array([0.0, 0.2, 0.6])

    def of(values: np.ndarray | float) -> SpeedResponse:
        mesh = {"epsilon": values, "transmission_error": {"sin": [0.1]}, "damping": 0.05}
        return speed_response(with_waves(pair(load=[1.0], mesh=mesh), wave), np.array([0.7, 1.0, 5.0]))

    batch = of(epsilon)
    for row, value in enumerate(epsilon):
        alone = of(value)
        # To the tolerance, 1e-9 of the map over a period, times its sensitivity.
        np.testing.assert_allclose(batch.transmission_error_rms[row], alone.transmission_error_rms[0], rtol=1e-7)


def test_a_system_at_rest_has_no_steady_state_to_show() -> None:
    system = pair()
    with pytest.raises(ValueError, match="nothing drives"):
        speed_response(system, SPEEDS)
    assert not replace(system, load=np.array([1.0])).symmetries


CONFIG = scene_text("response_speeds")


def run(path: Path, *arguments: str) -> object:
    return ran("sweep", path, *arguments)


def test_a_sweep_writes_the_responses_over_its_axes(tmp_path: Path) -> None:
    path, out = written(tmp_path, CONFIG, "run.yaml"), tmp_path / "run.h5"
    done = run(path, "-o", str(out), "-q", "-j", "1")
    assert done.exit_code == 0, done.output
    with open_result(out) as tree:
        found = tree["response"]
        assert found["mesh_force_peak"].dims == ("epsilon", "load.0", "mesh_frequency", "mesh")
        assert list(found["mesh"].values) == ["mesh"]
        assert found["status"].attrs["flag_meanings"].split() == list(STATUS_FLAGS)
        assert found.attrs["samples_per_cycle"] == 64
        system = pair(
            damping_ratio=0.05, load=[2.0],
            mesh={"mean_stiffness": 1.0, "epsilon": 0.3, "transmission_error": {"sin": [0.1]}},
        )  # fmt: skip
        expected = speed_response(system, np.linspace(0.4, 2.6, 23), 64)
        at = found.isel({"epsilon": 1, "load.0": 1})
        for name in ("mesh_force_peak", "mesh_force_rms", "dynamic_load_factor", "status"):
            np.testing.assert_allclose(at[name].values, getattr(expected, name)[0], rtol=1e-9)
            assert at[name].attrs["units"]
        unstable = found["status"].values & STATUS_FLAGS["unstable"] != 0
        np.testing.assert_array_equal(unstable, tree["floquet"]["stable"].values == 0)


def planetary(**changes: object) -> dict[str, object]:
    """Document of the run-up among the configurations: torques on sun and carrier, the ring on a foundation."""
    root = ROOT
    return plain(load(root / "configs" / "response" / "planetary_speeds.yaml").system) | changes


def test_the_meshes_of_a_planetary_gear_share_the_torque() -> None:
    """Nothing but the meshes holds the sun's rotation: their mean forces add up to its load. Sequential phases: what
    one planet does the next one does a quarter of a period later."""
    system = build(planetary())
    found = steady_state(system, 12000.0, 40)
    force = found.mesh_force[:-1]
    assert "unbalanced" not in found.findings
    measured = speed_response(system, np.array([12000.0]), 100)
    assert measured.mesh_force_mean[0, 0, :4].sum() == pytest.approx(1000.0, rel=1e-6)
    for n in range(3):
        np.testing.assert_allclose(force[:, n + 1], np.roll(force[:, n], 10), atol=1e-6)
        np.testing.assert_allclose(force[:, n + 5], np.roll(force[:, n + 4], 10), atol=1e-6)
    pushed = steady_state(build(planetary(load={"sun": 1000.0, "carrier": 0.0, "ring": 0.0})), 12000.0, 40)
    assert "unbalanced" in pushed.findings


def test_a_dimensionless_planetary_gear_feels_the_same() -> None:
    """Forces over k_rp, frequencies over sqrt(k_rp/m_r); lengths keep their scale."""
    rate = np.sqrt(1e8 / 6.35)
    plain = speed_response(build(planetary()), np.array([12000.0]), 40)
    scaled = speed_response(build(planetary(scaling="dimensionless")), np.array([12000.0 / rate]), 40)
    np.testing.assert_allclose(scaled.mesh_force_peak, plain.mesh_force_peak / 1e8, rtol=1e-8)
    np.testing.assert_allclose(scaled.transmission_error_rms, plain.transmission_error_rms, rtol=1e-8)
    np.testing.assert_allclose(scaled.dynamic_load_factor, plain.dynamic_load_factor, rtol=1e-8)


# --- intervals taken together give what they give one by one, for any number of rows, with either kernel


TRAIN = scene_data("response_bundles")
OMEGA = np.array([0.7, 1.9, 2.0, 5.0])
TOGETHER = 1e-11
"""Difference of sums over the same period in another order."""


def _close(one: Array, other: Array) -> None:
    np.testing.assert_allclose(one, other, rtol=TOGETHER, atol=TOGETHER * np.nanmax(np.abs(other)))


def _one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(States, "eigen", None)


@pytest.mark.parametrize("entries", [1, 500, 10**6])
def test_intervals_together_are_those_one_by_one(monkeypatch: pytest.MonkeyPatch, entries: int) -> None:
    system = gs.build({"system": TRAIN}, epsilon=np.array([0.1, 0.2, 0.3]))
    monkeypatch.setattr(bundles, "ENTRIES", entries)
    together = speed_response(system, OMEGA, samples_per_cycle=30)
    _one_by_one(monkeypatch)
    alone = speed_response(system, OMEGA, samples_per_cycle=30)
    assert np.isfinite(together.mesh_force_peak).all()
    for name in (field.name for field in fields(alone) if field.name != "connections"):
        _close(getattr(together, name), getattr(alone, name))


def test_harmonics_of_intervals_together(monkeypatch: pytest.MonkeyPatch) -> None:
    system = gs.build({"system": TRAIN})
    together = harmonics(system, 1.9, order=30)
    _one_by_one(monkeypatch)
    alone = harmonics(system, 1.9, order=30)
    _close(together.mesh_force, alone.mesh_force)
    _close(together.mesh_deflection, alone.mesh_deflection)


def test_states_without_eigenvectors_are_taken_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Eigenvectors of critical damping are parallel."""
    system = gs.build({"system": TRAIN})
    expected = speed_response(system, OMEGA)
    monkeypatch.setattr(States, "each", property(lambda states: [None] * len(states.generators)))
    _close(speed_response(system, OMEGA).mesh_force_rms, expected.mesh_force_rms)
