"""The section ``design``: what is to be small over which speeds, what may change for it, and within which limits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gearstab.config.document.problems import Path, nearest
from gearstab.config.document.tree import mapping, sequence
from gearstab.config.model.axes import SPEEDS, Axis
from gearstab.config.model.fields import NUMBER, PAIR, closed
from gearstab.config.model.reading import quantity
from gearstab.config.sections import design_variables
from gearstab.config.sections.expansion import UnresolvedAxis, build, expand_list
from gearstab.config.sections.objectives import (
    OBJECTIVES,
    QUANTITIES,
    Limit,
    each,
    positive,
    read_limits,
    read_objectives,
)
from gearstab.config.sections.sweep import Context
from gearstab.config.sections.targets import INPUT_SPEED

KEYS = {
    "range": "range: {mesh_frequency: [2.0, 6.0]}",
    "variables": "variables: {meshes.first.contact_ratio: [1.1, 1.9]}",
    "minimise": "minimise: instability_width",
    "constraints": "constraints: {contact_ratio: {max: 1.9}}",
}
"""The keys of the section with an example each."""


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
