"""Numbers that no gear has are refused by ``check``; what passes can be computed."""

from __future__ import annotations

import pytest
from scenes import ran, scene_text, written

from gearstab.config.model.fields import LARGEST_NUMBER, LARGEST_RATIO, SMALLEST_NUMBER

TRAIN = scene_text("absurd_numbers_train")


EXTREMES = [LARGEST_NUMBER, SMALLEST_NUMBER, 1e12, 1e-12, 0.0]
RATIOS = [LARGEST_RATIO / 10, f"10/{LARGEST_RATIO}"]
KEYS = ["inertias.0", "inertias.1", "input_shaft_stiffness", "meshes.0.mean_stiffness", "damping_ratio", "phasing"]
KEYS += ["meshes.1.damping", "sweep.mesh_frequency.0", "sweep.mesh_frequency.1", "tooth_ratio"]


@pytest.mark.parametrize("key", KEYS)
def test_what_passes_can_be_computed(tmp_path, key):
    """At the limits and between: numbers, or a line that says why there are none, and no warning of NumPy."""
    scene, out = written(tmp_path, TRAIN, "scene.yaml"), tmp_path / "out.h5"
    passed = []
    for value in RATIOS if key == "tooth_ratio" else EXTREMES:
        changes = ["--set", f"{key}={value}"]
        checked = ran("check", scene, *changes)
        assert checked.exit_code in (0, 2), value
        swept = ran("sweep", scene, "-o", out, "--overwrite", "-j", "1", *changes)
        assert swept.exit_code == checked.exit_code, (value, swept.output)
        passed.append(checked.exit_code == 0)
    assert any(passed)
