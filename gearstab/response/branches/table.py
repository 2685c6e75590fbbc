"""Branches as arrays: a row for each, its motions one after the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.response.branches.motions import BRANCH_FLAGS, KINDS, Branch
from gearstab.response.branches.solve import BranchSearch
from gearstab.system import Array


@dataclass(frozen=True)
class BranchTable:
    """The motions of B branches, each filled up to ``points`` (N).

    mesh_frequency: ``(B, N)``, or the value of the parameter that was followed;  period, parent: ``(B,)``.
    amplitude_rms, amplitude_peak: ``(B, N)``, of the mesh where each is largest.
    stable, event, multiplicity, loss, multiplier_error, residual: ``(B, N)``;  multipliers: ``(B, N, multipliers)``.
    transmission_error_rms, transmission_error_peak_to_peak, mesh_force_peak, contact_loss_ratio: ``(B, N, meshes)``.
    jump: ``(B, N)``, 1 where a stable motion ends in rising speed, -1 in falling.
    landing_branch, landing_point: ``(B, N)``, where the motion is next to the one that follows, -1 for nowhere.
    status: ``(B, N)``, bits of BRANCH_FLAGS.
    """

    mesh_frequency: Array
    amplitude_rms: Array
    amplitude_peak: Array
    stable: Array
    multipliers: Array
    multiplier_error: Array
    loss: Array
    event: Array
    multiplicity: Array
    period: Array
    parent: Array
    residual: Array
    mesh_force_peak: Array
    transmission_error_peak_to_peak: Array
    transmission_error_rms: Array
    contact_loss_ratio: Array
    jump: Array
    landing_branch: Array
    landing_point: Array
    status: Array


BY_MESH = {
    "transmission_error_rms": "rms", "transmission_error_peak_to_peak": "peak_to_peak",
    "mesh_force_peak": "force_peak", "contact_loss_ratio": "contact_loss",
}  # fmt: skip
"""Variables of every mesh, and the measures of a motion that they are."""


def table(search: BranchSearch, count: int, points: int, multipliers: int, meshes: int) -> BranchTable:
    """Arrange what was found of a system of so many meshes, in so many rows at least.

    multipliers: columns for them, as many as there are.
    """
    shape = max(count, len(search.found)), points
    found: dict[str, Array] = {name: np.full(shape, np.nan) for name in (
        "mesh_frequency", "amplitude_rms", "amplitude_peak", "multiplier_error", "residual")}  # fmt: skip
    found |= {name: np.full(shape, -1) for name in ("stable", "landing_branch", "landing_point")}
    found |= {name: np.zeros(shape, dtype=int) for name in ("event", "multiplicity", "loss", "jump", "status")}
    found |= {name: np.full((*shape, meshes), np.nan) for name in BY_MESH}
    found["multipliers"] = np.full((*shape, multipliers), np.nan, dtype=complex)
    found |= {"period": np.zeros(shape[0], dtype=int), "parent": np.full(shape[0], -1)}
    cycles = round(search.laps.at(search.limits.low).model.motion.drive.counts[0])
    for number, branch in enumerate(search.found):
        found["period"][number], found["parent"][number] = branch.periods * cycles, branch.parent
        _enter({name: values[number] for name, values in found.items()}, branch)
    for place, (sign, landing) in search.jumps.items():
        found["jump"][place] = sign
        if landing is not None:
            found["landing_branch"][place], found["landing_point"][place] = landing
    return BranchTable(**found)


def _enter(row: dict[str, Array], branch: Branch) -> None:
    """Write the motions of a branch into its row."""
    for k, motion in enumerate(branch.motions):
        own = motion.stability
        row["mesh_frequency"][k], row["event"][k], row["multiplicity"][k] = (
            motion.parameter, KINDS[motion.kind], motion.multiplicity,
        )  # fmt: skip
        row["stable"][k], row["loss"][k] = own.stable, own.loss
        row["multiplier_error"][k], row["residual"][k] = own.error, own.residual
        row["multipliers"][k, : len(own.multipliers)] = own.multipliers
        row["amplitude_rms"][k], row["amplitude_peak"][k] = motion.cycle.rms.max(), motion.cycle.peak.max()
        row["status"][k] = BRANCH_FLAGS["grazing"] * motion.grazing
        for name, measure in BY_MESH.items():
            row[name][k] = getattr(motion.cycle, measure)
    row["status"][0] |= BRANCH_FLAGS[branch.ends[0]]
    row["status"][len(branch.motions) - 1] |= BRANCH_FLAGS[branch.ends[1]]
