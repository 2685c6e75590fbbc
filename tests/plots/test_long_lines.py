"""Lines of many samples on paper: no gap where Matplotlib would split them."""

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from gearstab.plots.drawing.style import style
from gearstab.plots.motions.response import draw_long_line


@pytest.mark.parametrize("samples", [4_000, 25_000])
def test_a_line_has_no_gap(samples: int) -> None:
    with style():
        figure = Figure(figsize=(4, 1), dpi=200)
        ax = figure.add_axes((0, 0, 1, 1))
        x = np.linspace(0.0, 1.0, samples)
        # Steps of a third of the height: the two segments that a split of Matplotlib's drops would leave columns white.
        line = draw_long_line(ax, x, np.floor(30 * x) % 3, "black")
        ax.axis("off")
        ax.set(xlim=(0, 1), ylim=(-0.5, 2.5))
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        dark = (np.asarray(canvas.buffer_rgba())[:, :, 0] < 250).any(axis=0)
    assert line.get_rasterized() in (None, samples > 20_000)
    assert dark.all()
