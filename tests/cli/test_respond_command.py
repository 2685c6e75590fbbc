"""``gearstab respond``: from a configuration to a result file with time histories."""

from __future__ import annotations

import csv
from pathlib import Path

import h5py
import numpy as np
import pytest
from click.testing import Result
from scenes import opened, ran, refused, scene_text, succeeds, written

from gearstab.config import load
from gearstab.floquet import solve
from gearstab.modal import static_equilibrium, static_mesh_force
from gearstab.plots import default_kind, draw
from gearstab.plots.view import Request
from gearstab.response import RESPONSE_FLAGS, driven_response, free_response, harmonics, steady_state
from gearstab.results import open_result
from gearstab.systems import build

CONFIG = scene_text("respond_command")


@pytest.fixture
def config(tmp_path: Path) -> Path:
    return written(tmp_path, CONFIG, "train.yaml")


def test_the_file_holds_the_histories_with_units(config: Path, tmp_path: Path) -> None:
    out = tmp_path / "new" / "out.h5"
    done = succeeds("respond", config, "-o", out)
    assert done.stdout == ""
    assert "51 samples" in done.stderr
    loaded = load(config)
    system = build(loaded.system)
    expected = free_response(system, 1.25, np.zeros(2), np.array([0.0, 0.2]), 5 * 2 * np.pi / 1.25, 10)
    with open_result(out) as tree:
        found = tree["response"]
        for name in ("time", "displacement", "velocity", "mesh_deflection", "mesh_force", "energy"):
            np.testing.assert_array_equal(found[name].values, getattr(expected, name))
            assert found[name].dtype == np.float64
            assert found[name].attrs["units"]
            assert found[name].attrs["long_name"]
        assert found["displacement"].dims == ("time", "dof")
        assert found["mesh_force"].dims == ("time", "mesh")
        assert list(found["mesh"].values) == ["fast", "slow"]
        assert found.attrs["status"] == "complete"
        assert found.attrs["mesh_frequency"] == 1.25
        assert found.attrs["common_period"] == pytest.approx(2 * 2 * np.pi / 1.25)
        growth = solve(system, np.array([1.25])).growth_rate.item()
        assert found.attrs["growth_rate"] == growth
        assert found.attrs["largest_multiplier"] == pytest.approx(np.exp(growth * 2 * 2 * np.pi / 1.25))
        assert tree.attrs["title"] == "a small train"
        assert "samples_per_cycle" in tree.attrs["config"]
        assert "natural_frequency" in tree["modes"]


def test_plain_h5py_reads_it(config: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.h5"
    succeeds("respond", config, "-o", out)
    with h5py.File(out) as file:
        displacement = file["response/displacement"]
        assert displacement.shape == (51, 2)
        assert displacement.dims[0][0].name == "/response/time"
        assert displacement.attrs["units"] == "m"


def test_the_default_file_is_not_that_of_a_sweep(config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert succeeds("respond", config, "--quiet").stderr == ""
    assert [path.name for path in (tmp_path / "results").iterdir()] == ["train.response.h5"]


def test_values_can_be_replaced(config: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.h5"
    given = ["--set", "respond.cycles=2", "--set", "meshes.fast.epsilon=0", "--set", "meshes.slow.epsilon=0"]
    succeeds("respond", config, "-o", out, *given)
    energy = opened(out)["response"]["energy"].values
    assert len(energy) == 21
    np.testing.assert_allclose(energy, 0.5 * 2.0 * 0.2**2, rtol=1e-13)


def test_a_duration_instead_of_cycles(config: Path, tmp_path: Path) -> None:
    config.write_text(CONFIG.replace("cycles: 5", "duration: 10.0"))
    out = tmp_path / "out.h5"
    succeeds("respond", config, "-o", out)
    time = opened(out)["response"]["time"].values
    step = 2 * np.pi / 1.25 / 10
    # The last sample is the last one that is not after the end.
    assert 10.0 - step < time[-1] <= 10.0
    np.testing.assert_allclose(np.diff(time), step, rtol=1e-12)


def test_an_overflow_is_said(config: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.h5"
    given = ["allow_negative_stiffness=true", "meshes.fast.epsilon=3", "respond.cycles=1000"]
    done = succeeds("respond", config, "-o", out, *(part for text in given for part in ("--set", text)))
    assert "outgrew double precision" in done.stderr
    with open_result(out) as tree:
        assert tree["response"].attrs["status"] == "overflow"
        assert np.isfinite(tree["response"]["energy"].values).all()


def test_a_configuration_without_the_section(config: Path, tmp_path: Path) -> None:
    config.write_text(CONFIG[: CONFIG.index("respond:")] + "sweep: {mesh_frequency: [1.0]}\nmethods: {floquet: {}}\n")
    said = refused("respond", config, "-o", tmp_path / "out.h5")
    assert f"{config}:1: respond: is missing; add the section respond: mesh_frequency, cycles" in said


# --- ``gearstab respond`` of driven systems: steady states, spectra, status, and what does not fit together


SYSTEM = scene_text("respond_driven_command")
STEADY = SYSTEM + "respond: {mesh_frequency: 1.25, steady_state: true, samples_per_cycle: 40}\n"
HISTORY = SYSTEM + "respond: {mesh_frequency: 1.25, cycles: 6, samples_per_cycle: 20}\n"
FREE = """kind: two_stage
  inertias: [1.0, 0.3, 4.0]
  input_shaft_stiffness: 0
  damping_ratio: 0.05
  load: [1, 0, 0]
"""


def driven(tmp_path: Path, text: str, *options: str) -> tuple[Result, Path]:
    path, out = written(tmp_path, text, "train.yaml"), tmp_path / "out.h5"
    return succeeds("respond", path, "-o", out, *options), out


def test_a_steady_state_with_its_harmonics(tmp_path: Path) -> None:
    _, out = driven(tmp_path, STEADY)
    system = build(load(tmp_path / "train.yaml").system)
    expected = steady_state(system, 1.25, 40)
    with open_result(out) as tree:
        found = tree["response"]
        # The slow mesh and the force have twice the period of the fast one.
        assert found.sizes["time"] == 81
        for name in ("time", "displacement", "velocity", "mesh_deflection", "mesh_force", "energy"):
            np.testing.assert_allclose(found[name].values, getattr(expected, name), atol=1e-13)
        np.testing.assert_allclose(found["static_mesh_force"].values, static_mesh_force(system), rtol=1e-14)
        amplitude = np.abs(harmonics(system, 1.25, found.sizes["frequency"] - 1).mesh_force)
        np.testing.assert_allclose(found["mesh_force_amplitude"].values, amplitude, atol=1e-13)
        np.testing.assert_allclose(np.diff(found["frequency"].values), 1.25 / 2, rtol=1e-12)
        largest = found["peak_mesh"].values[0], found["peak_frequency"].values[0]
        at = found["mesh_force_amplitude"].sel(mesh=largest[0], frequency=largest[1])
        assert at == found["peak_amplitude"].values[0] == amplitude[1:].max()
        assert found["status"].values == expected.flags
        assert found["status"].attrs["flag_meanings"].split() == list(RESPONSE_FLAGS)
        assert found.attrs["status"] == "complete"
        for variable in found.data_vars.values():
            assert {"units", "long_name"} <= set(variable.attrs)


def test_a_history_from_static_equilibrium_with_its_densities(tmp_path: Path) -> None:
    _, out = driven(tmp_path, HISTORY)
    system = build(load(tmp_path / "train.yaml").system)
    start = static_equilibrium(system)
    expected = driven_response(system, 1.25, start, np.zeros(2), 6 * 2 * np.pi / 1.25, 20)
    with open_result(out) as tree:
        found = tree["response"]
        np.testing.assert_allclose(found["displacement"].values[0], start, atol=1e-15)
        np.testing.assert_allclose(found["displacement"].values, expected.displacement, atol=1e-13)
        density = found["mesh_force_density"]
        assert density.dims == ("frequency", "mesh")
        assert "mean_velocity" not in found
        assert (density.values >= 0).all()


def test_histories_and_spectra_are_exported_apart(tmp_path: Path) -> None:
    _, out = driven(tmp_path, STEADY)
    rows = {}
    for over in ("time", "time,mesh", "frequency", "peak"):
        table = tmp_path / f"{over}.csv"
        succeeds("export", out, "-o", table, "--over", over)
        rows[over] = list(csv.DictReader(table.read_text().splitlines()))
    # Coordinates and meshes have a table each, not one of their product.
    assert len(rows["time"]) == len(rows["time,mesh"]) == 81 * 2
    assert {"dof", "displacement", "velocity"} <= set(rows["time"][0])
    assert not {"mesh", "mesh_force", "mesh_force_amplitude"} & set(rows["time"][0])
    assert {"frequency", "mesh", "mesh_force_amplitude"} <= set(rows["frequency"][0])
    assert rows["peak"][0].keys() >= {"peak_mesh", "peak_frequency", "peak_amplitude"}
    force = opened(out)["response"]["mesh_force"].values
    last = [float(row["mesh_force"]) for row in rows["time,mesh"][-2:]]
    np.testing.assert_array_equal(last, force[-1])
    assert "time,dof; time,mesh; frequency,mesh; peak" in refused(
        "export", out, "-o", tmp_path / "x.csv", "--over", "speed"
    )
    done = ran("export", out, "-o", tmp_path / "x.csv")
    assert "note: not in the table: mesh_deflection, mesh_force" in done.stderr
    assert "(--over time,mesh)" in done.stderr


def test_a_train_that_accelerates_says_so(tmp_path: Path) -> None:
    mesh = "mean_stiffness: 1.0, epsilon: 0.2, contact_ratio: 1.5"
    free = f"system:\n  {FREE}  meshes: [{{{mesh}}}, {{{mesh}}}]\n"
    done, out = driven(tmp_path, free + "respond: {mesh_frequency: 2.0, steady_state: true}\n")
    assert "the load accelerates the train as a whole" in done.stderr
    with open_result(out) as tree:
        assert int(tree["response"]["status"]) & RESPONSE_FLAGS["unbalanced"]


def test_no_steady_state_is_an_answer_too(tmp_path: Path) -> None:
    pair = (
        "system: {kind: gear_pair, equivalent_mass: 1.0, load: [1.0],\n"
        "  meshes: [{mean_stiffness: 1.0, epsilon: 0, contact_ratio: 1.5}]}\n"
        "respond: {mesh_frequency: 1.0, steady_state: true}\n"
    )
    done, out = driven(tmp_path, pair)
    assert "no steady state" in done.stderr
    with open_result(out) as tree:
        assert tree["response"].attrs["status"] == "failed"
        assert tree["response"].sizes["time"] == 0


def test_a_system_that_nothing_drives_needs_an_initial_state(tmp_path: Path) -> None:
    lines = [line for line in SYSTEM.splitlines() if "load" not in line and "forces" not in line]
    free = "\n".join(lines).replace(",\n       transmission_error: {sin: [0.05, 0.02], cos: [0.01]}", "")
    path = written(tmp_path, free + "\nrespond: {mesh_frequency: 1.25, steady_state: true}\n")
    assert "respond.steady_state: nothing drives the system" in refused("respond", path)
    path = written(tmp_path, free + "\nrespond: {mesh_frequency: 1.25, cycles: 3}\n")
    assert "initial is missing" in refused("respond", path)


def test_too_many_samples_for_the_memory(tmp_path: Path) -> None:
    large = STEADY.replace("samples_per_cycle: 40", "samples_per_cycle: 1000000").replace("1/2", "1/997")
    said = refused("respond", written(tmp_path, large))
    assert "respond.samples_per_cycle" in said
    assert "GB" in said


# --- run-ups on the command line: what is read, written and drawn


RAMP = scene_text("respond_ramp_command")


@pytest.fixture
def ramp(tmp_path: Path) -> Path:
    return written(tmp_path, RAMP, "pair.yaml")


def test_a_run_up_is_written_and_drawn_over_the_speed_that_was_typed(ramp: Path, tmp_path: Path) -> None:
    out, picture = tmp_path / "out.h5", tmp_path / "out.png"
    succeeds("respond", ramp, "-o", out)
    teeth, rpm = 20, 2 * np.pi / 60
    with open_result(out) as tree:
        found = tree["response"].to_dataset()
        time, speed = found["time"].values, found["momentary_mesh_frequency"].values
        np.testing.assert_allclose(speed, teeth * rpm * (6000 + 6000 * time), rtol=1e-12)
        np.testing.assert_allclose(time[-1], 0.5, rtol=1e-3)
        # Of a free train the load is balanced by what accelerates it; its mean force is the static one.
        np.testing.assert_allclose(
            found["mesh_force"].values.mean(axis=0), found["static_mesh_force"].values, rtol=0.01
        )
        inside = found["input_speed"]
        np.testing.assert_allclose(inside.values, rpm * (6000 + 6000 * found["moment"].values), rtol=1e-6)
        assert default_kind(tree.load(), Request()) == "waterfall"
        _, artists = draw(tree, "waterfall", unit=("Hz",))
        # Harmonic 3 of the mesh at the ends of the axis: 3 x 20 per turn, both axes in Hz.
        line = artists["orders"][2]
        np.testing.assert_allclose(line.get_xdata() / line.get_ydata(), 3 * teeth, rtol=1e-9)
        np.testing.assert_allclose(line.get_ydata(), inside.values[[0, -1]] / (2 * np.pi), rtol=1e-9)
        _, artists = draw(tree, "orders")
        np.testing.assert_array_equal(artists["lines"][0].get_ydata(), found["mesh_force_harmonic"].values[:, 0, 0])
        np.testing.assert_allclose(artists["lines"][0].get_xdata(), inside.values / rpm, rtol=1e-12)
    succeeds("plot", out, "-o", picture)
    assert picture.stat().st_size > 10_000
    assert "spectra" in refused("plot", out, "--kind", "spectrum", "-o", picture)
