"""Amounts and durations as people say them."""

from __future__ import annotations


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
