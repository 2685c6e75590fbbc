"""Friction of the teeth: coefficients, kinematics in the plane, periodic functions, and what they must not do."""

from dataclasses import replace
from math import cos, exp, isclose, log10, pi, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearstab.gears.friction import (
    BenedictKelley,
    ConstantFriction,
    ContactState,
    XuKahraman,
    contact_state,
    mesh_friction,
    sliding_contact,
    sliding_sign,
)
from gearstab.gears.geometry import Gear
from gearstab.gears.mesh_stiffness import StiffnessModel, contact_stiffness, mesh_stiffness
from gearstab.gears.pair import Pair
from gearstab.gears.stress import load_shares
from gearstab.waveforms import Product

PAIR = Pair(Gear(19, 0.003175, face_width=0.016), Gear(48, 0.003175, face_width=0.016))
RING = Pair(Gear(24, 0.002), Gear(70, 0.002, addendum=0.7, internal=True))
HIGH = Pair(*(Gear(z, 0.002, addendum=1.3, dedendum=1.55) for z in (21, 51)))
MEASURED = StiffnessModel(single_pair_stiffness=2e8)


def test_xu_kahraman_spot() -> None:
    """SR 0.3, 1 GPa, 10 cP, 0.4 um, 10 m/s, 10 mm -> 0.01907, and its formula written out once more."""
    contact = ContactState(*(np.array(v) for v in (3.0, 10.0, 0.01, 1e9, 1e5)))
    assert contact.slide_roll == 0.3
    found = XuKahraman(10.0, 0.4).coefficient(contact)
    assert abs(found - 0.01907) < 1e-5
    f = -8.916465 - 0.354068 * 0.3 * log10(10) + 2.812084 * exp(-0.3 * log10(10)) + 0.620305 * exp(0.4)
    by_hand = exp(f) * 0.3**1.036077 * 10**-0.100601 * 10**0.752755 * 0.01**-0.390958
    assert isclose(found, by_hand, rel_tol=1e-12)
    reverse = replace(contact, sliding=-contact.sliding)
    assert XuKahraman(10.0, 0.4).coefficient(reverse) == found


def test_benedict_kelley_in_the_units_it_was_published_in() -> None:
    """mu = 0.0127 50/(50 - S) log10[3.17e8 W/(nu V_s V_r^2)]: S in microinch rms, W in lb/in, V in in/s, nu in cP."""
    contact = ContactState(*(np.array(v) for v in (2.0, 8.0, 0.01, 1e9, 2e5)))
    found = BenedictKelley(10.0, 0.3).coefficient(contact)
    load = 2e5 / 175.1268  # N/m in a pound an inch
    inch = 39.37008
    microinch = 50 * 0.3 / 1.13  # 50 microinch rms are 1.13 um arithmetic mean
    expected = 0.0127 * 50 / (50 - microinch) * log10(3.17e8 * load / (10.0 * 2 * inch * (16 * inch) ** 2))
    # 29700 is the constant rounded to three digits: 5e-4 in the logarithm.
    assert isclose(found, expected, rel_tol=2e-3)
    assert BenedictKelley(10.0, 0.3).coefficient(replace(contact, load=np.array(1e-6))) == 0
    at_pitch = BenedictKelley(10.0, 0.3).coefficient(replace(contact, sliding=np.array(0.0)))
    assert at_pitch == BenedictKelley(10.0, 0.3).coefficient(replace(contact, sliding=np.array(0.16)))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: ConstantFriction(-0.1), "level must be positive or 0"),
        (lambda: XuKahraman(0.0, 0.4), "viscosity must be positive"),
        (lambda: XuKahraman(10.0, -0.4), "roughness must be positive or 0"),
        (lambda: BenedictKelley(float("nan"), 0.4), "viscosity must be positive"),
        (lambda: BenedictKelley(10.0, 1.2), "below 1.13"),
        (lambda: mesh_friction(PAIR, ConstantFriction(0.1), 0.0, 100.0), "turning pinion"),
        (lambda: mesh_friction(PAIR, ConstantFriction(0.1), 10.0, -1.0), "positive force"),
    ],
)
def test_errors(make, message) -> None:
    with pytest.raises(ValueError, match=message):
        make()


def plane(pair, s, turn):
    """Contact, unit vectors n and t, and the wheel's centre; the pinion at 0 turns counterclockwise, T1 at ``turn``."""
    e = np.array([cos(turn), sin(turn)])
    n = np.array([-e[1], e[0]])
    point = pair.pinion.base_radius * e + s * n
    # T2 lies L along n; the wheel's centre is a base radius from it, on the far side (external) or this one (internal).
    sign = pair.wheel.sign
    centre = pair.pinion.base_radius * e + pair.length * n * sign + sign * pair.wheel.base_radius * e
    return point, n, -e, centre


def velocity(point, centre, speed, drift):
    arm = point - centre
    return speed * np.array([-arm[1], arm[0]]) + drift


@settings(deadline=None, max_examples=80)
@given(
    st.sampled_from([PAIR, RING, Pair(PAIR.pinion, PAIR.wheel, PAIR.centre * 1.003)]),
    st.floats(0, 1),
    st.floats(0, 6.28),
    st.lists(st.floats(-5, 5), min_size=6, max_size=6),
)
def test_directions_are_those_of_rigid_bodies_in_the_plane(pair, at, turn, rates) -> None:
    """h^T q' is the relative velocity along t, g^T q' that along n, for any rotation and displacement of both gears."""
    s = pair.path[0] + at * (pair.path[1] - pair.path[0])
    point, n, t, centre = plane(pair, s, turn)
    assert isclose(np.hypot(*centre), pair.centre, rel_tol=1e-12)
    q = np.array(rates)
    wheel_speed = -pair.wheel.sign * q[1]  # counted against the pinion's sense for an external wheel
    first = velocity(point, np.zeros(2), q[0], q[2:4])
    second = velocity(point, centre, wheel_speed, q[4:6])
    g = np.concatenate([[pair.pinion.base_radius, -pair.wheel.base_radius], n, -n])
    assert isclose((first - second) @ n, g @ q, abs_tol=1e-10)
    friction = mesh_friction(pair, ConstantFriction(0.05), 10.0, 100.0, MEASURED)
    u, v = friction.directions(t)
    assert isclose((first - second) @ t, (u + s * v) @ q, abs_tol=1e-10)


@pytest.mark.parametrize("pair", [PAIR, RING], ids=["external", "internal"])
def test_velocities_and_curvature(pair) -> None:
    speed = 150.0
    s = np.linspace(pair.path[0] + 1e-4, pair.path[1] - 1e-4, 9)
    state = contact_state(pair, s, speed, 1000.0)
    for i, distance in enumerate(s):
        point, _, t, centre = plane(pair, distance, 0.3)
        wheel = -pair.wheel.sign * speed / pair.ratio
        first, second = velocity(point, 0 * point, speed, 0 * point), velocity(point, centre, wheel, 0 * point)
        assert isclose(state.sliding[i], (first - second) @ t, rel_tol=1e-9, abs_tol=1e-12)
        assert isclose(state.entrainment[i], (first + second) @ t / 2, rel_tol=1e-9)
    arms = s, pair.length - pair.wheel.sign * s
    np.testing.assert_allclose(1 / state.radius, 1 / arms[0] + pair.wheel.sign / arms[1], rtol=1e-13)
    for ratio in (-0.3, 0.0, 0.02, 0.5):
        there = contact_state(pair, sliding_contact(pair, ratio), speed, 1.0)
        assert isclose(there.slide_roll, ratio, abs_tol=1e-12)
    assert isclose(sliding_contact(pair, 0.0), pair.pitch_point, rel_tol=1e-12)


MODELS = [ConstantFriction(0.06), XuKahraman(12.0, 0.4), BenedictKelley(12.0, 0.4)]


@pytest.mark.parametrize("friction", MODELS, ids=["constant", "xu-kahraman", "benedict-kelley"])
@pytest.mark.parametrize("pair", [PAIR, HIGH, replace(PAIR, wheel_drives=True)], ids=["plain", "high", "wheel drives"])
def test_periodic_functions_are_the_sums_over_the_pairs(pair, friction) -> None:
    model = StiffnessModel(double_contact_factor=0.8)
    speed, force = 150.0, 2000.0
    found = mesh_friction(pair, friction, speed, force, model)
    x = np.random.default_rng(1).random(500)
    s, k = contact_stiffness(pair, x, model)
    share = load_shares(pair, x, model)[1]
    inside = np.clip(s, *pair.path)
    state = contact_state(pair, inside, speed, np.where(share > 0, force * share, 1.0))
    resisting = sliding_sign(pair, inside) * friction.coefficient(state)
    total = mesh_stiffness(pair, model).curve
    for curve, weight in (
        (Product(total, found.share), k),
        (Product(total, found.share_arm), k * s),
        (found.share, share),
        (found.share_arm, share * s),
    ):
        direct = np.sum(resisting * weight, axis=-1)
        # |SR|^1.036 at the pitch point, an end of a piece, is followed to 1e-4 by the polynomials, all else far closer.
        np.testing.assert_allclose(curve.value(x), direct, atol=2e-4 * np.max(np.abs(direct)))
    edges = np.sort(found.share.breakpoints())
    assert np.min(np.abs(edges - pair.pitch_phase)) < 1e-12
    c = pair.contact_ratio
    assert np.min(np.abs(edges - (c - np.floor(c)))) < 1e-12


@pytest.mark.parametrize("back", [False, True])
@pytest.mark.parametrize("friction", MODELS, ids=["constant", "xu-kahraman", "benedict-kelley"])
def test_contact_clipped_at_the_tangent_points_has_finite_friction(back, friction) -> None:
    """There the pressure is infinite, and so it is for pairs that have just left."""
    pair = Pair(*(Gear(12, 0.003, addendum=1.1) for _ in range(2)), wheel_drives=back)
    assert pair.path == (0.0, pair.length)
    found = mesh_friction(pair, friction, 100.0, 1000.0)
    assert np.all(np.isfinite(found.share_arm.coefficients))


@pytest.mark.parametrize("pair", [PAIR, RING, replace(PAIR, wheel_drives=True)], ids=["external", "internal", "wheel"])
def test_friction_takes_power_from_rolling_teeth(pair) -> None:
    """u + s v times the rotation is the sliding velocity: the power of friction is negative at every phase."""
    friction = mesh_friction(pair, ConstantFriction(0.05), 100.0, 1000.0, MEASURED)
    speed = -100.0 if pair.wheel_drives else 100.0
    q = np.array([speed, speed / pair.ratio, 0, 0, 0, 0])
    u, v = friction.directions(np.array([0.6, 0.8]))
    x = np.linspace(0, 1, 501)
    power = -1000.0 * (friction.share.value(x) * (u @ q) + friction.share_arm.value(x) * (v @ q))
    # 0 at the instant one pair alone passes the pitch point.
    assert np.all(power < 1e-9)
    assert np.mean(power) < -1.0


def test_mean_loss_is_that_of_the_tooth_loss_factor() -> None:
    """P/P_in = mu H_V, H_V = pi (u + 1)/(z1 u) (1 - c + c1^2 + c2^2), Ohlendorf 1958: pairs that share evenly."""
    mu, speed, force = 0.05, 100.0, 1000.0
    friction = mesh_friction(PAIR, ConstantFriction(mu), speed, force)
    u, v = friction.directions(np.array([0.0, 1.0]))
    q = np.array([speed, speed / PAIR.ratio, 0, 0, 0, 0])
    loss = force * (friction.share.mean * (u @ q) + friction.share_arm.mean * (v @ q))
    c1, c2 = (abs(end - PAIR.pitch_point) / PAIR.base_pitch for end in PAIR.path)
    factor = pi * (PAIR.ratio + 1) / (19 * PAIR.ratio) * (1 - c1 - c2 + c1**2 + c2**2)
    # The stiffer inner pair carries more and slides less: 4 % less loss.
    assert 0.93 < loss / (force * PAIR.pinion.base_radius * speed) / (mu * factor) < 1.0


def test_a_rigid_rotation_feels_no_friction() -> None:
    """K(t) r = 0 with friction, on two gears with lateral coordinates, held by mesh and friction alone."""
    from gearstab.mesh import Mesh, PeriodicTerm
    from gearstab.system import GearSystem

    mesh = mesh_stiffness(PAIR)
    friction = mesh_friction(PAIR, XuKahraman(12.0, 0.4), 150.0, 2000.0)
    turn = 0.4
    _, n, t, _ = plane(PAIR, 0.0, turn)
    g = np.concatenate([[PAIR.pinion.base_radius, -PAIR.wheel.base_radius], n, -n])
    u, v = friction.directions(t)
    system = GearSystem(
        mass=np.eye(6),
        stiffness=np.zeros((6, 6)),
        meshes=(Mesh("mesh", g, np.array(mesh.mean), np.array(mesh.epsilon), mesh.waveform),),
        terms=(
            PeriodicTerm("sliding", u, g, stiffness=Product(mesh.curve, friction.share)),
            PeriodicTerm("arm", v, g, stiffness=Product(mesh.curve, friction.share_arm)),
        ),
    )
    rigid = np.array([1 / PAIR.pinion.base_radius, 1 / PAIR.wheel.base_radius, 0, 0, 0, 0])
    for x in (0.05, 0.3, 0.66, 0.9):
        k = system.stiffness_matrix([mesh.mean * (1 + 2 * mesh.epsilon * mesh.waveform.value(x))])
        for term in system.terms:
            k = k + term.stiffness.value(x) * np.outer(term.left, term.right)
        assert np.max(np.abs(k @ rigid)) < 1e-14 * np.max(np.abs(k)) * np.max(np.abs(rigid))
        assert np.max(np.abs(k - k.T)) > 1e-6 * np.max(np.abs(k))
        # What K(t) does is the sum over the pairs of normal force and friction force at their contacts.
        q = np.array([1e-4, -2e-4, 1e-5, 2e-5, -1e-5, 3e-5])
        s, stiffness = contact_stiffness(PAIR, x)
        share = stiffness / stiffness.sum()
        inside = np.clip(s, *PAIR.path)
        state = contact_state(PAIR, inside, 150.0, np.where(share > 0, 2000.0 * share, 1.0))
        coefficient = XuKahraman(12.0, 0.4).coefficient(state) * sliding_sign(PAIR, inside)
        expected = np.zeros(6)
        for distance, pair_k, mu in zip(s, stiffness, coefficient, strict=True):
            h = np.concatenate([[distance, -(PAIR.length - distance)], t, -t])
            expected += pair_k * (g @ q) * (g + mu * h)
        np.testing.assert_allclose(k @ q, expected, rtol=1e-5, atol=1e-5 * np.max(np.abs(expected)))
