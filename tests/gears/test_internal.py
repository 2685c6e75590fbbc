"""Teeth of internal gears: a reference, quadrature over the height, and their meshes."""

import json
from dataclasses import replace
from math import isclose, pi

import numpy as np
import pytest
from scenes import DATA
from scipy.integrate import quad
from scipy.optimize import brentq

from gearstab.gears.compliance import FOUNDATION, contact_compliance, foot_compliance, pair_stiffness, tooth_compliance
from gearstab.gears.geometry import Gear, involute
from gearstab.gears.mesh_stiffness import StiffnessModel, contact_stiffness, mesh_stiffness
from gearstab.gears.pair import Pair

ROWS = json.loads((DATA / "teeth" / "reference_relief_internal_phases.json").read_text())["internal"]
RING = Pair(Gear(24, 0.003), Gear(78, 0.003, internal=True))


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row['teeth']}")
def test_teeth_of_the_reference(row) -> None:
    names = ("teeth", "module", "alpha", "profile_shift", "addendum", "dedendum")
    gear = Gear(*(row[name] for name in names), young=row["E"], poisson=row["nu"], internal=True, face_width=1.0)
    found = [gear.tip_radius, gear.root_radius, gear.base_radius]
    np.testing.assert_allclose(found, [row[f"{name}_radius"] for name in ("tip", "root", "base")], rtol=1e-12)
    for point in row["points"]:
        tooth = tooth_compliance(gear, point["roll"])
        np.testing.assert_allclose([tooth.bending, tooth.shear, tooth.axial], point["bending_shear_axial"], rtol=1e-11)


@pytest.mark.parametrize("shift", [-0.2, 0.0, 0.4])
def test_compliance_by_adaptive_quadrature_over_the_height(shift) -> None:
    """The half thickness at each height from the half angle of the tooth at the radius that has this height."""
    gear = Gear(61, 0.002, profile_shift=shift, internal=True, face_width=0.01)

    def half_angle(radius: float) -> float:
        return gear.base_half_angle + involute(gear.profile_angle(radius))

    def height(radius: float) -> float:
        return radius * np.cos(half_angle(radius))

    roll = 0.39
    radius = gear.base_radius * np.hypot(1, roll)
    x_c, y_c, foot = radius * np.sin(half_angle(radius)), height(radius), height(gear.root_radius)
    beta = np.arccos(gear.base_radius / radius) + half_angle(radius)
    sin, cos = np.sin(beta), np.cos(beta)

    def half(y: float) -> float:
        at = brentq(lambda r: height(r) - y, gear.base_radius * 1.0001, gear.root_radius * 1.001, xtol=1e-15)
        return at * np.sin(half_angle(at))

    def integral(function) -> float:
        return quad(function, y_c, foot, epsabs=0, epsrel=1e-10)[0]

    b, e = gear.face_width, gear.young
    moment = integral(lambda y: ((y - y_c) * cos - x_c * sin) ** 2 / (e * 2 / 3 * half(y) ** 3 * b))
    area = integral(lambda y: 1 / (2 * half(y) * b))
    tooth = tooth_compliance(gear, roll)
    assert isclose(tooth.bending, moment, rel_tol=1e-8)
    assert isclose(tooth.shear, 1.2 * cos**2 * area * 2 * (1 + gear.poisson) / e, rel_tol=1e-8)
    assert isclose(tooth.axial, sin**2 * area / e, rel_tol=1e-8)


def test_a_tooth_of_an_internal_gear_is_stiffer_than_that_of_an_external_one() -> None:
    """It grows thicker towards its root; as the number of teeth grows both become the tooth of a rack."""
    near = {}
    for teeth in (99, 20000):
        inside, outside = (Gear(teeth, 0.003, internal=internal, rack_tip_radius=0.0) for internal in (True, False))
        alpha = inside.transverse_angle
        parts = [tooth_compliance(gear, np.tan(alpha)) for gear in (inside, outside)]
        near[teeth] = parts[0].bending / parts[1].bending
    assert near[99] < 0.75
    assert isclose(near[20000], 1.0, abs_tol=0.003)


def test_the_mesh_is_the_sum_of_its_pairs() -> None:
    mesh = mesh_stiffness(RING)
    x = (np.arange(997) + 0.5) / 997
    np.testing.assert_allclose(mesh.curve.value(x), np.sum(contact_stiffness(RING, x)[1], axis=-1), rtol=1e-10)
    s = np.linspace(*RING.path, 7)
    parts = contact_compliance(RING)
    for gear, arm in ((RING.pinion, s), (RING.wheel, RING.length + s)):
        parts = parts + tooth_compliance(gear, arm / gear.base_radius, RING.face_width).total
    np.testing.assert_allclose(pair_stiffness(RING, s), 1 / parts, rtol=1e-13)
    assert isclose(mesh.mean, float(np.mean(np.sum(contact_stiffness(RING, x)[1], axis=-1))), rel_tol=1e-3)


def test_a_measured_pair_is_as_stiff_all_along_its_path() -> None:
    mesh = mesh_stiffness(RING, StiffnessModel(single_pair_stiffness=3e8))
    assert mesh.waveform.piecewise_constant
    assert isclose(mesh.mean, 3e8 * RING.contact_ratio, rel_tol=1e-12)


def test_helical_internal_pairs_average_too() -> None:
    helical = [replace(gear, helix_angle=0.2) for gear in (RING.pinion, RING.wheel)]
    mesh = mesh_stiffness(Pair(*helical))
    x = (np.arange(300) + 0.5) / 300
    delay = mesh.pair.overlap_ratio * (np.arange(3000) + 0.5) / 3000
    slices = mesh.transverse.value(x[:, None] - delay).mean(axis=-1)
    np.testing.assert_allclose(mesh.curve.value(x), slices, rtol=1e-3)


# --- bodies under a tooth: closed forms of whole circles, published polynomials, and rims of internal gears


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
