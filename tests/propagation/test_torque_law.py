"""Torques that depend on the speed, against a numerical integration of the law itself."""

from math import cos, pi, radians, tau

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gearstab

RPM = pi / 30
SPEED = 3000 * RPM
TEETH = (20, 40)
FAN = {"at": "1500 rpm", "torque": 60.0, "exponent": 2}
STIFFNESS, EPSILON, SHAFT = 2e8, 0.2, (4e3, 6e3)
INERTIAS = {"motor": 4e-3, "pinion": 2e-4, "wheel": 3e-3, "fan": 2e-2}


def train(output, **more):
    return {
        "kind": "gearbox",
        "gears": {"pressure_angle": "20 deg", "module": "3 mm", "face_width": "20 mm"},
        "rotors": [
            {"name": name, "inertia": inertia} | ({"teeth": dict(zip(("pinion", "wheel"), TEETH, strict=True))[name]}
                                                 if name in ("pinion", "wheel") else {})
            for name, inertia in INERTIAS.items()
        ],
        "shafts": [
            {"name": "first", "between": ["motor", "pinion"], "stiffness": SHAFT[0], "damping_ratio": 0.02},
            {"name": "last", "between": ["wheel", "fan"], "stiffness": SHAFT[1], "damping_ratio": 0.02},
        ],
        "meshes": [{"name": "mesh", "gears": ["pinion", "wheel"], "mean_stiffness": STIFFNESS, "epsilon": EPSILON,
                    "waveform": {"kind": "fourier", "cos": [1.0]}, "damping_ratio": 0.05}],
        "input": {"rotor": "motor", "speed": "3000 rpm"} | more,
        "outputs": [{"rotor": "fan", **output}],
    }  # fmt: skip


def slope_of(law, speed=SPEED / 2):
    """Damping of the fan's rotation, N m s."""
    system = gearstab.build(train({"torque_law": law}))
    fan = system.coordinates.index("fan")
    with_law, without = (gearstab.build(train(end)).damping_matrix for end in ({"torque_law": law}, {"torque": 1.0}))
    difference = with_law - without
    assert np.count_nonzero(difference) == 1
    torque = -float(system.load[fan])
    return torque, float(difference[fan, fan])


@pytest.mark.parametrize(
    ("law", "torque", "slope"),
    [
        (FAN, 60.0, 2 * 60.0 / (1500 * RPM)),
        (FAN | {"exponent": -1}, 60.0, -60.0 / (1500 * RPM)),
        ({"polynomial": [10.0, 0.1, 1e-3]}, 10.0 + 0.1 * 50 * pi + 1e-3 * (50 * pi) ** 2, 0.1 + 2e-3 * 50 * pi),
        ({"speeds": ["0 rpm", "1000 rpm", "2000 rpm"], "torques": [0.0, 20.0, 40.0]}, 30.0, 0.02 / RPM),
    ],
)
def test_torque_and_slope_of_each_form(law, torque, slope):
    """The wheel has twice the teeth, so that the fan turns at 1500 rpm."""
    assert slope_of(law) == pytest.approx((torque, slope), rel=1e-12)


def test_a_table_of_a_fan_is_near_its_power():
    speeds = np.linspace(500, 2500, 21)
    table = {"speeds": [f"{n} rpm" for n in speeds], "torques": (60.0 * (speeds / 1500) ** 2).tolist()}
    # Cubics through points h apart whose slopes are those of parabolas but for h^2.
    assert slope_of(table) == pytest.approx(slope_of(FAN), rel=5e-3)


def test_input_torque_that_falls_with_the_speed_damps():
    outputs = {"torque_law": {"speeds": ["2900 rpm", "3100 rpm"], "torques": [30.0, 10.0]}}
    system = gearstab.build(train({}, **outputs))
    without = gearstab.build(train({}, torque=20.0))
    motor = system.coordinates.index("motor")
    assert (system.damping_matrix - without.damping_matrix)[motor, motor] == pytest.approx(0.1 / RPM, rel=1e-12)
    np.testing.assert_allclose(system.load, without.load, rtol=1e-12)


def integrated(speed, start):
    """Mean mesh force and amplitude of its first harmonic, by an integration of the quadratic law itself.

    start: a guess of a state of the motion; of its error 3e-4 is left after eight e-folds of the slowest decay.
    """
    r = [0.003 * z / 2 * cos(radians(20)) for z in TEETH]
    inertia = np.array([*INERTIAS.values()])
    g = np.array([0.0, r[0], -r[1], 0.0])
    shafts = [(np.array([1.0, -1, 0, 0]), SHAFT[0], 0, 1), (np.array([0, 0, 1.0, -1]), SHAFT[1], 2, 3)]
    static = sum(k * np.outer(row, row) for row, k, _, _ in shafts)
    drag = sum(
        2 * 0.02 * np.sqrt(k * inertia[i] * inertia[j] / (inertia[i] + inertia[j])) * np.outer(row, row)
        for row, k, i, j in shafts
    )
    mobility = r[0] ** 2 / inertia[1] + r[1] ** 2 / inertia[2]
    drag = drag + 2 * 0.05 * np.sqrt(STIFFNESS / mobility) * np.outer(g, g)
    omega, fan = TEETH[0] * speed, speed / 2

    def law(velocity):
        return 60.0 * (velocity / (1500 * RPM)) ** 2

    def motion(t, x):
        stiff = STIFFNESS * (1 + 2 * EPSILON * cos(omega * t))
        torque = -(static + stiff * np.outer(g, g)) @ x[:4] - drag @ x[4:]
        torque = torque + np.array([law(fan) / 2, 0.0, 0.0, -law(fan + x[7])])
        return np.concatenate([x[4:], torque / inertia])

    period = tau / omega
    slowest = (inertia[0] + inertia[1] + (inertia[2] + inertia[3]) / 4) / (2 * 60.0 / (1500 * RPM) / 4)
    settled = np.ceil(8 * slowest / period) * period
    times = settled + period * np.arange(200) / 200
    history = solve_ivp(motion, (0, times[-1]), start, "DOP853", times, rtol=1e-8, atol=1e-12).y
    force = STIFFNESS * (1 + 2 * EPSILON * np.cos(omega * times)) * (g @ history[:4])
    spectrum = np.fft.rfft(force) / len(force)
    return spectrum[0].real, 2 * abs(spectrum[1]), history


def test_steady_state_of_a_fan_is_that_of_its_law():
    speed = 3000 * RPM
    respond = {"input_speed": "3000 rpm", "steady_state": True, "samples_per_cycle": 200}
    found = gearstab.respond({"system": train({"torque_law": FAN}), "respond": respond})["response"]
    start = np.concatenate([found[name].values[0] for name in ("displacement", "velocity")])
    mean, first, history = integrated(speed, start)
    force = found["mesh_force"].values[:-1, 0]
    spectrum = np.fft.rfft(force) / len(force)
    # The law itself is parabolic: what is left out is of second order in the vibration, here below 1e-6 of the speed.
    assert np.abs(history[7] / (speed / 2)).max() < 1e-3
    assert spectrum[0].real == pytest.approx(mean, rel=2e-5)
    assert 2 * abs(spectrum[1]) == pytest.approx(first, rel=2e-5)


def test_sweeps_over_the_input_speed_take_torque_and_slope_there():
    speeds = [2000.0, 3000.0]
    sweep = {"input_speed": [f"{n} rpm" for n in speeds]}
    found = gearstab.sweep(
        {"system": train({"torque_law": FAN}), "sweep": sweep, "methods": {"response": {}, "floquet": {}}}
    )
    each = [
        gearstab.sweep({
            "system": train({"torque_law": FAN}, speed=f"{n} rpm"), "sweep": {"input_speed": [f"{n} rpm"]},
            "methods": {"response": {}, "floquet": {}},
        })
        for n in speeds
    ]  # fmt: skip
    for group, name in (("response", "mesh_force_peak"), ("floquet", "growth_rate")):
        expected = np.concatenate([tree[group][name].values for tree in each])
        np.testing.assert_allclose(found[group][name].values, expected, rtol=1e-9)
    means = found["response"]["mesh_force_mean"].values[:, 0]
    assert means[1] / means[0] == pytest.approx((3 / 2) ** 2, rel=1e-6)
