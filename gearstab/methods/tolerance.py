"""The probability of instability of a system whose parameters are not known exactly: ``methods.tolerance``.

Besides, how likely each instability region reaches into a range of speeds: ``methods.tongue_probability``.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, PrivateAttr, model_validator

from gearstab.config.document import Code, mapping
from gearstab.config.model.fields import AnyNumber, Flag, Quantity, Section, Whole
from gearstab.config.model.units import wrong
from gearstab.floquet.stability import STATUS_FLAGS
from gearstab.methods.base import RANGE, Method, Outcome, SampledMethod, Tolerance, UncertainSpeed, WidthFloor, flat
from gearstab.methods.boundaries import BoundariesOptions, BoundaryAnalysis
from gearstab.methods.floquet import Floquet, FloquetOptions
from gearstab.results.variables import (
    OCCURRENCE,
    PROBABILITY,
    SAMPLED,
    SOBOL,
    TONGUE,
    TONGUE_PROBABILITY,
    Flags,
    Variable,
    flagged,
)
from gearstab.system import Array, GearSystem

if TYPE_CHECKING:
    from pathlib import Path as FilePath

    from gearstab.config.document import Document
    from gearstab.config.model import Axis
    from gearstab.tolerance import SamplingDesign

ROW = 512
"""Points of a block at least, so that a row of a map is not cut where that would cost as much again."""
FEWEST = 16
"""Samples where nothing is drawn."""
EDGE = 1e-8
"""Edges of regions, relative to the mesh frequency: tolerance, and width of regions that are left out."""
TAIL = 1e-8
"""Probability of mesh frequencies beyond those in which regions are looked for."""
SEARCH = 10.0
"""Points of a row whose stability takes as long as the search for its regions, per point of the row."""


def _numbers(count: int) -> BeforeValidator:
    """Return a validator of a list of so many numbers."""

    def check(value: Any) -> Any:
        if isinstance(value, list) and len(value) != count:
            raise wrong("wrong_count", f"has {len(value)} entries", f"give {count}")
        return value

    return BeforeValidator(check)


class DistributionOptions(Section):
    """How an uncertain parameter is distributed: one of normal, uniform and triangular."""

    normal: Annotated[list[AnyNumber], _numbers(2)] | None = None
    """Mean and standard deviation, in the unit of the parameter."""
    uniform: Annotated[list[AnyNumber], _numbers(2)] | None = None
    """Low and high."""
    triangular: Annotated[list[AnyNumber], _numbers(3)] | None = None
    """Low, mode and high."""
    deviation: Flag = False
    """Whether this is added to the value that the system or an axis gives, instead of replacing it."""

    @model_validator(mode="after")
    def _one(self) -> DistributionOptions:
        given = [name for name in ("normal", "uniform", "triangular") if getattr(self, name) is not None]
        if len(given) != 1:
            message = f"has {' and '.join(given)}" if given else "has no distribution"
            code: Code = "already_given" if given else "missing"
            hint = "give one of normal: [mean, standard deviation], uniform: [low, high], triangular: [low, mode, high]"
            raise wrong(code, message, hint)
        return self


def _two(names: list[str]) -> list[str]:
    if len(names) != 2:
        raise wrong("wrong_count", f"has {len(names)} entries", "name two parameters")
    return names


class CorrelationOptions(Section):
    """How two uncertain parameters go together."""

    between: Annotated[list[str], AfterValidator(_two)]
    """Names of the two parameters, as under parameters."""
    value: Annotated[float, Field(gt=-1, lt=1), Quantity()]
    """Correlation coefficient of their normal deviates (1)."""


class ToleranceOptions(Section):
    """Probability of instability at every point of the grid, of a system whose parameters are uncertain."""

    parameters: dict[str, DistributionOptions] = Field(min_length=1)
    """Distributions by the name of the parameter, any that an axis may have."""
    samples: Annotated[int, Field(ge=16, le=1_000_000), Whole] = 1024
    """Systems at every point; a few more where that evens out."""
    seed: Annotated[int, Field(ge=0, le=2**32), Whole] = 0
    """Seed of the samples, which are the same at all points."""
    correlation: list[CorrelationOptions] | None = None
    """Pairs that are not independent (a Gaussian copula)."""
    sobol: Flag = Field(default=True, title="Sobol indices")
    """Which parameter is to blame; without, the samples tell the probability more accurately."""
    integrate_speed: Flag = False
    """Whether an uncertain mesh frequency is integrated between exact edges; then no Sobol indices."""
    tolerance: Tolerance = 1e-6
    """Error of the multipliers, for waves that are not piecewise constant (1)."""


class ToleranceAnalysis(SampledMethod):
    """Samples of the system by the method ``floquet``, and what they say."""

    name = "tolerance"
    reused = True
    Options = ToleranceOptions
    supports = Floquet.supports
    flag_notes: ClassVar[Mapping[str, str]] = {
        "negative_stiffness": "some samples have a mesh whose softer level is not positive at {points}",
        "failed": "some samples could not be computed at {points}; the interval counts them as either",
    }

    @classmethod
    def sets(cls, section: Any) -> Collection[str]:
        return mapping(mapping(section).get("parameters"))

    @cached_property
    def names(self) -> list[str]:
        """Names of the uncertain parameters."""
        return list(self.options.parameters)

    @cached_property
    def design(self) -> SamplingDesign:
        """Samples that are drawn, the same for all systems."""
        from gearstab.tolerance import SamplingDesign, groups_of

        pairs = [tuple(self.names.index(name) for name in entry.between) for entry in self.options.correlation or ()]
        groups = groups_of(len(self.names), pairs)  # type: ignore[arg-type]
        # The mesh frequency alone leaves nothing to draw.
        samples = FEWEST if self.alone else self.options.samples
        return SamplingDesign.of(groups, samples, self.indices, self.options.seed)

    @property
    def indices(self) -> bool:
        """Whether there are Sobol indices."""
        return self.options.sobol and not self.integrates

    @property
    def integrates(self) -> bool:
        return self.options.integrate_speed

    @property
    def alone(self) -> bool:
        """Whether the mesh frequency, integrated, is all that is uncertain."""
        return self.integrates and len(self.names) == 1

    @cached_property
    def inner(self) -> Method:
        """The method that decides on the stability of a sample."""
        return Floquet.on(FloquetOptions(tolerance=self.options.tolerance), self.system)

    def variables(self) -> tuple[Variable, ...]:
        status = next(variable for variable in self.inner.variables() if variable.name == "status")
        return (*flagged(PROBABILITY, Flags.of(status.attributes)), *(SOBOL if self.indices else ()))

    def constants(self) -> Mapping[str, Any]:
        return {"parameter": self.names} if self.indices else {}

    def run(self, mesh_frequency: Array) -> Outcome:
        """Compute a batch ``(rows, samples)``, the samples of a row in the order of the design."""
        from gearstab.tolerance import probability, sobol_indices

        inner = self.inner.of(self.system)
        found = inner.run(mesh_frequency).values
        count = found["stable"].shape[-1]
        shape = (-1, *self.design.shape, count)
        verdict = np.moveaxis(found["stable"].reshape(shape), -1, 1)
        unstable, failed = verdict == 0, verdict < 0
        if not failed.any():
            failed = np.zeros((1,) * verdict.ndim, dtype=bool)
        middle, lower, upper = probability(unstable, failed, self.design)
        status = np.bitwise_or.reduce(found["status"].reshape(-1, self.design.size, count), axis=1)
        values = {"probability": middle, "probability_lower": lower, "probability_upper": upper, "status": status}
        if self.indices:
            names = ("sobol_first", "sobol_total", "sobol_first_interval", "sobol_total_interval")
            values |= dict(zip(names, sobol_indices(unstable, self.design), strict=True))
        return Outcome(values)

    def integrated(self, present: Array, speed: UncertainSpeed, factor: float) -> Outcome:
        """Compute the same, the mesh frequency integrated over the regions of each sample.

        P(unstable) = E sum_k [F(b_k) - F(a_k)], over the regions a_k to b_k of a sample, F being the distribution of
        the mesh frequency. Edges are off by their tolerance at most, and regions narrower than it are left out.
        """
        from gearstab.tolerance import mean_of_chances

        system = self.system
        found = []
        for chances in _chances(system, present, speed, factor):
            samples = np.moveaxis(chances.reshape(-1, *self.design.shape, chances.shape[-1]), -1, 1)
            found.append(mean_of_chances(samples, self.design))
        middle, lower, upper = (one[0] if self.alone else one[k] for k, one in enumerate(found))
        soft = np.any([np.broadcast_to(mesh.lowest_stiffness <= 0, system.batch) for mesh in system.meshes], axis=0)
        flags = np.where(soft.reshape(-1, self.design.size).any(axis=1), STATUS_FLAGS["negative_stiffness"], 0)
        status = np.broadcast_to(flags[:, None], middle.shape).astype(np.int16)
        names = ("probability", "probability_lower", "probability_upper")
        ends = (middle, np.maximum(lower - TAIL, 0.0), np.minimum(upper + TAIL, 1.0))
        return Outcome(dict(zip(names, ends, strict=True)) | {"status": status})

    def cost(self) -> float:
        return self.design.size * self.inner.cost() * (SEARCH if self.integrates else 1.0)

    @property
    def fewest(self) -> int:
        return ROW

    @property
    def parallel(self) -> bool:
        return self.inner.parallel

    def report(self) -> Mapping[str, Any]:
        return {"samples_drawn": self.design.size, "scrambles": self.design.shape[0], **self.inner.report()}

    def attributes(self) -> dict[str, Any]:
        """Return the options without the distributions, which stand in the configuration that the result has."""
        plain = self.options.model_dump(exclude_none=True, exclude={"parameters", "correlation"})
        return flat(plain) | dict(self.report())

    def note(self) -> str | None:
        return self.inner.note()

    def check(self) -> None:
        self.inner.check()
        if self.integrates:
            self.require(BoundaryAnalysis.supports, {}, ("integrate_speed",))

    def of(self, system: GearSystem) -> Method:
        """Return the same for other systems; the design goes along."""
        other = type(self)(self.options, system)
        other.__dict__["design"] = self.design
        # What decides goes by the base system.
        other.__dict__["inner"] = self.inner
        return other


def _chances(system: GearSystem, present: Array, speed: UncertainSpeed, factor: float) -> Iterator[Array]:
    """Yield the probabilities ``(rows, P)`` of a mesh frequency in a region of each row, beside those ``present``.

    As found, then with every region as narrow and as wide as the tolerance of its edges allows.
    """
    from gearstab.floquet.boundaries import boundaries

    ends = speed.values(np.array([TAIL, 1 - TAIL])[:, None, None], present, factor)
    found = boundaries(system, float(ends[0].min()), float(ends[1].max()), EDGE, EDGE)
    present = np.broadcast_to(present, (found.rows, np.shape(present)[-1]))[found.row]
    for off in (0.0, -EDGE, EDGE):
        edges = (found.upper * (1 + off), found.lower * (1 - off))
        upper, lower = (speed.below(edge[:, None], present, factor) for edge in edges)
        chances = np.zeros((found.rows, present.shape[-1]))
        np.add.at(chances, found.row, np.maximum(upper - lower, 0.0))
        yield np.minimum(chances, 1.0)


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
            return options.knowing(parameters=len(parameters))
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
