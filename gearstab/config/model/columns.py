"""Columns of numbers in a text file: samples over a period, a speed over time."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

from pydantic_core import PydanticCustomError

from gearstab.config.document.files import DataFileError
from gearstab.config.document.problems import shown
from gearstab.config.model.units import UnitError, to_si
from gearstab.config.model.values import Quantity

COUNTS = {2: "two", 3: "three"}
HEADER = re.compile(r"\s*(.*?)\s*(?:\[([^\[\]]*)\]|\(([^()]*)\))?\s*", re.DOTALL)
"""A name, and a unit in brackets."""
PLAIN = ("", "-", "1", "fraction")
"""Units of a column whose numbers are taken as they are."""
BLANKS = r"\s+(?![\[(])(?![^\[(]*[\])])"
"""Blanks that separate columns: not those before a unit in brackets or within it."""


def columns_of(content: str, columns: Mapping[str, Quantity]) -> tuple[list[str], list[list[float]]]:
    """Return the place of each line, and the numbers of each column in SI units.

    The first line, or a comment before the numbers, may name the columns, each with a unit in brackets, or in a line of
    units that follows.

    columns: the names, and what each may be. Raises DataFileError, with the line.
    """
    names = tuple(columns)
    order: tuple[int, ...] | None = None
    named: list[str] = []
    factors = dict.fromkeys(names, 1.0)
    places: list[str] = []
    samples: dict[str, list[float]] = {name: [] for name in names}
    for number, line in enumerate(content.splitlines(), start=1):
        plain, _, comment = line.partition("#")
        fields = _fields(plain)
        place, heads = f"line {number}", _fields(comment)
        if not places and order is None:
            if not fields and _is_header(heads, names):
                fields = heads
            if fields and all(_number(field) is None for field in fields):
                order, factors = _header(fields, place, columns)
                named = fields
                continue
        elif not places and _are_units(fields, named):
            heads = [f"{name} [{unit.strip('[]()')}]" for name, unit in zip(named, fields, strict=True)]
            order, factors = _header(heads, place, columns)
            continue
        if not fields:
            continue
        if len(fields) <= max(order or (0,)) or (len(fields) != len(names) and order is None):
            hint = (
                f"write {COUNTS[len(names)]} numbers per line, {_listed(names)}, or name the columns in the first line"
            )
            raise DataFileError(f"{place}: has {len(fields)} column{'s' * (len(fields) != 1)}", hint)
        for name, k in zip(names, order or range(len(names)), strict=True):
            value = _number(fields[k])
            if value is None or not math.isfinite(value):
                message = f"{place}: {name} {shown(fields[k])} is no finite number"
                raise DataFileError(message, "write a number such as 2.5e8")
            samples[name].append(value * factors[name])
        places.append(place)
    return places, list(samples.values())


def head(field: str) -> tuple[str, str]:
    """Return the name of a column and its unit, "" without one: ``stiffness [N/um]``, ``stiffness (N/um)``."""
    found = HEADER.fullmatch(field)
    return (found[1], (found[2] or found[3] or "").strip()) if found else (field, "")


def factor(unit: str, quantity: Quantity, what: str) -> float:
    """Return the SI value of one of a unit, 1 without one. Raises DataFileError, which begins with ``what``."""
    try:
        return 1.0 if unit in PLAIN else quantity.number(f"1 {unit}")
    except PydanticCustomError as error:
        raise DataFileError(f"{what} {error.message()}", str((error.context or {}).get("hint", ""))) from None


def _fields(line: str) -> list[str]:
    """Return the entries of a line, none of an empty one."""
    line = line.strip()
    separator = r"\s*;\s*" if ";" in line else r"\s*,\s*" if "," in line else BLANKS
    return [field.strip("\"' ") for field in re.split(separator, line)] if line else []


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _is_header(fields: Sequence[str], names: Sequence[str]) -> bool:
    """Return whether a comment names the columns, or gives each of as many columns a unit."""
    heads = [head(field) for field in fields]
    named = {name.lower() for name, _ in heads}
    return named.issuperset(names) or (len(heads) == len(names) and all(_is_unit(field) for field in fields))


def _is_unit(field: str) -> bool:
    """Return whether a field ends with a unit in brackets, and not with other words in them."""
    found = HEADER.fullmatch(field)
    unit = found and (found[2] or found[3])
    try:
        return bool(unit) and (unit in PLAIN or to_si(f"1 {unit}", ("m",)) is not None)
    except UnitError as error:
        return error.type != "unknown_unit"


def _are_units(fields: Sequence[str], named: Sequence[str]) -> bool:
    """Return whether a line gives columns their units, which have none in the line of their names."""
    if len(fields) != len(named) or any(head(name)[1] for name in named):
        return False
    return all(field in PLAIN or _is_unit(f"[{field.strip('[]()')}]") for field in fields) and any(
        _number(field) is None for field in fields
    )


def _header(
    fields: Sequence[str], place: str, columns: Mapping[str, Quantity]
) -> tuple[tuple[int, ...], dict[str, float]]:
    """Return which columns have the names, and the factor of the unit of each."""
    heads = [head(field) for field in fields]
    found = [name.lower() for name, _ in heads]
    missing = [name for name in columns if found.count(name) != 1]
    if missing:
        twice = [name for name in missing if name in found]
        fault = f"names {twice[0]} twice" if twice else f"names no column {_listed(missing)}"
        names, (last, quantity) = _listed(tuple(columns)), list(columns.items())[-1]
        unit = f'"{last} [{quantity.unit}]"'
        raise DataFileError(
            f"{place}: the header {shown(', '.join(fields))} {fault}",
            f"call the columns {names}; units stand in brackets, {unit}, and are SI without"
            + "; a phase is a fraction of the mesh period" * ("phase" in columns),
        )
    order = tuple(found.index(name) for name in columns)
    units = [
        (name, heads[k][1], f"{place}: the header {shown(fields[k])}") for name, k in zip(columns, order, strict=True)
    ]
    return order, {name: factor(unit, columns[name], what) for name, unit, what in units}


def _listed(names: Sequence[str]) -> str:
    return " and ".join(filter(None, [", ".join(names[:-1]), names[-1]]))
