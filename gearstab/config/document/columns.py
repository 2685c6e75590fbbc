"""Two columns of numbers in a text file: samples over a period, a speed over time."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from gearstab.config.document.files import DataFileError
from gearstab.config.document.problems import shown


def columns_of(content: str, names: tuple[str, str]) -> tuple[list[str], list[float], list[float]]:
    """The place of each line, and the numbers of its two columns. Raises DataFileError, with the line."""
    columns, first = (0, 1), True
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
        if len(fields) <= max(columns) or (len(fields) != 2 and columns == (0, 1)):
            hint = f"write two numbers per line, {' and '.join(names)}, or name the columns in the first line"
            raise DataFileError(f"{place}: has {len(fields)} column{'s' * (len(fields) != 1)}", hint)
        for name, k in zip(names, columns, strict=True):
            value = _number(fields[k])
            if value is None or not math.isfinite(value):
                message = f"{place}: {name} {shown(fields[k])} is no finite number"
                raise DataFileError(message, "write a number such as 2.5e8")
            samples[name].append(value)
        places.append(place)
    return places, samples[names[0]], samples[names[1]]


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


def _columns(header: Sequence[str], place: str, names: tuple[str, str]) -> tuple[int, int]:
    """Which columns have the two names; those of a header of two other names are taken in this order."""
    found = [name.lower() for name in header]
    if all(name in found for name in names):
        return found.index(names[0]), found.index(names[1])
    if len(found) == 2:
        return 0, 1
    raise DataFileError(f"{place}: names no columns {' and '.join(names)}", "call the two columns that")
