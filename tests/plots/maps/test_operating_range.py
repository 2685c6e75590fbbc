"""The operating ranges of a configuration's design, in figures of its sweep: where they end, in the unit shown."""

import numpy as np
import plot_results as made
import pytest
from plot_results import axes, floquet_group, probability, tree
from ruamel.yaml import YAML
from scenes import TRAIN

import gearstab
from gearstab.errors import PlotError
from gearstab.plots import default_kind, draw
from gearstab.plots.view import Request

DESIGN = "design: {{range: {}, variables: {{meshes.second.phasing: [0, 1]}}, minimise: instability_width}}\n"
TEETH = TRAIN.replace("tooth_ratio: 1", "teeth: [20, 60, 20, 60]")


def swept(system: str, ranges: str, sweep: str):
    text = f"{system}{DESIGN.format(ranges)}sweep: {{{sweep}}}\nmethods: {{perturbation: {{}}}}\n"
    return gearstab.sweep(gearstab.load(YAML(typ="safe").load(text)))


def of_axis(tree, name: str) -> list[float]:
    return [float(end) for end in np.ravel(tree[name].attrs["operating_range"])]


def test_the_axis_of_speeds_knows_the_ranges() -> None:
    ranges = "[{mesh_frequency: [2.0, 3.5]}, {mesh_frequency: [4.5, 6.5]}]"
    tree = swept(TRAIN, ranges, "mesh_frequency: [0.5, 7]")
    assert of_axis(tree, "mesh_frequency") == [2.0, 3.5, 4.5, 6.5]


@pytest.mark.parametrize(("name", "factor"), [("input_speed", 1.0), ("mesh_frequency", 20.0)])
def test_ranges_of_the_input_go_with_the_teeth(name: str, factor: float) -> None:
    tree = swept(TEETH, '{input_speed: ["600 rpm", "900 rpm"]}', f"{name}: [1, 2000]")
    expected = np.array([600, 900]) * 2 * np.pi / 60 * factor
    np.testing.assert_allclose(of_axis(tree, name), expected, rtol=1e-12)


def with_range(*ends: float):
    tree = made.fig3()
    for group in tree.children.values():
        if "mesh_frequency" in group.coords:
            group.coords["mesh_frequency"].attrs["operating_range"] = list(ends)
    return tree


def veils(ax) -> list[list[float]]:
    """Where the frame is veiled, along x."""
    white = [p for p in ax.patches if p.get_alpha() == 0.6]
    return [[float(p.get_x()), float(p.get_x() + p.get_width())] for p in white]


@pytest.mark.parametrize("kind", ["map", "boundaries", "curve"])
def test_what_lies_outside_is_veiled(kind: str) -> None:
    select = {"epsilon": "0.3"} if kind == "curve" else {}
    figure, _ = draw(with_range(2.0, 3.0, 2.5, 4.0, 6.0, 9.0), kind, select=select)
    low, high = figure.axes[0].get_xlim()
    assert veils(figure.axes[0]) == [[low, 2.0], [4.0, 6.0]]
    words = [text.get_text() for text in figure.axes[0].texts]
    assert words.count("operating range") == 3
    assert high == 7.0


def test_along_y_and_in_another_unit() -> None:
    figure, _ = draw(with_range(2.0, 4.0), "map", x="epsilon", y="mesh_frequency", unit=["mesh_frequency=Hz"])
    ax = figure.axes[0]
    white = [p for p in ax.patches if p.get_alpha() == 0.6]
    ends = sorted(round(float(end), 9) for p in white for end in (p.get_y(), p.get_y() + p.get_height()))
    expected = [ax.get_ylim()[0], 2 / (2 * np.pi), 4 / (2 * np.pi), ax.get_ylim()[1]]
    assert ends == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("ends", [(), (0.1, 9.0)])
def test_nothing_is_marked_without_a_range_or_within_one(ends: tuple[float, ...]) -> None:
    figure, _ = draw(with_range(*ends), "map")
    assert not veils(figure.axes[0])
    assert "operating range" not in [text.get_text() for text in figure.axes[0].texts]


# --- the map of a probability, with lines at given levels


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
