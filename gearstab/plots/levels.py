"""Levels in dB of what is drawn over the speed, with ``--unit dB``.

    L = 20 lg(|F|/F_0),

F_0 as ISO 1683:2015 has it: 1 uN of forces, 1 pm of displacements, 1 nm/s of velocities; 1 uN m of torques, for which
there is none; 1 of what has no unit.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from gearstab.plots.axes import units_of
from gearstab.plots.drawing.text import bracketed
from gearstab.plots.view import Request

Array = np.ndarray

DECIBEL = "dB"
REFERENCES = {
    "N": (1e-6, r"1 $\mathrm{\mu N}$"), "N m": (1e-6, r"1 $\mathrm{\mu N\,m}$"), "m": (1e-12, "1 pm"),
    "m/s": (1e-9, "1 nm/s"), "rad": (1e-12, "1 prad"),
}  # fmt: skip
"""By unit: the reference value, and how it is written."""
SPAN = 80.0
"""dB that an axis shows at most: what lies further below the largest level is numerical noise."""


def in_decibels(values: Array, data: xr.DataArray, request: Request) -> Array:
    """Return values as they are, or as levels where these are asked for; NaN of 0."""
    if not request.decibels:
        return np.asarray(values, dtype=float)
    with np.errstate(divide="ignore"):
        level = 20 * np.log10(np.abs(values) / REFERENCES.get(units_of(data), (1.0, ""))[0])
    return np.where(np.isfinite(level), level, np.nan)


def level_label(words: str, data: xr.DataArray, request: Request) -> str:
    """Label of an axis, with the unit, or with what a level refers to."""
    units = units_of(data)
    if not request.decibels:
        return words + bracketed(units)
    reference = REFERENCES.get(units, (1.0, "1" + (f" {units}" if units not in ("", "1") else "")))[1]
    return f"{words} ({DECIBEL} re {reference})"


def tall_enough(ax: Axes, values: Array, request: Request) -> None:
    """Begin an axis of amplitudes at zero, and one of levels at most SPAN below the largest."""
    if not request.decibels:
        ax.set_ylim(bottom=0.0)
        return
    top = float(np.nanmax(values, initial=-np.inf))
    low = float(np.nanmin(values, initial=np.inf))
    if np.isfinite(top):
        air = 0.06 * (min(SPAN, top - low) or 1.0)
        ax.set_ylim(max(low - air, top - SPAN), top + air)
