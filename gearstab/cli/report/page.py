"""Parts of a report, independent of the format that it is written in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

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
