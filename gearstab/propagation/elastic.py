"""The first-order system of rows without their rigid-body motion.

In the modes of the mean system the state is x = (u, u', b): elastic coordinates, their velocities, and the velocities
of those rigid-body modes that damping couples back to the elastic ones. A rigid-body mode r deflects nothing,
K(t) r = 0, so that its position never enters; where no damping couples its velocity back the other multipliers are
exactly those of (u, u'), although friction may drive r: the monodromy matrix is block triangular.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gearstab.grouping import equal_rows
from gearstab.propagation.first_order import UNDAMPED, FirstOrder, ModalMatrices, acted_on
from gearstab.system import Array, GearSystem
from gearstab.waveforms.base import harmonic


@dataclass(frozen=True)
class ElasticRows:
    """Rows of equally many coordinates of each sort, but for rigid-body motion whose exponents are known beforehand.

    form: their first-order form. damped: ``(r,)`` bool, whether anything dissipates or feeds through velocities;
    gyroscopic terms alone do not. rigid_exponents: ``(r, k)``, 1/time, the known ones. elastic: ``(e,)``, the modes of
    the mean system that the coordinates u belong to.
    """

    form: FirstOrder
    damped: Array
    rigid_exponents: Array
    elastic: Array

    def subset(self, index: Array) -> ElasticRows:
        """Some of the rows, by position."""
        return ElasticRows(self.form.subset(index), self.damped[index], self.rigid_exponents[index], self.elastic)


def elastic_rows(system: GearSystem) -> Iterator[ElasticRows]:
    """All rows of the flattened batch, each once."""
    modal = ModalMatrices.of(system)
    rigid = _unfelt(modal)
    for members, key in equal_rows(rigid.astype(int)):
        free = np.flatnonzero(key)
        own = _turned(modal.subset(members), free)
        drag = own.dissipative()
        damped = rigid[members] & acted_on(drag)
        felt = _coupled(drag, ~rigid[members], damped) | _coupled(drag[1:], damped, damped)
        for index, sort in equal_rows(np.column_stack([damped, felt]).astype(int)):
            part = own.subset(index)
            yield _elastic_rows(part, members[index], key > 0, np.flatnonzero(sort[:-1]), bool(sort[-1]))


def single_rows(system: GearSystem) -> list[ElasticRows]:
    """Return all rows of the flattened batch, each by itself."""
    found = {int(r): own.subset(np.array([k])) for own in elastic_rows(system) for k, r in enumerate(own.form.rows)}
    return [found[r] for r in range(system.rows)]


def mean_levels(system: GearSystem) -> Array:
    """``(rows, J)``, the means of all that varies: of the meshes' stiffnesses, then of the terms' profiles."""
    levels = [system.flat(mesh.mean_stiffness) for mesh in system.meshes]
    profiles = [profile for term in system.terms for profile in term.profiles]
    levels += [system.flat(harmonic(profile, 0).real) for profile in profiles]
    return np.stack(levels, axis=-1)


def free_rotations(system: GearSystem) -> Array:
    """``(rows, n)``: which modes of the mean system are rigid-body motion that no mesh and no term feels."""
    return _unfelt(ModalMatrices.of(system))


def _unfelt(modal: ModalMatrices) -> Array:
    return np.asarray(modal.rigid & ~acted_on([matrix for on_velocity, matrix in modal.parts if not on_velocity]))


def _elastic_rows(modal: ModalMatrices, rows: Array, rigid: Array, damped: Array, felt: bool) -> ElasticRows:
    """Rows with the same rigid-body modes ``(n,)``, of which the modes ``damped`` (k,) are damped.

    felt: whether their velocities act on anything else, or on each other by what is not damping alone.
    """
    elastic = np.flatnonzero(~rigid)
    known = np.zeros((len(rows), 2 * int(rigid.sum()) - len(damped)))
    if not felt:
        # Nothing feels these velocities, which decay, or grow, by themselves.
        own = -np.linalg.eigvals(modal.damping[:, damped[:, None], damped]).real
        largest = np.abs(modal.damping).max(axis=(1, 2), initial=0.0)[:, None]
        known = np.concatenate([known, np.where(np.abs(own) > UNDAMPED * largest, own, 0.0)], axis=1)
        damped = damped[:0]
    form = modal.form(rows, elastic, damped, np.ones((len(rows), len(elastic))))
    return ElasticRows(form, _dissipates(modal), known, elastic)


def _dissipates(modal: ModalMatrices) -> Array:
    """``(r,)``."""
    drag = [modal.damping, *(matrix for on_velocity, matrix in modal.parts if on_velocity)]
    size = np.max([_largest(matrix) for matrix in modal.dissipative()], axis=0)
    power = np.max([_largest(matrix + np.swapaxes(matrix, -1, -2)) for matrix in drag], axis=0)
    return np.asarray(power > UNDAMPED * size)


def _coupled(drag: list[Array], rows: Array, columns: Array) -> Array:
    """``(r,)``: whether matrices ``(r, n, n)`` make velocities ``columns`` act on ``rows``, ``(r, n)`` bool both."""
    if not drag:
        return np.zeros(len(rows), dtype=bool)
    there = rows[:, :, None] & columns[:, None, :]
    parts = np.max([_largest(matrix * there) for matrix in drag], axis=0)
    return np.asarray(parts > UNDAMPED * np.max([_largest(matrix) for matrix in drag], axis=0))


def _largest(matrix: Array) -> Array:
    return np.asarray(np.abs(matrix).max(axis=(1, 2), initial=0.0))


def _turned(modal: ModalMatrices, rigid: Array) -> ModalMatrices:
    """The same with its modes ``rigid`` turned so that as few of them as possible are damped."""
    if len(rigid) < 2:
        return modal
    turn = np.broadcast_to(np.eye(modal.rigid.shape[1]), modal.damping.shape).copy()
    drag = np.concatenate([matrix[:, :, rigid] for matrix in modal.dissipative()], axis=1)
    own = np.linalg.svd(drag, full_matrices=False)[2]
    turn[:, rigid[:, None], rigid] = np.swapaxes(own, -1, -2)
    return modal.turned(turn)
