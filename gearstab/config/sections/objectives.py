"""Objectives and constraints of a design: the quantities that judge it, without their computation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field, TypeAdapter, ValidationError

from gearstab.config.document.problems import Path, dotted, nearest
from gearstab.config.document.tree import Document, is_number, mapping
from gearstab.config.model.conflicts import report_detail
from gearstab.config.model.values import Quantity

if TYPE_CHECKING:
    from gearstab.config.sections.sweep import Context
    from gearstab.config.sections.targets import Target

NonNegative = Field(ge=0)


@dataclass(frozen=True)
class Criterion:
    """A quantity: its unit, long name, and the type of a number that limits it."""

    units: str
    long_name: str
    annotation: Any


def _named(units: str, long_name: str) -> Criterion:
    return Criterion(units, long_name, Annotated[float, NonNegative, Quantity(units)])


QUANTITIES = {
    "instability_width": _named("rad/s", "width of all instability regions within the operating range"),
    "growth_rate": _named("1/s", "largest growth rate within the operating range"),
    "required_damping": _named("1", "damping ratio of all modes from which on the operating range is stable"),
    "load_factor": _named("1", "largest dynamic load factor of the steady state within the operating range"),
    "tongue_distance": _named("rad/s", "distance from the operating range to the nearest instability region"),
    "root_stress": _named("Pa", "largest static stress at the root of a tooth (ISO 6336-3)"),
    "transmission_error": _named("m", "peak-to-peak static transmission errors of teeth with relief, summed up"),
}
"""By the name that a configuration uses."""

OBJECTIVES = tuple(name for name in QUANTITIES if name != "tongue_distance")
"""Quantities that can be minimised."""


def objective_name(weights: Mapping[str, float]) -> str:
    """Name a weighted sum: ``instability_width``, ``instability_width + 0.2 load_factor``."""
    return " + ".join(name if weight == 1 else f"{weight:g} {name}" for name, weight in weights.items())


def objective_unit(weights: Mapping[str, float]) -> str:
    """Return the unit of a weighted sum, 1 of several quantities."""
    return QUANTITIES[next(iter(weights))].units if len(weights) == 1 else "1"


@dataclass(frozen=True)
class Limit:
    """A constraint: low <= the quantity, or the numbers at these paths below ``system``, <= high, in SI units."""

    name: str
    paths: tuple[Path, ...]
    low: float
    high: float
    units: str

    @property
    def ends(self) -> dict[str, float]:
        """``min`` and ``max`` that are given."""
        return {name: value for name, value in (("min", self.low), ("max", self.high)) if np.isfinite(value)}


def each(path: Path, spec: Any) -> list[tuple[Path, Any]]:
    """Return path and value of each entry of a list, or of a single value."""
    return [((*path, i), item) for i, item in enumerate(spec)] if isinstance(spec, list) else [(path, spec)]


def positive(document: Document, path: Path, value: Any) -> float | None:
    """Return a number > 0; None after reporting that it is none."""
    if is_number(value) and 0 < value < np.inf:
        return float(value)
    document.report(path, "wrong_type", "must be a number > 0", "write a number > 0", value=value)
    return None


def read_objectives(document: Document, spec: Any) -> Iterator[dict[str, float]]:
    """Weights by name, of each objective."""
    path: Path = ("design", "minimise")
    if spec in (None, [], {}):
        return
    seen: list[Any] = []
    for place, item in each(path, spec):
        if item in seen:
            document.report(place, "repeated_name", "stands there twice", "name each objective once", value=item)
        seen.append(item)
        found = _objective(document, place, item)
        if found:
            yield found


def _objective(document: Document, path: Path, item: Any) -> dict[str, float]:
    weights = {item: 1.0} if isinstance(item, str) else mapping(item)
    if not weights:
        hint = f"write one of {', '.join(OBJECTIVES)}, or a mapping of weights"
        document.report(path, "wrong_type", "must name what is to be small", hint, value=item)
        return {}
    found = {}
    for name, weight in weights.items():
        place = (*path, name) if weights is item else path
        if name not in OBJECTIVES:
            hint = nearest(str(name), OBJECTIVES)
            document.report(place, "unknown_name", f"'{name}' is no objective", hint, at_key=True)
            continue
        number = positive(document, place, weight)
        if number is not None:
            found[name] = number
    return found


def read_limits(context: Context, spec: Any) -> Iterator[Limit]:
    """Yield the constraints of a section as written; report problems."""
    document, path = context.document, ("design", "constraints")
    if spec in (None, {}):
        return
    if not mapping(spec):
        hint = "write constraints: {contact_ratio: {max: 1.9}}"
        document.report(path, "wrong_type", "must be a mapping", hint, value=spec)
        return
    for name, ends in spec.items():
        found = _limit(context, (*path, name), name, ends)
        if found is not None:
            yield found


def _limit(context: Context, path: Path, name: str, ends: Any) -> Limit | None:
    document = context.document
    if not mapping(ends) or not ends.keys() <= {"min", "max"}:
        document.report(path, "missing", "must give min, max or both", "write {min: .., max: ..}", value=ends or None)
        return None
    targets: list[Target] = []
    if name in QUANTITIES:
        units = QUANTITIES[name].units
        adapter: TypeAdapter[Any] = TypeAdapter(QUANTITIES[name].annotation)
    else:
        targets = context.resolve(name, path)
        if not targets:
            return None
        if targets[0].exact and not targets[0].counted:
            hint = "give the choices in variables"
            document.report(path, "no_range", "is no number that has limits", hint, at_key=True)
            return None
        units, adapter = targets[0].unit, TypeAdapter(targets[0].plain)
    values = {"min": -np.inf, "max": np.inf}
    for key, value in ends.items():
        try:
            values[key] = float(adapter.validate_python(value))
        except ValidationError as error:
            report_detail(document, (*path, key), error.errors(include_url=False)[0], value)
            return None
    if values["min"] > values["max"]:
        document.report(path, "wrong_order", "min is larger than max", "exchange the two", value=dotted(path))
        return None
    paths = tuple(item.paths[0] for item in targets)
    return Limit(name, paths, values["min"], values["max"], units)
