"""Motion through intervals of given mesh stiffnesses."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from driven_reference import series
from scipy.integrate import solve_ivp
from test_response_driven import CASES, train

from gearstab.response import driven_response
from gearstab.response.flow import flow
from gearstab.response.linear.driven import driven


def test_a_mesh_apart_and_one_on_its_other_flank() -> None:
    """Against DOP853 in physical coordinates: k_1 = 0 without its damping, k_2 with a force from backlash."""
    system, omega = train(), 1.7
    motion = driven(system, omega)
    push = 0.3 * np.array([0.0, 1.0, 1.0])
    start, begin = np.array([0.1, -0.2, 0.3, 0.05, 0.02, -0.1]), 0.4
    first = system.meshes[0]
    stiffness = system.stiffness_matrix([np.zeros(()), np.full((), 0.8)])
    damping = system.damping - first.damping * first.outer

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        force = system.load + push - stiffness @ y[:3] - damping @ y[3:]
        return np.concatenate([y[3:], np.linalg.solve(system.mass, force)])

    later = np.array([0.0, 0.3, 1.1])
    expected = solve_ivp(rate, (begin, begin + 1.1), start, "DOP853", t_eval=begin + later, rtol=1e-12, atol=1e-13)
    apart = flow(motion, np.array([0.0, 0.8]), 0.1, push, np.array([False, True]))
    x = motion.state(start[:3], start[3:])
    found = np.concatenate(motion.physical(apart.states(x, begin, later)), axis=1)
    np.testing.assert_allclose(found, expected.y.T, atol=1e-10)


def test_a_closed_mesh_is_driven_by_its_transmission_error() -> None:
    system, omega = train(), 1.7
    motion = driven(system, omega)
    q, v, time = np.array([0.1, -0.2, 0.3]), np.array([0.05, 0.02, -0.1]), 0.9
    closed = flow(motion, np.array([1.2, 0.9]), 0.1)
    _, acceleration = motion.physical(closed.rate(motion.state(q, v), np.array(time)))
    mesh = system.meshes[0]
    error, slope = series(mesh.transmission_error, omega * time / (2 * np.pi))
    force = system.load + (1.2 * error + mesh.damping * slope * omega / (2 * np.pi)) * mesh.direction
    force = force - system.stiffness_matrix([np.full((), 1.2), np.full((), 0.9)]) @ q - system.damping @ v
    np.testing.assert_allclose(acceleration, np.linalg.solve(system.mass, force), rtol=1e-12)


def test_flows_one_after_the_other_are_the_history() -> None:
    """With the stiffnesses as they are and the jumps as the ends of intervals."""
    system, omega = CASES["forces"]
    motion = driven(system, omega)
    edges = motion.points.edges[0]
    q, v = np.array([0.1, -0.2, 0.3]), np.zeros(3)
    x = motion.state(q, v)
    for begin, end in pairwise(edges):
        middle = 0.5 * (begin + end)
        stiffness = motion.drive.split(motion.drive.varying(np.array([[middle]]))[0])[0][0]
        x = flow(motion, stiffness, middle).states(x, begin * motion.period, np.array([(end - begin) * motion.period]))[
            0
        ]
    expected = driven_response(system, omega, q, v, motion.period, 10)
    np.testing.assert_allclose(motion.physical(x)[0], expected.displacement[-1], atol=1e-12)


def test_smooth_waves_have_no_exact_intervals() -> None:
    system, omega = CASES["smooth waves"]
    with pytest.raises(ValueError, match="piecewise constant"):
        flow(driven(system, omega), np.ones(2), 0.1)
