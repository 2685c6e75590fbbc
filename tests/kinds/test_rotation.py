"""Matrices that act with a speed of rotation: from a configuration to multipliers, steady states, histories, run-ups.

gyroscopic_multipliers.json holds multipliers in forty digits (mpmath) of 14 random systems, rotors.json
closed forms of whirling (mpmath).
"""

import json
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pytest
from driven import integrated, integrated_along, train, with_waves
from scipy.integrate import solve_ivp

import gearstab as gs
from gearstab.config import ConfigError, load
from gearstab.floquet import solve
from gearstab.floquet.stability import STATUS_FLAGS
from gearstab.mesh import Mesh, PeriodicTerm, Rotation
from gearstab.methods import METHODS, OptionError
from gearstab.propagation.elastic import mean_levels, single_rows
from gearstab.propagation.path import Path
from gearstab.response import driven_response, ramp_response, steady_state
from gearstab.system import Feature, GearSystem
from gearstab.systems import build
from gearstab.waveforms import Constant, Fourier, Rectangular, Trapezoidal

Array = np.ndarray
DATA = FilePath(__file__).parents[1] / "data" / "rotation"
RANDOM = json.loads((DATA / "gyroscopic_multipliers.json").read_text())["cases"]


ROTORS = json.loads((DATA / "rotors.json").read_text())


def section(system: dict[str, Any]) -> dict[str, Any]:
    """A case of the reference as the section ``system``."""
    names = {"gyroscopic": "gyroscopic", "circulatory_speed": "circulatory", "centripetal": "centripetal"}
    found = {
        "kind": "matrices",
        "mass": system["mass"],
        "stiffness": (np.array(system["stiffness"]) + np.array(system.get("circulatory", 0.0))).tolist(),
        "meshes": system["meshes"],
        "rotation": {"speed_ratio": system["speed_ratio"]}
        | {new: system[old] for old, new in names.items() if old in system},
    }
    return found | ({"damping": system["damping"]} if "damping" in system else {})


@pytest.mark.parametrize("case", RANDOM, ids=[case["name"] for case in RANDOM])
def test_multipliers_of_random_systems(case: dict[str, Any]) -> None:
    system = build(load({"system": section(case["system"])}).system)
    points = case["points"]
    found = solve(system, np.array([point["mesh_frequency"] for point in points]), exponents=True)
    for k, point in enumerate(points):
        expected = np.array([complex(*value) for value in point["multipliers"]])
        gap = np.abs(np.exp(found.exponents[0, k] * point["common_period"])[:, None] - expected)
        # Rounding of some ten products; the reference is right to all its digits.
        assert max(gap.min(axis=0).max(), gap.min(axis=1).max()) < 1e-12 * max(1.0, np.abs(expected).max())
        assert found.growth_rate[0, k] == pytest.approx(point["growth_rate"], abs=1e-12)


def rotor(rotation: dict[str, Any], mass: Any, stiffness: Any, damping: Any = None, speed: float = 1.0) -> Array:
    """Eigenvalues of a rotor at a held speed; its mesh has no weight."""
    n = len(mass)
    mesh = {"name": "mesh", "direction": [1.0] * n, "mean_stiffness": 1e-12, "epsilon": 0.0, "contact_ratio": 1.5}
    system = {
        "kind": "matrices", "mass": mass, "stiffness": stiffness, "meshes": [mesh],
        "rotation": {"speed": speed, **rotation},
    } | ({"damping": damping} if damping is not None else {})  # fmt: skip
    built = build(load({"system": system}).system)
    ((own,), (level,)) = single_rows(built), mean_levels(built)
    values = np.linalg.eigvals(own.form.generator(level[None], np.zeros(1))[0]) * own.form.rate
    return values[np.lexsort((values.real, values.imag))]


def test_stodola_rotor() -> None:
    own, given = ROTORS["stodola"], ROTORS["stodola"]["inputs"]
    k11, k12, k22 = own["k11_N_m"], own["k12_N"], own["k22_N_m_rad"]
    m, diametral, polar = given["m"], given["Id"], given["Ip"]
    plane = np.array([[k11, k12], [k12, k22]])
    stiffness = np.kron(np.eye(2), plane).tolist()
    gyroscopic = np.zeros((4, 4))
    gyroscopic[1, 3], gyroscopic[3, 1] = polar, -polar
    for row in own["rows"]:
        if row["speed_rad_s"] == 0:
            continue
        values = rotor(
            {"gyroscopic": gyroscopic.tolist()}, np.diag([m, diametral, m, diametral]).tolist(), stiffness,
            speed=row["speed_rad_s"],
        )  # fmt: skip
        np.testing.assert_allclose(values.real, 0.0, atol=1e-9)
        # Whirl frequencies of both senses: forward ones rise with the speed.
        np.testing.assert_allclose(values.imag[values.imag > 0], np.sort(np.abs(row["whirl_rad_s"])), rtol=1e-9)


def test_rotating_damping_destabilises_above_a_speed() -> None:
    given = ROTORS["internal_damping"]["inputs"]
    m, k, still, turning = given["m"], given["k"], given["ce"], given["ci"]
    for row in ROTORS["internal_damping"]["rows"]:
        values = rotor(
            {"circulatory": [[0, turning], [-turning, 0]]}, [[m, 0], [0, m]], [[k, 0], [0, k]],
            [[still + turning, 0], [0, still + turning]], row["speed_rad_s"],
        )  # fmt: skip
        assert values.real.max() == pytest.approx(row["growth"], rel=1e-9)


def test_a_disc_that_tilts() -> None:
    """I w^2 -+ I_p W w - k = 0: the forward motion rises, the backward one falls."""
    given = ROTORS["tilting"]["inputs"]
    diametral, polar, k = given["Id"], given["Ip"], given["k"]
    for row in ROTORS["tilting"]["rows"][1:]:
        gyroscopic = {"gyroscopic": [[0, polar], [-polar, 0]]}
        mass, stiffness = [[diametral, 0], [0, diametral]], [[k, 0], [0, k]]
        values = rotor(gyroscopic, mass, stiffness, speed=row["speed_rad_s"])
        np.testing.assert_allclose(values.imag[values.imag > 0], np.sort(np.abs(row["whirl_rad_s"])), rtol=1e-9)
        np.testing.assert_allclose(values.real, 0.0, atol=1e-9)


STILL: dict[str, Any] = {"gyroscopic": [[0, 0], [0, 0]]}
"""A rotation that nothing acts with."""


def test_cross_coupled_bearings_flutter_above_a_threshold() -> None:
    """Unsymmetric stiffness: |q| > c sqrt(k/m)."""
    given, own = ROTORS["cross_coupled"]["inputs"], ROTORS["cross_coupled"]
    m, c, k = given["m"], given["c"], given["k"]
    for row in own["rows"]:
        q = row["q_over_threshold"] * own["threshold_q_N_m"]
        values = rotor(STILL, [[m, 0], [0, m]], [[k, q], [-q, k]], [[c, 0], [0, c]])
        # The growth is a small part of the exponents, of 632 1/s, whose rounding it has.
        assert values.real.max() == pytest.approx(row["growth"], rel=1e-9, abs=1e-10)


def test_a_journal_bearing_has_a_critical_mass() -> None:
    """Unsymmetric stiffness and full damping matrices; at the critical mass it whirls with a frequency of its own."""
    own, given = ROTORS["journal"], ROTORS["journal"]["inputs"]
    stiffness, damping = ([[given[f"{x}{i}{j}"] for j in "xy"] for i in "xy"] for x in "kc")
    for row in [*own["rows"], {"mass_over_critical": 1.0, "growth": 0.0}]:
        m = row["mass_over_critical"] * own["critical_mass_kg"]
        values = rotor(STILL, [[m, 0], [0, m]], stiffness, damping)
        assert values.real.max() == pytest.approx(row["growth"], rel=1e-9, abs=1e-10)
    assert abs(values.imag[values.real.argmax()]) == pytest.approx(own["whirl_rad_s"], rel=1e-9)


G = np.array([[0.0, 0.3, -0.2], [-0.3, 0.0, 0.4], [0.2, -0.4, 0.0]])
H = np.array([[0.0, 0.1, 0.0], [-0.1, 0.02, 0.0], [0.05, 0.0, 0.0]])
K = np.diag([-0.05, 0.02, -0.03])
RATIO, OMEGA = Fraction(-2, 3), 1.31


def turning() -> GearSystem:
    return replace(train(Fraction(1, 2)), rotations=(Rotation(RATIO, gyroscopic=G, circulatory=H, centripetal=K),))


def constant(omega: float) -> GearSystem:
    """The same at one mesh frequency, made of constant parts that have nothing to do with a rotation."""
    system, w = train(Fraction(1, 2)), float(RATIO) * omega
    rows = [PeriodicTerm(f"h{i}", np.eye(3)[i], w * H[i], stiffness=Constant(np.array(1.0))) for i in range(3)]
    stiffness = system.stiffness + w**2 * K
    return replace(system, damping=system.damping + w * G, stiffness=stiffness, terms=tuple(rows))


def test_a_constant_speed_is_constant_matrices() -> None:
    omega = np.array([OMEGA, 2.2])
    found = solve(turning(), omega, exponents=True)
    for k, one in enumerate(omega):
        expected = solve(constant(float(one)), omega[[k]], exponents=True)
        np.testing.assert_allclose(found.exponents[0, k], expected.exponents[0, 0], atol=1e-12)
    state, expected_state = (steady_state(s, OMEGA, 8) for s in (turning(), constant(OMEGA)))
    np.testing.assert_allclose(state.displacement, expected_state.displacement, atol=1e-12)
    history, expected_history = (
        driven_response(s, OMEGA, np.array([0.1, 0.0, -0.2]), np.zeros(3), 12.0) for s in (turning(), constant(OMEGA))
    )
    np.testing.assert_allclose(history.displacement, expected_history.displacement, atol=1e-12)


def test_a_speed_that_is_held_is_that_of_its_ratio() -> None:
    held = replace(
        turning(),
        rotations=tuple(replace(r, speed_ratio=None, speed=float(RATIO) * OMEGA) for r in turning().rotations),
    )
    found, expected = (solve(s, np.array([OMEGA]), exponents=True).exponents for s in (held, turning()))
    np.testing.assert_allclose(found, expected, atol=1e-13)


SMOOTH = Trapezoidal(1.6, 0.2), Fourier(np.array([0.3, 0.1]), np.array([-0.2, 0.05]))


@pytest.mark.parametrize("holds", [False, True])
@pytest.mark.parametrize("damped", [False, True])
def test_multipliers_with_smooth_waves(holds: bool, damped: bool) -> None:
    """Many speeds at once, by integration (DOP853, between kinks) at two of them."""
    system = with_waves(turning() if damped else replace(turning(), damping=None), *SMOOTH)
    if not damped:
        (own,) = system.rotations
        system = replace(system, rotations=(replace(own, circulatory=None),))
    if holds:
        system = replace(system, rotations=(replace(system.rotations[0], speed_ratio=None, speed=-0.9),))
    omega = np.linspace(0.9, 2.9, 60)
    found = solve(system, omega, exponents=True)
    assert not np.any(found.status & STATUS_FLAGS["not_converged"])
    for k in (4, 51):
        period = 2 * np.pi * float(system.common_period()[0]) / omega[k]
        product = integrated(system, float(omega[k]), np.eye(2 * system.size), period)
        expected, own = np.linalg.eigvals(product), np.exp(found.exponents[0, k] * period)
        gap = np.abs(own[:, None] - expected)
        # The tolerance of the multipliers, relative to the largest.
        assert max(gap.min(axis=0).max(), gap.min(axis=1).max()) < 2e-9 * np.abs(expected).max()


def test_units_do_not_matter() -> None:
    mass, stiffness = np.array(2.5), np.array(7.0)
    time = float(np.sqrt(mass / stiffness))
    for system in (
        turning(),
        replace(turning(), rotations=(replace(turning().rotations[0], speed_ratio=None, speed=1.7),)),
    ):
        found = solve(system.scaled(mass, stiffness), np.array([OMEGA * time]), exponents=True).exponents
        np.testing.assert_allclose(found / time, solve(system, np.array([OMEGA]), exponents=True).exponents, atol=1e-12)


def test_a_run_up_follows_the_speed() -> None:
    path = Path.ramp(1.1, 1.6, 0.03)
    found = ramp_response(turning(), path, 8)
    start = np.concatenate([found.displacement[0], found.velocity[0]])
    expected = integrated_along(turning(), path, found.time, start)
    # Magnus steps and quadrature work to about 1e-9.
    np.testing.assert_allclose(np.hstack([found.displacement, found.velocity]), expected, atol=1e-8)


@pytest.mark.parametrize("name", [n for n, m in METHODS.items() if Feature.ROTATION not in m.supports])
def test_a_method_that_does_not_declare_it_refuses(name: str) -> None:
    with pytest.raises(OptionError, match="speed of rotation"):
        METHODS[name](None, turning()).require(METHODS[name].supports, METHODS[name].remedies)


BASE: dict[str, Any] = section(RANDOM[0]["system"])


def test_from_a_file_to_a_map(tmp_path: FilePath) -> None:
    own = RANDOM[0]["system"]
    np.savez(tmp_path / "rotor.npz", M=own["mass"], K=own["stiffness"], G=own["gyroscopic"])
    point = RANDOM[0]["points"][0]
    text = f"""
system:
  kind: matrices
  file: rotor.npz
  rotation: {{speed_ratio: "{own["speed_ratio"]}"}}
  meshes:
    - {json.dumps(own["meshes"][0])}
sweep: {{mesh_frequency: [{point["mesh_frequency"]}, 1.0]}}
methods: {{floquet: {{}}}}
"""
    (tmp_path / "c.yaml").write_text(text)
    tree = gs.sweep(gs.load(tmp_path / "c.yaml"))
    assert tree["floquet/growth_rate"].values[0] == pytest.approx(point["growth_rate"], abs=1e-12)
    (tmp_path / "d.yaml").write_text(text.replace(f'  rotation: {{speed_ratio: "{own["speed_ratio"]}"}}\n', ""))
    with pytest.raises(ConfigError, match="holds gyroscopic, and no speed of rotation"):
        gs.load(tmp_path / "d.yaml")


def test_a_matrix_that_is_not_symmetric_is_doubted() -> None:
    system = BASE | {"stiffness": [[1.0, 0.3], [0.2, 2.0]], "damping": [[0.1, 0.0], [0.0, 0.1]]}
    (doubt,) = load({"system": system}).doubts
    assert str(doubt).startswith(
        "configuration: system.stiffness.0.1: is not symmetric: entry 0.1 is 0.3, entry 1.0 is 0.2"
    )


def test_a_run_up_in_a_turning_frame_is_one_in_the_fixed_frame() -> None:
    """A body on an isotropic support, damped to the housing, and a mesh that turns with the frame, at a quick ramp.

    With X = R(phi) x, phi' = W: X'' + c X' + k X + k_m(t) R g g^T R^T X = R f, which knows of no force of the frame.
    """
    turn, ratio, c, load = np.array([[0.0, -1.0], [1.0, 0.0]]), Fraction(1, 5), 0.05, np.array([0.3, -0.2])
    mesh = Mesh("mesh", np.array([0.8, 0.6]), np.asarray(1.0), np.asarray(0.3), Rectangular(1.4))
    rotation = Rotation(ratio, gyroscopic=2 * turn, circulatory=c * turn, centripetal=-np.eye(2))
    system = GearSystem(np.eye(2), 2 * np.eye(2), (mesh,), c * np.eye(2), load=load, rotations=(rotation,))
    path = Path.ramp(1.1, 2.6, 0.15)
    found = ramp_response(system, path, 20)
    first, slope = path.mesh_frequency[0], path.rate[0]

    def frame(t: float) -> tuple[Array, float]:
        """R and W."""
        angle = float(ratio) * (first * t + 0.5 * slope * t**2)
        return np.cos(angle) * np.eye(2) + np.sin(angle) * turn, float(ratio) * (first + slope * t)

    def rate(t: float, y: Array, stiff: float) -> Array:
        own, _ = frame(t)
        g = own @ mesh.direction
        return np.concatenate([y[2:], own @ load - c * y[2:] - 2 * y[:2] - stiff * g * (g @ y[:2])])

    (own, w), q, v = frame(0.0), found.displacement[0], found.velocity[0]
    state = np.concatenate([own @ q, own @ (v + w * turn @ q)])
    jumps = np.sort(np.concatenate([np.arange(200), np.arange(200) + 0.4])) * 2 * np.pi
    moments = (np.sqrt(first**2 + 2 * slope * jumps) - first) / slope
    knots = np.unique(np.concatenate([moments[moments < found.time[-1]], found.time]))
    expected = [q]
    for a, b in pairwise(knots):
        phase = path.phase_at(np.array([0.5 * (a + b)]))[0] / (2 * np.pi)
        stiff = 1.0 + 0.6 * float(mesh.waveform.value(np.asarray(phase)))
        state = solve_ivp(rate, (a, b), state, "DOP853", args=(stiff,), rtol=1e-12, atol=1e-13).y[:, -1]
        if np.any(found.time == b):
            expected.append(frame(b)[0].T @ state[:2])
    # Magnus steps work to about 1e-9.
    np.testing.assert_allclose(found.displacement, expected, atol=1e-7)
