"""Senses of rotation of planetary gears with teeth: who turns which way, who drives, and the phases that follow."""

from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from planetary_gears import SUPPORTS, parameters, with_epsilon
from scenes import read, scene_text

from gearstab.floquet import solve
from gearstab.system import GearSystem
from gearstab.systems import build, section
from gearstab.systems.planetary.parts import Turning
from gearstab.systems.planetary.planets import misfit, nearest
from gearstab.systems.planetary.teeth import with_teeth

SUN, PLANET, RING, NUMBER = 29, 20, 69, 7
"""14 teeth of sun and ring for each of 7 planets, whose phases go round once: z_s mod 7 = 1."""
WAYS = pytest.mark.parametrize(("driving", "held"), list(permutations(("sun", "ring", "carrier"), 2)))
SENSES = pytest.mark.parametrize("sense", ["counter-clockwise", "clockwise"])


def speeds(driving: str, held: str, sense: str) -> dict[str, float]:
    """Speeds of all bodies, from a system of linear equations."""
    order = ("sun", "ring", "carrier", "planet")
    rows, right = np.zeros((4, 4)), np.zeros(4)
    rows[0] = [SUN, 0, -SUN - PLANET, PLANET]
    rows[1] = [0, RING, PLANET - RING, -PLANET]
    rows[2, order.index(held)] = rows[3, order.index(driving)] = 1
    right[3] = 1 if sense == "counter-clockwise" else -1
    return dict(zip(order, np.linalg.solve(rows, right), strict=True))


@WAYS
@SENSES
def test_the_motion_is_that_of_linear_equations_and_of_virtual_work(driving: str, held: str, sense: str) -> None:
    w = speeds(driving, held, sense)
    motion = Turning.of(section({"kind": "planetary", "input": driving, "fixed": held, "sense": sense}), SUN, RING)
    assert motion is not None
    assert motion.planets_turn == np.sign(w["planet"] - w["carrier"])
    assert float(motion.cycles) == pytest.approx(RING * abs(w["ring"] - w["carrier"]))
    # Torques do no work on any motion that the teeth allow, and the one of the input has its sense.
    allowed = [list(speeds(one, other, "clockwise").values())[:3] for one, other in (("sun", "ring"), ("ring", "sun"))]
    torque = dict(zip(("sun", "ring", "carrier"), np.cross(*allowed), strict=True))
    torque_on_sun = torque["sun"] * np.sign(torque[driving] * w[driving])
    assert motion.torque == np.sign(torque_on_sun)
    assert motion.sun_drives == (torque_on_sun * (w["sun"] - w["carrier"]) > 0)


@WAYS
@SENSES
def test_suns_teeth_reach_the_planets_when_their_phases_say(driving: str, held: str, sense: str) -> None:
    """A tooth of the sun at the first planet at time 0, and the first times after it at which one is at the others."""
    w = speeds(driving, held, sense)
    turning = w["sun"] - w["carrier"]
    angles = np.array(nearest(SUN, RING, 5))
    period = 2 * np.pi / (SUN * abs(turning))
    for psi, listed in ((2 * np.pi * np.arange(NUMBER) / NUMBER, None), (angles, list(angles))):
        teeth = 2 * np.pi * np.arange(-SUN, SUN + 1) / SUN
        passing = (psi[:, None] + teeth) / turning
        times = np.min(np.where(passing > -1e-9 * period, passing, np.inf), axis=1)
        p = gear(len(psi), angles=listed, input=driving, fixed=held, sense=sense)
        lags = np.array([float(mesh.lag) for mesh in build(p).meshes[: len(psi)]])
        differences = lags - times / period
        np.testing.assert_allclose(differences, np.rint(differences), atol=1e-9)


def gear(planets: int, **changes: object) -> dict[str, object]:
    """Parameters of Parker's gear on soft supports with these teeth, and a lag of the ring's that no symmetry has."""
    p = parameters(planets, harmonics=1, supports=SUPPORTS, phases={"sun_ring": 0.2}, **changes)
    return with_epsilon(p, 0.3) | {"teeth": {"sun": SUN, "planet": PLANET, "ring": RING}}


OMEGA = np.linspace(0.5, 3.0, 60)


def growth(system: GearSystem) -> np.ndarray:
    found = np.asarray(solve(system, OMEGA).growth_rate)
    assert found.max() > 1e-2
    return found


def test_a_planet_set_with_teeth_turned_as_a_whole_keeps_its_phases_and_growth() -> None:
    """By half a step, too: the teeth fit at multiples of 2 pi/(z_s + z_r) from the first planet, wherever it is."""
    angles = np.array(nearest(SUN, RING, 4))
    step = 2 * np.pi / (SUN + RING)
    first = build(gear(4, angles=list(angles)))
    for turn in (0.5 * step, -2.0):
        assert misfit(SUN, RING, list(angles + turn)) is None
        turned = build(gear(4, angles=list(angles + turn)))
        before, after = (np.array([float(mesh.lag) for mesh in system.meshes]) for system in (first, turned))
        np.testing.assert_allclose((after - after[0]) % 1, (before - before[0]) % 1, atol=1e-9)
        assert np.abs(turned.meshes[0].direction - first.meshes[0].direction).max() > 0.01
        # Growth within 1e-8: coordinates turned, and multipliers of 21 coordinates side by side.
        np.testing.assert_allclose(growth(turned), growth(first), atol=1e-7)


def test_a_planet_set_is_not_the_same_with_the_phases_of_other_places() -> None:
    """The test above would see nothing if growth did not hang on the phases."""
    angles = nearest(SUN, RING, 4)
    wrong = gear(4, angles=list(angles)) | {"teeth": {"sun": SUN + 1, "planet": PLANET, "ring": RING - 1}}
    assert np.abs(growth(build(wrong)) - growth(build(gear(4, angles=list(angles))))).max() > 1e-3


TEXT = scene_text("planetary_angles")


def test_a_gear_that_turns_the_other_way_is_its_mirror_image(tmp_path: Path) -> None:
    """Other flanks and the other order of phases: the same growth; with one of the two alone another gear."""
    there = with_teeth(read(tmp_path, TEXT).system)
    back = with_teeth(read(tmp_path, TEXT.replace("counter-clockwise", "clockwise")).system)
    assert back["pressure_angles"]["sun"] == -there["pressure_angles"]["sun"]
    half = back.model_copy(update={"pressure_angles": there.pressure_angles})
    omega = np.linspace(2e4, 9e4, 60)
    first, mirrored, other = (np.asarray(solve(build(p), omega).growth_rate) for p in (there, back, half))
    scale = first.max()
    np.testing.assert_allclose(mirrored, first, atol=1e-6 * scale)
    assert np.abs(other - first).max() > 1e-3 * scale
