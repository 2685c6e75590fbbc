"""Load sharing, root stress and contact pressure: closed forms of the standards, reference numbers."""

import json
from math import cos, isclose, pi, radians, sin, sqrt, tan

import numpy as np
import pytest
from scenes import DATA

from gearstab.gears.geometry import Gear
from gearstab.gears.mesh_stiffness import StiffnessModel
from gearstab.gears.pair import Pair
from gearstab.gears.profile import tooth_profile
from gearstab.gears.stress import (
    contact_pressure,
    critical_section,
    load_shares,
    mesh_root_stress,
    root_stress,
    root_stress_factors,
)

REFERENCE = json.loads((DATA / "gears_reference.json").read_text())
PAIR = Pair(Gear(19, 0.003175, face_width=0.016), Gear(48, 0.003175, face_width=0.016))


def iso_section(gear):
    """s_Fn and rho_F in modules and the height of the force over the section, by ISO 6336-3:2006."""
    alpha, z, x = gear.pressure_angle, gear.teeth, gear.profile_shift
    rho = gear.rounding
    e = pi / 4 - gear.dedendum * tan(alpha) - (1 - sin(alpha)) * rho / cos(alpha)
    g = rho - gear.dedendum + x
    h = 2 / z * (pi / 2 - e) - pi / 3
    theta = pi / 6
    for _ in range(100):
        theta = 2 * g / z * tan(theta) - h
    thickness = z * sin(pi / 3 - theta) + sqrt(3) * (g / cos(theta) - rho)
    radius = rho + 2 * g**2 / (cos(theta) * (z * cos(theta) ** 2 - 2 * g))

    def arm(beta):
        """h_Fe for a force at the angle beta, from its crossing of the tooth's axis at r_b/cos beta."""
        crossing = 2 * gear.base_radius / cos(beta) / gear.module
        return 0.5 * (crossing - z * cos(pi / 3 - theta) - g / cos(theta) + rho)

    return thickness, radius, arm


@pytest.mark.parametrize(
    "gear",
    [
        Gear(19, 0.003),
        Gear(48, 0.002, profile_shift=-0.2),
        Gear(30, 0.004, pressure_angle=radians(25), profile_shift=0.4),
    ],
    ids=["19", "48", "30"],
)
def test_critical_section_by_the_closed_form_of_iso_6336(gear) -> None:
    thickness, radius, _ = iso_section(gear)
    section = critical_section(gear)
    assert isclose(section.thickness, thickness * gear.module, rel_tol=1e-10)
    # The curvature is a difference quotient of step 1e-5.
    assert isclose(section.radius, radius * gear.module, rel_tol=1e-7)


def test_the_tangent_stands_at_thirty_degrees() -> None:
    gear = Gear(14, 0.003, profile_shift=0.19)
    section = critical_section(gear)
    x, y = tooth_profile(gear).outline(20000)
    at = int(np.argmin(np.abs(y - section.height)))
    slope = (x[at - 5] - x[at + 5]) / (y[at + 5] - y[at - 5])
    assert isclose(slope, tan(pi / 6), rel_tol=2e-3)
    assert isclose(x[at], section.thickness / 2, rel_tol=1e-3)


def test_stress_factors_of_a_common_pinion() -> None:
    """ISO 6336-3, by its closed forms, for 19/48 at the outer point of single contact."""
    gear = PAIR.pinion
    s = PAIR.path[0] + PAIR.base_pitch
    roll = s / gear.base_radius
    thickness, radius, height = iso_section(gear)
    beta = roll - gear.base_half_angle
    arm = height(beta)
    form, correction = root_stress_factors(gear, roll)
    assert isclose(form, 6 * arm * cos(beta) / (thickness**2 * cos(pi / 9)), rel_tol=1e-9)
    slender = thickness / arm
    expected = (1.2 + 0.13 * slender) * (thickness / 2 / radius) ** (1 / (1.21 + 2.3 / slender))
    assert isclose(correction, expected, rel_tol=1e-7)
    # Charts of the standard for 19 teeth without shift, rho = 0.38: about 1.5 and 1.7.
    assert 1.35 < form < 1.65
    assert 1.55 < correction < 1.85


def test_root_stress_of_the_reference() -> None:
    """Its nominal stress, bending less compression at the same section, is the largest of some 40 points."""
    data = REFERENCE["root_stress"]
    x = np.linspace(0, 1, 400, endpoint=False)
    for w, z, shift, b, largest in zip(*(data[k] for k in list(data)), strict=True):
        gears = (Gear(z[i], 0.003, profile_shift=shift[i], face_width=b) for i in (0, 1))
        found = [1e-6 * stress.max() for stress in mesh_root_stress(Pair(*gears), x, w, notch=False)]
        np.testing.assert_allclose(found, largest, rtol=3e-3)


def test_root_stress_follows_the_force() -> None:
    roll = np.linspace(0.3, 0.5, 5)
    gear = PAIR.pinion
    once = root_stress(gear, roll, 1000.0)
    np.testing.assert_allclose(root_stress(gear, roll, 2000.0, 0.5 * gear.face_width), 4 * once, rtol=1e-13)
    assert np.all(np.diff(once) > 0)
    assert np.all(root_stress(gear, roll, 1000.0, notch=False) < once)
    # A force that passes below the critical section does not bend it.
    np.testing.assert_array_equal(root_stress_factors(Gear(200, 0.002, dedendum=1.1, profile_shift=-2.0), 0.01)[0], 0.0)
    assert np.all(np.isnan(root_stress(Gear(60, 0.002, internal=True), roll, 1.0)))


def test_load_shares() -> None:
    x = np.linspace(0, 1, 200, endpoint=False)
    c = PAIR.contact_ratio
    s, share = load_shares(PAIR, x)
    np.testing.assert_allclose(share.sum(-1), 1, rtol=1e-14)
    alone = x >= c - 1
    np.testing.assert_array_equal(share[alone], np.broadcast_to([1.0, 0.0], (alone.sum(), 2)))
    assert np.all((share[~alone] > 0.3) & (share[~alone] < 0.7))
    assert s.shape == share.shape == (200, 2)
    # Neither body coupling nor a measured level changes how two pairs share.
    other = load_shares(PAIR, x, StiffnessModel(0.8, 3e8, 0.1))[1]
    np.testing.assert_allclose(other, share, rtol=1e-12, atol=1e-15)


def test_dynamic_force_scales_each_phase() -> None:
    x = np.linspace(0, 1, 50)
    force = 1000 * (1 + 0.5 * np.sin(7 * x))
    pinion, wheel = mesh_root_stress(PAIR, x, force)
    once = mesh_root_stress(PAIR, x, 1.0)
    np.testing.assert_allclose(pinion, once[0] * force[:, None], rtol=1e-13)
    np.testing.assert_allclose(wheel, once[1] * force[:, None], rtol=1e-13)


def test_contact_pressure_at_the_pitch_point_by_iso_6336() -> None:
    """sigma_H0 = Z_H Z_E sqrt[F_t/(d1 b) (u + 1)/u], Z_H = sqrt[2/(cos^2 alpha tan alpha_w)], ISO 6336-2."""
    for pair in (PAIR, Pair(PAIR.pinion, PAIR.wheel, PAIR.centre * 1.004)):
        steel, force = pair.pinion, 1500.0
        ze = sqrt(steel.young / (2 * pi * (1 - steel.poisson**2)))
        zh = sqrt(2 / (cos(steel.pressure_angle) ** 2 * tan(pair.pressure_angle)))
        tangential = force * cos(steel.pressure_angle)
        base = tangential / (2 * steel.radius * pair.face_width) * (pair.ratio + 1) / pair.ratio
        assert isclose(contact_pressure(pair, pair.pitch_point, force), zh * ze * sqrt(base), rel_tol=1e-12)


def test_contact_pressure_of_an_internal_pair_is_lower() -> None:
    ring = Pair(Gear(24, 0.002), Gear(70, 0.002, internal=True))
    outer = Pair(Gear(24, 0.002), Gear(70, 0.002))
    ratio = contact_pressure(ring, ring.pitch_point, 1.0) / contact_pressure(outer, outer.pitch_point, 1.0)
    assert isclose(ratio, sqrt((1 / 24 - 1 / 70) / (1 / 24 + 1 / 70)), rel_tol=1e-12)
    assert contact_pressure(outer, 0.0, 1.0) == np.inf
