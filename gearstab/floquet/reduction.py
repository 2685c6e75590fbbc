"""Exact reduction to elastic coordinates: rigid-body modes out, unit masses, unit rate, uniform damping as a shift.

A rigid-body mode r (K0 r = 0, g_i^T r = 0) has the defective multiplier 1, which no eigenvalue solver in double
precision finds; its exponents are known exactly and it is projected out first. Damping proportional to the mass, C
= alpha M, is removed by q = exp(-alpha t/2) y: y is undamped with K - (alpha^2/4) M, so that the symplectic theory
applies. This covers every system of one degree of freedom.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace

import numpy as np

from gearstab.floquet.grouping import equal_rows
from gearstab.modal import mean_modes
from gearstab.system import Array, GearSystem

UNIFORM = 4e-15
"""C is taken as proportional to M when it is so within rounding; what is neglected moves an exponent by 4e-15 alpha."""
DECOUPLED = 1e-13
"""Rigid and elastic modes are taken as uncoupled when the damping between them is rounding error of C."""


@dataclass(frozen=True)
class Elastic:
    """Rows reduced alike, in the elastic modes of the mean system (M = I), with time in units of 1/rate.

    rows: ``(r,)`` positions in the flattened batch, ascending.
    rate: ``(r,)``, 1/time.
    static: ``(r, n, n)``, K0;  directions: ``(r, meshes, n)``, g_i^T Phi; both so that K = static + sum k_i g g^T.
    damping: ``(r, n, n)`` or None when conservative after the shift.
    shift: ``(r,)``, alpha/2, the decay common to all elastic exponents, taken out of ``static``.
    rigid_exponents: ``(r, k)``, those known beforehand, 1/time: 2 a rigid mode, or only the one of its position where
        damping couples its velocity to elastic modes.
    rigid_damping: ``(r, n_rigid, n + n_rigid)``, the rows [C_re, C_rr] in that case, else None.
    turn: ``(r, n, n)``, the symmetric part of the turn that the mean system is the same after; None without one.
    """

    rows: Array
    rate: Array
    static: Array
    directions: Array
    damping: Array | None
    shift: Array
    rigid_exponents: Array
    rigid_damping: Array | None
    turn: Array | None = None

    def subset(self, index: Array) -> Elastic:
        """Some of the rows."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return replace(self, **{name: v[index] for name, v in values.items() if v is not None})

    def stiffness_of(self, levels: Array) -> Array:
        """``(r, D, n, n)`` for mesh stiffnesses ``(r, D, meshes)``, in units of rate^2 and after the shift."""
        g = self.directions
        outer = (g[..., :, None] * g[..., None, :]).reshape(*g.shape[:2], -1)
        total: Array = (levels @ outer).reshape(*levels.shape[:2], g.shape[-1], g.shape[-1])
        # In place: there may be thousands of states.
        total += self.static[:, None]
        total /= self.rate[:, None, None, None] ** 2
        if self.shift.any():
            total -= self.shift[:, None, None, None] ** 2 * np.eye(g.shape[-1])
        return total


def reduce(system: GearSystem, rows: int) -> Iterator[Elastic]:
    """Group the rows by number of rigid-body modes and kind of damping; each row comes once."""
    n = system.size

    def full(matrix: Array) -> Array:
        return np.broadcast_to(matrix, (*system.batch, n, n)).reshape(rows, n, n)

    modes = mean_modes(system)
    shapes = full(modes.shapes)
    deflection = np.broadcast_to(modes.mesh_deflection, (*system.batch, n, len(system.meshes)))
    deflection = np.swapaxes(deflection.reshape(rows, n, -1), -1, -2)
    squared = np.broadcast_to(modes.squared_frequency, (*system.batch, n)).reshape(rows, n)
    rigid = rigid_modes(squared, deflection)
    rate = np.sqrt(np.maximum(np.mean(np.abs(squared), axis=-1), np.finfo(float).tiny))
    damping = None if system.damping is None else _modal(shapes, full(system.damping))
    kind = _kinds(rigid, damping)
    static = _modal(shapes, full(system.stiffness))
    turn = None if system.symmetry is None else _modal(shapes, full(system.mass @ system.symmetry.turn))
    for members, key in equal_rows(kind):
        elastic = np.nonzero(~rigid[members])[1].reshape(len(members), -1)
        inner = _take(static[members], elastic, elastic)
        directions = deflection[members]
        if elastic.shape[1] < n:
            directions = np.take_along_axis(directions, elastic[:, None, :], axis=-1)
        loose = np.nonzero(rigid[members])[1].reshape(len(members), -1)
        none = np.zeros(len(members))
        symmetry = None if turn is None else _take(turn[members], elastic, elastic)
        base = Elastic(members, rate[members], inner, directions, None, none, np.zeros(loose.shape), None, symmetry)
        yield _with_damping(base, None if damping is None else damping[members], elastic, loose, int(key[1]))


def rigid_modes(squared: Array, deflection: Array) -> Array:
    """``(r, n)`` bool: modes of zero mean frequency that deflect no mesh (with negative stiffness it may be chance).

    squared: ``(r, n)``; deflection: ``(r, meshes, n)``.
    """
    size = np.max(np.abs(deflection), axis=(1, 2), keepdims=True)
    still = np.all(np.abs(deflection) <= 1e-7 * size, axis=1)
    return (squared == 0) & still


def _modal(shapes: Array, matrix: Array) -> Array:
    product = np.swapaxes(shapes, -1, -2) @ matrix @ shapes
    return 0.5 * (product + np.swapaxes(product, -1, -2))


def _take(matrix: Array, rows: Array, columns: Array) -> Array:
    if rows.shape[1] == columns.shape[1] == matrix.shape[1]:
        return matrix  # all of them, in ascending order
    chosen = np.take_along_axis(matrix, rows[:, :, None], axis=1)
    return np.take_along_axis(chosen, columns[:, None, :], axis=2)


def _kinds(rigid: Array, damping: Array | None) -> Array:
    """``(rows, 2)``: number of rigid modes; 0 conservative after a shift, 1 damped, 2 damping couples to rigid ones."""
    kind = np.zeros((len(rigid), 2), dtype=int)
    kind[:, 0] = rigid.sum(axis=1)
    if damping is None:
        return kind
    scale = np.max(np.abs(damping), axis=(1, 2))
    both = rigid[:, :, None] != rigid[:, None, :]
    coupled = np.max(np.abs(damping) * both, axis=(1, 2)) > DECOUPLED * scale
    inside = ~rigid[:, :, None] & ~rigid[:, None, :]
    mean = np.einsum("rii,ri->r", damping, ~rigid) / np.maximum((~rigid).sum(axis=1), 1)
    deviation = np.abs(damping - mean[:, None, None] * np.eye(rigid.shape[1])) * inside
    uniform = np.max(deviation, axis=(1, 2)) <= UNIFORM * scale
    kind[:, 1] = np.where(coupled, 2, np.where(uniform, 0, 1))
    return kind


def _with_damping(base: Elastic, damping: Array | None, elastic: Array, loose: Array, kind: int) -> Elastic:
    members, unit = len(base.rows), base.rate[:, None, None]
    if damping is None:
        return replace(base, rigid_exponents=np.zeros((members, 2 * loose.shape[1])))
    inner = _take(damping, elastic, elastic) / unit
    if kind == 2:
        both = np.concatenate([elastic, loose], axis=1)
        return replace(base, damping=inner, rigid_damping=_take(damping, loose, both) / unit)
    # M r'' + C_rr r' = 0: each rigid coordinate has the exponents 0 and minus an eigenvalue of C_rr.
    decay = -np.linalg.eigvalsh(_take(damping, loose, loose)) if loose.shape[1] else np.zeros((members, 0))
    exponents = np.concatenate([np.zeros_like(decay), decay], axis=1)
    if kind == 0:
        shift = 0.5 * np.einsum("rii->r", inner) / max(elastic.shape[1], 1)
        return replace(base, shift=shift, rigid_exponents=exponents)
    return replace(base, damping=inner, rigid_exponents=exponents)
