"""Edges of all instability regions by root finding: ``methods.boundaries``."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from pydantic import Field

from gearstab.config.model.fields import Section
from gearstab.methods.base import RANGE, EffortEstimate, Key, Outcome, Tolerance, TongueMethod
from gearstab.results.variables import EXACT, OCCURRENCE, TONGUE, Variable, flagged
from gearstab.system import Array


class BoundariesOptions(Section):
    """Edges of all instability regions over the range of the mesh frequency, by root finding."""

    tolerance: Tolerance = Field(
        default=1e-10, title="tolerance", description="Of an edge, relative to the mesh frequency (1)."
    )
    width_floor: Tolerance = Field(
        default=1e-6,
        title="width floor",
        description="Regions narrower than this, relative to the mesh frequency, may be left out (1).",
    )


class BoundaryAnalysis(TongueMethod):
    """Exact boundaries."""

    name = "boundaries"
    Options = BoundariesOptions
    frequency = RANGE
    relief = (
        "narrow the range of mesh_frequency, take ratios of smaller numbers, or remove it: floquet on a fine grid "
        "shows the regions that damping leaves"
    )

    def variables(self) -> tuple[Variable, ...]:
        from gearstab.floquet.boundaries import BOUNDARY_FLAGS

        return (*TONGUE, OCCURRENCE, *flagged(EXACT, BOUNDARY_FLAGS))

    def run(self, mesh_frequency: Array) -> Outcome:
        from gearstab.floquet.boundaries import boundaries

        start, stop = (float(end) for end in mesh_frequency)
        found = boundaries(self.system, start, stop, self.options.tolerance, self.options.width_floor)
        edges = found.arranged()
        values = {
            "boundary_frequency": edges.boundary_frequency, "tolerance": edges.tolerance, "status": edges.flags,
            "holder": edges.holder, "contacts": found.contacts, "evaluations": found.evaluations,
            "proved_share": found.stable_share(found.proved), "counted_share": found.stable_share(found.counted),
            "proved_frequency": found.stretches(found.proved),
        }  # fmt: skip
        return Outcome(values, edges.index)

    @staticmethod
    def unite(indices: Iterable[Sequence[Key]]) -> tuple[Key, ...]:
        from gearstab.floquet.boundaries import union

        return union(indices)

    def check(self) -> None:
        self.needs_common_period("remove it, or give exact ratios")
        self.only_mesh_stiffness()

    def effort(self, mesh_frequency: Array) -> EffortEstimate:
        from gearstab.floquet.boundaries.effort import effort

        start, stop = (float(end) for end in mesh_frequency)
        return effort(self.system, start, stop)

    def cost(self) -> float:
        return 4000 * max(1.0, 2 * sum(self.system.common_period()[1]) * self.system.size**3 / 108)
