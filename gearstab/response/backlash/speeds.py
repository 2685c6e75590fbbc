"""Limit cycles over speed: a run-up or a run-down, every mesh frequency from where the one before has led."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.floquet import solve
from gearstab.modal import mean_modes, static_mesh_force
from gearstab.propagation.first_order import bases
from gearstab.response.backlash.contact import resting
from gearstab.response.backlash.history import BACKLASH_FLAGS, Recording
from gearstab.response.backlash.measure import LimitCycle, Meter, elastic
from gearstab.response.branches.sections import SectionMap
from gearstab.response.branches.stability import MotionStability, of_settled
from gearstab.response.driven import driven
from gearstab.response.steady import unbalanced
from gearstab.system import Array, GearSystem

FAILED = BACKLASH_FLAGS["chatter"] | BACKLASH_FLAGS["overflow"]
SETTLED = BACKLASH_FLAGS["separation"]
"""Flag of the settled motion only."""


@dataclass(frozen=True)
class SpeedCycles:
    """Settled motion at every mesh frequency, ``(P, meshes)`` or ``(P,)``; see LimitCycle.

    dynamic_load_factor: mesh_force_peak over the static mesh force; NaN where that is 0.
    multiplier_real, multiplier_imag: ``(P, 2 n)``, of the periodic motion, descending in magnitude; NaN for no more.
    multiplier_error: an estimate;  motion_stable: 1 stable, 0 unstable, -1 where no periodic motion is near.
    loss: of stability, as in :mod:`gearstab.response.branches.stability`.
    status: bits of BACKLASH_FLAGS.
    """

    mesh_force_peak: Array
    transmission_error_peak_to_peak: Array
    transmission_error_rms: Array
    dynamic_load_factor: Array
    contact_loss_ratio: Array
    period: Array
    multiplier_real: Array
    multiplier_imag: Array
    multiplier_error: Array
    motion_stable: Array
    loss: Array
    status: Array


def speed_cycles(
    system: GearSystem,
    mesh_frequency: Array,
    down: bool = False,
    cycles: float = 200,
    discard: float | None = None,
    tolerance: float = 1e-12,
) -> SpeedCycles:
    """Limit cycles by continuation in the mesh frequency.

    The first motion begins in static equilibrium, every other one in the last state of the one before: where several
    motions are stable, a run-up and a run-down may show different ones. The part of the load that would accelerate the
    train as a whole is left out.

    Parameters
    ----------
    system: a single system (no batch) of which a mesh has backlash.
    mesh_frequency: ``(P,)``, positive, in any order.
    down: from the largest frequency to the smallest one.
    cycles, discard: of the first mesh, at every frequency, rounded up to whole common periods; of the former, the
        latter (default half) are left for the motion to settle.
    tolerance: of the motion where functions vary smoothly, relative, in a piece of it.

    Raises ValueError as :func:`~gearstab.response.backlash.history.backlash_response`.
    """
    omega = np.asarray(mesh_frequency, dtype=float)
    laps, rest = SectionMap(system), np.zeros(system.size)
    equilibrium = resting(system, laps.teeth)
    first = driven(system, omega[0])
    flags = BACKLASH_FLAGS["unbalanced"] * bool(unbalanced(first.drive, next(bases(system)))[0])
    growth = np.ravel(solve(system.undriven(), omega).growth_rate)
    per_period = first.drive.counts[0]
    # Whole periods, but for rounding.
    left_out = int(np.ceil((0.5 * cycles if discard is None else discard) / per_period - 1e-9))
    periods = max(int(np.ceil(cycles / per_period - 1e-9)), left_out + 1)
    found: list[LimitCycle | None] = [None] * len(omega)
    stabilities: list[MotionStability | None] = [None] * len(omega)
    status = np.where(growth > 0, BACKLASH_FLAGS["unstable"], 0) | flags
    start = equilibrium, rest
    for k in np.argsort(-omega if down else omega, kind="stable"):
        model = laps.at(float(omega[k])).model
        period = model.motion.period
        run = Recording(model, 1, periods + 1, Meter(model, left_out * period, periods * period))
        run.follow(model.motion.state(*start), tolerance)
        status[k] |= run.flags & ~SETTLED
        if run.flags & FAILED:
            start = equilibrium, rest
            continue
        cycle = found[k] = run.meter.summary(periods)
        if cycle is not None and cycle.contact_loss.any():
            status[k] |= BACKLASH_FLAGS["separation"]
        if cycle is not None and cycle.period:
            stabilities[k] = of_settled(laps, run.x[-1][elastic(model)], float(omega[k]), cycle.period)
        q, v = model.motion.physical(run.x[-1])
        start = _elastic(system, q), v
    return _table(found, _multipliers(stabilities, 2 * system.size), status, static_mesh_force(system))


def _multipliers(found: list[MotionStability | None], most: int) -> dict[str, Array]:
    """Stability in SpeedCycles; most: multipliers."""
    values = np.full((len(found), most), np.nan, dtype=complex)
    for k, one in enumerate(found):
        if one is not None:
            values[k, : len(one.multipliers)] = one.multipliers
    return {
        "multiplier_real": values.real, "multiplier_imag": values.imag,
        "multiplier_error": np.array([np.nan if one is None else one.error for one in found]),
        "motion_stable": np.array([-1 if one is None else one.stable for one in found], dtype=np.int8),
        "loss": np.array([0 if one is None else one.loss for one in found], dtype=np.int8),
    }  # fmt: skip


def _elastic(system: GearSystem, q: Array) -> Array:
    """Without rigid-body motion, which deflects nothing and would grow from speed to speed."""
    modes = mean_modes(system)
    rigid = modes.shapes[:, modes.rigid]
    return np.asarray(q - rigid @ (rigid.T @ (np.asarray(system.mass) @ q)))


def _table(found: list[LimitCycle | None], multipliers: dict[str, Array], status: Array, static: Array) -> SpeedCycles:
    nothing = np.full(static.shape, np.nan)

    def column(name: str) -> Array:
        return np.stack([nothing if cycle is None else getattr(cycle, name) for cycle in found])

    force = column("force_peak")
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.where(static != 0, force / np.abs(static), np.nan)
    period = np.array([0 if cycle is None else cycle.period for cycle in found])
    return SpeedCycles(
        force, column("peak_to_peak"), column("rms"), factor, column("contact_loss"), period, **multipliers,
        status=status.astype(np.int16),
    )  # fmt: skip
