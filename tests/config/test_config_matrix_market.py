"""Matrix Market files of a configuration: read as what they hold, or one line that names the file and the remedy."""

from pathlib import Path

import numpy as np
import pytest
from scipy import sparse
from scipy.io import mmwrite

from gearstab.config import ConfigError, load
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
    mmwrite(folder / "wide.mtx", np.ones((2, 3)))
    mmwrite(folder / "large.mtx", np.eye(3))
    mmwrite(folder / "skew.mtx", np.array([[1.0, 2.0], [3.0, 1.0]]))
    mmwrite(folder / "half.mtx", np.array([[1.0, 2.0], [0.0, 1.0]]))
    (folder / "broken.mtx").write_text("mass")
    (folder / "huge.mtx").write_text("%%MatrixMarket matrix coordinate real general\n1000000 1000000 1\n1 1 1\n")
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


MISTAKES = [
    ("file: M.mtx", "system.file", "data_file", "files: {mass"),
    ("files: {mass: M.mtx}", "system.files.stiffness", "missing", "add stiffness"),
    ("files: {mass: M.mtx, stiffness: K.npz}", "system.files.stiffness", "file", ".mtx"),
    ("files: {mass: M.mtx, stiffness: none.mtx}", "system.files.stiffness", "file", "relative to the folder"),
    ("files: {mass: M.mtx, stiffness: broken.mtx}", "system.files.stiffness", "file", "again"),
    ("files: {mass: M.mtx, stiffness: wide.mtx}", "system.files.stiffness", "file", "square"),
    ("files: {mass: huge.mtx, stiffness: K.mtx}", "system.files.mass", "file", "at most 4000"),
    ("files: {mass: M.mtx, stiffness: large.mtx}", "system.files.stiffness", "file", "equal"),
    ("files: {mass: skew.mtx, stiffness: K.mtx}", "system.files.mass", "matrix", "equal"),
    ("files: {mass: M.mtx, stiffness: half.mtx}", "system.files.stiffness", "file", "both triangles"),
    ("files: {mass: M.mtx, stiffness: K.mtx, dumping: C.mtx}", "system.files.dumping", "unknown_key", "damping"),
    ("files: {mass: M.mtx, stiffness: K.mtx}\n  mass: [[1, 0], [0, 1]]", "system.mass", "already_given", "keep one"),
]


@pytest.mark.parametrize(("files", "path", "code", "hint"), MISTAKES, ids=[item[0] for item in MISTAKES])
def test_mistakes_are_one_line(tmp_path: Path, files: str, path: str, code: str, hint: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load(scene(tmp_path, files))
    (problem,) = caught.value.problems
    assert (problem.path, problem.code.replace("data_file", "file")) == (path, code.replace("data_file", "file"))
    assert hint in problem.hint
