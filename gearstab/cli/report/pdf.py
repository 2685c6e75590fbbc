"""A report as PDF: A4 pages of text, tables and pictures, in the order of the report."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from functools import cache
from itertools import zip_longest
from typing import TYPE_CHECKING, Any

from matplotlib import rcParams
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.image import imread
from matplotlib.lines import Line2D
from matplotlib.textpath import text_to_path

from gearstab.cli.report import Block, BulletList, Heading, Page, Picture, Table, Text
from gearstab.plots.drawing.style import metadata, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Lengths in points.
PAPER = (595.0, 842.0)
MARGIN = 56.0
WIDTH = PAPER[0] - 2 * MARGIN
TITLE, HEADING, BODY, SMALL = 15.0, 12.0, 9.5, 8.5
"""Sizes of type."""
LEADING = 1.3
"""Distance of lines in units of their size."""
GAP = 9.0
"""Between the columns of a table, and between paragraphs."""
RESOLUTION = 300
"""Dots per inch of pictures."""


def pdf(page: Page) -> bytes:
    """Return the file."""
    data = io.BytesIO()
    with style(), PdfPages(data, metadata=metadata(".pdf", page.title)) as file:
        for sheet in sheets(page):
            file.savefig(sheet)
    return data.getvalue()


def sheets(page: Page) -> list[Figure]:
    """Return the pages; to be called within the style of figures."""
    paper = _Paper()
    paper.lines(page.title, TITLE, bold=True)
    for block, following in zip_longest(page.blocks, page.blocks[1:]):
        _write(paper, block, following)
    return paper.sheets


class _Paper:
    """Pages filled from above; ``y`` is the height over the lower edge down to which the last one is full."""

    def __init__(self) -> None:
        self.sheets: list[Figure] = []
        self.turn()

    def turn(self) -> None:
        """Begin a page."""
        self.sheets.append(Figure(figsize=(PAPER[0] / 72, PAPER[1] / 72)))
        FigureCanvasAgg(self.sheets[-1])
        self.y = MARGIN / 2
        self.text(PAPER[0] / 2, str(len(self.sheets)), SMALL, ha="center")
        self.y = PAPER[1] - MARGIN

    def need(self, height: float) -> bool:
        """Begin a page where this one has no room for ``height``; whether it did."""
        full = self.y - height < MARGIN and self.y < PAPER[1] - MARGIN
        if full:
            self.turn()
        return full

    def text(self, x: float, text: str, size: float, bold: bool = False, **look: Any) -> None:
        """Write one line, its upper edge at ``y``."""
        weight = "bold" if bold else "normal"
        base = (self.y - size) / PAPER[1]
        self.sheets[-1].text(x / PAPER[0], base, text, fontsize=size, weight=weight, parse_math=False, **look)

    def lines(self, text: str, size: float, bold: bool = False, indent: float = 0.0, **look: Any) -> None:
        """Write a paragraph across the page."""
        for line in _wrapped(text, WIDTH - indent, size, bold):
            self.need(LEADING * size)
            self.text(MARGIN + indent, line, size, bold, **look)
            self.y -= LEADING * size

    def rule(self, colour: str) -> None:
        """Draw a line across the page at ``y``."""
        ends = MARGIN / PAPER[0], 1 - MARGIN / PAPER[0]
        self.sheets[-1].add_artist(Line2D(ends, [self.y / PAPER[1]] * 2, color=colour, linewidth=0.5))

    def picture(self, figure: Figure, caption: str) -> None:
        """Show a figure, no larger than it is, over its caption."""
        data = io.BytesIO()
        figure.savefig(data, format="png", dpi=RESOLUTION, metadata=metadata(".png", caption))
        data.seek(0)
        width, height, words = _extent(figure, caption)
        self.need(height + words)
        self.y -= height
        frame = self.sheets[-1].add_axes((MARGIN / PAPER[0], self.y / PAPER[1], width / PAPER[0], height / PAPER[1]))
        frame.imshow(imread(data), interpolation="none", aspect="auto")
        frame.set_axis_off()
        self.y -= GAP / 3
        self.lines(caption, SMALL, color="#444444")

    def table(self, header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
        """Write rows, a line under each; the header again on every further page."""
        every = [list(map(str, row)) for row in (header, *rows)]
        widths = _columns(every)
        head = _cells(every[0], widths, bold=True)
        if any(every[0]):
            self._row(head, widths, bold=True)
        for row in every[1:]:
            cells = _cells(row, widths)
            if self.need(_height(cells)) and any(every[0]):
                self._row(head, widths, bold=True)
            self._row(cells, widths)

    def _row(self, cells: Sequence[Sequence[str]], widths: Sequence[float], bold: bool = False) -> None:
        x, top = MARGIN, self.y
        for cell, width in zip(cells, widths, strict=True):
            for number, line in enumerate(cell):
                self.y = top - number * LEADING * SMALL
                self.text(x, line, SMALL, bold)
            x += width + GAP
        self.y = top - _height(cells) + GAP / 4
        self.rule("#bbbbbb" if bold else "#dddddd")
        self.y -= GAP / 4


def _extent(figure: Figure, caption: str) -> tuple[float, float, float]:
    """Width and height of a picture on the page, and the height of its caption."""
    width, height = (72 * size for size in figure.get_size_inches())
    words = len(_wrapped(caption, WIDTH, SMALL)) * LEADING * SMALL + GAP
    # Below a heading, which stands on the same page.
    scale = min(1.0, WIDTH / width, (PAPER[1] - 2 * MARGIN - words - 4 * HEADING) / height)
    return scale * width, scale * height, words


def _write(paper: _Paper, block: Block, following: Block | None) -> None:
    match block:
        case Heading(text):
            paper.y -= 2 * GAP
            start = sum(_extent(following.figure, following.caption)[1:]) if isinstance(following, Picture) else 60.0
            paper.need(3 * HEADING + start)
            paper.lines(text, HEADING, bold=True)
            paper.rule("#bbbbbb")
        case Text(text, strong):
            paper.y -= GAP
            paper.lines(text, BODY, bold=strong)
        case BulletList(items):
            paper.y -= GAP / 2
            for item in items:
                paper.need(LEADING * BODY)
                paper.text(MARGIN, "\N{BULLET}", BODY)
                paper.lines(item, BODY, indent=GAP)
        case Table(header, rows):
            paper.y -= GAP
            paper.table(header, rows)
        case Picture(figure, caption):
            paper.y -= GAP
            paper.picture(figure, caption)


@cache
def _unit_length(text: str, bold: bool) -> float:
    """The length of a text in units of its size."""
    font = FontProperties(family=rcParams["font.family"], weight="bold" if bold else "normal", size=100)
    return text_to_path.get_text_width_height_descent(text, font, ismath=False)[0] / 100


def _wrapped(text: str, width: float, size: float, bold: bool = False) -> list[str]:
    """Lines no longer than ``width``; a word that is longer goes on in the next line."""
    lines = [""]
    for word in text.split():
        for piece in _pieces(word, width, size, bold):
            longer = f"{lines[-1]} {piece}".strip()
            if _unit_length(longer, bold) * size <= width:
                lines[-1] = longer
            else:
                lines.append(piece)
    return lines


def _pieces(word: str, width: float, size: float, bold: bool) -> Iterator[str]:
    while len(word) > 1 and _unit_length(word, bold) * size > width:
        fits = max(n for n in range(1, len(word)) if n == 1 or _unit_length(word[:n], bold) * size <= width)
        yield word[:fits]
        word = word[fits:]
    yield word


def _columns(rows: Sequence[Sequence[str]]) -> list[float]:
    """Widths of columns: as their longest cell, but the widest ones as much narrower as the page asks for."""
    longest = [
        max(_unit_length(cell, number == 0) for number, cell in enumerate(column)) * SMALL + 0.1
        for column in zip(*rows, strict=True)
    ]
    room = WIDTH - GAP * (len(longest) - 1)
    most = max(longest)
    while sum(min(width, most) for width in longest) > room:
        most *= 0.98
    return [min(width, most) for width in longest]


def _cells(row: Sequence[str], widths: Sequence[float], bold: bool = False) -> list[list[str]]:
    return [_wrapped(cell, width, SMALL, bold) for cell, width in zip(row, widths, strict=True)]


def _height(cells: Sequence[Sequence[str]]) -> float:
    return max(map(len, cells)) * LEADING * SMALL + GAP / 2
