"""Teeth with play: where their flanks are, which of them carries the load, and where the train rests on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.errors import NotPossible
from gearstab.modal import mean_modes, static_equilibrium
from gearstab.system import Array, GearSystem

UPPER, APART, LOWER = 1, 0, -1
"""States of a mesh's contact: x = g_i^T q - e_i above, within or below its play."""

KINDS = ("separation", "drive_side_contact", "coast_side_contact")
"""Events of a mesh."""

MOST_STATES = 200
"""Combinations of contacts that a static equilibrium is sought in."""
BALANCED = 1e-9
"""Part of the largest load: a smaller one is none, and a smaller imbalance of an equilibrium is rounding."""
ROUNDING = 1e-13
"""Part of the terms of a deflection: a smaller one is some rounding errors of theirs, 2e-16 each."""
FREE = 1e-12
"""Part of the largest stiffness, of modes in units of their own: motions of a smaller one are free but for rounding."""


@dataclass(frozen=True)
class Play:
    """The play of every mesh of a single system.

    low, high: ``(meshes,)``; the mesh force is k_i (x - high) above, 0 within and k_i (x - low) below. Both are 0 of a
        mesh without backlash.
    has: ``(meshes,)`` bool, whether a mesh has backlash at all.
    drive: ``(meshes,)``, UPPER or LOWER: the side that carries the static load; UPPER without load.
    """

    low: Array
    high: Array
    has: Array
    drive: Array

    @property
    def width(self) -> Array:
        """2 b."""
        return self.high - self.low

    def contact(self, x: Array) -> Array:
        """UPPER, APART or LOWER for deflections ``(..., meshes)``; UPPER where there is no backlash."""
        state = np.where(x > self.high, UPPER, np.where(x < self.low, LOWER, APART))
        return np.where(self.has, state, UPPER)

    def touching(self, x: Array, contact: Array, near: Array) -> Array:
        """Whether deflections ``(meshes,)`` are as near as that to a flank that bounds their contact."""
        upper, lower = np.abs(x - self.high) <= near, np.abs(x - self.low) <= near
        return np.where(contact == APART, upper | lower, np.where(contact == UPPER, upper, lower))

    def offset(self, contact: Array) -> Array:
        """The deflection ``(..., meshes)`` at which the force of a mesh in contact is zero."""
        return np.where(contact == LOWER, self.low, self.high)

    def kind(self, mesh: int, contact: int) -> int:
        """Return the kind of a change of a mesh into ``contact``, as a position in KINDS."""
        return 0 if contact == APART else 1 if contact == self.drive[mesh] else 2


def play(system: GearSystem) -> Play:
    """The play of a single system. Raises NotPossible where the drive side of a mesh is needed and not known."""
    width = np.array([float(np.asarray(mesh.backlash)) for mesh in system.meshes])
    side = _sides(system)
    low, high = -0.5 * width, 0.5 * width
    for i, mesh in enumerate(system.meshes):
        if width[i] > 0 and mesh.backlash_zero == "drive_side":
            if side[i] == 0:
                raise NotPossible(
                    f"mesh {mesh.name} carries no load, so that it has no drive side: use backlash_zero: middle"
                )
            low[i], high[i] = (-width[i], 0.0) if side[i] > 0 else (0.0, width[i])
    return Play(low, high, width > 0, np.where(side < 0, LOWER, UPPER))


def directions(system: GearSystem) -> Array:
    """g ``(meshes, n)``, which makes deflections of coordinates."""
    return np.stack([np.asarray(mesh.direction, dtype=float) for mesh in system.meshes])


def _sides(system: GearSystem) -> Array:
    """The flank ``(meshes,)`` that the static load presses on; APART where it does not, but for rounding."""
    q = static_equilibrium(system)
    g = directions(system)
    x = g @ q
    load = np.array([float(mesh.mean_stiffness) for mesh in system.meshes]) * x
    loaded = np.abs(load) > BALANCED * np.max(np.abs(load), initial=0.0)
    return np.where(loaded & (np.abs(x) > ROUNDING * (np.abs(g) @ np.abs(q))), np.sign(x), APART).astype(int)


def resting(system: GearSystem, teeth: Play) -> Array:
    """q ``(n,)`` of the static equilibrium under the constant load, at the mean stiffness, on the flanks.

    K0 q + sum_i k_gi g_i (g_i^T q - offset_i) = f0 with the sum over the meshes in contact, sought from that of teeth
    without play on. Rigid-body motion is left out, as in
    :func:`~gearstab.modal.static_equilibrium`.

    Raises NotPossible where there is none, or none is found.
    """
    modes = mean_modes(system)
    shapes = modes.shapes[:, ~modes.rigid]
    k = np.array([float(mesh.mean_stiffness) for mesh in system.meshes])
    load = np.zeros(system.size) if system.load is None else np.asarray(system.load, dtype=float)
    contact = np.where(teeth.has, _sides(system), UPPER)
    # Modes in units of their own stiffness: beside a stiff one a soft one would drown in rounding errors.
    scale = 1 / np.sqrt(modes.natural_scale[~modes.rigid])
    gauge, pull = directions(system) @ shapes * scale, shapes.T @ load * scale
    constant = shapes.T @ system.stiffness @ shapes * scale * scale[:, None]
    for _ in range(MOST_STATES):
        closed = contact != APART
        matrix = constant + (gauge[closed].T * k[closed]) @ gauge[closed]
        force = pull + gauge[closed].T @ (k * teeth.offset(contact))[closed]
        amplitudes, free = _solved(matrix, force)
        # Teeth that are apart may leave motions free; of all equilibria this is the smallest.
        free *= scale[:, None]
        found = scale * amplitudes - free @ np.linalg.lstsq(free, scale * amplitudes)[0]
        # Teeth that just touch carry nothing: which side of the flank they are on is for rounding to say.
        x, terms = gauge @ (found / scale), np.abs(gauge) @ np.abs(found / scale)
        following = np.where(teeth.touching(x, contact, ROUNDING * terms), contact, teeth.contact(x))
        if np.array_equal(following, contact):
            size = max(np.abs(force).max(initial=0.0), np.abs(pull).max(initial=0.0))
            if np.abs(matrix @ amplitudes - force).max(initial=0.0) <= BALANCED * size:
                return np.asarray(shapes @ found)
            break
        contact = following
    raise NotPossible("no static equilibrium on the flanks of the teeth was found: give respond.initial")


def _solved(matrix: Array, force: Array) -> tuple[Array, Array]:
    """The smallest solution ``(m,)`` of least squares for a symmetric matrix, and the motions that are free ``(m, f)``.

    In the units of :func:`resting` stiffnesses are about 1, so that what is far below is a rounding error.
    """
    values, vectors = np.linalg.eigh(matrix)
    free = np.abs(values) <= FREE * np.abs(values).max(initial=0.0)
    bound = vectors[:, ~free]
    return bound @ (bound.T @ force / values[~free]), vectors[:, free]
