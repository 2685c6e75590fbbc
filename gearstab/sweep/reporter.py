"""Events of a running sweep; this class ignores them. The command line has one that draws a bar."""

from __future__ import annotations


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
