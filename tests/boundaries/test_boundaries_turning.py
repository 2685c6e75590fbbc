"""Edges of instability regions of systems with matrices that act with speeds of rotation.

edges.json: three systems, all intervals, by bisection on products of exponentials, with growth rates in 30 digits
(mpmath) on both sides. tongues.json: widths at small epsilon by bisection.
"""

import json
from copy import deepcopy
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from random_rotors import random_rotor

from gearstab.config import load
from gearstab.floquet import solve
from gearstab.floquet.boundaries import Boundaries, boundaries, gyroscopic
from gearstab.floquet.general.mean import mean_motions
from gearstab.floquet.stability import STATUS_FLAGS
from gearstab.system import GearSystem
from gearstab.systems import build
from gearstab.waveforms import Fourier

Array = np.ndarray
DATA = Path(__file__).parents[1] / "data" / "rotation"
EDGES = json.loads((DATA / "edges.json").read_text())["cases"]
TONGUES = json.loads((DATA / "tongues.json").read_text())["cases"]
START, STOP = 0.8, 6.0


def built(system: dict[str, Any]) -> GearSystem:
    """A system of the references."""
    speed = {"speed": system["speed_held"]} if "speed_held" in system else {"speed_ratio": system["speed_ratio"]}
    names = {"gyroscopic": "gyroscopic", "circulatory_speed": "circulatory", "centripetal": "centripetal"}
    section = {
        "kind": "matrices",
        "mass": system["mass"],
        "stiffness": (np.array(system["stiffness"]) + np.array(system.get("circulatory", 0.0))).tolist(),
        "meshes": system["meshes"],
        "rotation": speed | {new: system[old] for old, new in names.items() if old in system},
    }
    section |= {"damping": system["damping"]} if "damping" in system else {}
    return build(load({"system": section}).system)


def inside(found: Boundaries, omega: Array, row: int = 0) -> Array:
    """Which mesh frequencies lie in a region of a row."""
    mine = found.row == row
    return np.any((omega[:, None] > found.lower[mine]) & (omega[:, None] < found.upper[mine]), axis=1)


def beside(found: Boundaries, omega: Array) -> Array:
    """Which mesh frequencies lie on an edge, but for rounding."""
    edges = np.concatenate([found.lower, found.upper])
    return np.any(np.abs(omega[:, None] / edges - 1) < 1e-8, axis=1)


@pytest.mark.parametrize("case", EDGES, ids=[case["name"] for case in EDGES])
def test_edges_of_the_reference(case: dict[str, Any]) -> None:
    found = boundaries(built(case["system"]), *case["mesh_frequency_range"])
    expected = np.array([[interval["lower"], interval["upper"]] for interval in case["unstable_intervals"]])
    # The tolerance that is asked for, 1e-10 of the mesh frequency, and what the reference's bisection leaves.
    np.testing.assert_allclose(np.stack([found.lower, found.upper], axis=1), expected, rtol=2e-10)
    undamped = "damping" not in case["system"]
    assert (found.stable_share(found.counted if undamped else found.proved) > 0.9999).all()
    assert found.sampled_step.max() == 0


def test_each_region_is_named_by_its_motions_at_its_speed() -> None:
    case = EDGES[0]
    system = built(case["system"])
    found = boundaries(system, *case["mesh_frequency_range"])
    for lower, upper, (tongue, *more) in zip(found.lower, found.upper, found.members, strict=True):
        frequency = mean_motions(system, 0.5 * (lower + upper)).frequency[0]
        root = (frequency[tongue.mode_p - 1] + frequency[tongue.mode_q - 1]) / tongue.frequency_ratio
        # Epsilon 0.3 shifts the twelve by up to 1.4 %; neighbours are 3 % and more away.
        assert root == pytest.approx(0.5 * (lower + upper), rel=0.015)
        assert not more
    assert len(set(found.labels())) == len(found.row) == 12


def test_self_excitation_is_named_once() -> None:
    case = EDGES[2]
    found = boundaries(built(case["system"]), *case["mesh_frequency_range"])
    assert [tongue.kind for tongue in found.members[-1]] == ["self-excited"]
    assert found.cut[-1].tolist() == [False, True]
    assert all(tongue.kind != "self-excited" for members in found.members[:-1] for tongue in members)


@pytest.mark.parametrize(("case", "tongue"), [(case, t) for case in TONGUES for t in case["tongues"]])
def test_narrow_tongues_of_sums_and_differences(case: dict[str, Any], tongue: dict[str, Any]) -> None:
    """Differences open where signatures differ, sums where they agree."""
    system, epsilon = deepcopy(case["system"]), 1e-3
    for mesh in system["meshes"]:
        mesh["epsilon"] = epsilon
    center = tongue["centre_mesh_frequency"]
    found = boundaries(built(system), 0.97 * center, 1.03 * center)
    here = (found.lower < center) & (found.upper > center)
    expected = epsilon * tongue["floquet_half_width_over_epsilon_at_1e-3"]
    assert here.any() == (expected > 0)
    if expected:
        (k,) = np.flatnonzero(here)
        assert 0.5 * (found.upper - found.lower)[k] == pytest.approx(expected, abs=2e-10 * center)
        (member,) = found.members[k]
        numbers = sorted((tongue["mode_p"], tongue["mode_q"]))
        assert [member.mode_p, member.mode_q, member.harmonic] == [*numbers, tongue["harmonic"]]
        assert member.difference == (tongue["type"] == "difference")


@pytest.mark.parametrize(("case", "tongue"), [(case, t) for case in TONGUES for t in case["tongues"]])
@pytest.mark.parametrize("epsilon", [1e-6, 1e-8, 1e-9])
def test_points_in_the_narrowest_tongues(case: dict[str, Any], tongue: dict[str, Any], epsilon: float) -> None:
    """Krein signs tell growth of 1e-11 per unit of time from rounding: half of what detuning takes to stop it."""
    system = deepcopy(case["system"])
    for mesh in system["meshes"]:
        mesh["epsilon"] = epsilon
    center = tongue["centre_mesh_frequency"]
    found = solve(built(system), np.array([center]))
    if not tongue["half_width_over_epsilon_first_order"]:
        assert (found.stable[0, 0], found.growth_rate[0, 0]) == (1, 0)
        return
    if "speed_held" in system:
        detuning = tongue["harmonic"] * tongue["half_width_over_epsilon_first_order"]
        # The growth is the root of a difference of some 1e-16.
        assert found.growth_rate[0, 0] == pytest.approx(0.5 * epsilon * detuning, rel=1e-3)
    assert found.stable[0, 0] == 0
    assert found.status[0, 0] & STATUS_FLAGS["krein"]


@pytest.mark.parametrize("tongue", [t for t in TONGUES[1]["tongues"] if t["half_width_over_epsilon_first_order"]])
def test_regions_below_the_usual_floor(tongue: dict[str, Any]) -> None:
    """Widths of 1e-8 of the mesh frequency are right to 1e-4, which rounding leaves of phases 1e-8 apart."""
    system, epsilon = deepcopy(TONGUES[1]["system"]), 2e-7
    for mesh in system["meshes"]:
        mesh["epsilon"] = epsilon
    center = tongue["centre_mesh_frequency"]
    found = boundaries(built(system), 0.97 * center, 1.03 * center, 1e-12, 1e-9)
    (k,) = np.flatnonzero(np.abs(found.lower / center - 1) < 1e-6)
    width = 0.5 * (found.upper - found.lower)[k] / epsilon
    assert width == pytest.approx(tongue["half_width_over_epsilon_first_order"], rel=1e-4)


def check_hamiltonian(seed: int, points: int) -> int:
    """Regions of a random Hamiltonian system against a raster; returns how many there are."""
    system = random_rotor(seed, hamiltonian=True)
    found = boundaries(system, START, STOP)
    assert found.stable_share(found.counted)[0] == pytest.approx(1.0) or np.isnan(found.stable_share(found.counted)[0])
    omega = np.random.default_rng(seed).uniform(START, STOP, points)
    omega = omega[~beside(found, omega)]
    np.testing.assert_array_equal(solve(system, omega).stable[0] == 0, inside(found, omega))
    # The verdict changes within 1e-8 of each edge.
    for edges, cut, outwards in ((found.lower, found.cut[:, 0], -1), (found.upper, found.cut[:, 1], 1)):
        near = edges[~cut] * (1 + 1e-8 * np.array([[outwards], [-outwards]]))
        stable = solve(system, near.ravel()).stable[0].reshape(2, -1)
        assert np.all(stable[0] == 1) or len(found.row) > 60  # where two regions are nearer than that
        assert np.all(stable[1] == 0)
    return len(found.row)


def test_a_long_period_with_strong_growth() -> None:
    """Fifty cycles: multipliers of e^10, whose matrices have lost their inverses in rounding, and gaps in between."""
    system = random_rotor(6, hamiltonian=True)
    first = system.meshes[0]
    second = replace(first, name="other", direction=np.roll(first.direction, 1), frequency_ratio=Fraction(49, 50))
    system = replace(system, meshes=(first, replace(second, lag=0.3)))
    start, stop = 4.2, 4.6
    found = boundaries(system, start, stop)
    assert found.sampled_step[0] == 0
    assert found.evaluations[0] < 5000
    omega = np.random.default_rng(0).uniform(start, stop, 1000)
    np.testing.assert_array_equal(solve(system, omega).stable[0] == 0, inside(found, omega))


def check_unsymmetric(seed: int, points: int) -> float:
    """Regions of a random unsymmetric system against a raster; returns the share that is proved stable."""
    system = random_rotor(seed, hamiltonian=False)
    found = boundaries(system, START, STOP)
    omega = np.random.default_rng(seed).uniform(START, STOP, points)
    unstable = solve(system, omega).stable[0] == 0
    proved = np.any((omega[:, None] >= found.proved[0][:, 0]) & (omega[:, None] <= found.proved[0][:, 1]), axis=1)
    assert not (proved & unstable).any()
    keep = ~beside(found, omega)
    np.testing.assert_array_equal(unstable[keep], inside(found, omega)[keep])
    return float(found.stable_share(found.proved)[0])


@pytest.mark.parametrize("seed", [1, 8, 24])
def test_random_hamiltonian_systems(seed: int) -> None:
    assert check_hamiltonian(seed, 1000) > 0


@pytest.mark.slow
def test_two_hundred_hamiltonian_systems() -> None:
    assert sum(check_hamiltonian(seed, 20_000) for seed in range(200)) > 4000


@pytest.mark.parametrize("seed", [1, 3])
def test_random_unsymmetric_systems(seed: int) -> None:
    assert check_unsymmetric(seed, 1000) > 0.99


@pytest.mark.slow
def test_two_hundred_unsymmetric_systems() -> None:
    assert np.nanmean([check_unsymmetric(seed, 20_000) for seed in range(1000, 1200)]) > 0.95


def test_what_the_bound_allows_for_is_no_matter_of_taste(monkeypatch: pytest.MonkeyPatch) -> None:
    """Twice and half as much finds the same, to rounding."""
    system = random_rotor(1, hamiltonian=True)
    found = boundaries(system, START, STOP)
    for factor in (0.5, 2.0):
        with monkeypatch.context() as own:
            own.setattr(gyroscopic, "DRIFT", factor * gyroscopic.DRIFT)
            other = boundaries(system, START, STOP)
        np.testing.assert_allclose(np.stack([other.lower, other.upper]), [found.lower, found.upper], rtol=3e-10)


def test_rows_of_a_batch() -> None:
    """Every row as if it were alone, also where one of them is damped and one is at rest."""
    single = random_rotor(3, hamiltonian=True)
    damping = np.stack([np.zeros((single.size, single.size)), 0.02 * np.eye(single.size)])
    found = boundaries(replace(single, damping=damping), START, STOP)
    for row in range(2):
        alone = boundaries(replace(single, damping=damping[row]), START, STOP)
        mine = found.row == row
        np.testing.assert_allclose(found.lower[mine], alone.lower, rtol=3e-10)
        assert [found.labels()[k] for k in np.flatnonzero(mine)] == alone.labels()
    assert found.stable_share(found.counted)[0] == pytest.approx(1.0)
    assert found.stable_share(found.proved)[1] > 0.99


@pytest.mark.parametrize("free", [False, True])
def test_a_planetary_gear_with_a_turning_carrier(free: bool) -> None:
    """Edges against points; with a free rotation, whose momentum is conserved, exactly too."""
    held = {} if free else {"carrier_rotation": 2e8, "sun_rotation": 1e8}
    section = {
        "kind": "planetary",
        "planets": 3,
        "ring": {"kind": "rigid"},
        "masses": {"ring": 2.35, "carrier": 5.43, "sun": 0.4, "planet": 0.66},
        "inertias": {"ring": 3.0, "carrier": 6.29, "sun": 0.39, "planet": 0.61},
        "supports": {"carrier": 1e8, "sun": 1e8, "ring": 1e8, "planet": 1e8, "ring_rotation": 1e9, **held},
        "pressure_angles": {"sun": "24.6 deg", "ring": "24.6 deg"},
        "meshes": {mesh: {"mean_stiffness": 5e8, "epsilon": 0.2, "contact_ratio": 1.4} for mesh in ("sun", "ring")},
        "teeth": {"sun": 30, "planet": 27, "ring": 84},
        "carrier_speed": "from_teeth",
    }
    system = build(load({"system": section}).system)
    start, stop = 30_000.0, 34_000.0
    found = boundaries(system, start, stop)
    assert len(found.row) >= 3
    np.testing.assert_allclose(found.stable_share(found.counted), 1.0)
    omega = np.random.default_rng(0).uniform(start, stop, 2000)
    omega = omega[~beside(found, omega)]
    np.testing.assert_array_equal(solve(system, omega).stable[0] == 0, inside(found, omega))


@pytest.mark.parametrize("damped", [False, True])
def test_a_smooth_wave(damped: bool) -> None:
    """Magnus steps in place of segments; the verdict changes at the edges."""
    system = built(EDGES[0]["system"])
    (mesh,), wave = system.meshes, Fourier(np.array([0.4, 0.1]), np.array([0.2, 0.0]))
    system = replace(system, meshes=(replace(mesh, waveform=wave),), damping=0.01 * np.eye(2) if damped else None)
    found = boundaries(system, 1.5, 4.0)
    omega = np.random.default_rng(0).uniform(1.5, 4.0, 60)
    np.testing.assert_array_equal(solve(system, omega).stable[0] == 0, inside(found, omega))
    assert found.tolerance.max() < 2e-10
