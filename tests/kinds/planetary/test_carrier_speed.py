"""Planetary gears whose carrier turns: natural frequencies, divergence, multipliers, free rotation, the elastic ring.

tests/data/rotation/carrier_speed.json holds natural frequencies in carrier coordinates (numpy, the Hamiltonian form and
mpmath agree) and multipliers over a mesh cycle (carrier frame and fixed frame agree to 4e-11).
"""

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from driven import breaks, force_and_matrices
from planetary_gears import parameters
from scipy.integrate import solve_ivp
from scipy.linalg import eigh
from scipy.spatial.transform import Rotation

import gearstab as gs
from gearstab.config import ConfigError, load
from gearstab.errors import NotPossible
from gearstab.floquet import solve
from gearstab.floquet.general.mean import mean_motions
from gearstab.mesh import speed_factors
from gearstab.propagation.elastic import mean_levels, single_rows
from gearstab.response import steady_state
from gearstab.system import GearSystem
from gearstab.systems import build

Array = np.ndarray
DATA = json.loads((Path(__file__).parents[2] / "data" / "rotation" / "carrier_speed.json").read_text())
GEARS, FRAMES = DATA["carrier_speed"]["cases"], DATA["frames"]["cases"]
BODIES = ("ring", "carrier", "sun", "planet")


def section(own: dict[str, Any], speed: Any, waves: dict[str, Any] | None = None, **changes: Any) -> dict[str, Any]:
    """A gear of the reference as the section ``system``; without waves all in phase, at their mean stiffness."""
    waves = waves or {
        "epsilon": 0.0, "contact_ratio_sun": 1.5, "contact_ratio_ring": 1.5,
        "gamma_sn": [0.0] * own["planets"], "gamma_sr": 0.0,
    }  # fmt: skip
    meshes = {
        name: {
            "mean_stiffness": own[key],
            "epsilon": waves["epsilon"],
            "contact_ratio": waves[f"contact_ratio_{name}"],
        }
        for name, key in (("sun", "k_sp"), ("ring", "k_rp"))
    }
    held = {name: own[f"k_{name[0]}"] for name in BODIES}
    held |= {f"{name}_rotation": own[f"k_{name[0]}u"] for name in ("ring", "carrier", "sun")}
    return {
        "kind": "planetary", "planets": own["planets"], "ring": {"kind": "rigid"},
        "masses": {name: own[f"m_{name[0]}"] for name in BODIES},
        "inertias": {name: own[f"I_{name[0]}"] for name in BODIES},
        "supports": held, "pressure_angles": {"sun": own["alpha_s"], "ring": own["alpha_r"]}, "meshes": meshes,
        "phases": {"sun": waves["gamma_sn"], "sun_ring": waves["gamma_sr"]}, "carrier_speed": speed,
    } | changes  # fmt: skip


def built(own: dict[str, Any]) -> GearSystem:
    return build(load({"system": own}).system)


@pytest.mark.parametrize("gear", GEARS, ids=[gear["name"] for gear in GEARS])
@pytest.mark.parametrize(("key", "preload"), [("as_printed", False), ("with_pin_preload", True)])
def test_natural_frequencies_of_a_turning_carrier(gear: dict[str, Any], key: str, preload: bool) -> None:
    for row in gear[key]:
        speed = {"speed": row["carrier_speed_rad_s"]}
        found = mean_motions(built(section(gear["parameters"], speed, pin_preload=preload)))
        expected = np.array(row["whirl_frequencies_rad_s"])
        own = found.frequency[0]
        np.testing.assert_allclose(own[own > 1e-3], expected[expected > 1e-3], rtol=1e-9)
        # The motion that diverges where pins carry no preload; the free rotation has no growth at all with it.
        growth = max((real for real, _ in row["growing_eigenvalues_re_absim"]), default=0.0)
        if preload or row["carrier_speed_rad_s"] > 0:
            # Rounding of a real exponent: of the largest one.
            assert found.growth_rate.max() == pytest.approx(growth, abs=1e-10 * expected.max())


@pytest.mark.parametrize("gear", GEARS, ids=[gear["name"] for gear in GEARS])
def test_critical_speeds_of_the_printed_model(gear: dict[str, Any]) -> None:
    """det(K + W^2 K_c) = 0: at these speeds, and at none beside them, a motion rests in carrier coordinates."""
    system = built(section(gear["parameters"], "1/82", pin_preload=False))
    ((own,), (level,)) = single_rows(system), mean_levels(system)

    def smallest(speed: float) -> float:
        values = np.linalg.svd(own.form.generator(level[None], np.array([82 * speed]))[0], compute_uv=False)
        return float(values[-1] / values[0])

    for critical in gear["critical_speeds_as_printed_rad_s"]:
        if critical > 0:
            assert smallest(critical) < 1e-9 * smallest(critical * 1.001)


@pytest.mark.parametrize("row", DATA["frames"]["pin_preload_from_nonlinear_model"])
def test_the_preload_of_pins_is_that_of_the_nonlinear_model(row: dict[str, Any]) -> None:
    """The second derivative of the potential of a carrier with its planets, in fifty digits."""
    own = GEARS[0]["parameters"] | {key: row[key] for key in ("planets", "m_p", "k_p")}
    (rotation,) = built(section(own, {"speed": row["W"]})).rotations
    (term,) = [term for term in rotation.terms() if np.any(term.softening)]
    speed, power, softening = (np.asarray(v) for v in (term.speed, term.power, term.softening))
    found = float(speed_factors(speed, power, softening)) * np.asarray(term.matrix)
    carrier = built(section(own, 0)).coordinates.index("carrier_rotation")
    assert found[carrier, carrier] == pytest.approx(row["Hessian_theta_theta_over_rc2_minus_N_kp"], rel=1e-12)
    assert np.count_nonzero(found) == 1


@pytest.mark.parametrize("case", FRAMES, ids=[case["name"] for case in FRAMES])
def test_multipliers_over_a_mesh_cycle(case: dict[str, Any]) -> None:
    own = section(case["parameters"], f"1/{case['ring_teeth']}", case, pin_preload=case["pin_preload"])
    found = solve(built(own), np.array([case["mesh_frequency_rad_s"]]), exponents=True)
    multipliers = np.exp(found.exponents[0, 0] * case["mesh_cycle"])
    expected = np.array([complex(*value) for value in case["multipliers_over_mesh_cycle_carrier_frame"]])
    gap = np.abs(multipliers[:, None] - expected)
    assert gap.min(axis=0).max() < 1e-9 * np.abs(expected).max()
    left_out = np.sort(np.abs(multipliers - 1))[: case["multipliers_of_free_rotation_left_out"]]
    # Neither of both is one to the root of rounding only, as a double multiplier would be.
    assert left_out.max(initial=0.0) < 1e-12
    assert found.growth_rate[0, 0] == pytest.approx(case["growth_rate"], rel=1e-9)


@pytest.mark.parametrize("case", FRAMES, ids=[case["name"] for case in FRAMES])
def test_growth_in_the_fixed_frame(case: dict[str, Any]) -> None:
    """X = R(W t) x of every body: no force of the frame is left, and all directions turn instead (DOP853).

    As K(t + T) = R(W T) K(t) R(W T)^T, multipliers over a whole turn are powers of those of R(W T)^-1 P(T).
    """
    own, speed, period = case["parameters"], case["carrier_speed_rad_s"], case["mesh_cycle"]
    rest, omega = built(section(own, 0, case)), case["mesh_frequency_rad_s"]
    n, pull = rest.size, speed**2 * own["m_p"]
    pins = np.zeros(n)
    if case["pin_preload"]:
        pins[rest.coordinates.index("carrier_rotation")] = own["planets"] * pull * own["k_p"] / (own["k_p"] - pull)

    def frame(angle: float) -> Array:
        """R: translations of a body turn, its rotation does not."""
        return np.kron(np.eye(n // 3), Rotation.from_euler("z", angle).as_matrix())

    def rate(t: float, y: Array, stiffness: Array) -> Array:
        turn, state = frame(speed * t), y.reshape(2 * n, 2 * n)
        return np.concatenate([state[n:], -turn @ (stiffness @ (turn.T @ state[:n]))]).ravel()

    state = np.eye(2 * n).ravel()
    for a, b in pairwise(breaks(rest, omega, period)):
        _, stiffness, _ = force_and_matrices(rest, omega, 0.5 * (a + b))
        acceleration = np.linalg.solve(rest.mass, stiffness + np.diag(pins))
        state = solve_ivp(rate, (a, b), state, "DOP853", args=(acceleration,), rtol=1e-12, atol=1e-12).y[:, -1]
    back = np.kron(np.eye(2), frame(speed * period).T)
    multipliers = np.linalg.eigvals(back @ state.reshape(2 * n, 2 * n))
    # The double multiplier one of the free rotation is known to the root of rounding only.
    others = np.sort(np.abs(multipliers[np.argsort(np.abs(multipliers - 1))[2 * case["pin_preload"] :]]))
    turning = built(section(own, f"1/{case['ring_teeth']}", case, pin_preload=case["pin_preload"]))
    growth = solve(turning, np.array([omega])).growth_rate[0, 0]
    # DOP853 leaves 1e-11 of it.
    assert np.log(others[-1]) / period == pytest.approx(growth, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("damping_ratio", [0.0, 1e-6, 0.02])
def test_the_free_rotation_colours_no_map(damping_ratio: float) -> None:
    """A double exponent of zero would be a growth of about 1e-5 1/s by rounding, at every other point."""
    case = FRAMES[0]
    own = section(case["parameters"], "1/82", damping_ratio=damping_ratio)
    found = solve(built(own), np.linspace(3e3, 9e4, 40))
    assert (found.stable == 1).all()
    assert (found.growth_rate <= 0).all()


@pytest.mark.parametrize("speed", [0, "0", {"speed_ratio": 0}, {"speed": "0 rpm"}])
def test_a_carrier_at_rest_is_one_without_a_speed(speed: Any) -> None:
    """Also where a speed could not be taken, as of bodies that only rotate."""
    case = FRAMES[0]
    omega = np.linspace(3e3, 9e4, 40)
    own, none = (section(case["parameters"], given, case, damping_ratio=0.01) for given in (speed, None))
    np.testing.assert_array_equal(solve(built(own), omega).growth_rate, solve(built(none), omega).growth_rate)


def test_a_carrier_at_rest_fits_bodies_that_only_rotate() -> None:
    gear = section(FRAMES[0]["parameters"], 0, FRAMES[0], motion="rotational")
    gear["supports"] = {key: k for key, k in gear["supports"].items() if key == "planet" or key.endswith("_rotation")}
    assert not built(gear).rotations


def test_waves_of_a_ring_at_rest_pass_the_frame() -> None:
    """A ring that no mesh holds: its waves w_m are seen with w_m + m W and w_m - m W from the carrier."""
    speed, planets = 0.05, 4
    free = {name: {"mean_stiffness": 1.0, "epsilon": 0.0, "contact_ratio": 1.5} for name in ("sun", "ring")}
    ring = {"kind": "elastic", "harmonics": 4, "bending_stiffness": 5e7}
    own = parameters(planets, scaling="SI", ring=ring, meshes=free)
    speeds = ({}, {"carrier_speed": {"speed": speed}})
    at_rest, turning = (mean_motions(build(own | more)).frequency[0] for more in speeds)
    for m in range(2, 5):
        w = np.sqrt(np.pi * 5e7 * (m * (m**2 - 1)) ** 2 / (6.35 * (1 + m**2) / 2))
        # Mesh stiffnesses of 1 N/m change frequencies by 1e-9 of their own size.
        for expected in (w - m * speed, w + m * speed):
            assert np.abs(turning - expected).min() < 1e-3 * speed
        assert np.sum(np.abs(at_rest - w) < 1e-3 * speed) == 2


TEETH = {"sun": 30, "planet": 26, "ring": 82}


@pytest.mark.parametrize(
    ("changes", "ratio"),
    [
        ({}, "1/82"),
        ({"sense": "clockwise"}, "-1/82"),
        ({"input": "carrier", "fixed": "sun"}, "1/30"),
        ({"input": "ring", "fixed": "sun", "sense": "clockwise"}, "-1/30"),
        ({"fixed": "carrier"}, None),
    ],
)
def test_the_speed_follows_from_the_teeth(changes: dict[str, Any], ratio: str | None) -> None:
    """A planet passes a tooth of the member at rest in each mesh cycle."""
    own = section(GEARS[0]["parameters"], "from_teeth", planets=4, teeth=TEETH, phases={}, **changes)
    rotations = built(own).rotations
    assert [str(rotation.speed_ratio) for rotation in rotations] == ([ratio] if ratio else [])


def test_units_of_the_scaling() -> None:
    own = section(GEARS[0]["parameters"], {"speed": 400.0})
    plain, scaled = (mean_motions(built(own | {"scaling": name})).frequency[0] for name in ("SI", "dimensionless"))
    unit = np.sqrt(GEARS[0]["parameters"]["k_rp"] / GEARS[0]["parameters"]["m_r"])
    np.testing.assert_allclose(scaled * unit, plain, rtol=1e-12)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"motion": "rotational"}, "carrier_speed: acts on translations, and bodies only rotate"),
        (
            {"ring": {"kind": "elastic", "bending_stiffness": 1e8}, "fixed": "sun", "input": "ring", "supports": {
                "planet": 1e8}},
            "carrier_speed: an elastic ring that turns is stretched by its own speed",
        ),
        ({"carrier_speed": "from_teeth"}, "carrier_speed: needs the numbers of teeth"),
        ({"carrier_speed": {"speed": "30 rpm", "speed_ratio": 1}}, "speed_ratio is given already"),
        ({"carrier_speed": {}}, "speed_ratio or speed is missing"),
        ({"carrier_speed": 0.123456}, "the ratio must be exact"),
        ({"supports": {"planet": 0.0}}, "no bearing keeps the planets from flying off"),
    ],
)  # fmt: skip
def test_mistakes_get_a_line(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError) as raised:
        load({"system": section(GEARS[0]["parameters"], "1/82") | changes})
    assert said in str(raised.value)
    assert len(raised.value.problems) == 1


def test_from_a_file_to_a_map() -> None:
    case = FRAMES[2]
    own = section(case["parameters"], f"1/{case['ring_teeth']}", case)
    speeds = [case["mesh_frequency_rad_s"], 2e4]
    tree = gs.sweep(gs.load({"system": own, "sweep": {"mesh_frequency": speeds}, "methods": {"floquet": {}}}))
    assert tree["floquet/growth_rate"].values[0] == pytest.approx(case["growth_rate"], rel=1e-9)


def test_loads_on_a_gear_that_is_held_and_one_that_is_not() -> None:
    """K + W^2 (K_c + preload) carries constant loads; without a support of carrier and sun nothing holds the speed."""
    own = section(GEARS[0]["parameters"], "1/82", damping_ratio=0.02, load={"sun": 1000.0, "carrier": -1800.0})
    with pytest.raises(NotPossible, match="nothing holds the speed of a gear that turns freely"):
        steady_state(built(own), 8.2e4, 4)
    with pytest.raises(ConfigError, match="nothing holds the speed of a gear that turns freely"):
        gs.sweep(gs.load({"system": own, "sweep": {"mesh_frequency": [8e4, 9e4]}, "methods": {"response": {}}}))
    held = built(own | {"supports": own["supports"] | {"carrier_rotation": 1e8}})
    speed, bearing, mass = 1000.0, 1e8, 0.66
    stiffness = held.mean_stiffness_matrix()
    ways = [name.endswith(("_x", "_y", "_radial", "_tangential")) for name in held.coordinates]
    stiffness = stiffness - speed**2 * np.diag(np.diag(held.mass) * ways)
    carrier = held.coordinates.index("carrier_rotation")
    stiffness[carrier, carrier] += 4 * speed**2 * mass * bearing / (bearing - speed**2 * mass)
    found = steady_state(held, 82 * speed, 4).displacement
    expected = np.linalg.solve(stiffness, held.load)
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("planets", [4, 5])
def test_pairs_of_translational_modes_split_as_first_order_says(planets: int) -> None:
    """w -+ (W/2) phi_1^T G phi_2 (Lin & Parker 1999), with G = 2 m [[0, -1], [1, 0]] of each body."""
    own = GEARS[0]["parameters"] | {"planets": planets}
    rest = built({key: value for key, value in section(own, 0).items() if key != "carrier_speed"})
    squared, shapes = eigh(rest.mean_stiffness_matrix(), rest.mass)
    frequency = np.sqrt(np.maximum(squared, 0.0))
    gyroscopic, mass = np.zeros_like(rest.mass), np.asarray(rest.mass)
    for body in range(len(mass) // 3):
        x, y = 3 * body, 3 * body + 1
        gyroscopic[x, y], gyroscopic[y, x] = -2 * mass[x, x], 2 * mass[x, x]
    modal = shapes.T @ gyroscopic @ shapes
    equal = np.flatnonzero(np.diff(frequency) < 1e-6 * frequency[-1])
    # Planet modes of five planets are pairs too, of bodies that move against each other.
    pairs = [p for p in equal if frequency[p] > 1.0]
    assert len(pairs) >= 6
    for speed in (20.0, 40.0):
        moved = np.sort(mean_motions(built(section(own, {"speed": speed}, pin_preload=False))).frequency[0])
        for p in pairs:
            split = speed * abs(modal[p, p + 1])
            # Errors of first order are of order (W/w)^2 of w.
            assert moved[p + 1] - moved[p] == pytest.approx(split, rel=1e-3, abs=2 * speed**2 / frequency[p])
    for p in pairs:
        if planets == 4 and abs(frequency[p] / (2 * np.pi) - 727.27) < 0.01:
            assert abs(modal[p, p + 1]) == pytest.approx(1.842, abs=5e-4)
            break
    else:
        assert planets == 5
