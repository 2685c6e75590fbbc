"""Profile relief of helical teeth: slices in equilibrium, against their definition, and the limits that must hold."""

from dataclasses import replace
from itertools import pairwise
from math import asin, degrees, pi

import numpy as np
import pytest

from gearstab.gears.geometry import Gear
from gearstab.gears.loaded import loaded_mesh
from gearstab.gears.mesh_stiffness import StiffnessModel, mesh_stiffness, single_stiffness
from gearstab.gears.pair import Pair
from gearstab.gears.relief import NO_RELIEF, FlankRelief, Relief

PLAIN = StiffnessModel()
TIP, ROOT = FlankRelief(20e-6, 0.004, 2), FlankRelief(5e-6, 0.006, 1)
LONG = FlankRelief(8e-6, 0.02, 2)
RELIEFS = {
    "tips": Relief(pinion_tip=TIP, wheel_tip=TIP),
    "tip and roots": Relief(pinion_tip=TIP, pinion_root=ROOT, wheel_root=ROOT),
    "longer than the path": Relief(pinion_tip=LONG, wheel_tip=LONG),
    "of one end": Relief(wheel_tip=ROOT),
}
REVERSED = pytest.mark.parametrize("wheel_drives", [False, True])


def pair(angle: float, width: float = 0.03, wheel_drives: bool = False) -> Pair:
    """32/48 teeth; angle: deg."""
    one, two = (Gear(z, 0.003, face_width=width, helix_angle=s * pi / 180 * angle) for z, s in ((32, 1), (48, -1)))
    return Pair(one, two, wheel_drives=wheel_drives)


def force_of(item: Pair, relief: Relief, x: float, delta: float) -> float:
    """The force of all slices by Gauss's rule on short pieces of the face, from the definition."""
    overlap = item.overlap_ratio
    jumps = [(x - p) % 1 + n for p in (0.0, item.contact_ratio) for n in range(int(overlap) + 1)]
    ends = sorted({0.0, overlap, *(u for u in jumps if 0 < u < overlap)})
    points, weights = np.polynomial.legendre.leggauss(4)
    total = 0.0
    for low, high in pairwise(ends):
        edges = np.linspace(low, high, 401)
        u = edges[:-1, None] + (edges[1] - low) * (points + 1) / 2
        s, touching = item.contacts(x - u)
        s = np.clip(s, *item.path)
        k = np.where(touching, single_stiffness(item, s, PLAIN), 0.0)
        carried = np.sum(k * np.maximum(delta - relief.gap(item, s), 0.0), axis=-1)
        total += float(np.sum(carried @ weights)) * (edges[1] - low) / 2
    return total / overlap


@pytest.mark.parametrize("name", RELIEFS)
def test_all_slices_together_carry_the_force(name: str) -> None:
    """The force with the approach found, and its difference quotient for the tangent stiffness. Where a contact ends
    the quadrature has an error of the square of its step, 1/400 of the face, and the quotient one of
    its own step.
    """
    item, relief = pair(12.0), RELIEFS[name]
    for force in (600.0, 4000.0):
        found = loaded_mesh(item, PLAIN, relief, force)
        for x in (0.137, 0.61):
            delta = float(found.error.value(np.array(x)))
            assert force_of(item, relief, x, delta) == pytest.approx(force, rel=1e-5)
            step = 1e-3 * delta
            more, less = (force_of(item, relief, x, delta + sign * step) for sign in (1, -1))
            assert float(found.curve.value(np.array(x))) == pytest.approx((more - less) / (2 * step), rel=3e-4)


@REVERSED
@pytest.mark.parametrize("angle", [2.0, 20.0])
def test_many_slices_of_sorted_gaps_come_near(angle: float, wheel_drives: bool) -> None:
    """4,000 slices, each a spur mesh of its own: they differ by 1/n of the entry of a pair at one slice."""
    item, relief = pair(angle, wheel_drives=wheel_drives), RELIEFS["tip and roots"]
    count = 4000
    u = (np.arange(count) + 0.5) / count * item.overlap_ratio
    for force in (300.0, 3000.0, 30_000.0):
        found = loaded_mesh(item, PLAIN, relief, force)
        for x in np.linspace(0.013, 0.97, 12):
            s, touching = item.contacts(x - u)
            s = np.clip(s, *item.path)
            k = np.where(touching, single_stiffness(item, s, PLAIN), 0.0).ravel() / count
            e = relief.gap(item, s).ravel()
            k, e = k[np.argsort(e)], np.sort(e)
            carried, closing = np.cumsum(k), np.cumsum(k * e)
            with np.errstate(divide="ignore", invalid="ignore"):
                delta = (force + closing) / carried
            last = np.argmax((carried > 0) & (delta <= np.append(e[1:], np.inf)))
            assert float(found.error.value(x)) == pytest.approx(delta[last], rel=2e-4)
            assert float(found.curve.value(x)) == pytest.approx(carried[last], rel=4e-4)


@pytest.mark.parametrize("force", [400.0, 3000.0])
def test_the_spur_limit(force: float) -> None:
    """The difference falls with the helix angle, as the lines do, and is nothing at 0."""
    x = np.linspace(0.003, 0.983, 29)
    relief = RELIEFS["tips"]
    spur = loaded_mesh(pair(0.0), PLAIN, relief, force)
    off = []
    for angle in (0.1, 0.01, 1e-3, 1e-4, 1e-5):
        found = loaded_mesh(pair(angle), PLAIN, relief, force)
        parts = [(found.curve, spur.curve), (found.error, spur.error)]
        off.append(max(np.max(np.abs(a.value(x) / b.value(x) - 1)) for a, b in parts))
        assert found.contact_ratio == pytest.approx(spur.contact_ratio, abs=0.3 * angle)
        assert found.start == pytest.approx(spur.start, abs=0.3 * angle)
    assert off[-1] < 1e-5
    assert np.all(np.array(off[2:]) < 0.2 * np.array(off[1:-1]))
    exact = loaded_mesh(pair(1e-7), PLAIN, relief, force)
    np.testing.assert_allclose(exact.curve.value(x), spur.curve.value(x), rtol=1e-8)
    np.testing.assert_allclose(exact.error.value(x), spur.error.value(x), rtol=1e-8)


@pytest.mark.parametrize("angle", [0.5, 11.0, 25.0])
def test_without_relief_it_is_the_stiffness_of_helical_teeth(angle: float) -> None:
    item, x = pair(angle), np.linspace(0.0, 1.0, 101)
    found, plain = loaded_mesh(item, PLAIN, NO_RELIEF, 3000.0), mesh_stiffness(item)
    np.testing.assert_allclose(found.curve.value(x), plain.curve.value(x), rtol=1e-11)
    np.testing.assert_allclose(found.error.value(x) * plain.curve.value(x), 3000.0, rtol=1e-11)
    assert found.contact_ratio == pytest.approx(item.contact_ratio, rel=1e-12)
    assert found.start == pytest.approx(0.0, abs=1e-12)
    assert found.levels == pytest.approx(plain.levels, rel=1e-10)
    kept, whole = found.rectangular(), plain.rectangular()
    assert (kept.epsilon, kept.mean_stiffness) == pytest.approx((whole.epsilon, whole.mean_stiffness), rel=1e-10)


@pytest.mark.parametrize("whole", [1, 2])
def test_a_whole_overlap_leaves_nothing_to_vary(whole: int) -> None:
    """Every phase of the path is touched as often as any other, with relief and at every load; near it nearly so."""
    angle = degrees(asin(whole * pi * 0.003 / 0.04))
    relief = RELIEFS["tips"]
    for force in (500.0, 5000.0):
        item = pair(angle, 0.04)
        assert item.overlap_ratio == pytest.approx(whole, abs=1e-12)
        found = loaded_mesh(item, PLAIN, relief, force)
        assert found.peak_to_peak < 1e-10 * found.mean_error
        assert found.epsilon < 1e-10
        near = loaded_mesh(pair(angle * (1 + 1e-4), 0.04), PLAIN, relief, force)
        assert near.mean == pytest.approx(found.mean, rel=1e-3)
        assert near.epsilon < 1e-3


@pytest.mark.parametrize("name", RELIEFS)
def test_reversed_drive_mirrors_the_cycle(name: str) -> None:
    ahead, back = (pair(9.0, wheel_drives=way) for way in (False, True))
    x = np.linspace(0.01, 0.99, 33)
    one, two = (loaded_mesh(item, PLAIN, RELIEFS[name], 2500.0) for item in (ahead, back))
    turned = ahead.contact_ratio + ahead.overlap_ratio - x
    np.testing.assert_allclose(two.error.value(turned), one.error.value(x), rtol=1e-10)
    np.testing.assert_allclose(two.curve.value(turned), one.curve.value(x), rtol=1e-9)


def test_more_load_closes_more_gaps_and_less_relief_makes_a_stiffer_mesh() -> None:
    item = pair(15.0)
    ratios = [loaded_mesh(item, PLAIN, RELIEFS["tips"], force).contact_ratio for force in (1.0, 500.0, 3e3, 1e5)]
    assert np.all(np.diff(ratios) > 0)
    assert ratios[-1] == pytest.approx(item.contact_ratio, rel=1e-12)
    means = [
        loaded_mesh(item, PLAIN, Relief(replace(TIP, amount=amount), None, replace(TIP, amount=amount)), 2000.0).mean
        for amount in (40e-6, 20e-6, 5e-6, 1e-9)
    ]
    assert np.all(np.diff(means) > 0)
    assert means[-1] == pytest.approx(mesh_stiffness(item).mean, rel=1e-9)


def test_a_transverse_contact_ratio_below_one_is_enough_with_overlap() -> None:
    one, two = (Gear(z, 0.003, face_width=0.05, helix_angle=s * 0.5, addendum=0.5) for z, s in ((32, 1), (48, -1)))
    item = Pair(one, two)
    assert item.contact_ratio < 1 < item.total_contact_ratio
    found = loaded_mesh(item, PLAIN, RELIEFS["tips"], 3000.0)
    delta = float(found.error.value(np.array(0.3)))
    assert force_of(item, RELIEFS["tips"], 0.3, delta) == pytest.approx(3000.0, rel=1e-5)
