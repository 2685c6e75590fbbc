"""The first-order system of one row without its rigid-body motion.

In the modes of the mean system the state is x = (u, u', b): elastic coordinates, their velocities, and the velocities
of those rigid-body modes that damping couples back to the elastic ones. A rigid-body mode r deflects nothing,
K(t) r = 0, so that its position never enters; where no damping couples its velocity back the other multipliers are
exactly those of (u, u'), although friction may drive r: the monodromy matrix is block triangular.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gearstab.propagation.first_order import UNDAMPED, ModalMatrices, acted_on
from gearstab.system import Array, GearSystem


@dataclass(frozen=True)
class Generator:
    """x' = [constant + sum_j f_j(t) parts_j] x of one row, time in units of 1/rate.

    constant: ``(m, m)``.  parts: ``(J, m, m)``, of the meshes, then of the terms' profiles.
    damped: whether anything dissipates or feeds through velocities.
    rigid_exponents: ``(k,)``, 1/time, those of rigid-body modes that are known beforehand.
    elastic: ``(e,)``, the modes of the mean system that the coordinates u belong to.
    """

    constant: Array
    parts: Array
    rate: float
    damped: bool
    rigid_exponents: Array
    elastic: Array

    @property
    def rigid_growth(self) -> float:
        """1/time: the largest rate at which a rigid-body mode grows by itself; -inf where none does."""
        largest = float(self.rigid_exponents.max(initial=-np.inf))
        return largest if largest > 0 else -np.inf


def generators(system: GearSystem) -> list[Generator]:
    """Those of all rows of the flattened batch."""
    modal = ModalMatrices.of(system)
    return [_generator(modal.subset(np.array([row]))) for row in range(system.rows)]


def free_rotations(system: GearSystem) -> Array:
    """``(rows, n)``: which modes of the mean system are rigid-body motion that no mesh and no term feels."""
    return _unfelt(ModalMatrices.of(system))


def _unfelt(modal: ModalMatrices) -> Array:
    return np.asarray(modal.rigid & ~acted_on([matrix for on_velocity, matrix in modal.parts if not on_velocity]))


def _generator(modal: ModalMatrices) -> Generator:
    """That of a single row."""
    rigid = _unfelt(modal)[0]
    modal = _turned(modal, np.flatnonzero(rigid))
    drag = modal.dissipative()
    elastic, damped = np.flatnonzero(~rigid), np.flatnonzero(rigid & acted_on(drag)[0])
    known = np.zeros(2 * int(rigid.sum()) - len(damped))
    if not _coupled(drag, elastic, damped) and not _coupled(drag[1:], damped, damped):
        # Nothing feels these velocities, which decay, or grow, by themselves.
        own = -np.linalg.eigvals(modal.damping[0][np.ix_(damped, damped)]).real
        largest = np.abs(modal.damping).max(initial=0.0)
        known, damped = np.append(known, np.where(np.abs(own) > UNDAMPED * largest, own, 0.0)), damped[:0]
    constant, parts = modal.generator(elastic, damped, np.ones((1, len(elastic))))
    dissipates = any(np.any(matrix) for matrix in drag)
    return Generator(constant[0], parts[0], float(modal.rate[0]), dissipates, known, elastic)


def _coupled(drag: list[Array], rows: Array, columns: Array) -> bool:
    """Whether damping makes velocities ``columns`` act on ``rows``."""
    largest = max((float(np.abs(matrix).max(initial=0.0)) for matrix in drag), default=0.0)
    parts = (matrix[0][np.ix_(rows, columns)] for matrix in drag)
    return max((float(np.abs(part).max(initial=0.0)) for part in parts), default=0.0) > UNDAMPED * largest


def _turned(modal: ModalMatrices, rigid: Array) -> ModalMatrices:
    """The same with its modes ``rigid`` turned so that as few of them as possible are damped."""
    if len(rigid) < 2:
        return modal
    turn = np.eye(modal.rigid.shape[1])
    drag = np.concatenate([matrix[0][:, rigid] for matrix in modal.dissipative()])
    turn[np.ix_(rigid, rigid)] = np.linalg.svd(drag, full_matrices=False)[2].T
    parts = [(on_velocity, turn.T @ matrix @ turn) for on_velocity, matrix in modal.parts]
    return replace(modal, static=turn.T @ modal.static @ turn, damping=turn.T @ modal.damping @ turn, parts=parts)
