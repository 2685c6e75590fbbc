"""The progress of a sweep on standard error: a bar on a terminal, nothing but messages elsewhere."""

from __future__ import annotations

import sys

from gearstab.cli.terminal.console import tell
from gearstab.sweep import Reporter


class Messages(Reporter):
    """Messages alone; none of them if ``quiet``."""

    def __init__(self, quiet: bool = False) -> None:
        self.quiet = quiet

    def message(self, text: str) -> None:
        if not self.quiet:
            tell(text)


def reporter(quiet: bool) -> Reporter:
    """A bar if someone can see it."""
    if quiet or not sys.stderr.isatty():
        return Messages(quiet)
    from gearstab.sweep.progress import Bar

    return Bar(tell)
