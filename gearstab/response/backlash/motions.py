"""Periodic motions with loss of contact: their stability, as points of a branch, and what motions settle to over speed.

A run-up or a run-down begins at every mesh frequency where the motion at the one before has led.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gearstab.floquet import solve
from gearstab.modal import mean_modes, static_mesh_force
from gearstab.propagation.first_order import bases
from gearstab.response.backlash.continuation import BRANCHING, DOUBLING, FOLD, NEIMARK_SACKER, Curve, NoPoint
from gearstab.response.backlash.dynamics import resting
from gearstab.response.backlash.history import BACKLASH_FLAGS, LimitCycle, Meter, Recording, elastic
from gearstab.response.backlash.sections import Lap, SectionMap
from gearstab.response.steady import driven, unbalanced
from gearstab.system import Array, GearSystem

LOSSES = {"none": 0, "fold": 1, "period_doubling": 2, "neimark_sacker": 3}
"""Kind of stability loss by the multiplier of the largest magnitude: it is 1, -1 or one of a pair where stability is
lost."""
NEAR = 1e-3
"""Part of its extent by which a motion may move when it is made periodic."""


@dataclass(frozen=True)
class MotionStability:
    """Stability of a periodic motion.

    multipliers: ``(m,)`` complex, of descending magnitude;  error: an estimate for them.
    loss: a value of LOSSES, of what is lost, or would be first;  residual: of the motion, relative to its extent.
    """

    multipliers: Array
    error: float
    loss: int
    residual: float

    @property
    def stable(self) -> bool:
        """Whether all multipliers are inside of the unit circle."""
        return bool(np.all(np.abs(self.multipliers) < 1))


def stability(laps: SectionMap, lap: Lap, omega: float) -> MotionStability:
    """The stability of a motion that ends, but for rounding, where it begins."""
    values = lap.multipliers
    extent = float(np.abs(lap.start).max(initial=0.0)) or 1.0
    residual = float(np.abs(lap.end - lap.start).max(initial=0.0)) / extent
    error = lap.multiplier_error(laps.lap(lap.end, omega, lap.periods))
    return MotionStability(values, error, loss_of(values), residual)


def loss_of(multipliers: Array) -> int:
    """The value of LOSSES by multipliers of descending magnitude."""
    if not len(multipliers):
        return LOSSES["none"]
    first = multipliers[0]
    if first.imag != 0:
        return LOSSES["neimark_sacker"]
    return LOSSES["fold" if first.real > 0 else "period_doubling"]


def of_settled(laps: SectionMap, x: Array, omega: float, periods: int) -> MotionStability | None:
    """The stability of the periodic motion that the elastic state x has come near to; None where there is none."""
    extent = float(np.abs(x).max(initial=0.0)) or 1.0
    try:
        point = Curve(lambda x, omega: laps.lap(x, omega, periods), extent, 1.0).at(x, omega)
    except NoPoint:
        return None
    lap = point.visit
    assert isinstance(lap, Lap)
    if np.abs(point.x - x).max(initial=0.0) > NEAR * extent:
        return None
    return stability(laps, lap, omega)


GRAZING = "grazing"
MOST_BRANCHES = 32
"""Branches of a system, at most."""
KINDS = {"none": 0, FOLD: 1, DOUBLING: 2, NEIMARK_SACKER: 3, GRAZING: 4, BRANCHING: 5}
"""Events of motions: what crosses the unit circle; the first of a doubled branch, up to which motions are linear."""
BRANCH_FLAGS = {
    "range_end": 1, "closed": 2, "unbounded": 4, "more_points": 8, "step_failed": 16, "linear_motions": 32,
    "doubling": 64, "branch_point": 128, "grazing": BACKLASH_FLAGS["grazing"],
}  # fmt: skip
"""Bits of ``status``: why a branch ends at a motion, at an end of the range, where it began, or beyond the amplitude
limit; as so many points were asked for; as no step was short enough; at linear motions of any amplitude; at the
doubling or branch point that it leaves from. ``grazing``: a flank is hardly touched or missed."""


@dataclass(frozen=True)
class BranchMotion:
    """A point of a branch. x, parameter, kind, multiplicity, vector: as there.  grazing: a flank is hardly touched."""

    x: Array
    parameter: float
    kind: str
    multiplicity: int
    vector: Array | None
    stability: MotionStability
    cycle: LimitCycle
    grazing: bool


@dataclass(frozen=True)
class Branch:
    """Periodic motions along a curve.

    motions: in its order;  periods: common periods of each.
    parent, leaves: the branch that it leaves and the number of the motion there, -1 for none.
    ends: why it ends at the first and the last, of BRANCH_FLAGS.
    """

    motions: tuple[BranchMotion, ...]
    periods: int
    ends: tuple[str, str]
    parent: int = -1
    leaves: int = -1

    def between(self, parameter: float) -> Iterator[tuple[int, Array, float]]:
        """Where the branch passes a parameter: the motion next to it, the state ``(m,)`` there by a straight line, and
        the step between the motions on both sides.
        """
        for k, (one, other) in enumerate(pairwise(self.motions)):
            if (one.parameter - parameter) * (other.parameter - parameter) <= 0:
                part = (parameter - one.parameter) / (other.parameter - one.parameter or 1.0)
                step = other.x - one.x
                yield k + round(part), one.x + part * step, float(np.abs(step).max(initial=0.0))


FAILED = BACKLASH_FLAGS["chatter"] | BACKLASH_FLAGS["overflow"]
SETTLED = BACKLASH_FLAGS["separation"]
"""Flag of the settled motion only."""
BY_MESH = {
    "transmission_error_rms": "rms", "transmission_error_peak_to_peak": "peak_to_peak",
    "mesh_force_peak": "force_peak", "contact_loss_ratio": "contact_loss",
}  # fmt: skip
"""Variables of every mesh, and the measures of a motion that they are."""


def speed_cycles(
    system: GearSystem,
    mesh_frequency: Array,
    down: bool = False,
    cycles: float = 200,
    discard: float | None = None,
) -> dict[str, Array]:
    """Limit cycles by continuation in the mesh frequency: measures of the settled motion, by variable.

    Those of BY_MESH: ``(P, meshes)``. dynamic_load_factor: mesh_force_peak over the static mesh force, NaN where that
    is 0. multiplier_real, multiplier_imag: ``(P, 2 n)``, of the periodic motion, descending in magnitude, NaN for no
    more; multiplier_error: an estimate. motion_stable: 1 stable, 0 unstable, -1 where no periodic motion is near. loss:
    of LOSSES. status: bits of BACKLASH_FLAGS.

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
        run.follow(model.motion.state(*start))
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
    """Variables of the stability; most: multipliers."""
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


def _table(
    found: list[LimitCycle | None], multipliers: dict[str, Array], status: Array, static: Array
) -> dict[str, Array]:
    nothing = np.full(static.shape, np.nan)

    def column(name: str) -> Array:
        return np.stack([nothing if cycle is None else getattr(cycle, name) for cycle in found])

    table = {name: column(measure) for name, measure in BY_MESH.items()}
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.where(static != 0, table["mesh_force_peak"] / np.abs(static), np.nan)
    period = np.array([0 if cycle is None else cycle.period for cycle in found])
    own = {"dynamic_load_factor": factor, "period": period, "status": status.astype(np.int16)}
    return {**table, **own, **multipliers}
