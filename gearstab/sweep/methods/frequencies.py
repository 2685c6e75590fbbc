"""How a sweep solves systems of many mesh frequencies: what ``methods.floquet.frequencies`` asks for, or ``auto``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from gearstab.floquet import Floquet
from gearstab.floquet.frequencies import ManyFrequencies, choice, groups, lyapunov, per_mesh
from gearstab.floquet.report import reduction
from gearstab.floquet.smooth.schemes import CF6_5
from gearstab.results.variables import BY_MESH, INTERVAL, Variable
from gearstab.system import Array, GearSystem

Solver = Callable[[GearSystem, Array], Floquet]

VECTORS = 0.5
"""Cost of a segment over the square of the number of coordinates, in units of a sweep's costs: carrying the vectors of
a Lyapunov exponent takes four times as long as the compiled kernel's product at 12 coordinates."""
MOST = 512.0
"""Cost of a Lyapunov exponent beyond which blocks of the grid do not get smaller: calls pay for hundreds of points."""


def way(options: Any, system: GearSystem) -> str:
    """One of :data:`~gearstab.floquet.frequencies.WAYS`. Raises ValueError."""
    return choice.chosen(system, options.frequencies, options.affordable_segments)


def solved(options: Any, system: GearSystem, mesh_frequency: Array, solver: Solver) -> Floquet | ManyFrequencies:
    """Stability of a batch of systems."""
    taken = way(options, system)
    if taken == choice.PER_MESH:
        return per_mesh.solve(system, mesh_frequency, solver)
    if taken == choice.LYAPUNOV:
        asked = options.lyapunov
        return lyapunov.solve(system, mesh_frequency, asked.cycles, asked.confidence, asked.seed)
    return solver(system, mesh_frequency)


def variables(options: Any, system: GearSystem) -> tuple[Variable, ...]:
    """What there is besides growth rate, stability and status; the way of the base system decides."""
    return {choice.PER_MESH: BY_MESH, choice.LYAPUNOV: INTERVAL}.get(way(options, system), ())


def constants(options: Any, system: GearSystem) -> dict[str, Any]:
    """Values of their coordinates."""
    names = [mesh.name for mesh in system.meshes]
    return {"mesh": names} if way(options, system) == choice.PER_MESH else {}


def values(options: Any, system: GearSystem, found: Floquet | ManyFrequencies) -> dict[str, Array]:
    """Those that there may be besides growth rate, stability and status.

    What is declared depends on the base system; systems of other ratios that ``auto`` treats otherwise have an interval
    of zero (exact) and NaN for each mesh.
    """
    interval, by_mesh = (getattr(found, name, None) for name in ("interval", "by_mesh"))
    shape = found.growth_rate.shape
    of = [group.ratio for group in groups(system)]
    index = [of.index(mesh.frequency_ratio) for mesh in system.meshes]
    none = np.broadcast_to(np.nan, (*shape, len(index)))
    return {
        "growth_rate_interval": np.broadcast_to(0.0, shape) if interval is None else interval,
        "growth_rate_mesh": none if by_mesh is None else by_mesh[..., index],
    }


def cost(options: Any, system: GearSystem, exact: Callable[[GearSystem], float]) -> float:
    """Of a point, in the units of a sweep's costs; ``exact``: that of a system with a common period."""
    taken = way(options, system)
    if taken == choice.PER_MESH:
        return sum(exact(per_mesh.alone(system, group)) for group in groups(system))
    if taken == choice.LYAPUNOV:
        return min(max(1.0, VECTORS * _segments(options, system) * system.size**2), MOST)
    return exact(system)


def report(options: Any, system: GearSystem) -> dict[str, Any]:
    """What the result says of the choice where there is more than one mesh frequency."""
    if len(set(system.frequency_ratios)) < 2:
        return {}
    return {"frequencies_chosen": choice.reason(system, options.frequencies, options.affordable_segments)}


def note(options: Any, system: GearSystem) -> str | None:
    """What the user is told of an automatic choice that is not the exact one."""
    if options.frequencies != "auto" or way(options, system) == choice.COMMON_PERIOD:
        return None
    return f"methods.floquet.frequencies: {choice.reason(system, 'auto', options.affordable_segments)}"


def outlook(options: Any, system: GearSystem) -> str | None:
    """What --dry-run says of the way: segments and distinct states of a common period, or the length of the window."""
    if len(set(system.frequency_ratios)) < 2:
        return None
    text = choice.reason(system, options.frequencies, options.affordable_segments)
    taken = way(options, system)
    if taken == choice.COMMON_PERIOD and system.piecewise_constant and not system.terms:
        states = max((part.states for part in reduction(system).parts), default=1)
        return f"{text}, {states} distinct states"
    if taken == choice.LYAPUNOV:
        return (
            f"{text}; a window of {options.lyapunov.cycles:,g} cycles of the slowest mesh, {_counted(options, system)}"
        )
    return text


def _segments(options: Any, system: GearSystem) -> float:
    """In the window of a Lyapunov exponent."""
    cycles = lyapunov.length(system, options.lyapunov.cycles)
    if system.piecewise_constant:
        return choice.segments_a_cycle(system) * cycles
    return 2 * lyapunov.FEWEST_STEPS * CF6_5.exponentials * cycles * max(map(float, system.frequency_ratios))


def _counted(options: Any, system: GearSystem) -> str:
    what = "segments" if system.piecewise_constant else "exponentials of Magnus steps or more"
    return f"{_segments(options, system):,.0f} {what}"
