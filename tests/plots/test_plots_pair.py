"""The figure of a gear pair's response: what is drawn, and from what."""

import numpy as np
import plot_results as made
import pytest

from gearstab.errors import PlotError
from gearstab.plots import default_kind, draw
from gearstab.plots.view import Request


def test_a_response_of_a_pair_is_drawn_by_default() -> None:
    assert default_kind(made.pair(), Request()) == "pair"
    assert default_kind(made.pair(), Request(variable="phi")) == "response"
    assert default_kind(made.response(), Request()) == "response"


def test_the_deflection_is_that_of_the_last_cycles() -> None:
    tree = made.pair()
    figure, artists = draw(tree, "pair")
    time, phi = artists["deflection"].get_data()
    np.testing.assert_allclose([time[0], time[-1]], [4.0, 10.0])
    np.testing.assert_array_equal(phi, tree["response"]["phi"].values[800:])
    assert len(figure.axes) == 3


def test_bands_show_where_two_pairs_are_in_contact() -> None:
    _, artists = draw(made.pair(), "pair")
    spans = sorted((p.vertices[:, 0].min(), p.vertices[:, 0].max()) for p in artists["bands"].get_paths())
    # From sample to sample, 5 ms apart.
    np.testing.assert_allclose(spans, [(c + 0.5, c + 1.0) for c in range(4, 10)], atol=0.006)


def test_the_spectrum_ends_at_eight_times_the_natural_frequency() -> None:
    figure, artists = draw(made.pair(), "pair")
    assert figure.axes[2].get_xlim() == (0.0, 8.0)
    assert figure.axes[2].get_yscale() == "log"
    np.testing.assert_allclose(artists["density"].get_xdata()[-1], 12.0)


def test_a_short_response_has_no_spectrum() -> None:
    figure, artists = draw(made.pair(spectrum=False), "pair")
    assert artists["density"] is None
    assert len(figure.axes) == 2


def test_a_constant_energy_is_not_blown_up() -> None:
    figure, _ = draw(made.pair(energy_loss=1e-16), "pair")
    low, high = figure.axes[1].get_ylim()
    assert high - low > 0.1


def test_two_columns_stand_side_by_side() -> None:
    figure, _ = draw(made.pair(), "pair", size="double")
    assert figure.get_figwidth() > 2 * figure.get_figheight()


def test_what_the_figure_cannot_show_is_said() -> None:
    with pytest.raises(PlotError, match="no response of a gear pair"):
        draw(made.response(), "pair")
    with pytest.raises(PlotError, match="fixed panels"):
        draw(made.pair(), "pair", variable="phi")
