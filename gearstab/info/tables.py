"""Columns of text, and the frequencies of ``gearstab info`` in a unit that was asked for."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

from gearstab.info.records import unit_asked

OF_TONGUES = ("center_frequency", "half_width", "boundary_frequency", "boundary_error")
"""Keys of a tongue that are frequencies, or distances of them."""


def shown_in(facts: dict[str, Any], text: str) -> dict[str, Any]:
    """Return the facts with natural frequencies, tongues and the table of dangerous speeds in a unit.

    text: rpm, Hz, rad/s or another unit of a speed; SI. Raises ResultError for any other, and for orders.
    """
    from gearstab.errors import ResultError
    from gearstab.results.display import ORDER

    if text == ORDER:
        where = (
            "the table of meshes shows theirs" if facts["meshes"][0]["order"] is not None else "and no teeth are given"
        )
        raise ResultError(f"--unit {text}: a natural frequency has an order at a single speed only; {where}")
    unit, one = unit_asked(text, not facts["unit"])
    return facts | {
        "unit": unit,
        "per_unit": one,
        "modes": [mode | {"natural_frequency": over(mode["natural_frequency"], one)} for mode in facts["modes"]],
        "tongues": [t | {key: over(t[key], one) for key in OF_TONGUES if key in t} for t in facts["tongues"]],
        "dangerous": facts["dangerous"].within(unit, one),
    }


def over(value: Any, one: float) -> Any:
    """Return a number or a list of them over a unit; texts and None as they are."""
    if isinstance(value, list):
        return [over(item, one) for item in value]
    return value / one if isinstance(value, float) else value


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Columns of text: the first to the left, numbers to the right, two spaces between."""
    numeric = [all(row[k] in {"", "-"} or row[k][0] in "+-.0123456789" for row in rows) for k in range(len(header))]
    widths = [max(len(line[k]) for line in [header, *rows]) for k in range(len(header))]
    lines = [header, ["-" * width for width in widths], *rows]
    pads = [str.rjust if right else str.ljust for right in numeric]
    padded = ([pad(cell, width) for pad, cell, width in zip(pads, line, widths, strict=True)] for line in lines)
    return "\n".join("  ".join(cells).rstrip() for cells in padded)


def columns(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Columns of text, all to the left, two spaces between, under a plain header."""
    widths = [max(len(row[k]) for row in [header, *rows]) for k in range(len(header))]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in [header, *rows]
    ]


OF_SET = re.compile(r"(.+)\.(sun|ring)\.\d+")
"""The name of a mesh of a planetary set."""


def meshes_text(names: Iterable[str]) -> str:
    """Meshes in short: those of a planetary set, or of its sun or ring, by the name of the set."""
    kinds: dict[str, set[str]] = {}
    for name in names:
        found = OF_SET.fullmatch(name)
        kinds.setdefault(found[1] if found else name, set()).update({found[2]} if found else ())
    return ", ".join(f"{name}.{min(kind)}" if len(kind) == 1 else name for name, kind in kinds.items())


def label_text(label: str) -> str:
    """The label of a tongue, or several, with the meshes of sets in short: ``2w7/5 (stage 2)``."""

    def short(found: re.Match[str]) -> str:
        names = found[1].split("+")
        return f" ({meshes_text(names)})" if any(map(OF_SET.fullmatch, names)) else found[0]

    return re.sub(r" \(([^()]+)\)", short, label)
