"""Exact reduction to elastic coordinates: rigid-body modes out, unit masses, unit rate, uniform damping as a shift.

A rigid-body mode r (K0 r = 0, g_i^T r = 0) has the defective multiplier 1, which no eigenvalue solver in double
precision finds; its exponents are known exactly and it is projected out first. It takes no part in stability unless
its damping is negative: a velocity that grows makes the system unstable, whatever the elastic modes do. Damping
proportional to the mass, C = alpha M, is removed by q = exp(-alpha t/2) y: y is undamped with K - (alpha^2/4) M, so
that the symplectic theory applies. This covers every system of one degree of freedom.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace

import numpy as np

from gearstab.grouping import Columns, equal_rows
from gearstab.modal import mean_modes
from gearstab.system import Array, GearSystem

UNIFORM = 4e-15
"""C is taken as proportional to M when it is so within rounding; what is neglected moves an exponent by 4e-15 alpha."""
DECOUPLED = 1e-13
"""Rigid and elastic modes are taken as uncoupled when the damping between them is rounding error of C."""
CANCELLED = 1e-12
"""Damping of a rigid-body mode below this part of the sum of the magnitudes that cancel in it is rounding error."""


@dataclass(frozen=True)
class Elastic:
    """Rows reduced alike, in the elastic modes of the mean system (M = I), with time in units of 1/rate.

    rows: ``(r,)`` positions in the flattened batch, ascending.
    rate: ``(r,)``, 1/time.
    static: ``(r, n, n)``, K0;  directions: ``(r, meshes, n)``, g_i^T Phi; both so that K = static + sum k_i g g^T.
    damping: ``(r, n, n)`` or None when conservative after the shift.
    shift: ``(r,)``, alpha/2, the decay common to all elastic exponents, taken out of ``static``.
    rigid_exponents: ``(r, k)``, those known beforehand, 1/time: 2 per rigid mode, or only the one of its position where
        damping couples rigid and elastic modes and acts on its velocity.
    rigid_damping: ``(r, n_held, n + n_held)``, the rows [C_re, C_rr] of the rigid-body modes that damping holds in that
        case; of none else.
    turns: ``(r, s, n, n)``, the symmetric parts of the s turns that the mean system is the same after; None without.
    """

    rows: Array
    rate: Array
    static: Array
    directions: Array
    damping: Array | None
    shift: Array
    rigid_exponents: Array
    rigid_damping: Array
    turns: Array | None = None

    @property
    def conservative(self) -> bool:
        """Whether there is no damping after the shift."""
        return self.damping is None

    @property
    def damped(self) -> Array:
        """``(r,)`` bool: the rows with any damping of the elastic modes, uniform or not."""
        return (self.shift != 0) | (not self.conservative)

    @property
    def damping_matrix(self) -> Array:
        """``(r, n, n)``, C after the shift."""
        return np.zeros_like(self.static) if self.conservative else np.asarray(self.damping)

    @property
    def held(self) -> int:
        """The number of rigid-body modes that damping holds, whose velocities follow (u, u') in the state."""
        return int(self.rigid_damping.shape[1])

    @property
    def state_size(self) -> int:
        """m, the length of the state."""
        return 2 * int(self.static.shape[-1]) + self.held

    @property
    def rigid_growth(self) -> Array:
        """``(r,)``, 1/time: the largest rate at which a rigid-body mode grows by itself; -inf where none does."""
        largest = self.rigid_exponents.max(axis=1, initial=-np.inf)
        return np.asarray(np.where(largest > 0, largest, -np.inf))

    @property
    def rigid_driven(self) -> Array:
        """``(r,)`` bool: whether damping feeds a rigid-body mode, alone or with the elastic modes it is coupled to."""
        own = self.rigid_damping[..., self.static.shape[-1] :]
        least = np.linalg.eigvalsh(own).min(axis=1, initial=np.inf)
        noise = DECOUPLED * np.abs(self.rigid_damping).max(axis=(1, 2), initial=0.0)
        return np.asarray((self.rigid_growth > 0) | (least < -noise))

    def subset(self, index: Array) -> Elastic:
        """Some of the rows."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return replace(self, **{name: v[index] for name, v in values.items() if v is not None})

    def without_damping(self) -> Elastic:
        """The same coordinates without any damping of the elastic ones."""
        none = self.rigid_damping[:, :0, : self.static.shape[-1]]
        return replace(self, damping=None, rigid_damping=none, shift=np.zeros_like(self.shift))

    def unshifted(self) -> Elastic:
        """The same coordinates with uniform damping as a matrix like any other."""
        uniform = 2 * self.shift[:, None, None] * np.eye(self.static.shape[-1])
        return replace(self, damping=self.damping_matrix + uniform, shift=np.zeros_like(self.shift))

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


def reduce(system: GearSystem) -> Iterator[Elastic]:
    """Group the rows by number of rigid-body modes and kind of damping; each row comes once."""
    n, modes = system.size, mean_modes(system)
    shapes, rate = system.flat(modes.shapes, 2), system.flat(modes.rate)
    deflection = np.swapaxes(system.flat(modes.mesh_deflection, 2), -1, -2)
    rigid = system.flat(modes.rigid, 1) == 1
    drag = _damping(shapes, system.flat(system.damping_matrix, 2), rigid) if system.damped else None
    # Before the rows are laid out: they may share it.
    static = system.flat(_modal(modes.shapes, system.stiffness), 2)
    turns = [_modal(shapes, system.flat(system.mass @ symmetry.turn, 2)) for symmetry in system.symmetries]
    for members, key in equal_rows(_kinds(rigid, drag)):
        elastic = np.nonzero(~rigid[members])[1].reshape(len(members), -1)
        inner = _take(static[members], elastic, elastic)
        directions = deflection[members]
        if elastic.shape[1] < n:
            directions = np.take_along_axis(directions, elastic[:, None, :], axis=-1)
        rigid_at = np.nonzero(rigid[members])[1].reshape(len(members), -1)
        kept = [_take(turn[members], elastic, elastic) for turn in turns]
        stacked = np.stack(kept, axis=1) if kept else None
        none, free = np.zeros(len(members)), np.zeros((len(members), 0, elastic.shape[1]))
        still = np.zeros((len(members), 2 * rigid_at.shape[1]))
        base = Elastic(members, rate[members], inner, directions, None, none, still, free, stacked)
        yield base if drag is None else _with_damping(base, drag.chosen(members), elastic, rigid_at, int(key[1]))


@dataclass(frozen=True)
class _Damping(Columns):
    """Damping in modal coordinates, those of rigid-body modes turned so that as few as possible are damped.

    matrix: ``(r, n, n)``. held: ``(r, n)``, which rigid-body modes damping acts on. noise: ``(r,)``, what of the
    damping between them is rounding error. coupled: ``(r,)``, whether damping couples them to elastic modes.
    """

    matrix: Array
    held: Array
    noise: Array
    coupled: Array


def _damping(shapes: Array, physical: Array, rigid: Array) -> _Damping:
    matrix, noise = _modal(shapes, physical), np.zeros(len(rigid))
    if rigid.any():
        size = np.abs(shapes)
        terms = np.einsum("rip,rip->rp", size, np.abs(physical) @ size)
        noise = CANCELLED * np.max(terms * rigid, axis=1)
    for row in np.flatnonzero(rigid.sum(axis=1) > 1):
        rigid_at = np.flatnonzero(rigid[row])
        # By descending size of C r: combinations that nothing damps come last.
        turn = np.linalg.svd(matrix[row][:, rigid_at])[2].T
        matrix[row][:, rigid_at] = matrix[row][:, rigid_at] @ turn
        matrix[row][rigid_at] = turn.T @ matrix[row][rigid_at]
    scale = DECOUPLED * np.max(np.abs(matrix), axis=(1, 2), initial=0.0)
    both = rigid[:, :, None] != rigid[:, None, :]
    coupled = np.max(np.abs(matrix) * both, axis=(1, 2)) > scale
    held = rigid & (np.max(np.abs(matrix), axis=1) > scale[:, None])
    return _Damping(matrix, held, noise, coupled)


def _modal(shapes: Array, matrix: Array) -> Array:
    product = np.swapaxes(shapes, -1, -2) @ matrix @ shapes
    return 0.5 * (product + np.swapaxes(product, -1, -2))


def _take(matrix: Array, rows: Array, columns: Array) -> Array:
    if rows.shape[1] == columns.shape[1] == matrix.shape[1]:
        return matrix  # all of them, in ascending order
    chosen = np.take_along_axis(matrix, rows[:, :, None], axis=1)
    return np.take_along_axis(chosen, columns[:, None, :], axis=2)


def _kinds(rigid: Array, drag: _Damping | None) -> Array:
    """``(rows, 3)``: number of rigid modes; 0 conservative after a shift, 1 damped, 2 damping couples to rigid ones;
    how many rigid modes are held where it does.
    """
    kind = np.zeros((len(rigid), 3), dtype=int)
    kind[:, 0] = rigid.sum(axis=1)
    if drag is None:
        return kind
    inside = ~rigid[:, :, None] & ~rigid[:, None, :]
    mean = np.einsum("rii,ri->r", drag.matrix, ~rigid) / np.maximum((~rigid).sum(axis=1), 1)
    deviation = np.abs(drag.matrix - mean[:, None, None] * np.eye(rigid.shape[1])) * inside
    uniform = np.max(deviation, axis=(1, 2)) <= UNIFORM * np.max(np.abs(drag.matrix), axis=(1, 2))
    kind[:, 1] = np.where(drag.coupled, 2, np.where(uniform, 0, 1))
    kind[:, 2] = np.where(drag.coupled, drag.held.sum(axis=1), 0)
    return kind


def _with_damping(base: Elastic, drag: _Damping, elastic: Array, rigid_at: Array, kind: int) -> Elastic:
    """Rows of one kind with their damping."""
    members, unit = len(base.rows), base.rate[:, None, None]
    inner = _take(drag.matrix, elastic, elastic) / unit
    if kind == 2:
        held = np.nonzero(drag.held)[1].reshape(members, -1)
        both = np.concatenate([elastic, held], axis=1)
        known = np.zeros((members, 2 * rigid_at.shape[1] - held.shape[1]))
        return replace(base, damping=inner, rigid_exponents=known, rigid_damping=_take(drag.matrix, held, both) / unit)
    # M r'' + C_rr r' = 0: each rigid coordinate has the exponents 0 and minus an eigenvalue of C_rr.
    decay = -np.linalg.eigvalsh(_take(drag.matrix, rigid_at, rigid_at)) if rigid_at.shape[1] else np.zeros((members, 0))
    decay = np.where(np.abs(decay) > drag.noise[:, None], decay, 0.0)
    exponents = np.concatenate([np.zeros_like(decay), decay], axis=1)
    if kind == 0:
        shift = 0.5 * np.einsum("rii->r", inner) / max(elastic.shape[1], 1)
        return replace(base, shift=shift, rigid_exponents=exponents)
    return replace(base, damping=inner, rigid_exponents=exponents)
