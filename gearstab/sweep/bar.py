"""The progress of a sweep as a bar, on a terminal or in a notebook."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from gearstab.sweep.effort.words import quantity
from gearstab.sweep.reporter import Reporter

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID


class Bar(Reporter):
    """A bar per method: points, points per second, time taken and left, unstable share. say: shows a message.

    Until the first block is done nothing tells how far it is; then the bar runs to and fro.
    """

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._progress: Progress | None = None
        self._task: TaskID | None = None
        self._points = self._unstable = self._known = self._total = 0

    def message(self, text: str) -> None:
        self._say(text)

    def begin(self, method: str, points: int, done: int) -> None:
        progress = self._progress = self._progress or bar()
        progress.start()
        self._task = progress.add_task(method, total=points if done else None, completed=done, speed="", unstable="")
        self._points, self._unstable, self._known, self._total = 0, 0, done, points

    def advance(self, points: int, unstable: int, failed: int) -> None:
        if self._progress is None or self._task is None:
            return
        self._points += points
        self._known += points
        self._unstable += unstable
        task = next(t for t in self._progress.tasks if t.id == self._task)
        speed = f"{quantity(self._points / task.elapsed)} points/s" if task.elapsed and self._points else ""
        share = f"{100 * self._unstable / self._known:.1f} % unstable" if self._unstable else ""
        total = self._total if self._known else None
        self._progress.update(self._task, total=total, advance=points, speed=speed, unstable=share)

    def end(self) -> None:
        if self._progress is not None:
            self._progress.stop()


def bar(disable: bool = False) -> Progress:
    """The columns of the bar; rich itself heeds NO_COLOR and the width of the terminal."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = [TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TextColumn("{task.fields[speed]}")]
    more = [TimeElapsedColumn(), TimeRemainingColumn(), TextColumn("{task.fields[unstable]}")]
    return Progress(*columns, *more, console=Console(stderr=True), transient=True, disable=disable)
