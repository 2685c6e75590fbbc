"""``design.variables``: in which forms a variable is given, and what it sets."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from gearstab.config.document import Document, Path, is_number, mapping, nearest, sequence
from gearstab.config.document.yaml import number
from gearstab.config.model import Axis, files
from gearstab.config.model.fields import NUMBER, PAIR, closed
from gearstab.config.model.files import PLAIN, head
from gearstab.config.sections import INPUT_SPEED, MESH_FREQUENCY, Target
from gearstab.config.sections.expansion import Column, UnresolvedAxis
from gearstab.config.sections.sweep import Context, cases, report_rivals

FORMS = {
    "integers": "{integers: [17, 40]}",
    "values": "{values: [1.2, 1.4]}",
    "catalogue": "{catalogue: gears.csv}",
    "choices": "{choices: [{label: A, path: value}]}",
}
"""The forms of a variable that takes one of a few values."""
PLACE: Path = ("design", "variables")
MOST_CHOICES = 10_000
"""Most choices of one variable."""


def layouts(context: Context) -> Iterator[UnresolvedAxis]:
    """Find what each variable sets; report unknown forms, names without a target, and rivals."""
    document = context.document
    section = mapping(document.get(PLACE))
    if not section:
        hint = "write a path and its bounds, such as epsilon: [0.1, 0.3]"
        document.report(PLACE, "wrong_type", "must be a mapping", hint)
        return
    found = [layout for name in section if (layout := _layout(context, name)) is not None]
    report_rivals(document, found)
    for layout in found:
        layout.expand(document)
        yield layout


def form_of(document: Document, name: str) -> str | None:
    """The form of a variable that was found right, once a catalogue was read."""
    spec = document.get((*PLACE, name))
    if isinstance(spec, list):
        return "bounds"
    return next((key for key in FORMS if key in mapping(spec)), None)


def check(document: Document, axis: Axis, form: str) -> None:
    """Report bounds that are none, or of something that has no bounds, and choices that are equal."""
    path = (*PLACE, axis.name)
    if form != "bounds":
        texts = [tuple(repr(item.values[k]) for item in axis.assignments) for k in range(axis.size)]
        twice = next((k for k, text in enumerate(texts) if text in texts[:k]), None)
        if twice is not None:
            hint = "give every choice once"
            document.report((*path, form), "equal_values", f"choice {twice + 1} stands there twice", hint)
        return
    if any(item.structural for item in axis.assignments):
        hint = "give {integers: [low, high]} or {values: [..]}"
        document.report(path, "no_range", "is exact or a word and has no bounds", hint)
    elif not axis.values[0] < axis.values[1]:
        hint = "give the lower bound first"
        document.report(path, "wrong_order", "has no room between its bounds", hint, value=document.get(path))


def _layout(context: Context, name: str) -> UnresolvedAxis | None:
    document, path = context.document, (*PLACE, name)
    if name in (MESH_FREQUENCY[0], INPUT_SPEED):
        hint = "give it in design.range"
        document.report(path, "not_applicable", "is what the range is of, and no variable", hint, at_key=True)
        return None
    spec = document.get(path)
    if isinstance(spec, list):
        return _of_bounds(context, name, path, spec)
    forms = mapping(spec)
    wrong = [key for key in forms if key not in FORMS]
    if len(forms) != 1 or wrong:
        hint = nearest(wrong[0], FORMS) if wrong else f"write [low, high], or one of {', '.join(FORMS.values())}"
        document.report(path, "missing", "has no bounds and no choices", hint, value=spec or None)
        return None
    ((form, given),) = forms.items()
    if form == "integers":
        items = _integers(document, (*path, form), given)
        return None if items is None else _of_values(context, name, (*path, form), items)
    if form == "values":
        if not sequence(given):
            hint = "write values: [1.2, 1.4]"
            document.report((*path, form), "wrong_type", "must be a list of values", hint, value=given)
            return None
        return _of_values(context, name, (*path, form), given)
    entries = given if form == "choices" else _catalogue(document, path, given)
    return None if entries is None else _of_choices(context, name, (*path, "choices"), entries)


def _of_bounds(context: Context, name: str, path: Path, spec: list[Any]) -> UnresolvedAxis | None:
    if len(spec) != 2:
        hint = "write [low, high]"
        context.document.report(path, "wrong_type", "must be the lower and the upper bound", hint, value=spec)
        return None
    targets = context.resolve(name, path)
    if not targets:
        return None
    middle = 0.5 * (spec[0] + spec[1]) if all(map(is_number, spec)) else spec[0]
    return UnresolvedAxis(name, [Column(path, targets, base=_given(targets, middle))])


def _given(targets: list[Target], otherwise: Any) -> Any:
    """Return the value of a number that the system does not give: its default, where it has one."""
    default = targets[0].default
    if default is None:
        return otherwise
    return str(default) if isinstance(default, Fraction) else default


def _of_values(context: Context, name: str, path: Path, items: list[Any]) -> UnresolvedAxis | None:
    """Also of a number that has a base value: a choice that is not one of the base system is no mistake."""
    targets: list[Target] = context.resolve(name, path[:-1])
    if not targets:
        return None
    places = [(*path, i) if path[-1] == "values" else path for i in range(len(items))]
    return UnresolvedAxis(name, [Column(path, targets, items, places, _given(targets, items[0]))])


def _integers(document: Document, path: Path, ends: Any) -> list[int] | None:
    """All integers between two, both included."""
    whole = all(is_number(value) and value % 1 == 0 for value in sequence(ends))
    if len(sequence(ends)) != 2 or not whole or not ends[0] <= ends[1]:
        hint = "write integers: [17, 40]"
        document.report(path, "wrong_type", "must be the lowest and the highest integer", hint, value=ends)
        return None
    if ends[1] - ends[0] >= MOST_CHOICES:
        document.report(path, "too_large", f"gives more than {MOST_CHOICES:,} choices", "narrow the range", value=ends)
        return None
    return list(range(int(ends[0]), int(ends[1]) + 1))


def _of_choices(context: Context, name: str, path: Path, entries: Any) -> UnresolvedAxis | None:
    document = context.document
    if not sequence(entries) or not all(isinstance(entry, dict) for entry in entries):
        hint = "write choices: [{path: value}, ..]"
        document.report(path, "wrong_type", "must be a list of mappings", hint, value=entries)
        return None
    found: UnresolvedAxis = cases(context, name, path, entries)
    return found


def _catalogue(document: Document, path: Path, name: Any) -> list[dict[str, Any]] | None:
    """Return the rows of a CSV file, whose columns are paths, with or without a unit in brackets.

    They take the place of the file in the document.
    """
    place = (*path, "catalogue")
    if not isinstance(name, str):
        document.report(place, "wrong_type", "must be the name of a file", "write catalogue: gears.csv", value=name)
        return None
    file = FilePath(document.file).parent / name
    try:
        files.usable(file, ".csv", (".csv",))
        rows = list(csv.reader(files.text(file).splitlines(), skipinitialspace=True))
    except files.DataFileError as error:
        document.report(place, "file", str(error), error.hint, value=name)
        return None
    except csv.Error as error:
        document.report(place, "file", f"cannot be read: {error}", "save it as comma-separated values", value=name)
        return None
    rows = [row for row in rows if any(cell.strip() for cell in row)]
    fault = _fault(rows)
    if fault:
        document.report(place, "data_file", *fault, value=name)
        return None
    heads = [head(cell) for cell in rows[0]]
    entries = []
    for k, row in enumerate(rows[1:], start=1):
        cells = {key: (cell.strip(), unit) for (key, unit), cell in zip(heads, row, strict=True) if cell.strip()}
        label, _ = cells.pop("label", (f"row {k}", ""))
        values = {key: _value(*cell) for key, cell in cells.items()}
        entries.append({"label": label} | values)
    where = document.where(place)
    document.put(path, {"choices": entries}, where)
    return entries


def _fault(rows: list[list[str]]) -> tuple[str, str] | None:
    """Mistakes in the rows of a catalogue, with remedies."""
    if len(rows) < 2:
        return "holds no row of choices", "write paths in the first line and a choice in each further one"
    if len(rows) > MOST_CHOICES:
        return f"holds more than {MOST_CHOICES:,} rows", "leave out what is no choice"
    header = [head(cell)[0] for cell in rows[0]]
    if "" in header or len(set(header)) < len(header):
        return "has columns without a name, or two of one name", "name each column by the path that it sets"
    for k, row in enumerate(rows[1:], start=1):
        if len(row) != len(header):
            return f"has {len(row)} cells in row {k} and {len(header)} columns", "give every row a cell for each column"
    return None


def _value(cell: str, unit: str) -> Any:
    """Return the number of a cell, with the unit of its column, or its text."""
    try:
        finite = np.isfinite(float(cell))
    except ValueError:
        finite = False
    if not finite:
        return cell
    return number(cell) if unit in PLAIN else f"{cell} {unit}"


def json_schema() -> dict[str, Any]:
    """Return the schema of a variable: bounds, or one of the forms of choices."""
    forms: dict[str, dict[str, Any]] = {
        "integers": PAIR | {"items": {"type": "number"}},
        "values": {"type": "array", "minItems": 1, "items": NUMBER},
        "catalogue": {"type": "string", "description": "A CSV file: columns are paths, rows are choices."},
        "choices": {"type": "array", "minItems": 1, "items": {"$ref": "#/$defs/Case"}},
    }
    return {"anyOf": [PAIR, *(closed({key: form}, required=[key]) for key, form in forms.items())]}
