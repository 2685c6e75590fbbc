"""Without options every result gives a figure; what a figure leaves out is said."""

from pathlib import Path

import numpy as np
import plot_results as made
import pytest
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from ruamel.yaml import YAML
from scenes import TRAIN, succeeds

import gearstab
from gearstab.errors import PlotError
from gearstab.plots import default_kind, draw
from gearstab.plots.drawing.style import style
from gearstab.plots.drawing.tongues import THIN, joints, pieces
from gearstab.plots.motions.response import draw_long_line
from gearstab.plots.view import Request, thinned

ENTRIES = {
    "mesh_frequency": [1.0, 2.0, 4.0],
    "input_speed": [10.0, 20.0, 40.0],
    "epsilon": [0.1, 0.2],
    "contact_ratio": np.linspace(1.2, 1.8, 8),
    "case": [f"case {k}" for k in range(7)],
}
AXES = [
    ["mesh_frequency"],
    ["input_speed"],
    ["epsilon"],
    ["case"],
    ["mesh_frequency", "case"],
    ["mesh_frequency", "epsilon"],
    ["input_speed", "contact_ratio"],
    ["epsilon", "contact_ratio"],
    ["mesh_frequency", "epsilon", "case"],
]


def swept(axes: list[str], groups: tuple[str, ...], meshes: int) -> xr.DataTree:
    """A result of the groups over the axes, with exponents and more meshes than there are colours."""
    coords = {}
    for name in axes:
        coords |= made.coordinate(name, ENTRIES[name])
    if "input_speed" in axes:
        coords["input_speed"][2]["mesh_frequency_factor"] = 20.0
    shape = [len(ENTRIES[name]) for name in axes]
    rows = [name for name in axes if name not in ("mesh_frequency", "input_speed")]
    values = 1.0 + np.arange(np.prod(shape)).reshape(shape) % 5
    over = {"mesh": [f"m{k}" for k in range(meshes)]}
    whole: dict[str, dict] = {
        "floquet": {"growth_rate": (axes, values - 3), "status": (axes, np.zeros(shape, "i2")),
                    "exponent_real": ([*axes, "exponent"], values[..., None] - [3.0, 4.0])},
        "boundaries": {"boundary_frequency": (
            ["tongue", "side", *rows],
            0.0 + np.broadcast_to(np.array([[1.5, 2.5], [3.0, 3.1]]).reshape(2, 2, *[1] * len(rows)),
                            (2, 2, *(len(ENTRIES[name]) for name in rows))), {"units": "rad/s"})},
        "required_damping": {"required_damping": (axes, values - 2)},
        "response": {"mesh_force_peak": ([*axes, "mesh"], values[..., None] * np.arange(1, meshes + 1)),
                     "transmission_error_peak_to_peak": ([*axes, "mesh"], values[..., None] * np.ones(meshes)),
                     "dynamic_load_factor": ([*axes, "mesh"], values[..., None] * np.arange(1, meshes + 1)),
                     "status": (axes, np.zeros(shape, "i2"))},
    }  # fmt: skip
    beside = {"boundaries": {"label": ("tongue", ["2w1", "w2"])}, "response": over}
    held = {}
    for name in groups:
        kept = {axis: coords[axis] for axis in (rows if name == "boundaries" else axes)}
        held[name] = xr.Dataset(whole[name], coords=kept | beside.get(name, {}))
    modes = xr.Dataset(
        {"mode_shape": (("mode", "dof"), np.eye(2)), "natural_frequency": ("mode", [1.0, 2.0]),
         "mesh_deflection": (("mode", "mesh"), np.ones((2, meshes)))},
        coords={"dof": ["a", "b"]} | over,
    )  # fmt: skip
    return made.tree(modes=modes, **held)


@pytest.mark.parametrize(
    ("axes", "groups"),
    [
        (axes, groups)
        for axes in AXES
        for groups in (("floquet",), ("boundaries",), ("required_damping",), ("response",), ("floquet", "boundaries"))
        if len(axes) < 2 or len(groups) > 1 or groups == ("response",)
    ],
    ids="-".join,
)
def test_every_result_of_a_sweep_has_a_figure(axes: list[str], groups: tuple[str, ...]) -> None:
    """The kind fits, and nothing is too much for it; of panels the first is enough."""
    tree = swept(axes, groups, 8)
    kind = default_kind(tree, Request())
    if kind != "slices":
        assert draw(tree, dpi=50)[0].axes
    else:
        fixed = {name: str(ENTRIES[name][0]) for name in axes[1:-1]}
        assert draw(tree, kind, select=fixed | ({} if groups != ("response",) else {"mesh": "m1"}), dpi=50)[0].axes


def test_an_axis_of_one_value_alone_leaves_the_modes() -> None:
    tree = swept(["mesh_frequency"], ("floquet",), 1).isel(mesh_frequency=[1])
    assert default_kind(tree, Request()) == "modes"


def test_the_curves_with_the_largest_values_stand_for_many() -> None:
    tree = swept(["mesh_frequency"], ("response",), 8)
    _, artists = draw(tree, dpi=50)
    assert [line.get_label() for line in artists["lines"]] == [f"mesh = m{k}" for k in range(2, 8)]
    assert artists["left_out"] == ("shows the 6 of 8 curves with the largest values; choose with --select mesh=VALUE")
    with pytest.raises(PlotError, match=r"8 curves are too many \(at most 6\)"):
        draw(tree, "speeds")


@pytest.mark.parametrize(
    ("sizes", "most", "expected"),
    [
        ([5], 12, [[0, 1, 2, 3, 4]]),
        ([101], 3, [[0, 50, 100]]),
        ([9, 2], 6, [[0, 4, 8], [0, 1]]),
        ([4, 4], 12, [[0, 2, 3], [0, 1, 2, 3]]),
    ],
)
def test_numbers_are_thinned_out_evenly(sizes: list[int], most: int, expected: list[list[int]]) -> None:
    assert thinned(sizes, most) == expected


def histories(dofs: int, meshes: int) -> xr.DataTree:
    time = np.linspace(0, 1, 50)
    data = {
        "displacement": (("time", "dof"), np.outer(time, np.arange(1, dofs + 1)), {"units": "m"}),
        "mesh_force": (("time", "mesh"), np.outer(time, np.arange(1, meshes + 1)), {"units": "N"}),
        "energy": ("time", 1 + time, {"units": "J", "long_name": "kinetic and potential energy"}),
    }
    coords = {"time": time, "dof": [f"q{k}" for k in range(dofs)], "mesh": [f"m{k}" for k in range(meshes)]}
    return made.tree(response=xr.Dataset(data, coords=coords))


@pytest.fixture
def unfitted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Panels whose labels nobody breaks, which takes longer than all else where there are a dozen."""
    monkeypatch.setattr("gearstab.plots.motions.response.fit_labels", lambda axes: None)


@pytest.mark.usefixtures("unfitted")
def test_many_coordinates_give_way_to_mesh_forces_and_energy() -> None:
    figure, artists = draw(histories(25, 8), dpi=50)
    labels = [ax.get_ylabel().replace("\n", " ") for ax in figure.axes]
    assert labels == [*(f"mesh force, m{k} (N)" for k in range(8)), "energy (J)"]
    assert "not the 25 displacements" in artists["left_out"]
    with pytest.raises(PlotError, match="33 histories are too many"):
        draw(histories(25, 8), "response")


@pytest.mark.usefixtures("unfitted")
def test_the_largest_of_too_many_histories_are_drawn() -> None:
    _, artists = draw(histories(2, 20), dpi=50)
    ends = [line.get_ydata()[-1] for line in artists["lines"]]
    np.testing.assert_allclose(ends, np.arange(9, 21))
    _, artists = draw(histories(25, 1), variable="displacement", dpi=50)
    assert len(artists["lines"]) == 12
    assert "12 largest of 25" in artists["left_out"]
    assert draw(histories(2, 2), dpi=50)[1]["left_out"] == ""


def test_the_command_says_what_a_figure_leaves_out(tmp_path: Path) -> None:
    histories(25, 8).to_netcdf(tmp_path / "r.h5", engine="h5netcdf")
    done = succeeds("plot", tmp_path / "r.h5", "--dpi", "50")
    assert "note: shows the mesh forces and the energy" in done.output


# --- over the speed of the input


def test_boundaries_lie_at_the_speed_of_the_input_that_gives_their_mesh_frequency() -> None:
    tree = swept(["input_speed"], ("response", "boundaries"), 1)
    # 20 teeth: 15 to 25 and 35 to 36.
    tree["boundaries"]["boundary_frequency"].values[:] = [[300.0, 500.0], [700.0, 720.0]]
    figure, artists = draw(tree, "speeds", dpi=50)
    spans = [(path.vertices[:, 0].min(), path.vertices[:, 0].max()) for path in artists["bands"].get_paths()]
    np.testing.assert_allclose(spans, [(15, 25), (35, 36)])
    assert figure.axes[0].get_xlim() == (10, 40)


def test_a_map_over_the_speed_of_the_input_has_boundaries() -> None:
    tree = swept(["input_speed", "contact_ratio"], ("floquet", "boundaries"), 1)
    tree["boundaries"]["boundary_frequency"].values[:] = np.array([[300.0, 500.0], [700.0, 760.0]])[..., None]
    figure, artists = draw(tree, dpi=50)
    edges = {round(float(x), 9) for path in artists["boundaries"].get_paths() for x in path.vertices[:, 0]}
    assert edges == {15.0, 25.0, 35.0, 38.0}
    assert figure.axes[0].get_xlabel() == "input speed"


def test_without_the_factor_boundaries_are_not_drawn_at_the_wrong_place() -> None:
    tree = swept(["input_speed"], ("response", "boundaries"), 1)
    del tree["response"]["input_speed"].attrs["mesh_frequency_factor"]
    _, artists = draw(tree, "speeds", dpi=50)
    assert artists["bands"] is None


# --- limits and contours


def test_a_map_ends_at_the_first_and_the_last_number() -> None:
    figure, _ = draw(swept(["mesh_frequency", "epsilon"], ("floquet",), 1), dpi=50)
    assert (figure.axes[0].get_xlim(), figure.axes[0].get_ylim()) == ((1, 4), (0.1, 0.2))


def test_no_contour_crosses_an_axis_of_labels() -> None:
    tree = swept(["mesh_frequency", "case"], ("floquet", "required_damping"), 1)
    assert draw(tree, "map", dpi=50)[1]["neutral"] is None
    assert draw(tree, "required-damping", dpi=50)[1]["contours"] is None
    tree = swept(["mesh_frequency", "epsilon"], ("floquet", "required_damping"), 1)
    assert draw(tree, "map", dpi=50)[1]["neutral"] is not None
    assert draw(tree, "required-damping", dpi=50)[1]["contours"] is not None


# --- labels of panels


def test_labels_of_panels_keep_to_their_panels() -> None:
    tree = histories(4, 1)
    names = ["in", "the pinion on the countershaft", "w", "averylongnameofonecoordinatewithoutblank"]
    renamed = tree["response"].to_dataset().assign_coords(dof=names)
    figure, _ = draw(made.tree(response=renamed), size="single")
    figure.draw_without_rendering()
    for ax in figure.axes:
        # A pixel of 300 to the inch: glyphs are placed on whole ones.
        assert ax.yaxis.label.get_window_extent().height <= ax.get_window_extent().height + 1


def test_an_edge_that_leaves_the_range_is_drawn_up_to_its_end() -> None:
    """It moves by 1.3 % of the frame from row to row, and stays at the end of the range for most of them."""
    edge = np.concatenate([np.linspace(8.72, 9.0, 9), np.full(20, 9.0)])
    (whole,) = pieces(edge, np.linspace(0.0, 0.4, 29), 2.5)
    np.testing.assert_array_equal(whole[:, 0], edge)


def test_an_edge_goes_on_where_regions_merge() -> None:
    """The upper edge of the second region ends in row 5 and is that of the first from row 6 on; span of the frame 4."""
    row, away = np.arange(11), np.full(11, np.nan)
    inner, outer = 2.0 + 0.02 * row, 3.0 + 0.01 * row
    first = pieces(np.where(row < 6, inner, outer), row / 10, 4.0)
    assert [len(part) for part in first] == [6, 5]
    (joint,) = joints([*first, *pieces(np.where(row < 6, outer, away), row / 10, 4.0)], 4.0)
    np.testing.assert_allclose(joint, [[3.05, 0.5], [3.06, 0.6]], rtol=1e-12)
    # Neither over the leap of the first edge, nor over more than a row.
    assert joints(first, 4.0) == []
    assert joints([*first, *pieces(np.where(row < 5, outer, away), row / 10, 4.0)], 4.0) == []


def test_a_region_that_is_one_light_line_has_an_entry() -> None:
    """Beside the lines of first order; 2w1/3 is nowhere wider than 0.0015 up to epsilon = 0.1, a frame of 6.65."""
    sweep = "sweep: {mesh_frequency: [0.35, 7.0], epsilon: [0.02, 0.06, 0.1]}\n"
    for methods, expected in (("boundaries: {}, perturbation: {}", True), ("perturbation: {}", False)):
        config = YAML(typ="safe").load(f"{TRAIN}{sweep}methods: {{{methods}}}\n")
        _, artists = draw(gearstab.sweep(gearstab.load(config)), dpi=50)
        words = [text.get_text() for text in artists["legend"].get_texts()]
        assert (THIN in words) == expected


# --- lines of many samples on paper: no gap where Matplotlib would split them


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
