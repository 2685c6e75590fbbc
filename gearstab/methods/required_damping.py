"""The smallest damping that makes every point of the grid stable: ``methods.required_damping``."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from gearstab.config.model.fields import Choice, Quantity, Section
from gearstab.errors import NotPossible
from gearstab.methods.base import Method, OptionError, Outcome, Tolerance
from gearstab.results.variables import REQUIRED_DAMPING, Variable, flagged
from gearstab.support import ANY_LINEAR, WHIRLING
from gearstab.system import Array, Feature

if TYPE_CHECKING:
    from gearstab.floquet.frequencies import Strategy

LADDER = 60.0
"""Cost of scanning the levels of damping, in undamped points."""
ROOTS = 400.0
"""Cost of the root finding, shared by all points: eigenproblems of their own for those that need damping."""


class RequiredDampingOptions(Section):
    """The smallest damping that makes every point of the grid stable."""

    of: Annotated[str, Choice("kind of damping", ("damping_ratio", "factor"))] = "damping_ratio"
    """damping_ratio: one modal damping ratio for all modes, in place of the damping given; factor: on the damping
    given. What acts with a speed of rotation stays as it is."""
    largest: Annotated[float, Field(gt=0, le=1e6), Quantity()] | None = Field(default=None, title="largest damping")
    """Where the search ends (1); default a damping ratio of 0.5, or a factor of 100."""
    tolerance: Tolerance = 1e-6
    """Relative error of the required damping (1)."""
    frequencies: Annotated[str, Choice("way", ("auto", "common_period", "per_mesh"))] = Field(
        default="auto", title="many mesh frequencies"
    )
    """common_period: exact; per_mesh: one frequency at a time, the others at their mean; auto: exact while affordable.
"""


class DampingAnalysis(Method):
    """The damping that suppresses instability."""

    name = "required_damping"
    reused = True
    Options = RequiredDampingOptions
    supports = ANY_LINEAR | WHIRLING
    flag_notes: ClassVar[Mapping[str, str]] = {"beyond": "no damping up to `largest` suffices at {points}"}

    @cached_property
    def strategy(self) -> Strategy:
        """Choose ``common_period`` or ``per_mesh``. Raises NotPossible where the one asked for does not exist."""
        from gearstab.floquet.frequencies import chosen

        taken = chosen(self.system, self.options.frequencies).name
        # Zeros of an estimate with an interval would have none.
        return chosen(self.system, "per_mesh" if taken == "lyapunov" else taken)

    def variables(self) -> tuple[Variable, ...]:
        from gearstab.floquet.required_damping import FLAGS

        return flagged(REQUIRED_DAMPING, FLAGS)

    def run(self, mesh_frequency: Array) -> Outcome:
        from gearstab.floquet.frequencies import apart
        from gearstab.floquet.required_damping import required_damping

        options, exact = self.options, self.strategy.name == "common_period"
        found = [
            required_damping(system, ratio * mesh_frequency, options.of, options.largest, options.tolerance)
            for system, ratio in ([(self.system, 1.0)] if exact else apart(self.system))
        ]
        status = np.bitwise_or.reduce([one.status for one in found])
        return Outcome({"required_damping": np.max([one.value for one in found], axis=0), "status": status})

    def cost(self) -> float:
        from gearstab.floquet.dispatch import reduction
        from gearstab.floquet.frequencies import apart

        exact = self.strategy.name == "common_period"
        systems = [self.system] if exact else [system for system, _ in apart(self.system)]
        return sum(LADDER * reduction(system).cost + ROOTS for system in systems)

    def report(self) -> Mapping[str, Any]:
        return {"frequencies_chosen": self.strategy.name} if self.strategy.several else {}

    def outlook(self) -> str | None:
        return self.strategy.reason if self.strategy.several else None

    def check_options(self) -> None:
        try:
            _ = self.strategy
        except NotPossible:
            self.require((), {Feature.IRRATIONAL_RATIO: "choose per_mesh or auto"}, ("frequencies",))
            raise
        from gearstab.floquet.required_damping import scalable

        if self.options.of == "factor" and not scalable(self.system):
            remedy = "give the system damping, or choose of: damping_ratio"
            raise OptionError(("of",), "there is no damping to multiply", remedy)
