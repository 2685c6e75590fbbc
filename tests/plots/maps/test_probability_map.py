"""The map of a probability, with lines at given levels."""

import numpy as np
import pytest
from plot_results import axes, floquet_group, probability, tree

from gearstab.errors import PlotError
from gearstab.plots import default_kind, draw
from gearstab.plots.view import Request


def test_lines_stand_where_the_levels_are():
    found = probability()
    assert default_kind(found, Request()) == "probability"
    _, artists = draw(found, dpi=50, levels=(0.25, 0.6))
    assert list(artists["contours"].levels) == [0.25, 0.6]
    assert [entry.get_label() for entry in artists["entries"]] == ["25 %", "60 %"]
    values = found["tolerance"]["probability"].values
    x, y = (found["tolerance"][name].values for name in ("mesh_frequency", "epsilon"))
    for level, paths in zip((0.25, 0.6), artists["contours"].get_paths(), strict=True):
        for at_x, at_y in paths.vertices[::7]:
            i, j = np.searchsorted(x, at_x) - 1, np.searchsorted(y, at_y) - 1
            around = values[max(j - 1, 0) : j + 3, max(i - 1, 0) : i + 3]
            assert np.nanmin(around) <= level <= np.nanmax(around)


def test_defaults_failures_and_nothing():
    _, artists = draw(probability(), "probability", dpi=50)
    assert list(artists["contours"].levels) == [0.01, 0.1, 0.5, 0.9]
    assert artists["failed"] is not None
    calm = probability()
    calm["tolerance"]["probability"].values[:] = 0.0
    _, artists = draw(calm, dpi=50)
    assert artists["contours"] is None
    assert artists["note"].get_text() == "no sample is unstable"
    coords = axes(frequency=np.linspace(1, 2, 3), epsilon=np.linspace(0, 0.5, 3))
    with pytest.raises(PlotError, match=r"methods\.tolerance was not run"):
        draw(tree(floquet=floquet_group(coords)), "probability")
