"""Contact of teeth in a report: at which speeds they would part, and how large the loads become."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.cli.report.facts import State
from gearstab.floquet.frequencies import AFFORDABLE, COMMON_PERIOD
from gearstab.system import Array, GearSystem

SPEEDS = 201
"""Speeds of a range at which steady states are computed."""
WORST = 3
"""Speeds at which teeth part that are named."""


@dataclass(frozen=True)
class ToothContact:
    """Loss of contact in the linear steady state.

    worst: up to WORST speeds at which teeth would part, the worst first. count, looked: at how many of how many speeds
    they do. load_factor: the largest. bound: whether all this comes from one frequency at a time, whose largest
    deviations add up.
    """

    worst: list[float]
    count: int
    looked: int
    load_factor: float
    bound: bool


def separation(state: State) -> ToothContact | None:
    """Judge whether teeth would part. None where nothing drives the system."""
    system = state.system
    if not system.forced:
        return None
    several = len(set(system.all_ratios)) > 1
    strategy = state.strategy
    long = strategy.period is None or strategy.period.segments > AFFORDABLE
    bound = several and (long or strategy.name != COMMON_PERIOD)
    parting: list[tuple[float, float]] = []
    count, looked, factor = 0, 0, 0.0
    for span in state.spans:
        omega = np.linspace(span.low, span.high, SPEEDS)
        factors, parts = (_bounded if bound else _exactly)(system, omega)
        count, looked, factor = count + int(parts.sum()), looked + len(omega), max(factor, float(factors.max()))
        parting += [(float(factors[k]), float(omega[k])) for k in _peaks(factors) if parts[k]]
    worst = [speed for _, speed in sorted(parting, reverse=True)[:WORST]]
    return ToothContact(worst, count, looked, factor, bound)


def _exactly(system: GearSystem, omega: Array) -> tuple[Array, Array]:
    """The largest load factor at every speed, and whether a loaded mesh's force changes its sign."""
    from gearstab.response.speeds import speed_response
    from gearstab.response.steady import STATUS_FLAGS

    found = speed_response(system, omega)
    factors = np.nan_to_num(np.nanmax(found.dynamic_load_factor[0].reshape(len(omega), -1), axis=1))
    return factors, (found.status[0] & STATUS_FLAGS["separation"]) != 0


def _bounded(system: GearSystem, omega: Array) -> tuple[Array, Array]:
    """The same by the bounds of one frequency at a time."""
    from gearstab.response.speeds import force_bounds

    found = force_bounds(system, omega)
    loaded = found.static[0] > 0
    return np.nanmax(np.nan_to_num(found.load_factor[0]), axis=1), np.any(loaded & (found.least[0] < 0), axis=1)


def _peaks(values: Array) -> list[int]:
    """Places of local maxima, ends included."""
    padded = np.concatenate([[-np.inf], values, [-np.inf]])
    return np.flatnonzero((padded[1:-1] >= padded[:-2]) & (padded[1:-1] > padded[2:])).tolist()
