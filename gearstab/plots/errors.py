"""The one error of this package."""

from __future__ import annotations

from collections.abc import Iterable

from gearstab.errors import UserError


class PlotError(UserError, ValueError):
    """A figure that the result cannot give; the message is one line and says what is possible instead."""


def listed(names: Iterable[str], most: int = 12) -> str:
    """``a, b, c``; long lists are cut and counted, so that a message stays one line."""
    items = [str(name) for name in names]
    shown = ", ".join(items[:most]) or "none"
    return shown if len(items) <= most else f"{shown}, ... ({len(items)} in all)"
