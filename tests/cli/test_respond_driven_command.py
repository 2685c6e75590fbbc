"""``gearstab respond`` of driven systems: steady states, spectra, status, and what does not fit together."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from click.testing import Result
from scenes import ran, scene_text

from gearstab.config import load
from gearstab.modal import static_equilibrium, static_mesh_force
from gearstab.response import RESPONSE_FLAGS, driven_response, harmonics, steady_state
from gearstab.results import open_result
from gearstab.systems import build

SYSTEM = scene_text("respond_driven_command")
STEADY = SYSTEM + "respond: {mesh_frequency: 1.25, steady_state: true, samples_per_cycle: 40}\n"
HISTORY = SYSTEM + "respond: {mesh_frequency: 1.25, cycles: 6, samples_per_cycle: 20}\n"
FREE = """kind: two_stage
  inertias: [1.0, 0.3, 4.0]
  input_shaft_stiffness: 0
  damping_ratio: 0.05
  load: [1, 0, 0]
"""


def call(tmp_path: Path, text: str, *options: str) -> tuple[Result, Path]:
    path, out = tmp_path / "train.yaml", tmp_path / "out.h5"
    path.write_text(text)
    return ran("respond", path, "-o", out, *options), out


def test_a_steady_state_with_its_harmonics(tmp_path: Path) -> None:
    done, out = call(tmp_path, STEADY)
    assert done.exit_code == 0, done.output
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
    done, out = call(tmp_path, HISTORY)
    assert done.exit_code == 0, done.output
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
    _, out = call(tmp_path, STEADY)
    rows = {}
    for over in ("time", "time,mesh", "frequency", "peak"):
        table = tmp_path / f"{over}.csv"
        done = ran("export", out, "-o", table, "--over", over)
        assert done.exit_code == 0, done.output
        rows[over] = list(csv.DictReader(table.read_text().splitlines()))
    # Coordinates and meshes have a table each, not one of their product.
    assert len(rows["time"]) == len(rows["time,mesh"]) == 81 * 2
    assert {"dof", "displacement", "velocity"} <= set(rows["time"][0])
    assert not {"mesh", "mesh_force", "mesh_force_amplitude"} & set(rows["time"][0])
    assert {"frequency", "mesh", "mesh_force_amplitude"} <= set(rows["frequency"][0])
    assert rows["peak"][0].keys() >= {"peak_mesh", "peak_frequency", "peak_amplitude"}
    with open_result(out) as tree:
        force = tree["response"]["mesh_force"].values
    last = [float(row["mesh_force"]) for row in rows["time,mesh"][-2:]]
    np.testing.assert_array_equal(last, force[-1])
    done = ran("export", out, "-o", tmp_path / "x.csv", "--over", "speed")
    assert done.exit_code == 2
    assert "time,dof; time,mesh; frequency,mesh; peak" in done.stderr
    done = ran("export", out, "-o", tmp_path / "x.csv")
    assert "note: not in the table: mesh_deflection, mesh_force" in done.stderr
    assert "(--over time,mesh)" in done.stderr


def test_a_train_that_accelerates_says_so(tmp_path: Path) -> None:
    mesh = "mean_stiffness: 1.0, epsilon: 0.2, contact_ratio: 1.5"
    free = f"system:\n  {FREE}  meshes: [{{{mesh}}}, {{{mesh}}}]\n"
    done, out = call(tmp_path, free + "respond: {mesh_frequency: 2.0, steady_state: true}\n")
    assert done.exit_code == 0, done.output
    assert "the load accelerates the train as a whole" in done.stderr
    with open_result(out) as tree:
        assert int(tree["response"]["status"]) & RESPONSE_FLAGS["unbalanced"]


def test_no_steady_state_is_an_answer_too(tmp_path: Path) -> None:
    pair = (
        "system: {kind: gear_pair, equivalent_mass: 1.0, load: [1.0],\n"
        "  meshes: [{mean_stiffness: 1.0, epsilon: 0, contact_ratio: 1.5}]}\n"
        "respond: {mesh_frequency: 1.0, steady_state: true}\n"
    )
    done, out = call(tmp_path, pair)
    assert done.exit_code == 0, done.output
    assert "no steady state" in done.stderr
    with open_result(out) as tree:
        assert tree["response"].attrs["status"] == "failed"
        assert tree["response"].sizes["time"] == 0


def test_a_system_that_nothing_drives_needs_an_initial_state(tmp_path: Path) -> None:
    lines = [line for line in SYSTEM.splitlines() if "load" not in line and "forces" not in line]
    free = "\n".join(lines).replace(",\n       transmission_error: {sin: [0.05, 0.02], cos: [0.01]}", "")
    done, _ = call(tmp_path, free + "\nrespond: {mesh_frequency: 1.25, steady_state: true}\n")
    assert done.exit_code == 2
    assert "respond.steady_state: nothing drives the system" in done.stderr
    done, _ = call(tmp_path, free + "\nrespond: {mesh_frequency: 1.25, cycles: 3}\n")
    assert done.exit_code == 2
    assert "initial is missing" in done.stderr


def test_too_many_samples_for_the_memory(tmp_path: Path) -> None:
    done, _ = call(
        tmp_path, STEADY.replace("samples_per_cycle: 40", "samples_per_cycle: 1000000").replace("1/2", "1/997")
    )
    assert done.exit_code == 2
    assert "respond.samples_per_cycle" in done.stderr
    assert "GB" in done.stderr
