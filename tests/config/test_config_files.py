"""Files that a configuration names: damaged ones, pipes and declared sizes of terabytes come to one line."""

import contextlib
import os
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pytest
from scenes import scene_text, written
from scipy import sparse
from scipy.io import mmwrite, savemat

from gearstab.config import ConfigError, load
from gearstab.systems import build

MODEL = scene_text("config_files_model")
SAMPLES = scene_text("config_files_samples")
OF_MODEL = {"mass": np.eye(2), "stiffness": np.diag([1.0, 0.0])}
OF_SAMPLES = {"phase": np.array([0.0, 0.3, 0.6]), "stiffness": np.array([1.0, 2.0, 3.0])}
FILES = [(MODEL, "model.npz"), (MODEL, "model.h5"), (MODEL, "model.mat"), (SAMPLES, "k.h5"), (SAMPLES, "k.csv")]
IDS = [name for _, name in FILES]


def save(path: Path, content) -> None:
    if path.suffix == ".npz":
        np.savez(path, **content)
    elif path.suffix == ".mat":
        savemat(path, content)
    elif path.suffix == ".csv":
        path.write_text("phase,stiffness\n" + "\n".join(f"{p},{k}" for p, k in zip(*content.values(), strict=True)))
    else:
        with h5py.File(path, "w") as file:
            file.update(content)


def problem(folder: Path, text: str, name: str):
    path = written(folder, text.replace("NAME", name), "scene.yaml")
    with pytest.raises(ConfigError) as caught:
        load(path)
    (found,) = caught.value.problems
    assert found.path.endswith("file")
    assert len(str(found)) < 600
    return found


def content_of(text: str):
    return OF_MODEL if text is MODEL else OF_SAMPLES


@pytest.mark.parametrize(("text", "name"), FILES, ids=IDS)
def test_damaged_files(tmp_path, text, name):
    """Every one of a few hundred damages of a file is read as before or named in one line."""
    path = tmp_path / name
    save(path, content_of(text))
    data = path.read_bytes()
    scene = written(tmp_path, text.replace("NAME", name), "scene.yaml")
    load(scene)
    random = np.random.default_rng(1)
    for k in range(4 if text is MODEL and name.endswith(".mat") else 120):  # a process for each of those
        broken = bytearray(data)
        if k % 4 == 0:
            del broken[int(random.integers(len(data))) :]
        else:
            for place in random.integers(len(data), size=k % 4):
                broken[place] = random.integers(256)
        path.write_bytes(broken)
        with contextlib.suppress(ConfigError):
            load(scene)


def test_a_reader_that_crashes(tmp_path):
    """With an unknown type of number SciPy's reader looks beyond its table of types."""
    path = tmp_path / "model.mat"
    savemat(path, OF_MODEL)
    data = bytearray(path.read_bytes())
    place = data.index(b"mass") + 4
    assert data[place] == 9  # double precision
    data[place] = 178
    path.write_bytes(data)
    assert "cannot be read" in problem(tmp_path, MODEL, "model.mat").message


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with a name")
@pytest.mark.parametrize(("text", "name"), FILES, ids=IDS)
def test_pipes_are_refused(tmp_path, text, name):
    os.mkfifo(tmp_path / name)
    assert "no regular file" in problem(tmp_path, text, name).message


@pytest.mark.parametrize("text", [MODEL, SAMPLES], ids=["model", "samples"])
def test_declared_sizes_of_terabytes(tmp_path, text):
    """Declared arrays are not stored: such a file has some kilobytes."""
    path = tmp_path / "big.h5"
    first = next(iter(content_of(text)))
    with h5py.File(path, "w") as file:
        file.update(content_of(text))
        del file[first]
        shape = (10**6, 10**6) if text is MODEL else (10**12,)
        file.create_dataset(first, shape=shape, dtype="f8", chunks=shape[:0] + (1000,) * len(shape))
    assert path.stat().st_size < 100_000
    found = problem(tmp_path, text, "big.h5")
    assert "shape" in found.message


def test_declared_sizes_in_archives(tmp_path):
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000, 1000000), }"
    header += b" " * (118 - len(header) - 1) + b"\n"
    with zipfile.ZipFile(tmp_path / "model.npz", "w") as archive:
        for name in OF_MODEL:
            archive.writestr(f"{name}.npy", b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header)
    assert "(1000000, 1000000)" in problem(tmp_path, MODEL, "model.npz").message


def test_declared_sizes_in_files_of_matlab(tmp_path):
    path = tmp_path / "model.mat"
    savemat(path, OF_MODEL)
    data = path.read_bytes()
    two = (2).to_bytes(4, "little")
    place = data.index(two + two)
    path.write_bytes(data[:place] + 2 * (10**6).to_bytes(4, "little") + data[place + 8 :])
    assert "(1000000, 1000000)" in problem(tmp_path, MODEL, "model.mat").message


def test_tables_of_many_megabytes(tmp_path):
    (tmp_path / "k.csv").write_text("0.0,1.0\n" * 1_000_000)
    assert "4 MB" in problem(tmp_path, SAMPLES, "k.csv").message


def test_data_in_other_files_is_not_looked_at(tmp_path):
    save(tmp_path / "other.h5", OF_MODEL)
    with h5py.File(tmp_path / "model.h5", "w") as file:
        file["mass"] = OF_MODEL["mass"]
        file["stiffness"] = h5py.ExternalLink("other.h5", "stiffness")
        file["dangling"] = h5py.SoftLink("/nowhere")
    assert "holds no stiffness" in problem(tmp_path, MODEL, "model.h5").message


@pytest.mark.parametrize("name", ["n" * 300 + ".npz", "none/model.npz", "scene.yaml/model.npz", "model.npz/"])
def test_names_that_are_no_file(tmp_path, name):
    problem(tmp_path, MODEL, name)


# --- Matrix Market files of a configuration: read as what they hold, or one line that names the file and the remedy


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
