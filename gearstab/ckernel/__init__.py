"""The compiled kernel, where it was built: numerical loops in C over contiguous arrays, for any layer to use.

The environment variable GEARSTAB_SIMD (plain, avx2, avx512) limits the vector instructions used, which by default are
the best that the processor has.
"""

from __future__ import annotations

import os
from importlib import import_module
from types import ModuleType

import numpy as np

from gearstab.errors import SettingError

Array = np.ndarray

library: ModuleType | None
"""The extension module, or None where it was not built."""

try:
    library = import_module("gearstab.ckernel._kernel")
except ImportError:
    library = None


def in_use() -> bool:
    """Whether it was built, and the environment does not ask for NumPy (GEARSTAB_KERNEL=numpy)."""
    return library is not None and os.environ.get("GEARSTAB_KERNEL") != "numpy"


def symmetric_eigen(matrix: Array) -> tuple[Array, Array]:
    """Eigenvalues ``(..., n)`` ascending and orthonormal eigenvectors ``(..., n, n)`` by cyclic Jacobi rotations."""
    if library is None:
        raise ValueError("the compiled kernel was not built")
    given = np.ascontiguousarray(matrix, dtype=float)
    n = given.shape[-1]
    values, vectors = np.empty(given.shape[:-1]), np.empty(given.shape)
    if given.size:
        library.symmetric(simd(), given.size // n**2, n, given, values, vectors)
    return values, vectors


def simd() -> str:
    """The level of vector instructions in use; raises SettingError where GEARSTAB_SIMD asks for another."""
    if library is None:
        raise ValueError("the compiled kernel was not built")
    available: list[str] = library.levels()
    asked = os.environ.get("GEARSTAB_SIMD")
    if asked and asked not in available:
        raise SettingError(f"GEARSTAB_SIMD={asked}: this processor offers {', '.join(available)}")
    return asked or available[-1]
