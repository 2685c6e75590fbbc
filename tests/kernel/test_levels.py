"""Multipliers of few segments with very different decay, against those in many digits and against the periodic QR."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import numpy_kernel
import pytest

from gearstab.floquet.kernel import levels
from gearstab.floquet.kernel.c_kernel import graded
from gearstab.floquet.kernel.damped import Generators, factors, generators
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
