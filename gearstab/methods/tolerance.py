"""The probability of instability of a system whose parameters are not known exactly: ``methods.tolerance``."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from gearstab.config.document.codes import Code
from gearstab.config.document.tree import mapping
from gearstab.config.model.fields import AnyNumber, Flag, Quantity, Section, Whole, wrong
from gearstab.methods.base import Method, Outcome, SampledMethod, Tolerance, flat
from gearstab.methods.floquet import Floquet, FloquetOptions
from gearstab.results.variables import PROBABILITY, SOBOL, Variable, flagged
from gearstab.system import Array, GearSystem

if TYPE_CHECKING:
    from gearstab.tolerance.design import SamplingDesign

ROW = 512
"""Points of a block at least, so that a row of a map is not cut where that would cost as much again."""


def _numbers(count: int) -> BeforeValidator:
    """Of a list of so many."""

    def check(value: Any) -> Any:
        if isinstance(value, list) and len(value) != count:
            raise wrong("wrong_count", f"has {len(value)} entries", f"give {count}")
        return value

    return BeforeValidator(check)


class DistributionOptions(Section):
    """How an uncertain parameter is distributed: one of normal, uniform and triangular."""

    normal: Annotated[list[AnyNumber], _numbers(2)] | None = Field(
        default=None, title="normal", description="Mean and standard deviation, in the unit of the parameter."
    )
    uniform: Annotated[list[AnyNumber], _numbers(2)] | None = Field(
        default=None, title="uniform", description="Low and high."
    )
    triangular: Annotated[list[AnyNumber], _numbers(3)] | None = Field(
        default=None, title="triangular", description="Low, mode and high."
    )
    deviation: Flag = Field(
        default=False,
        title="deviation",
        description="Whether this is added to the value that the system or an axis gives, instead of replacing it.",
    )

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

    between: Annotated[list[str], AfterValidator(_two)] = Field(
        title="between", description="Names of the two parameters, as under parameters."
    )
    value: Annotated[float, Field(gt=-1, lt=1), Quantity()] = Field(
        title="value", description="Correlation coefficient of their normal deviates (1)."
    )


class ToleranceOptions(Section):
    """Probability of instability at every point of the grid, of a system whose parameters are uncertain."""

    parameters: dict[str, DistributionOptions] = Field(
        min_length=1,
        title="parameters",
        description="Distributions by the name of the parameter, any that an axis may have.",
    )
    samples: Annotated[int, Field(ge=16, le=1_000_000), Whole] = Field(
        default=1024, title="samples", description="Systems at every point; a few more where that evens out."
    )
    seed: Annotated[int, Field(ge=0, le=2**32), Whole] = Field(
        default=0, title="seed", description="Of the samples, which are the same at all points."
    )
    correlation: list[CorrelationOptions] | None = Field(
        default=None, title="correlation", description="Pairs that are not independent (a Gaussian copula)."
    )
    sobol: Flag = Field(
        default=True,
        title="Sobol indices",
        description="Which parameter is to blame; without, the samples tell the probability more accurately.",
    )
    tolerance: Tolerance = Field(
        default=1e-6,
        title="tolerance",
        description="Of the multipliers, for waves that are not piecewise constant (1).",
    )


class ToleranceAnalysis(SampledMethod):
    """Samples of the system by the method ``floquet``, and what they say."""

    name = "tolerance"
    reused = True
    Options = ToleranceOptions
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
        from gearstab.tolerance.design import SamplingDesign, groups_of

        pairs = [tuple(self.names.index(name) for name in entry.between) for entry in self.options.correlation or ()]
        groups = groups_of(len(self.names), pairs)  # type: ignore[arg-type]
        return SamplingDesign.of(groups, self.options.samples, self.options.sobol, self.options.seed)

    @cached_property
    def inner(self) -> Method:
        """The method that decides on the stability of a sample."""
        return Floquet.on(FloquetOptions(tolerance=self.options.tolerance), self.system)

    def variables(self) -> tuple[Variable, ...]:
        status = next(variable for variable in self.inner.variables() if variable.name == "status")
        said = status.attributes
        flags = dict(zip(str(said["flag_meanings"]).split(), said["flag_masks"], strict=True))
        return (*flagged(PROBABILITY, flags), *(SOBOL if self.options.sobol else ()))

    def constants(self) -> Mapping[str, Any]:
        return {"parameter": self.names} if self.options.sobol else {}

    def run(self, mesh_frequency: Array) -> Outcome:
        """Compute a batch ``(rows, samples)``, the samples of a row in the order of the design."""
        from gearstab.tolerance import estimates

        inner = self.inner.of(self.system)
        found = inner.run(mesh_frequency).values
        count = found["stable"].shape[-1]
        shape = (-1, *self.design.shape, count)
        verdict = np.moveaxis(found["stable"].reshape(shape), -1, 1)
        unstable, failed = verdict == 0, verdict < 0
        if not failed.any():
            failed = np.zeros((1,) * verdict.ndim, dtype=bool)
        middle, lower, upper = estimates.probability(unstable, failed, self.design)
        status = np.bitwise_or.reduce(found["status"].reshape(-1, self.design.size, count), axis=1)
        values = {"probability": middle, "probability_lower": lower, "probability_upper": upper, "status": status}
        if self.options.sobol:
            names = ("sobol_first", "sobol_total", "sobol_first_interval", "sobol_total_interval")
            values |= dict(zip(names, estimates.sobol_indices(unstable, self.design), strict=True))
        return Outcome(values)

    def cost(self) -> float:
        return self.design.size * self.inner.cost()

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

    def of(self, system: GearSystem) -> Method:
        """Return the same for other systems; the design goes along."""
        other = type(self)(self.options, system)
        other.__dict__["design"] = self.design
        # What decides goes by the base system.
        other.__dict__["inner"] = self.inner
        return other
