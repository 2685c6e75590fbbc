"""Figures: the arrays of their artists against the data, over every kind."""

from typing import Any

import numpy as np
import plot_results as made
import pytest
import xarray as xr
from matplotlib.colors import ListedColormap, Normalize
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from gearstab.errors import PlotError
from gearstab.plots import KINDS, default_kind, draw
from gearstab.plots.axes import FigureAxis
from gearstab.plots.drawing.grid import draw_cells
from gearstab.plots.drawing.style import new_figure
from gearstab.plots.maps import surface
from gearstab.plots.view import Request


def growth_of(tree, **index):
    return tree["floquet"]["growth_rate"].isel(index).transpose("epsilon", "mesh_frequency").values


@pytest.fixture(scope="module")
def plain_map():
    """(result, figure, artists) of a map that tests only look at."""
    tree = made.fig3()
    return tree, *draw(tree, "map")


def segments(lines):
    return [np.asarray(path.vertices) for path in lines.get_paths()]


def names_in(artists):
    return [text.get_text() for text in artists["names"].texts]


# --- map


def test_map_colours_the_growth_rates_of_unstable_points_only(plain_map):
    tree, _, artists = plain_map
    values, growth = artists["cells"].get_array(), growth_of(tree)
    assert values.shape == growth.shape
    np.testing.assert_array_equal(np.ma.getmaskarray(values), growth <= 0)
    np.testing.assert_array_equal(values.compressed(), growth[growth > 0])
    assert artists["note"] is None
    assert artists["cells"].norm.vmin == 0
    assert artists["cells"].norm.vmax == growth.max()
    assert artists["failed"] is None
    assert artists["neutral"] is None


def test_map_trusts_the_stable_flag_over_rounding_in_the_growth_rate():
    tree = made.fig3()
    noise = tree["floquet"]["growth_rate"].values
    noise[noise == 0] = 1e-9
    _, artists = draw(tree, "map")
    np.testing.assert_array_equal(
        np.ma.getmaskarray(artists["cells"].get_array()),
        tree["floquet"]["stable"].transpose("epsilon", "mesh_frequency").values == 1,
    )


def test_map_draws_the_perturbation_boundaries_that_can_be_seen(plain_map):
    tree, _, artists = plain_map
    edges = tree["perturbation"]["boundary_frequency"].values
    # 0.4 % of the frame, 0.0266 rad/s, is the width below which a tongue is no more than its own lines.
    seen = [e for e in edges if e[1, -1] - e[0, -1] > 0.0266 and e[1, -1] > 0.35 and e[0, -1] < 7]
    expected = np.array([side for edge in seen for side in edge])
    drawn = segments(artists["perturbation"])
    assert len(seen) == 8
    np.testing.assert_array_equal([s[:, 0] for s in drawn], expected)
    for segment in drawn:
        np.testing.assert_array_equal(segment[:, 1], tree["perturbation"]["epsilon"].values)


def test_map_names_the_tongues_of_figure_3(plain_map):
    artists = plain_map[-1]
    expected = {
        r"$2\omega_{1}$", r"$2\omega_{2}$", r"$2\omega_{3}$", r"$\omega_{1}+\omega_{2}$", r"$\omega_{1}+\omega_{3}$",
        r"$\omega_{2}+\omega_{3}$", r"$2\omega_{2}/3$", r"$2\omega_{3}/3$",
    }  # fmt: skip
    assert set(names_in(artists)) == expected


def test_regions_of_a_single_mode_without_boundaries_are_named_by_where_they_lie():
    """Around 2w1 and w1; not where the parameter moves the region away from there."""
    epsilon, omega = np.linspace(0, 1, 5), np.linspace(0.5, 3.0, 51)
    near = np.abs(omega - 2.0) < 0.3
    moved = np.abs(omega - 1.0 - 0.4 * epsilon[:, None]) < 0.2
    group = xr.Dataset(
        {
            "growth_rate": (("epsilon", "mesh_frequency"), (near | moved).astype(float)),
            "stable": (("epsilon", "mesh_frequency"), (~(near | moved)).astype(np.int8)),
        },
        {"epsilon": epsilon, "mesh_frequency": omega},
    )
    modes = xr.Dataset({"natural_frequency": ("mode", [0.0, 1.0])})
    _, artists = draw(xr.DataTree.from_dict({"/floquet": group, "/modes": modes}), "map")
    assert names_in(artists) == [r"$2\omega_{2}$"]


def test_a_map_of_stable_has_two_colours_and_words_for_them():
    tree = made.fig3()
    tree["floquet"]["stable"].transpose("epsilon", "mesh_frequency").values[20, 59] = -1
    figure, artists = draw(tree, "map", variable="stable")
    assert artists["cells"].cmap.N == 2
    assert [t.get_text() for t in artists["colour_bar"].ax.get_yticklabels()] == ["unstable", "stable"]
    assert len(artists["failed"].get_paths()) == 1
    assert [t.get_text() for legend in figure.legends for t in legend.get_texts()][-1] == "no value"


def test_map_prefers_the_names_of_exact_boundaries_and_draws_both():
    coords = made.axes()
    exact = made.boundary_group(coords, "fig5 dashed")
    tree = made.tree(floquet=made.floquet_group(coords), perturbation=made.boundary_group(coords), boundaries=exact)
    _, artists = draw(tree, "map")
    edges = exact["boundary_frequency"].values
    wide = edges[:, 1] - edges[:, 0] >= 0.002 * 6.65  # else the two lines are one
    drawn = segments(artists["boundaries"])
    assert len(drawn) == 2 * wide.any(axis=1).sum()
    for segment, edge in zip(drawn, edges[wide.any(axis=1)].reshape(-1, 21), strict=True):
        np.testing.assert_array_equal(segment[:, 0], edge[-len(segment) :])
    # The tongue at w2+w3 is fifteen times as wide as to perturbation theory here, that at 2w1 too thin to see.
    texts = names_in(artists)
    assert texts.count(r"$\omega_{2}+\omega_{3}$") == 1
    assert r"$2\omega_{1}$" in texts  # seen in the predicted boundaries only


def test_thin_tongues_are_one_light_line_and_leaps_are_left_open():
    coords = made.axes()
    exact = made.boundary_group(coords).isel(tongue=[0, 5])
    edges = exact["boundary_frequency"].values
    edges[0] = [[4.0], [4.0001]]
    edges[1, :, 10:] += 0.4  # the name passes to another region here
    tree = made.tree(floquet=made.floquet_group(coords), boundaries=exact)
    _, artists = draw(tree, "map")
    (thin, tip) = segments(artists["thin"])
    np.testing.assert_allclose(thin[:, 0], 4.00005)
    assert len(tip) == 2  # from epsilon = 0 to the first row where 2w3 is wide
    drawn = segments(artists["boundaries"])
    assert [len(line) for line in drawn] == [10, 11, 10, 11]
    np.testing.assert_array_equal(np.concatenate([line[:, 0] for line in drawn[:2]]), edges[1, 0])


def test_damped_map_draws_the_neutral_line_where_the_growth_rate_is_zero():
    tree = made.fig3(damping=0.05)
    _, artists = draw(tree, "map")
    _, centre, half = made.published()
    # The 2w3 tongue alone reaches beyond 5 rad/s: sqrt(W^2 - d^2)/2 = 0.05 there.
    points = np.concatenate([np.asarray(p.vertices) for p in artists["neutral"].get_paths()])
    points = points[points[:, 0] > 5]
    width = half[5] * points[:, 1]
    exact = np.sqrt(np.maximum(width**2 - 0.1**2, 0))
    assert len(points) > 10
    # Contours interpolate linearly between frequencies 0.113 apart.
    assert np.max(np.abs(np.abs(points[:, 0] - centre[5]) - exact)) < 0.113
    assert (artists["cells"].get_array().compressed() > 0).all()


@pytest.mark.parametrize("flip", [{"epsilon": slice(None, None, -1)}, {"mesh_frequency": slice(None, None, -1)}])
def test_descending_axes_give_the_same_map(flip):
    tree = made.fig3()
    groups = {
        name: tree[name].to_dataset().isel({k: v for k, v in flip.items() if k in tree[name].sizes})
        for name in ("floquet", "perturbation")
    }
    _, straight = draw(tree, "map")
    _, flipped = draw(made.tree(**groups), "map")
    np.testing.assert_array_equal(straight["cells"].get_array(), flipped["cells"].get_array())
    np.testing.assert_array_equal(segments(straight["perturbation"]), segments(flipped["perturbation"]))
    assert straight["cells"].get_extent() == flipped["cells"].get_extent()


def test_uneven_axis_keeps_its_cell_edges():
    epsilon = np.array([0.0, 0.1, 0.3, 0.5])
    _, artists = draw(made.fig3(epsilon=epsilon), "map")
    corners = artists["cells"].get_coordinates()
    np.testing.assert_allclose(corners[:, 0, 1], [-0.05, 0.05, 0.2, 0.4, 0.6])


def test_geometric_axis_is_drawn_logarithmically_with_geometric_edges():
    frequency = np.geomspace(0.4, 6.4, 33)
    figure, artists = draw(made.fig3(frequency=frequency), "map")
    ax = figure.axes[0]
    ratio = 16 ** (1 / 32)
    assert ax.get_xscale() == "log"
    edges = artists["cells"].get_coordinates()[0, :, 0]
    np.testing.assert_allclose(edges[1:] / edges[:-1], ratio)
    np.testing.assert_allclose(edges[[0, -1]], [0.4 / ratio**0.5, 6.4 * ratio**0.5])
    assert r"$2\omega_{3}$" in names_in(artists)


def test_points_without_a_value_are_hatched_once_each():
    tree = made.fig3()
    holes = tree["floquet"]["growth_rate"].transpose("epsilon", "mesh_frequency").values
    holes[3, 10:14] = np.nan
    tree["floquet"]["stable"].transpose("epsilon", "mesh_frequency").values[20, 59] = -1
    _, artists = draw(tree, "map")
    boxes = [path.get_extents() for path in artists["failed"].get_paths()]
    assert len(boxes) == 2  # a run of cells is one patch
    step, row = 6.65 / 59, 0.025
    np.testing.assert_allclose(boxes[0].extents, [0.35 + 9.5 * step, 2.5 * row, 0.35 + 13.5 * step, 3.5 * row])
    np.testing.assert_allclose(boxes[1].extents, [7 - step / 2, 19.5 * row, 7 + step / 2, 20.5 * row])
    assert np.ma.getmaskarray(artists["cells"].get_array())[3, 10:14].all()


def test_swapped_axes_transpose_the_map_and_its_lines():
    tree = made.fig3()
    figure, artists = draw(tree, "map", x="epsilon", y="mesh_frequency")
    values = artists["cells"].get_array()
    np.testing.assert_array_equal(values.filled(0), np.maximum(growth_of(tree), 0).T)
    np.testing.assert_array_equal(segments(artists["perturbation"])[0][:, 0], tree["perturbation"]["epsilon"].values)
    assert set(names_in(artists)) == set(names_in(draw(tree, "map")[1]))
    right = figure.axes[0].get_window_extent().x1
    assert all(text.get_window_extent().x0 > right for text in artists["names"].texts)


def test_axis_of_labels_is_drawn_in_rows_with_its_labels():
    tree = made.fig3(case=["worst", "phased", "near integer"])
    figure, artists = draw(tree, "map", y="case", select={"epsilon": "0.3"})
    assert [t.get_text() for t in figure.axes[0].get_yticklabels()] == ["worst", "phased", "near integer"]
    assert artists["cells"].get_array().shape == (3, 60)
    assert artists["perturbation"] is None


def test_single_value_axis_can_be_drawn():
    tree = made.fig3(epsilon=np.array([0.3]))
    _, artists = draw(tree, "map", y="epsilon")
    assert artists["cells"].get_array().shape == (1, 60)
    assert default_kind(tree, Request()) == "curve"


def test_other_variables_are_drawn_over_their_own_axes():
    tree = made.fig3(phasing=[0.0, 0.25, 0.5])
    figure, artists = draw(tree, "map", variable="half_width", select={"tongue": "2w3"}, x="phasing")
    expected = tree["perturbation"]["half_width"].values[5].T
    np.testing.assert_array_equal(artists["cells"].get_array(), expected)
    assert "2\\omega_{3}" in figure.get_suptitle()


def test_selection_takes_the_nearest_value_and_says_so():
    tree = made.fig3(phasing=[0.0, 0.2, 0.4])
    figure, artists = draw(tree, "map", select={"phasing": "0.23"})
    np.testing.assert_array_equal(artists["cells"].get_array().filled(0), np.maximum(growth_of(tree, phasing=1), 0))
    assert figure.get_suptitle().endswith("$h$ = 0.2")
    plain, _ = draw(tree, "map", select={"phasing": "0.23"}, title=False)
    assert plain.get_suptitle() == ""


def test_axis_labels_carry_symbol_and_unit(plain_map):
    _, figure, artists = plain_map
    ax = figure.axes[0]
    assert ax.get_xlabel() == r"mesh frequency $\Omega$ (rad/s)"
    assert ax.get_ylabel() == r"stiffness variation $\varepsilon$"
    assert artists["colour_bar"].ax.get_ylabel() == r"growth rate ($\mathrm{s}^{-1}$)"


def test_cells_narrower_than_a_pixel_are_averaged_and_wide_ones_stay_sharp():
    """A pixel with one unstable cell of ten has a tenth of its colour; a row of cells does not bleed into the next."""
    values = np.ma.masked_all((2, 4000))
    values[0, 5::10] = 1.0
    figure = new_figure(Request(), 0.5)
    figure.set_layout_engine("none")
    ax = figure.add_axes((0, 0, 1, 1))
    frequency, case = (
        FigureAxis("mesh_frequency", np.arange(4000.0)),
        FigureAxis("case", np.array(["a", "b"], dtype=object)),
    )
    draw_cells(ax, frequency, case, values, ListedColormap(["black"]), Normalize(0, 1))
    ax.set(xlim=(0, 3999), ylim=(-0.5, 1.5))
    ax.set_axis_off()
    figure.canvas.draw()
    grey = np.asarray(figure.canvas.buffer_rgba())[:, 20:-20, 0].astype(float)
    height = grey.shape[0]
    assert np.all(grey[: height // 2 - 1] == 255)  # the stable upper row
    lower = grey[height // 2 + 2 :]
    assert lower.mean() == pytest.approx(255 * 0.9, rel=0.02)
    assert lower.min() > 100  # no pixel is as dark as its one unstable cell


# --- boundaries


def test_boundaries_over_floquet_regions_with_lines_of_every_theory():
    coords = made.axes()
    tree = made.tree(
        floquet=made.floquet_group(coords),
        perturbation=made.boundary_group(coords),
        boundaries=made.boundary_group(coords),
        uncoupled=made.boundary_group(coords, factor=1.2),
    )
    assert default_kind(tree, Request()) == "boundaries"
    _, artists = draw(tree, "boundaries")
    (case,) = artists["cases"]
    unstable = ~np.ma.getmaskarray(case["regions"].get_array())
    np.testing.assert_array_equal(unstable, growth_of(tree) > 0)
    for group in ("uncoupled", "boundaries"):
        ends = {round(s[-1, 0], 9) for s in segments(case[group])}
        edges = tree[group]["boundary_frequency"].values[5, :, -1]
        assert {round(e, 9) for e in edges} <= ends
    texts = [text.get_text() for text in artists["legend"].get_texts()]
    assert texts == ["exact boundaries", "first order", "uncoupled modes", "exact, narrow", "unstable (Floquet)"]


def styles(artists, *groups):
    """Dashes of the lines of groups."""
    return [artists[group].get_linestyle()[0][1] for group in groups]


def test_theories_have_one_style_of_lines_in_every_kind_of_figure():
    coords = made.axes()
    known = {"floquet": made.floquet_group(coords), "boundaries": made.boundary_group(coords)}
    orders = [made.tree(**known, perturbation=made.boundary_group(coords)) for _ in range(2)]
    orders[1]["perturbation"].attrs["order"] = 2
    found = []
    for tree in orders:
        on_map = draw(tree, "map")[1]
        (case,) = draw(tree, "boundaries")[1]["cases"]
        flipped = draw(tree, "map", x="epsilon", y="mesh_frequency")[1]
        looks = [styles(artists, "boundaries", "perturbation") for artists in (on_map, case, flipped)]
        assert looks[0] == looks[1] == looks[2]
        found += looks[0]
    exact, first, again, second = found
    assert exact is None
    assert again is None
    assert len(first) < len(second)  # dashes against dashes and dots


def test_cases_are_overlaid_in_different_styles():
    tree = made.fig3(case=["worst", "phased", "near integer"])
    _, artists = draw(tree)
    assert len(artists["cases"]) == 3
    for index, case in enumerate(artists["cases"]):
        expected = tree["perturbation"]["boundary_frequency"].isel(case=index).values[5]
        drawn = [s[:, 0] for s in segments(case["perturbation"])]
        assert sum(np.array_equal(line, side) for line in drawn for side in expected) == 2
    looks = {str((c["perturbation"].get_linestyle(), c["perturbation"].get_color())) for c in artists["cases"]}
    assert len(looks) == 3
    assert [t.get_text() for t in artists["legend"].get_texts()][:3] == ["worst", "phased", "near integer"]


def test_boundaries_need_no_floquet_grid():
    coords = made.axes()
    tree = made.tree(perturbation=made.boundary_group(coords))
    figure, artists = draw(tree)
    assert artists["cases"][0]["regions"] is None
    low, high = figure.axes[0].get_xlim()
    edges = tree["perturbation"]["boundary_frequency"].values
    assert low <= edges.min()
    assert high >= edges.max()


def test_one_selected_tongue_is_drawn_alone():
    _, artists = draw(made.fig3(), "boundaries", select={"tongue": "2w3"})
    assert len(segments(artists["cases"][0]["perturbation"])) == 2
    assert names_in(artists) == [r"$2\omega_{3}$"]


def test_a_tongue_that_only_the_exact_boundaries_know_can_be_selected():
    coords = made.axes()
    exact = made.boundary_group(coords)
    tree = made.tree(perturbation=exact.isel(tongue=[0, 5]), boundaries=exact)
    figure, artists = draw(tree, "boundaries", select={"tongue": "2w2"})
    assert artists["cases"][0]["perturbation"] is not None
    assert segments(artists["cases"][0]["perturbation"]) == []
    assert names_in(artists) == [r"$2\omega_{2}$"]
    assert figure.get_suptitle().endswith(r"$2\omega_{2}$")
    with pytest.raises(PlotError, match="no value 'w9'"):
        draw(tree, "boundaries", select={"tongue": "w9"})


# --- slices and curves


def test_slices_share_axes_and_colours():
    tree = made.fig3(phasing=[0.0, 0.2, 0.4, 0.5], case=["a", "b"])
    figure, artists = draw(tree, select={"case": "b"})
    assert len(artists["panels"]) == 4
    for index, panel in enumerate(artists["panels"]):
        expected = np.maximum(growth_of(tree, phasing=index, case=1), 0)
        np.testing.assert_array_equal(panel["cells"].get_array().filled(0), expected)
        assert panel["caption"].get_text() == f"({'abcd'[index]})  $h$ = {[0, 0.2, 0.4, 0.5][index]:g}"
    assert len({panel["cells"].norm for panel in artists["panels"]}) == 1
    assert len({ax.get_xlim() for ax in figure.axes[:4]}) == 1


def test_two_axes_left_over_span_rows_and_columns():
    tree = made.fig3(phasing=[0.0, 0.2, 0.4], case=["a", "b"])
    figure, artists = draw(tree, "slices")
    spec = figure.axes[0].get_subplotspec().get_gridspec()
    assert (spec.nrows, spec.ncols) == (3, 2)
    assert artists["panels"][1]["caption"].get_text() == "(b)  $h$ = 0, b"


def test_curve_over_the_mesh_frequency_shades_what_perturbation_theory_calls_unstable():
    tree = made.fig3()
    _, artists = draw(tree, select={"epsilon": "0.3"})
    (line,) = artists["lines"]
    np.testing.assert_array_equal(line.get_xdata(), tree["floquet"]["mesh_frequency"].values)
    np.testing.assert_array_equal(line.get_ydata(), growth_of(tree)[12])
    left = sorted(path.get_extents().x0 for path in artists["bands"].get_paths())
    edges = tree["perturbation"]["boundary_frequency"].values[:, :, 12]
    np.testing.assert_allclose(left, np.sort(edges[edges[:, 1] > edges[:, 0], 0]))


def test_curves_of_several_cases():
    tree = made.fig3(case=["a", "b"])
    _, artists = draw(tree, "curve", select={"epsilon": "0.3"})
    assert [line.get_label() for line in artists["lines"]] == ["a", "b"]
    np.testing.assert_array_equal(artists["lines"][1].get_ydata(), growth_of(tree, case=1)[12])


# --- surface


class Recorded(Poly3DCollection):
    """One that keeps its corners, which Matplotlib gives back to nobody."""

    def set_verts(self, verts: Any, closed: bool = True) -> None:
        if len(verts):
            self.corners = np.asarray(verts)
        super().set_verts(verts, closed)


def test_surface_shows_both_boundaries_and_the_line_where_they_meet(monkeypatch):
    monkeypatch.setattr(surface, "Poly3DCollection", Recorded)
    tree = made.two_amplitudes()
    assert default_kind(tree, Request()) == "surface"
    _, artists = draw(tree)
    assert artists["name"].get_text() == r"$\omega_{2}+\omega_{3}$"
    (line,) = artists["vanishing"]._segments3d
    # 0.40 e1 = 0.45 e2; the squared width is a quadratic form, for which the search is exact but for rounding.
    np.testing.assert_allclose(0.40 * line[:, 0], 0.45 * line[:, 1], atol=1e-7)
    np.testing.assert_allclose(line[:, 2], 3.715, atol=1e-12)
    assert line[:, 0].min() == 0
    assert line[:, 0].max() == 0.5
    corners = artists["surfaces"].corners
    assert corners.shape == (2 * 20 * 15, 4, 3)  # two sheets of quadrilaterals
    x, y, z = corners.reshape(-1, 3).T
    np.testing.assert_allclose(np.abs(z - 3.715), np.abs(0.40 * x - 0.45 * y), atol=1e-12)


def test_surface_of_a_tongue_that_never_vanishes_has_no_line():
    _, artists = draw(made.two_amplitudes(), "surface", select={"tongue": "2w3"})
    assert artists["vanishing"] is None
    assert artists["name"].get_text() == r"$2\omega_{3}$"


def test_surface_labels_name_the_mesh_by_number():
    figure, _ = draw(made.two_amplitudes(), "surface")
    assert r"$\varepsilon_{1}$" in figure.axes[0].get_xlabel()
    assert r"$\varepsilon_{2}$" in figure.axes[0].get_ylabel()


# --- response


def test_response_shows_every_history():
    tree = made.response()
    figure, artists = draw(tree)
    assert len(artists["lines"]) == 5
    group = tree["response"]
    for index in range(3):
        np.testing.assert_array_equal(artists["lines"][index].get_ydata(), group["displacement"].values[:, index])
    np.testing.assert_array_equal(artists["lines"][4].get_ydata(), group["mesh_force"].values[:, 1])
    assert [ax.get_ylabel().replace("\n", " ") for ax in figure.axes] == [
        "$x_{1}$ (m)", "$x_{2}$ (m)", "$x_{3}$ (m)", "dynamic mesh force, first (N)", "dynamic mesh force, second (N)",
    ]  # fmt: skip
    _, one = draw(tree, select={"dof": "x2"}, variable="displacement")
    assert len(one["lines"]) == 1


def test_a_growing_history_shows_its_beginning_too():
    tree = made.response()
    time = tree["response"]["time"].values
    tree["response"]["displacement"].values[:, 1] = np.exp(time) * np.sin(5 * time)
    figure, artists = draw(tree)
    scales = [ax.get_yscale() for ax in figure.axes]
    assert scales == ["linear", "asinh", "linear", "linear", "linear"]
    ticks = figure.axes[1].get_yticks()
    np.testing.assert_array_equal(ticks, -ticks[::-1])
    assert ticks.max() == 1e8  # exp(20) = 4.9e8
    np.testing.assert_array_equal(artists["lines"][1].get_ydata(), np.exp(time) * np.sin(5 * time))


# --- what cannot be drawn


@pytest.fixture(scope="module")
def four_axes():
    return made.fig3(phasing=np.linspace(0, 0.5, 15), case=["first", "second"])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"kind": "pie"}, ["pie", "map", "in all"]),
        ({"x": "speed"}, ["speed", "mesh_frequency", "epsilon", "phasing"]),
        ({"y": "speed"}, ["speed", "mesh_frequency"]),
        ({"x": "epsilon", "y": "epsilon"}, ["both epsilon"]),
        ({"select": {"phase": "0"}}, ["phase", "phasing"]),
        ({"select": {"phasing": "lots"}}, ["lots", "15 values from 0 to 0.5"]),
        ({"select": {"phasing": "7"}}, ["7", "15 values from 0 to 0.5"]),
        ({"select": {"case": "third"}}, ["third", "first, second"]),
        ({"kind": "map"}, ["--select", "phasing: 15 values from 0 to 0.5", "case", "first, second"]),
        ({"kind": "slices"}, ["30 panels", "at most 12", "phasing: 15 values"]),
        ({"kind": "boundaries"}, ["30 overlaid cases", "at most 6"]),
        ({"kind": "boundaries", "x": "phasing", "y": "epsilon"}, ["mesh_frequency"]),
        ({"kind": "curve"}, ["at most 6", "epsilon: 21 values"]),
        ({"kind": "surface", "select": {"epsilon": "0.1"}}, ["two axes of numbers"]),
        ({"kind": "response"}, ["no time response", "floquet, perturbation"]),
        ({"variable": "colour"}, ["colour", "growth_rate", "stable"]),
        ({"size": "poster", "select": {"phasing": "0", "case": "first"}}, ["poster", "single, double"]),
        ({"x": "epsilon", "select": {"epsilon": "0.1"}}, ["epsilon", "at once"]),
    ],
)
def test_what_cannot_be_drawn_is_one_line_that_says_what_can(options, words, four_axes):
    with pytest.raises(PlotError) as caught:
        draw(four_axes, **options)
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "response"])
def test_a_response_holds_no_maps(kind):
    with pytest.raises(PlotError):
        draw(made.response(), kind)


def test_a_result_without_growth_rates_says_which_method_is_missing():
    tree = made.tree(perturbation=made.boundary_group(made.axes()))
    with pytest.raises(PlotError, match=r"methods\.floquet"):
        draw(tree, "map")


def test_a_tongue_closed_everywhere_has_no_surface():
    tree = made.two_amplitudes()
    tree["perturbation"]["boundary_frequency"].values[:] = np.nan
    with pytest.raises(PlotError, match="closed"):
        draw(tree, "surface")


def test_a_map_without_unstable_points_is_drawn_blank():
    coords = made.axes(epsilon=np.linspace(0, 1e-9, 5), frequency=np.linspace(6, 7, 12))
    tree = made.tree(floquet=made.floquet_group(coords))
    _, artists = draw(tree, "map")
    assert np.ma.getmaskarray(artists["cells"].get_array()).all()
    assert artists["note"].get_text() == "stable at every point"


def test_a_map_where_everything_failed_is_hatched_all_over():
    tree = made.fig3()
    tree["floquet"]["growth_rate"].values[:] = np.nan
    _, artists = draw(tree, "map")
    assert len(artists["failed"].get_paths()) == 21


def test_tongues_without_labels_are_drawn_without_names():
    coords = made.axes()
    unlabelled = made.boundary_group(coords).drop_vars("label")
    tree = made.tree(floquet=made.floquet_group(coords), boundaries=unlabelled)
    _, artists = draw(tree, "map")
    assert names_in(artists) == []
    assert len(segments(artists["boundaries"])) == 2 * 9  # wider than 0.2 % of the frame at epsilon = 0.5
