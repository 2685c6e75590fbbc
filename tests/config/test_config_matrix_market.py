"""Matrix Market files of a configuration: read as what they hold, or one line that names the file and the remedy."""

from pathlib import Path

import numpy as np
import pytest
from scipy import sparse
from scipy.io import mmwrite

from gearstab.config import load
from gearstab.systems import build

TEXT = """\
system:
  kind: matrices
  FILES
  meshes: [{direction: [1, -2], mean_stiffness: 1.0, epsilon: 0.3, contact_ratio: 1.5}]
"""
MASS, STIFFNESS = np.diag([1.0, 2.0]), np.array([[3.0, -1.0], [-1.0, 4.0]])


def scene(folder: Path, files: str) -> Path:
    mmwrite(folder / "M.mtx", sparse.coo_array(MASS))
    mmwrite(folder / "K.mtx", sparse.coo_array(STIFFNESS), symmetry="symmetric")
    mmwrite(folder / "C.mtx", 0.1 * STIFFNESS)
    (folder / "scene.yaml").write_text(TEXT.replace("FILES", files))
    return folder / "scene.yaml"


@pytest.mark.parametrize("key", ["files", "file"])
def test_a_file_for_each_matrix(tmp_path: Path, key: str) -> None:
    config = load(scene(tmp_path, key + ": {mass: M.mtx, stiffness: K.mtx, damping: C.mtx}"))
    system = build(config.system)
    np.testing.assert_array_equal(system.mass, MASS)
    np.testing.assert_array_equal(system.stiffness, STIFFNESS)
    np.testing.assert_array_equal(system.damping, 0.1 * STIFFNESS)
    assert "files: {mass: M.mtx, stiffness: K.mtx, damping: C.mtx}" in config.resolved
    (tmp_path / "again.yaml").write_text(config.resolved)
    assert load(tmp_path / "again.yaml").digest == config.digest
    mmwrite(tmp_path / "M.mtx", 2 * MASS)
    assert load(tmp_path / "again.yaml").digest != config.digest
