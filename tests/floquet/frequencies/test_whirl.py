"""Motions followed over the speed of rotation: closed forms of rotors, crossings, veering, divergence, equal exponents.

tests/data/rotation/rotors.json: an overhung disc (Stodola), closed forms in forty digits (mpmath).
"""

import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from scenes import scene_data

import gearstab as gs
from gearstab.config import ConfigError
from gearstab.floquet.general.mean import whirl_motions
from gearstab.mesh import Mesh, Rotation
from gearstab.system import GearSystem
from gearstab.waveforms import Rectangular

Array = np.ndarray
ROTORS = json.loads((Path(__file__).parents[2] / "data" / "rotation" / "rotors.json").read_text())


def system(mass: Array, stiffness: Array, damping: Array | None = None, **rotation: Array) -> GearSystem:
    """A rotor that turns once a mesh cycle, with a mesh of no weight."""
    n = len(mass)
    mesh = Mesh("mesh", np.ones(n), np.asarray(1e-12), np.asarray(0.0), Rectangular(1.5))
    return GearSystem(mass, stiffness, (mesh,), damping, rotations=(Rotation(Fraction(1), **rotation),))


def stodola(sense: float = 1.0) -> GearSystem:
    own, given = ROTORS["stodola"], ROTORS["stodola"]["inputs"]
    plane = np.array([[own["k11_N_m"], own["k12_N"]], [own["k12_N"], own["k22_N_m_rad"]]])
    gyroscopic = np.zeros((4, 4))
    gyroscopic[1, 3], gyroscopic[3, 1] = sense * given["Ip"], -sense * given["Ip"]
    mass = np.diag([given["m"], given["Id"], given["m"], given["Id"]])
    return system(mass, np.kron(np.eye(2), plane), gyroscopic=gyroscopic)


def test_overhung_disc() -> None:
    rows = [row for row in ROTORS["stodola"]["rows"] if row["speed_rad_s"] > 0]
    found = whirl_motions(stodola(), np.array([row["speed_rad_s"] for row in rows]))
    for k, row in enumerate(rows):
        own = found.whirl[k] * found.natural_frequency[k]
        np.testing.assert_allclose(np.sort(own), row["whirl_rad_s"], rtol=1e-9)
    # Each motion keeps its sense, although forward ones rise and backward ones fall past others.
    assert (found.whirl == found.whirl[0]).all()
    slope = np.diff(found.natural_frequency, axis=0)
    np.testing.assert_array_equal(np.sign(slope), found.whirl[1:])
    np.testing.assert_allclose(found.damping_ratio, 0.0, atol=1e-12)


def test_critical_speeds() -> None:
    """Where a natural frequency is the speed: one forward for a disc, two backward."""
    speeds = np.linspace(5.0, 1500.0, 600)
    found = whirl_motions(stodola(), speeds)
    for sense, key in ((1, "forward_critical_speeds_rad_s"), (-1, "backward_critical_speeds_rad_s")):
        expected, critical = ROTORS["stodola"][key], []
        for mode in np.flatnonzero(found.whirl[0] == sense):
            gap = found.natural_frequency[:, mode] - speeds
            for k in np.flatnonzero(gap[:-1] * gap[1:] < 0):
                critical.append(speeds[k] + (speeds[k + 1] - speeds[k]) * gap[k] / (gap[k] - gap[k + 1]))
        # Linear between speeds 2.5 rad/s apart.
        np.testing.assert_allclose(np.sort(critical), expected, rtol=1e-5)


def test_forward_is_in_the_sense_of_the_rotation() -> None:
    speeds = np.array([100.0, 300.0])
    turning = stodola()
    other = replace(turning, rotations=(replace(turning.rotations[0], speed_ratio=Fraction(-1)),))
    found, expected = whirl_motions(other, speeds), whirl_motions(turning, speeds)
    np.testing.assert_allclose(found.natural_frequency, expected.natural_frequency, rtol=1e-12)
    np.testing.assert_array_equal(found.whirl, expected.whirl)


def tilting_beside(spring: float) -> GearSystem:
    """A disc that tilts, whose backward motion falls past the natural frequency of a mass on a spring."""
    own = ROTORS["tilting"]["inputs"]
    gyroscopic = np.zeros((3, 3))
    gyroscopic[0, 1], gyroscopic[1, 0] = own["Ip"], -own["Ip"]
    stiffness = np.diag([own["k"], own["k"], 500.0**2])
    stiffness[0, 2] = stiffness[2, 0] = spring
    return system(np.diag([own["Id"], own["Id"], 1.0]), stiffness, gyroscopic=gyroscopic)


def test_motions_cross_and_veer() -> None:
    speeds = np.linspace(100.0, 500.0, 41)
    crossing, veering = (whirl_motions(tilting_beside(spring), speeds) for spring in (0.0, 3e3))
    # The mass keeps its frequency, the backward motion falls through it.
    steady = np.argmin(np.ptp(crossing.natural_frequency, axis=0))
    np.testing.assert_allclose(crossing.natural_frequency[:, steady], 500.0, rtol=1e-12)
    assert not crossing.veering.any()
    # With a spring between them both turn away from each other, and have each other's shape in the end.
    near = np.flatnonzero(veering.veering.any(axis=1))
    assert len(near) == 1
    pair = np.flatnonzero(veering.veering[near[0]])
    assert len(pair) == 2
    gap = np.diff(veering.natural_frequency[:, pair], axis=1)
    assert (gap > 0).all() or (gap < 0).all()
    assert np.argmin(np.abs(gap)) == near[0]


def test_a_motion_that_diverges_rests() -> None:
    """x'' - 2 W y' + (k_x - W^2) x, y'' + 2 W x' + (k_y - W^2) y: divergence for k_x < W^2 < k_y."""
    turn = np.array([[0.0, -2.0], [2.0, 0.0]])
    unequal = system(np.eye(2), np.diag([1.0, 4.0]), gyroscopic=turn, centripetal=-np.eye(2))
    speeds = np.array([0.5, 0.9, 1.1, 1.5, 1.9, 2.1, 3.0])
    found = whirl_motions(unequal, speeds)
    diverges = (speeds > 1) & (speeds < 2)
    np.testing.assert_array_equal(found.growth_rate.max(axis=1) > 0, diverges)
    np.testing.assert_array_equal((found.natural_frequency == 0).sum(axis=1), np.where(diverges, 1, 0))
    for k, w in enumerate(speeds):
        squared = np.roots([1.0, 4 * w**2 + 5 - 2 * w**2, (1 - w**2) * (4 - w**2)])
        expected = np.sort(np.sqrt(np.maximum(-squared, 0.0)))
        np.testing.assert_allclose(np.sort(found.natural_frequency[k]), expected, atol=1e-9)


def test_rotating_damping_is_named_by_its_threshold() -> None:
    given = ROTORS["internal_damping"]["inputs"]
    m, k, still, turning = given["m"], given["k"], given["ce"], given["ci"]
    rotor = system(
        m * np.eye(2), k * np.eye(2), (still + turning) * np.eye(2),
        circulatory=np.array([[0, turning], [-turning, 0]]),
    )  # fmt: skip
    threshold = ROTORS["internal_damping"]["threshold_speed_rad_s"]
    found = whirl_motions(rotor, threshold * np.array([0.5, 1 - 1e-9, 1 + 1e-9, 1.5]))
    np.testing.assert_array_equal(found.growth_rate.max(axis=1) > 0, [False, False, True, True])
    grows = np.argmax(found.growth_rate[-1])
    assert found.damping_ratio[-1, grows] < 0
    assert found.whirl[-1, grows] == 1


def test_equal_exponents_keep_their_curves() -> None:
    """Two equal pairs, whose vectors are free at every speed."""
    one = stodola()
    both = [np.kron(np.eye(2), np.asarray(part)) for part in (one.mass, one.stiffness, one.rotations[0].gyroscopic)]
    found = whirl_motions(system(both[0], both[1], gyroscopic=both[2]), np.linspace(50.0, 1500.0, 12))
    expected = whirl_motions(one, np.linspace(50.0, 1500.0, 12))
    np.testing.assert_allclose(
        np.sort(found.natural_frequency), np.sort(np.repeat(expected.natural_frequency, 2, axis=1)), rtol=1e-9
    )
    np.testing.assert_allclose(
        found.natural_frequency[:, np.argsort(found.natural_frequency[-1])],
        np.repeat(expected.natural_frequency[:, np.argsort(expected.natural_frequency[-1])], 2, axis=1), rtol=1e-9,
    )  # fmt: skip


CONFIG = scene_data("whirl_rotor")


def test_over_the_axes_of_a_sweep() -> None:
    config = CONFIG | {"sweep": {"mesh_frequency": [3.0, 1.0, 2.0], "meshes.0.mean_stiffness": [0.5, 1.0]}}
    found = gs.sweep(gs.load(config))["natural_frequencies"].to_dataset()
    assert found["whirl"].dims == ("mesh_frequency", "meshes.0.mean_stiffness", "mode")
    base = gs.build(gs.load(config))
    for k, stiffness in enumerate((0.5, 1.0)):
        mesh = replace(base.meshes[0], mean_stiffness=np.array(stiffness))
        expected = whirl_motions(replace(base, meshes=(mesh,)), np.array([1.0, 2.0, 3.0]))
        own = found["natural_frequency"].values[:, k]
        np.testing.assert_allclose(own, expected.natural_frequency[[2, 0, 1]], rtol=1e-12)


def test_speeds_that_follow_nothing_are_refused() -> None:
    with pytest.raises(ConfigError, match="needs a mesh_frequency axis: speeds of rotation follow it"):
        gs.sweep(gs.load(CONFIG | {"sweep": {"epsilon": [0.1, 0.2]}}))


def test_modes_of_the_base_system_over_the_speed() -> None:
    """Frequencies are those of the first-order matrix, and one motion orbits against the other."""
    speeds = [2.0, 0.5, 3.5]
    config = gs.load(CONFIG | {"sweep": {"mesh_frequency": speeds}})
    modes = gs.sweep(config)["modes"].to_dataset()
    assert modes["frequency"].dims == modes["whirl"].dims == ("speed", "mode")
    np.testing.assert_array_equal(modes["speed"], sorted(speeds))
    base = gs.build(config)
    mass, stiffness = base.mass, base.mean_stiffness_matrix()
    for speed, frequency in zip(sorted(speeds), modes["frequency"].values, strict=True):
        gyroscopic = 0.1 * speed * np.array([[0, 1.0], [-1.0, 0]])
        bottom = np.linalg.solve(mass, np.hstack([-stiffness, -gyroscopic]))
        exponents = np.linalg.eigvals(np.vstack([np.hstack([np.zeros((2, 2)), np.eye(2)]), bottom]))
        np.testing.assert_allclose(np.sort(frequency), np.sort(exponents.imag[exponents.imag > 0]), rtol=1e-12)
    np.testing.assert_allclose(modes["damping_ratio"], 0.0, atol=1e-12)
    assert (np.sort(modes["whirl"].values, axis=1) == [-1, 1]).all()
