"""Observers of the progress of a sweep from Python."""

from __future__ import annotations

import sys

from gearstab.sweep import Reporter

NOTEBOOK = "ipykernel"
"""A module that is there in a notebook."""


def reporter(wanted: bool | None) -> Reporter:
    """Return a bar if someone can see it; rich draws it in a notebook as well as on a terminal.

    wanted: True or False decides; None: in a notebook and on a terminal.
    """
    seen = NOTEBOOK in sys.modules or (sys.stderr is not None and sys.stderr.isatty())
    if not (seen if wanted is None else wanted):
        return Reporter()
    from gearstab.sweep.progress import Bar

    return Bar(lambda text: print(text, file=sys.stderr))  # noqa: T201
