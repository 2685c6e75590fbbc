"""Branches of a planetary gear and of a gearbox whose teeth part: what symmetry does, and motions of an integrator."""

from __future__ import annotations

from functools import cache

import numpy as np
from driven import integrated_with_backlash
from scenes import scene_data

import gearstab
from gearstab.response.backlash.branches import BranchSearch, Starts
from gearstab.response.backlash.continuation import DOUBLING, FOLD, StepLimits
from gearstab.response.backlash.dynamics import play
from gearstab.response.backlash.motions import Branch, BranchMotion
from gearstab.response.backlash.sections import SectionMap
from gearstab.system import GearSystem
from gearstab.systems import build

Array = np.ndarray


@cache
def planetary() -> GearSystem:
    """A sun, a ring and three equal planets in phase, all of which only turn: any two planets may change places."""
    mesh = {"mean_stiffness": 1.0, "epsilon": 0.3, "contact_ratio": 1.5, "backlash": 0.4}
    return build({
        "kind": "planetary", "planets": 3, "ring": {"kind": "rigid"}, "motion": "rotational", "scaling": "SI",
        "masses": {"ring": 1.0, "planet": 0.7}, "pressure_angles": {"sun": 0.4, "ring": 0.4}, "damping_ratio": 0.05,
        "inertias": {"ring": 2.0, "carrier": 3.0, "sun": 1.0, "planet": 0.6},
        "supports": {"ring_tangential": 0.5, "carrier_rotation": 0.3, "sun_rotation": 0.2},
        "meshes": {"sun": mesh, "ring": mesh}, "phases": {"sun": [0, 0, 0], "sun_ring": 0.0},
        "load": {"sun": 0.3, "carrier": -0.55},
    })  # fmt: skip


@cache
def searched() -> BranchSearch:
    found = BranchSearch(SectionMap(planetary()), StepLimits(3.1, 4.3, most=140), {DOUBLING})
    found.run(Starts((3.2,), kinds=("linear",)))
    return found


def planet_alone(omega: float) -> Array:
    """Multipliers of u, u' of a planet whose neighbours rest: where planets move against each other, sun, ring and
    carrier do not move. By the exact matrices of the two intervals of the stiffness.
    """
    system = planetary()
    at = system.coordinates.index("planet1_rotation")
    mass, period = system.mass[at, at], 2 * np.pi / omega
    # Modal damping of a mode that has this planet in it.
    own = [mesh for mesh in system.meshes if mesh.direction[at] != 0]
    mean = sum(mesh.mean_stiffness * mesh.direction[at] ** 2 for mesh in own)
    damping = 0.05 * np.sqrt(mean / mass)
    whole = np.eye(2)
    # Stiff for half of the period: the contact ratio is 1.5.
    for k in (1.3 * mean, 0.7 * mean):
        w, t = np.sqrt(k / mass - damping**2), 0.5 * period
        c, s = np.cos(w * t), np.sin(w * t)
        step = [[c + damping / w * s, s / w], [-k / mass * s / w, c - damping / w * s]]
        whole = np.exp(-damping * t) * np.array(step) @ whole
    return np.linalg.eigvals(whole)


def test_two_multipliers_cross_at_once_in_a_planetary_gear() -> None:
    """Where planets move against each other there are two such motions, and two multipliers pass -1 together, at both
    ends of the region of a planet alone; det(DP + I) only touches zero there. Others pass alone.
    """
    doublings = [motion for motion in searched().found[0].motions if motion.kind == DOUBLING]
    assert [motion.multiplicity for motion in doublings] == [2, 1, 2, 1]
    for motion in doublings[::2]:
        alone = planet_alone(motion.parameter)
        assert np.abs(alone + 1).min() < 1e-10
        nearest = np.sort(np.abs(motion.stability.multipliers + 1))
        assert nearest[1] < 1e-10 < nearest[2]
    for motion in doublings[1::2]:
        assert np.abs(planet_alone(motion.parameter) + 1).min() > 1e-3


def leaving() -> list[Branch]:
    found = searched().found
    first = next(k for k, motion in enumerate(found[0].motions) if motion.kind == DOUBLING)
    return [branch for branch in found if (branch.parent, branch.leaves) == (0, first)]


def test_a_branch_of_every_symmetry_type_leaves_and_loses_contact() -> None:
    """Two planets in opposite step with the third one as before, or two in step against the third."""
    patterns = []
    for branch in leaving():
        motion = branch.motions[8]
        assert motion.cycle.contact_loss.max() > 0.1
        sun = np.sort(motion.cycle.rms[:3])
        patterns.append(bool(sun[2] - sun[1] < 1e-9 < sun[1] - sun[0]))
        assert min(np.diff(sun)) < 1e-9
    assert sorted(patterns) == [False, True]


def returned(system: GearSystem, laps: SectionMap, motion: BranchMotion, cycles: int) -> tuple[Array, Array]:
    """(q, q') at the beginning of a motion that loses contact, and by DOP853 from the definition so many cycles on."""
    teeth = play(system)
    limits = np.stack([teeth.low, teeth.high], axis=1)
    start = motion.x @ np.concatenate(laps.at(motion.parameter).physical(), axis=1)
    until = np.array([cycles * 2 * np.pi / motion.parameter])
    (end,), events = integrated_with_backlash(system, limits, motion.parameter, start, until)
    assert events
    return start, end


def test_motions_of_the_planetary_gear_are_integrated_ones() -> None:
    """Over the two cycles of a motion; these are unstable."""
    for branch in leaving():
        assert not branch.motions[8].stability.stable
        start, end = returned(planetary(), searched().laps, branch.motions[8], 2)
        np.testing.assert_allclose(end, start, atol=1e-8)


GEARBOX = scene_data("branches_of_trains_gearbox")


def test_a_gearbox_jumps_where_its_teeth_part() -> None:
    """Two stages in SI units, from their teeth; the second mesh has half the frequency. Motions on both sides of the
    fold at 3.4 kHz lose contact, and are those of an integration over the two cycles of the first mesh after which
    both meshes repeat; positions are some 1e-4 rad, speeds 1 rad/s. Rotation as a whole is left out.
    """
    system = gearstab.build({"system": GEARBOX})
    found = BranchSearch(SectionMap(system), StepLimits(20e3, 22e3, most=80))
    (branch,) = found.run(Starts((20.4e3,), kinds=("linear",)))
    # It comes back below where it began, and is no closed curve.
    assert branch.ends == ("range_end", "range_end")
    (fold,) = [k for k, motion in enumerate(branch.motions) if motion.kind == FOLD]
    before, after = branch.motions[fold - 2], branch.motions[fold + 2]
    assert before.stability.stable != after.stability.stable
    assert before.parameter < branch.motions[fold].parameter > after.parameter
    for motion in (before, after):
        assert motion.cycle.contact_loss[0] > 0.05
        start, end = returned(system, found.laps, motion, 2)
        gauge = np.stack([mesh.direction for mesh in system.meshes])
        n = system.size
        for part, size in ((slice(0, n), 1e-5), (slice(n, 2 * n), 0.2)):
            np.testing.assert_allclose(gauge @ end[part], gauge @ start[part], atol=1e-7 * size)
