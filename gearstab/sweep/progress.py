"""Events of a running sweep; this class ignores them. The command line has one that draws a bar."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.progress import Progress, TaskID


def quantity(value: float) -> str:
    """A number in three digits: ``999``, ``1.23 k``, ``45.6 M``."""
    for factor, letter in ((1e9, " G"), (1e6, " M"), (1e3, " k")):
        if value >= 0.9995 * factor:
            return f"{value / factor:.3g}{letter}"
    return f"{value:.3g}"


def octets(count: float) -> str:
    """A number of bytes: ``0 B``, ``999 B``, ``1.23 kB``, ``45.6 GB``."""
    text = quantity(count)
    return f"{text}B" if " " in text else f"{text} B"


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


class Reporter:
    """Gets called as a sweep proceeds."""

    def message(self, text: str) -> None:
        """Something the user should know, one line."""

    def begin(self, method: str, points: int, done: int, seconds: float | None, together: int) -> None:
        """A method starts; ``done`` of its points are there already.

        seconds: what the others will take, None where that is not known; together: how many come at once.
        """

    def advance(self, points: int, unstable: int, failed: int) -> None:
        """Further points are there, of which so many are unstable and could not be computed."""

    def end(self) -> None:
        """No more points will come: all are there, or the sweep was stopped."""


class Bar(Reporter):
    """A bar per method: points, points per second, time taken and left, unstable share. say: shows a message.

    Within a block it goes on with the speed so far, or with that of the forecast; where neither is known it runs to and
    fro.
    """

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._progress: Progress | None = None
        self._task: TaskID | None = None
        self._points = self._unstable = self._known = self._total = self._together = 0
        self._speed, self._since = 0.0, 0.0

    def message(self, text: str) -> None:
        self._say(text)

    def begin(self, method: str, points: int, done: int, seconds: float | None, together: int) -> None:
        progress = self._progress = self._progress or bar(self._ahead)
        self._points, self._unstable, self._known, self._total, self._together = 0, 0, done, points, together
        self._speed, self._since = (points - done) / seconds if seconds else 0.0, time.monotonic()
        total = points if done or seconds else None
        self._task = progress.add_task(method, total=total, completed=done, speed="", unstable="")
        progress.start()

    def _ahead(self) -> float:
        """The points that are done, by the speed: never quite those that come together next."""
        left = min(self._together, self._total - self._known)
        passed = self._speed * (time.monotonic() - self._since)
        return self._known + (left * -math.expm1(-passed / left) if left else 0.0)

    def advance(self, points: int, unstable: int, failed: int) -> None:
        if self._progress is None or self._task is None:
            return
        self._points += points
        self._known += points
        self._unstable += unstable
        task = next(t for t in self._progress.tasks if t.id == self._task)
        speed = f"{quantity(self._points / task.elapsed)} points/s" if task.elapsed and self._points else ""
        share = f"{100 * self._unstable / self._known:.1f} % unstable" if self._unstable else ""
        total = self._total if self._known or self._speed else None
        if points and task.elapsed:
            self._speed = self._points / task.elapsed
        self._since = time.monotonic()
        self._progress.update(self._task, total=total, completed=self._known, speed=speed, unstable=share)

    def end(self) -> None:
        if self._progress is not None:
            self._progress.stop()


def bar(ahead: Callable[[], float] = lambda: 0.0, disable: bool = False) -> Progress:
    """The columns of the bar; rich itself heeds NO_COLOR and the width of the terminal.

    ahead: how far the last task is at any moment.
    """
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    class Going(Progress):
        """A bar whose last task goes on whenever it is drawn."""

        def get_renderables(self) -> Iterable[RenderableType]:
            if self.tasks and not (last := self.tasks[-1]).finished and last.total is not None:
                self.update(last.id, completed=max(ahead(), last.completed))
            yield from super().get_renderables()

    columns = [TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TextColumn("{task.fields[speed]}")]
    more = [TimeElapsedColumn(), TimeRemainingColumn(), TextColumn("{task.fields[unstable]}")]
    return Going(*columns, *more, console=Console(stderr=True), transient=True, disable=disable)
