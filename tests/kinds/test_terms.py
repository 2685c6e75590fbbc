"""Stability with smooth waves and periodic terms, from configurations, against integration of the equations."""

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from driven import FORCE, PULSES, train, with_friction
from scenes import CONFIGS, read, scene_text
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from gearstab.config import load
from gearstab.config.schema import schema
from gearstab.floquet import solve
from gearstab.floquet.frequencies import alone, groups
from gearstab.response import steady_state
from gearstab.system import GearSystem
from gearstab.systems import build
from gearstab.waveforms import Rectangular

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


# --- vectors of a model of matrices, written as mappings of what is not zero


MODEL = scene_text("terms_model")


def text(names: str, direction: str, left: str) -> str:
    model = MODEL.replace("  coordinates: [q1, q2, q3]", f"  {names}")
    return model.replace("[1, 0, -2]", direction).replace("[0, 0.5, 0]", left)


@pytest.mark.parametrize(
    ("names", "direction", "left"),
    [("", "{q1: 1, q3: -2}", "{q2: 0.5}"), ("coordinates: [a, b, c]", "{c: -2, a: 1}", "{b: 0.5}")],
    ids=["default names", "own names"],
)
def test_a_mapping_is_the_list_with_zeros(tmp_path: Path, names: str, direction: str, left: str) -> None:
    short, long = read(tmp_path, text(names, direction, left)), read(tmp_path, text(names, "[1, 0, -2]", "[0, 0.5, 0]"))
    assert short.tree["system"] == long.tree["system"]  # the resolved configuration holds lists
    system = build(short.system)
    np.testing.assert_array_equal(system.meshes[0].direction, [1, 0, -2])
    np.testing.assert_array_equal(system.terms[0].left, [0, 0.5, 0])
    np.testing.assert_array_equal(system.forces[0].direction, [0, 0.5, 0])
    np.testing.assert_array_equal(system.load, [0, 0.5, 0])


def test_matrices_from_a_file_tell_the_size(tmp_path: Path) -> None:
    np.savez(tmp_path / "model.npz", mass=np.eye(40), stiffness=2 * np.eye(40))
    mesh = "{direction: {q40: 1, q7: 0.1}, mean_stiffness: 1.0, epsilon: 0.3, contact_ratio: 1.5}"
    config = read(tmp_path, f"system: {{kind: matrices, file: model.npz, meshes: [{mesh}]}}")
    assert np.flatnonzero(build(config.system).meshes[0].direction).tolist() == [6, 39]


def test_a_unit_is_understood_and_the_schema_knows_mappings(tmp_path: Path) -> None:
    config = read(tmp_path, text("coordinate_units: rad", "{q1: 25 mm, q2: 1}", "[0, 1, 0]"))
    np.testing.assert_allclose(build(config.system).meshes[0].direction, [0.025, 1, 0], rtol=1e-15)
    direction = schema()["$defs"]["MatrixMesh"]["properties"]["direction"]
    assert {form["type"] for form in direction["anyOf"]} == {"array", "object"}


# --- a system in other coordinates or units moves as the same system does, whatever drives it and varies in it


OMEGA = 1.31
SKEW = np.array([[0.0, 0.3, -0.2], [-0.3, 0.0, 0.4], [0.2, -0.4, 0.0]])


def system() -> GearSystem:
    """With a load, forces, transmission errors, terms of both sorts and a damping matrix that is not symmetric."""
    base = with_friction(train(Fraction(1, 2)), Rectangular(1.6))
    # One term with both functions too: units of stiffness and damping differ.
    both = replace(base.terms[0], damping=base.terms[1].damping)
    return replace(base, forces=(FORCE, PULSES), damping=base.damping + SKEW, terms=(both, base.terms[1]))


def test_in_other_coordinates() -> None:
    basis = np.array([[1.0, 0.4, 0.0], [0.2, -0.8, 0.5], [0.1, 0.3, 1.2]])
    other = system().projected(basis, ("a", "b", "c"))
    assert other.coordinates == ("a", "b", "c")
    q, y = (steady_state(one, OMEGA, 10) for one in (system(), other))
    # Condition numbers of modes and of I - M are of order 10: a few hundred roundings.
    np.testing.assert_allclose(y.displacement @ basis.T, q.displacement, atol=1e-12)
    np.testing.assert_allclose(y.mesh_force, q.mesh_force, atol=1e-12)


def test_in_other_units() -> None:
    """Lengths stay; forces are in units of the stiffness and times in units of sqrt(mass/stiffness)."""
    mass, stiffness = np.array(2.5), np.array(1.7)
    time = np.sqrt(mass / stiffness)
    other = system().scaled(mass, stiffness)
    assert other.dimensionless == ("mass", "time")
    q, y = steady_state(system(), OMEGA, 10), steady_state(other, OMEGA * float(time), 10)
    np.testing.assert_allclose(y.displacement, q.displacement, atol=1e-12)
    np.testing.assert_allclose(y.velocity, q.velocity * time, atol=1e-12)
    np.testing.assert_allclose(y.mesh_force * stiffness, q.mesh_force, atol=1e-12)
    np.testing.assert_allclose(y.time * time, q.time, rtol=1e-14)


def test_the_mean_system_decays_as_its_eigenvalues_say_at_all_speeds() -> None:
    one = system()
    growth = solve(one.averaged(), np.array([0.7, 1.3, 2.9])).growth_rate[0]
    # Of the terms only the damping has a mean, of 0.05.
    damping = one.damping + 0.05 * sum(np.outer(term.left, term.right) for term in one.terms)
    below = -np.linalg.solve(one.mass, np.hstack([one.mean_stiffness_matrix(), damping]))
    values = np.linalg.eigvals(np.vstack([np.eye(3, 6, 3), below]))
    np.testing.assert_allclose(growth, values.real.max(), rtol=1e-10)


def test_one_frequency_varies_and_the_others_keep_their_mean() -> None:
    first = groups(system())[0]
    own = alone(system(), first)
    assert [np.any(mesh.epsilon) for mesh in own.meshes] == [True, False]
    assert all(ratio == 1 for ratio in own.frequency_ratios)


def test_without_what_drives_it() -> None:
    assert system().forced
    assert not system().undriven().forced
