"""Branches as arrays: their motions one after the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.response.branches.motions import BRANCH_FLAGS, KINDS
from gearstab.response.branches.solve import BranchSearch
from gearstab.system import Array


@dataclass(frozen=True)
class BranchTable:
    """The motions of all branches one after the other, filled up to ``points`` (N).

    branch, parent: ``(N,)``, numbers, -1 for none;  branch_frequency: ``(N,)``.
    period, kind, multiplicity: ``(N,)``;  motion_stable, loss, multiplier_error, residual: ``(N,)``.
    multiplier_real, multiplier_imag: ``(N, multipliers)``.
    transmission_error_rms, transmission_error_peak_to_peak, mesh_force_peak, contact_loss_ratio: ``(N, meshes)``.
    jump: ``(N,)``, 1 where a stable motion ends in rising speed, -1 in falling;  landing: ``(N,)``, the place of a
        motion next to the one that follows, -1 for none.
    status: ``(N,)``, bits of BRANCH_FLAGS.
    """

    branch: Array
    parent: Array
    branch_frequency: Array
    period: Array
    kind: Array
    multiplicity: Array
    motion_stable: Array
    loss: Array
    multiplier_error: Array
    residual: Array
    multiplier_real: Array
    multiplier_imag: Array
    transmission_error_rms: Array
    transmission_error_peak_to_peak: Array
    mesh_force_peak: Array
    contact_loss_ratio: Array
    jump: Array
    landing: Array
    status: Array


def table(search: BranchSearch, points: int, multipliers: int, meshes: int) -> BranchTable:
    """Arrange what was found of a system of so many meshes; multipliers: columns for them, as many as there are."""
    branches = search.found
    rows = [(k, branch, motion) for k, branch in enumerate(branches) for motion in branch.motions]

    def filled(values: list[float] | list[int], missing: float) -> Array:
        return np.array([*values, *[missing] * (points - len(values))])

    def by_mesh(name: str) -> Array:
        found = np.full((points, meshes), np.nan)
        for place, (_, _, motion) in enumerate(rows):
            found[place] = getattr(motion.cycle, name)
        return found

    values = np.full((points, multipliers), np.nan, dtype=complex)
    status, place = np.zeros(points, dtype=np.int16), 0
    for k, (_, _, motion) in enumerate(rows):
        values[k, : len(motion.stability.multipliers)] = motion.stability.multipliers
        status[k] = BRANCH_FLAGS["grazing"] * motion.grazing
    for branch in branches:
        status[place] |= BRANCH_FLAGS[branch.ends[0]]
        place += len(branch.motions)
        status[place - 1] |= BRANCH_FLAGS[branch.ends[1]]
    first = np.cumsum([0, *(len(branch.motions) for branch in branches)])
    jump, landing = np.zeros(points, dtype=np.int8), np.full(points, -1)
    for (number, k), (sign, where) in search.jumps.items():
        jump[first[number] + k] = sign
        if where is not None:
            landing[first[number] + k] = first[where[0]] + where[1]
    return BranchTable(
        branch=filled([k for k, _, _ in rows], -1), parent=filled([branch.parent for _, branch, _ in rows], -1),
        branch_frequency=filled([motion.parameter for _, _, motion in rows], np.nan),
        period=filled([branch.periods for _, branch, _ in rows], 0),
        kind=filled([KINDS[motion.kind] for _, _, motion in rows], 0),
        multiplicity=filled([motion.multiplicity for _, _, motion in rows], 0),
        motion_stable=filled([int(motion.stability.stable) for _, _, motion in rows], -1),
        loss=filled([motion.stability.loss for _, _, motion in rows], 0),
        multiplier_error=filled([motion.stability.error for _, _, motion in rows], np.nan),
        residual=filled([motion.stability.residual for _, _, motion in rows], np.nan),
        multiplier_real=values.real, multiplier_imag=values.imag,
        transmission_error_rms=by_mesh("rms"), transmission_error_peak_to_peak=by_mesh("peak_to_peak"),
        mesh_force_peak=by_mesh("force_peak"), contact_loss_ratio=by_mesh("contact_loss"),
        jump=jump, landing=landing, status=status,
    )  # fmt: skip
