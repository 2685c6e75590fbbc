"""Parts of a report, and the report as one HTML file with its pictures embedded."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from string import Template
from typing import TYPE_CHECKING

from gearstab.plots.drawing.style import metadata, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Heading:
    """The title of a section."""

    text: str


@dataclass(frozen=True)
class Text:
    """A paragraph; ``strong`` for a verdict."""

    text: str
    strong: bool = False


@dataclass(frozen=True)
class BulletList:
    """A list of short statements."""

    items: Sequence[str]


@dataclass(frozen=True)
class Table:
    """Rows under headings."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Picture:
    """A figure and what it shows."""

    figure: Figure
    caption: str


Block = Heading | Text | BulletList | Table | Picture


@dataclass(frozen=True)
class Page:
    """A report: its title and its blocks in order."""

    title: str
    blocks: Sequence[Block]


PAGE = Template("""\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="gearstab">
<title>$title</title>
<style>
body { font: 16px/1.45 Georgia, "Times New Roman", serif; color: #1a1a1a; }
body { max-width: 60em; margin: 2em auto; padding: 0 1em; }
h1 { font-size: 1.6em; line-height: 1.2; } h2 { font-size: 1.2em; margin-top: 2em; border-bottom: 1px solid #bbb; }
table { border-collapse: collapse; margin: 1em 0; font-size: 0.9em; }
th, td { border-bottom: 1px solid #ddd; padding: 0.3em 0.8em 0.3em 0; text-align: left; vertical-align: top; }
figure { margin: 1.5em 0; } img { max-width: 100%; height: auto; }
figcaption { font-size: 0.9em; color: #444; } .strong { font-weight: bold; }
@media print { body { margin: 0; max-width: none; } h2 { break-after: avoid; } figure, table { break-inside: avoid; } }
</style>
</head>
<body>
<h1>$title</h1>
$body
</body>
</html>
""")
RESOLUTION = 160
"""Dots per inch of pictures."""


def html(page: Page) -> bytes:
    """Return the file."""
    body = "\n".join(_block(block) for block in page.blocks)
    return PAGE.substitute(title=escape(page.title), body=body).encode()


def _block(block: Block) -> str:
    match block:
        case Heading(text):
            return f"<h2>{escape(text)}</h2>"
        case Text(text, strong):
            return f'<p class="strong">{escape(text)}</p>' if strong else f"<p>{escape(text)}</p>"
        case BulletList(items):
            return "<ul>\n" + "\n".join(f"<li>{escape(item)}</li>" for item in items) + "\n</ul>"
        case Table(header, rows):
            head = [_row(header, "th")] if any(header) else []
            return "<table>\n" + "\n".join([*head, *(_row(row, "td") for row in rows)]) + "\n</table>"
        case Picture(_, caption):
            words = escape(caption)
            return f'<figure><img src="{_data(block)}" alt="{words}"><figcaption>{words}</figcaption></figure>'


def _row(cells: Sequence[str], tag: str) -> str:
    return "<tr>" + "".join(f"<{tag}>{escape(str(cell))}</{tag}>" for cell in cells) + "</tr>"


def _data(picture: Picture) -> str:
    data = io.BytesIO()
    with style():
        picture.figure.savefig(data, format="png", dpi=RESOLUTION, metadata=metadata(".png", picture.caption))
    return "data:image/png;base64," + base64.b64encode(data.getvalue()).decode()
