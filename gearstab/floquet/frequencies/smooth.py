"""Windows of time over mesh stiffness that is not piecewise constant, cut into Magnus steps.

Between the jumps and kinks of all meshes the window is cut into steps of about equal length; each is a product of a few
exponentials, which are segments of constant stiffness (:mod:`~gearstab.floquet.smooth.schemes`), so that vectors are
carried through them as through any others.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gearstab.floquet.segments.pattern import CONSTANT, PROBES, SHORTEST, Pattern
from gearstab.floquet.segments.reduction import Elastic, reduce
from gearstab.floquet.smooth.schemes import CF6_5
from gearstab.floquet.smooth.steps import exponentials, in_steps
from gearstab.propagation.schedule import Functions, sources
from gearstab.system import Array, GearSystem


@dataclass(frozen=True)
class Window:
    """One row of a system over ``cycles`` periods 2 pi/Omega from t = 0.

    row: position in the flattened batch. elastic: its reduced coordinates. start, length ``(Q,)``: of the pieces, in
    periods 2 pi/Omega. constant ``(Q,)`` bool.
    """

    functions: Functions
    row: int
    elastic: Elastic
    cycles: float
    start: Array
    length: Array
    constant: Array

    def pattern(self, steps: int) -> Pattern:
        """Return the pattern with about so many steps per period of the fastest mesh."""
        density = steps * max(source.cycles for source in self.functions.found)
        counts = np.where(self.constant, 1, np.ceil(density * self.length)).astype(int)
        start, length, piece = in_steps(self.start[None], self.length[None], counts)
        row = np.array([self.row])
        durations, levels = exponentials(self.functions, row, start, length, self.constant[piece], CF6_5)
        fractions, every = durations / self.cycles, self.elastic.stiffness_of(levels)
        states, begin = np.arange(fractions.shape[1]), np.zeros(1)
        return Pattern(row, self.cycles, fractions, begin, states, levels, self.elastic, every, closed=False)


def windows(system: GearSystem, cycles: float) -> Iterator[Window]:
    """Every row once."""
    functions = Functions(sources(system, [float(ratio) for ratio in system.frequency_ratios]), system.batch)
    ends = np.broadcast_to([0.0, cycles], (system.rows, 2))
    jumps = [
        np.where(functions.varies(k)[:, None], functions.jumps_until(k, cycles), 0.0)
        for k in range(len(functions.found))
    ]
    every = np.clip(np.concatenate([ends, *jumps], axis=1), 0.0, cycles)
    for elastic in reduce(system):
        for k, row in enumerate(elastic.rows):
            edges = np.unique(every[row])
            length = np.diff(edges)
            start, length = edges[:-1][length > SHORTEST * cycles], length[length > SHORTEST * cycles]
            place = start[:, None] + length[:, None] * PROBES
            known = functions(np.array([row]), place.reshape(1, -1)).reshape(*place.shape, -1)
            constant = np.all(np.ptp(known, axis=1) <= CONSTANT * np.abs(known).max(axis=1), axis=-1)
            yield Window(functions, int(row), elastic.subset(np.array([k])), cycles, start, length, constant)
