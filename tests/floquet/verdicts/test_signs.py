"""Growth rate, verdict and exponents agree in sign, whatever computes them."""

from dataclasses import replace

import numpy as np
import pytest
from systems import KINDS, SMOOTH_OMEGA, Smooth, smooth_train, star, system, train

from gearstab.floquet import solve
from gearstab.floquet.frequencies import lyapunov, per_mesh
from gearstab.mesh import PeriodicTerm
from gearstab.modal import modal_damping_matrix

RATIOS = (None, 0.0, 1e-14, 1e-12, 1e-10, 1e-3, -1e-12)
"""Damping ratios of all modes; at the smallest, growth a period is of the size of rounding errors."""


def lightly_damped(item, ratio):
    if ratio is None:
        return item
    return replace(item, damping=modal_damping_matrix(item.mass, item.mean_stiffness_matrix(), np.array([ratio])))


def assert_signs(found):
    known = found.stable >= 0
    assert known.any()
    np.testing.assert_array_equal((found.growth_rate > 0)[known], (found.stable == 0)[known])
    if found.exponents is not None:
        assert np.all(found.exponents.real[found.stable == 1] <= 0)


@pytest.mark.parametrize("ratio", RATIOS)
def test_exact(ratio):
    omega = np.linspace(0.3, 6.0, 150)
    for item in (train(0.0), train(), train(0.9), star(0.3)):
        assert_signs(solve(lightly_damped(item, ratio), omega, exponents=ratio == 1e-12))


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind(kind):
    for n in (1, 2, 3, 5):
        for damping in (0.0, 1e-13):
            item = system(n, kind, 7)
            item = replace(item, damping=damping * item.mass) if damping else item
            assert_signs(solve(item, np.linspace(0.3, 6.0, 60), exponents=True))


@pytest.mark.parametrize("ratio", RATIOS)
def test_smooth(ratio):
    from systems import TRAPEZOID, WAVE

    item = lightly_damped(smooth_train(TRAPEZOID, WAVE, 0.3), ratio)
    assert_signs(solve(item, SMOOTH_OMEGA, exponents=True))
    # Nothing varies.
    assert_signs(solve(lightly_damped(smooth_train(TRAPEZOID, WAVE, 0.0), ratio), SMOOTH_OMEGA, exponents=True))


@pytest.mark.parametrize("ratio", RATIOS)
def test_terms(ratio):
    end = np.array([1.0, 0.5, 0.0])
    term = PeriodicTerm("term", end, end, stiffness=Smooth(0.1, 0.05))
    assert_signs(solve(replace(lightly_damped(train(), ratio), terms=(term,)), SMOOTH_OMEGA[::3], exponents=True))


@pytest.mark.parametrize("ratio", RATIOS)
def test_several_frequencies(ratio):
    item, omega = lightly_damped(train(0.2, ratio="3/2"), ratio), np.linspace(0.8, 6.0, 12)
    assert_signs(lyapunov.solve(item, omega, cycles=20))
    assert_signs(per_mesh.solve(item, omega, solve))


def test_rigid_motion_that_grows_by_rounding_only():
    # Damping of minus 1e-15 on a free rotation.
    item = train(shaft=0.0)
    for size in (-1e-15, -1e-3, 1e-15):
        assert_signs(solve(replace(item, damping=size * item.mass), np.linspace(0.3, 6.0, 20), exponents=True))
