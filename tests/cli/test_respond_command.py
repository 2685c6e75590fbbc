"""``gearstab respond``: from a configuration to a result file with time histories."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from click.testing import Result
from scenes import ran, scene_text, written

from gearstab.config import load
from gearstab.floquet import solve
from gearstab.response import free_response
from gearstab.results import open_result
from gearstab.systems import build

CONFIG = scene_text("respond_command")


@pytest.fixture
def config(tmp_path: Path) -> Path:
    return written(tmp_path, CONFIG, "train.yaml")


def call(*arguments: str | Path) -> Result:
    return ran("respond", *arguments)


def test_the_file_holds_the_histories_with_units(config: Path, tmp_path: Path) -> None:
    out = tmp_path / "new" / "out.h5"
    done = call(config, "-o", out)
    assert done.exit_code == 0, done.output
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
    assert call(config, "-o", out).exit_code == 0
    with h5py.File(out) as file:
        displacement = file["response/displacement"]
        assert displacement.shape == (51, 2)
        assert displacement.dims[0][0].name == "/response/time"
        assert displacement.attrs["units"] == "m"


def test_the_default_file_is_not_that_of_a_sweep(config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert call(config, "--quiet").stderr == ""
    assert [path.name for path in (tmp_path / "results").iterdir()] == ["train.response.h5"]


def test_values_can_be_replaced(config: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.h5"
    given = ["--set", "respond.cycles=2", "--set", "meshes.fast.epsilon=0", "--set", "meshes.slow.epsilon=0"]
    done = call(config, "-o", out, *given)
    assert done.exit_code == 0, done.output
    with open_result(out) as tree:
        energy = tree["response"]["energy"].values
    assert len(energy) == 21
    np.testing.assert_allclose(energy, 0.5 * 2.0 * 0.2**2, rtol=1e-13)


def test_a_duration_instead_of_cycles(config: Path, tmp_path: Path) -> None:
    config.write_text(CONFIG.replace("cycles: 5", "duration: 10.0"))
    out = tmp_path / "out.h5"
    assert call(config, "-o", out).exit_code == 0
    with open_result(out) as tree:
        time = tree["response"]["time"].values
    step = 2 * np.pi / 1.25 / 10
    # The last sample is the last one that is not after the end.
    assert 10.0 - step < time[-1] <= 10.0
    np.testing.assert_allclose(np.diff(time), step, rtol=1e-12)


def test_an_overflow_is_said(config: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.h5"
    given = ["allow_negative_stiffness=true", "meshes.fast.epsilon=3", "respond.cycles=1000"]
    done = call(config, "-o", out, *(part for text in given for part in ("--set", text)))
    assert done.exit_code == 0, done.output
    assert "outgrew double precision" in done.stderr
    with open_result(out) as tree:
        assert tree["response"].attrs["status"] == "overflow"
        assert np.isfinite(tree["response"]["energy"].values).all()


def test_a_configuration_without_the_section(config: Path, tmp_path: Path) -> None:
    config.write_text(CONFIG[: CONFIG.index("respond:")] + "sweep: {mesh_frequency: [1.0]}\nmethods: {floquet: {}}\n")
    done = call(config, "-o", tmp_path / "out.h5")
    assert done.exit_code == 2
    assert done.stderr.count("\n") == 1
    assert f"{config}:1: respond: is missing; add the section respond: mesh_frequency, cycles" in done.stderr
