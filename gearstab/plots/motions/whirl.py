"""Natural frequencies that follow the speed of rotation: curves by the sense of their orbits, and what grows there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from gearstab.plots.axes import FigureAxis, group_of
from gearstab.plots.drawing.style import CASES, LINE, UNSTABLE
from gearstab.plots.view import View
from gearstab.results.display import SPEED_RATIOS

Array = np.ndarray

LOOKS: dict[int, tuple[str, Any, str]] = {
    1: (CASES[1], "-", "forward"),
    -1: (CASES[3], (0, (5, 1.5)), "backward"),
    0: (LINE, "-", "neither"),
}
"""By the sense of the orbits: colour, line, words."""
TURNING: dict[str, Any] = {"color": "#6e6e6e", "linestyle": ":", "linewidth": 1.0}
"""Look of lines at the speeds of rotation."""


@dataclass(frozen=True)
class WhirlCurves:
    """Curves over a speed, ``(P, n)`` each; speed: ``(P,)``, ascending. unstable: ``(P,)``, by Floquet analysis, and
    None where the result does not hold it. ratios: of the speeds of rotation to the mesh frequency.
    """

    speed: Array
    frequency: Array
    growth: Array
    whirl: Array
    veering: Array
    unstable: Array | None
    ratios: tuple[float, ...]

    @classmethod
    def read(cls, tree: xr.DataTree, view: View, speed: FigureAxis | None) -> WhirlCurves | None:
        """Return those of a result over the speed that is drawn, None where there are none."""
        data = group_of(tree, "natural_frequencies")
        if "whirl" not in data or speed is None or view.x.name != speed.name:
            return None
        names = ("natural_frequency", "growth_rate", "whirl", "veering")
        frequency, growth, whirl, veering = (view.cut(data[name], speed.name, "mode") for name in names)
        floquet, unstable = group_of(tree, "floquet"), None
        if "stable" in floquet and set(map(str, floquet["stable"].dims)) <= {speed.name, *view.fixed}:
            unstable = view.cut(floquet["stable"], speed.name) == 0
        ratios = tuple(np.atleast_1d(data.attrs[SPEED_RATIOS]).tolist())
        return cls(speed.ascending, frequency, growth, whirl, veering, unstable, ratios)

    def draw(self, ax: Axes, unit: float, factor: float) -> list[Line2D]:
        """Draw the curves, what grows by itself, where motions veer, and lines at the speeds of rotation."""
        lines: list[Line2D] = []
        for own, growth, sense, near in zip(
            self.frequency.T / unit, self.growth.T, self.whirl.T, self.veering.T, strict=True
        ):
            drawn = np.where(own > 0, own, np.nan)
            for value, (colour, look, _) in LOOKS.items():
                part = sense == value
                # A stretch goes on to the next speed, so that no gap is left where the sense changes.
                part[1:] |= part[:-1]
                if np.isfinite(drawn[part]).any():
                    y = np.where(part, drawn, np.nan)
                    lines += ax.plot(self.speed, y, color=colour, linestyle=look, linewidth=1.0, zorder=2)
            if (growth > 0).any():
                y = np.where(growth > 0, own, np.nan)
                ax.plot(self.speed, y, color=UNSTABLE, linewidth=2.6, alpha=0.8, zorder=1.9)
            at = np.flatnonzero(near)
            ax.plot(self.speed[at], drawn[at], "o", markersize=4.5, color=LINE, fillstyle="none", zorder=3)
        for ratio in sorted({abs(ratio) for ratio in self.ratios if ratio}):
            y = ratio * factor * self.speed / unit
            ax.plot(self.speed, y, **TURNING, zorder=1.6)
        return lines

    def bands(self) -> list[tuple[float, float]]:
        """Return where the speeds of unstable points begin and how wide they are, each half way to the next."""
        if self.unstable is None or len(self.speed) < 2:
            return []
        middle = 0.5 * (self.speed[1:] + self.speed[:-1])
        edges = np.concatenate([self.speed[:1], middle, self.speed[-1:]])
        change = np.flatnonzero(np.diff(np.concatenate([[False], self.unstable, [False]]).astype(int)))
        return [(float(edges[a]), float(edges[b] - edges[a])) for a, b in change.reshape(-1, 2)]

    def handles(self) -> list[Any]:
        """Return the entries of a legend."""
        found: list[Any] = [
            Line2D([], [], color=colour, linestyle=look, linewidth=1.0, label=f"whirl {words}")
            if value
            else Line2D([], [], color=colour, linewidth=1.0, label="other natural frequencies")
            for value, (colour, look, words) in LOOKS.items()
            if ((self.whirl == value) & (self.frequency > 0)).any()
        ]
        if self.veering.any():
            mark: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 4.5, "fillstyle": "none"}
            found.append(Line2D([], [], color=LINE, label="veering", **mark))
        if ((self.growth > 0) & (self.frequency > 0)).any():
            found.append(Line2D([], [], color=UNSTABLE, linewidth=2.6, alpha=0.8, label="grows by itself"))
        if any(self.ratios):
            found.append(Line2D([], [], **TURNING, label="speed of rotation"))
        return found
