"""A report as PDF: pages of text and tables, then a page for each picture."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from textwrap import wrap

from gearstab.cli.report.page import Block, BulletList, Heading, Page, Picture, Table, Text

PAPER = (8.27, 11.69)
"""A4, inches."""
LETTERS, LINES = 96, 66
"""Letters per line and lines per page, in type of one width."""
SIZE, LEADING = 8.5, 11.6
"""Points."""
MARGIN = 0.75
NARROWEST = 6
"""Letters of a column."""

Line = tuple[str, bool]
"""A line of text, and whether it is bold."""


def pdf(page: Page) -> bytes:
    """Return the file."""
    from matplotlib.backends.backend_pdf import PdfPages

    from gearstab.plots.drawing.style import metadata, style

    data = io.BytesIO()
    lines: list[Line] = [(text, True) for text in wrap(page.title, LETTERS)]
    with style(), PdfPages(data, metadata=metadata(".pdf", page.title)) as file:
        for block in page.blocks:
            lines += _lines(block)
        for start in range(0, len(lines), LINES):
            file.savefig(_written(lines[start : start + LINES]))
        for block in page.blocks:
            if isinstance(block, Picture):
                file.savefig(block.figure)
    return data.getvalue()


def _written(lines: Sequence[Line]) -> object:
    """A page of lines."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=PAPER)
    FigureCanvasAgg(figure)
    for k, (text, bold) in enumerate(lines):
        y = 1 - (MARGIN + k * LEADING / 72) / PAPER[1]
        figure.text(MARGIN / PAPER[0], y, text.replace("$", r"\$"), family="DejaVu Sans Mono", fontsize=SIZE * 0.9,
                    weight="bold" if bold else "normal", va="top")  # fmt: skip
    return figure


def _lines(block: Block) -> Iterator[Line]:
    match block:
        case Heading(text):
            yield "", False
            yield text, True
        case Text(text, strong):
            yield from ((line, strong) for line in wrap(text, LETTERS))
            yield "", False
        case BulletList(items):
            for item in items:
                yield from ((line, False) for line in wrap(item, LETTERS, initial_indent="- ", subsequent_indent="  "))
            yield "", False
        case Table(header, rows):
            yield from _table(header, rows)
            yield "", False
        case Picture(_, caption):
            yield from ((line, False) for line in wrap(f"[picture, below] {caption}", LETTERS))


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[Line]:
    """Columns as wide as their longest word where all does not fit, cells of several lines."""
    every = [list(map(str, row)) for row in (header, *rows)]
    widths = [max(len(cell) for cell in column) for column in zip(*every, strict=True)]
    while sum(widths) + 2 * (len(widths) - 1) > LETTERS and max(widths) > NARROWEST:
        widths[widths.index(max(widths))] -= 1
    for number, row in enumerate(every):
        cells = [wrap(cell, width) or [""] for cell, width in zip(row, widths, strict=True)]
        for k in range(max(map(len, cells))):
            parts = [(cell[k] if k < len(cell) else "").ljust(width) for cell, width in zip(cells, widths, strict=True)]
            yield "  ".join(parts).rstrip(), number == 0
