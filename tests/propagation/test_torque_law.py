"""Torques that depend on the speed, against a numerical integration of the law itself."""

from dataclasses import replace
from math import cos, pi, radians, tau

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gearstab
from gearstab.mesh import Mesh
from gearstab.propagation.elastic import single_rows
from gearstab.propagation.first_order import bases
from gearstab.propagation.magnus import StepControl
from gearstab.system import GearSystem
from gearstab.waveforms import Rectangular

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

    start: a guess of a state of the motion; of its error 2 % is left after four e-folds of the slowest decay.
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
    settled = np.ceil(4 * slowest / period) * period
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


# --- the number of steps that points get, with errors that follow a law: c 2^(-p k) after k doublings, above rounding


ORDER = 6
LAST = 12


def reached(size: np.ndarray, tolerance: float, rounding: float = 0.0) -> tuple[np.ndarray, np.ndarray, int]:
    """Levels that points end at, their errors there, and how many of them were computed in all."""
    error, computed = np.full(size.shape, np.nan), 0
    level = np.zeros(size.shape, dtype=int)
    control = StepControl(level, LAST, tolerance, ORDER)
    for current, chosen in control:
        error[chosen] = size[chosen] * 2.0 ** (-ORDER * current) + rounding
        computed += int(chosen.sum())
        control.judge(error[chosen], rounding)
    return level, error, computed


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
def test_every_point_reaches_the_tolerance_with_at_most_one_doubling_too_many(tolerance: float) -> None:
    size = np.geomspace(1e-12, 1e2, 200).reshape(4, 50)
    level, error, computed = reached(size, tolerance)
    assert np.all(error <= tolerance)
    enough = np.maximum(np.ceil(np.log2(size / tolerance) / ORDER), 0)
    assert np.all((level == enough) | (level == enough + 1))
    # One doubling after the other would take a look at each level below.
    assert computed < np.sum(1 + enough) or enough.max() <= 2


def test_more_steps_are_not_tried_against_rounding() -> None:
    level, error, _ = reached(np.geomspace(1e-2, 1e2, 50), 1e-9, rounding=1e-7)
    assert np.all(error <= 2e-7)
    assert level.max() <= 6


@pytest.mark.parametrize(("error", "levels"), [(np.inf, list(range(LAST + 1))), (np.nan, [0])])
def test_results_beyond_doubles_take_twice_the_steps_until_the_last_and_none_where_nothing_is_known(
    error: float, levels: list[int]
) -> None:
    control, seen = StepControl(np.zeros(1, dtype=int), LAST, 1e-9, ORDER), []
    for level, _ in control:
        seen.append(level)
        control.judge(error)
    assert seen == levels


# --- the first-order form against the equations of motion in physical coordinates, and how a batch is flattened


MASS, SPRINGS = np.diag([1.0, 0.3, 4.0]), np.diag([0.5, 0.0, 0.0])
FIRST, SECOND = np.array([1.0, 1.0, 0.0]), np.array([0.0, 1.0, 1.0])
LEVELS = np.array([1.3, 0.6])


def sprung(mean_stiffness: np.ndarray | float = 1.0, grounded: bool = True, damping: float = 0.02) -> GearSystem:
    meshes = (
        Mesh("first", FIRST, np.asarray(mean_stiffness), np.asarray(0.3), Rectangular(1.5)),
        Mesh("second", SECOND, np.asarray(0.8), np.asarray(0.3), Rectangular(1.4)),
    )
    drag = damping * (np.outer(FIRST, FIRST) + 2 * np.outer(SECOND, SECOND))
    return GearSystem(MASS, SPRINGS if grounded else 0 * SPRINGS, meshes, drag)


def physical(system: GearSystem) -> np.ndarray:
    """A of (q, q') with the mesh stiffnesses LEVELS."""
    stiffness = system.stiffness_matrix(list(LEVELS))
    below = -np.linalg.solve(system.mass, np.hstack([stiffness, system.damping]))
    return np.vstack([np.eye(3, 6, 3), below])


@pytest.mark.parametrize("grounded", [True, False])
def test_all_modes_move_as_the_physical_coordinates_do(grounded: bool) -> None:
    system = sprung(grounded=grounded)
    (basis,) = bases(system, whole=True)
    rate = basis.generator(LEVELS[None])[0] * basis.rate[0]
    x = np.random.default_rng(1).standard_normal(basis.size)
    state = np.concatenate([basis.outlet[0] @ x, basis.speed[0] @ x])
    expected = physical(system) @ state
    found = np.concatenate([basis.outlet[0] @ rate @ x, basis.speed[0] @ rate @ x])
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


@pytest.mark.parametrize("grounded", [True, False])
def test_forms_of_stability_and_response_have_the_exponents_of_the_elastic_motion(grounded: bool) -> None:
    """Without its rigid-body motion, whose exponents are two zeros; natural frequencies weight only one of the two."""
    system = sprung(grounded=grounded)
    (basis,), (own,) = bases(system), single_rows(system)
    expected = np.sort_complex(np.linalg.eigvals(physical(system)))
    elastic = expected[np.abs(expected) > 1e-6]
    assert len(elastic) == basis.size == own.form.size == (6 if grounded else 4)
    for form in (basis, own.form):
        found = np.linalg.eigvals(form.generator(LEVELS[None])[0]) * form.rate[0]
        np.testing.assert_allclose(np.sort_complex(found), elastic, atol=1e-13)


def test_an_undamped_rigid_body_mode_stays_out_and_a_damped_one_has_its_velocity() -> None:
    loose = sprung(grounded=False)
    (basis,) = bases(loose)
    assert basis.undamped_rigid.shape == (1, 3, 1)
    held = replace(loose, damping=loose.damping + np.diag([0.1, 0.0, 0.0]))
    (basis,) = bases(held)
    assert basis.undamped_rigid.shape == (1, 3, 0)
    assert basis.size == 5


def test_a_batch_is_flattened_row_by_row() -> None:
    system = sprung(np.arange(1.0, 7.0).reshape(2, 3))
    assert (sprung().rows, system.rows) == (1, 6)
    np.testing.assert_array_equal(system.flat(system.meshes[0].mean_stiffness), np.arange(1.0, 7.0))
    np.testing.assert_array_equal(system.flat(np.array([[1.0], [2.0]])), [1, 1, 1, 2, 2, 2])
    assert system.flat(MASS, 2).shape == (6, 3, 3)
    assert system.operating_points(np.array([1.0, 2.0])).shape == (6, 2)
    points = np.arange(12.0).reshape(6, 2)
    np.testing.assert_array_equal(system.operating_points(points), points)
