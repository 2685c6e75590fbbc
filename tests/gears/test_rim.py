"""Bodies under a tooth: closed forms of whole circles, published polynomials, and rims of internal gears."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from gearstab.gears.compliance import FOUNDATION, tooth_compliance
from gearstab.gears.geometry import Gear
from gearstab.gears.rim import foot_compliance

NU = 0.3
BODIES = pytest.mark.parametrize(("root", "clamped"), [(1.0, 0.4), (0.05, 0.045), (1.0, 1.2), (0.2, 0.7)])


@BODIES
def test_uniform_stress_all_around_is_that_of_lame(root, clamped) -> None:
    """u = A r + B/r with u = 0 on the clamped circle; a foot of the whole circle carries 1/(2 pi r) everywhere."""
    found = foot_compliance(root, clamped, pi, NU)
    out = 1 if root > clamped else -1
    mu = 1 / (2 * (1 + NU))  # of E = 1
    # Radial: sigma_r = 2 mu [A/(1 - 2 nu) - B/r^2]; tangential: tau = -2 mu D/r^2 of u = C r + D/r.
    radial = out / (2 * pi * root) / (2 * mu) / (1 / (1 - 2 * NU) + clamped**2 / root**2)
    assert found.normal == pytest.approx(radial * (root - clamped**2 / root), rel=1e-10)
    d = -out / (2 * pi * root) * root**2 / (2 * mu)
    assert found.shear == pytest.approx(d / root - d * root / clamped**2, rel=1e-10)


@pytest.mark.parametrize(("half_angle", "h"), [(0.03, 2.0), (0.05, 3.0), (0.08, 2.0), (0.1, 4.0), (0.02, 6.0)])
def test_bodies_clamped_at_their_bore_have_the_published_coefficients(half_angle, h) -> None:
    """Sainsot, Velex & Duverger 2004: L and P to 3 %, M to 7 %, P Q to 6 %, which is how well polynomials fit."""
    terms = np.array([1 / half_angle**2, h**2, h / half_angle, 1 / half_angle, h, 1.0])
    big_l, big_m, big_p, big_q = FOUNDATION @ terms
    found = foot_compliance(1.0, 1 / h, half_angle, NU)
    assert found.bending == pytest.approx(big_l, rel=0.01)
    assert found.coupling == pytest.approx(big_m, rel=0.07)
    assert found.shear == pytest.approx(big_p, rel=0.03)
    assert found.normal == pytest.approx(big_p * big_q, rel=0.06)


def test_coefficients_know_no_size() -> None:
    one, two = foot_compliance(1.0, 1.1, 0.03, NU), foot_compliance(0.05, 0.055, 0.03, NU)
    for name in ("bending", "coupling", "shear", "normal"):
        assert getattr(one, name) == pytest.approx(getattr(two, name), rel=1e-9)


def test_thin_rims_are_stiffer_and_a_rim_without_a_radius_is_rigid() -> None:
    """Clamped close behind the teeth it gives way less; all along the contact it is softer than nothing."""
    gear = Gear(99, 0.003, internal=True, face_width=0.02)
    roll = np.linspace(0.3, 0.42, 5)
    rigid = tooth_compliance(gear, roll)
    assert not rigid.foundation.any()
    found = [
        tooth_compliance(replace(gear, bore_radius=ratio * gear.root_radius), roll).foundation
        for ratio in (1.001, 1.02, 1.1, 1.5)
    ]
    assert np.all(found[0] > 0)
    assert np.all(np.diff(found, axis=0) > 0)
    assert np.max(found[0]) < 0.1 * np.min(found[2])


def test_many_teeth_are_those_of_a_rack_inside_and_outside() -> None:
    """A foot far smaller than the radius does not know on which side of it the body is: differences go as its size."""
    for name in ("bending", "coupling", "shear", "normal"):
        apart = []
        for size in (1e-2, 3e-3):
            inside, outside = (foot_compliance(1.0, 1.0 + sign * size, size, NU) for sign in (1, -1))
            apart.append(getattr(inside, name) / getattr(outside, name) - 1)
        assert abs(apart[1]) < 0.04
        assert apart[1] / apart[0] == pytest.approx(0.3, rel=0.05)
