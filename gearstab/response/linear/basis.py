"""The first-order form of all rows of a system, in its mean modes and without rigid-body motion.

The state is x = (w u, u', b'): elastic modal coordinates u of the mean system, q = Phi u, weighted by their natural
frequencies, their velocities, and the velocities of the rigid-body modes that damping holds back; ' = d/(rate dt), so
that all entries are of one size. The position of a rigid-body mode deflects nothing and never enters; where nothing
damps it, its velocity does not either, and the part of a force that would accelerate it is left out (it acts on the
train as a whole: elastic modes are orthogonal to it).

    x' = A(t) x + B f(t),    A(t) = constant + sum_j s_j(t) parts_j
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from gearstab.floquet.segments.grouping import equal_rows
from gearstab.floquet.segments.reduction import rigid_modes
from gearstab.modal import mean_modes
from gearstab.system import Array, GearSystem

STILL = 1e-11
"""Damping of a rigid-body mode below this part of the largest one is rounding."""
SLOWEST = 1e-6
"""A mode slower than this part of the mean one is weighted as if it had that frequency."""


@dataclass(frozen=True)
class Basis:
    """Rows of a system that have equally many coordinates of each sort.

    rows: ``(r,)``, positions in the flattened batch.
    rate: ``(r,)``, the unit of 1/time.
    constant: ``(r, m, m)``; parts: ``(r, J, m, m)``, of the meshes, then of the terms' profiles.
    inlet: ``(r, m, n)``, B, for generalised forces in the system's units.
    outlet: ``(r, n, m)``, q from x; speed: ``(r, n, m)``, dq/dt from x.
    loose: ``(r, n, k)``, the undamped rigid-body modes, normalised by the mass matrix.
    drifting: whether the velocities of rigid-body modes are part of the state.
    """

    rows: Array
    rate: Array
    constant: Array
    parts: Array
    inlet: Array
    outlet: Array
    speed: Array
    loose: Array
    drifting: bool

    @property
    def size(self) -> int:
        """m."""
        return int(self.constant.shape[-1])

    def generator(self, values: Array) -> Array:
        """A ``(..., r, m, m)`` for the values ``(..., r, J)`` of the varying functions."""
        flat = self.parts.reshape(*self.parts.shape[:2], self.size**2)
        varying = np.einsum("...rj,rjk->...rk", values, flat)
        return self.constant + varying.reshape(*varying.shape[:-1], self.size, self.size)


@dataclass(frozen=True)
class _Modal:
    """Modal matrices of all rows; ``parts`` are (whether it acts on velocities, matrix)."""

    shapes: Array
    squared: Array
    rate: Array
    static: Array
    damping: Array
    parts: list[tuple[bool, Array]]


def bases(system: GearSystem, whole: bool = False) -> Iterator[Basis]:
    """All rows, each once.

    whole: keep all modes, positions of rigid-body modes included, for histories that follow the train as it turns.
    """
    modal, rigid = _modal(system)
    if whole:
        free = (~rigid[:, None, :]).astype(float)
        still = [(on_velocity, matrix if on_velocity else matrix * free) for on_velocity, matrix in modal.parts]
        # Rounding in the stiffness of a rigid-body mode would bend its uniform motion in the long run.
        modal = replace(modal, static=modal.static * free, parts=still, squared=np.where(rigid, np.inf, modal.squared))
        rigid = np.zeros_like(rigid)
    drag = [modal.damping] + [matrix for on_velocity, matrix in modal.parts if on_velocity]
    moved = np.max([np.abs(matrix).max(axis=1) for matrix in drag], axis=0)
    held = rigid & (moved > STILL * moved.max(axis=1, keepdims=True))
    for members, _ in equal_rows(rigid.astype(int) + held):
        yield _basis(modal, members, rigid[members[0]], held[members[0]])


def _modal(system: GearSystem) -> tuple[_Modal, Array]:
    modes = mean_modes(system)
    shapes, squared = system.flat(modes.shapes, 2), system.flat(modes.squared_frequency, 1)
    deflection = np.swapaxes(system.flat(modes.mesh_deflection, 2), -1, -2)
    back = np.swapaxes(shapes, -1, -2)
    rate = np.sqrt(np.maximum(np.abs(squared).mean(axis=-1), np.finfo(float).tiny))
    drag = np.zeros(shapes.shape)
    if system.damping is not None:
        drag = back @ system.flat(system.damping, 2) @ shapes
    parts = [(False, deflection[:, i, :, None] * deflection[:, i, None, :]) for i in range(len(system.meshes))]
    for term in system.terms:
        u, v = (np.einsum("rnp,rn->rp", shapes, system.flat(end, 1)) for end in (term.left, term.right))
        kinds = [on for on, profile in enumerate((term.stiffness, term.damping)) if profile is not None]
        parts += [(bool(on), u[:, :, None] * v[:, None, :]) for on in kinds]
    static = back @ system.flat(system.stiffness, 2) @ shapes
    return _Modal(shapes, squared, rate, static, drag, parts), rigid_modes(squared, deflection)


def _basis(modal: _Modal, members: Array, rigid: Array, held: Array) -> Basis:
    elastic, coupled = np.flatnonzero(~rigid), np.flatnonzero(held)
    moving = np.concatenate([elastic, coupled])
    n, m = len(elastic), 2 * len(elastic) + len(coupled)
    rate = modal.rate[members]
    frequency = np.sqrt(np.abs(modal.squared[members][:, elastic])) / rate[:, None]
    weight = np.where(np.isinf(frequency), 1.0, np.maximum(frequency, SLOWEST))

    def placed(on_velocity: bool, matrix: Array) -> Array:
        """-matrix where it acts, in the units of the state."""
        whole = np.zeros((len(members), m, m))
        if on_velocity:
            whole[:, n:, n:] = -matrix[members][:, moving[:, None], moving] / rate[:, None, None]
        else:
            inner = matrix[members][:, moving[:, None], elastic] / rate[:, None, None] ** 2
            whole[:, n:, :n] = -inner / weight[:, None, :]
        return whole

    constant = placed(False, modal.static) + placed(True, modal.damping)
    constant[:, np.arange(n), n + np.arange(n)] = weight
    shapes = modal.shapes[members]
    inlet, outlet = np.zeros((len(members), m, shapes.shape[1])), np.zeros((len(members), shapes.shape[1], m))
    speed = np.zeros_like(outlet)
    inlet[:, n:] = np.swapaxes(shapes[:, :, moving], -1, -2) / rate[:, None, None] ** 2
    outlet[:, :, :n] = shapes[:, :, elastic] / weight[:, None, :]
    speed[:, :, n:] = shapes[:, :, moving] * rate[:, None, None]
    parts = np.stack([placed(*part) for part in modal.parts], axis=1)
    loose = shapes[:, :, rigid & ~held]
    return Basis(members, rate, constant, parts, inlet, outlet, speed, loose, bool(held.any()))
