"""How likely each instability region reaches into a range of speeds: ``methods.tongue_probability``."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field, PrivateAttr

from gearstab.config.model.fields import Section, Whole
from gearstab.methods.base import RANGE, Method, Outcome, SampledMethod, Tolerance, WidthFloor
from gearstab.methods.boundaries import BoundariesOptions, BoundaryAnalysis
from gearstab.results.variables import OCCURRENCE, SAMPLED, TONGUE, TONGUE_PROBABILITY, Variable
from gearstab.system import Array, GearSystem

if TYPE_CHECKING:
    from pathlib import Path as FilePath

    from gearstab.config.document import Document
    from gearstab.config.model import Axis
    from gearstab.tolerance import SamplingDesign


class TongueProbabilityOptions(Section):
    """Probability that each region reaches into the range of speeds, of the distributions of methods.tolerance."""

    samples: Annotated[int, Field(ge=16, le=1_000_000), Whole] = 256
    """Systems of which all regions are found; a few more for even numbers."""
    seed: Annotated[int, Field(ge=0, le=2**32), Whole] = 0
    """Seed of the samples."""
    tolerance: Tolerance = 1e-6
    """Error of the edges of the regions, relative to the mesh frequency (1)."""
    width_floor: WidthFloor = 1e-6
    """Regions narrower than this, relative to it, count as none (1)."""
    _parameters: int = PrivateAttr(default=0)

    @property
    def parameters(self) -> int:
        """Return the number of uncertain parameters."""
        return self._parameters

    def of_parameters(self, count: int) -> TongueProbabilityOptions:
        """Return the options for so many uncertain parameters."""
        other = self.model_copy()
        other._parameters = count
        return other


class TongueProbabilityAnalysis(SampledMethod):
    """Exact boundaries of samples of the system, and which share of them has each region."""

    name = "tongue_probability"
    Options = TongueProbabilityOptions
    frequency = RANGE
    relief = "ask for fewer samples, or narrow the range of mesh_frequency"

    @cached_property
    def design(self) -> SamplingDesign:
        """Samples that are drawn, the same for all systems."""
        from gearstab.tolerance import SamplingDesign

        groups = tuple(range(self.options.parameters))
        return SamplingDesign.of(groups, self.options.samples, False, self.options.seed)

    @cached_property
    def inner(self) -> BoundaryAnalysis:
        """The method that finds the regions of a sample."""
        options = BoundariesOptions(tolerance=self.options.tolerance, width_floor=self.options.width_floor)
        return BoundaryAnalysis(options, self.system)

    @classmethod
    def over_range(cls, options: TongueProbabilityOptions) -> str:
        return "into which regions may reach"

    @classmethod
    def completed(
        cls, options: TongueProbabilityOptions, document: Document, source: FilePath, axes: Sequence[Axis]
    ) -> TongueProbabilityOptions:
        parameters = document.get(("methods", "tolerance", "parameters"))
        if parameters:
            return options.of_parameters(len(parameters))
        remedy = "add tolerance: {parameters: {..}} to methods"
        path = ("methods", cls.name)
        document.report(path, "needs_other", "takes its distributions from methods.tolerance", remedy, at_key=True)
        return options

    def variables(self) -> tuple[Variable, ...]:
        from gearstab.tolerance import probability

        # What is said of a region that no sample of a block has: 0 to the upper end for none.
        none = np.zeros(self.design.shape, dtype=bool)
        ends = probability(none, np.zeros((1, 1, 1), dtype=bool), self.design)
        table = [replace(v, missing=float(end)) for v, end in zip(TONGUE_PROBABILITY, ends, strict=True)]
        return (*TONGUE, OCCURRENCE, *table, *SAMPLED)

    def portions(self, rows: int, points: int) -> Iterable[slice]:  # type: ignore[override]
        """All rows together: regions of different portions would have to be united."""
        return [slice(0, rows)]

    def run(self, mesh_frequency: Array) -> Outcome:
        """Compute a batch ``(rows, samples)``, the samples of a row in the order of the design."""
        from gearstab.floquet.boundaries import boundaries
        from gearstab.tolerance import probability

        start, stop = (float(end) for end in mesh_frequency)
        found = boundaries(self.system, start, stop, self.options.tolerance, self.options.width_floor)
        edges = found.arranged()
        touching = np.isfinite(edges.boundary_frequency).any(axis=1)
        samples = touching.reshape(len(edges.index), -1, *self.design.shape)
        names = ("tongue_probability", "tongue_probability_lower", "tongue_probability_upper")
        shares = probability(samples, np.zeros((1,) * samples.ndim, dtype=bool), self.design)
        step, coarse = (own.reshape(-1, self.design.size) for own in (found.sampled_step, found.coarse))
        search = {"sampled_step": step.max(axis=1), "coarse": coarse.sum(axis=1)}
        return Outcome(dict(zip(names, shares, strict=True)) | search, edges.index)

    def once(self) -> tuple[Method, int]:
        return self.inner, self.design.size

    def cost(self) -> float:
        return self.design.size * self.inner.cost()

    def report(self) -> Mapping[str, Any]:
        return {"samples_drawn": self.design.size, "scrambles": self.design.shape[0]}

    def check(self) -> None:
        self.inner.check()

    def of(self, system: GearSystem) -> Method:
        """Return the same for other systems; the design goes along."""
        other = type(self)(self.options, system)
        other.__dict__["design"] = self.design
        return other
