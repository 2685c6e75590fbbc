"""Methods that draw samples of uncertain parameters: rows of a grid to many systems each."""

from __future__ import annotations

import numpy as np

from gearstab.methods import RANGE, Outcome, SampledMethod
from gearstab.sweep.plan import Plan
from gearstab.system import Array
from gearstab.tolerance.design import correlated


def run_sampled(plan: Plan, method: SampledMethod, rows: dict[str, Array], count: int, columns: Array) -> Outcome:
    """Run a method on the samples of rows of one structure, a few rows at a time."""
    uncertain = plan.config.uncertainties
    if uncertain is None:
        raise ValueError(f"{method.name} needs distributions of parameters")
    points = correlated(method.design.points, uncertain.correlation)
    outcomes = []
    for part in method.portions(count, len(columns)):
        size = part.stop - part.start
        every = np.tile(points, (size, 1))
        # The samples of a row are next to each other.
        chosen = {name: np.repeat(index[part], len(points)) for name, index in rows.items()}
        system = uncertain.sampled(plan.config.at(chosen), every).build()
        batch = method.of(system.over((len(every),)))
        if method.frequency == RANGE:
            return batch.run(np.array(plan.mesh_frequency_range))
        present: Array = np.ones((1, 1)) if uncertain.sets_mesh_frequency else plan.mesh_frequency(chosen, columns)
        if isinstance(batch, SampledMethod) and batch.integrates and uncertain.speed is not None:
            outcomes.append(batch.integrated(present, *uncertain.speed).values)
            continue
        frequency = uncertain.mesh_frequency(present, every)
        outcomes.append(batch.run(frequency).values)
    return Outcome({name: np.concatenate([values[name] for values in outcomes]) for name in outcomes[0]})
