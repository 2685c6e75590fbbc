"""Periodic motions with backlash followed over the mesh frequency, unstable ones too: ``methods.branches``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from gearstab.config.model.fields import Flag, Quantity, Section, Whole
from gearstab.methods.base import RANGE, Method, OptionError, Outcome
from gearstab.results.variables import Variable, flagged
from gearstab.results.variables.responses import BRANCHES
from gearstab.system import Array, Feature


class BranchesOptions(Section):
    """Periodic motions with backlash as curves over the mesh frequency, through folds."""

    starts: list[Annotated[float, Field(gt=0), Quantity("rad/s")]] | None = Field(
        default=None,
        min_length=1,
        max_length=1000,
        title="starts",
        description="Mesh frequencies at which motions are looked for by running on; default five over the range.",
    )
    states: Annotated[int, Field(ge=1, le=1000), Whole] = Field(
        default=1,
        title="initial states",
        description="At each start: the static equilibrium, and random ones that may lead to isolated branches.",
    )
    seed: Annotated[int, Field(ge=0), Whole] = Field(default=0, title="seed", description="Of the random states.")
    cycles: Annotated[float, Field(gt=0, le=1e6), Quantity()] = Field(
        default=200.0, title="cycles", description="Of the first mesh, that a motion is given to settle (1)."
    )
    switch: Flag = Field(
        default=False,
        title="switch",
        description="Whether branches that leave at period doublings are followed too.",
    )
    points: Annotated[int, Field(ge=10, le=100_000), Whole] = Field(
        default=1000, title="points", description="Motions of all branches of a system together, at most."
    )
    longest_step: Annotated[float, Field(gt=0, le=1), Quantity()] = Field(
        default=0.05,
        title="longest step",
        description="Between motions, relative to the range of mesh frequencies and the extent of a motion (1).",
    )
    largest: Annotated[float, Field(gt=1, le=1e6), Quantity()] = Field(
        default=10.0,
        title="largest motion",
        description="Extent, relative to that of the first motion, at which a branch ends (1).",
    )


class BranchAnalysis(Method):
    """Periodic motions of a system whose teeth may part, one system at a time."""

    name = "branches"
    Options = BranchesOptions
    frequency = RANGE
    singly = True
    bounded = True
    supports = frozenset({Feature.PERIODIC_TERMS})
    relief = "narrow the range of mesh_frequency, or ask for fewer points"
    STARTS: ClassVar[int] = 5
    """Mesh frequencies at which motions are looked for, if not said otherwise."""

    def variables(self) -> tuple[Variable, ...]:
        from gearstab.response.branches.solve import BRANCH_FLAGS

        return flagged(BRANCHES, BRANCH_FLAGS)

    def constants(self) -> Mapping[str, Any]:
        return {
            "point": np.arange(1, self.options.points + 1),
            "multiplier": np.arange(1, 2 * self.system.size + 1),
            "mesh": [mesh.name for mesh in self.system.meshes],
        }

    def run(self, mesh_frequency: Array) -> Outcome:
        from gearstab.response.branches.continuation import StepLimits
        from gearstab.response.branches.solve import BranchSearch, Starts
        from gearstab.response.branches.table import table

        low, high = (float(end) for end in mesh_frequency)
        own = self.options
        values = np.linspace(low, high, self.STARTS) if own.starts is None else np.clip(own.starts, low, high)
        limits = StepLimits(low, high, own.points, longest=own.longest_step, largest=own.largest)
        starts = Starts(tuple(values.tolist()), own.states, own.cycles, own.seed)
        search = BranchSearch(self.system, limits, own.switch)
        search.run(starts)
        arranged = table(search, own.points, 2 * self.system.size, len(self.system.meshes))
        return Outcome({name: values[None] for name, values in vars(arranged).items()})

    @property
    def fewest(self) -> int:
        return 1

    def cost(self) -> float:
        """Measured: 14 ms a motion of a gear pair, 20 ms of three coordinates and two meshes."""
        return 4e5 * (1 + self.system.size / 4) * self.options.points * (1 if self.system.piecewise_constant else 5)

    def check_options(self) -> None:
        from gearstab.response.backlash import has_backlash

        if not has_backlash(self.system):
            remedy = "give a mesh backlash; motions without loss of contact are those of response"
            raise OptionError((), "no mesh has backlash", remedy)
        if not self.system.forced:
            raise OptionError((), "nothing drives the system", "give a load, forces or transmission errors")

    @classmethod
    def over_range(cls, options: BranchesOptions) -> str:
        return "over which motions are followed"
