"""Load sharing, root stress and contact pressure: closed forms of the standards, reference numbers."""

from __future__ import annotations

import json
from math import cos, isclose, pi, radians, sin, sqrt, tan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import DATA

from gearstab.gears.geometry import Gear, tooth_profile
from gearstab.gears.mesh_stiffness import StiffnessModel
from gearstab.gears.pair import Pair
from gearstab.gears.stress import (
    contact_pressure,
    critical_section,
    load_shares,
    mesh_root_stress,
    root_stress,
    root_stress_factors,
)
from gearstab.systems.gearbox import bodies

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


# --- tooth profiles: the fillet against the rack that cuts it, and discs


GEARS = [
    Gear(10, 0.003),  # undercut
    Gear(14, 0.003),
    Gear(14, 0.003, profile_shift=0.19),
    Gear(19, 0.003175),
    Gear(25, 0.002, profile_shift=1.1),  # the rounding's centre lies beyond the pitch line
    Gear(48, 0.003175, profile_shift=-0.3),
    Gear(30, 0.002, rack_tip_radius=0.1),
    Gear(30, 0.002, rack_tip_radius=0.0),
    Gear(22, 0.002, addendum=1.25, dedendum=1.5),
    Gear(40, 0.002, pressure_angle=pi * 25 / 180),
]
ids = [f"{g.teeth}-{g.profile_shift}-{g.rounding:.2f}" for g in GEARS]
each = pytest.mark.parametrize("gear", GEARS, ids=ids)


def rack_tip(gear, turn):
    """Centre of the rounding of the rack's tip in the tooth's frame (x + i y) when the gear has turned by ``turn``."""
    m, alpha = gear.module, gear.pressure_angle
    rho = gear.rounding * m
    # The flank is the line |u| = pi m/4 - v tan alpha at the depth v below the reference line, to the cutter's right.
    v = gear.dedendum * m - rho
    u = pi * m / 4 - v * tan(alpha) - rho / cos(alpha)
    fixed = (u + gear.radius * turn) + 1j * (gear.radius + gear.profile_shift * m - v)
    # The gear turns clockwise as the rack moves to the right; the tooth stands half a pitch to the right of the space.
    own = fixed * np.exp(1j * (turn + pi / gear.teeth))
    return -own.real + 1j * own.imag, rho  # mirrored: the left flank of the tooth is cut, the right one drawn


@each
def test_the_fillet_is_the_envelope_of_the_rack_tip(gear) -> None:
    """Each of its points is at the distance rho from the path of the rounding's centre and never closer."""
    profile = tooth_profile(gear)
    turns = np.linspace(-1.0, 1.0, 20001) * 4 * gear.module / gear.radius
    centre, rho = rack_tip(gear, turns)
    for gamma in np.linspace(pi / 2, profile.fillet_end, 15):
        x, y, _, _ = profile.fillet(gamma)
        distance = np.abs(x + 1j * y - centre)
        # The path is sampled every 4e-4 modules: a distance misses its minimum by (2e-4 m)^2/(2 rho) or less, and by
        # 2e-4 m where rho = 0.
        miss = gear.module * (4e-8 / max(2 * gear.rounding, 2e-4))
        assert distance.min() > rho - 1e-12
        assert distance.min() < rho + miss


@each
def test_the_rack_tip_spares_the_involute(gear) -> None:
    profile = tooth_profile(gear)
    turns = np.linspace(-1.0, 1.0, 4001) * 4 * gear.module / gear.radius
    centre, rho = rack_tip(gear, turns)
    x, y, _, _ = profile.involute(np.linspace(profile.form_roll, profile.tip_roll, 50))
    assert np.abs((x + 1j * y)[:, None] - centre).min() > rho - 1e-12


@each
def test_fillet_and_involute_meet(gear) -> None:
    profile = tooth_profile(gear)
    fillet, flank = profile.fillet(profile.fillet_end), profile.involute(profile.form_roll)
    np.testing.assert_allclose(fillet[:2], flank[:2], rtol=1e-11)
    x, y, _, _ = profile.fillet(pi / 2)
    assert isclose(np.hypot(x, y), gear.root_radius, rel_tol=1e-12)
    if not profile.undercut:  # with a common tangent
        cross = fillet[2] * flank[3] - fillet[3] * flank[2]
        assert abs(cross) < 1e-10 * np.hypot(*fillet[2:]) * np.hypot(*flank[2:])


@each
def test_rates_are_those_of_the_points(gear) -> None:
    profile = tooth_profile(gear)
    step = 1e-6
    for curve, at in (
        (profile.fillet, 0.5 * (pi / 2 + profile.fillet_end)),
        (profile.involute, 0.9 * profile.tip_roll),
    ):
        _, _, dx, dy = curve(at)
        after, before = curve(at + step), curve(at - step)
        rates = [(after[i] - before[i]) / (2 * step) for i in (0, 1)]
        # Central differences: truncation 1e-12, rounding 1e-16/1e-6.
        np.testing.assert_allclose([dx, dy], rates, rtol=1e-7, atol=1e-9)


@settings(deadline=None, max_examples=60)
@given(st.integers(6, 200), st.floats(-0.3, 1.0), st.sampled_from([0.25, 0.35, 0.43]))
def test_the_form_radius_is_where_the_straight_flank_ends(z, x, alpha) -> None:
    """sqrt[r_b^2 + (r sin alpha - h/sin alpha)^2], h the depth of the rack's straight flank below the pitch line."""
    try:
        gear = Gear(z, 0.002, alpha, x)
        profile = tooth_profile(gear)
    except ValueError:
        return
    depth = (gear.dedendum - gear.rounding * (1 - sin(alpha)) - x) * gear.module
    start = gear.radius * sin(alpha) - depth / sin(alpha)
    if start >= 0:
        assert isclose(profile.form_radius, sqrt(gear.base_radius**2 + start**2), rel_tol=1e-10)
    assert profile.undercut == (start < -1e-12 * gear.module)
    assert np.all(np.diff(np.hypot(*profile.outline(30))) > -1e-12)


def test_discs_of_the_reference() -> None:
    """Discs of the base radius, as Kuria & Kihiu 2008 take their gears."""
    data, density = REFERENCE["disc"], 7850.0
    for z, bore, mass, polar in zip(*(data[k] for k in ("teeth", "bore_radius", "mass", "polar")), strict=True):
        gear = Gear(z, data["module"], face_width=data["face_width"])
        rotor = {"body_radius": gear.base_radius, "bore_radius": bore, "face_width": gear.face_width}
        assert isclose(bodies.mass(rotor, density), mass, rel_tol=1e-8)
        assert isclose(bodies.inertia(rotor, density), polar, rel_tol=1e-8)


def test_what_a_rack_cannot_cut() -> None:
    with pytest.raises(ValueError, match="internal"):
        tooth_profile(Gear(60, 0.002, internal=True))
    with pytest.raises(ValueError, match=r"flank|involute"):
        tooth_profile(Gear(8, 0.002, addendum=-0.21))
