"""How long a response takes, roughly: said beforehand where that is long."""

from __future__ import annotations

from math import ceil, tau

import numpy as np

from gearstab.modal import mean_modes
from gearstab.propagation.path import Path
from gearstab.response.backlash.dynamics import REACH
from gearstab.response.history import equation_of
from gearstab.response.panels import NODES
from gearstab.response.spectra import MOST_PANELS
from gearstab.response.steady import FEW, FEWEST, MAPS, driven
from gearstab.response.steady import REACH as REACH_OF_STEPS
from gearstab.system import GearSystem

LONG = 20.0
"""Seconds from which on it is said."""
PIECE = 2e-6
"""Seconds of a piece of a motion with backlash; measured on two coordinates."""
ENTRY = 2e-8
"""Seconds of an entry of its generator."""
NORM = 1.2
"""|G| over the fastest frequency, about."""

MAP, MAP_CUBE, STATE, NUMBER = 7e-5, 9e-10, 5e-6, 2.5e-8
"""Seconds of the map over an interval with m states, and of each m^3; of a state that it gives; of a number kept."""
ENTRY_OF_MAP = 1e-9
"""Cost of an entry of a map that is applied to a state of many periods."""
STEP, STEP_CUBE, DOUBLED = 4e-5, 4e-8, 14
"""The same of a step where functions vary smoothly; and how many such steps are taken for one that is sought first."""
SLOPE, SLOPE_SQUARE, SLOPES = 3e-5, 2e-9, 40
"""Cost of a slope of a single motion through smooth functions, each m^2; slopes in a vibration of the fastest mode."""
PRODUCT = 1e-9
"""Cost of a term of a Fourier integral."""
SHARE = 8e-6
"""Cost of a sample whose mesh force is shared out among the teeth."""
RAMP, RAMP_SQUARE, RAMP_CUBE = 8e-6, 2e-9, 3e-9
"""Cost of a step of a run-up with m states, each m^2; with functions that vary smoothly each m^3 instead."""


def motion_with_backlash(system: GearSystem, duration: float) -> str | None:
    """Say how long it takes to follow one for so long, and why; None where that is soon done.

    Pieces are as short as the stiffest part asks for, |G| t <= REACH, whether it vibrates or not.
    """
    fastest = _fastest(system)
    pieces = NORM * duration * fastest / REACH
    seconds = pieces * (PIECE + ENTRY * (2 * system.size + 1) ** 2)
    return warning(seconds, f"the fastest mode vibrates {duration * fastest / tau:.2g} times meanwhile")


def warning(seconds: float, why: str) -> str | None:
    """Return the warning before so much work; None below LONG."""
    if seconds < LONG:
        return None
    text = f"{seconds:.0f} seconds" if seconds < 120 else f"{seconds / 60:,.0f} minutes"
    return f"this takes some {text if seconds < 7200 else f'{seconds / 3600:,.0f} hours'}: {why}"


def _fastest(system: GearSystem) -> float:
    """The largest natural frequency."""
    return float(np.sqrt(np.abs(mean_modes(system).squared_frequency).max()))


def linear_motion(
    system: GearSystem, mesh_frequency: float, duration: float, samples: int, order: int = 0, teeth: int = 0
) -> str | None:
    """The same of a motion without backlash, or of a steady state and its harmonics up to ``order``.

    samples: in a cycle of the first mesh. teeth: number of meshes whose force is shared out among teeth.
    """
    motion = driven(system, mesh_frequency)
    drive, m, intervals = motion.drive, motion.basis.size, len(motion.points.equation.occupied)
    grid = drive.counts[0] * samples
    every = duration / motion.period * grid + 1
    periods = max(1, ceil((every - 1) / grid * (1 - 1e-12)))
    turns = _fastest(system) * motion.period / tau
    seconds = every * ((m + 3 * len(system.meshes)) * NUMBER + teeth * SHARE)
    single = periods * MAPS <= m**3
    if drive.exact:
        # Few periods are followed from sample to sample; of many, the map to each sample serves all.
        maps = intervals * (1 + 2 * periods) if periods <= FEW else grid + intervals
        each = STATE if periods <= FEW else m**2 * ENTRY_OF_MAP
        seconds += maps * (MAP + MAP_CUBE * m**3) + every * each
    elif single:
        seconds += periods * (intervals + turns) * SLOPES * (SLOPE + SLOPE_SQUARE * m**2)
    if not drive.exact and (order or not single):
        sought = max(FEWEST * intervals, tau * turns / REACH_OF_STEPS) * DOUBLED
        steps = sought * (not single) + sought * 2 * bool(order) + grid * (not single)
        seconds += steps * (STEP + STEP_CUBE * (m + 2) ** 3)
    if order:
        nodes = (min(tau * max(order, turns), MOST_PANELS) + intervals) * len(NODES)
        seconds += nodes * (STATE + order * len(system.meshes) * PRODUCT)
    return warning(seconds, f"{every:,.0f} samples, and {intervals:,} intervals between jumps in a common period")


def run_up(system: GearSystem, path: Path, samples: float) -> str | None:
    """The same of a run-up or coast-down along a path of the mesh frequency."""
    equation = equation_of(system)
    m, jumps = equation.form.size, float(path.phase[-1]) / equation.period * (len(equation.borders) - 1)
    steps = samples + jumps + float(path.time[-1]) / equation.longest_step(path)
    each = RAMP_SQUARE * m**2 if equation.exact else RAMP_CUBE * (m + 1) ** 3
    return warning(steps * (RAMP + each), f"{steps:,.0f} steps from sample to sample and from jump to jump")
