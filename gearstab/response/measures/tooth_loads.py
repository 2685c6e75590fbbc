"""Load and root stress of single teeth along their contact, from the history of a mesh force.

A pair of teeth carries F(t) k_p/k of the mesh force while it moves from its first point of contact to its last one.
Over a common period it does so many times, each a little different: the largest value at each point of the contact
counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.gears.mesh_stiffness import StiffnessModel
from gearstab.gears.pair import Pair
from gearstab.gears.stress import load_shares, root_stress
from gearstab.system import Array, GearSystem

MOST_POINTS = 100
"""Parts of the contact in which the largest value is sought."""
AT_ONCE = 4096
"""Samples whose load is shared out at once: each takes integrals over two or more teeth, 2 kB apiece."""
AFTER = 1e-9
"""Of a cycle: a history has the mesh force just after a jump where a sample falls on one."""


@dataclass(frozen=True)
class LoadedTeeth:
    """The teeth of a mesh: pair of gears, how its stiffness is computed, names of the driver and the driven gear."""

    pair: Pair
    model: StiffnessModel
    gears: tuple[str, str]

    @property
    def in_order(self) -> tuple[str, str]:
        """Names of pinion and wheel."""
        return (self.gears[1], self.gears[0]) if self.pair.wheel_drives else self.gears


@dataclass(frozen=True)
class ToothLoads:
    """Of one mesh, over the contact from its first point (0) to its last (1), in the middle of equal parts.

    load, static_load: ``(points,)``, the largest load of a pair, and that under the static mesh force, N.
    stress, static_stress: ``(points, 2)``, at the roots of pinion and wheel, Pa; NaN for an internal gear.
    """

    load: Array
    static_load: Array
    stress: Array
    static_stress: Array


def positions(points: int) -> Array:
    """``(points,)``, 0 to 1, the middle of equal parts."""
    return (np.arange(points) + 0.5) / points


def phases(system: GearSystem, mesh: int, time: Array, mesh_frequency: float) -> Array:
    """Return the phases of a mesh at times, in its cycles; 0 is the entry of a pair of teeth."""
    item = system.meshes[mesh]
    return time * mesh_frequency * float(item.frequency_ratio) / (2 * np.pi) - float(item.lag) + AFTER


def tooth_loads(teeth: LoadedTeeth, phase: Array, force: Array, static: float, points: int = MOST_POINTS) -> ToothLoads:
    """Compute the loads of teeth from the mesh force ``(samples,)`` at phases ``(samples,)``, in cycles, and the static
    mesh force.

    points: parts of the contact; with fewer samples in a mesh cycle some of them may be empty, NaN. All are NaN for
    helical teeth, and where the teeth by themselves would part, with a contact ratio below 1.
    """
    pair, model = teeth.pair, teeth.model
    ratio = pair.contact_ratio
    if ratio < 1 or pair.overlap_ratio > 0:
        none, both = np.full(points, np.nan), np.full((points, 2), np.nan)
        return ToothLoads(none, none, both, both)
    load = np.full(points, -np.inf)
    for i in range(0, len(phase), AT_ONCE):
        own = phase[i : i + AT_ONCE]
        _, share = load_shares(pair, own, model)
        # Pairs from the youngest: each has travelled the phase and whole cycles.
        travelled = (own - np.floor(own))[:, None] + np.arange(share.shape[1])
        touching = travelled < ratio
        part = np.minimum((travelled[touching] / ratio * points).astype(int), points - 1)
        np.maximum.at(load, part, (force[i : i + AT_ONCE, None] * share)[touching])
    load = np.where(np.isfinite(load), load, np.nan)
    middle = positions(points) * ratio
    _, own = load_shares(pair, middle, model)
    resting = static * own[np.arange(points), np.floor(middle).astype(int)]
    unit = _stress_of_unit_load(pair, middle)
    return ToothLoads(load, resting, unit * load[:, None], unit * resting[:, None])


def _stress_of_unit_load(pair: Pair, travelled: Array) -> Array:
    """``(points, 2)``, at the roots of pinion and wheel, Pa/N, after base pitches travelled since the entry."""
    way = travelled * pair.base_pitch
    s = np.clip(pair.path[1] - way if pair.wheel_drives else pair.path[0] + way, *pair.path)
    sides = ((pair.pinion, s), (pair.wheel, pair.wheel_arm(s)))
    found = [root_stress(gear, arm / gear.base_radius, 1.0, pair.face_width) for gear, arm in sides]
    return np.stack(found, axis=-1)
