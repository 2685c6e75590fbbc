"""The compiled kernel, where it was built, and the one place that says which kernel is in use.

Numerical loops in C over contiguous arrays, for any layer to use; NumPy serves instead of them. Environment variables
choose for a whole process, :func:`using` for a part of a program:

* GEARSTAB_KERNEL: ``c`` (compiled, the default where it was built) or ``numpy``;
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
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np

from gearstab.errors import SettingError
from gearstab.interrupts import own

Array = np.ndarray

NAMES = ("numpy", "c")
"""The kernels, the fastest last."""

OUTDATED = "the compiled kernel is older than its sources; run `make install`, or `pip install -e .` once more"

library: ModuleType | None
"""The extension module, or None where it was not built."""

try:
    library = import_module("gearstab.ckernel._kernel")
except ImportError:
    library = None


@dataclass(frozen=True)
class KernelChoice:
    """What a part of a program chose: the kernel's name and the number of threads of a call; None leaves it open."""

    kernel: str | None = None
    threads: int | None = None


_own: ContextVar[KernelChoice | None] = ContextVar("choice", default=None)
_active: dict[object, KernelChoice] = {}
"""Choices of all threads, the latest last: what threads without a choice of their own go by."""
_recorder: ContextVar[set[str] | None] = ContextVar("recorder", default=None)


@contextmanager
def using(kernel: str | None = None, threads: int | None = None) -> Iterator[None]:
    """Use one of the kernels, or so many threads a call, within a ``with`` block, whatever the environment says.

    It holds for the threads that are started inside as well. What is None stays as it was outside.
    """
    outer = _choice()
    choice = KernelChoice(kernel or outer.kernel, threads or outer.threads)
    token, key = _own.set(choice), object()
    _active[key] = choice
    try:
        yield
    finally:
        del _active[key]
        _own.reset(token)


def _choice() -> KernelChoice:
    return _own.get() or next(reversed(_active.values()), KernelChoice())


def available() -> tuple[str, ...]:
    """The kernels that can run here, the fastest last."""
    return NAMES if library is not None else NAMES[:1]


@cache
def outdated() -> bool:
    """Whether the kernel was compiled from other sources than those that lie beside it: an update left it behind."""
    sources = sorted(Path(__file__).parent.rglob("*.[ch]"))
    if library is None or not sources:
        return False
    now = sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:15]
    return not hasattr(library, "sources") or library.sources() != int(now, 16)


def name() -> str:
    """The name of the kernel in use; raises SettingError where the environment asks for one that is not there."""
    asked = _choice().kernel or os.environ.get("GEARSTAB_KERNEL")
    if not asked:
        asked = available()[-1]
    if asked not in NAMES:
        raise SettingError(f"GEARSTAB_KERNEL={asked}: the kernels are {' and '.join(NAMES)}")
    if asked == "c" and outdated():
        raise SettingError(OUTDATED)
    if asked not in available():
        raise SettingError(
            f"GEARSTAB_KERNEL={asked}: the compiled kernel was not built; install a C compiler and gearstab again, "
            "or use numpy"
        )
    return asked


def in_use() -> bool:
    """Whether the compiled kernel is the one in use."""
    return name() == "c"


def threads() -> int:
    """How many threads a call may use; raises SettingError where GEARSTAB_THREADS is no such number."""
    chosen = _choice().threads
    if chosen is not None:
        return chosen
    asked = os.environ.get("GEARSTAB_THREADS")
    if asked:
        if not asked.isdecimal() or int(asked) == 0:
            raise SettingError(f"GEARSTAB_THREADS={asked}: a positive whole number is needed")
        return int(asked)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def simd() -> str:
    """The level of vector instructions in use; raises SettingError where GEARSTAB_SIMD asks for another."""
    if library is None:
        raise ValueError("the compiled kernel was not built")
    levels: list[str] = library.levels()
    asked = os.environ.get("GEARSTAB_SIMD")
    if asked and asked not in levels:
        raise SettingError(f"GEARSTAB_SIMD={asked}: this processor offers {', '.join(levels)}")
    return asked or levels[-1]


def checked() -> str:
    """The name of the kernel in use, with all that the environment says of it. Raises SettingError."""
    if in_use():
        simd()
    threads()
    return name()


@contextmanager
def recorded() -> Iterator[set[str]]:
    """Collect the names of the kernels that compute stability within a ``with`` block."""
    ran: set[str] = set()
    outer = _recorder.get()
    token = _recorder.set(ran)
    try:
        yield ran
    finally:
        _recorder.reset(token)
        if outer is not None:
            outer |= ran


def record(kernel: str) -> None:
    """Tell :func:`recorded` that a kernel runs."""
    ran = _recorder.get()
    if ran is not None:
        ran.add(kernel)


def said(ran: set[str]) -> str:
    """What results say of the kernels that ran: ``c`` where the compiled one took part, ``numpy`` where NumPy did
    everything, ``none`` where stability was not computed.
    """
    return next((kernel for kernel in reversed(NAMES) if kernel in ran), "none")


@contextmanager
def stopping() -> Iterator[None]:
    """Let all calls in all threads end early within a ``with`` block, with :class:`gearstab.interrupts.Stopped`."""
    stop = getattr(library, "stop", lambda _: None)
    stop(1)
    try:
        yield
    finally:
        stop(-1)


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Raise TimeUp where this thread takes more processor time: in :func:`gearstab.interrupts.heed` and the kernel."""
    outer, limit = getattr(own, "end", float("inf")), getattr(library, "limit", lambda _: None)
    own.end = min(outer, time.thread_time() + seconds)
    limit(own.end - time.thread_time())
    try:
        yield
    finally:
        own.end = outer
        limit(outer - time.thread_time())


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


def light_modes(squared: Array, shapes: Array, damping: Array) -> tuple[Array, Array, Array, Array]:
    """Modes of lightly damped states from those of their stiffness: squared frequencies ``(B, n)``, shapes as columns
    and the damping in them ``(B, n, n)``.

    Returns: (values ``(B, 2n)``, X, X^-1, found ``(B,)``), of [[0, 1], [-K, -C]], pairs with the positive imaginary
    part first, columns of X of length 1; meaningless where not found.
    """
    if library is None:
        raise ValueError("the compiled kernel was not built")
    count, n = squared.shape
    given = [np.ascontiguousarray(values, dtype=float) for values in (squared, shapes, damping)]
    values, found = np.empty((count, 2 * n), dtype=complex), np.zeros(count, dtype=np.int8)
    vectors, inverse = np.empty((2, count, 2 * n, 2 * n), dtype=complex)
    if given[0].size:
        library.light_modes(count, n, *given, values, vectors, inverse, found)
    return values, vectors, inverse, found.astype(bool)


def magnus_steps(
    coefficients: Array, length: Array, growth: Array, period: Array, matrix: Array, scale: Array
) -> tuple[Array, Array]:
    """What :func:`gearstab.propagation.products.propagated` says; growth ``(S,)``: the rates taken out of the steps."""
    if library is None:
        raise ValueError("the compiled kernel was not built")
    given = [np.ascontiguousarray(values, dtype=float) for values in (coefficients, length, growth, period)]
    found, taken = np.array(matrix, dtype=float, order="C"), np.array(scale, dtype=float)
    points = len(found)
    library.magnus(simd(), len(given[1]), found.shape[-1], *given[:3], 0, points, points, given[3], found, taken)
    return found, taken


def eigenvalues(matrix: Array) -> Array:
    """Eigenvalues ``(P, m)``, complex, of matrices ``(P, m, m)`` of entries of about one; NaN of one not finite."""
    if library is None:
        raise ValueError("the compiled kernel was not built")
    given = np.ascontiguousarray(matrix, dtype=float)
    count, m = given.shape[:2]
    values = np.empty((count, m), dtype=complex)
    library.eigenvalues(simd(), count, m, 0, count, given, values)
    return values
