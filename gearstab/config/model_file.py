"""Matrices of a model from a file: .npz, HDF5 or MATLAB."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from gearstab.config.axes import Array

REQUIRED = ("mass", "stiffness")
OPTIONAL = ("damping",)
SUFFIXES = (".npz", ".h5", ".hdf5", ".mat")


class ModelFileError(ValueError):
    """A file holds no usable matrices; ``hint`` says what it should hold."""

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.hint = hint


def read_matrices(path: FilePath) -> dict[str, Array]:
    """``mass``, ``stiffness`` and, where given, ``damping`` as float arrays (n, n).

    Sparse matrices of a .mat file are filled. Raises ModelFileError.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise ModelFileError("is no .npz, .h5 or .mat file", f"save the matrices in one of {', '.join(SUFFIXES)}")
    if path.is_dir():
        raise ModelFileError("is a folder", "name a file")
    if not path.exists():
        raise ModelFileError("there is no such file", "the path is relative to the folder of the configuration")
    try:
        found = _read(path)
    except Exception as error:  # each library has errors of its own for a broken file
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ModelFileError(f"cannot be read: {reason}", "save the matrices again") from None
    missing = [name for name in REQUIRED if name not in found]
    if missing:
        present = ", ".join(sorted(name for name in found if not name.startswith("__"))) or "nothing"
        raise ModelFileError(
            f"holds no {' and no '.join(missing)}", f"it needs mass and stiffness, and holds {present}"
        )
    result = {name: _matrix(name, found[name]) for name in REQUIRED + OPTIONAL if name in found}
    shape = result["mass"].shape
    for name, values in result.items():
        if values.shape != shape:
            raise ModelFileError(f"{name} has the shape {values.shape}, mass {shape}", "make them equal")
    return result


def _read(path: FilePath) -> Mapping[str, Any]:
    if path.suffix.lower() == ".npz":
        with np.load(path, allow_pickle=False) as archive:
            return {name: archive[name] for name in archive.files}
    if path.suffix.lower() == ".mat" and not _is_hdf5(path):
        from scipy.io import loadmat

        return dict(loadmat(path, spmatrix=False))
    import h5py

    with h5py.File(path, "r", locking=False) as file:
        found = {name: item[()] for name, item in file.items() if isinstance(item, h5py.Dataset)}
    # MATLAB's own HDF5 files hold the columns of a matrix as its rows.
    return {name: np.transpose(values) for name, values in found.items()} if path.suffix.lower() == ".mat" else found


def _is_hdf5(path: FilePath) -> bool:
    import h5py

    return bool(h5py.is_hdf5(path))


def _matrix(name: str, values: Any) -> Array:
    if hasattr(values, "toarray"):
        values = values.toarray()
    array = np.asarray(values)
    if array.dtype.kind not in "fiu":
        raise ModelFileError(f"{name} holds no real numbers but {array.dtype}", "save a real matrix")
    if array.ndim != 2 or array.shape[0] != array.shape[1] or array.shape[0] == 0:
        raise ModelFileError(f"{name} has the shape {array.shape}", "save a square matrix")
    array = np.ascontiguousarray(array, dtype=float)
    if not np.all(np.isfinite(array)):
        raise ModelFileError(f"{name} holds numbers that are not finite", "save finite numbers")
    return array
