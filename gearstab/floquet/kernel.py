"""Which kernel runs, and what a kernel is.

A kernel is a module that offers, for a conservative pattern (see :class:`~gearstab.floquet.segments.Pattern`):

* ``scan(pattern, omega) -> (verdict, growth)``: int8 of UNSTABLE, STABLE, DOUBTFUL and ln max |lambda| a common period,
  both ``(r, P)``, for mesh frequencies ``(r, P)`` in units of the pattern's rate;
* ``monodromy(pattern, row, omega) -> (matrix, scale)``: the monodromy matrix of one row at ``(P,)`` frequencies, for
  what ``scan`` leaves in doubt.
"""

from __future__ import annotations

from types import ModuleType

from gearstab.floquet import numpy_kernel

KERNELS: dict[str, ModuleType] = {"numpy": numpy_kernel}


def name() -> str:
    """The name of the kernel in use."""
    return "numpy"


def current() -> ModuleType:
    """The kernel in use."""
    return KERNELS[name()]
