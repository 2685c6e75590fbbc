"""Parts that all benchmarks share: rounds in turn, clocks, tables."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from gearstab.system import Array


@dataclass(frozen=True)
class Way:
    """One way to compute ``points`` points; goal: how much slower than the first way it is meant to be."""

    name: str
    points: int
    run: Callable[[], Any]
    goal: float | None = None


def turns(works: Sequence[Callable[[], Any]], rounds: int, clock: Callable[[], float] = time.process_time) -> Array:
    """Return the seconds ``(rounds, works)`` of pieces of work that take turns."""
    seconds = np.empty((rounds, len(works)))
    for turn in seconds:
        for k, work in enumerate(works):
            begin = clock()
            work()
            turn[k] = clock() - begin
    return seconds


def compare(title: str, ways: list[Way], rounds: int, clock: Callable[[], float] = time.thread_time) -> None:
    """Print microseconds per point of all ways, medians, and their ratios to the first."""
    for way in ways:
        way.run()
    medians = np.median(turns([way.run for way in ways], rounds, clock), axis=0) / [way.points for way in ways]
    rows = [
        (way.name, f"{1e6 * median:.4f}", f"{median / medians[0]:,.3g}", f"{way.goal:,.0f}" if way.goal else "")
        for way, median in zip(ways, medians, strict=True)
    ]
    show(title, ("", "us per point", "x", "goal"), rows)


def show(title: str, headings: Sequence[str], rows: Sequence[Sequence[object]], caption: str = "") -> None:
    """Print a table; numbers with three digits."""
    table = Table(title=title, caption=caption or None)
    for k, heading in enumerate(headings):
        table.add_column(heading, justify="right" if k else "left", no_wrap=True)
    for row in rows:
        table.add_row(*(f"{x:.3g}" if isinstance(x, float) else str(x) for x in row))
    Console(width=120).print(table)
