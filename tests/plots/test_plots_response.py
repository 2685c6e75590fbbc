"""Figures of responses: curves over speed, spectra, maps of the response."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import plot_results as made
import pytest
import xarray as xr
from plot_results import passage, probability
from scenes import read, scene_text

from gearstab.errors import PlotError
from gearstab.plots import default_kind, draw
from gearstab.plots.view import Request
from gearstab.response.command import respond
from gearstab.results import open_result


def test_curves_over_speed_show_every_mesh_and_the_unstable_range():
    tree = made.speeds()
    assert default_kind(tree, Request()) == "speeds"
    figure, artists = draw(tree)
    first, second = artists["lines"]
    factor = tree["response"]["dynamic_load_factor"].values
    x = first.get_xdata()
    inside = (x >= 3.0) & (x <= 3.4)
    np.testing.assert_array_equal(first.get_ydata()[~inside], factor[~inside, 0])
    np.testing.assert_array_equal(second.get_ydata()[~inside], factor[~inside, 1])
    # What repels is drawn faintly.
    assert np.isnan(first.get_ydata()[inside]).all()
    (band,) = artists["bands"].get_paths()
    np.testing.assert_allclose(band.vertices[:, 0].min(), 3.0)
    np.testing.assert_allclose(band.vertices[:, 0].max(), 3.4)
    assert figure.axes[0].get_ylabel() == "dynamic load factor"
    assert figure.axes[0].get_yscale() == "log"  # from 1/21 to 5


def test_without_boundaries_the_flags_tell_what_is_unstable():
    tree = made.speeds()
    del tree["boundaries"]
    _, artists = draw(tree, "speeds", select={"mesh": "second"})
    (line,) = artists["lines"]
    flagged = tree["response"]["status"].values & 1 == 1
    assert flagged.any()
    assert np.isnan(line.get_ydata()[flagged]).all()
    assert artists["bands"] is not None


def test_several_systems_have_no_common_bands():
    tree = made.speeds(epsilon=[0.1, 0.2])
    _, artists = draw(tree, "speeds", select={"mesh": "first"}, variable="mesh_force_peak")
    assert len(artists["lines"]) == 2
    assert artists["bands"] is None
    with pytest.raises(PlotError, match="not over epsilon"):
        draw(tree, "speeds", select={"mesh": "first"}, x="epsilon")


def test_a_map_of_the_response_carries_the_boundaries():
    tree = made.speeds(epsilon=np.linspace(0, 0.5, 6))
    _, artists = draw(tree, "map", variable="dynamic_load_factor", select={"mesh": "first"})
    assert artists["boundaries"] is not None
    with pytest.raises(PlotError, match="mesh"):
        draw(tree, "map", variable="dynamic_load_factor")


def test_without_growth_rates_a_map_shows_the_load_factor():
    tree = made.speeds(epsilon=np.linspace(0, 0.5, 6))
    assert default_kind(tree, Request(select={"mesh": "first"})) == "speeds"  # six curves
    _, artists = draw(tree, "map", select={"mesh": "first"})
    values = tree["response"]["dynamic_load_factor"].values[..., 0].T
    cells = artists["cells"].get_array().reshape(values.shape)
    np.testing.assert_array_equal(np.ma.getdata(cells), values)
    # Where the steady state repels there is nothing to be seen of it.
    unstable = tree["response"]["status"].values.T & 1 == 1
    assert unstable.any()
    np.testing.assert_array_equal(np.ma.getmaskarray(cells), unstable)
    assert artists["colour_bar"].ax.get_ylabel().replace("\n", " ") == "dynamic load factor, white where unstable"
    with pytest.raises(PlotError, match="mesh: its values: first, second"):
        draw(tree, "map")


def test_histories_are_no_speeds_and_speeds_no_histories():
    with pytest.raises(PlotError, match="use --kind response"):
        draw(made.response(), "speeds")
    with pytest.raises(PlotError, match="no histories over time"):
        draw(made.speeds(), "response")


def test_harmonics_are_stems_without_the_mean():
    tree = made.spectra()
    figure, artists = draw(tree, "spectrum")
    assert len(artists["lines"]) == 2
    values = tree["response"]["mesh_force_amplitude"].values
    x, y = artists["lines"][0].get_data()
    assert x[0] == 1.0
    np.testing.assert_array_equal(y, values[x.astype(int), 0])
    # Two natural frequencies above zero in two panels, each named once.
    assert len(artists["modes"]) == 4
    assert [text.get_text() for text in figure.axes[0].texts] == [r"$\omega_{2}$", r"$\omega_{3}$"]
    _, one = draw(tree, "spectrum", select={"mesh": "second"})
    assert len(one["lines"]) == 1


def test_a_density_is_a_line_over_its_whole_range():
    tree = made.spectra(amplitudes=False)
    _, artists = draw(tree, "spectrum")
    values = tree["response"]["mesh_force_density"].values
    np.testing.assert_array_equal(artists["lines"][1].get_ydata(), values[:, 1])


def test_a_pair_of_gears_has_its_spectrum_over_w_d():
    frequency = np.linspace(0, 10, 101)
    data = {"power_spectral_density": ("frequency", np.exp(-frequency), {"units": "1", "long_name": "density"})}
    coords = made.coordinate("frequency", frequency) | {"normalised_frequency": ("frequency", frequency / 2)}
    figure, artists = draw(made.tree(response=xr.Dataset(data, coords=coords)), "spectrum")
    np.testing.assert_array_equal(artists["lines"][0].get_xdata(), frequency / 2)
    assert "omega_d" in figure.axes[-1].get_xlabel()


@pytest.mark.parametrize(
    ("tree", "options", "words"),
    [
        (made.response, {}, "no spectra"),
        (made.spectra, {"variable": "colour"}, "mesh_force_amplitude"),
        (made.spectra, {"select": {"dof": "x1"}}, "there is mesh"),
        (made.spectra, {"select": {"mesh": "third"}}, "first, second"),
    ],
)
def test_spectra_that_are_not_there(tree, options, words):
    with pytest.raises(PlotError, match=words):
        draw(tree(), "spectrum", **options)


@pytest.mark.parametrize(
    ("tree", "kind", "along", "other"),
    [(made.response, "response", "time", "dof"), (made.spectra, "spectrum", "frequency", "mesh"),
     (made.teeth, "teeth", "contact", "mesh")],
)  # fmt: skip
def test_what_is_drawn_along_cannot_be_selected(tree, kind, along, other):
    with pytest.raises(PlotError, match=f"is drawn over {along}: export --select {along}=VALUE"):
        draw(tree(), kind, select={along: "0.5"})
    with pytest.raises(PlotError, match=f"no axis 'colour' to select in this figure; there is .*{other}"):
        draw(tree(), kind, select={"colour": "1"})


def test_what_would_be_a_solid_block_is_drawn_between_its_envelopes():
    tree = made.response()
    data = tree["response"].to_dataset()
    time = np.linspace(0, 20, 4001)
    fast = (1 + 0.1 * time) * np.cos(2 * np.pi * 20 * time)
    coords = {"time": ("time", time, {"units": "s"}), "dof": ["x1"]}
    block = xr.Dataset({"displacement": (("time", "dof"), fast[:, None], data["displacement"].attrs)}, coords=coords)
    _, artists = draw(xr.DataTree.from_dict({"/": tree.to_dataset(), "/response": block}), "response")
    (band,) = artists["lines"]
    inside = band.get_paths()[0].vertices
    assert inside[:, 1].max() == fast.max()
    assert inside[:, 1].min() == fast.min()
    _, artists = draw(tree, "response")
    np.testing.assert_array_equal(artists["lines"][0].get_ydata(), data["displacement"].values[:, 0])


def test_small_waves_on_a_slow_history_do_not_make_it_a_solid_block():
    tree = made.response()
    time = np.linspace(0, 20, 4001)
    slow = 5 + np.cos(2 * np.pi * time / 4) + 0.01 * np.cos(2 * np.pi * 40 * time)
    coords = {"time": ("time", time, {"units": "s"}), "dof": ["x1"]}
    history = xr.Dataset({"displacement": (("time", "dof"), slow[:, None], {"units": "m"})}, coords=coords)
    figure, artists = draw(xr.DataTree.from_dict({"/": tree.to_dataset(), "/response": history}), "response")
    np.testing.assert_array_equal(artists["lines"][0].get_ydata(), slow)
    assert figure.axes[0].get_ylim()[0] > 3  # zero is far from all of it


@pytest.mark.parametrize("size", [3e305, float("inf")])
def test_a_history_beyond_the_limits_of_a_panel_is_refused(size):
    tree = made.response()
    data = tree["response"].to_dataset()
    data["displacement"][-1, 0] = size
    with pytest.raises(PlotError, match="displacement has values beyond 1e\\+200"):
        draw(xr.DataTree.from_dict({"/": tree.to_dataset(), "/response": data}), "response")


def test_a_history_that_grows_beyond_what_a_response_can_is_drawn():
    """A response ends where its square would be infinite, at some 1e155."""
    tree = made.response()
    data = tree["response"].to_dataset()
    data["displacement"][-1, 0] = 1e199
    figure, _ = draw(xr.DataTree.from_dict({"/": tree.to_dataset(), "/response": data}), "response")
    assert 1e199 < figure.axes[0].get_ylim()[1] < np.inf


WEAK = scene_text("plots_response_weak")


FAULT = "faults: [{gear: b, factor: 0.6}]"


@pytest.mark.parametrize("own", [FAULT, "revolution_errors: [{gear: b, cos: [10 um]}]"])
def test_sidebands_are_numbered_by_the_order_of_their_shaft(tmp_path: Path, own: str) -> None:
    out = tmp_path / "weak.h5"
    assert WEAK.count(FAULT) == 1
    respond(read(tmp_path, WEAK.replace(FAULT, own)), out, None)
    with open_result(out) as tree:
        figure, artists = draw(tree, "spectrum", Request())
        amplitude = tree["response"]["mesh_force_amplitude"].isel(mesh=0)
        shaft = 2000 / 60 * 20 / 33 * 2 * np.pi
        numbers = [(int(text.get_text()), *text.xy) for text in artists["sidebands"]]
        assert 0 < len(numbers) <= 6
        for order, x, y in numbers:
            assert order % 33
            assert x == pytest.approx(order * shaft, rel=1e-9)
            assert y == pytest.approx(float(amplitude.sel(frequency=x, method="nearest")), rel=1e-9)
        plt.close(figure)


# --- the figure of a gear pair's response: what is drawn, and from what


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


# --- e-folds over the rate


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
