"""Rows of many mesh frequencies, in part interpolated by the compiled kernel (ckernel/undamped/stretches.h)."""

from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction

import mpmath as mp
import numpy as np
import numpy_kernel
import pytest
from oracle import plain
from oracle import solve as reference
from systems import KINDS, damped_patterns, patterns, system, two_stage

from gearstab import ckernel
from gearstab.floquet.kernel import c_kernel, threads
from gearstab.floquet.kernel.decision import DOUBTFUL, UNSTABLE
from gearstab.floquet.segments.pattern import Pattern, prepare
from gearstab.system import Array
from gearstab.systems import build

LEVELS = ckernel.library.levels()
POINTS = 1501


@pytest.fixture(params=LEVELS)
def level(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setenv("GEARSTAB_SIMD", request.param)
    return str(request.param)


def compare(pattern: Pattern, omega: Array) -> float:
    """Points as they are scanned against all propagated; returns the share of unstable ones that differ in bits."""
    verdict, growth = c_kernel.scan(pattern, omega)
    expected, propagated, *_ = c_kernel.scan_traces(pattern, omega)
    # Nothing near a threshold is decided by interpolated numbers.
    np.testing.assert_array_equal(verdict, expected)
    assert np.all(growth[verdict != UNSTABLE] == 0)
    unstable = verdict == UNSTABLE
    # Of rho = 2 cosh g, whose errors are some 1e-13, up to 1e3 times as much at the least scaled discriminant, 1e-6.
    change = np.abs(growth - propagated)[unstable] * np.minimum(1.0, propagated[unstable])
    assert np.all(change < 1e-10)
    assert len(change) == 0 or np.median(change) < 1e-13
    return float(np.mean(growth[unstable] != propagated[unstable])) if len(change) else 0.0


def dense(n: int, kind: str, seed: int) -> Iterator[tuple[Pattern, Array]]:
    """Rows as of maps, uniform in the mesh frequency."""
    for pattern, _ in patterns(system(n, kind, seed), 1):
        yield pattern, np.linspace(0.3, 6, POINTS) / pattern.elastic.rate[:, None]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("n", [1, 2, 3])
def test_verdicts_are_those_of_propagation(level: str, n: int, kind: str) -> None:
    interpolated = [compare(pattern, omega) for pattern, omega in dense(n, kind, 20)]
    # With two segments polynomials hardly pay for one coordinate; without excitation nothing is unstable.
    assert kind in ("no excitation", "negative stiffness") or n == 1 or max(interpolated) > 0.05


@pytest.mark.parametrize("ratio", ["1", "3/5", "9/10"])
@pytest.mark.parametrize("order", [1, -1])
def test_the_train(level: str, ratio: str, order: int) -> None:
    """Many segments, long periods, edges and strong growth; rows of few points and of many, up and down."""
    (pattern,) = prepare(build(two_stage(ratio, np.array([0.02, 0.3, 0.9]), (1.47, 1.64), 0.13)))
    for points, least in ((65, 0.0), (400, 0.15), (4001, 0.5)):
        omega = np.linspace(0.35, 7, points)[::order] / pattern.elastic.rate[:, None]
        assert compare(pattern, omega) >= least


def test_against_the_kernel_in_numpy(level: str) -> None:
    for pattern, omega in dense(3, "ratios", 21):
        verdict, growth = c_kernel.scan(pattern, omega)
        expected, reference_growth = numpy_kernel.scan(pattern, omega)
        sure = (verdict != DOUBTFUL) & (expected != DOUBTFUL)
        np.testing.assert_array_equal(verdict[sure], expected[sure])
        np.testing.assert_allclose(growth[sure], reference_growth[sure], atol=1e-9)


@pytest.mark.parametrize("level", LEVELS[-1:], indirect=True)
def test_growth_in_high_precision(level: str) -> None:
    """Some unstable points of a row, inside stretches, against 40 digits."""
    item = build(two_stage(Fraction(3, 5), contact_ratio=(1.47, 1.64), phasing=0.13))
    (pattern,) = prepare(item)
    asked = np.linspace(0.35, 7, POINTS)
    verdict, growth = c_kernel.scan(pattern, asked[None] / pattern.elastic.rate[0])
    *_, magnified = c_kernel.scan_traces(pattern, asked[None] / pattern.elastic.rate[0])
    assert np.all(magnified == 1)
    for k in np.flatnonzero(verdict[0] == UNSTABLE)[::60]:
        exact = max(abs(value) for value in reference(plain(item), float(asked[k])).multipliers)
        assert abs(growth[0, k] - float(mp.log(exact))) < 1e-12


def test_a_row_alone_decides(level: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither other rows nor threads; a row in no order is propagated."""
    monkeypatch.setattr(threads, "WORTH_A_THREAD", 1.0)
    for pattern, omega in dense(3, "generic", 22):
        verdict, growth = c_kernel.scan(pattern, omega, 1)
        for row in range(len(omega)):
            alone = c_kernel.scan(pattern.row(row), omega[row : row + 1], 3)
            assert alone[0].tobytes() == verdict[row].tobytes()
            assert alone[1].tobytes() == growth[row].tobytes()
        mixed = np.random.default_rng(3).permutation(POINTS)
        found, expected = c_kernel.scan(pattern, omega[:, mixed]), c_kernel.scan_traces(pattern, omega[:, mixed])
        assert found[1].tobytes() == expected[1].tobytes()


def test_growth_too_large_for_polynomials(level: str) -> None:
    """Coefficients over many orders of magnitude in one row, up to exp(10), and all verdicts right."""
    item = system(3, "negative stiffness", 23)
    for pattern, _ in patterns(replace(item, stiffness=0.1 * item.stiffness), 1):
        omega = np.linspace(0.01, 3, POINTS) / pattern.elastic.rate[:, None]
        compare(pattern, omega)
        assert c_kernel.scan(pattern, omega)[1].max() > 10


FEW = 63
"""Points of a row that are too few for polynomials."""


@pytest.mark.parametrize("damping", [1e-7, 1e-3, 0.1, 3.0])
@pytest.mark.parametrize("kind", ["generic", "rigid", "negative stiffness", "ratios"])
@pytest.mark.parametrize("n", [2, 3])
def test_damped_growth_is_that_of_propagation(level: str, n: int, kind: str, damping: float) -> None:
    changed = []
    for pattern, generator, omega in damped_patterns(system(n, kind, 24, damping), 1001):
        growth, scale = c_kernel.scan_damped(pattern, generator, omega)
        for first in range(0, 1001, FEW):
            part = slice(first, first + FEW)
            alone, taken = c_kernel.scan_damped(pattern, generator, omega[:, part])
            # What both may be off before a point is left to QR, TRUSTED in moduli.h.
            assert np.all(np.abs(growth[:, part] - alone) <= 4e-13 * np.maximum(1.0, np.abs(alone)))
            assert np.abs(scale[:, part] - taken).max() < 2 * np.log(1e4)
            changed.append(np.mean(growth[:, part] != alone))
    # Heavy damping parts the multipliers too far for a polynomial, growing modes do not go in pairs.
    assert kind == "negative stiffness" or damping > 0.1 or np.mean(changed) > 0.2
