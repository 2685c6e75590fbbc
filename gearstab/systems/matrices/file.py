"""Matrices of a model from a file: .npz, HDF5 or MATLAB."""

from __future__ import annotations

from pathlib import Path as FilePath

from gearstab.config.document.files import DataFileError, arrays, numbers, present, usable
from gearstab.config.model.axes import Array

REQUIRED = ("mass", "stiffness")
OPTIONAL = ("damping",)
SUFFIXES = (".npz", ".h5", ".hdf5", ".mat")
MOST_COORDINATES = 4000
"""A matrix of so many takes 128 MB."""


def read_matrices(path: FilePath) -> dict[str, Array]:
    """``mass``, ``stiffness`` and, where given, ``damping`` as float arrays (n, n).

    Sparse matrices of a .mat file are filled. Raises DataFileError.
    """
    usable(path, ".npz, .h5 or .mat", SUFFIXES)
    found = arrays(path, REQUIRED + OPTIONAL, MOST_COORDINATES)
    missing = [name for name in REQUIRED if found.get(name) is None]
    if missing:
        message = f"holds no {' and no '.join(missing)}"
        raise DataFileError(message, f"it needs mass and stiffness, and holds {present(found)}")
    result = {name: numbers(name, found[name]) for name in REQUIRED + OPTIONAL if found.get(name) is not None}
    for name, values in result.items():
        if values.ndim != 2 or values.shape[0] != values.shape[1] or values.shape[0] == 0:
            raise DataFileError(f"{name} has the shape {values.shape}", "save a square matrix")
    shape = result["mass"].shape
    for name, values in result.items():
        if values.shape != shape:
            raise DataFileError(f"{name} has the shape {values.shape}, mass {shape}", "make them equal")
    return result
