"""Run-ups and coast-downs through the instability regions: ``methods.passage``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, PrivateAttr, model_validator

from gearstab.config.model import SPEEDS
from gearstab.config.model.conflicts import validate
from gearstab.config.model.fields import Flag, Quantity, Section
from gearstab.config.model.files import DataFileError, columns_of, text, usable
from gearstab.config.model.units import wrong
from gearstab.methods.base import RANGE, Method, Outcome, Tolerance, WidthFloor
from gearstab.results.variables import OCCURRENCE, PASSAGE, TONGUE, Variable, flagged
from gearstab.system import Array, Feature

if TYPE_CHECKING:
    from pathlib import Path as FilePath

    from gearstab.config.document import Document
    from gearstab.config.model import Axis
    from gearstab.propagation.path import Path

RAMP_COST, POWER = 1e6, 2.4
"""Cost of a ramp of three coordinates without its segments; it grows with that power of their number."""

SEARCHED, FOLLOWED = 2, 4
"""Ramps as slow as the first one, and faster ones, that the search for the slowest rate follows, about."""

Rate = Annotated[float, Quantity("rad/s^2")]


def _moving(rates: list[float]) -> list[float]:
    for rate in rates:
        if rate == 0:
            raise wrong(
                "out_of_range", "has a rate of 0, at which nothing is passed", "give rates > 0, or < 0 for downwards"
            )
    if len(set(rates)) < len(rates):
        raise wrong("equal_values", "has a rate twice", "give each once")
    return rates


def _path(knots: list[tuple[float, float]]) -> list[tuple[float, float]]:
    times = [time for time, _ in knots]
    for k, (first, second) in enumerate(pairwise(times)):
        if second <= first:
            raise wrong(
                "wrong_order", f"has the time {second:g} after {first:g} (entry {k + 1})", "give ascending times"
            )
    if any(speed <= 0 for _, speed in knots):
        raise wrong("out_of_range", "has a mesh frequency that is not positive", "give mesh frequencies > 0")
    return knots


def _table(path: FilePath) -> list[list[float]]:
    """Return time and speed of each line of a text file of two columns. Raises DataFileError, with the line."""
    usable(path, ".csv", (".csv", ".txt"))
    _, (time, speed) = columns_of(text(path), {"time": Quantity("s"), "speed": Quantity("rad/s")})
    return [list(knot) for knot in zip(time, speed, strict=True)]


class PassageOptions(Section):
    """Growth while the mesh frequency changes, from end to end of its axis at given rates, or along a path."""

    rate: (
        Annotated[list[Rate], AfterValidator(_moving), BeforeValidator(lambda v: v if isinstance(v, list) else [v])]
        | None
    ) = Field(default=None, min_length=1)
    """Change of the axis of the mesh frequency (or input_speed) per unit time; negative: downwards."""
    path: Annotated[list[tuple[float, float]], AfterValidator(_path)] | None = Field(
        default=None, min_length=2, max_length=100_000
    )
    """Instead of rates: mesh frequency (or input speed) over time, [[time, frequency], ...], straight between."""
    table: str | None = None
    """A CSV file with such a path, columns time and speed, in SI units or with a unit in brackets."""
    amplification: Annotated[float, Field(gt=1, le=1e12), Quantity()] = 10.0
    """Largest amplification that is admitted, for the slowest rate (1)."""
    tolerance: Tolerance = 1e-8
    """Error of the edges of the regions, relative to the mesh frequency (1)."""
    width_floor: WidthFloor = 1e-6
    """Regions narrower than this, relative to the mesh frequency, may be left out (1)."""
    regions: Flag = True
    """Whether regions are found and growth rates integrated; without, the exact motion alone tells."""
    _factor: float = PrivateAttr(default=1.0)

    @model_validator(mode="after")
    def _one(self) -> PassageOptions:
        given = [name for name in ("rate", "path", "table") if getattr(self, name) is not None]
        if len(given) != 1:
            what = f"has {' and '.join(given)}" if given else "has neither rates nor a path"
            raise wrong(
                "already_given" if given else "missing",
                what,
                "give one of rate: [0.1, 1.0], path: [[0, 1.0], [10, 5.0]], table: run_up.csv",
            )
        return self

    @property
    def factor(self) -> float:
        """Return the mesh frequency over the quantity of the axis, the rates and the path."""
        return self._factor


class Passage(Method):
    """Growth rates along a path, and the exact motion."""

    name = "passage"
    reused = True
    Options = PassageOptions
    frequency = RANGE
    supports = frozenset({Feature.UNSYMMETRIC_DAMPING, Feature.ROTATION})
    relief = "narrow the range of mesh_frequency, pass it faster, or follow the exact motion alone (regions: false)"
    flag_notes: ClassVar[Mapping[str, str]] = {
        "sampled": "regions of {points} are looked for by samples where multipliers meet: neither proved nor counted",
        "coarse": "regions of {points} are looked for by samples in equal steps only: narrower ones may be missing",
    }

    @cached_property
    def rates(self) -> Array:
        """``(R,)``, as the axis has them; of a path its mean one."""
        if self.options.rate is not None:
            return np.array(self.options.rate)
        knots = np.array(self.options.path)
        return np.array([(knots[-1, 1] - knots[0, 1]) / (knots[-1, 0] - knots[0, 0])])

    def paths(self, low: float, high: float) -> list[Path]:
        """Return what is followed, in mesh frequencies; low, high: the ends of the axis."""
        from gearstab.propagation.path import Path

        factor = self.options.factor
        if self.options.rate is not None:
            return [Path.ramp(low, high, factor * rate) for rate in self.rates]
        knots = np.array(self.options.path)
        return [Path(knots[:, 0] - knots[0, 0], factor * knots[:, 1])]

    def variables(self) -> tuple[Variable, ...]:
        from gearstab.passage import STATUS_FLAGS

        return (*TONGUE, OCCURRENCE, *flagged(PASSAGE, STATUS_FLAGS))

    def constants(self) -> Mapping[str, Any]:
        return {"rate": self.rates}

    def run(self, mesh_frequency: Array) -> Outcome:
        from gearstab.passage import passage

        low, high = (float(end) for end in mesh_frequency)
        options = self.options
        return Outcome(*passage(self.system, self.paths(low, high), options.amplification, self.rates,
                                options.tolerance, options.width_floor, options.regions))  # fmt: skip

    @classmethod
    def over_range(cls, options: PassageOptions) -> str:
        return "" if options.rate is None else "which is passed"

    @classmethod
    def completed(
        cls, options: PassageOptions, document: Document, source: FilePath, axes: Sequence[Axis]
    ) -> PassageOptions:
        """Return the options with the path that a file holds, in mesh frequencies of an axis of the input speed."""
        place, own = ("methods", cls.name), options
        if options.table is not None:
            try:
                knots = _table(source.parent / options.table)
            except DataFileError as error:
                document.report((*place, "table"), "file", str(error), error.hint, value=options.table)
                return options
            where = document.where((*place, "table"))
            del document.get(place)["table"]
            document.put((*place, "path"), knots, where)
            own = validate(document, PassageOptions, place) or options
        speeds = [axis.mesh_frequency for axis in axes if axis.name in SPEEDS]
        return own.knowing(factor=speeds[0].factor if speeds and speeds[0] else 1.0)

    def attributes(self) -> dict[str, Any]:
        """Return the options without the path, which stands in the configuration that the result has."""
        found = super().attributes()
        return {name: value for name, value in found.items() if name not in ("path", "rate")}

    def cost(self) -> float:
        """The search for the regions of a row, and its ramps without their segments."""
        ramp = RAMP_COST * max(1.0, self.system.size / 3) ** POWER
        if not self.options.regions:
            return len(self.rates) * ramp
        from gearstab.floquet.report import search_cost

        return search_cost(self.system, self.system.size) + (len(self.rates) + SEARCHED + FOLLOWED) * ramp
