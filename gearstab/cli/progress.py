"""The progress of a sweep on standard error: a bar on a terminal, nothing but messages elsewhere."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from gearstab.cli.console import tell
from gearstab.sweep import Reporter

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID


class Messages(Reporter):
    """Messages alone; none of them if ``quiet``."""

    def __init__(self, quiet: bool = False) -> None:
        self.quiet = quiet

    def message(self, text: str) -> None:
        if not self.quiet:
            tell(text)


class Bar(Messages):
    """A bar a method: points, points a second, time left, unstable share."""

    def __init__(self) -> None:
        super().__init__()
        self._progress: Progress | None = None
        self._task: TaskID | None = None
        self._points = self._unstable = self._known = 0

    def begin(self, method: str, points: int, done: int) -> None:
        progress = self._progress = self._progress or bar()
        progress.start()
        self._task = progress.add_task(method, total=points, completed=done, speed="", unstable="")
        self._points, self._unstable, self._known = 0, 0, done

    def advance(self, points: int, unstable: int, failed: int) -> None:
        if self._progress is None or self._task is None:
            return
        self._points += points
        self._known += points
        self._unstable += unstable
        task = next(t for t in self._progress.tasks if t.id == self._task)
        speed = f"{quantity(self._points / task.elapsed)} points/s" if task.elapsed and self._points else ""
        share = f"{100 * self._unstable / self._known:.1f} % unstable" if self._unstable else ""
        self._progress.update(self._task, advance=points, speed=speed, unstable=share)

    def end(self) -> None:
        if self._progress is not None:
            self._progress.stop()


def bar() -> Progress:
    """The columns of the bar; rich itself heeds NO_COLOR and the width of the terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = [TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TextColumn("{task.fields[speed]}")]
    more = [TimeRemainingColumn(elapsed_when_finished=True), TextColumn("{task.fields[unstable]}")]
    return Progress(*columns, *more, console=Console(stderr=True), transient=True)


def reporter(quiet: bool) -> Reporter:
    """A bar if someone can see it."""
    return Bar() if not quiet and sys.stderr.isatty() else Messages(quiet)


def quantity(value: float) -> str:
    """A number in three digits: ``999``, ``1.23 k``, ``45.6 M``."""
    for factor, letter in ((1e9, " G"), (1e6, " M"), (1e3, " k")):
        if value >= 0.9995 * factor:
            return f"{value / factor:.3g}{letter}"
    return f"{value:.3g}"


def duration(seconds: float) -> str:
    """Seconds in words: ``0.42 s``, ``12 s``, ``3 min 20 s``, ``5 h 12 min``, ``2 d 3 h``."""
    if seconds < 59.5:
        return f"{seconds:.2g} s" if seconds < 10 else f"{seconds:.0f} s"
    whole = round(seconds)
    for unit, name, inner, below in ((86400, "d", 3600, "h"), (3600, "h", 60, "min"), (60, "min", 1, "s")):
        if whole >= unit:
            rest = whole % unit // inner
            return f"{whole // unit} {name}" + (f" {rest} {below}" if rest else "")
    return f"{whole} s"
