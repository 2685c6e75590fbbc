"""Stability with smooth waves and periodic terms, from configurations, against integration of the equations."""

from itertools import pairwise

import numpy as np
import pytest
from scenes import CONFIGS
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from gearstab.config import load
from gearstab.floquet import solve
from gearstab.systems import build

WAVEFORMS = CONFIGS / "waveforms"


def multipliers(inertia, damping, stiffness, period: float, edges) -> np.ndarray:
    """Multipliers of M q'' + C(t) q' + K(t) q = 0 by DOP853, begun anew at every kink; both functions of time."""
    n = len(inertia)
    inverse = np.linalg.inv(inertia)
    y = np.eye(2 * n)

    def field(t, x):
        x = x.reshape(2 * n, 2 * n)
        return np.vstack([x[n:], -inverse @ (damping(t) @ x[n:] + stiffness(t) @ x[:n])]).ravel()

    times = np.unique(np.concatenate([[0.0], np.asarray(edges), [1.0]])) * period
    for a, b in pairwise(times):
        # Just inside: at an edge a wave has its value from the right.
        run = solve_ivp(field, (a, b - 1e-13 * period), y.ravel(), "DOP853", rtol=1e-11, atol=1e-13)
        y = run.y[:, -1].reshape(2 * n, 2 * n)
    return np.linalg.eigvals(y)


def growth(values, period: float) -> float:
    return float(np.log(np.abs(values).max()) / period)


def test_a_rotating_shaft_with_friction() -> None:
    """Every number from the configuration's text, not from what the program made of it."""
    config = load(WAVEFORMS / "rotating_shaft.yaml", ["terms.friction.stiffness.amplitude=0.2"])
    system = build(config.system)
    gyroscopic = np.array([[0.03, 0.2], [-0.2, 0.03]])
    for omega in (1.3, 2.25, 2.6, 3.4):
        period = 2 * np.pi / omega

        def stiffness(t, omega=omega):
            x = omega * t / (2 * np.pi)
            mesh = 1 + 0.6 * (0.4 if x % 1 < 0.6 else -0.6)
            return np.array([[0.6 + mesh, 0.0], [0.4 * np.sin(omega * t), 0.9]])

        expected = growth(multipliers(np.eye(2), lambda t: gyroscopic, stiffness, period, [0.6]), period)
        found = solve(system, np.array([omega]), tolerance=1e-9)
        # rtol of the integrator times some hundred steps.
        assert found.growth_rate[0, 0] == pytest.approx(expected, abs=2e-9)


def test_mesh_damping_that_follows_parabolic_pairs() -> None:
    config = load(WAVEFORMS / "pairs.yaml", ["sweep.contact_ratio=[1.6]", "contact_ratio=1.6"])
    system = build(config.system)

    def mesh(x: float) -> float:
        pairs = [(x % 1 + j) / 1.6 for j in (0, 1)]
        return sum(1 - 0.45 * (2 * u - 1) ** 2 for u in pairs if u < 1)

    mean = 1.6 * 0.85
    for omega in (1.1, 2.2, 2.9):
        period = 2 * np.pi / omega

        def stiffness(t, period=period):
            return np.array([[mesh(t / period)]])

        def damping(t, period=period):
            # The damping ratio counts with the mean stiffness.
            return np.array([[0.02 * mesh(t / period) / mean + 2 * 0.01 * np.sqrt(mean)]])

        expected = growth(multipliers(np.eye(1), damping, stiffness, period, [0.6]), period)
        found = solve(system, np.array([omega]), tolerance=1e-9)
        assert found.growth_rate[0, 0] == pytest.approx(expected, abs=2e-9)


def test_mesh_damping_that_follows_a_rectangular_wave() -> None:
    """States of symmetric matrices whose velocities are weighted: growth by two exponentials."""
    mesh = {"name": "m", "mean_stiffness": 1.0, "epsilon": 0.4, "contact_ratio": 1.6, "damping": 0.05}
    pair = {"kind": "gear_pair", "units": "none", "equivalent_mass": 1.0, "damping_ratio": 0.01}
    system = build(
        load(
            {
                "system": pair | {"meshes": [mesh | {"damping_follows_stiffness": True}]},
                "sweep": {"mesh_frequency": [2.2]},
                "methods": {"floquet": {}},
            }
        ).system
    )
    period, monodromy = 2 * np.pi / 2.2, np.eye(2)
    for stiffness, part in ((1 + 2 * 0.4 * 0.4, 0.6), (1 - 2 * 0.4 * 0.6, 0.4)):
        damping = 0.05 * stiffness + 2 * 0.01
        monodromy = expm(np.array([[0.0, 1.0], [-stiffness, -damping]]) * part * period) @ monodromy
    expected = np.log(np.abs(np.linalg.eigvals(monodromy)).max()) / period
    found = solve(system, np.array([2.2]))
    assert found.growth_rate[0, 0] == pytest.approx(expected, rel=1e-11)


def test_sampled_stiffness_from_its_file() -> None:
    config = load(WAVEFORMS / "sampled.yaml", ["sweep.epsilon=[0.35]"])
    system = build(config.at({"epsilon": np.array(0)}))
    samples = np.loadtxt(WAVEFORMS / "mesh_stiffness.csv", delimiter=",", skiprows=2)[:, 1]
    # Twenty-four equal steps: trigonometric interpolation differs from the spline by O(h^4), 1e-4 of the variation.
    harmonics = np.fft.rfft(samples) / len(samples)
    mean = harmonics[0].real
    x = np.arange(4000) / 4000
    wave = sum(2 * (c * np.exp(2j * np.pi * n * x)).real for n, c in enumerate(harmonics[1:12], start=1))
    size = np.ptp(wave)
    for hertz in (3600.0, 7300.0):
        omega, period = 2 * np.pi * hertz, 1 / hertz

        def stiffness(t, period=period):
            k = sum(2 * (c * np.exp(2j * np.pi * n * t / period)).real for n, c in enumerate(harmonics[1:12], start=1))
            return np.array([[mean * (1 + 0.7 * k / size)]])

        damping = np.array([[2 * 0.02 * np.sqrt(mean * 0.6)]])
        values = multipliers(np.array([[0.6]]), lambda t, c=damping: c, stiffness, period, [])
        found = solve(system, np.array([omega]), tolerance=1e-9)
        assert found.growth_rate[0, 0] * period == pytest.approx(growth(values, period) * period, abs=2e-4)
