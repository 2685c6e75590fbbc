"""Friction between the teeth of a train: forces by hand, energy that only gets lost, torques that cancel."""

from __future__ import annotations

from math import cos, pi, radians
from typing import Any

import numpy as np
import pytest
from gearbox_trains import RPM, gear, mesh, tractor, train

from gearstab.gears.friction import MeshFriction, XuKahraman, contact_state, mesh_friction
from gearstab.gears.geometry import Gear
from gearstab.gears.pair import Pair
from gearstab.modal import static_equilibrium, static_mesh_force
from gearstab.response import driven_response
from gearstab.system import GearSystem
from gearstab.systems import build, section
from gearstab.systems.gearbox.train import Train

ALPHA = radians(20)
MU = 0.07
X = np.linspace(0.003, 0.997, 143)
RING = gear("ring", 60, internal=True, inertia=0.1, mass=1.0)


def rubbing_pair(kind: str, sense: str, **more: Any) -> dict[str, Any]:
    """Two gears with constant friction; the stiffness of the mesh follows from the teeth or a measured one."""
    rotors = {
        "external": [gear("a", 20), gear("b", 41)],
        "driven": [gear("a", 20), RING],
        "driver": [RING, gear("a", 20)],
    }
    pair = rotors[kind]
    names = [rotor["name"] for rotor in pair]
    link = {"name": "m", "gears": names, "friction": {"kind": "constant", "coefficient": MU}} | more
    if kind != "external":
        link["single_pair_stiffness"] = 2e8
    outputs = [{"rotor": names[1], "torque": 40.0}]
    return train(pair, [link], input={"rotor": names[0], "sense": sense, "speed": 150 * RPM}, outputs=outputs)


def frictional_force(system: GearSystem, x: np.ndarray, deflection: float = 1e-6) -> np.ndarray:
    """``(points, n)``, what friction adds to the left side at the phases x, g^T q being the deflection."""
    total = np.zeros((len(x), system.size))
    for term in system.terms:
        assert term.stiffness is not None
        total += term.stiffness.value(x)[:, None] * term.left * deflection
    return total


def moment(arm: np.ndarray, force: np.ndarray) -> float:
    return float(arm[0] * force[1] - arm[1] * force[0])


CASES = [(kind, sense) for kind in ("external", "driven", "driver") for sense in ("counter-clockwise", "clockwise")]


@pytest.mark.parametrize(("kind", "sense"), CASES)
def test_friction_takes_power_and_balances(kind: str, sense: str) -> None:
    p = rubbing_pair(kind, sense)
    system, speeds = build(p), Train(section(p)).speeds
    turning = np.array([*(abs(float(v)) for v in speeds.values()), 0, 0, 0, 0])
    force = frictional_force(system, X)
    power = force @ turning
    assert np.all(power > 0)
    # By hand: mu F |v|, the sliding velocity being the distance from the pitch point times the relative speed.
    wheel = Gear(60, 2e-3, face_width=0.02, internal=True) if kind != "external" else Gear(41, 2e-3, face_width=0.02)
    pair = Pair(Gear(20, 2e-3, face_width=0.02), wheel, wheel_drives=kind == "driver")
    s, touching = pair.contacts(X)
    level = system.meshes[0].mean_stiffness + 2 * system.meshes[0].amplitude * system.meshes[0].waveform.value(X)
    relative = abs(turning[0] + (turning[1] if kind == "external" else -turning[1]))
    if kind != "external":
        # Pairs of equal stiffness share the load equally.
        share = touching / touching.sum(axis=-1, keepdims=True)
        expected = MU * level * 1e-6 * relative * np.sum(share * np.abs(s - pair.pitch_point), axis=-1)
        np.testing.assert_allclose(power, expected, rtol=1e-9)
    # The forces on both bodies are opposite, perpendicular to the line of action and mu times the shares of the load.
    np.testing.assert_allclose(force[:, 2:4], -force[:, 4:6], atol=1e-12)
    across = force[:, 2:4] @ system.meshes[0].direction[2:4]
    np.testing.assert_allclose(across, 0.0, atol=1e-12)
    assert np.all(np.hypot(*force[:, 2:4].T) <= MU * level * 1e-6 * (1 + 1e-12))


@pytest.mark.parametrize(("kind", "sense"), CASES)
def test_friction_by_hand_at_a_point_of_single_contact(kind: str, sense: str) -> None:
    """Positions, velocities and torques in the plane, without base circles: psi = 0, the driver's centre at 0."""
    p = rubbing_pair(kind, sense)
    system, train_ = build(p), Train(section(p))
    turn = 1 if sense == "counter-clockwise" else -1
    radii = [2e-3 * rotor["teeth"] / 2 for rotor in p["rotors"]]
    centre = np.array([radii[0] + radii[1] if kind == "external" else abs(radii[0] - radii[1]), 0.0])
    # The centre of a driven ring is to the right of its pinion's: the teeth in mesh are to the left.
    pitch = np.array([-radii[0] if kind == "driven" else radii[0], 0.0])
    spins = [turn * float(v) for v in train_.speeds.values()]
    push = -system.meshes[0].direction[4:6]
    wheel = Gear(60, 2e-3, face_width=0.02, internal=True) if kind != "external" else Gear(41, 2e-3, face_width=0.02)
    pair = Pair(Gear(20, 2e-3, face_width=0.02), wheel, wheel_drives=kind == "driver")
    for x in X:
        s, touching = pair.contacts(np.array(x))
        if touching.sum() != 1:
            continue
        # The contact moves along the push of the driver: before the pitch point it lies behind it.
        travelled = (s[touching][0] - pair.pitch_point) * (-1 if kind == "driver" else 1)
        contact = pitch + travelled * push
        velocity = [
            w * np.array([-(contact - c)[1], (contact - c)[0]])
            for w, c in zip(spins, (np.zeros(2), centre), strict=True)
        ]
        slide = velocity[0] - velocity[1]
        if np.hypot(*slide) < 1e-9:
            continue
        level = float(
            system.meshes[0].mean_stiffness
            + 2 * system.meshes[0].amplitude * system.meshes[0].waveform.value(np.array(x))
        )
        on_driver = -MU * level * 1e-6 * slide / np.hypot(*slide)
        torque = [moment(contact - c, f) for c, f in ((np.zeros(2), on_driver), (centre, -on_driver))]
        # Coordinates count each rotor's own sense as positive; the left side has forces with the opposite sign.
        expected = -np.array([np.sign(spins[0]) * torque[0], np.sign(spins[1]) * torque[1], *on_driver, *-on_driver])
        found = frictional_force(system, np.array([x]))[0]
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


def test_its_terms_follow_the_stiffness_and_the_damping_of_the_mesh() -> None:
    p = rubbing_pair("external", "clockwise", damping_ratio=0.05, damping_follows_stiffness=True, lag=0.3)
    system = build(p)
    (drag, *terms) = system.terms
    assert drag.stiffness is None
    item = system.meshes[0]
    for term in terms:
        assert term.stiffness is not None
        assert term.damping is not None
        assert (float(term.lag), term.frequency_ratio) == (0.3, item.frequency_ratio)
        # c/k is the same for the force of the springs and of the dampers, so that it is in friction too.
        assert drag.damping is not None
        ratio = drag.damping.value(X) / (item.mean_stiffness + 2 * item.amplitude * item.waveform.value(X))
        np.testing.assert_allclose(term.damping.value(X), term.stiffness.value(X) * ratio, rtol=1e-12)
    plain = build(rubbing_pair("external", "clockwise", damping=800.0))
    for term in plain.terms:
        assert term.stiffness is not None
        assert term.damping is not None
        level = plain.meshes[0].mean_stiffness + 2 * plain.meshes[0].amplitude * plain.meshes[0].waveform.value(X)
        np.testing.assert_allclose(term.damping.value(X), 800 * term.stiffness.value(X) / level, rtol=1e-12)


def test_lubricated_friction_has_the_speed_and_load_of_each_mesh() -> None:
    p = tractor()
    for link in p["meshes"]:
        link["friction"] = {"kind": "xu_kahraman", "viscosity": 2e-2, "roughness": 0.5e-6}
    system = build(p)
    forces = static_mesh_force(system)
    for k, ((z1, z2), shifts) in enumerate(zip(((14, 34), (14, 40)), ((0.19, -0.19), (0.19, -0.19)), strict=True)):
        width, bores = (0.015, 0.020)[k], ((0.0, 12.5e-3), (0.0, 15e-3))[k]
        gears = [
            Gear(z, 3e-3, face_width=width, profile_shift=x, bore_radius=b)
            for z, x, b in zip((z1, z2), shifts, bores, strict=True)
        ]
        speed = 1500 * RPM * (1 if k == 0 else 14 / 34)
        expected: MeshFriction = mesh_friction(Pair(*gears), XuKahraman(20.0, 0.5), speed, float(forces[k]))
        term = system.terms[2 * k]
        assert term.stiffness is not None
        level = system.meshes[k].mean_stiffness + 2 * system.meshes[k].amplitude * system.meshes[k].waveform.value(X)
        np.testing.assert_allclose(term.stiffness.value(X), level * expected.share.value(X), rtol=1e-9)
        state = contact_state(Pair(*gears), Pair(*gears).path[0], speed, float(forces[k]))
        assert np.sign(state.sliding) == -1


def test_statics_of_a_pair_with_friction() -> None:
    """The driver held: mesh force and friction together turn the driven gear, and its bearing holds both."""
    system = build(rubbing_pair("external", "counter-clockwise"))
    item = system.meshes[0]
    pair = Pair(Gear(20, 2e-3, face_width=0.02), Gear(41, 2e-3, face_width=0.02))
    for x in X:
        s, touching = pair.contacts(np.array(x))
        if touching.sum() != 1:
            continue
        level = item.mean_stiffness + 2 * item.amplitude * item.waveform.value(np.array(x))
        matrix = system.stiffness + level * item.outer
        for term in system.terms:
            assert term.stiffness is not None
            matrix = matrix + term.stiffness.value(np.array(x)) * np.outer(term.left, term.right)
        q = np.zeros(6)
        assert system.load is not None
        q[1:] = np.linalg.solve(matrix[1:, 1:], system.load[1:])
        force, arm = level * (item.direction @ q), pair.length - s[touching][0]
        sigma = np.sign(s[touching][0] - pair.pitch_point)
        # Past the pitch point the pinion slides outwards over the wheel's flank and drags it along.
        assert pytest.approx(force * (2e-3 * 41 / 2 * cos(ALPHA) + sigma * MU * arm), rel=1e-9) == 40
        lateral = 2e8 * q[4:6]
        assert np.hypot(*lateral) == pytest.approx(force * np.sqrt(1 + MU**2), rel=1e-9)
        # 20 degrees off the tangent, turned by the angle of friction.
        expected = pi / 2 - ALPHA + sigma * np.arctan(MU)
        assert np.arctan2(lateral[1], lateral[0]) == pytest.approx(expected, abs=1e-9)


def test_friction_and_transmission_error_act_on_the_same_mesh_force() -> None:
    """A constant part of the error is nothing but another zero of the deflection."""
    p = rubbing_pair("external", "clockwise")
    p["meshes"][0]["transmission_error"] = {"cos": [2e-6], "sin": [0.0]}
    system = build(p)
    item = system.meshes[0]
    assert item.transmission_error is not None
    assert len(system.forces) == 2
    for term, force in zip(system.terms, system.forces, strict=True):
        assert term.stiffness is not None
        np.testing.assert_array_equal(force.direction, term.left)
        np.testing.assert_allclose(
            force.profile.value(X), term.stiffness.value(X) * 2e-6 * np.cos(2 * pi * X), rtol=1e-12, atol=1e-9
        )


def test_a_history_with_friction_loses_the_energy_that_friction_takes() -> None:
    """Without damping and load, from the static deflection of a load: d(energy)/dt = - power of friction."""
    p = rubbing_pair("external", "counter-clockwise", mean_stiffness=3e8, epsilon=0.0)
    system = build(p)
    start = static_equilibrium(system)
    omega = 2e4
    found = driven_response(system, omega, start, np.zeros(system.size), 2 * np.pi / omega, 2000)
    x = found.time * omega / (2 * pi)
    friction = np.zeros_like(found.displacement)
    for term in system.terms:
        assert term.stiffness is not None
        friction += (term.stiffness.value(x) * (found.displacement @ term.right))[:, None] * term.left
    power = np.sum((system.load - friction) * found.velocity, axis=1)
    work = np.concatenate([[0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(found.time))])
    # The trapezoidal rule over three jumps of friction at 2000 samples.
    scale = np.abs(np.cumsum(np.abs(power[:-1]) * np.diff(found.time)))[-1]
    np.testing.assert_allclose(found.energy - found.energy[0], work, atol=0.01 * scale)
    assert scale > 0


def test_meshes_without_friction_add_no_terms() -> None:
    p = train([gear("a", 20), gear("b", 41)], [mesh("m", "a", "b")])
    assert build(p).terms == ()
