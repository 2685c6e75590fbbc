"""The section ``design``: what is to be small over which speeds, what may change for it, and within which limits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from pydantic import Field, TypeAdapter, ValidationError

from gearstab.config.document import Document, Path, dotted, is_number, mapping, nearest, sequence
from gearstab.config.model import SPEEDS, Axis
from gearstab.config.model.conflicts import report_detail
from gearstab.config.model.fields import NUMBER, PAIR, Quantity, closed
from gearstab.config.model.reading import quantity
from gearstab.config.sections import INPUT_SPEED, Target, design_variables
from gearstab.config.sections.expansion import UnresolvedAxis, build, expand_list
from gearstab.config.sections.sweep import Context

KEYS = {
    "range": "range: {mesh_frequency: [2.0, 6.0]}",
    "variables": "variables: {meshes.first.contact_ratio: [1.1, 1.9]}",
    "minimise": "minimise: instability_width",
    "constraints": "constraints: {contact_ratio: {max: 1.9}}",
}
"""The keys of the section with an example each."""


@dataclass(frozen=True)
class Criterion:
    """A quantity that judges a design: its unit and long name."""

    units: str
    long_name: str

    @property
    def annotation(self) -> Any:
        """The type of a number that limits it."""
        return Annotated[float, Field(ge=0), Quantity(self.units)]


QUANTITIES = {
    "instability_width": Criterion("rad/s", "width of all instability regions within the operating range"),
    "growth_rate": Criterion("1/s", "largest growth rate within the operating range"),
    "required_damping": Criterion("1", "damping ratio of all modes from which on the operating range is stable"),
    "load_factor": Criterion("1", "largest dynamic load factor of the steady state within the operating range"),
    "tongue_distance": Criterion("rad/s", "distance from the operating range to the nearest instability region"),
    "root_stress": Criterion("Pa", "largest static stress at the root of a tooth (ISO 6336-3)"),
    "transmission_error": Criterion("m", "peak-to-peak static transmission errors of teeth with relief, summed up"),
}
"""By the name that a configuration uses."""

OBJECTIVES = tuple(name for name in QUANTITIES if name != "tongue_distance")
"""Quantities that can be minimised."""


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


@dataclass(frozen=True)
class DesignVariable:
    """A quantity that may change.

    axis: its values as those of an axis of a sweep, both bounds of a continuous one, else all choices.
    form: how it is given: ``bounds``, ``integers``, ``values`` or ``choices``.
    turns: whether it is a part of a turn, such as a phasing, so that values 1 apart are the same.
    """

    axis: Axis
    form: str
    turns: bool = False

    @property
    def name(self) -> str:
        """Its key in the section."""
        return self.axis.name

    @property
    def continuous(self) -> bool:
        """Whether every number between two bounds is allowed."""
        return self.form == "bounds"

    @property
    def bounds(self) -> tuple[float, float]:
        """The bounds of a continuous variable."""
        low, high = np.asarray(self.axis.values, dtype=float)
        return float(low), float(high)

    @property
    def periodic(self) -> bool:
        """Whether its bounds hold a whole turn, so that they bound nothing."""
        return self.continuous and self.turns and self.bounds[1] - self.bounds[0] >= 1


@dataclass(frozen=True)
class SpeedRange:
    """Operating speeds: low to high of the mesh frequency or, ``of`` says which, of the input speed, rad/s.

    typed_units: the unit that the user wrote at both ends; "" for plain numbers.
    """

    of: str
    low: float
    high: float
    weight: float = 1.0
    typed_units: str = ""

    @property
    def shown_units(self) -> str:
        """The unit for a reader: that typed, rpm of an input speed without one, "" for SI."""
        return self.typed_units or ("rpm" if self.of == INPUT_SPEED else "")


@dataclass(frozen=True)
class Design:
    """A design problem as read.

    objectives: weights by name of quantity; several are for a Pareto front. tree: the section as plain data, resolved.
    """

    variables: tuple[DesignVariable, ...]
    ranges: tuple[SpeedRange, ...]
    objectives: tuple[Mapping[str, float], ...]
    limits: tuple[Limit, ...]
    tree: Mapping[str, Any]


def layouts(context: Context) -> list[UnresolvedAxis]:
    """Find what each variable sets; what is wrong with the section's keys and variables is reported."""
    document = context.document
    section = mapping(document.get(("design",)))
    if not section:
        hint = f"add {', '.join(KEYS[key] for key in ('range', 'variables', 'minimise'))}"
        document.report(("design",), "wrong_type", "must be a mapping", hint, value=document.get(("design",)) or None)
        return []
    for key in section:
        if key not in KEYS:
            document.report(("design", key), "unknown_key", "unknown key", nearest(key, KEYS), at_key=True)
    for key in ("range", "variables", "minimise"):
        if section.get(key) in (None, [], {}):
            document.report(("design", key), "missing", "is missing", f"add {KEYS[key]}")
    return list(design_variables.layouts(context)) if section.get("variables") else []


def read(context: Context, found: list[UnresolvedAxis]) -> Design | None:
    """Read the section; None after reporting problems."""
    before = len(context.document.problems)
    variables, specs = [], {}
    for layout in found:
        built = build(context.document, context.system, layout)
        form = design_variables.form_of(context.document, layout.name)
        if built is None or form is None:
            continue
        kinds = [quantity(target.annotation) for column in layout.columns for target in column.targets]
        variables.append(DesignVariable(built[0], form, all(kind is not None and kind.turns for kind in kinds)))
        values = [int(float(built[1][k])) for k in (0, -1)] if form == "integers" else built[1]
        specs[layout.name] = values if form == "bounds" else {form: values}
        design_variables.check(context.document, variables[-1].axis, form)
    section = mapping(context.document.get(("design",)))
    ranges = list(_ranges(context, section.get("range")))
    objectives = list(read_objectives(context.document, section.get("minimise")))
    limits = list(read_limits(context, section.get("constraints")))
    if len(context.document.problems) > before or not (variables and ranges and objectives):
        return None
    tree = {
        "range": [{item.of: [item.low, item.high], "weight": item.weight} for item in ranges],
        "variables": specs,
        "minimise": [dict(item) for item in objectives] if len(objectives) > 1 else dict(objectives[0]),
    }
    if limits:
        tree["constraints"] = {item.name: item.ends for item in limits}
    return Design(tuple(variables), tuple(ranges), tuple(objectives), tuple(limits), tree)


def _ranges(context: Context, spec: Any) -> Iterator[SpeedRange]:
    document, path = context.document, ("design", "range")
    if spec in (None, [], {}):
        return
    for place, item in each(path, spec):
        found = _range(context, place, item)
        if found is not None:
            yield found
    kinds = {key for _, item in each(path, spec) for key in mapping(item) if key in SPEEDS}
    if len(kinds) > 1:
        hint = "use one of the two for all"
        document.report(path, "needs_other", "some ranges are of mesh_frequency and some of input_speed", hint)


def _range(context: Context, path: Path, item: Any) -> SpeedRange | None:
    document = context.document
    named = [key for key in SPEEDS if key in mapping(item)]
    if len(named) != 1:
        hint = f"write {KEYS['range']}, or input_speed with speeds of the input"
        message = "must give one of mesh_frequency, input_speed"
        document.report(path, "missing", message, hint, value=None if named else item)
        return None
    for key in item:
        if key not in (*SPEEDS, "weight"):
            document.report((*path, key), "unknown_key", "unknown key", nearest(key, (*SPEEDS, "weight")), at_key=True)
    of, ends = named[0], item[named[0]]
    weight = positive(document, (*path, "weight"), item["weight"]) if "weight" in item else 1.0
    targets = context.resolve(of, (*path, of))
    if len(sequence(ends)) != 2:
        hint = "write [low, high]"
        document.report((*path, of), "wrong_type", "must be the lowest and the highest speed", hint, value=ends)
        return None
    if not targets:
        return None
    found = expand_list(document, ends, [(*path, of, i) for i in range(2)], targets[0], (*path, of))
    if found.values is None or weight is None:
        return None
    low, high = (float(value) for value in found.values)
    if not low < high:
        document.report((*path, of), "wrong_order", "is no range", "give the lower speed first", value=ends)
        return None
    return SpeedRange(of, low, high, weight, found.typed_units)


def objective_name(weights: Mapping[str, float]) -> str:
    """Name a weighted sum: ``instability_width``, ``instability_width + 0.2 load_factor``."""
    return " + ".join(name if weight == 1 else f"{weight:g} {name}" for name, weight in weights.items())


def objective_unit(weights: Mapping[str, float]) -> str:
    """Return the unit of a weighted sum, 1 of several quantities."""
    return QUANTITIES[next(iter(weights))].units if len(weights) == 1 else "1"


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


def json_schema() -> dict[str, Any]:
    """Return the schema of the section, which refers to the definition ``Case``."""
    positive_number = {"type": "number", "exclusiveMinimum": 0}
    span = closed(
        {
            "mesh_frequency": PAIR | {"description": "Lowest and highest frequency of the first mesh (rad/s)."},
            "input_speed": PAIR | {"description": "Of systems with an input, in place of mesh_frequency."},
            "weight": positive_number | {"description": "Of this range; default 1."},
        }
    )
    weights = {name: positive_number | {"description": QUANTITIES[name].long_name} for name in OBJECTIVES}
    goal = {"anyOf": [{"enum": list(OBJECTIVES)}, closed(weights, minProperties=1)]}
    limit = closed({"min": NUMBER, "max": NUMBER}, minProperties=1)
    limits = {name: limit | {"description": item.long_name} for name, item in QUANTITIES.items()}
    variable = design_variables.json_schema()
    return closed(
        {
            "range": {"anyOf": [span, {"type": "array", "minItems": 1, "items": span}]},
            "variables": {"type": "object", "minProperties": 1, "additionalProperties": variable},
            "minimise": {"anyOf": [goal, {"type": "array", "minItems": 1, "items": goal}]},
            "constraints": {"type": "object", "properties": limits, "additionalProperties": limit},
        },
        description="What gearstab design may change, and what for.",
        required=["range", "variables", "minimise"],
    )
