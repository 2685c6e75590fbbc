"""Names of tongues: mathematical text, and places where none covers another."""

from itertools import combinations, pairwise

import numpy as np
import plot_results as made
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gearstab as gs
from gearstab.plots import draw
from gearstab.plots.axes import FigureAxis
from gearstab.plots.drawing.names import FAR, isotonic, pack, place
from gearstab.plots.drawing.text import axis_label, fitted, symbol, tongue_label, unit_text


def overlaps(boxes):
    return [(a, b) for a, b in combinations(boxes, 2) if a.overlaps(b)]


def crossings(texts, leaders, renderer_boxes):
    """Pairs of a leader and another tongue's label that it runs through."""
    found = []
    for owner, leader in enumerate(leaders):
        points = leader.get_transform().transform(leader.get_xydata())
        dense = np.concatenate([np.linspace(a, b, 50) for a, b in pairwise(points)])
        for other, box in enumerate(renderer_boxes):
            inside = (dense[:, 0] > box.x0) & (dense[:, 0] < box.x1) & (dense[:, 1] > box.y0) & (dense[:, 1] < box.y1)
            if other != owner and inside.any():
                found.append((texts[owner].get_text(), texts[other].get_text()))
    return found


@pytest.mark.parametrize("size", ["single", "double"])
@pytest.mark.parametrize("swapped", [False, True])
def test_names_of_figure_3_cover_neither_each_other_nor_the_frame(size, swapped):
    options = {"x": "epsilon", "y": "mesh_frequency"} if swapped else {}
    figure, artists = draw(made.fig3(), "map", size=size, **options)
    names = artists["names"]
    boxes = [text.get_window_extent() for text in names.texts]
    frame = figure.axes[0].get_window_extent()
    assert len(boxes) == 8
    assert not overlaps(boxes)
    assert not overlaps([frame, *boxes])
    assert not crossings(names.texts, names.leaders, boxes)
    others = [artists["colour_bar"].ax.get_window_extent(), figure._suptitle.get_window_extent()]
    assert not [box for box in boxes for other in others if box.overlaps(other)]
    page = figure.bbox
    assert all(page.x0 <= b.x0 and b.x1 <= page.x1 and page.y0 <= b.y0 and b.y1 <= page.y1 for b in boxes)


def test_each_leader_begins_at_its_tongue_and_ends_under_its_name():
    figure, artists = draw(made.fig3(), "map")
    ax = figure.axes[0]
    labels, centre, _ = made.published()
    where = {tongue_label(label): c for label, c in zip(labels, centre, strict=True)}
    for text, leader in zip(artists["names"].texts, artists["names"].leaders, strict=True):
        points = leader.get_transform().transform(leader.get_xydata())
        data = ax.transData.inverted().transform(points)
        # First-order tongues of constant mean stiffness are upright, but 2w1's left edge leaves the frame... none does.
        assert data[0, 0] == pytest.approx(where[text.get_text()], abs=1e-9)
        box = text.get_window_extent()
        assert points[-1, 0] == pytest.approx((box.x0 + box.x1) / 2, abs=1.0)
        assert points[-1, 1] <= box.y0


def test_names_keep_to_each_panel_of_slices():
    figure, artists = draw(made.fig3(phasing=[0.0, 0.3, 0.5]), "slices")
    boxes = [text.get_window_extent() for panel in artists["panels"] for text in panel["names"].texts]
    captions = [panel["caption"].get_window_extent() for panel in artists["panels"]]
    frames = [ax.get_window_extent() for ax in figure.axes[:3]]
    assert len(boxes) >= 3
    assert not overlaps([*boxes, *captions, *frames])


def test_a_tongue_that_closes_before_the_end_is_pointed_at_from_within():
    coords = made.axes()
    group = made.boundary_group(coords)
    group["boundary_frequency"][5, :, 15:] = np.nan  # 2w3 ends at epsilon = 0.35
    figure, artists = draw(made.tree(floquet=made.floquet_group(coords), perturbation=group), "map")
    texts = [text.get_text() for text in artists["names"].texts]
    (leader,) = artists["names"].inner
    ends = figure.axes[0].transData.inverted().transform(leader.get_transform().transform(leader.get_xydata()))
    np.testing.assert_allclose(ends[:, 0], 5.423447526)
    np.testing.assert_allclose(ends[:, 1], [0.35, 0.5])
    assert r"$2\omega_{3}$" in texts


def test_a_curve_names_regions_that_are_narrower_than_their_lines():
    mesh = {"name": "mesh", "mean_stiffness": 1.0, "epsilon": 0.005, "contact_ratio": 1.25}
    system = {"kind": "gear_pair", "equivalent_mass": 1.0, "meshes": [mesh]}
    speeds = {"mesh_frequency": {"start": 0.9, "stop": 2.2, "num": 27}}
    result = gs.sweep({"system": system, "sweep": speeds, "methods": {"floquet": {}, "boundaries": {}}})
    edges = result["boundaries"]["boundary_frequency"].values
    # Thousandths of the frame: a map gives them no name.
    assert np.all(np.diff(edges, axis=1) < 0.004 * 1.3)
    _, artists = draw(result, "curve")
    named = {text.get_text() for text in artists["names"].texts}
    assert named == {tongue_label(label) for label in ("w1", "2w1")}


@pytest.mark.parametrize(("until", "told"), [(7.0, False), (3.0, True)])
def test_the_legend_of_a_map_tells_white_cells_from_tinted_ones(until, told):
    coords = made.axes()
    group = made.boundary_group(coords)
    ends = np.broadcast_to(np.array([0.35, until])[None, :, None], (1, 2, coords["epsilon"][1].size))
    group["proved_frequency"] = (("stretch", "side", "epsilon"), ends, {"units": "rad/s"})
    figure, _ = draw(made.tree(floquet=made.floquet_group(coords), boundaries=group), "map")
    entries = [text.get_text() for text in figure.legends[0].get_texts()]
    assert ("stable, not proved" in entries) is told
    assert "proved stable" in entries


numbers = st.lists(st.floats(0, 100), min_size=1, max_size=25)


@given(numbers)
def test_isotonic_is_the_least_squares_non_decreasing_sequence(values):
    fit = isotonic(np.array(values))
    assert np.all(np.diff(fit) >= 0)
    # Optimality (Karush-Kuhn-Tucker): partial sums of the residual vanish where the fit rises, and are never negative.
    residual = np.cumsum(np.array(values) - fit)
    assert np.all(residual >= -1e-9 * (1 + np.abs(values).max()) * len(values))
    rising = np.append(np.diff(fit) > 0, True)
    np.testing.assert_allclose(residual[rising], 0, atol=1e-9 * 100 * len(values))


@given(numbers, st.floats(0.1, 4))
def test_packed_labels_touch_at_most_and_stay_inside(anchors, width):
    anchors = np.sort(anchors)
    widths = np.full(anchors.size, width)
    middles = pack(anchors, widths, 0.0, 100.0)
    # Rounding of sums of 25 numbers below 100.
    assert np.all(np.diff(middles) >= width - 1e-10)
    assert middles[0] >= width / 2 - 1e-10
    assert middles[-1] <= 100 - width / 2 + 1e-10


@given(numbers, st.lists(st.floats(2, 20), min_size=25, max_size=25), st.integers(1, 3))
def test_placed_labels_never_overlap_and_stay_near(anchors, widths, rows):
    anchors, widths = np.array(anchors), np.array(widths[: len(anchors)])
    weights = np.linspace(1, 2, anchors.size)
    placed = place(anchors, widths, 0.0, 100.0, weights, rows, leader=0.5)
    assert placed  # the heaviest always fits
    assert anchors.size - 1 in {item.index for item in placed}
    for item in placed:
        assert item.row < rows
        assert len(item.path) == item.row + 1
        assert abs(item.position - anchors[item.index]) <= FAR * widths[item.index] + 1e-9
    for a, b in combinations(placed, 2):
        for row in range(min(a.row, b.row) + 1):
            room = [widths[k.index] if k.row == row else 0.5 for k in (a, b)]
            assert abs(a.path[row] - b.path[row]) >= sum(room) / 2 - 1e-9


@pytest.mark.parametrize(
    ("label", "text"),
    [
        ("2w3", r"$2\omega_{3}$"),
        ("w2", r"$\omega_{2}$"),
        ("w2+w13", r"$\omega_{2}+\omega_{13}$"),
        ("(w2+w3)/2", r"$(\omega_{2}+\omega_{3})/2$"),
        ("2w3/3", r"$2\omega_{3}/3$"),
        ("2w3 (second)", r"$\Omega_{2}=2\omega_{3}$"),
        ("2w3 (second+third)", r"$\Omega_{2}=2\omega_{3}$"),
        ("2w3 (other_one)", r"$2\omega_{3}$ (other_one)"),
        ("costs $5", r"costs \$5"),
        ("", ""),
    ],
)
def test_tongue_labels(label, text):
    assert tongue_label(label, {"first": 1, "second": 2, "third": 3}) == text


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("mesh_frequency", r"\Omega"),
        ("meshes.second.epsilon", r"\varepsilon_{2}"),
        ("meshes.0.mean_stiffness", r"k_{g,1}"),
        ("meshes.sun.phase", r"\gamma_{\mathrm{sun}}"),
        ("phases.sun_ring", r"\gamma_{sr}"),
        ("inertias.1", "m_{2}"),
        ("system.damping_ratio", r"\zeta"),
        ("case", None),
    ],
)
def test_symbols(name, text):
    assert symbol(name, {"first": 1, "second": 2}) == text


@pytest.mark.parametrize(
    ("units", "text"),
    [("1", ""), ("", ""), ("1/s", r"$\mathrm{s}^{-1}$"), ("rad/s", "rad/s"), ("kg*m**2", "kg m$^{2}$"), ("N/m", "N/m"),
     ("kg^-1/2", "kg$^{-1/2}$")],
)  # fmt: skip
def test_units(units, text):
    assert unit_text(units) == text
    assert axis_label("case", "inertia", units).startswith("inertia")


def test_captions_print_four_digits_unless_values_would_read_alike():
    speeds = FigureAxis("input_speed", np.array([9974.358974, 15000.0]), "rpm")
    assert [speeds.caption(index) for index in (0, 1)] == ["input speed = 9974 rpm", "input speed = 15000 rpm"]
    near = FigureAxis("epsilon", np.array([0.100012, 0.100034]))
    assert near.caption(1) == r"$\varepsilon$ = 0.100034"


def test_labels_with_commas_are_quoted_in_messages():
    axis = FigureAxis("case", np.array(["worst", "c = 1.5, h = 0"], dtype=object))
    assert axis.extent() == "its values: worst, 'c = 1.5, h = 0'"


def test_long_labels_are_broken_between_words_and_outside_formulas():
    text = r"amplitude of the mesh stiffness variation $k_{a} + k_{b}$ (N/m)"
    broken = fitted(text, 1.4, 8.5)
    assert broken.replace("\n", " ") == text
    assert 2 <= broken.count("\n") + 1 <= 3
    assert "$k_{a} + k_{b}$" in broken
    assert fitted("short", 1.0, 8.5) == "short"
