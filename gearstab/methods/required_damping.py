"""The smallest damping that makes every point of the grid stable: ``methods.required_damping``."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from gearstab.config.model.fields import Choice, Quantity, Section
from gearstab.errors import NotPossible
from gearstab.methods.base import Method, OptionError, Outcome, Tolerance
from gearstab.results.variables import REQUIRED_DAMPING, Variable, flagged
from gearstab.system import Array, GearSystem

LADDER = 60.0
"""Cost of scanning the levels of damping, in undamped points."""
ROOTS = 400.0
"""Cost of the root finding, shared by all points: eigenproblems of their own for those that need damping."""


class RequiredDampingOptions(Section):
    """The smallest damping that makes every point of the grid stable."""

    of: Annotated[str, Choice("kind of damping", ("damping_ratio", "factor"))] = Field(
        default="damping_ratio",
        title="of",
        description="damping_ratio: one modal damping ratio for all modes, in place of the damping given; factor: on "
        "the damping given.",
    )
    largest: Annotated[float, Field(gt=0, le=1e6), Quantity()] | None = Field(
        default=None,
        title="largest damping",
        description="Where the search ends (1); default a damping ratio of 0.5, or a factor of 100.",
    )
    tolerance: Tolerance = Field(default=1e-6, title="tolerance", description="Of the required damping, relative (1).")
    frequencies: Annotated[str, Choice("way", ("auto", "common_period", "per_mesh"))] = Field(
        default="auto",
        title="many mesh frequencies",
        description="common_period: exact; per_mesh: one frequency at a time, the others at their mean; auto: exact "
        "while affordable.",
    )


class RequiredDamping(Method):
    """The damping that suppresses instability."""

    name = "required_damping"
    Options = RequiredDampingOptions
    flag_notes: ClassVar[Mapping[str, str]] = {"beyond": "no damping up to `largest` suffices at {points}"}

    @cached_property
    def strategy(self) -> str:
        """``common_period`` or ``per_mesh``. Raises NotPossible where the one asked for does not exist."""
        from gearstab.floquet.frequencies import choice

        taken = choice.chosen(self.system, self.options.frequencies)
        # Zeros of an estimate with an interval would have none.
        return choice.PER_MESH if taken == choice.LYAPUNOV else taken

    def variables(self) -> tuple[Variable, ...]:
        from gearstab.floquet.required_damping import FLAGS

        return flagged(REQUIRED_DAMPING, FLAGS)

    def run(self, mesh_frequency: Array) -> Outcome:
        from gearstab.floquet.frequencies import groups, per_mesh
        from gearstab.floquet.required_damping import required_damping

        system, settings = self.system, (self.options.of, self.options.largest, self.options.tolerance)
        if self.strategy == "common_period":
            found = [required_damping(system, mesh_frequency, *settings)]
        else:
            whole = system.over(system.batch)
            found = [
                required_damping(per_mesh.alone(whole, group), float(group.ratio) * mesh_frequency, *settings)
                for group in groups(system)
            ]
        status = np.bitwise_or.reduce([one.status for one in found])
        return Outcome({"required_damping": np.max([one.value for one in found], axis=0), "status": status})

    def cost(self) -> float:
        from gearstab.floquet.frequencies import groups, per_mesh

        if self.strategy == "per_mesh":
            return sum(_cost(per_mesh.alone(self.system, group)) for group in groups(self.system))
        return _cost(self.system)

    def report(self) -> Mapping[str, Any]:
        return {"frequencies_chosen": self.strategy} if len(set(self.system.frequency_ratios)) > 1 else {}

    def outlook(self) -> str | None:
        from gearstab.floquet.frequencies import choice

        return choice.reason(self.system, self.strategy) if len(set(self.system.frequency_ratios)) > 1 else None

    def check(self) -> None:
        self.only_mesh_stiffness("sweep the damping with floquet instead")
        try:
            _ = self.strategy
        except NotPossible:
            self.needs_common_period("choose per_mesh or auto", ("frequencies",))
            raise
        if self.options.of == "factor" and self.system.damping is None:
            remedy = "give the system damping, or choose of: damping_ratio"
            raise OptionError(("of",), "there is no damping to multiply", remedy)


def _cost(system: GearSystem) -> float:
    from gearstab.floquet.report import reduction

    return LADDER * max(1.0, sum(p.segments * p.size**3 for p in reduction(system).parts) / 108) + ROOTS
