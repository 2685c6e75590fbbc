"""The first-order system of one row without its rigid-body motion.

In the modes of the mean system the state is x = (u, u', b): elastic coordinates, their velocities, and the velocities
of those rigid-body modes that damping couples back to the elastic ones. A rigid-body mode r deflects nothing,
K(t) r = 0, so that its position never enters; where no damping couples its velocity back the other multipliers are
exactly those of (u, u'), although friction may drive r: the monodromy matrix is block triangular.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.floquet.segments.reduction import rigid_modes
from gearstab.modal import mean_modes
from gearstab.system import Array, GearSystem

STILL = 1e-11
"""Damping of a rigid-body mode below this part of the largest one is rounding."""


@dataclass(frozen=True)
class Generator:
    """x' = [constant + sum_j f_j(t) parts_j] x of one row, time in units of 1/rate.

    constant: ``(m, m)``.  parts: ``(J, m, m)``, one a profile, in the order of :func:`profiles_of`.
    damped: whether anything dissipates or feeds through velocities.
    rigid_exponents: ``(k,)``, 1/time, those of rigid-body modes that are known beforehand.
    """

    constant: Array
    parts: Array
    rate: float
    damped: bool
    rigid_exponents: Array

    @property
    def rigid_growth(self) -> float:
        """1/time: the largest rate at which a rigid-body mode grows by itself; -inf where none does."""
        largest = float(self.rigid_exponents.max(initial=-np.inf))
        return largest if largest > 0 else -np.inf


@dataclass(frozen=True)
class _Modal:
    """Modal matrices of one row; each of ``parts`` is (kind, matrix), kind 0 for stiffness and 1 for damping."""

    stiffness: Array
    damping: Array
    parts: list[tuple[int, Array]]


def generators(system: GearSystem) -> list[Generator]:
    """Those of all rows of the flattened batch."""
    return [_generator(modal, rigid, float(rate)) for modal, rigid, rate in zip(*_modals(system), strict=True)]


def _modals(system: GearSystem) -> tuple[list[_Modal], Array, Array]:
    """Modal matrices, rigid-body modes of the meshes ``(rows, n)`` and rates ``(rows,)`` of all rows."""
    rows, n, full = system.rows, system.size, system.flat
    modes = mean_modes(system)
    shapes = full(modes.shapes, 2)
    back = np.swapaxes(shapes, -1, -2)
    squared = full(modes.squared_frequency, 1)
    deflection = np.swapaxes(full(modes.mesh_deflection, 2), -1, -2)
    rigid = rigid_modes(squared, deflection)
    rate = np.sqrt(np.maximum(np.abs(squared).mean(axis=-1), np.finfo(float).tiny))
    damping = np.zeros((rows, n, n)) if system.damping is None else back @ full(system.damping, 2) @ shapes
    static = back @ full(system.stiffness, 2) @ shapes
    outer = [(0, deflection[:, i, :, None] * deflection[:, i, None, :]) for i in range(len(system.meshes))]
    for term in system.terms:
        u, v = (np.einsum("rnp,rn->rp", shapes, full(end, 1)) for end in (term.left, term.right))
        kinds = [kind for kind, profile in enumerate((term.stiffness, term.damping)) if profile is not None]
        outer += [(kind, u[:, :, None] * v[:, None, :]) for kind in kinds]
    found = [_Modal(static[r], damping[r], [(kind, matrix[r]) for kind, matrix in outer]) for r in range(rows)]
    return found, rigid, rate


def free_rotations(system: GearSystem) -> Array:
    """``(rows, n)``: which modes of the mean system are rigid-body motion that no mesh and no term feels."""
    modals, rigid, _ = _modals(system)
    return np.array([_unfelt(modal, r) for modal, r in zip(modals, rigid, strict=True)])


def _unfelt(modal: _Modal, rigid: Array) -> Array:
    return np.asarray(rigid & ~_moved([matrix for kind, matrix in modal.parts if kind == 0], len(rigid)))


def _moved(matrices: list[Array], size: int) -> Array:
    """Which modes these matrices act on."""
    if not matrices:
        return np.zeros(size, dtype=bool)
    columns = np.max([np.abs(matrix).max(axis=0) for matrix in matrices], axis=0)
    return np.asarray(columns > STILL * columns.max(initial=0.0))


def _generator(modal: _Modal, rigid: Array, rate: float) -> Generator:
    rigid = _unfelt(modal, rigid)
    modal = _turned(modal, rigid)
    varying = [matrix for kind, matrix in modal.parts if kind == 1]
    drag = [modal.damping, *varying]
    elastic, held = np.flatnonzero(~rigid), np.flatnonzero(rigid & _moved(drag, len(rigid)))
    known = np.zeros(2 * int(rigid.sum()) - len(held))
    if not _felt(drag, elastic, held) and not _felt(varying, held, held):
        # Nothing feels these velocities, which decay, or grow, by themselves.
        own = -np.linalg.eigvals(modal.damping[np.ix_(held, held)]).real
        largest = np.abs(modal.damping).max(initial=0.0)
        known, held = np.append(known, np.where(np.abs(own) > STILL * largest, own, 0.0)), held[:0]
    n, k = len(elastic), len(held)
    velocities = np.concatenate([elastic, held])

    def state(kind: int, matrix: Array) -> Array:
        """-matrix where it acts: on positions (kind 0) or on velocities (kind 1)."""
        whole = np.zeros((2 * n + k, 2 * n + k))
        columns, at = (velocities, slice(n, None)) if kind else (elastic, slice(0, n))
        whole[n:, at] = -matrix[np.ix_(velocities, columns)] / rate ** (2 - kind)
        return whole

    constant = state(0, modal.stiffness) + state(1, modal.damping)
    constant[:n, n : 2 * n] = np.eye(n)
    parts = [state(kind, matrix) for kind, matrix in modal.parts]
    stacked = np.array(parts) if parts else np.zeros((0, *constant.shape))
    damped = any(np.any(matrix) for matrix in drag)
    return Generator(constant, stacked, rate, damped, known)


def _felt(drag: list[Array], rows: Array, columns: Array) -> bool:
    """Whether damping makes velocities ``columns`` act on ``rows``."""
    largest = max((float(np.abs(matrix).max(initial=0.0)) for matrix in drag), default=0.0)
    part = max((float(np.abs(matrix[np.ix_(rows, columns)]).max(initial=0.0)) for matrix in drag), default=0.0)
    return part > STILL * largest


def _turned(modal: _Modal, rigid: Array) -> _Modal:
    """The same with rigid-body modes such that as few as possible are damped."""
    loose = np.flatnonzero(rigid)
    if len(loose) < 2:
        return modal
    drag = [modal.damping, *(matrix for kind, matrix in modal.parts if kind == 1)]
    turn = np.eye(len(rigid))
    turn[np.ix_(loose, loose)] = np.linalg.svd(np.concatenate([m[:, loose] for m in drag]), full_matrices=False)[2].T
    parts = [(kind, turn.T @ matrix @ turn) for kind, matrix in modal.parts]
    return _Modal(turn.T @ modal.stiffness @ turn, turn.T @ modal.damping @ turn, parts)
