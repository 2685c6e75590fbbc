"""The benchmark's reference, its independent segments and its honesty; no times are asserted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import oracle
import pytest
import systems
from planetary_gears import SUPPORTS, parameters, with_epsilon
from scenes import opened, refused, scene_text, succeeds
from systems import two_stage

from gearstab import bench
from gearstab.bench import Scene, costs, measure, reference, without_rigid_modes
from gearstab.bench.methods import METHODS, Entry
from gearstab.floquet import solve
from gearstab.mesh import PeriodicTerm
from gearstab.modal import mean_modes
from gearstab.system import GearSystem
from gearstab.systems import build
from gearstab.waveforms import Fourier, Trapezoidal

CONFIG = scene_text("bench_config")


def test_reference_agrees_with_the_oracle():
    scene = Scene(systems.train(0.3, (1.4, 1.7), 0.2, "1/2"), 0.5, 7.0)
    for omega in (0.61, 2.05, 5.3):
        exact = oracle.solve(oracle.plain(scene.system), omega)
        expected = float(exact.growth_rate * exact.period)
        # The scene's segments are rounded to doubles, the oracle's are exact.
        assert reference.growth(scene, omega) == pytest.approx(expected, abs=1e-14)


def test_extended_doubles_agree_with_thirty_digits():
    if np.finfo(np.longdouble).nmant < 63:
        pytest.skip("this processor has no extended doubles")
    scene = Scene(systems.train(0.3, (1.4, 1.7), damping=np.diag([0.02, 0.01, 0.03])), 0.5, 7.0)
    for omega in (0.6, 2.0, 5.3):
        # A period of ten segments in 64 bits, 5e-20 each operation, some hundred operations an exponential.
        assert reference.extended(scene, omega) == pytest.approx(reference.multiprecision(scene, omega), abs=2e-16)


def test_scene_has_the_segments_of_the_oracle():
    scene = Scene(systems.train(0.3, (1.4, 1.7), 0.2, "2/3"), 0.5, 7.0)
    ours = [s for s in scene.segments if s[0] > 1e-12]
    theirs = [s for s in oracle.segments(oracle.plain(scene.system)) if s[0] > 1e-12]
    np.testing.assert_allclose([d for d, _ in ours], [float(d) for d, _ in theirs], atol=1e-14)
    np.testing.assert_allclose([k for _, k in ours], [[float(x) for x in k] for _, k in theirs], atol=1e-14)


@pytest.mark.parametrize("entry", METHODS, ids=lambda entry: entry.name)
def test_every_method_finds_the_growth(entry: Entry):
    """At its finest tolerance, on points well inside tongues, where the growth is a smooth function of M."""
    damped = systems.train(0.3, damping=np.diag([0.02, 0.01, 0.03]))
    for system in (systems.train(0.3), damped):
        scene = Scene(system, 1.95, 5.4)
        if not entry.fits(scene):
            continue
        omega = np.array([2.0, 5.3])
        period = 2 * np.pi * scene.cycles / omega
        expected = solve(system, omega).growth_rate[0] * period
        np.testing.assert_allclose(entry.run(scene, omega, min(entry.tolerances)), expected, atol=2e-8)


def smooth_train(**other: object) -> GearSystem:
    """The train with a trapezoidal and a harmonic wave at other frequencies, and what is asked for."""
    first, second = systems.train(0.3).meshes
    waves = Trapezoidal(np.array(1.6), np.array(0.2)), Fourier(np.array([0.3, 0.1]), np.array([0.2, 0.0]))
    meshes = replace(first, waveform=waves[0]), replace(second, waveform=waves[1], lag=0.15)
    return replace(systems.train(0.3), meshes=meshes, **other)


FRICTION = PeriodicTerm("friction", np.array([0.1, 0.05, -0.02]), np.array([1.0, 1.0, 0.0]), Trapezoidal(1.4, 0.3))


@pytest.mark.parametrize("entry", METHODS, ids=lambda entry: entry.name)
@pytest.mark.parametrize("terms", [(), (FRICTION,)], ids=["mesh stiffness", "friction"])
def test_every_method_finds_the_growth_of_smooth_systems(entry: Entry, terms: tuple[PeriodicTerm, ...]):
    """At its finest tolerance, to the reference, which is another method of another precision."""
    scene = Scene(smooth_train(terms=terms, damping=np.diag([0.02, 0.01, 0.03])), 1.0, 5.4)
    if not entry.fits(scene):
        return
    omega = np.array([1.9, 3.3])
    expected = [reference.growth(scene, value) for value in omega]
    # Hill's method cuts off the harmonics of kinks, a part 1e-5 of them.
    tolerance = 1e-4 if entry.name == "Hill's method" else 1e-8
    np.testing.assert_allclose(entry.run(scene, omega, min(entry.tolerances)), expected, atol=tolerance)


def test_collocation_agrees_with_thirty_digits():
    scene = Scene(systems.train(0.3, (1.4, 1.7), damping=np.diag([0.02, 0.01, 0.03])), 0.5, 7.0)
    for omega in (0.6, 2.0, 5.3):
        # Of order 16 with short steps, in 64 bits.
        assert reference.collocation(scene, omega) == pytest.approx(reference.multiprecision(scene, omega), abs=2e-16)


def test_measurements_are_honest():
    """Exact methods to rounding error; the error of an integrator falls with its tolerance."""
    found = measure(Scene(systems.train(0.3), 0.5, 7.0), points=4, budget=0.0)
    by_name: dict[str, list[float]] = {}
    for m in found:
        by_name.setdefault(m.method, []).append(m.error)
        assert m.seconds > 0
    for name, errors in by_name.items():
        if len(errors) == 1:
            assert errors[0] < 1e-12, name
        else:
            assert errors[-1] < 1e-3 * errors[0], name


def test_mass_proportional_damping_is_measured_by_every_method():
    system = systems.train(0.3)
    scene = Scene(replace(system, damping=0.02 * system.mass), 0.5, 7.0)
    names = {m.method for m in measure(scene, points=2, budget=0.0) if m.error < 1e-6}
    assert "NumPy products + eigvals" in names


def test_a_run_shorter_than_a_tick_of_the_clock_is_repeated(monkeypatch: pytest.MonkeyPatch):
    ticks = iter([5.0, 5.0, 5.0, 5.0, 5.5])
    monkeypatch.setattr(bench, "process_time", lambda: next(ticks))
    runs = []
    entry = replace(METHODS[0], run=lambda *given: runs.append(given))
    assert bench._timed(entry, None, np.zeros(1), 0.0) == 0.5 / 4
    assert len(runs) == 4


def test_command(tmp_path):
    (tmp_path / "train.yaml").write_text(CONFIG)
    target = tmp_path / "out" / "train.h5"
    arguments = ["bench", str(tmp_path / "train.yaml"), "-o", str(target), "--points", "2", "--seconds", "0", "-q"]
    result = succeeds(*arguments)
    assert "products of expm" in result.output
    assert target.with_suffix(".png").stat().st_size > 10_000
    bench = opened(target)["bench"].to_dataset()
    assert set(bench) >= {"seconds", "error", "wrong_flags"}
    assert np.all(bench["wrong_flags"].values[np.isnan(bench["tolerance"].values)] == 0)


def test_command_says_what_a_point_costs_where_speeds_turn(tmp_path, monkeypatch):
    monkeypatch.setattr(costs, "POINTS", 64)
    monkeypatch.setattr(costs, "PRODUCTS", 8)
    (tmp_path / "rotor.yaml").write_text(TURNING)
    result = succeeds("bench", tmp_path / "rotor.yaml", "-q")
    held, follows = result.output.splitlines()
    assert held.startswith("speeds held: ")
    assert follows.startswith("speeds that follow the mesh frequency: ")
    for line in (held, follows):
        assert float(line.split()[-1]) < 1e-9, line
    monkeypatch.setattr(costs, "SMOOTH_POINTS", 16)
    (tmp_path / "smooth.yaml").write_text(SMOOTH)
    result = succeeds("bench", tmp_path / "smooth.yaml", "-q")
    for line in result.output.splitlines():
        assert "points/s; multipliers are right to" in line
        assert 0 < float(line.split()[-1]) <= 1e-9, line


def test_command_needs_a_mesh_frequency_axis(tmp_path):
    text = CONFIG.replace("mesh_frequency: {start: 0.5, stop: 7.0, num: 50}", "epsilon: [0.1, 0.2]")
    (tmp_path / "train.yaml").write_text(text.replace("floquet: {}", "perturbation: {}"))
    assert "mesh_frequency" in refused("bench", tmp_path / "train.yaml")


ROTOR = scene_text("bench_rotor")
TURNING = ROTOR.replace(
    "  meshes", '  rotation: {speed_ratio: "1/20", gyroscopic: [[0.0, 0.5], [-0.5, 0.0]]}\n  meshes'
)
SMOOTH = TURNING.replace("contact_ratio: 1.5}", "contact_ratio: 1.5, waveform: {kind: trapezoidal, ramp: 0.2}}")
APART = ROTOR.replace("[1.0, -1.0],", "[1.0, -1.0], frequency_ratio: 0.7123456, exact: false,")


def test_command_refuses_what_its_scenes_do_not_hold(tmp_path):
    (tmp_path / "system.yaml").write_text(APART)
    said = refused("bench", tmp_path / "system.yaml")
    assert "bench: " in said
    assert "irrational ratio" in said


# --- scenes of the benchmark: systems without their rigid-body modes


def train(**changes: object) -> GearSystem:
    meshes = {"epsilon": (0.3, 0.2), "contact_ratio": (1.4, 1.7), "phasing": 0.2, "second": {"damping": 0.01}}
    return build(two_stage(**{"mean_stiffness": (1.0, 1.2), "input_shaft_stiffness": 0.0} | meshes | changes))


@pytest.mark.parametrize("damping", [{}, {"damping_ratio": 0.01}])
def test_stability_is_that_of_the_whole_system(damping: dict[str, float]) -> None:
    whole = train(**damping)
    elastic = without_rigid_modes(whole)
    assert elastic.size == whole.size - 1
    omega = np.linspace(0.5, 7.0, 200)
    # The same exponents from matrices of another size: rounding of two products, a few 1e-14.
    np.testing.assert_allclose(solve(elastic, omega).growth_rate, solve(whole, omega).growth_rate, atol=1e-12)
    frequency = mean_modes(whole).natural_frequency
    np.testing.assert_allclose(mean_modes(elastic).natural_frequency, frequency[1:], rtol=1e-13)


def test_a_planetary_gear_keeps_its_symmetry() -> None:
    """A turn of the planets takes the elastic modes into one another: it is an isometry of their energies."""
    supports = SUPPORTS | {"carrier_rotation": 0.0, "sun_rotation": 0.0}
    whole = build(with_epsilon(parameters(harmonics=1, supports=supports), 0.2))
    elastic = without_rigid_modes(whole)
    assert elastic.size < whole.size
    (symmetry,) = elastic.symmetries
    turn = symmetry.turn
    for matrix in (elastic.mass, elastic.stiffness_matrix([mesh.mean_stiffness for mesh in elastic.meshes])):
        np.testing.assert_allclose(turn.T @ matrix @ turn, matrix, atol=1e-10 * np.abs(matrix).max())
    np.testing.assert_allclose(np.linalg.matrix_power(turn, symmetry.order), np.eye(elastic.size), atol=1e-10)
    omega = np.linspace(0.3, 2.0, 40) * mean_modes(elastic).natural_frequency[-1]
    found = solve(elastic, omega).growth_rate
    assert found.max() > 0
    np.testing.assert_allclose(found, solve(whole, omega).growth_rate, atol=1e-10 * found.max())


def test_a_system_without_rigid_modes_stays_as_it_is() -> None:
    whole = train(input_shaft_stiffness=0.5)
    assert without_rigid_modes(whole) is whole


def test_rigid_modes_stay_where_damping_couples_them() -> None:
    whole = replace(train(), damping=np.diag([0.1, 0.0, 0.0]))
    assert without_rigid_modes(whole) is whole
