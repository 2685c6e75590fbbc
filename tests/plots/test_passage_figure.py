"""E-folds over the rate."""

import numpy as np
import pytest
from plot_results import passage, probability

from gearstab.errors import PlotError
from gearstab.plots import default_kind, draw
from gearstab.plots.view import Request


def test_curves_are_those_of_the_result():
    found = passage()
    assert default_kind(found, Request()) == "passage"
    figure, artists = draw(found, dpi=50)
    data = found["passage"].to_dataset()
    for name, key in (("growth_exact", "exact"), ("growth", "adiabatic")):
        lines = artists[key]
        # Upwards a line, downwards a mark, for each of three damping ratios.
        assert len(lines) == 6
        for k, ratio in enumerate(data["damping_ratio"].values):
            values = data[name].sel(damping_ratio=ratio).values
            assert np.array_equal(lines[2 * k].get_xdata(), [0.1, 1.0, 10.0])
            assert np.array_equal(lines[2 * k].get_ydata(), values[1:])
            assert np.array_equal(lines[2 * k + 1].get_xdata(), [0.1])
            assert np.array_equal(lines[2 * k + 1].get_ydata(), values[:1])
    assert artists["admitted"].get_ydata()[0] == np.log(10.0)
    words = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    assert "exactly" in words
    assert "downwards, by growth rates" in words


def test_rates_are_in_the_unit_of_the_speed_and_nothing_is_drawn_where_nothing_grows():
    found = passage()
    found["passage"] = found["passage"].to_dataset().assign(growth_exact=lambda data: 0 * data["growth_exact"])
    typed = {"units": "rad/s", "display_units": "rpm", "display_scale": 2 * np.pi / 60}
    found.dataset = found.to_dataset().assign_coords(input_speed=("input_speed", [1.0, 2.0], typed))
    figure, artists = draw(found, dpi=50)
    assert "(rpm/s)" in figure.axes[0].get_xlabel()
    assert artists["adiabatic"][0].get_xdata() == pytest.approx(np.array([0.1, 1.0, 10.0]) * 60 / (2 * np.pi))
    assert np.isnan(artists["exact"][0].get_ydata()).all()


def test_one_case_and_other_results():
    _, artists = draw(passage((0.1, 1.0)), "passage", select={"damping_ratio": "0.01"}, dpi=50)
    assert len(artists["exact"]) == 1
    with pytest.raises(PlotError, match=r"methods\.passage was not run"):
        draw(probability(), "passage")
