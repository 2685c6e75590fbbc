"""Tooth profiles: the fillet against the rack that cuts it, and discs."""

from __future__ import annotations

import json
from math import cos, isclose, pi, sin, sqrt, tan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import DATA

from gearstab.gears.geometry import Gear
from gearstab.gears.profile import tooth_profile
from gearstab.systems.gearbox import bodies

REFERENCE = json.loads((DATA / "gears_reference.json").read_text())

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
