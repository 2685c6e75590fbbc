"""Columns of numbers in a text file: samples over a period, a speed over time."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from gearstab.config.document.files import DataFileError
from gearstab.config.document.problems import shown

COUNTS = {2: "two", 3: "three"}


def columns_of(content: str, names: tuple[str, ...]) -> tuple[list[str], list[list[float]]]:
    """The place of each line, and the numbers of each column. Raises DataFileError, with the line."""
    in_order = tuple(range(len(names)))
    columns, first = in_order, True
    places: list[str] = []
    samples: dict[str, list[float]] = {name: [] for name in names}
    for number, line in enumerate(content.splitlines(), start=1):
        fields = _fields(line.partition("#")[0])
        if not fields:
            continue
        place = f"line {number}"
        if first and all(_number(field) is None for field in fields):
            columns, first = _columns(fields, place, names), False
            continue
        first = False
        if len(fields) <= max(columns) or (len(fields) != len(names) and columns == in_order):
            hint = (
                f"write {COUNTS[len(names)]} numbers per line, {_listed(names)}, or name the columns in the first line"
            )
            raise DataFileError(f"{place}: has {len(fields)} column{'s' * (len(fields) != 1)}", hint)
        for name, k in zip(names, columns, strict=True):
            value = _number(fields[k])
            if value is None or not math.isfinite(value):
                message = f"{place}: {name} {shown(fields[k])} is no finite number"
                raise DataFileError(message, "write a number such as 2.5e8")
            samples[name].append(value)
        places.append(place)
    return places, list(samples.values())


def _fields(line: str) -> list[str]:
    """The entries of a line, none of an empty one."""
    line = line.strip()
    separator = r"\s*;\s*" if ";" in line else r"\s*,\s*" if "," in line else r"\s+"
    return [field.strip("\"' ") for field in re.split(separator, line)] if line else []


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _columns(header: Sequence[str], place: str, names: tuple[str, ...]) -> tuple[int, ...]:
    """Which columns have the names; those of a header of as many other names are taken in this order."""
    found = [name.lower() for name in header]
    if all(name in found for name in names):
        return tuple(found.index(name) for name in names)
    if len(found) == len(names):
        return tuple(range(len(names)))
    raise DataFileError(f"{place}: names no columns {_listed(names)}", f"call the {COUNTS[len(names)]} columns that")


def _listed(names: tuple[str, ...]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]}"
