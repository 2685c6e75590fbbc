"""The section ``sweep``: what each axis sets, and to which values."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from gearstab.config.document import Document, Path, Problem, Where, dotted, nearest, sequence, value_at
from gearstab.config.model import MESH_FREQUENCY
from gearstab.config.model.reading import WRONG, SkipRule, as_far_as_right
from gearstab.config.sections import INPUT_SPEED, Target, TargetError, resolve
from gearstab.config.sections.expansion import Column, Range, Tie, UnresolvedAxis
from gearstab.methods import METHODS
from gearstab.results.variables.responses import taken_names
from gearstab.systems.base import System

BaseValue = tuple[Path, Any, Where]
"""Where a number is below ``system``, its value in SI units, and the place in the file that gives it."""
GROUPS = ("modes", "bench", "teeth", *METHODS)
"""Names of the groups of a result."""
LONGEST_NAME = 100
"""Characters of the name of an axis."""


@dataclass(frozen=True)
class Context:
    """Section that the names in ``sweep`` refer to. system: its section, in which values may be wrong."""

    document: Document
    system: System

    def resolve(self, name: str, path: Path) -> list[Target]:
        """Return the targets of a name at ``path``; report a name that has none."""
        try:
            return resolve(name, self.system)
        except TargetError as error:
            self.document.report(path, error.code, str(error), error.hint, at_key=True)
        except SkipRule:
            pass  # what it leads to is wrong, and reported
        return []


def layouts(context: Context) -> list[UnresolvedAxis]:
    """Return what each axis sets; report unknown names, and parameters that two axes set."""
    document = context.document
    if "sweep" not in document.data:
        return []
    section = document.data["sweep"]
    if not isinstance(section, dict) or not section:
        hint = "add one, such as mesh_frequency: {start: 1, stop: 5, num: 200}"
        shown = None if section in (None, {}, []) else section
        document.report(("sweep",), "missing", "has no axes", hint, value=shown)
        return []
    found = []
    for name, spec in section.items():
        path = ("sweep", name)
        if spec is None or spec in ([], {}):
            document.report(path, "empty", "an axis without values", "give a list, or {start: .., stop: .., num: ..}")
        elif isinstance(spec, list) and all(isinstance(entry, dict) for entry in spec):
            found.append(cases(context, name, path, spec))
        elif isinstance(spec, dict) and not spec.keys().isdisjoint(("targets", "values")):
            found.append(_tie(context, name, path, spec))
        else:
            found.append(UnresolvedAxis(name, [Column(path, context.resolve(name, path))]))
    report_rivals(document, found)
    _report_teeth(document, found)
    for layout in found:
        layout.expand(document)
    return found


def report_rivals(document: Document, found: list[UnresolvedAxis]) -> None:
    """Report parameters that are set twice: each can be set by one axis or variable only, and by one name only."""
    owners: dict[Path, Path] = {}
    for layout in found:
        for column in layout.columns:
            for path in (p for target in column.targets for p in target.paths):
                owner = owners.setdefault(path, column.path)
                if owner != column.path:
                    message = f"sets {dotted(path)}, as {dotted(owner)} does"
                    document.report(column.path, "set_twice", message, "let one of the two set it", at_key=True)
                    break


def _report_teeth(document: Document, found: list[UnresolvedAxis]) -> None:
    """How many cycles of a mesh are in a turn of the input must not change from point to point."""
    columns = [column for layout in found for column in layout.columns]
    teeth = any("teeth" in path for c in columns for target in c.targets for path in target.paths)
    for column in columns:
        if teeth and any(target.factor != 1 for target in column.targets):
            message = "numbers of teeth vary too, which set how many mesh cycles a turn has"
            document.report(column.path, "needs_other", message, "sweep mesh_frequency instead", at_key=True)


def _named_freely(context: Context, name: str, path: Path) -> None:
    """Report a name that HDF5 cannot hold, or that something else in a result has."""
    plain = name.strip() == name and name not in ("", ".", "..") and not re.search(r"[/\x00-\x1f\x7f]", name)
    if not plain or len(name) > LONGEST_NAME:
        hint = f"choose another name, of at most {LONGEST_NAME} characters and without '/'"
        context.document.report(path, "reserved_name", f"'{name}' cannot be the name of an axis", hint, at_key=True)
    elif name in (MESH_FREQUENCY[0], INPUT_SPEED):
        message = f"'{name}' is the name of an axis that sets this alone"
        context.document.report(path, "reserved_name", message, "choose another name, such as case", at_key=True)
    elif name in taken_names() or name in GROUPS:
        message = f"'{name}' cannot be the name of an axis: results hold something else of that name"
        context.document.report(path, "reserved_name", message, "choose another name", at_key=True)


def _tie(context: Context, name: str, path: Path, spec: dict[str, Any]) -> UnresolvedAxis:
    document = context.document
    _named_freely(context, name, path)
    for key in spec:
        if key not in Tie.model_fields:
            document.report((*path, key), "unknown_key", "unknown key", nearest(key, Tie.model_fields), at_key=True)
    names: Any = spec.get("targets")
    if not sequence(names) or not all(isinstance(n, str) for n in names):
        where = (*path, "targets")
        hint = "write targets: [name, name]"
        document.report(where, "wrong_type", "must be a list of parameter names", hint, value=names)
        return UnresolvedAxis(name, [])
    targets = [context.resolve(n, (*path, "targets", i)) for i, n in enumerate(names)]
    values: Any = spec.get("values")
    apart = any(isinstance(v, list | dict) for v in sequence(values))
    if not apart:
        return UnresolvedAxis(
            name, [_shared(document, path, [t for found in targets for t in found])], all(targets), tie=spec
        )
    if len(values) != len(names):
        given = f"{len(names)} targets, but values for {len(values)}"
        hint = "give one list for each target, or one list of numbers for all"
        document.report((*path, "values"), "wrong_count", given, hint)
        return UnresolvedAxis(name, [])
    columns = [Column((*path, "values", i), found) for i, found in enumerate(targets)]
    return UnresolvedAxis(name, columns, all(targets), tie=spec)


def _shared(document: Document, path: Path, targets: list[Target]) -> Column:
    """The column of a tie whose targets all take the same values."""
    spec = document.get(path)
    if spec.get("values") is not None:
        for key in ("start", "stop", "num", "step", "spacing"):
            if key in spec:
                hint = f"remove {key} or values"
                document.report((*path, key), "already_given", "values are given already", hint, at_key=True)
        return Column((*path, "values"), targets)
    inner = (*path, "values")
    plain = {key: value for key, value in spec.items() if key in Range.model_fields}
    document.move(path, inner)
    spec["values"] = plain
    for key in plain:
        del spec[key]
    return Column(inner, targets)


def cases(context: Context, name: str, path: Path, entries: list[dict[str, Any]]) -> UnresolvedAxis:
    """An axis, or a design variable, whose entries are mappings that change several parameters together."""
    document = context.document
    _named_freely(context, name, path)
    labels = _labels(document, path, entries)
    columns, sound = _case_columns(context, path, entries)
    if not any(key != "label" for entry in entries for key in entry):
        document.report(path, "missing", "the cases set nothing", "let each set parameters, such as contact_ratio: 1.5")
        sound = False
    return UnresolvedAxis(name, columns, sound, labels, cases=entries)


def _case_columns(context: Context, path: Path, entries: list[dict[str, Any]]) -> tuple[list[Column], bool]:
    """A column for each parameter that a case sets, under whichever name; and whether every name has a target."""
    targets: dict[str, list[Target]] = {}
    found: dict[frozenset[Path], tuple[Target, dict[int, str]]] = {}
    for i, entry in enumerate(entries):
        for key in entry:
            if key == "label":
                continue
            if key not in targets:
                targets[key] = context.resolve(key, (*path, i, key))
            for target in targets[key]:
                first, names = found.setdefault(frozenset(target.paths), (target, {}))
                if i in names:
                    message = f"sets {dotted(target.paths[0])}, as {dotted((*path, i, names[i]))} does"
                    hint = "let one of the two set it"
                    context.document.report((*path, i, key), "set_twice", message, hint, at_key=True)
                    continue
                names[i] = key
                if first.factor != target.factor:
                    # A column has one factor, that of its first case.
                    other = next(iter(names.values()))
                    message = f"sets {dotted(target.paths[0])}, as {other} of another case does"
                    hint = f"give {other} in all cases"
                    context.document.report((*path, i, key), "set_twice", message, hint, at_key=True)
    columns = [_case_column(context, path, entries, target, names) for target, names in found.values()]
    return columns, bool(targets) and all(targets.values())


def _case_column(
    context: Context, path: Path, entries: list[dict[str, Any]], target: Target, names: dict[int, str]
) -> Column:
    """The values of a parameter along cases, with its base value in those that do not set it.

    names: index of a case -> the key by which it sets the parameter.
    """
    first = next(iter(names))
    where = (*path, first, names[first])
    base = _base(context, target)
    for i in range(len(entries)):
        if i not in names and base is None:
            name = dotted(target.paths[0])
            message = f"does not set {name}, which has no base value"
            remedy = f"add {name} to this case, or to the system"
            context.document.report((*path, i), "missing", message, remedy)
    fill = entries[first][names[first]] if base is None else base
    items = [entry[names[i]] if i in names else fill for i, entry in enumerate(entries)]
    places = [(*path, i, names[i]) if i in names else where for i in range(len(entries))]
    return Column(where, [target], items, places, None if len(names) == len(entries) else base)


def _base(context: Context, target: Target) -> Any:
    value = context.document.get(("system", *target.paths[0]))
    if value is None:
        held = value_at(context.system, target.paths[0])
        value = target.default if held is None or held is WRONG else held
    return str(value) if isinstance(value, Fraction) else value


def _labels(document: Document, path: Path, entries: list[dict[str, Any]]) -> list[str]:
    labels: list[str] = []
    for i, entry in enumerate(entries):
        label = entry.get("label", ", ".join(f"{key} = {value}" for key, value in entry.items()))
        if isinstance(label, bool | list | dict) or label is None:
            document.report((*path, i, "label"), "wrong_type", "must be a text", "put it in quotes", value=label)
        elif str(label) in labels:
            message = f"the label '{label}' is used twice"
            document.report((*path, i, "label"), "repeated_name", message, "give each case a label of its own")
        labels.append(str(label))
    return labels


def without_effect(document: Document, found: list[UnresolvedAxis]) -> Iterator[Problem]:
    """Yield a doubt for each override of a single parameter that an axis, a tie or every case sets anyway."""
    for layout in found:
        column_paths = ((c, ("system", *p)) for c in layout.columns for t in c.targets for p in t.paths)
        for column, path in column_paths:
            place = document.values.get(path)
            # An option that replaces a whole section gives base values, as a file does.
            if column.base is not None or place is None or place.file == document.file:
                continue
            if place.file != document.where(path[:-1]).file:
                message = f"has no effect on the sweep, whose axis {layout.name} sets it"
                yield document.problem(
                    path, "set_twice", message, f"set {dotted(column.path)} instead", value=document.get(path)
                )


def base_values(context: Context, layouts: Iterable[UnresolvedAxis]) -> Iterator[BaseValue]:
    """Yield a base value, the first one, of each number that is set by an axis only."""
    for column, found in ((c, e) for layout in layouts for c, e in zip(layout.columns, layout.expansions, strict=True)):
        for target, expansion in zip(column.targets, found, strict=True):
            if is_absent(context, target.paths[0]):
                first = WRONG if expansion.values is None else expansion.values[0]
                first = float(first) if isinstance(first, np.floating) else first
                if column.base is not None:
                    given = target.default
                    first = as_far_as_right(target.annotation, column.base) if given is None else given
                yield target.paths[0], first, context.document.where(column.path)


def is_absent(context: Context, path: Path) -> bool:
    """Return whether the section ``system`` as written could hold a number at a path and does not."""
    around = context.document.get(("system", *path[:-1]))
    return path != MESH_FREQUENCY and isinstance(around, dict) and around.get(str(path[-1])) is None
