"""The first-order system of one row without its rigid-body motion.

In the modes of the mean system the state is x = (u, u', b): elastic coordinates, their velocities, and the velocities
of those rigid-body modes that damping couples back to the elastic ones. A rigid-body mode r deflects nothing,
K(t) r = 0, so that its position never enters; where no damping couples its velocity back the other multipliers are
exactly those of (u, u'), although friction may drive r: the monodromy matrix is block triangular.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gearstab.propagation.first_order import UNDAMPED, FirstOrder, ModalMatrices, acted_on
from gearstab.system import Array, GearSystem


@dataclass(frozen=True)
class ElasticForm:
    """The first-order form of one row, but for rigid-body motion whose exponents are known beforehand.

    damped: whether anything dissipates or feeds through velocities; gyroscopic terms alone do not.
    rigid_exponents: ``(k,)``, 1/time, the known ones.
    elastic: ``(e,)``, the modes of the mean system that the coordinates u belong to.
    """

    form: FirstOrder
    damped: bool
    rigid_exponents: Array
    elastic: Array

    @property
    def size(self) -> int:
        """m."""
        return self.form.size

    @property
    def rate(self) -> float:
        """The unit of 1/time."""
        return float(self.form.rate[0])

    def at_speed(self, speed: float) -> ElasticForm:
        """Return the form at a speed, constant where it goes with the speed."""
        return replace(self, form=self.form.at_speeds(np.zeros(1, dtype=int), np.array([speed])))

    def generators(self, values: Array) -> Array:
        """A ``(..., m, m)`` for the values ``(..., J)`` of what varies."""
        return self.form.generator(values[..., None, :])[..., 0, :, :]

    @property
    def rigid_growth(self) -> float:
        """1/time: the largest rate at which a rigid-body mode grows by itself; -inf where none does."""
        largest = float(self.rigid_exponents.max(initial=-np.inf))
        return largest if largest > 0 else -np.inf


def elastic_forms(system: GearSystem) -> list[ElasticForm]:
    """Return the forms of all rows of the flattened batch."""
    modal = ModalMatrices.of(system)
    return [_elastic_form(modal, row) for row in range(system.rows)]


def free_rotations(system: GearSystem) -> Array:
    """``(rows, n)``: which modes of the mean system are rigid-body motion that no mesh and no term feels."""
    return _unfelt(ModalMatrices.of(system))


def _unfelt(modal: ModalMatrices) -> Array:
    return np.asarray(modal.rigid & ~acted_on([matrix for on_velocity, matrix in modal.parts if not on_velocity]))


def _elastic_form(modal: ModalMatrices, row: int) -> ElasticForm:
    rows = np.array([row])
    modal = modal.subset(rows)
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
    form = modal.form(rows, elastic, damped, np.ones((1, len(elastic))))
    return ElasticForm(form, _dissipates(modal), known, elastic)


def _dissipates(modal: ModalMatrices) -> bool:
    drag = [modal.damping, *(matrix for on_velocity, matrix in modal.parts if on_velocity)]
    size = max(float(np.abs(matrix).max(initial=0.0)) for matrix in modal.dissipative())
    power = (np.abs(matrix + np.swapaxes(matrix, -1, -2)).max(initial=0.0) for matrix in drag)
    return max(power) > UNDAMPED * size


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
    return modal.turned(turn)
