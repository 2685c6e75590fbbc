"""Profile relief of a loaded pair of gears, against sorted gaps and root finding computed elsewhere."""

import json

import numpy as np
import pytest
from scenes import DATA
from scipy.optimize import brentq, minimize_scalar

from gearstab.errors import NotPossible
from gearstab.gears.geometry import Gear
from gearstab.gears.loaded import equilibrium, loaded_mesh
from gearstab.gears.mesh_stiffness import StiffnessModel, contact_stiffness, mesh_stiffness, single_stiffness
from gearstab.gears.pair import Pair
from gearstab.gears.relief import NO_RELIEF, FlankRelief, Relief

CASES = json.loads((DATA / "teeth" / "reference_relief_internal_phases.json").read_text())["relief"]
REFERENCE = pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
PLAIN = StiffnessModel()
OF_INPUTS = {"normal_module": "module", "normal_pressure_angle": "pressure_angle", "rounding": "rack_tip_radius",
             "E": "young", "nu": "poisson", "addendum": "addendum", "dedendum": "dedendum",
             "face_width": "face_width"}  # fmt: skip


def scene(case) -> tuple[Pair, Relief]:
    given = case["inputs"]
    both = {key: given[name] for name, key in OF_INPUTS.items()}
    one, two = (Gear(given["teeth"][k], bore_radius=given["bore_radius"][k], **both) for k in (0, 1))
    power = case["relief"]["power"]
    pinion, wheel = (FlankRelief(**case["relief"][gear], power=power) for gear in ("pinion", "wheel"))
    return Pair(one, two), Relief(pinion_tip=pinion, wheel_tip=wheel)


def sampled(pair: Pair, relief: Relief, force: float, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """delta and k_T at phases, from the definition."""
    s, touching = pair.contacts(x)
    s = np.clip(s, *pair.path)
    k = np.where(touching, single_stiffness(pair, s, PLAIN), 0.0)
    delta, carrying = equilibrium(k, relief.gap(pair, s), force)
    return delta, np.sum(k * carrying, axis=-1)


@REFERENCE
def test_error_and_stiffness_of_the_reference(case) -> None:
    """Its tolerance is 1e-9; peaks are those of its raster, which misses the cusps where the contact of a pair ends."""
    pair, relief = scene(case)
    x = np.array(case["phases"])
    for row in case["rows"]:
        found = loaded_mesh(pair, PLAIN, relief, row["normal_force_N"])
        np.testing.assert_allclose(found.error.value(x), row["static_transmission_error_m"], rtol=1e-9)
        np.testing.assert_allclose(found.curve.value(x), row["tangent_stiffness_N_m"], rtol=1e-9)
        np.testing.assert_allclose(row["normal_force_N"] / found.error.value(x), row["secant_stiffness_N_m"], rtol=1e-9)
        piece = np.searchsorted(found.curve.edges, x, side="right") - 1
        np.testing.assert_array_equal(found.carrying[piece], row["pairs_in_contact"])
        assert found.peak_to_peak == pytest.approx(row["peak_to_peak_ste_m"], rel=1e-3)


@REFERENCE
def test_the_force_of_the_flattest_error(case) -> None:
    """The least peak-to-peak of the reference is 0.4 % low for the parabolic form, as its raster misses a cusp: there
    the error changes by 1e-4 of itself within 5e-6 of a cycle, so that 20,000 points come within 1e-3.
    """
    pair, relief = scene(case)
    force = case["flattest_at_force_N"]
    least = minimize_scalar(
        lambda f: loaded_mesh(pair, PLAIN, relief, f).peak_to_peak, bounds=(0.7 * force, 1.4 * force), method="bounded"
    )
    assert least.x == pytest.approx(force, rel=1e-3)
    assert least.fun == pytest.approx(case["its_peak_to_peak_m"], rel=5e-3)
    delta, _ = sampled(pair, relief, least.x, np.linspace(0.0, 1.0, 20_001))
    assert np.ptp(delta) == pytest.approx(least.fun, rel=1e-3)
    assert np.ptp(delta) <= least.fun


@REFERENCE
def test_polynomials_between_changes_of_contact_are_the_definition(case) -> None:
    pair, relief = scene(case)
    x = np.linspace(0.0, 1.0, 997, endpoint=False)
    for row in case["rows"]:
        force = row["normal_force_N"]
        found = loaded_mesh(pair, PLAIN, relief, force)
        delta, tangent = sampled(pair, relief, force, x)
        np.testing.assert_allclose(found.error.value(x), delta, rtol=1e-12)
        np.testing.assert_allclose(found.curve.value(x), tangent, rtol=1e-12)
        assert found.contact_ratio <= pair.contact_ratio + 1e-12
        assert np.all(tangent <= contact_stiffness(pair, x)[1].sum(axis=-1) * (1 + 1e-12))


def test_the_tangent_is_the_derivative_of_force_and_stiffer_than_the_secant() -> None:
    pair, relief = scene(CASES[1])
    x, step = np.linspace(0.03, 0.97, 41), 1e-3
    for force in (300.0, 2500.0):
        found = loaded_mesh(pair, PLAIN, relief, force)
        more, less = (sampled(pair, relief, force + sign * step, x)[0] for sign in (1, -1))
        np.testing.assert_allclose(found.curve.value(x), 2 * step / (more - less), rtol=1e-6)
        assert np.all(force / found.error.value(x) < found.curve.value(x) * (1 + 1e-12))
        assert found.secant < found.mean


def test_sorted_gaps_are_the_root_of_the_sum_of_all_forces() -> None:
    random = np.random.default_rng(3)
    k, e = random.uniform(0.5, 2.0, (200, 4)), random.uniform(0.0, 1.0, (200, 4))
    k[random.uniform(size=k.shape) < 0.3] = 0.0
    k[:, 0] = 1.0
    delta, carrying = equilibrium(k, e, 0.4)
    for row in range(200):
        root = brentq(lambda d, r=row: np.sum(k[r] * np.maximum(d - e[r], 0.0)) - 0.4, 0.0, 10.0, xtol=1e-15)
        assert delta[row] == pytest.approx(root, rel=1e-13)
        np.testing.assert_array_equal(carrying[row], (k[row] > 0) & (e[row] < root))


def test_without_relief_it_is_the_stiffness_of_the_teeth() -> None:
    pair, _ = scene(CASES[0])
    x = np.linspace(0.0, 1.0, 101)
    found, plain = loaded_mesh(pair, PLAIN, NO_RELIEF, 3000.0), mesh_stiffness(pair)
    np.testing.assert_allclose(found.curve.value(x), plain.curve.value(x), rtol=1e-12)
    np.testing.assert_allclose(found.error.value(x) * plain.curve.value(x), 3000.0, rtol=1e-12)
    assert found.contact_ratio == pytest.approx(pair.contact_ratio, rel=1e-12)
    assert found.start == pytest.approx(0.0, abs=1e-12)
    assert found.levels == pytest.approx(plain.levels, rel=1e-10)


def test_more_load_closes_more_gaps_up_to_the_contact_ratio_of_the_teeth() -> None:
    pair, relief = scene(CASES[0])
    ratios = [loaded_mesh(pair, PLAIN, relief, force).contact_ratio for force in (1.0, 300.0, 1000.0, 3000.0, 20000.0)]
    assert np.all(np.diff(ratios) >= 0)
    assert ratios[0] == pytest.approx(1.0, abs=1e-3)
    assert ratios[-1] == pytest.approx(pair.contact_ratio, rel=1e-12)


def test_the_rectangular_wave_begins_where_the_second_pair_takes_load() -> None:
    """Long relief of the wheel's tip alone keeps an entering pair from the load, and that of the pinion a leaving
    one: the contact begins late by what the wheel's relief takes and ends early by what the pinion's does.
    """
    pair, relief = scene(CASES[0])
    late = loaded_mesh(pair, PLAIN, Relief(wheel_tip=relief.wheel_tip), 1500.0)
    early = loaded_mesh(pair, PLAIN, Relief(pinion_tip=relief.pinion_tip), 1500.0)
    end = pair.contact_ratio - 1
    assert late.start > 0.05
    assert late.start + late.contact_ratio - 1 == pytest.approx(end, abs=1e-12)
    assert early.start == pytest.approx(0.0, abs=1e-12)
    assert early.contact_ratio - 1 < end - 0.05
    reduced = late.rectangular("levels")
    low, high = late.levels
    assert (reduced.mean_stiffness, reduced.contact_ratio) == (late.mean, late.contact_ratio)
    assert 2 * reduced.epsilon * reduced.mean_stiffness == pytest.approx(high - low, rel=1e-12)


def test_relief_acts_at_the_ends_of_contact() -> None:
    """e of 20 um at the tips of wheel and pinion; a root of the same relief doubles it; reversed drive mirrors it."""
    pair, relief = scene(CASES[0])
    first, last = pair.path
    tip = relief.pinion_tip
    assert tip is not None
    s = np.array([first, first + 0.25 * tip.length, first + 1.001 * tip.length, last - 0.5 * tip.length, last])
    np.testing.assert_allclose(relief.gap(pair, s) * 1e6, [20.0, 15.0, 0.0, 10.0, 20.0], atol=1e-9)
    both = Relief(tip, tip, tip, tip)
    np.testing.assert_allclose(both.gap(pair, s), 2 * relief.gap(pair, s), rtol=1e-14)
    turned = Pair(pair.pinion, pair.wheel, wheel_drives=True)
    x = np.linspace(0.01, 0.99, 33)
    ahead, back = (loaded_mesh(item, PLAIN, relief, 2500.0) for item in (pair, turned))
    np.testing.assert_allclose(back.error.value(pair.contact_ratio - x), ahead.error.value(x), rtol=1e-10)


def test_what_relief_cannot_do() -> None:
    pair, relief = scene(CASES[0])
    for model, words in (
        (StiffnessModel(double_contact_factor=0.8), "each pair"),
        (StiffnessModel(variation=0.2), "each pair"),
    ):
        with pytest.raises(NotPossible, match=words):
            loaded_mesh(pair, model, relief, 100.0)
    with pytest.raises(NotPossible, match="positive force"):
        loaded_mesh(pair, PLAIN, relief, 0.0)
