"""Multipliers of few segments with very different decay, against those in many digits and against the periodic QR."""

from __future__ import annotations

import os
import re
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import mpmath as mp
import numpy as np
import numpy_kernel
import pytest

from gearstab import ckernel
from gearstab.floquet.boundaries import names
from gearstab.floquet.boundaries.counting import points
from gearstab.floquet.kernel import factors as levels
from gearstab.floquet.kernel.c_kernel import graded
from gearstab.floquet.kernel.damped import Generators, factors, generators
from gearstab.floquet.kernel.threads import WORTH_A_THREAD, in_threads
from gearstab.floquet.segments.pattern import Pattern, prepare
from gearstab.mesh import Mesh
from gearstab.system import Array, GearSystem
from gearstab.waveforms import Rectangular


def chain(n: int, damping: float, meshes: int = 1, epsilon: float = 0.3) -> tuple[Pattern, Generators]:
    """A chain of n inertias between n springs, whose damping follows the stiffness, and meshes between some of them."""
    stiffness = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    gauges = [np.eye(n)[k] + np.eye(n)[k + 1] for k in range(meshes)]
    each = [Mesh(f"mesh {k}", g, np.asarray(1.5), np.asarray(epsilon), Rectangular(1.4)) for k, g in enumerate(gauges)]
    system = GearSystem(np.eye(n), stiffness, tuple(each), damping * stiffness)
    (pattern,) = prepare(system)
    return pattern, generators(pattern)


def in_many_digits(generator: Generators, pattern: Pattern, omega: float) -> Array:
    """ln |lambda|, descending, from exponentials of all segments in many digits."""
    durations = pattern.durations(0, np.array([omega]))[:, 0]
    decay = -(np.trace(generator.matrix[0, pattern.states], axis1=1, axis2=2) @ durations)
    with mp.workdps(40 + int(decay)):
        product = mp.eye(generator.matrix.shape[-1])
        for state, duration in zip(pattern.states, durations, strict=True):
            product = mp.expm(mp.matrix(generator.matrix[0, state].tolist()) * mp.mpf(duration)) * product
        values = mp.eig(product, left=False, right=False)
        return np.sort([float(mp.log(abs(value))) for value in values])[::-1]


@pytest.mark.parametrize(("damping", "omega"), [(0.4, 0.05), (0.1, 0.02), (0.05, 0.2), (0.02, 0.9)])
@pytest.mark.parametrize("meshes", [1, 2])
def test_multipliers_are_those_in_many_digits(damping: float, omega: float, meshes: int) -> None:
    pattern, generator = chain(3, damping, meshes)
    found = levels.log_multipliers(pattern, generator, 0, np.array([omega]))[0]
    expected = in_many_digits(generator, pattern, omega)
    # A digit more than the sixteen of a product of two matrices, relative to the largest |ln lambda|.
    np.testing.assert_allclose(found.real, expected, rtol=0, atol=1e-13 * max(10.0, abs(expected[-1])))


@pytest.mark.parametrize("omega", [0.02, 0.3, 1.1])
def test_multipliers_are_those_of_the_periodic_qr(omega: float) -> None:
    pattern, generator = chain(12, 0.05, 2, 0.02)
    found = levels.log_multipliers(pattern, generator, 0, np.array([omega]))[0]
    pieces, growing = factors(generator, pattern, 0, np.array([omega]), spread=1.0)
    expected = graded(pieces)[0] + growing[0]
    # Hundreds of factors, each of which is good for some 1e-14.
    np.testing.assert_allclose(np.sort(found.real), np.sort(expected.real), rtol=0, atol=1e-12 * len(pieces))


def test_what_fails_a_check_is_left_to_the_periodic_qr(monkeypatch: pytest.MonkeyPatch) -> None:
    pattern, generator = chain(6, 0.1)
    omega = np.array([[0.05, 0.3]])
    expected = numpy_kernel.log_multipliers_damped(pattern, generator, omega)
    for name, value in (("MOST_GROWN", 1e-3), ("AGREEMENT", -1.0)):
        with monkeypatch.context() as patch:
            patch.setattr(levels, name, value)
            assert np.isnan(levels.log_multipliers(pattern, generator, 0, omega[0])).all()
            found = numpy_kernel.log_multipliers_damped(pattern, generator, omega)
        np.testing.assert_allclose(np.sort(found.real), np.sort(expected.real), rtol=0, atol=1e-9)


def test_time_that_runs_backwards_is_left_to_the_periodic_qr() -> None:
    pattern, generator = chain(3, 0.1)
    assert np.isnan(levels.log_multipliers(pattern, generator, 0, np.array([-0.3]))).all()


# --- rows of a call in pieces on threads: each once, whoever else asks, and whatever fails


MOST = max(os.cpu_count() or 1, ckernel.threads())


def _counted(rows: int, limit: int) -> tuple[np.ndarray, set[int]]:
    """How often each row was computed, and by which threads."""
    found, by = np.zeros(rows, dtype=int), set()

    def part(first: int, last: int) -> None:
        found[first:last] += 1
        by.add(threading.get_ident())

    in_threads(part, rows, WORTH_A_THREAD, limit)
    return found, by


@pytest.mark.parametrize("rows", [1, 2, 7, 100, 1001])
@pytest.mark.parametrize("limit", [1, 2, 3])
def test_every_row_once(rows: int, limit: int) -> None:
    found, by = _counted(rows, limit)
    assert np.all(found == 1)
    assert len(by) <= limit


def test_threads_are_kept() -> None:
    """The first call starts them, at most."""
    _counted(100, 2)
    helpers = {thread for thread in threading.enumerate() if thread.name.startswith("gearstab kernel")}
    for _ in range(50):
        _counted(100, 2)
    assert all(thread.is_alive() for thread in helpers)
    assert sum(thread.name.startswith("gearstab kernel") for thread in threading.enumerate()) <= MOST


def test_more_callers_than_helpers() -> None:
    with ThreadPoolExecutor(8) as pool:
        for found, _ in pool.map(lambda _: _counted(200, 3), range(100)):
            assert np.all(found == 1)


@pytest.mark.parametrize("at", [0, 50, 99])
def test_what_a_piece_raises_is_raised(at: int) -> None:
    def part(first: int, last: int) -> None:
        if first <= at < last:
            raise IndexError("of the piece itself")

    with pytest.raises(IndexError, match="of the piece itself"):
        in_threads(part, 100, WORTH_A_THREAD, 2)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there are no forks")
@pytest.mark.filterwarnings("ignore:.*fork")
def test_a_fork_computes_alone() -> None:
    """The threads that wait are not in it."""
    _counted(100, 2)
    child = os.fork()
    if child == 0:
        os._exit(0 if np.all(_counted(100, 2)[0] == 1) else 1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


# --- numbers by which both the compiled search and Python decide: a drift would change verdicts


SOURCES = Path(ckernel.__file__).parent / "boundaries"

SHARED = [
    ("naming/actions.h", "BAND", names.BAND), ("naming/actions.h", "LEADING", names.LEADING),
    ("naming/actions.h", "LEAST", names.LEAST),
    ("naming/actions.h", "LARGEST_MATRIX", points.LARGEST), ("search.h", "LARGEST", points.LARGEST),
]  # fmt: skip


@pytest.mark.parametrize(("file", "name", "value"), SHARED, ids=[f"{file}:{name}" for file, name, _ in SHARED])
def test_constants_agree(file: str, name: str, value: float) -> None:
    found = re.findall(rf"^#define {name} (\S+)", (SOURCES / file).read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert [float(text) for text in found] == [value]
