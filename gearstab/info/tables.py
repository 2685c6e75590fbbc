"""Columns of text."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence


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
