"""The uncertain parameters of ``methods.tolerance``: the targets of their names, and how they are distributed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np
from pydantic_core import PydanticCustomError

from gearstab.config.document import Document, Path, Problem, dotted, mapping, sequence, value_at
from gearstab.config.model import MESH_FREQUENCY, Array, Axis, Grid, replaced
from gearstab.config.model.conflicts import report_wrong
from gearstab.config.model.fields import Quantity
from gearstab.config.model.reading import as_far_as_right, quantity
from gearstab.config.sections import Target
from gearstab.config.sections.sweep import BaseValue, Context, is_absent
from gearstab.systems.base import System
from gearstab.tolerance import DISTRIBUTIONS, Distribution, groups_of

SECTION: Path = ("methods", "tolerance")
OUTSIDE = 1e-6
"""Probability beyond what a parameter can be that goes without saying."""


@dataclass(frozen=True)
class Uncertain:
    """A parameter that is not known exactly.

    name: as in the configuration. paths: the numbers below ``system`` that it sets, or that of the mesh frequency, each
    with the factor of the number there over the parameter. distribution: of the parameter, or with ``deviation`` of
    what is added to its value. low, high: between which it can be.
    """

    name: str
    paths: tuple[tuple[Path, float], ...]
    distribution: Distribution
    deviation: bool
    low: float
    high: float

    def values(self, u: Array, present: Any, factor: float) -> Array:
        """Return values for u, uniform in (0, 1), given the ``present`` ones, of a number with this factor."""
        if not self.deviation:
            return factor * self.distribution.quantile(u, np.asarray(self.low), np.asarray(self.high))
        value = np.asarray(present, dtype=float) / factor
        return np.asarray(factor * (value + self.distribution.quantile(u, self.low - value, self.high - value)))

    def below(self, x: Array, present: Any, factor: float) -> Array:
        """Return the probability of less than ``x``, of a number with this factor, given the ``present`` values."""
        value = np.asarray(present, dtype=float) / factor if self.deviation else np.zeros(())
        first, last = (self.distribution.below(end - value) for end in (self.low, self.high))
        return np.clip((self.distribution.below(x / factor - value) - first) / (last - first), 0.0, 1.0)

    def outside(self, present: Any) -> float:
        """Return the greatest probability of what it cannot be, given any of the ``present`` values."""
        value = np.asarray(present if self.deviation else 0.0, dtype=float)
        return float(np.max(self.distribution.outside(self.low - value, self.high - value)))


@dataclass(frozen=True)
class Uncertainties:
    """All uncertain parameters. correlation: ``(d, d)``, of their normal deviates; groups: what it connects."""

    parameters: tuple[Uncertain, ...]
    correlation: Array
    groups: tuple[int, ...]

    def sampled(self, system: System, points: Array) -> System:
        """Return the section ``system`` with the numbers that are uncertain replaced by arrays ``(N,)``.

        points: ``(N, d)`` in the unit cube. What they are replaced by may depend on arrays that are there already.
        """
        for own, u in zip(self.parameters, points.T, strict=True):
            for path, factor in own.paths:
                if path != MESH_FREQUENCY:
                    present = _present(system, path) if own.deviation else 0.0
                    system = replaced(system, path, own.values(u, present, factor))
        return system

    def mesh_frequency(self, present: Array, points: Array) -> Array:
        """Return mesh frequencies ``(N, P)`` for those that the grid has, ``(P,)`` or ``(N, 1)``."""
        for own, u in zip(self.parameters, points.T, strict=True):
            for path, factor in own.paths:
                if path == MESH_FREQUENCY:
                    return np.asarray(own.values(u[:, None], present, factor))
        return present

    def doubts(self, document: Document, grid: Grid[System]) -> list[Problem]:
        """Return what is said of distributions that reach beyond what their parameters can be."""
        swept = {item.path: (item.values, item.factor) for axis in grid.axes for item in axis.assignments}
        problems = []
        for own in self.parameters:
            path, factor = own.paths[0]
            present = 0.0 if path == MESH_FREQUENCY else _present(grid.system, path)
            values, scale = swept.get(path, (present, factor))
            share = own.outside(np.asarray(values, dtype=float) / scale)
            if share > OUTSIDE:
                message = f"{100 * share:.3g} % of the distribution lies outside of {_between(own.low, own.high)}"
                hint = "it is cut off there; choose a narrower one if that is not what is meant"
                problems.append(document.problem((*SECTION, "parameters", own.name), "unusual", message, hint))
        return problems

    @property
    def speed(self) -> tuple[Uncertain, float] | None:
        """Return the uncertain mesh frequency, or its deviation, and the factor of the one over the other."""
        found = ((own, factor) for own in self.parameters for path, factor in own.paths if path == MESH_FREQUENCY)
        return next(found, None)

    @property
    def sets_mesh_frequency(self) -> bool:
        """Whether the mesh frequency has a distribution of its own, so that it needs no axis."""
        return any(path == MESH_FREQUENCY and not own.deviation for own in self.parameters for path, _ in own.paths)


def _present(system: System, path: Path) -> Any:
    """Return the value at a path, in a matrix too, which may be one for each row of a batch."""
    for length in range(len(path)):
        inner = value_at(system, path[:length])
        if isinstance(inner, np.ndarray):
            row, column = (int(part) for part in path[length:])
            return inner[..., row, column]
    return value_at(system, path)


def resolve(context: Context, section: Any) -> dict[str, list[Target]]:
    """Return the targets of each uncertain parameter of a section as written; report names that have none."""
    names = mapping(mapping(section).get("parameters"))
    return {name: context.resolve(name, (*SECTION, "parameters", name)) for name in names}


def base_values(context: Context, targets: Mapping[str, list[Target]]) -> Iterator[BaseValue]:
    """Yield the middle of the distribution of every number that has one and no value."""
    document = context.document
    for name, found in targets.items():
        path = (*SECTION, "parameters", name)
        for kind in DISTRIBUTIONS:
            numbers = sequence(document.get((*path, kind)))
            if len(numbers) < 2 or document.get((*path, "deviation")) is True:
                continue
            for target in (own for own in found if own.paths[0] != MESH_FREQUENCY):
                if is_absent(context, target.paths[0]):
                    middle = numbers[len(numbers) // 2 if kind == "triangular" else 0]
                    yield target.paths[0], as_far_as_right(target.annotation, middle), document.where(path)


def uncertainties(
    context: Context, section: Any, targets: Mapping[str, list[Target]], axes: Sequence[Axis]
) -> tuple[Uncertainties | None, dict[str, Any]]:
    """Return the uncertain parameters, None after reporting problems, and their section in SI units.

    section: the options, validated.
    """
    before = len(context.document.problems)
    found = [_uncertain(context, name, section.parameters[name], own) for name, own in targets.items() if own]
    names = list(section.parameters)
    _report_rivals(context, targets, axes, section)
    matrix, pairs = _correlation(context, section, names)
    if section.integrate_speed:
        _report_speed(context, targets, [names[k] for pair in pairs for k in pair])
    if len(context.document.problems) > before or any(own is None for own in found):
        return None, section.parameters
    known = tuple(own for own in found if own is not None)
    plain = {
        own.name: type(section.parameters[own.name])(
            **{own.distribution.key: list(own.distribution.numbers), "deviation": own.deviation}
        )
        for own in known
    }
    return Uncertainties(known, matrix, groups_of(len(known), pairs)), plain


def _uncertain(context: Context, name: str, given: Any, targets: list[Target]) -> Uncertain | None:
    path = (*SECTION, "parameters", name)
    document, first = context.document, targets[0]
    unit = quantity(first.annotation)
    if first.exact or unit is None:
        hint = "sweep it instead"
        message = f"{first.title} is exact, or a word, and has no distribution"
        document.report(path, "no_range", message, hint, at_key=True)
        return None
    key = next((key for key in DISTRIBUTIONS if getattr(given, key) is not None), None)
    if key is None:
        return None
    numbers = [_number(context, (*path, key, i), value, unit) for i, value in enumerate(getattr(given, key))]
    if None in numbers:
        return None
    distribution = Distribution(key, tuple(float(number) for number in numbers if number is not None))
    if distribution.mistake is not None:
        document.report((*path, key), "inconsistent", *distribution.mistake, value=document.get((*path, key)))
        return None
    low, high = domain(first.annotation)
    paths = tuple((place, target.factor) for target in targets for place in target.paths)
    own = Uncertain(name, paths, distribution, given.deviation, low, high)
    if not given.deviation and not low <= distribution.central <= high:
        text = f"lies about {distribution.central:g}, and {first.title} is {_between(low, high)}"
        hint = "choose a distribution within that"
        document.report((*path, key), "out_of_range", text, hint, value=document.get((*path, key)))
        return None
    return own


def _number(context: Context, path: Path, value: Any, unit: Quantity) -> float | None:
    """A number in the unit of the parameter, of any sign; None after reporting that it is none."""
    try:
        return unit.number(value)
    except PydanticCustomError as error:
        report_wrong(context.document, path, error, value)
        return None


def domain(annotation: Any) -> tuple[float, float]:
    """Return between which numbers a field lets its value be."""
    low, high = -np.inf, np.inf
    for item in get_args(annotation)[1:]:
        for bound in (item, *getattr(item, "metadata", ())):
            low = max(low, *(getattr(bound, name) for name in ("gt", "ge") if hasattr(bound, name)), -np.inf)
            high = min(high, *(getattr(bound, name) for name in ("lt", "le") if hasattr(bound, name)), np.inf)
    return low, high


def _between(low: float, high: float) -> str:
    return f"{low:g} at least" if np.isinf(high) else f"{high:g} at most" if np.isinf(low) else f"{low:g} to {high:g}"


def _report_rivals(context: Context, targets: Mapping[str, list[Target]], axes: Sequence[Axis], section: Any) -> None:
    """A number can have one distribution, and one that the sweep sets too only deviations from what that sets."""
    owners: dict[Path, str] = {}
    swept = {item.path: axis.name for axis in axes for item in axis.assignments}
    for name, found in targets.items():
        place = (*SECTION, "parameters", name)
        for path in (path for target in found for path in target.paths):
            other = owners.setdefault(path, name)
            if other != name:
                message = f"sets {dotted(path)}, as {other} does"
                context.document.report(place, "set_twice", message, "let one of the two set it", at_key=True)
                break
            if path in swept and not section.parameters[name].deviation:
                message = f"the axis {swept[path]} sets it too"
                hint = "add deviation: true and give the distribution of the deviation, or remove the axis"
                context.document.report(place, "set_twice", message, hint, at_key=True)
                break
            if path not in swept and path == MESH_FREQUENCY and section.parameters[name].deviation:
                hint = "remove deviation and give the distribution of the speed itself, or add the axis"
                context.document.report(place, "no_range", "deviates from nothing: no axis sets it", hint, at_key=True)


def _report_speed(context: Context, targets: Mapping[str, list[Target]], correlated: Sequence[str]) -> None:
    """Report that there is no speed to integrate, or one that depends on what is drawn."""
    path = (*SECTION, "integrate_speed")
    speeds = [name for name, found in targets.items() if any(MESH_FREQUENCY in own.paths for own in found)]
    if not speeds:
        hint = "give mesh_frequency a distribution under parameters, or remove this"
        context.document.report(path, "needs_other", "needs a mesh frequency that is uncertain", hint, at_key=True)
    elif speeds[0] in correlated:
        hint = "remove its correlation, or this"
        context.document.report(path, "inconsistent", f"needs {speeds[0]} to be independent", hint, at_key=True)


def _correlation(context: Context, section: Any, names: list[str]) -> tuple[Array, list[tuple[int, int]]]:
    """The matrix, and which parameters it connects; reports problems."""
    matrix, pairs = np.eye(len(names)), []
    for k, entry in enumerate(section.correlation or ()):
        path: Path = (*SECTION, "correlation", k)
        wrong = [name for name in entry.between if name not in names]
        for name in wrong:
            hint = f"name two of {', '.join(names)}"
            context.document.report((*path, "between"), "unknown_name", f"'{name}' has no distribution here", hint)
        if wrong:
            continue
        i, j = (names.index(name) for name in entry.between)
        if i == j or (min(i, j), max(i, j)) in pairs:
            hint = "name two different parameters, each pair once"
            message = "is no further pair"
            context.document.report((*path, "between"), "equal_values", message, hint, value=list(entry.between))
            continue
        matrix[i, j] = matrix[j, i] = entry.value
        pairs.append((min(i, j), max(i, j)))
    if len(pairs) > 1 and np.linalg.eigvalsh(matrix)[0] <= 1e-10:
        message, hint = "contradict each other: their matrix is not positive definite", "bring some of them nearer to 0"
        context.document.report((*SECTION, "correlation"), "inconsistent", message, hint)
    return matrix, pairs
