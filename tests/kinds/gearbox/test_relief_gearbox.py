"""Profile relief in a gearbox: stiffness under torque, excitation of the response, and what users are told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenes import read, scene_text
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar
from test_planetary_sets import TWO

from gearstab.config import ConfigError
from gearstab.design import check, search
from gearstab.design.judge import Judge
from gearstab.design.problem import DesignProblem
from gearstab.gears.loaded import LoadedHelical, loaded_mesh
from gearstab.gears.mesh_stiffness import single_stiffness
from gearstab.gears.relief import FlankRelief, Relief
from gearstab.modal import static_mesh_force
from gearstab.response import steady_state
from gearstab.response.speeds import speed_response
from gearstab.system import GearSystem
from gearstab.systems import build
from gearstab.systems.gearbox.train import Train

PAIR = scene_text("relief_gearbox")
TIP = "{tip: {amount: 20 um, length: 4 mm, form: parabolic}}"


def text(wave: str = "tooth", relief: str = TIP) -> str:
    return PAIR.replace("WAVE", wave).replace("RELIEF", relief)


def scene(tmp_path: Path, wave: str = "tooth", relief: str = TIP) -> tuple[Train, GearSystem]:
    p = read(tmp_path, text(wave, relief)).system
    return Train(p), build(p)


def test_the_force_is_the_static_one_of_the_mesh(tmp_path: Path) -> None:
    train, system = scene(tmp_path)
    loaded = train.meshes[0].teeth.loaded[0]
    assert loaded.force == pytest.approx(float(static_mesh_force(system)[0]), rel=1e-10)
    assert loaded.force == pytest.approx(200 / (0.048 * np.cos(np.pi / 9)), rel=1e-12)
    assert float(system.meshes[0].mean_stiffness) == loaded.mean
    x = np.linspace(0, 1, 37)
    mesh = system.meshes[0]
    k = mesh.mean_stiffness * (1 + 2 * mesh.epsilon * mesh.waveform.value(x))
    np.testing.assert_allclose(k, loaded.curve.value(x), rtol=1e-12)


@pytest.mark.parametrize("wave", ["tooth", "rectangular", "tooth, harmonics: 3"])
def test_turned_slowly_the_teeth_follow_the_static_transmission_error(tmp_path: Path, wave: str) -> None:
    """Whatever the wave: the force is constant and the deflection is the error, but for inertia, of (Omega/w)^2 with
    w = 7000 rad/s of stiff shafts, and for what kinks of the error excite, which much damping keeps small.
    """
    stiff = text(wave).replace("2.0e4, damping_ratio: 0.05", "2.0e6, damping_ratio: 0.7")
    p = read(tmp_path, stiff.replace("4.0e4, damping_ratio: 0.05", "4.0e6, damping_ratio: 0.7")).system
    train, system = Train(p), build(p)
    loaded = train.meshes[0].teeth.loaded[0]
    omega = 60.0
    found = steady_state(system, omega, 500)
    np.testing.assert_allclose(found.mesh_force[:, 0], loaded.force, rtol=4e-3)
    phase = found.time * omega / (2 * np.pi)
    np.testing.assert_allclose(found.mesh_deflection[:, 0], loaded.error.value(phase), rtol=4e-3)
    speeds = speed_response(system, np.array([omega]), 400)
    assert speeds.dynamic_load_factor[0, 0, 0] == pytest.approx(1.0, abs=4e-3)
    assert speeds.transmission_error_peak_to_peak[0, 0, 0] == pytest.approx(loaded.peak_to_peak, rel=8e-3)


def test_the_response_is_that_of_teeth_with_gaps(tmp_path: Path) -> None:
    """Gaps that open and close as the teeth vibrate, integrated from their law; the linear response about the loaded
    state has the contact of rest, which differs by the vibration over the gaps' growth.
    """
    train, system = scene(tmp_path)
    teeth = train.meshes[0].teeth
    pair, loaded, law = teeth.pairs[0], teeth.loaded[0], teeth.loaded[0]
    omega, g = 2500.0, np.asarray(system.meshes[0].direction)
    mass, damping, rest = (np.asarray(part) for part in (system.mass, system.damping, system.stiffness))
    x = np.arange(4096) / 4096
    s, touching = pair.contacts(x)
    s = np.clip(s, *pair.path)
    k = np.where(touching, single_stiffness(pair, s, teeth.models[0]), 0.0)
    e = law.relief.gap(pair, s)

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        q, v = y[:4], y[4:]
        at = int((omega * t / (2 * np.pi) % 1.0) * 4096)
        force = np.sum(k[at] * np.maximum(g @ q - e[at], 0.0))
        load = np.asarray(system.load)
        return np.concatenate([v, np.linalg.solve(mass, load - damping @ v - rest @ q - force * g)])

    start = steady_state(system, omega, 512)
    period = 2 * np.pi / omega
    y = np.concatenate([start.displacement[0], start.velocity[0]])
    moments = np.linspace(11 * period, 12 * period, 129)
    found = solve_ivp(slope, (0, 12 * period), y, t_eval=moments, rtol=1e-6, max_step=period / 256).y[:4].T @ g
    linear = np.interp(np.linspace(0, period, 129), start.time[:513], start.mesh_deflection[:513, 0])
    vibration = np.ptp(linear)
    assert vibration > 1.05 * loaded.peak_to_peak  # it is no quasi-static motion
    assert np.abs(found - linear).max() < 0.15 * vibration


def test_torque_and_relief_are_axes(tmp_path: Path) -> None:
    axes = """\
sweep:
  input_speed: ["300 rpm", "3000 rpm"]
  input.torque: ["40 N m", "400 N m"]
  meshes.only.relief.tip.amount: ["5 um", "20 um"]
methods: {floquet: {}}
"""
    config = read(tmp_path, text() + axes)
    names = [axis.name for axis in config.axes]
    indices = {names[1]: np.array([[0], [1]]), names[2]: np.array([[0, 1]])}
    system = build(config.at(indices))
    assert system.meshes[0].mean_stiffness.shape == (2, 2)
    x = np.linspace(0.0, 1.0, 57)[:, None, None]
    mesh = system.meshes[0]
    for i in range(2):
        for j in range(2):
            one = build(config.at({names[1]: np.array(i), names[2]: np.array(j)})).meshes[0]
            for name in ("mean_stiffness", "epsilon"):
                assert getattr(mesh, name)[i, j] == pytest.approx(float(getattr(one, name)), rel=1e-13)
            np.testing.assert_allclose(
                mesh.waveform.value(x)[:, i, j], one.waveform.value(x[:, 0, 0]), rtol=1e-11, atol=1e-12
            )


def test_design_finds_the_flattest_error(tmp_path: Path) -> None:
    """Linear relief at one torque, against the least of a search of its own over the amount."""
    section = """\
design:
  range: {input_speed: ["300 rpm", "3000 rpm"]}
  variables: {meshes.only.relief.tip.amount: ["2 um", "40 um"]}
  minimise: transmission_error
"""
    linear = "{tip: {amount: 5 um, length: 6 mm}}"
    config = read(tmp_path, text("rectangular", linear) + section)
    assert config.design is not None
    problem = DesignProblem(config, config.design)
    judge = Judge(problem)
    optimum = search.best(problem, judge, search.first, lambda text: None)
    found = judge.worth(np.stack([problem.given[0], optimum])).objectives[:, 0]
    loaded = scene(tmp_path, relief=linear)[0].meshes[0].teeth.loaded[0]

    def peak_to_peak(amount: float) -> float:
        tip = FlankRelief(amount, 0.006)
        return loaded_mesh(loaded.pair, loaded.model, Relief(pinion_tip=tip, wheel_tip=tip), loaded.force).peak_to_peak

    least = minimize_scalar(peak_to_peak, bounds=(2e-6, 40e-6), method="bounded", options={"xatol": 1e-10})
    assert found[0] == pytest.approx(peak_to_peak(5e-6), rel=1e-12)
    assert found[1] <= least.fun * (1 + 1e-3)
    assert optimum[0] == pytest.approx(least.x, rel=1e-2)


def test_a_design_without_relief_has_no_such_error(tmp_path: Path) -> None:
    section = "design: {range: {mesh_frequency: [100, 200]}, variables: {input.torque: [1, 2]}, minimise: %s}\n"
    plain = text().replace(f", relief: {TIP}", "")
    with pytest.raises(ConfigError, match="needs a mesh with relief"):
        check(read(tmp_path, plain + section % "transmission_error"))
    with pytest.raises(ConfigError, match="teeth with relief share"):
        check(read(tmp_path, text() + section % "root_stress"))


def test_planets_share_the_torque_of_their_set(tmp_path: Path) -> None:
    changed = TWO.replace("meshes: {sun: {}", "meshes: {sun: {relief: {tip: {amount: 8 um, length: 1 mm}}}", 1)
    assert changed != TWO
    p = read(tmp_path, changed).system
    train, system = Train(p), build(p)
    static = static_mesh_force(system)
    for mesh, force in zip(train.meshes, static, strict=True):
        if mesh.teeth.relieved:
            assert mesh.teeth.loaded[0].force == pytest.approx(float(force), rel=1e-9)
    assert sum(force.name.startswith("relief of first.sun.") for force in system.forces) == 4


def helical(wave: str = "tooth") -> str:
    return text(wave).replace("gears: {module", "gears: {helix_angle: 12 deg, module", 1)


@pytest.mark.parametrize("wave", ["tooth", "rectangular"])
def test_turned_slowly_helical_teeth_follow_the_static_transmission_error(tmp_path: Path, wave: str) -> None:
    """Whatever the wave, as for spur teeth: only inertia, of (Omega/w)^2 with w = 7000 rad/s, keeps them from it."""
    stiff = helical(wave).replace("2.0e4, damping_ratio: 0.05", "2.0e6, damping_ratio: 0.7")
    p = read(tmp_path, stiff.replace("4.0e4, damping_ratio: 0.05", "4.0e6, damping_ratio: 0.7")).system
    train, system = Train(p), build(p)
    loaded = train.meshes[0].teeth.loaded[0]
    assert isinstance(loaded, LoadedHelical)
    radius = 0.048 / np.cos(np.radians(12)) * np.cos(np.arctan(np.tan(np.radians(20)) / np.cos(np.radians(12))))
    assert loaded.force == pytest.approx(200 / radius, rel=1e-12)
    assert loaded.force == pytest.approx(float(static_mesh_force(system)[0]), rel=1e-10)
    found = steady_state(system, 60.0, 500)
    np.testing.assert_allclose(found.mesh_force[:, 0], loaded.force, rtol=2e-3)
    phase = found.time * 60.0 / (2 * np.pi)
    np.testing.assert_allclose(found.mesh_deflection[:, 0], loaded.error.value(phase), rtol=2e-3)


def test_the_reduced_wave_keeps_mean_and_is_near_the_computed_one(tmp_path: Path) -> None:
    """The trapezoid of mean contact and levels, against the tangent stiffness: the curvature within levels is left."""
    train = Train(read(tmp_path, helical("rectangular")).system)
    loaded = train.meshes[0].teeth.loaded[0]
    (mesh,) = build(train.p).meshes
    x = np.linspace(0.0, 1.0, 400, endpoint=False)
    k = mesh.mean_stiffness * (1 + 2 * mesh.epsilon * mesh.waveform.value(x - np.asarray(mesh.lag)))
    assert float(mesh.mean_stiffness) == pytest.approx(loaded.mean, rel=1e-12)
    computed = loaded.curve.value(x)
    assert np.abs(k - computed).max() < 0.3 * np.ptp(computed)
    assert np.corrcoef(k, computed)[0, 1] > 0.95


def test_helical_planets_share_the_torque(tmp_path: Path) -> None:
    changed = TWO.replace("meshes: {sun: {}", "meshes: {sun: {relief: {tip: {amount: 8 um, length: 1 mm}}}", 1)
    changed = changed.replace("gears: {", "gears: {helix_angle: 8 deg, ", 1)
    assert "helix_angle" in changed
    p = read(tmp_path, changed).system
    train, system = Train(p), build(p)
    static = static_mesh_force(system)
    relieved = [k for k, mesh in enumerate(train.meshes) if mesh.teeth.relieved]
    assert relieved
    for k in relieved:
        assert isinstance(train.meshes[k].teeth.loaded[0], LoadedHelical)
        assert train.meshes[k].teeth.loaded[0].force == pytest.approx(float(static[k]), rel=1e-9)
