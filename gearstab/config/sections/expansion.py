"""The forms in which an axis gives its values, and the values."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from decimal import Decimal
from typing import Annotated, Any

import numpy as np
from pydantic import Field, TypeAdapter, ValidationError, WithJsonSchema

from gearstab.config.document import Code, Document, Path
from gearstab.config.model import Array, Assignment, Axis, evenly
from gearstab.config.model.conflicts import report_detail, validate
from gearstab.config.model.fields import NUMBER, AnyNumber, Choice, Section, Whole, optional
from gearstab.config.model.reading import axis_choice, number_kind
from gearstab.config.model.units import typed_unit
from gearstab.config.sections import Target, described
from gearstab.systems.base import System

LARGEST_AXIS = 100_000_000
STEP_TOLERANCE = 1e-9
"""How far from the last step, in steps, the stop still counts as hit: (stop - start)/step carries a few roundings."""


Count = Annotated[int, Field(ge=1, le=LARGEST_AXIS), Whole]
Spacing = Annotated[str, Choice("spacing", ("linear", "log"))]


class Range(Section):
    """Equally spaced values, both ends included."""

    start: AnyNumber
    """The first value."""
    stop: AnyNumber
    """The last value."""
    num: Count | None = optional("number of values")
    """How many values; or give step."""
    step: AnyNumber | None = None
    """From value to value; the stop is included when a step hits it. Or give num."""
    spacing: Spacing = "linear"
    """log: equal ratios instead of equal differences, with num."""


RANGE = {"$ref": "#/$defs/Range"}
EACH = {"anyOf": [NUMBER, {"type": "array", "minItems": 1, "items": NUMBER}, RANGE]}
TIED = {"anyOf": [NUMBER, {"type": "array", "minItems": 1, "items": EACH}, RANGE]}
"""Schema of values for all targets, or of a list of such values, one for each target."""


class Tie(Section):
    """Several parameters on one axis."""

    targets: list[str] = Field(min_length=1)
    """Names of the parameters that vary together."""
    values: Annotated[Any, WithJsonSchema(TIED)] = None
    """One list or range for all targets, or a list of them, one for each target."""
    start: AnyNumber | None = None
    """The first value, of all targets."""
    stop: AnyNumber | None = None
    """The last value, of all targets."""
    num: Count | None = optional("number of values")
    """How many values; or give step."""
    step: AnyNumber | None = None
    """From value to value; or give num."""
    spacing: Spacing | None = None
    """linear or log."""


@dataclass(frozen=True)
class Expansion:
    """The values of one parameter along an axis.

    values: a float array, or a list of exact ratios; None after problems. spec: the same as plain data, resolved.
    ends: start and stop of a range, whichever values lie between them; None where the values are given one by one.
    typed_units: the unit that the user wrote at every value; "" for plain numbers or several units.
    """

    values: Array | list[Any] | None
    spec: Any
    ends: tuple[float, float] | None = None
    typed_units: str = ""

    @property
    def size(self) -> int:
        return 0 if self.values is None else len(self.values)


FAILED = Expansion(None, None)


def expand(document: Document, path: Path, target: Target) -> Expansion:
    """The values at ``path`` (a number, a list or a range) for a parameter; reports problems to the document."""
    spec = document.get(path)
    if isinstance(spec, list):
        return expand_list(document, spec, [(*path, i) for i in range(len(spec))], target, path)
    if not isinstance(spec, dict):
        return expand_list(document, [spec], [path], target, path)
    if target.exact and not target.decimal:
        words = axis_choice(target.annotation)
        remedy = (
            'give a list such as [1, "3/5"]'
            if words is None
            else f"give a list of {', '.join(map(str, words.available))}"
        )
        message = f"{target.title} {'is exact and ' if words is None else ''}has no range"
        document.report(path, "no_range", message, remedy)
        return FAILED
    given = validate(document, Range, path)
    ends = {name: _number(document, path, name, target, ranged=name != "step") for name in ("start", "stop", "step")}
    if given is None or any(ends[name] is None for name in ends if spec.get(name) is not None):
        return FAILED
    found = _expand_range(document, path, given, ends)
    if target.exact and found.values is not None:
        return replace(found, values=list(map(float, found.values)))
    return replace(found, typed_units=typed_unit([spec["start"], spec["stop"]]))


def expand_list(document: Document, items: list[Any], places: list[Path], target: Target, path: Path) -> Expansion:
    """Return values that are given one by one, at ``places``."""
    if not items:
        document.report(path, "empty", "an axis without values", "give at least one value")
        return FAILED
    try:
        values = target.adapter.validate_python(items)
    except ValidationError as error:
        for detail in error.errors(include_url=False):
            report_detail(document, places[int(detail["loc"][0])], detail, detail["input"])
        return FAILED
    if target.exact:
        return Expansion(values, target.adapter.dump_python(values, mode="json"))
    return Expansion(np.array(values, dtype=float), values, typed_units=typed_unit(items))


def _number(document: Document, path: Path, name: str, target: Target, *, ranged: bool) -> float | None:
    """An end within the range of the parameter, or a step in its unit; None where there is none or it is wrong."""
    raw = document.get((*path, name))
    if raw is None:
        return None
    annotation: Any = target.annotation if ranged else Annotated[float, number_kind(target.annotation)]
    try:
        return float(TypeAdapter(annotation).validate_python(raw))
    except ValidationError as error:
        report_detail(document, (*path, name), error.errors(include_url=False)[0], raw)
        return None


def _expand_range(document: Document, path: Path, given: Range, ends: dict[str, float | None]) -> Expansion:
    start, stop, step = ends["start"], ends["stop"], ends["step"]
    if start is None or stop is None:
        for name in ("start", "stop"):
            if ends[name] is None:
                document.report((*path, name), "empty", "is empty", "write a number")
        return FAILED
    if (given.num is None) == (step is None):
        code: Code = "missing" if step is None else "already_given"
        message = "num or step is missing" if step is None else "num and step are given"
        document.report(path, code, message, "give num, the number of values, or step")
        return FAILED
    spec: dict[str, Any] = {"start": start, "stop": stop}
    if step is not None:
        steps = _stepped(start, stop, step, given.spacing)
        if isinstance(steps, tuple):
            document.report((*path, "step"), *steps, value=document.get((*path, "step")))
            return FAILED
        return Expansion(steps, spec | {"step": step}, (start, stop))
    spec["num"] = given.num
    if given.spacing == "linear":
        num = given.num or 1
        values = evenly(start, Decimal(repr(stop)) - Decimal(repr(start)), max(1, num - 1), num)
        return Expansion(np.linspace(start, stop, num) if values is None else values, spec, (start, stop))
    for name, value in (("start", start), ("stop", stop)):
        if value <= 0:
            hint = "choose a value > 0, or spacing: linear"
            document.report((*path, name), "out_of_range", "must be > 0 with log spacing", hint, value=value)
            return FAILED
    return Expansion(np.geomspace(start, stop, given.num or 1), spec | {"spacing": "log"}, (start, stop))


def _stepped(start: float, stop: float, step: float, spacing: str) -> Array | tuple[Code, str, str]:
    """Return the values, or code, message and remedy for a step that makes none."""
    if spacing == "log":
        return "no_range", "log spacing takes no step", "give num, the number of values"
    if step == 0 or (stop - start) / step < 0:
        sign = "positive" if stop >= start else "negative"
        return "no_range", f"must lead from {start:g} to {stop:g}", f"choose a {sign} step"
    steps = (stop - start) / step
    if steps >= LARGEST_AXIS:
        return "too_large", f"gives more than {LARGEST_AXIS} values", "choose a larger step"
    count = math.floor(steps + STEP_TOLERANCE)
    values = evenly(start, Decimal(repr(step)), 1, count + 1)
    if values is None:
        values = start + step * np.arange(count + 1)
    if abs(steps - count) <= STEP_TOLERANCE:
        values[-1] = stop  # hit to rounding: the end is what the user wrote
    return values


@dataclass
class Column:
    """Parameters that take the same values along an axis.

    items: values written one by one (cases), with the place of each; without them the values are at ``path``.
    base: the value of cases that do not set it, None where all do.
    """

    path: Path
    targets: list[Target]
    items: list[Any] = field(default_factory=list)
    places: list[Path] = field(default_factory=list)
    base: Any = None

    def expand(self, document: Document, target: Target) -> Expansion:
        if self.items:
            return expand_list(document, self.items, self.places, target, self.path)
        return expand(document, self.path, target)


@dataclass
class UnresolvedAxis:
    """An axis before its values are known.

    sound: whether every name in it has a target. labels, cases and tie: of axes in these forms, as written.
    expansions: the values of each column for each of its targets.
    """

    name: str
    columns: list[Column]
    sound: bool = True
    labels: list[str] | None = None
    tie: dict[str, Any] | None = None
    cases: list[dict[str, Any]] | None = None
    expansions: list[list[Expansion]] = field(default_factory=list)

    def expand(self, document: Document) -> None:
        """Find the values; report problems."""
        self.expansions = [[column.expand(document, t) for t in column.targets] for column in self.columns]


def build(document: Document, system: System, layout: UnresolvedAxis) -> tuple[Axis, Any] | None:
    """Return the axis and its resolved specification; None after reporting problems."""
    expansions = layout.expansions
    flat = [e for found in expansions for e in found]
    if not layout.sound or not flat or any(e.values is None for e in flat):
        return None
    sizes = [found[0].size for found in expansions]
    if len(set(sizes)) > 1:
        path = ("sweep", layout.name, "values")
        hint = "give all of them as many"
        document.report(path, "wrong_count", f"the targets have {', '.join(map(str, sizes))} values", hint)
        return None
    targets = [target for column in layout.columns for target in column.targets]
    assignments = tuple(
        Assignment(
            path,
            e.values if target.factor == 1 else np.asarray(e.values) * target.factor,
            target.factor,
            *described(path, system),
            e.typed_units,
        )
        for target, e in zip(targets, flat, strict=True)
        for path in target.paths
        if e.values is not None
    )
    values, units, title = _coordinate(layout, targets, flat[0])
    axis = Axis(layout.name, flat[0].size, values, units, title, assignments, flat[0].ends)
    return axis, _spec(layout, expansions)


def _coordinate(layout: UnresolvedAxis, targets: list[Target], first: Expansion) -> tuple[Any, str, str]:
    if layout.labels is not None:
        return layout.labels, "1", layout.name
    values = [str(v) for v in first.values] if isinstance(first.values, list) else first.values
    units = targets[0].unit if len({t.unit for t in targets}) == 1 else "1"
    titles = list(dict.fromkeys(t.title for t in targets))
    return values, units, layout.name if layout.tie and len(titles) > 1 else titles[0]


def _spec(layout: UnresolvedAxis, expansions: list[list[Expansion]]) -> Any:
    if layout.cases is not None:
        given = {
            place[-2:]: value
            for column, found in zip(layout.columns, expansions, strict=True)
            for i, (place, value) in enumerate(zip(column.places, found[0].spec, strict=True))
            if place[-2] == i
        }
        return [
            {"label": label} | {key: given[i, key] for key in entry if key != "label"}
            for i, (label, entry) in enumerate(zip(layout.labels or [], layout.cases, strict=True))
        ]
    if layout.tie is not None:
        specs = [found[0].spec for found in expansions]
        return {"targets": layout.tie["targets"], "values": specs[0] if len(specs) == 1 else specs}
    return expansions[0][0].spec
