"""Columns of text."""

from __future__ import annotations

from collections.abc import Sequence


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
