"""Numbers that no gear has are refused by ``check``; what passes can be computed."""

from __future__ import annotations

import pytest
from scenes import ran

from gearstab.config import ConfigError, load
from gearstab.config.model.values import LARGEST_NUMBER, LARGEST_RATIO, SMALLEST_NUMBER

TRAIN = """\
system:
  kind: two_stage
  inertias: [1.0, 0.3, 4.0]
  input_shaft_stiffness: 0.5
  damping_ratio: 0.01
  meshes:
    - {mean_stiffness: 1.0, epsilon: 0.3, contact_ratio: 1.5}
    - {mean_stiffness: 1.0, epsilon: 0.3, contact_ratio: 1.5, phasing: 0.1}
sweep: {mesh_frequency: [1.0, 2.0]}
methods: {floquet: {}, perturbation: {}}
respond: {mesh_frequency: 1.0, cycles: 2, initial: {displacement: [1, 0, 0]}}
"""
MATRICES = """\
system:
  kind: matrices
  mass: [[1.0, 1.0e-40], [1.0e-40, 2.0]]
  stiffness: [[1.0, 0], [0, 1.0e-90]]
  meshes: [{direction: [1, 1], mean_stiffness: 1.0, epsilon: 0.3, contact_ratio: 1.5}]
sweep: {mesh_frequency: [1.0, 2.0]}
methods: {floquet: {}}
"""

ABSURD = [
    (TRAIN, "sweep.mesh_frequency.0=1e99", "sweep.mesh_frequency.0"),
    (TRAIN, "sweep.mesh_frequency.0=1e-90", "sweep.mesh_frequency.0"),
    (TRAIN, "sweep.mesh_frequency.0=1e-15", "sweep.mesh_frequency"),
    (TRAIN, "respond.mesh_frequency=1e-90", "respond.mesh_frequency"),
    (TRAIN, "respond.mesh_frequency=1e-15", "respond.mesh_frequency"),
    (TRAIN, "inertias.1=1e-150", "system.inertias.1"),
    (TRAIN, "inertias.1=1e99", "system.inertias.1"),
    (TRAIN, "input_shaft_stiffness=1e99", "system.input_shaft_stiffness"),
    (TRAIN, "meshes.first.mean_stiffness=1e-99", "system.meshes.0.mean_stiffness"),
    (TRAIN, "tooth_ratio=1/999999999", "system.tooth_ratio"),
    (TRAIN, "tooth_ratio=999999999", "system.tooth_ratio"),
    (TRAIN, "phasing=1e99", "system.meshes.1.phasing"),
    (MATRICES, "mass.0.0=1e-150", "system.mass"),
    (MATRICES, "mass.0.0=1e150", "system.mass.0.0"),
    (MATRICES, "meshes.0.frequency_ratio=1/999999999", "system.meshes.0.frequency_ratio"),
    (MATRICES, "meshes.0={exact: false, frequency_ratio: 1e-9, direction: [1, 1], mean_stiffness: 1, epsilon: 0.1, "
     "contact_ratio: 1.5}", "system.meshes.0.frequency_ratio"),
]  # fmt: skip


def names(text, override):
    return override.replace("meshes.first", "meshes.0") if text is TRAIN else override


@pytest.mark.parametrize(("text", "override", "path"), ABSURD, ids=[override[:40] for _, override, _ in ABSURD])
def test_what_no_gear_is(tmp_path, text, override, path):
    scene = tmp_path / "scene.yaml"
    scene.write_text(text)
    load(scene)
    with pytest.raises(ConfigError) as caught:
        load(scene, [names(text, override)])
    assert path in {problem.path for problem in caught.value.problems}


EXTREMES = [LARGEST_NUMBER, SMALLEST_NUMBER, 1e12, 1e-12, 0.0]
RATIOS = [LARGEST_RATIO / 10, f"10/{LARGEST_RATIO}"]
KEYS = ["inertias.0", "inertias.1", "input_shaft_stiffness", "meshes.0.mean_stiffness", "damping_ratio", "phasing"]
KEYS += ["meshes.1.damping", "sweep.mesh_frequency.0", "sweep.mesh_frequency.1", "tooth_ratio"]


@pytest.mark.parametrize("key", KEYS)
def test_what_passes_can_be_computed(tmp_path, key):
    """At the limits and between: numbers, or a line that says why there are none, and no warning of NumPy."""
    scene, out = tmp_path / "scene.yaml", tmp_path / "out.h5"
    scene.write_text(TRAIN)
    passed = []
    for value in RATIOS if key == "tooth_ratio" else EXTREMES:
        changes = ["--set", f"{key}={value}"]
        checked = ran("check", scene, *changes)
        assert checked.exit_code in (0, 2), value
        swept = ran("sweep", scene, "-o", out, "--overwrite", "-j", "1", *changes)
        assert swept.exit_code == checked.exit_code, (value, swept.output)
        passed.append(checked.exit_code == 0)
    assert any(passed)
