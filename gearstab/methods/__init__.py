"""The methods of a sweep: a class each, with its section of the configuration, and one line in the table.

Nothing here imports numerics before a method runs, as configurations are validated with the methods' options.
"""

from __future__ import annotations

from typing import Any

from gearstab.methods.base import POINTS, RANGE, Key, Method, OptionError, Outcome, SampledMethod
from gearstab.methods.boundaries import BoundaryAnalysis, DampingAnalysis
from gearstab.methods.floquet import Floquet
from gearstab.methods.passage import Passage
from gearstab.methods.perturbation import NaturalFrequencies, Perturbation, Uncoupled
from gearstab.methods.response import BranchAnalysis, SteadyStateAnalysis
from gearstab.methods.tolerance import ToleranceAnalysis, TongueProbabilityAnalysis
from gearstab.system import GearSystem

METHODS: dict[str, type[Method]] = {
    method.name: method
    for method in (
        Floquet,
        Perturbation,
        Uncoupled,
        NaturalFrequencies,
        DampingAnalysis,
        BoundaryAnalysis,
        Passage,
        SteadyStateAnalysis,
        BranchAnalysis,
        ToleranceAnalysis,
        TongueProbabilityAnalysis,
    )
}
"""By name, the key in ``methods`` of a configuration and the group in the result."""


def chosen(methods: Any, system: GearSystem) -> list[Method]:
    """Return the methods that a configuration asks for, for its base system, in the order in which they run."""
    asked = [(method, getattr(methods, name, None)) for name, method in METHODS.items()]
    found = [method.on(options, system) for method, options in asked if options is not None]
    return sorted(found, key=lambda method: not method.cheap)


__all__ = ["METHODS", "POINTS", "RANGE", "Key", "Method", "OptionError", "Outcome", "SampledMethod", "chosen"]
