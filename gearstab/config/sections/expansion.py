"""The forms in which an axis gives its values, and the values."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import Annotated, Any

import numpy as np
from pydantic import Field, TypeAdapter, ValidationError

from gearstab.config.document.problems import Code, Path, code_of
from gearstab.config.document.tree import Document
from gearstab.config.model.axes import Array
from gearstab.config.model.conflicts import explain, validate
from gearstab.config.model.fields import AnyNumber, Choice, Section, Whole, optional
from gearstab.config.model.reading import axis_choice, number_kind
from gearstab.config.model.units import typed_unit
from gearstab.config.sections.targets import Target

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
    """Values given one by one, which stand at ``places``."""
    if not items:
        document.report(path, "empty", "an axis without values", "give at least one value")
        return FAILED
    try:
        values = target.adapter.validate_python(items)
    except ValidationError as error:
        for detail in error.errors(include_url=False):
            message, hint = explain(detail)
            document.report(
                places[int(detail["loc"][0])], code_of(detail["type"]), message, hint, value=detail["input"]
            )
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
        detail = error.errors(include_url=False)[0]
        message, hint = explain(detail)
        document.report((*path, name), code_of(detail["type"]), message, hint, value=raw)
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
        typed = document.get((*path, "step"))

        def report(code: Code, message: str, hint: str) -> None:
            document.report((*path, "step"), code, message, hint, value=typed)

        values = _stepped(start, stop, step, given.spacing, report)
        return FAILED if values is None else Expansion(values, spec | {"step": step}, (start, stop))
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


def evenly(start: float, change: Decimal, parts: int, count: int) -> Array | None:
    """Return start + i change/parts for i < count, each rounded once; None unless all are short decimal numbers.

    Numerator and denominator are whole numbers that doubles hold exactly, so that 3 steps of 0.1 are 0.3.
    """
    first = Decimal(repr(start))
    digits = max(0, *(-int(number.as_tuple().exponent) for number in (first, change)))
    if digits > EXACT_POWER:
        return None
    a, b = (int(number.scaleb(digits)) for number in (first, change))
    endless = parts // math.gcd(b, parts)
    for factor in (2, 5):
        while endless % factor == 0:
            endless //= factor
    if endless > 1 or max(abs(a) * parts + abs(b) * count, parts * 10**digits) > EXACT:
        return None
    return np.asarray((a * parts + b * np.arange(count)) / (parts * 10**digits))


EXACT = 2**53
"""Whole numbers up to this one are doubles."""
EXACT_POWER = 22
"""The largest power of ten that is a double."""


def _stepped(
    start: float, stop: float, step: float, spacing: str, report: Callable[[Code, str, str], None]
) -> Array | None:
    if spacing == "log":
        report("no_range", "log spacing takes no step", "give num, the number of values")
    elif step == 0 or (stop - start) / step < 0:
        sign = "positive" if stop >= start else "negative"
        report("no_range", f"must lead from {start:g} to {stop:g}", f"choose a {sign} step")
    elif (stop - start) / step >= LARGEST_AXIS:
        report("too_large", f"gives more than {LARGEST_AXIS} values", "choose a larger step")
    else:
        steps = (stop - start) / step
        count = math.floor(steps + STEP_TOLERANCE)
        values = evenly(start, Decimal(repr(step)), 1, count + 1)
        if values is None:
            values = start + step * np.arange(count + 1)
        if abs(steps - count) <= STEP_TOLERANCE:
            values[-1] = stop  # hit to rounding: the end is what the user wrote
        return values
    return None
