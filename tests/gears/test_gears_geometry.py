"""Involute geometry: against reference numbers, against plane geometry done numerically, and at the limits."""

import json
from dataclasses import replace
from math import acos, atan2, cos, degrees, hypot, isclose, pi, radians, sin, tan

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scenes import DATA
from scipy.optimize import brentq

from gearstab.gears.geometry import Gear, inverse_involute, involute, tooth_profile
from gearstab.gears.pair import Pair

REFERENCE = json.loads((DATA / "gears_reference.json").read_text())

teeth = st.integers(18, 150)
shifts = st.floats(-0.2, 0.6)


def pair_of(entry):
    common = {
        "module": entry["m_mm"] * 1e-3,
        "pressure_angle": radians(entry["alpha"]),
        "addendum": entry["ha"],
        "dedendum": entry["ha"] + 0.25,
    }
    one, two = (Gear(entry[f"z{i}"], profile_shift=entry[f"x{i}"], **common) for i in (1, 2))
    return Pair(one, two)


@pytest.mark.parametrize(
    "entry", REFERENCE["contact_ratios"], ids=lambda e: f"{e['z1']}-{e['z2']}-{e['alpha']}-{e['x1']}"
)
def test_contact_ratios_of_the_reference(entry) -> None:
    """Its digits are printed to 1e-9."""
    pair = pair_of(entry)
    assert abs(pair.contact_ratio - entry["cr_interference_limited"]) < 2e-8
    assert any(n.name == "interference" for n in pair.notices) == entry["interference"]
    assert abs(degrees(pair.pressure_angle) - entry["alpha_w_deg"]) < 1e-7
    assert abs(pair.centre * 1e3 - entry["C_mm"]) < 1e-6
    lands = [gear.top_land / gear.module for gear in (pair.pinion, pair.wheel)]
    np.testing.assert_allclose(lands, entry["topland_modules"], atol=1e-8)


@pytest.mark.parametrize(
    ("one", "two", "expected"),
    [
        (19, 48, 1.6456),
        (28, 28, 1.6380),
        (62, 62, 1.7898),
        (25, 25, 1.6117),
        (21, 51, 1.6636),
        (30, 50, 1.704094),
        (20, 40, 1.635186),
    ],
)
def test_contact_ratios_of_standard_pairs(one, two, expected) -> None:
    assert abs(Pair(Gear(one, 0.002), Gear(two, 0.002)).contact_ratio - expected) < 1e-4


@settings(deadline=None, max_examples=150)
@given(teeth, teeth, shifts, shifts, st.floats(1.0, 1.02), st.sampled_from([14.5, 20.0, 25.0]), st.booleans())
def test_contact_ratio_by_intersection_of_tip_circles(z1, z2, x1, x2, apart, alpha, internal) -> None:
    """The common tangent of the base circles and the tip circles, in plane coordinates."""
    one = Gear(z1, 0.003, radians(alpha), x1)
    if internal:
        z2 = z1 + z2
    two = Gear(z2, 0.003, radians(alpha), x2, internal=internal)
    try:
        pair = Pair(one, two)
        pair = Pair(one, two, pair.centre * apart)
    except ValueError:
        assume(False)
    centre = np.array([pair.centre, 0.0])
    if internal:  # the pinion's centre lies at -a of the wheel's, its contacts beyond it
        centre = np.array([-pair.centre, 0.0])
    angle = acos((two.base_radius + (-1 if internal else 1) * one.base_radius) / pair.centre)
    # Tangent point of the pinion and direction of the line of action, upwards.
    touch = one.base_radius * np.array([cos(angle), -sin(angle)])
    along = np.array([sin(angle), cos(angle)])

    def beyond(s, middle, radius):
        return hypot(*(touch + s * along - middle)) - radius

    last = brentq(beyond, 0, 10 * one.tip_radius, args=(np.zeros(2), one.tip_radius))
    # s of the point of the line nearest to the wheel's centre: T2
    foot = float((centre - touch) @ along)
    if two.tip_radius <= two.base_radius:
        first = foot
    elif internal:
        first = brentq(beyond, foot, foot + 10 * two.tip_radius, args=(centre, two.tip_radius))
    else:
        first = brentq(beyond, foot - 10 * two.tip_radius, foot, args=(centre, two.tip_radius))
    first = max(first, 0.0)
    last = last if internal else min(last, foot)
    assert isclose(pair.contact_ratio, (last - first) / (pi * 0.003 * cos(radians(alpha))), abs_tol=1e-9)
    # The pitch point divides the centre line in the ratio of the teeth.
    pitch = touch + pair.pitch_point * along
    assert abs(pitch[1]) < 1e-12
    assert isclose(pitch[0], one.base_radius / cos(angle), rel_tol=1e-12)


@settings(deadline=None, max_examples=150)
@given(teeth, teeth, shifts, shifts, st.booleans())
def test_teeth_without_backlash_fill_the_pitch(z1, z2, x1, x2, internal) -> None:
    one, two = Gear(z1, 0.002, profile_shift=x1), Gear(z1 + z2 if internal else z2, 0.002, profile_shift=x2)
    two = replace(two, internal=internal)
    try:
        pair = Pair(one, two)
    except ValueError:
        assume(False)
    r1, r2 = pair.pitch_radii
    assert isclose(r2 + (-1 if internal else 1) * r1, pair.centre, rel_tol=1e-12)
    assert isclose(one.thickness(r1) + two.thickness(r2), 2 * pi * r1 / z1, rel_tol=1e-11)
    assert abs(pair.backlash) < 1e-14
    wider = Pair(one, two, pair.centre * 1.001)
    # The wheel moves off along the line of centres; each flank by that times sin alpha, here to second order.
    sine = sin((pair.pressure_angle + wider.pressure_angle) / 2)
    expected = 2 * sine * 0.001 * pair.centre * (-1 if internal else 1)
    assert isclose(wider.backlash, expected, rel_tol=2e-3)


@given(st.floats(0, 10))
def test_inverse_involute(value) -> None:
    angle = inverse_involute(value)
    assert isclose(involute(angle), value, rel_tol=1e-12, abs_tol=1e-15)


def test_no_angle_has_a_negative_involute() -> None:
    with pytest.raises(ValueError, match="must not be negative"):
        inverse_involute(-0.1)


def test_thickness_is_that_of_the_outline() -> None:
    gear = Gear(23, 0.004, profile_shift=0.3)
    profile = tooth_profile(gear)
    for roll in np.linspace(profile.form_roll, profile.tip_roll, 7):
        x, y, _, _ = profile.involute(roll)
        radius = hypot(x, y)
        assert isclose(gear.thickness(radius), 2 * radius * atan2(x, y), rel_tol=1e-12)


@pytest.mark.parametrize("z", [8, 12, 14, 17, 18, 25, 40])
def test_undercut_begins_at_its_limit(z) -> None:
    """x = (17.097 - z)/17.097 at 20 degrees: 2/sin^2(20 degrees) = 17.097."""
    gear = Gear(z, 0.002)
    assert abs(gear.least_shift - (17.097 - z) / 17.097) < 1e-4
    for shift, undercut in ((gear.least_shift - 1e-3, True), (gear.least_shift + 1e-3, False)):
        assert tooth_profile(replace(gear, profile_shift=shift)).undercut == undercut


def test_what_the_pinion_of_14_teeth_suffers() -> None:
    plain = Pair(Gear(14, 0.003), Gear(34, 0.003))
    found = {(n.part, n.name): n for n in plain.notices}
    assert set(found) == {("pinion", "undercut"), ("wheel", "interference"), ("pinion", "fillet_contact")}
    undercut = found["pinion", "undercut"]
    assert (undercut.number, round(undercut.limit, 4)) == (0.0, 0.1812)
    assert str(undercut) == "pinion: undercut 0 (limit 0.18116)"
    assert found["wheel", "interference"].number < 0
    shifted = Pair(Gear(14, 0.003, profile_shift=0.19), Gear(34, 0.003, profile_shift=-0.19))
    assert shifted.notices == ()


def test_notices_of_the_fit() -> None:
    pointed = Pair(Gear(12, 0.002, profile_shift=0.6), Gear(40, 0.002))
    assert [n.name for n in pointed.notices if n.part == "pinion"] == ["top_land", "tip_clearance"][:1]
    tight = Pair(Gear(30, 0.002), Gear(40, 0.002), 0.0698)
    assert {n.name for n in tight.notices} >= {"backlash"}
    far = Pair(Gear(30, 0.002), Gear(40, 0.002), 0.0725)
    assert "contact_ratio" in {n.name for n in far.notices}
    shallow = Pair(Gear(30, 0.002, dedendum=1.05, rack_tip_radius=0.05), Gear(40, 0.002))
    clearance = next(n for n in shallow.notices if n.name == "tip_clearance")
    assert (clearance.part, round(clearance.number, 6), clearance.limit) == ("wheel", 0.05, 0.1)


def test_tip_shortening_gives_back_the_clearance() -> None:
    pair = Pair(Gear(20, 0.002, profile_shift=0.4), Gear(40, 0.002, profile_shift=0.3))
    # What the rack leaves is lost by (x1 + x2) m - (a - a0).
    k = 0.7 - (pair.centre - 0.06) / 0.002
    short = Pair(replace(pair.pinion, tip_shortening=k), replace(pair.wheel, tip_shortening=k))
    np.testing.assert_allclose(short.tip_clearances, 0.25 * 0.002, rtol=1e-10)
    assert short.contact_ratio < pair.contact_ratio


def internal_notices(z1, z2):
    return {n.name for n in Pair(Gear(z1, 0.002), Gear(z2, 0.002, internal=True)).notices}


def test_limits_of_tooth_differences_of_internal_pairs() -> None:
    """Standard teeth of 20 degrees: nine teeth more avoid trochoid interference, some sixteen allow radial assembly."""
    for z1 in (30, 60):
        assert "trochoid_interference" in internal_notices(z1, z1 + 8)
        assert "trochoid_interference" not in internal_notices(z1, z1 + 9)
        assert "trimming" in internal_notices(z1, z1 + 15)
        assert "trimming" not in internal_notices(z1, z1 + 17)
    # tan(alpha_a2)/tan(alpha_w) >= 1 - z1/z2 keeps the ring's tip off the pinion's tangent point.
    for z1 in (20, 26, 30, 40):
        ring = Gear(z1 + 40, 0.002, internal=True)
        tip = ring.profile_angle(ring.tip_radius) if ring.tip_radius > ring.base_radius else 0.0
        sound = tan(tip) / tan(pi / 9) >= 1 - z1 / (z1 + 40)
        assert ("interference" in internal_notices(z1, z1 + 40)) == (not sound)


def test_a_driving_wheel_turns_the_path_round() -> None:
    gears = Gear(19, 0.003), Gear(48, 0.003)
    pair, back = Pair(*gears), Pair(*gears, wheel_drives=True)
    x = np.array([0.0, 0.3, 0.7, 1.9, -0.2])
    s, touching = pair.contacts(x)
    r, touched = back.contacts(x)
    np.testing.assert_allclose(s + r, sum(pair.path), rtol=1e-14)
    np.testing.assert_array_equal(touching, touched)
    # The same pair with its gears swapped: the wheel's distance from its own tangent point.
    swapped = Pair(gears[1], gears[0])
    np.testing.assert_allclose(back.wheel_arm(r), swapped.contacts(x)[0], rtol=1e-13)
    assert isclose(back.pitch_phase, swapped.pitch_phase, rel_tol=1e-12)


@settings(deadline=None, max_examples=50)
@given(st.integers(18, 60), st.integers(18, 60), st.floats(0.8, 1.35), st.floats(-3, 3))
def test_contacts_are_a_base_pitch_apart_and_as_many_as_the_contact_ratio_says(z1, z2, addendum, x) -> None:
    gears = (Gear(z, 0.002, addendum=addendum, dedendum=addendum + 0.25) for z in (z1, z2))
    pair = Pair(*gears)
    s, touching = pair.contacts(x)
    np.testing.assert_allclose(np.diff(s), pair.base_pitch, rtol=1e-10)
    inside = (s >= pair.path[0] - 1e-15) & (s < pair.path[1])
    np.testing.assert_array_equal(inside, touching)
    phase = x % 1.0 % 1.0  # the first may round to 1, which is phase 0
    c = pair.contact_ratio
    assert np.sum(touching) == np.floor(c) + (phase < c - np.floor(c))


def test_the_pitch_point_is_passed_at_its_phase() -> None:
    pair = Pair(Gear(19, 0.003), Gear(48, 0.003))
    s, touching = pair.contacts(pair.pitch_phase)
    assert np.min(np.abs(s[touching] - pair.pitch_point)) < 1e-15


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"teeth": 2}, "at least 3"),
        ({"teeth": 20.5}, "whole number"),
        ({"module": 0.0}, "module must be positive"),
        ({"face_width": -1.0}, "face_width must be positive"),
        ({"young": float("nan")}, "young must be positive"),
        ({"pressure_angle": 20.0}, "between 0 and 45 degrees"),
        ({"poisson": 0.5}, "poisson must lie"),
        ({"addendum": -1.3}, "does not rise"),
        ({"addendum": -1.0}, "inside the base circle"),
        ({"teeth": 3, "dedendum": 1.6}, "root radius"),
        ({"rack_tip_radius": 0.6}, "full rounding"),
        ({"dedendum": 2.2}, "no tooth as deep"),
        ({"teeth": 10, "profile_shift": 0.9}, "pointed teeth"),
        ({"rack_tip_radius": -0.1}, "rack_tip_radius"),
        ({"bore_radius": 0.1}, "bore_radius"),
        ({"bore_radius": -0.01}, "bore_radius"),
    ],
)
def test_what_can_be_no_gear(change, message) -> None:
    with pytest.raises(ValueError, match=message):
        Gear(**({"teeth": 20, "module": 0.002} | change))


def test_what_cannot_mesh() -> None:
    gear = Gear(20, 0.002)
    with pytest.raises(ValueError, match="base pitches differ"):
        Pair(gear, Gear(40, 0.003))
    with pytest.raises(ValueError, match="pinion must be an external gear"):
        Pair(Gear(40, 0.002, internal=True), gear)
    with pytest.raises(ValueError, match="more teeth than its pinion"):
        Pair(gear, Gear(20, 0.002, internal=True))
    with pytest.raises(ValueError, match="base to base"):
        Pair(gear, gear, 0.03)
    with pytest.raises(ValueError, match="do not reach"):
        Pair(gear, gear, 0.05)
    with pytest.raises(ValueError, match=r"profile shifts -0.9 and -1: give centre_distance"):
        Pair(replace(gear, profile_shift=-0.9), replace(gear, profile_shift=-1.0))
    with pytest.raises(ValueError, match="inside the base circle"):
        gear.thickness(0.01)


def test_gears_of_unlike_rack_but_equal_base_pitch_mesh() -> None:
    """A rack of 25 degrees and the module that gives the same base pitch cuts the same involute."""
    one, other = Gear(30, 0.002), Gear(40, 0.002)
    twin = Gear(40, 0.002 * cos(pi / 9) / cos(radians(25)), radians(25))
    assert isclose(Pair(one, twin, 0.0701).pressure_angle, Pair(one, other, 0.0701).pressure_angle, rel_tol=1e-12)
