"""Teeth that part: exact motion between events, and events that are where they should be."""

from dataclasses import replace
from fractions import Fraction
from functools import cache
from typing import Any

import mpmath
import numpy as np
import pytest
from driven import ERROR, FORCE, PULSES, SMOOTH, integrated_with_backlash, pair, train, with_waves
from systems import train as shafted

from gearstab.response import driven_response
from gearstab.response.backlash import KINDS, BacklashResponse, backlash_response, follow
from gearstab.response.backlash.dynamics import play, resting
from gearstab.system import GearSystem
from gearstab.systems import build

Array = np.ndarray


def loose(system: GearSystem, *widths: float, zero: str = "middle") -> GearSystem:
    """With backlash."""
    meshes = [replace(m, backlash=w, backlash_zero=zero) for m, w in zip(system.meshes, widths, strict=True)]
    return replace(system, meshes=tuple(meshes))


def follows(**changes: Any) -> GearSystem:
    """The train whose second mesh has a damping that follows its stiffness."""
    meshes = [
        {"name": "first", "mean_stiffness": 1.0, "epsilon": 0.3, "contact_ratio": 1.47, "transmission_error": ERROR},
        {"name": "second", "mean_stiffness": 1.1, "epsilon": 0.3, "contact_ratio": 1.57, "phasing": 0.2,
         "damping": 0.1, "damping_follows_stiffness": True},
    ]  # fmt: skip
    return train(meshes=meshes, **changes)


CASES: dict[str, tuple[GearSystem, float]] = {
    "both meshes": (loose(train(), 0.3, 0.2), 2.6),
    "one mesh": (loose(train(), 0.3, 0.0), 1.3),
    "drive side": (loose(train(), 0.3, 0.2, zero="drive_side"), 0.9),
    "forces": (loose(replace(train(), forces=(FORCE, PULSES)), 0.3, 0.2), 1.7),
    "damping that follows": (loose(follows(), 0.3, 0.2), 1.9),
    "smooth waves": (loose(with_waves(train(), *SMOOTH), 0.3, 0.2), 1.9),
}  # fmt: skip


Q, V = np.array([0.4, -0.2, 0.6]), np.array([0.5, -0.3, 0.1])


@cache
def integrated(name: str) -> tuple[Array, list[tuple[float, int, int]]]:
    """From Q and V, 30 samples in a period of the first mesh, and changes of contact, both up to the time 14."""
    system, omega = CASES[name]
    teeth = play(system)
    times = np.arange(0.0, 14.0, 2 * np.pi / omega / 30)
    limits = np.stack([teeth.low, teeth.high], axis=1)
    return integrated_with_backlash(system, limits, omega, np.concatenate([Q, V]), times)


@pytest.mark.parametrize("name", CASES)
def test_histories_against_numerical_integration(name: str) -> None:
    """DOP853 with rtol 1e-12 restarted at all events, which keeps some 1e-11 over a dozen impacts."""
    system, omega = CASES[name]
    found = backlash_response(system, omega, 14.0, (Q, V), 30)
    expected, changes = integrated(name)
    assert len(changes) >= 4
    assert [event.mesh for event in found.events] == [mesh for _, mesh, _ in changes]
    np.testing.assert_allclose([event.time for event in found.events], [t for t, _, _ in changes], atol=1e-10)
    np.testing.assert_allclose(found.displacement, expected[:, :3], atol=1e-10)
    np.testing.assert_allclose(found.velocity, expected[:, 3:], atol=1e-10)


@pytest.mark.parametrize("name", ["drive side", "smooth waves"])
def test_the_motion_does_not_depend_on_the_samples(name: str) -> None:
    system, omega = CASES[name]
    start = np.array([0.4, -0.2, 0.6]), np.zeros(3)
    coarse, fine = (backlash_response(system, omega, 30.0, start, samples) for samples in (7, 70))
    # Only the times of the samples are rounded differently.
    np.testing.assert_allclose(coarse.displacement, fine.displacement[::10], atol=1e-13)
    assert coarse.events == fine.events
    assert coarse.cycle is not None
    assert fine.cycle is not None
    np.testing.assert_array_equal(coarse.cycle.rms, fine.cycle.rms)


def test_free_flight_is_a_straight_line_between_impacts() -> None:
    """Without load: half a vibration pi/w on each flank, 2 b/v between them."""
    speed, width, w = 1.3, 0.7, 2.0
    found = backlash_response(loose(pair(), width), 3.0, 20.0, (np.zeros(1), np.array([speed])), 50)
    first, flight, contact = 0.5 * width / speed, width / speed, np.pi / w
    expected = [first]
    while expected[-1] < 20.0:
        expected += [expected[-1] + contact, expected[-1] + contact + flight]
    times = [event.time for event in found.events]
    np.testing.assert_allclose(times, [t for t in expected if t <= found.time[-1]], rtol=1e-13)
    kinds = [KINDS[event.kind] for event in found.events]
    assert kinds[:4] == ["drive_side_contact", "separation", "coast_side_contact", "separation"]
    np.testing.assert_allclose(np.abs([event.speed for event in found.events]), speed, rtol=1e-12)
    apart = found.contact[:, 0] == 0
    np.testing.assert_allclose(np.abs(found.mesh_velocity[apart, 0]), speed, rtol=1e-12)
    assert not found.mesh_force[apart].any()
    # x = b + (v/w) sin w t on the upper flank.
    np.testing.assert_allclose(np.ptp(found.displacement), width + 2 * speed / w, rtol=1e-3)
    assert found.cycle is not None
    np.testing.assert_allclose(found.cycle.force_peak, 4.0 * speed / w, rtol=1e-6)


def test_thrown_up_against_the_load_the_teeth_come_down_again() -> None:
    """A parabola: with f/m = a the tooth that leaves its flank with speed v is back after 2 v/a, with speed v."""
    load, rise = 0.6, 0.5
    system = loose(pair(load=[load]), 10.0)
    at_rest = 5.0 + load / 4.0
    found = backlash_response(system, 3.0, 6.0, (np.array([at_rest + rise]), np.zeros(1)), 50)
    leaves, lands = found.events[:2]
    assert [KINDS[e.kind] for e in (leaves, lands)] == ["separation", "drive_side_contact"]
    # x - at_rest = rise cos 2 t down to -load/4.
    np.testing.assert_allclose(leaves.time, np.arccos(-load / 4.0 / rise) / 2, rtol=1e-13)
    speed = 2.0 * np.sqrt(rise**2 - (load / 4.0) ** 2)
    np.testing.assert_allclose([leaves.speed, lands.speed], [-speed, speed], rtol=1e-13)
    np.testing.assert_allclose(lands.time - leaves.time, 2 * speed / load, rtol=1e-13)
    inside = (found.time > leaves.time) & (found.time < lands.time)
    t = found.time[inside] - leaves.time
    np.testing.assert_allclose(found.displacement[inside, 0], 5.0 - speed * t + 0.5 * load * t**2, rtol=1e-13)


def potential(system: GearSystem, found: BacklashResponse) -> Array:
    """Energy, that of the load included."""
    return found.energy - found.displacement @ system.load


def test_impacts_without_damping_keep_the_energy() -> None:
    """Through more than a thousand of them."""
    system = loose(train(epsilon=0.0, damping_ratio=0.0), 0.3, 0.2)
    meshes = tuple(replace(mesh, transmission_error=None, damping=0.0) for mesh in system.meshes)
    system = replace(system, meshes=meshes, damping=None)
    found = backlash_response(system, 2.0, 2600.0, (np.array([0.4, -0.2, 0.6]), np.zeros(3)), 5)
    assert len(found.events) > 1000
    energy = potential(system, found)
    assert np.ptp(energy) < 1e-10 * np.abs(energy[0])


def test_damping_only_takes_energy() -> None:
    system = loose(train(epsilon=0.0), 0.3, 0.2)
    meshes = tuple(replace(mesh, transmission_error=None) for mesh in system.meshes)
    system = replace(system, meshes=meshes)
    found = backlash_response(system, 2.0, 60.0, (np.array([0.4, -0.2, 0.6]), np.zeros(3)), 50)
    energy = potential(system, found)
    assert np.diff(energy).max() < 1e-13
    np.testing.assert_allclose(found.displacement[-1], resting(system, play(system)), atol=0.05)


def test_a_free_train_turns_as_the_torques_say() -> None:
    """Forces between the teeth do not act on it as a whole: r^T M q'' = r^T f for the rigid-body motion r."""
    system = loose(train(input_shaft_stiffness=0.0, damping_ratio=0.0), 0.3, 0.2)
    meshes = tuple(replace(mesh, damping=0.0) for mesh in system.meshes)
    system = replace(system, meshes=meshes, damping=None)
    turning = np.array([1.0, -1.0, 1.0])
    q, v = np.array([0.4, -0.2, 0.6]), np.array([0.5, -0.3, 0.1])
    found = backlash_response(system, 2.6, 60.0, (q, v), 20)
    assert len(found.events) > 10
    assert "unbalanced" in found.findings
    along = turning @ system.mass
    t, force = found.time, turning @ system.load
    expected = along @ q + (along @ v) * t + 0.5 * force * t**2
    np.testing.assert_allclose(found.displacement @ along, expected, rtol=1e-11)


def test_a_free_train_settles_however_it_turns() -> None:
    """Its rigid-body motion is no part of the sections that are compared."""
    system = loose(train(input_shaft_stiffness=0.0), 0.3, 0.2)
    system = replace(system, load=np.array([2.0, 0.0, 2.5]))
    found = backlash_response(system, 2.6, 300.0, None, 4)
    assert np.abs(found.velocity[-1]).max() > 5.0
    assert found.cycle is not None
    assert found.cycle.period == 1


def test_less_than_a_common_period_is_summed_up_as_it_is() -> None:
    """Over what follows the time that is left out, by the samples of a finer history."""
    system = loose(train(Fraction(16, 17)), 0.3, 0.2)
    q, v = np.array([0.4, -0.2, 0.6]), np.zeros(3)
    found = backlash_response(system, 2.6, 20.0, (q, v), 4000, 8.0)
    assert found.common_period > 20.0
    cycle = found.cycle
    assert cycle is not None
    assert cycle.period == 0
    assert cycle.begin == pytest.approx(8.0, abs=0.5)
    part = (found.time >= cycle.begin) & (found.time <= cycle.end)
    x = found.mesh_deflection[part]
    # Sums over samples 6e-4 apart.
    np.testing.assert_allclose(cycle.peak_to_peak, np.ptp(x, axis=0), rtol=1e-5)
    np.testing.assert_allclose(cycle.rms, x.std(axis=0), rtol=1e-3)
    np.testing.assert_allclose(cycle.force_peak, np.abs(found.mesh_force[part]).max(axis=0), rtol=1e-3)
    np.testing.assert_allclose(cycle.contact_loss, (found.contact[part] == 0).mean(axis=0), atol=2e-3)


@pytest.mark.parametrize("name", ["both meshes", "smooth waves", "damping that follows", "forces"])
def test_under_a_large_load_nothing_changes(name: str) -> None:
    """With zero on the drive side the motion is that of the linear system, as long as contact is kept."""
    system, omega = CASES[name]
    system = replace(loose(system, 0.3, 0.2, zero="drive_side"), load=np.array([3.0, 0.0, 8.0]))
    q, v = resting(system, play(system)), np.array([0.05, -0.03, 0.1])
    found = backlash_response(system, omega, 20.0, (q, v), 30)
    expected = driven_response(system, omega, q, v, 20.0, 30)
    assert not found.events
    assert "separation" not in found.findings
    # Both follow the smooth waves to some 1e-10.
    np.testing.assert_allclose(found.displacement, expected.displacement, rtol=1e-10)
    np.testing.assert_allclose(found.mesh_force, expected.mesh_force, rtol=1e-9)
    np.testing.assert_allclose(found.energy, expected.energy, rtol=1e-9)


def test_in_the_middle_the_motion_is_shifted_by_half_the_backlash() -> None:
    system = pair(load=[3.0], mesh={"epsilon": 0.3, "damping": 0.2})
    start = np.array([0.8]), np.array([0.1])
    middle, side = loose(system, 0.4), loose(system, 0.4, zero="drive_side")
    found = backlash_response(middle, 3.0, 20.0, (start[0] + 0.2, start[1]), 30)
    np.testing.assert_allclose(found.displacement, backlash_response(side, 3.0, 20.0, start, 30).displacement + 0.2)
    assert not found.events


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_flank_that_carries_the_load_is_the_drive_side(sign: float) -> None:
    system = loose(pair(load=[2.0 * sign]), 0.4, zero="drive_side")
    teeth = play(system)
    np.testing.assert_allclose(sorted([teeth.low[0], teeth.high[0]]), [-0.4, 0] if sign > 0 else [0, 0.4])
    np.testing.assert_allclose(resting(system, teeth), [0.5 * sign])
    np.testing.assert_allclose(resting(loose(system, 0.4), play(loose(system, 0.4))), [0.7 * sign])
    found = backlash_response(system, 3.0, 5.0, (np.array([0.0]), np.array([-3.0 * sign])), 50)
    assert KINDS[found.events[0].kind] == ("separation" if found.contact[0] else "coast_side_contact")


@pytest.mark.parametrize("shaft", [1e-6, 0.5, 5e7, 5e9])
@pytest.mark.parametrize("load", [[0.3, 0.0, 1.0], [-2.0, 0.7, 0.2], [900.0, -1.0, 40.0]])
def test_the_equilibrium_is_right_beside_any_stiffness(shaft: float, load: list[float]) -> None:
    """K q = f in 50 digits, with the contacts that the solution has; some rounding errors of each entry are left."""
    system = replace(loose(shafted(shaft=shaft), 0.01, 5.0), load=np.array(load))
    teeth = play(system)
    found = resting(system, teeth)
    directions = np.stack([mesh.direction for mesh in system.meshes])
    contact = teeth.contact(directions @ found)
    with mpmath.workdps(50):
        matrix, force = mpmath.matrix(system.stiffness.tolist()), mpmath.matrix(load)
        for mesh, closed, offset in zip(system.meshes, contact != 0, teeth.offset(contact), strict=True):
            if closed:
                g, k = mpmath.matrix(mesh.direction.tolist()), mpmath.mpf(float(mesh.mean_stiffness))
                matrix, force = matrix + k * g * g.T, force + k * float(offset) * g
        exact = mpmath.lu_solve(matrix, force)
        deflections = mpmath.matrix(directions.tolist()) * exact
    np.testing.assert_array_equal(teeth.contact(np.array([float(x) for x in deflections])), contact)
    np.testing.assert_allclose(found, [float(q) for q in exact], rtol=1e-13)


@pytest.mark.parametrize("load", [[0.4, 0.0, 0.0], [0.0, -0.7, 0.0], [-0.8, 0.0, 0.0], [0.9, 0.1, 0.0]])
@pytest.mark.parametrize("widths", [(0.3, 0.3), (0.0, 0.01), (5.0, 0.3)])
def test_rounding_does_not_choose_the_flank_of_a_mesh_without_load(load: list[float], widths: list[float]) -> None:
    """Stiffnesses in their last digits, which move the equilibrium by no more; nor is there a drive side then."""
    found = []
    for first, second in ((0, 0), (1, -2), (-3, 1), (2, 5), (-1, -4)):
        system = replace(loose(shafted(), *widths), load=np.array(load))
        meshes = [replace(m, mean_stiffness=1 + 2e-16 * k) for m, k in zip(system.meshes, (first, second), strict=True)]
        system = replace(system, meshes=tuple(meshes))
        found.append(resting(system, play(system)))
        np.testing.assert_allclose(found[-1], found[0], rtol=0, atol=1e-13)
        with pytest.raises(ValueError, match="second carries no load" if widths[0] == 0 else "carries no load"):
            play(loose(system, *widths, zero="drive_side"))


def test_at_rest_the_train_stays_at_rest() -> None:
    system = loose(train(epsilon=0.0), 0.3, 0.2)
    system = replace(system, meshes=tuple(replace(mesh, transmission_error=None) for mesh in system.meshes))
    found = backlash_response(system, 2.0, 30.0, None, 10)
    assert not found.events
    assert np.ptp(found.displacement, axis=0).max() < 1e-13
    np.testing.assert_allclose(found.mesh_force[0] @ [[1, 1, 0], [0, 1, 1]] + found.displacement[0] * [0.5, 0, 0],
                               system.load, atol=1e-13)  # fmt: skip


def test_a_touch_is_said_to_be_one() -> None:
    """Released twice the static deflection above the flank, an undamped pair just comes down to it."""
    system = loose(pair(load=[2.0]), 0.4)

    def released(above: float) -> BacklashResponse:
        return backlash_response(system, 3.0, 20.0, (np.array([0.2 + above]), np.zeros(1)), 20)

    touch, clear, dip = released(1.0), released(0.9), released(1.0 + 1e-9)
    assert "grazing" in touch.findings
    assert not touch.events
    assert "grazing" not in clear.findings
    # A dip of 1e-9 is found: below the flank the acceleration is the load, depth = v^2/(2 a), time = 2 v/a.
    assert "grazing" in dip.findings
    assert [KINDS[event.kind] for event in dip.events[:2]] == ["separation", "drive_side_contact"]
    np.testing.assert_allclose(dip.events[1].time - dip.events[0].time, 2 * np.sqrt(2 * 1e-9 / 2.0), rtol=1e-3)


def test_too_many_events_end_a_history(monkeypatch: pytest.MonkeyPatch) -> None:
    # Ten events for every vibration of the fastest mode, 2 rad/s, in a period are allowed as well.
    monkeypatch.setattr(follow, "BUSY", 3 - 10 * 2.0 / 0.01)
    found = backlash_response(loose(pair(), 0.01), 0.01, 2000.0, (np.zeros(1), np.ones(1)), 2000)
    assert found.status == "chatter"
    assert 0 < found.time[-1] < 20.0
    assert np.isfinite(found.displacement).all()


def test_growth_beyond_doubles_ends_a_history() -> None:
    system = loose(pair(damping={"matrix": [[-20.0]]}), 0.4)
    found = backlash_response(system, 3.0, 200.0, (np.zeros(1), np.ones(1)), 20)
    assert found.status == "overflow"
    assert np.isfinite(found.energy).all()
    assert found.time[-1] < 200.0


def test_what_cannot_be_done_is_said() -> None:
    system = loose(pair(), 0.4)
    with pytest.raises(ValueError, match=r"give respond\.initial"):
        backlash_response(replace(loose(train(), 0.3, 0.2), load=np.array([0.0, 0.0, np.nan])), 1.0, 5.0)
    with pytest.raises(ValueError, match="positive"):
        backlash_response(system, -1.0, 5.0, (np.zeros(1), np.ones(1)))
    with pytest.raises(ValueError, match="numbers are needed"):
        backlash_response(system, 1.0, 5.0, (np.zeros(2), np.ones(1)))


@pytest.mark.parametrize("kind", ["planetary", "matrices"])
def test_other_kinds_of_systems(kind: str) -> None:
    if kind == "planetary":
        mesh = {"mean_stiffness": 1.0, "epsilon": 0.2, "contact_ratio": 1.5, "backlash": 0.5, "damping": 0.05}
        system = build({
            "kind": kind, "planets": 3, "ring": {"kind": "rigid"}, "motion": "rotational",
            "masses": {"ring": 1.0, "planet": 0.7},
            "inertias": {"ring": 2.0, "carrier": 3.0, "sun": 1.0, "planet": 0.6},
            "supports": {"carrier": 0.0, "sun": 0.0, "ring_tangential": 10.0, "ring_radial": 10.0,
                         "carrier_rotation": 0.0, "sun_rotation": 0.0},
            "pressure_angles": {"sun": 0.4, "ring": 0.4}, "meshes": {"sun": mesh, "ring": mesh},
            "phases": {"sun": [0, 0.3, 0.6], "sun_ring": 0.2}, "scaling": "SI", "load": {"sun": 0.3, "carrier": -0.55},
        })  # fmt: skip
    else:
        mesh = {"mean_stiffness": 1.0, "epsilon": 0.2, "contact_ratio": 1.5}
        system = build({
            "kind": kind, "mass": [[1.0, 0.0], [0.0, 2.0]], "stiffness": [[0.5, 0.0], [0.0, 0.2]], "load": [0.4, -0.1],
            "meshes": [mesh | {"name": "a", "direction": [1, -1], "backlash": 0.3, "frequency_ratio": Fraction(1)},
                       mesh | {"name": "b", "direction": [0.2, 1], "frequency_ratio": Fraction(3, 2)}],
        })  # fmt: skip
    start = np.concatenate([resting(system, play(system)), 0.8 * np.cos(np.arange(system.size))])
    n = system.size
    found = backlash_response(system, 1.3, 12.0, (start[:n], start[n:]), 20)
    teeth = play(system)
    expected, changes = integrated_with_backlash(
        system, np.stack([teeth.low, teeth.high], axis=1), 1.3, start, found.time
    )
    assert len(changes) >= 3
    np.testing.assert_allclose(found.displacement, expected[:, :n], atol=1e-8)
