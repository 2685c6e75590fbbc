"""The compiled kernel: numerical loops in C over contiguous arrays, for any layer to use.

Environment variables choose for a whole process, :func:`using` for a part of a program:

* GEARSTAB_SIMD: ``plain``, ``avx2`` or ``avx512``, a limit of the vector instructions used, by default the best
  that the processor has;
* GEARSTAB_THREADS: how many threads a call may use, by default one for each processor.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from gearstab.errors import SettingError
from gearstab.interrupts import own

Array = np.ndarray

MISSING = "the compiled kernel is missing; install gearstab again, where there is no C compiler with the wheel ziglang"
OUTDATED = "the compiled kernel is older than its sources; run `make install`, or `pip install -e .` once more"
GONE = "the kernel is the compiled one; there is none in NumPy any more"


def _loaded() -> Any:
    """Return the extension module. Raises SettingError where it was not built."""
    try:
        return import_module("gearstab.ckernel._kernel")
    except ImportError:
        raise SettingError(MISSING) from None


library = _loaded()

_own: ContextVar[int | None] = ContextVar("threads", default=None)
_active: dict[object, int] = {}
"""Choices of all threads, the latest last: what threads without a choice of their own go by."""


@contextmanager
def using(threads: int) -> Iterator[None]:
    """Use so many threads a call within a ``with`` block and in threads started inside."""
    token, key = _own.set(threads), object()
    _active[key] = threads
    try:
        yield
    finally:
        del _active[key]
        _own.reset(token)


@cache
def outdated() -> bool:
    """Whether the kernel was compiled from other sources than those that lie beside it: an update left it behind."""
    sources = sorted(Path(__file__).parent.rglob("*.[ch]"))
    now = sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:15]
    return bool(sources) and (not hasattr(library, "sources") or library.sources() != int(now, 16))


def threads() -> int:
    """How many threads a call may use; raises SettingError where GEARSTAB_THREADS is no such number."""
    chosen = _own.get() or next(reversed(_active.values()), None)
    if chosen is not None:
        return chosen
    asked = os.environ.get("GEARSTAB_THREADS")
    if asked:
        if not asked.isdecimal() or int(asked) == 0:
            raise SettingError(f"GEARSTAB_THREADS={asked}: a positive whole number is needed")
        return int(asked)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def simd() -> str:
    """The level of vector instructions in use.

    Raises SettingError where GEARSTAB_SIMD asks for another, GEARSTAB_KERNEL for another kernel, or this is outdated.
    """
    kernel = os.environ.get("GEARSTAB_KERNEL")
    if kernel and kernel != "c":
        raise SettingError(f"GEARSTAB_KERNEL={kernel}: {GONE}")
    if outdated():
        raise SettingError(OUTDATED)
    levels: list[str] = library.levels()
    asked = os.environ.get("GEARSTAB_SIMD")
    if asked and asked not in levels:
        raise SettingError(f"GEARSTAB_SIMD={asked}: this processor offers {', '.join(levels)}")
    return asked or levels[-1]


def check() -> None:
    """Raise SettingError where the environment asks for what is not there."""
    simd()
    threads()


@contextmanager
def stopping() -> Iterator[None]:
    """Let all calls in all threads end early within a ``with`` block, with :class:`gearstab.interrupts.Stopped`."""
    library.stop(1)
    try:
        yield
    finally:
        library.stop(-1)


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Raise TimeUp where this thread takes more processor time: in :func:`gearstab.interrupts.heed` and the kernel."""
    outer = getattr(own, "end", float("inf"))
    own.end = min(outer, time.thread_time() + seconds)
    library.limit(own.end - time.thread_time())
    try:
        yield
    finally:
        own.end = outer
        library.limit(outer - time.thread_time())


def symmetric_eigen(matrix: Array) -> tuple[Array, Array]:
    """Eigenvalues ``(..., n)`` ascending and orthonormal eigenvectors ``(..., n, n)`` by cyclic Jacobi rotations."""
    given = np.ascontiguousarray(matrix, dtype=float)
    n = given.shape[-1]
    values, vectors = np.empty(given.shape[:-1]), np.empty(given.shape)
    if given.size:
        library.symmetric(simd(), given.size // n**2, n, given, values, vectors)
    return values, vectors


def light_modes(squared: Array, shapes: Array, damping: Array) -> tuple[Array, Array, Array, Array]:
    """Modes of lightly damped states from those of their stiffness: squared frequencies ``(B, n)``, shapes as columns
    and the damping in them ``(B, n, n)``.

    Returns: (values ``(B, 2n)``, X, X^-1, found ``(B,)``), of [[0, 1], [-K, -C]], pairs with the positive imaginary
    part first, columns of X of length 1; meaningless where not found.
    """
    count, n = squared.shape
    given = [np.ascontiguousarray(values, dtype=float) for values in (squared, shapes, damping)]
    values, found = np.empty((count, 2 * n), dtype=complex), np.zeros(count, dtype=np.int8)
    vectors, inverse = np.empty((2, count, 2 * n, 2 * n), dtype=complex)
    if given[0].size:
        library.light_modes(count, n, *given, values, vectors, inverse, found)
    return values, vectors, inverse, found.astype(bool)


def eigenvalues(matrix: Array) -> Array:
    """Eigenvalues ``(P, m)``, complex, of matrices ``(P, m, m)`` of entries of about one; NaN of one not finite."""
    given = np.ascontiguousarray(matrix, dtype=float)
    count, m = given.shape[:2]
    values = np.empty((count, m), dtype=complex)
    if given.size:
        library.eigenvalues(simd(), count, m, 0, count, given, values)
    return values


def exponentials(matrix: Array) -> Array:
    """exp(A) of matrices ``(P, m, m)`` by scaling and squaring, each with the scaling it needs; NaN of one not finite.

    Twelve terms of the Taylor polynomial by five products (Paterson & Stockmeyer 1973).
    """
    given = np.ascontiguousarray(matrix, dtype=float)
    count, m = given.shape[:2]
    result = np.empty(given.shape)
    if given.size:
        library.exponentials(simd(), count, m, 0, count, given, result)
    return result
