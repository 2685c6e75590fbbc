"""Run-ups on the command line: what is read, written and drawn."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import Result
from scenes import ran, scene_text, written

from gearstab.plots import default_kind, draw
from gearstab.plots.view import Request
from gearstab.results import open_result

CONFIG = scene_text("respond_ramp_command")


@pytest.fixture
def config(tmp_path: Path) -> Path:
    return written(tmp_path, CONFIG, "pair.yaml")


def call(*arguments: str | Path) -> Result:
    return ran(*arguments)


def test_a_run_up_is_written_and_drawn_over_the_speed_that_was_typed(config: Path, tmp_path: Path) -> None:
    out, picture = tmp_path / "out.h5", tmp_path / "out.png"
    done = call("respond", config, "-o", out)
    assert done.exit_code == 0, done.output
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
    assert call("plot", out, "-o", picture).exit_code == 0
    assert picture.stat().st_size > 10_000
    refused = call("plot", out, "--kind", "spectrum", "-o", picture)
    assert refused.exit_code == 2
    assert "spectra" in refused.stderr
