"""Forces of bearings and torques of shafts against balances of forces and a numerical integration."""

from math import tau

import numpy as np
import pytest
from scenes import scene_data
from scipy.integrate import solve_ivp

import gearstab
from gearstab.config import ConfigError
from gearstab.errors import PlotError
from gearstab.plots import draw

SPEED = 7000.0
TRAIN = scene_data("bearings_train")
GEARBOX = scene_data("bearings_gearbox")


def swept(system, speeds, **options):
    """Return the steady states of a system over mesh frequencies."""
    methods = {"response": {"bearings": True, **options}}
    return gearstab.sweep({"system": system, "sweep": {"mesh_frequency": speeds}, "methods": methods})["response"]


def test_shaft_of_a_train_as_a_numerical_integration_finds_it():
    """A general integrator knows nothing of panels. The motion that is the same after a period starts at x with
    x = M x + b, where b is where it gets from rest, and M what it makes of each coordinate without the load.
    """
    system, found = gearstab.build(TRAIN), swept(TRAIN, [SPEED])
    inverse = np.linalg.inv(system.mass)
    directions = [mesh.direction for mesh in system.meshes]

    def motion(t, states, loads):
        """Change of motions ``(6 k,)`` under the parts ``(k,)`` of the load."""
        x = states.reshape(6, -1)
        stiff = 1e8 * (1 + 2 * 0.3 * np.cos(SPEED * t))
        matrix = system.stiffness + sum(stiff * np.outer(g, g) for g in directions)
        force = np.outer(system.load, loads) - matrix @ x[:3] - system.damping @ x[3:]
        return np.concatenate([x[3:], inverse @ force]).ravel()

    def integrated(start, times, loads):
        given = (0, times[-1]), start.ravel(), "DOP853", times
        return solve_ivp(motion, *given, args=(loads,), rtol=1e-11, atol=1e-16).y

    period = tau / SPEED
    after = integrated(np.eye(6, 7), np.array([period]), np.eye(1, 7, 6)[0]).reshape(6, 7)
    start = np.linalg.solve(np.eye(6) - after[:, :6], after[:, 6])
    history = integrated(start, period * np.arange(2000) / 2000, np.ones(1))
    force = 1e8 * history[0]
    harmonics = 2 * np.abs(np.fft.rfft(force)[1:5]) / len(force)
    # Of a peak, 2000 samples a period miss (n pi/2000)^2/2 for the n-th harmonic; the integrator is right to 1e-9.
    assert float(found["shaft_torque_peak"].squeeze()) == pytest.approx(np.abs(force).max(), rel=1e-5)
    assert float(found["shaft_torque_mean"].squeeze()) == pytest.approx(force.mean(), rel=1e-7)
    assert float(found["shaft_torque_rms"].squeeze()) == pytest.approx(force.std(), rel=1e-7)
    np.testing.assert_allclose(found["shaft_torque_harmonic"].squeeze(), harmonics, rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(found["mesh_order"], [1, 2, 3, 4])


def test_means_of_all_forces_on_a_body_are_in_balance():
    found = swept(TRAIN, np.linspace(3000.0, 30000.0, 7).tolist())
    sums = found["shaft_torque_mean"].squeeze() + found["mesh_force_mean"].sel(mesh="first")
    # Accelerations and modal damping have no mean; the error is that of the integrals.
    np.testing.assert_allclose(sums, 900.0, rtol=1e-8)


def test_forces_on_a_wheel_are_its_mass_times_its_acceleration():
    respond = {"mesh_frequency": 9000.0, "steady_state": True, "samples_per_cycle": 4000}
    found = gearstab.respond({"system": GEARBOX, "respond": respond})["response"]
    system = gearstab.build(GEARBOX)
    for name in ("wheel.x", "wheel.y", "pinion.x"):
        place = system.coordinates.index(name)
        force = found["bearing_force"].sel(bearing=name) + found["mesh_force"][:, 0] * system.meshes[0].direction[place]
        step = float(found["time"][1] - found["time"][0])
        impulse = np.concatenate([[0.0], np.cumsum((force[1:].values + force[:-1].values) / 2) * step])
        momentum = system.mass[place, place] * found["velocity"].sel(dof=name).values
        # The trapezoidal rule errs by one jump of the force in a step, at each of two jumps.
        size = float(np.abs(force).max())
        np.testing.assert_allclose(momentum[0] - impulse, momentum, rtol=0, atol=2 * size * step)


def test_peaks_and_means_of_a_sweep_are_those_of_the_histories():
    respond = {"mesh_frequency": 9000.0, "steady_state": True, "samples_per_cycle": 4000}
    history = gearstab.respond({"system": GEARBOX, "respond": respond})["response"]
    found = swept(GEARBOX, [9000.0], samples_per_cycle=200)
    for name in ("bearing_force", "shaft_torque"):
        values, low = history[name].values[:-1], found[f"{name}_peak"].values[0]
        np.testing.assert_allclose(found[f"{name}_mean"][0], values.mean(axis=0), rtol=1e-3)
        # Samples lie up to half a step beside a peak, and beside a jump of what the mesh pushes.
        np.testing.assert_allclose(low, np.abs(values).max(axis=0), rtol=1e-4)
    assert found["bearing_force_peak"].attrs["units"] == "N"
    assert found["shaft_torque_peak"].attrs["units"] == "N m"


def test_bearings_of_a_train_without_any_are_refused():
    system = TRAIN | {"input_shaft_stiffness": 0.0}
    with pytest.raises(ConfigError, match="no bearing and no shaft"):
        swept(system, [SPEED])


def test_orders_of_a_slow_run_up_are_those_of_steady_states():
    """So slowly that the motion follows: within the part by which the speed changes in a window."""
    respond = {"mesh_frequency": 9000.0, "ramp": {"to": 9400.0, "rate": 400.0}, "samples_per_cycle": 40}
    found = gearstab.respond({"system": GEARBOX, "respond": respond})["response"]
    middle = found.sizes["mesh_frequency"] // 2
    steady = swept(GEARBOX, [float(found["mesh_frequency"][middle])], samples_per_cycle=400)
    for name in ("bearing_force_harmonic", "shaft_torque_harmonic"):
        ramp, expected = found[name].values[middle], steady[name].values[0]
        np.testing.assert_allclose(ramp, expected, rtol=0.01, atol=0.01 * expected.max())
    np.testing.assert_allclose(found["mesh_order"], steady["mesh_order"])
    system, last = gearstab.build(GEARBOX), found.isel(time=-1)
    for item in system.connections:
        name = "shaft_torque" if item.unit == "N m" else "bearing_force"
        force = item.force(last["displacement"].values, last["velocity"].values)
        assert float(last[name].sel({item.part.value: item.name})) == pytest.approx(float(force), rel=1e-12)


# --- orders of the forces of bearings and shafts over the speed, and levels in dB


TEETH = 20
CONFIG = scene_data("bearings_orders")


@pytest.fixture(scope="module")
def tree():
    return gearstab.sweep(CONFIG)


def test_orders_are_labelled_by_turns_of_the_input_shaft(tree):
    _, artists = draw(tree, "orders")
    found = tree["response"]["bearing_force_harmonic"]
    largest = np.sort(np.argsort(-found.max(("input_speed", "bearing")).values)[:4])
    assert len(artists["lines"]) == 4 * found.sizes["bearing"]
    for line, order in zip(artists["lines"], largest, strict=False):
        multiple = float(found["mesh_order"][order])
        assert line.get_label().startswith(f"order {TEETH * multiple:g} (")
        np.testing.assert_allclose(line.get_ydata(), found[:, order, 0])
        np.testing.assert_allclose(line.get_xdata(), np.linspace(2000, 4000, 5))


@pytest.mark.parametrize("kind", ["orders", "speeds"])
def test_levels_refer_to_a_micronewton(tree, kind):
    variable = {"orders": "bearing_force_harmonic", "speeds": "bearing_force_peak"}[kind]
    figure, artists = draw(tree, kind, variable=variable, select={"bearing": "motor.y"}, unit=["dB", "input_speed=Hz"])
    values = tree["response"][variable].sel(bearing="motor.y").values.reshape(5, -1)
    np.testing.assert_allclose(artists["lines"][0].get_ydata(), 120 + 20 * np.log10(values[:, 0]), rtol=1e-12)
    np.testing.assert_allclose(artists["lines"][0].get_xdata(), np.linspace(2000, 4000, 5) / 60)
    assert "dB re 1" in figure.axes[0].get_ylabel().replace("\n", " ")


def test_what_cannot_be_drawn_is_one_line(tree):
    with pytest.raises(PlotError, match=r"kind modes shows no amplitudes as levels; --kind: speeds, orders"):
        draw(tree, "modes", unit=["dB"])
    with pytest.raises(
        PlotError, match=r"no variable 'growth_rate' with orders over the speed; there is bearing_force"
    ):
        draw(tree, "orders", variable="growth_rate")
    with pytest.raises(PlotError, match=r"no axis 'epsilon' to select in this figure; there is mesh_order, bearing"):
        draw(tree, "orders", select={"epsilon": "0.1"})
    without = gearstab.sweep({**CONFIG, "methods": {"response": {}}})
    with pytest.raises(PlotError, match=r"methods\.response with bearings: true"):
        draw(without, "orders")
