"""Eccentricity and pitch errors, which repeat with the revolution of a gear: closed form and integration."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from systems import lone_pair

import gearstab as gs
from gearstab.response.history import steady_state

MASS, STIFFNESS, ZETA, TEETH = 1.5, 4e8, 0.03, 7
DRAG = 2 * ZETA * np.sqrt(STIFFNESS * MASS)
ERRORS = [{"gear": "a", "cos": [8e-6], "sin": [0, 2e-6]}, {"gear": "b", "sin": [5e-6]}]


def pair(epsilon: float, **mesh: Any) -> dict[str, Any]:
    """Two gears without anything else, of which one coordinate is left: with J = 2 m r_b^2, m_e = m."""
    of = {"mean_stiffness": STIFFNESS, "epsilon": epsilon, "contact_ratio": 1.5, "damping_ratio": ZETA}
    return lone_pair(TEETH, MASS, of | {"revolution_errors": ERRORS} | mesh)


@pytest.mark.parametrize("lag", [0.0, 0.3])
def test_response_to_an_eccentric_gear(lag: float) -> None:
    """With a constant stiffness q = Re sum (k + i w c)/(k - m w^2 + i w c) e exp(i w t)."""
    omega = 9000.0
    found = steady_state(gs.build(pair(0.0, lag=lag)), omega)
    # The common period is a revolution of the wheel.
    assert_allclose(found.time[-1], 3 * TEETH * 2 * np.pi / omega, rtol=1e-12)
    wanted = np.zeros(len(found.time))
    for e, order, teeth in ((8e-6, 1, TEETH), (-2e-6j, 2, TEETH), (-5e-6j, 1, 3 * TEETH)):
        w = order * omega / teeth
        share = (STIFFNESS + 1j * w * DRAG) / (STIFFNESS - MASS * w**2 + 1j * w * DRAG)
        turned = np.exp(1j * (w * found.time - 2 * np.pi * order * lag / teeth))
        wanted += (share * e * turned).real
    assert_allclose(found.mesh_deflection[:, 0], wanted, rtol=0, atol=1e-9 * np.abs(wanted).max())


def test_response_with_a_varying_stiffness() -> None:
    """Integration by a Runge-Kutta method from jump to jump over a revolution comes back to where it began."""
    omega, epsilon = 9000.0, 0.3
    system = gs.build(pair(epsilon))
    found = steady_state(system, omega)
    g = np.asarray(system.meshes[0].direction)
    cycle = 2 * np.pi / omega

    def error(t: Any) -> tuple[Any, Any]:
        a, b = omega / TEETH, omega / (3 * TEETH)
        value = 8e-6 * np.cos(a * t) + 2e-6 * np.sin(2 * a * t) + 5e-6 * np.sin(b * t)
        return value, -8e-6 * a * np.sin(a * t) + 4e-6 * a * np.cos(2 * a * t) + 5e-6 * b * np.cos(b * t)

    y = np.array([found.displacement[0] @ g, found.velocity[0] @ g])
    for k, (begin, end) in enumerate(pairwise(np.arange(0, 3 * TEETH + 0.25, 0.5) * cycle)):
        stiffness = STIFFNESS * (1 + epsilon * (1 if k % 2 == 0 else -1))

        def slope(t: float, y: np.ndarray, stiffness: float = stiffness) -> list[float]:
            e, rate = error(t)
            return [y[1], -(stiffness * (y[0] - e) + DRAG * (y[1] - rate)) / MASS]

        y = solve_ivp(slope, (begin, end), y, "DOP853", rtol=1e-11, atol=1e-16).y[:, -1]
        at = np.argmin(np.abs(found.time - end))
        assert_allclose(found.time[at], end, rtol=1e-12)
        assert_allclose(y[0], found.mesh_deflection[at, 0], rtol=0, atol=1e-8 * np.ptp(found.mesh_deflection))
    force = STIFFNESS * (1 + epsilon * np.where((found.time / cycle) % 1 < 0.5, 1, -1))
    force = force * (found.mesh_deflection[:, 0] - error(found.time)[0])
    off = np.abs(found.time / cycle * 2 - np.round(found.time / cycle * 2)) > 1e-6  # away from the jumps
    assert_allclose(found.mesh_force[off, 0], force[off], rtol=0, atol=1e-9 * np.abs(force).max())


def test_stability_does_not_depend_on_them() -> None:
    system, plain = gs.build(pair(0.3)), gs.build(pair(0.3, revolution_errors=[]))
    assert system.common_period() == plain.common_period()
    omega = [9000.0, 33000.0]
    assert_allclose(gs.floquet(system, omega).growth_rate, gs.floquet(plain, omega).growth_rate, rtol=1e-14)
