"""Strategies for several mesh frequencies: what the exact one costs, and which one ``auto`` takes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gearstab.errors import NotPossible
from gearstab.floquet.frequencies.period import AFFORDABLE, Period, common_period, exact_pattern
from gearstab.support import ONLY_MESHES, unsupported
from gearstab.system import GearSystem

COMMON_PERIOD, PER_MESH, LYAPUNOV = "common_period", "per_mesh", "lyapunov"
STRATEGIES = (COMMON_PERIOD, PER_MESH, LYAPUNOV)


@dataclass(frozen=True)
class Strategy:
    """The strategy for the mesh frequencies of a system, and what it was chosen for.

    name: one of STRATEGIES. automatic: whether ``auto`` took it. period: None where there is none; affordable: the
    segments up to which it was to be the automatic choice.
    """

    system: GearSystem
    name: str
    automatic: bool
    period: Period | None
    affordable: int

    @property
    def several(self) -> bool:
        """Whether there is more than one frequency, and so anything to choose."""
        return len(set(self.system.frequency_ratios)) > 1

    @cached_property
    def reason(self) -> str:
        """The strategy and why it was taken, in a line, for instance "lyapunov (no common period)"."""
        if self.automatic and self.name == PER_MESH and varying(self.system) < 2:
            return f"{self.name} (a single mesh frequency varies)"
        if self.period is None:
            return f"{self.name} (the mesh frequencies have no common period)"
        cycles = " + ".join(f"{count:,}" for count in dict.fromkeys(self.period.mesh_cycles))
        # Jumps of several meshes may coincide; they are counted where that takes no time.
        pattern = exact_pattern(self.system)
        segments = self.period.segments if pattern is None else len(pattern.states)
        stepped = not self.system.piecewise_constant
        parts = f"some {segments:,} exponentials of Magnus steps" if stepped else f"{segments:,} segments"
        what = f"a common period of {cycles} mesh cycles with {parts}"
        limit = f", more than {self.affordable:,}" if self.automatic and self.name != COMMON_PERIOD else ""
        return f"{self.name} ({what}{limit})"


def chosen(system: GearSystem, asked: str, affordable: int = AFFORDABLE, cycles: float = 500) -> Strategy:
    """Choose the strategy where ``asked`` is one of STRATEGIES or ``auto``.

    ``auto`` is the common period while it has at most ``affordable`` segments; else one frequency at a time where only
    one varies, which is exact, or where there are other periodic terms; else the Lyapunov exponent, unless its window
    of ``cycles`` of the slowest mesh is no shorter than the common period: it would take longer and say less. Raises
    NotPossible where there is no such strategy.
    """
    period = common_period(system)
    if asked == COMMON_PERIOD and period is None:
        raise NotPossible("mesh frequencies of irrational ratio have no common period", "choose per_mesh or lyapunov")
    if (refused := unsupported(system, ONLY_MESHES)) and asked == LYAPUNOV:
        raise NotPossible(f"{LYAPUNOV} {refused[0]}", "choose per_mesh")
    name = asked
    if asked == "auto" and period is not None and period.segments <= affordable:
        name = COMMON_PERIOD
    elif asked == "auto":
        from gearstab.floquet.frequencies.lyapunov import length

        name = PER_MESH if refused or varying(system) < 2 else LYAPUNOV
        if name == LYAPUNOV and period is not None and period.cycles <= length(system, cycles):
            name = COMMON_PERIOD
    return Strategy(system, name, asked == "auto", period, affordable)


def varying(system: GearSystem) -> int:
    """Count the frequencies with which anything varies."""
    moving = [mesh.frequency_ratio for mesh in system.meshes if np.any(mesh.epsilon)]
    return len(set(moving + [term.frequency_ratio for term in system.terms]))
