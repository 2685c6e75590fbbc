"""Weak teeth: stability against multipliers in 40 digits, exact periods, which meshes are weak and when."""

from __future__ import annotations

import json
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from ruamel.yaml import YAML
from scenes import CONFIGS, DATA, problems, ran, written
from scipy.integrate import solve_ivp
from systems import lone_pair

import gearstab as gs
from gearstab.config import load
from gearstab.gears.mesh_stiffness import contact_stiffness
from gearstab.response.history import steady_state
from gearstab.system import GearSystem
from gearstab.systems import build
from gearstab.systems.gearbox.faults import equal_shares, missing, over_the_width
from gearstab.systems.gearbox.train import Train
from gearstab.waveforms import Rectangular

REFERENCE = json.loads((DATA / "rotation" / "weak_teeth.json").read_text())
WEAK = pytest.mark.parametrize("case", REFERENCE["weak_tooth"], ids=lambda case: case["name"])
MILLIMETRES = {"module": "2 mm", "pressure_angle": "20 deg", "face_width": "20 mm"}


def pair(case: dict[str, Any], **fault: Any) -> dict[str, Any]:
    """Two gears without anything else, of which one coordinate is left: with J = 2 m r_b^2, m_e = m."""
    c, k = case["contact_ratio"], case["pair_stiffness"]
    mesh = {"mean_stiffness": c * k, "epsilon": 1 / (2 * c), "contact_ratio": c, "damping_ratio": case["zeta"]}
    return lone_pair(case["teeth"], case["mass"], mesh | {"faults": [{"gear": "a", "factor": case["factor"]} | fault]})


@WEAK
def test_multipliers_over_the_revolution(case: dict[str, Any]) -> None:
    omega = np.array([point["mesh_frequency"] for point in case["points"]])
    found = gs.floquet(pair(case), omega, exponents=True)
    for k, point in enumerate(case["points"]):
        period = case["teeth"] * 2 * np.pi / omega[k]
        # Two exponents are those of the rigid rotation, without damping 0.
        own = found.exponent_real[k] + 1j * found.exponent_imag[k]
        multipliers = np.exp(own[np.argsort(np.abs(own))[2:]] * period)
        wanted = np.array([complex(*value) for value in point["multipliers_over_revolution"]])
        assert_allclose(np.sort_complex(multipliers), np.sort_complex(wanted), rtol=1e-9, atol=1e-9)
        assert_allclose(found.growth_rate[k], point["growth_rate"], rtol=0, atol=1e-9)
    assert (found.stable == (np.array([point["growth_rate"] for point in case["points"]]) <= 1e-12)).all()


@WEAK
def test_lines_of_the_stiffness(case: dict[str, Any]) -> None:
    z, c, k, q = case["teeth"], np.array(case["contact_ratio"]), case["pair_stiffness"], case["factor"]
    wave, mean, amplitude = Rectangular(c), c * k, np.array(k / 2)
    lost = missing(wave, c, z, np.array(1 - q), equal_shares(wave, c, mean, amplitude))
    assert lost.piecewise_constant
    for j, real, imaginary in case["lines"]:
        a, b = lost.fourier(j) if j else (0.0, 0.0)
        found = lost.mean + mean if j == 0 else 0.5 * (b - 1j * a)
        if j and j % z == 0:
            a, b = wave.fourier(j // z)
            found += amplitude * (b - 1j * a)
        assert_allclose(found, complex(real, imaginary), rtol=0, atol=1e-9)


def test_helical_teeth_lose_the_mean_over_their_overlap() -> None:
    # K_s of the mean over a width v is K_s sinc(s v) exp(-i pi s v).
    wave, c, overlap = Rectangular(np.array(1.7)), np.array(1.7), np.array([0.0, 0.4, 1.9])
    spur = missing(wave, c, 23, np.array(0.3), equal_shares(wave, c, np.array(2.0), np.array(0.5)))
    found = over_the_width(spur, overlap / 23)
    assert_allclose(found.mean, spur.mean, rtol=1e-13)
    for s in (1, 5, 23, 40):
        (a, b), (sine, cosine) = spur.fourier(s), found.fourier(s)
        width = s * overlap / 23
        assert_allclose(cosine - 1j * sine, (b - 1j * a) * np.sinc(width) * np.exp(-1j * np.pi * width), atol=1e-14)


def train(name: str) -> dict[str, Any]:
    return dict(YAML(typ="safe").load((CONFIGS / "drivetrains" / f"{name}.yaml").read_text())["system"])


SETS = {"nrel_5mw": ("one", "two"), "grc_750kw": ("one",)}
MESHES = {"nrel_5mw": ("three",), "grc_750kw": ("two", "three")}


@pytest.mark.parametrize(
    ("name", "place"), [(name, place) for name in SETS for place in REFERENCE["trains"][name]]
)  # fmt: skip
def test_periods_of_drivetrains(name: str, place: str) -> None:
    p, (stage, gear) = train(name), place.split(".")
    fault = {"factor": 0.7}
    if stage in SETS[name]:
        p["planetary_sets"][SETS[name].index(stage)]["faults"] = [fault | {"gear": gear}]
    else:
        mesh = p["meshes"][MESHES[name].index(stage)]
        # The reference calls the first gear of a pair its pinion, which in a wind turbine is the larger one.
        mesh["faults"] = [fault | {"gear": mesh["gears"][gear == "wheel"]}]
    system = gs.build(p)
    ratios = {mesh.frequency_ratio for mesh in system.meshes if mesh.part_of}
    wanted = REFERENCE["trains"][name][place]
    assert {1 / ratio for ratio in ratios} == {Fraction(wanted["fault_period"])}
    assert system.common_period()[0] == Fraction(wanted["common_with_all_meshes"])


def stiffness(system: GearSystem, turns: np.ndarray) -> dict[str, np.ndarray]:
    """k(t) of each whole mesh with its parts at Omega t/2 pi, from the waves themselves."""
    found: dict[str, np.ndarray] = {}
    for mesh in system.meshes:
        name = mesh.part_of or mesh.name
        phase = float(mesh.frequency_ratio) * turns - float(mesh.lag)
        own = mesh.mean_stiffness + 2 * mesh.amplitude * mesh.waveform.value(phase)
        found[name] = found.get(name, np.zeros(turns.shape)) + own
    return found


TRAIN = {
    "kind": "gearbox", "gears": MILLIMETRES, "rotors": [{"name": "a", "teeth": 17}, {"name": "b", "teeth": 40}],
    "input": {"rotor": "a", "torque": 20.0}, "outputs": [{"rotor": "b"}],
}  # fmt: skip


@pytest.mark.parametrize(
    "waveform", [{"kind": "tooth"}, {"kind": "pair", "shape": "parabolic"}, {"kind": "rectangular"}]
)
def test_the_weak_pair_carries_less_and_no_other(waveform: dict[str, Any]) -> None:
    mesh = {"name": "mesh", "gears": ["a", "b"], "lag": 0.3, "waveform": waveform}
    if waveform["kind"] == "pair":
        mesh |= {"contact_ratio": 1.6, "mean_stiffness": 4e8}
    faults = [{"gear": "a", "tooth": 2, "factor": 0.6}, {"gear": "b", "tooth": 5, "factor": 0.8}]
    system = gs.build(TRAIN | {"meshes": [mesh | {"faults": faults}]})
    whole, c = system.meshes[0], 1.6
    teeth = Train(load({"system": TRAIN | {"meshes": [mesh]}}).system).pair_teeth[0]
    if waveform["kind"] != "pair":
        c = teeth.pairs[0].contact_ratio
    turns = np.random.default_rng(1).uniform(0, 17 * 40, 4000)
    x = turns - 0.3
    expected = np.zeros(len(turns))
    for j in range(3):  # pairs in contact: the one that entered j whole cycles before the youngest
        number, since = np.floor(x).astype(int) - j, x - np.floor(x) + j
        if waveform["kind"] == "tooth":
            _, k = contact_stiffness(teeth.pairs[0], x)
            one = k[:, j] if j < k.shape[1] else 0 * x
        elif waveform["kind"] == "pair":
            u = since / c
            one = np.where(since < c, 1 - 0.45 * (2 * u - 1) ** 2, 0.0) * 4e8 / (c * (1 - 0.45 / 3))
        else:
            level = whole.mean_stiffness + 2 * whole.amplitude * whole.waveform.value(x)
            one = np.where(since < c, level / (1 + (x - np.floor(x) < c - 1)), 0.0)
        loss = 0.4 * (number % 17 == 1) + 0.2 * (number % 40 == 4)
        expected += one * (1 - loss)
    # The computed stiffness of a tooth is a polynomial that is right to 1e-7 of itself.
    assert_allclose(stiffness(system, turns)["mesh"], expected, rtol=1e-6)


def test_growth_of_a_smooth_wave_by_direct_integration() -> None:
    mesh = {"name": "mesh", "gears": ["a", "b"], "waveform": {"kind": "tooth"}, "damping_ratio": 0.01,
            "faults": [{"gear": "a", "factor": 0.5}]}  # fmt: skip
    system = gs.build(TRAIN | {"meshes": [mesh]})
    g = np.asarray(system.meshes[0].direction)
    mobility = float(g @ np.linalg.solve(system.mass, g))
    own = np.sqrt(mobility * sum(float(m.mean_stiffness) for m in system.meshes))
    omega = 2.02 * own
    c = float(g @ np.linalg.solve(system.mass, system.damping_matrix @ np.linalg.solve(system.mass, g))) / mobility

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        k = stiffness(system, np.array([omega * t / (2 * np.pi)]))["mesh"][0]
        return np.array([y[1], -mobility * k * y[0] - c * y[1], y[3], -mobility * k * y[2] - c * y[3]])

    period = 17 * 2 * np.pi / omega
    d = float(Train(load({"system": TRAIN | {"meshes": [mesh]}}).system).pair_teeth[0].pairs[0].contact_ratio) - 1
    edges = np.unique(np.concatenate([np.arange(18), np.arange(17) + d])) * 2 * np.pi / omega
    y = np.array([1.0, 0.0, 0.0, 1.0])
    for begin, end in pairwise(edges):
        middle = (begin + end) / 2
        inner = lambda t, y, a=begin, b=end, m=middle: slope(m + (t - m) * (1 - 1e-12), y)  # noqa: E731
        y = solve_ivp(inner, (begin, end), y, "DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
    multipliers = np.linalg.eigvals(y.reshape(2, 2).T)
    growth = np.log(np.abs(multipliers).max()) / period
    assert growth > 0
    assert_allclose(gs.floquet(system, [omega]).growth_rate, growth, rtol=1e-6)


def sets(sense: str, held: str, **fault: Any) -> dict[str, Any]:
    """A set of 27/35/99 teeth whose three planets are 120 degrees apart."""
    rotors = [{"name": "s", "teeth": 27}, {"name": "r", "teeth": 99, "internal": True}, {"name": "c", "inertia": 0.01}]
    rotors[1] |= {"inertia": 0.02}
    stiff = {"mean_stiffness": 3e8, "epsilon": 0.2}
    of = {"name": "set", "sun": "s", "ring": "r", "carrier": "c", "held": held, "planets": {"count": 3, "teeth": 36},
          "meshes": {"sun": stiff | {"contact_ratio": 1.6}, "ring": stiff | {"contact_ratio": 1.8}},
          "faults": [{"factor": 0.7, "gear": "sun"} | fault]}  # fmt: skip
    given = {"kind": "gearbox", "gears": MILLIMETRES, "rotors": rotors, "planetary_sets": [of], "meshes": []}
    return given | {"input": {"rotor": "s", "sense": sense}, "damping_ratio": 0.01}


SENSES = pytest.mark.parametrize("sense", ["clockwise", "counter-clockwise"])
HELD = pytest.mark.parametrize("held", ["ring", "carrier"])


@SENSES
@HELD
@pytest.mark.parametrize("gear", ["sun", "ring"])
def test_a_tooth_meets_the_planets_in_turn(sense: str, held: str, gear: str) -> None:
    p = load({"system": sets(sense, held, gear=gear)}).system
    system, own = build(p), Train(p)
    parts = [mesh for mesh in system.meshes if mesh.part_of]
    assert [mesh.part_of for mesh in parts] == [f"set.{gear}.{n}" for n in (1, 2, 3)]
    name, teeth = ("s", 27) if gear == "sun" else ("r", 99)
    relative = own.driving * (own.speeds[name] - own.speeds["c"])
    way = 1 if relative > 0 else -1
    for n, mesh in enumerate(parts):
        # The marked tooth turns from planet 1 to planet n, in the sense in which the gear turns on the carrier.
        turned = (way * n / 3) % 1
        assert_allclose((float(mesh.lag) - float(parts[0].lag)) % 1, turned, rtol=0, atol=0.5 / teeth)
        # The weak pair enters as any pair of that mesh does.
        (whole,) = (item for item in system.meshes if item.name == mesh.part_of)
        cycles = teeth * float(mesh.lag) - float(whole.lag)
        assert_allclose(cycles, round(cycles), rtol=0, atol=1e-9)


@SENSES
def test_which_meshes_a_planet_weakens(sense: str) -> None:
    crack = gs.build(sets(sense, "ring", gear="planet", planet=2))
    assert [mesh.part_of for mesh in crack.meshes if mesh.part_of] == ["set.sun.2", "set.ring.2"]
    sun, ring = (mesh for mesh in crack.meshes if mesh.part_of)
    # Half a turn of the planet, less half the tooth on either side, and what lies between entry and pitch point.
    assert_allclose((float(ring.lag) - float(sun.lag)) % 1, 0.5, rtol=0, atol=1.0 / 36)
    for flank in ("sun", "ring"):
        pit = gs.build(sets(sense, "ring", gear="planet", planet=3, kind="pit", flank=flank))
        assert [mesh.part_of for mesh in pit.meshes if mesh.part_of] == [f"set.{flank}.3"]


@SENSES
@pytest.mark.parametrize("change", [{"tooth": 5}, {"gear": "planet", "planet": 2}, {"gear": "ring", "tooth": 40}])
def test_the_choice_of_the_tooth_does_not_matter(sense: str, change: dict[str, Any]) -> None:
    # Another tooth of a gear, or another of equal planets, is the same motion at another time or turned.
    base = {"gear": change.get("gear", "sun")}
    omega = np.linspace(4.0e4, 9.0e4, 6)
    first, second = (gs.floquet(sets(sense, "ring", **of), omega).growth_rate for of in (base, base | change))
    assert_allclose(second, first, rtol=0, atol=1e-7 * np.abs(first).max())


def test_mesh_forces_are_those_of_the_whole_mesh() -> None:
    error = {"sin": [5e-6, 1e-6]}
    mesh = {"name": "mesh", "gears": ["a", "b"], "damping_ratio": 0.05, "contact_ratio": 1.6, "epsilon": 0.2,
            "mean_stiffness": 3e8, "transmission_error": error, "faults": [{"gear": "b", "factor": 0.6}]}  # fmt: skip
    p = TRAIN | {"meshes": [mesh]}
    system = gs.build(p)
    found = steady_state(system, 9000.0)
    turns = np.asarray(found.time) * 9000 / (2 * np.pi)
    off = np.abs(turns - np.round(turns * 5) / 5) > 1e-6  # away from the jumps at multiples of 1 and at 0.6
    e = 5e-6 * np.sin(2 * np.pi * turns) + 1e-6 * np.sin(4 * np.pi * turns)
    assert found.mesh_force.shape[1] == found.mesh_deflection.shape[1] == 1
    wanted = stiffness(system, turns)["mesh"] * (found.mesh_deflection[:, 0] - e)
    assert_allclose(found.mesh_force[off, 0], wanted[off], rtol=1e-9, atol=1e-9 * np.abs(wanted).max())
    # Sidebands: the force has lines between the harmonics of the mesh, which it lacks without the fault.
    assert len(np.unique(np.round(found.mesh_force[off][:200, 0], 3))) > 100


def test_two_weak_teeth_that_meet_must_leave_some_stiffness(tmp_path: Path) -> None:
    faults = [{"gear": "a", "factor": 0.4}, {"gear": "b", "factor": 0.3}]
    text = json.dumps({"system": TRAIN | {"meshes": [{"name": "mesh", "gears": ["a", "b"], "faults": faults}]}})
    (problem,) = problems(tmp_path, text)
    assert "both weak teeth meet" in str(problem)


def test_info_tells_period_and_sidebands(tmp_path: Path) -> None:
    mesh = {"name": "mesh", "gears": ["a", "b"], "faults": [{"gear": "b", "tooth": 4, "factor": 0.6}]}
    path = written(tmp_path, json.dumps({"title": "Weak", "system": TRAIN | {"meshes": [mesh]}}))
    told = json.loads(ran("info", path, "--json").stdout)
    assert [item["name"] for item in told["meshes"]] == ["mesh"]
    (fault,) = told["faults"]
    assert (fault["name"], fault["mesh"], fault["period"]) == ("mesh.b tooth 4", "mesh", "40")
    assert fault["order"] == pytest.approx(17 / 40)
    sides = {line["side"]: line["order"] for line in fault["sidebands"]}
    assert sides == {n: pytest.approx(17 * (1 + n / 40)) for n in (-3, -2, -1, 1, 2, 3)}
    text = ran("info", path).stdout
    assert "weak tooth" in text
    assert "+1 shaft (order 17.425)" in text
