"""The Campbell diagram: natural frequencies by another solver, crossings where they must be, branches by shapes."""

import numpy as np
import pytest
from plot_results import tree as result
from ruamel.yaml import YAML
from scenes import REDUCER, TRAIN
from scipy.linalg import eigh, qr

import gearstab
from gearstab.errors import PlotError
from gearstab.plots import default_kind, draw
from gearstab.plots.drawing.names import settle
from gearstab.plots.drawing.style import new_frame
from gearstab.plots.maps.branches import draw_order, followed, number_orders
from gearstab.plots.maps.campbell import said
from gearstab.plots.view import Request

SHAFT = np.linspace(0.2, 9.0, 12)


def swept(sweep: str, methods: str, system: str = TRAIN):
    text = f"{system}sweep: {{{sweep}}}\nmethods: {{{methods}}}\n"
    return gearstab.sweep(gearstab.load(YAML(typ="safe").load(text)))


def frequencies(shaft: float) -> np.ndarray:
    """Natural frequencies of the train: masses 1, 0.3, 4; the meshes deflect as x1 + x2 and x2 + x3."""
    stiffness = np.array([[shaft + 1, 1, 0], [1, 2, 1], [0, 1, 1]])
    return np.sqrt(eigh(stiffness, np.diag([1.0, 0.3, 4.0]), eigvals_only=True))


@pytest.fixture(scope="module")
def train():
    axes = "mesh_frequency: {start: 0.35, stop: 7, num: 5}, epsilon: [0.0, 0.1, 0.3]"
    shaft = f"input_shaft_stiffness: {[float(k) for k in SHAFT]}"
    return swept(f"{axes}, {shaft}", "natural_frequencies: {}, perturbation: {harmonics: 3}")


def test_natural_frequencies_over_an_axis(train) -> None:
    found = train["natural_frequencies"].to_dataset()
    assert found["natural_frequency"].dims == ("epsilon", "input_shaft_stiffness", "mode")
    expected = [frequencies(shaft) for shaft in SHAFT]
    np.testing.assert_allclose(found["natural_frequency"], np.broadcast_to(expected, (3, 12, 3)), rtol=1e-12)
    shapes, mass = found["mode_shape"].values, np.diag([1.0, 0.3, 4.0])
    unit = np.einsum("...pi,ij,...qj->...pq", shapes, mass, shapes)
    np.testing.assert_allclose(unit, np.broadcast_to(np.eye(3), unit.shape), atol=1e-12)


def test_branches_are_straight_where_modes_keep_their_shapes() -> None:
    """K = M Phi diag(lambda) Phi^T M with the same Phi throughout: squared frequencies cross as straight lines."""
    rng = np.random.default_rng(1)
    root = np.linalg.cholesky(np.cov(rng.normal(size=(5, 40))) + np.eye(5))
    shapes = np.linalg.solve(root.T, qr(rng.normal(size=(5, 5)))[0])
    assert np.allclose(shapes.T @ (root @ root.T) @ shapes, np.eye(5))
    x = np.linspace(0, 1, 9)
    values = rng.uniform(1, 2, 5) + np.outer(x, rng.uniform(-1, 1, 5) * 3)
    order = np.argsort(values, axis=1)
    assert len(np.unique(order, axis=0)) >= 4
    signs = rng.choice([-1.0, 1.0], size=(9, 5))
    ascending = np.take_along_axis(values, order, axis=1)
    rows = np.array([shapes.T[order[k]] * signs[k][:, None] for k in range(9)])
    branches = np.take_along_axis(ascending, followed(rows), axis=1)
    np.testing.assert_allclose(np.diff(branches, 2, axis=0), 0.0, atol=1e-12)


def test_regions_lie_where_an_order_meets_their_modes(train) -> None:
    _, artists = draw(train, "campbell", select={"epsilon": "0.3", "input_shaft_stiffness": f"{SHAFT[0]}"})
    (panel,) = artists["panels"]
    w = frequencies(SHAFT[0])
    assert [line.get_ydata()[0] for line in panel["modes"]] == pytest.approx(list(w))
    # Orders of one mesh frequency: half, one and one and a half times it.
    slopes = [np.ptp(line.get_ydata()) / np.ptp(line.get_xdata()) for line in panel["orders"]]
    assert slopes == pytest.approx([0.5, 1.0, 1.5])
    # A contact ratio of 1.5 has no second harmonic, and the third is a third of the first: open are 1 and 3.
    roots = {(p, q, s): (w[p] + w[q]) / s for p in range(3) for q in range(p, 3) for s in (1, 2, 3)}
    inside = {key: root for key, root in roots.items() if root > 0.36}
    single = sorted(root for (p, q, s), root in inside.items() if p == q and s != 2)
    marked = np.asarray(panel["regions"]["one"].get_offsets())
    # Of regions rooted outside of the frame the part inside is marked, where it begins.
    marked = marked[marked[:, 0] > 0.36]
    np.testing.assert_allclose(sorted(marked[:, 0]), single, rtol=1e-9)
    for x, y in marked:
        assert np.abs(y - w).min() < 1e-9
        assert min(abs(s * x / 2 - y) for s in (1, 3)) < 1e-9
    closed = np.asarray(panel["closed"]["one"].get_offsets())
    np.testing.assert_allclose(sorted(closed[:, 0]), sorted(r for (p, q, s), r in inside.items() if p == q and s == 2))
    # A region of two modes is marked where a drawn order passes the mean of their frequencies.
    pairs = np.asarray(panel["regions"]["two"].get_offsets())
    means = sorted((root, (w[p] + w[q]) / 2) for (p, q, s), root in inside.items() if p != q and s != 2)
    np.testing.assert_allclose(sorted(map(tuple, pairs[pairs[:, 0] > 0.36])), means, rtol=1e-9)


def test_higher_orders_than_those_drawn_are_not_marked() -> None:
    """Seven harmonics, of which six are drawn: every mark lies on one of the lines."""
    tree = swept("mesh_frequency: {start: 0.35, stop: 7, num: 5}", "perturbation: {harmonics: 7}", TRAIN)
    (panel,) = draw(tree, "campbell")[1]["panels"]
    slopes = np.array([np.ptp(line.get_ydata()) / np.ptp(line.get_xdata()) for line in panel["orders"]])
    assert len(slopes) == 6
    for kind in ("one", "two"):
        x, y = np.asarray(panel["regions"][kind].get_offsets()).T
        assert np.abs(y[:, None] / x[:, None] / slopes - 1).min(axis=1).max() < 1e-9


def test_every_order_has_its_number_and_every_mark_its_entry(train) -> None:
    figure, artists = draw(train, "campbell", select={"epsilon": "0.3", "input_shaft_stiffness": "0.2"})
    (panel,) = artists["panels"]
    numbers = [text.get_text() for text in figure.axes[0].texts if "times" in text.get_text()]
    assert len(numbers) == len(panel["orders"])
    entries = [text.get_text() for text in artists["legend"].get_texts()]
    sorts = {"instability of one mode", "instability of two modes", "one mode, closed", "two modes, closed"}
    assert sorts <= set(entries)


def test_numbers_of_orders_are_clear_of_lines_and_marks(train) -> None:
    """Each lies on its own line, inside the frame, over no other number and no mark, and on no natural frequency."""
    for select in ({"epsilon": "0.3", "input_shaft_stiffness": "0.2"}, {"epsilon": "0", "input_shaft_stiffness": "9"}):
        figure, artists = draw(train, "campbell", select=select)
        (ax,), (panel,) = figure.axes, artists["panels"]
        numbers = [text for text in ax.texts if "times" in text.get_text()]
        boxes, frame = [text.get_window_extent() for text in numbers], ax.get_window_extent()
        assert len(boxes) == 3
        for k, box in enumerate(boxes):
            assert frame.x0 <= box.x0 < box.x1 <= frame.x1
            assert frame.y0 <= box.y0 < box.y1 <= frame.y1
            assert not any(box.overlaps(other) for other in boxes[:k])
        marks = [mark for sort in ("regions", "closed") for mark in panel[sort].values()]
        places = np.concatenate([ax.transData.transform(np.asarray(mark.get_offsets())) for mark in marks])
        assert not any(box.contains(*place) for box in boxes for place in places)
        levels = [ax.transData.transform((0.0, line.get_ydata()[0]))[1] for line in panel["modes"]]
        assert not any(box.y0 < level < box.y1 for box in boxes for level in levels)
        for text, line in zip(numbers, panel["orders"], strict=True):
            slope = np.ptp(line.get_ydata()) / np.ptp(line.get_xdata())
            assert text.get_position()[1] == pytest.approx(slope * text.get_position()[0])


def test_bands_are_the_regions_and_names_those_of_the_widest(train) -> None:
    _, artists = draw(train, "campbell", select={"epsilon": "0.3", "input_shaft_stiffness": f"{SHAFT[0]}"})
    (panel,) = artists["panels"]
    at = train["perturbation"].to_dataset().sel(epsilon=0.3, input_shaft_stiffness=SHAFT[0])
    edges = at["boundary_frequency"].transpose("tongue", "side").values
    wide = edges[np.argmax(edges[:, 1] - edges[:, 0])]
    spans = [path.vertices[:, 0] for path in panel["bands"].get_paths()]
    assert any(np.allclose([x.min(), x.max()], wide) for x in spans)
    named = [text.get_text() for text in panel["names"].texts]
    assert "$2\\omega_{3}$" in named
    assert [text.get_text() for text in panel["mode_names"].texts] == [rf"$\omega_{{{k}}}$" for k in (1, 2, 3)]


def test_without_variation_everything_is_closed(train) -> None:
    _, artists = draw(train, "campbell", select={"epsilon": "0", "input_shaft_stiffness": "0.2"})
    (panel,) = artists["panels"]
    assert not panel["regions"]
    assert panel["bands"] is None
    assert set(panel["closed"]) == {"one", "two"}


def test_a_panel_for_each_value_of_what_is_left(train) -> None:
    figure, artists = draw(train, "campbell", select={"input_shaft_stiffness": "0.2"})
    assert len(artists["panels"]) == 3
    assert [ax.get_title(loc="left")[:3] for ax in figure.axes] == ["(a)", "(b)", "(c)"]
    bars = [len(panel["regions"].get("one").get_offsets()) if panel["regions"] else 0 for panel in artists["panels"]]
    assert bars[0] == 0 < bars[1] <= bars[2]
    with pytest.raises(PlotError, match="36 panels are too many"):
        draw(train, "campbell")


def test_over_another_axis_at_one_speed(train) -> None:
    """The order through 2 w2 = Omega: that shaft stiffness, by bisection."""
    select = {"epsilon": "0.3", "mesh_frequency": "3.675"}
    _, artists = draw(train, "campbell", x="input_shaft_stiffness", select=select)
    (panel,) = artists["panels"]
    low, high = 0.2, 9.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if 2 * frequencies(middle)[1] < 3.675 else (low, middle)
    x, y = np.asarray(panel["regions"]["one"].get_offsets()).T
    # Between the values of the axis the natural frequency is taken as straight.
    assert np.abs(x - low).min() < 0.05
    assert np.abs(y - 3.675 / 2).min() < 0.01
    grid = [line.get_ydata() for line in panel["modes"]]
    np.testing.assert_allclose(np.sort(grid, axis=0).T, [frequencies(shaft) for shaft in SHAFT], rtol=1e-12)


def test_input_speeds_in_rpm_and_frequencies_in_hertz() -> None:
    tree = swept('input_speed: ["300 rpm", "6000 rpm"]', "perturbation: {}", REDUCER)
    _, artists = draw(tree, "campbell")
    (panel,) = artists["panels"]
    (half, *_) = panel["orders"]
    x, y = half.get_xdata(), half.get_ydata()
    assert x[0] == pytest.approx(300)
    # Twenty teeth: at 300 rpm they mesh a hundred times a second, which half an order is half of.
    assert y[0] == pytest.approx(50)
    elastic = tree["modes"]["natural_frequency"].values[1:] / (2 * np.pi)
    drawn = [line.get_ydata()[0] for line in panel["modes"]]
    assert drawn == pytest.approx(list(elastic))
    edges = tree["perturbation"]["boundary_frequency"].values / (2 * np.pi) / 20 * 60
    spans = np.array([path.vertices[:, 0].min() for path in panel["bands"].get_paths()])
    assert set(np.round(spans, 6)) <= set(np.round(np.clip(edges, 300, 6000)[:, 0], 6))


def test_meshes_of_a_planetary_set_are_named_by_it() -> None:
    assert said(["planets.sun.1", "planets.sun.2", "planets.ring.1"]) == "planets"
    assert said(["sun1", "ring1", "second.part"]) == "sun1, ring1, second.part"


def test_frequencies_from_two_thousand_hertz_on_are_drawn_in_kilohertz() -> None:
    stiff = REDUCER.replace("e4}", "e6}")
    assert stiff != REDUCER
    tree = swept('input_speed: ["300 rpm", "20000 rpm"]', "perturbation: {}", stiff)
    figure, artists = draw(tree, "campbell")
    assert figure.axes[0].get_ylabel() == "frequency (kHz)"
    elastic = tree["modes"]["natural_frequency"].values[1:] / (2000 * np.pi)
    assert elastic.max() > 2
    assert [line.get_ydata()[0] for line in artists["panels"][0]["modes"]] == pytest.approx(list(elastic))


def test_natural_frequencies_that_change_are_asked_for() -> None:
    sweep = "mesh_frequency: [1, 5], input_shaft_stiffness: [0.5, 2.0]"
    tree = swept(sweep, "perturbation: {}")
    draw(tree, "campbell", select={"input_shaft_stiffness": "0.5"})
    with pytest.raises(PlotError, match="add natural_frequencies"):
        draw(tree, "campbell", select={"input_shaft_stiffness": "2"})
    with pytest.raises(PlotError, match="no natural frequencies over input_shaft_stiffness"):
        draw(tree, "campbell", x="input_shaft_stiffness")
    with pytest.raises(PlotError, match="needs an axis"):
        draw(result(), "campbell")


def test_natural_frequencies_alone_are_drawn_over_their_axis() -> None:
    tree = swept("input_shaft_stiffness: [0.2, 1.0, 5.0]", "natural_frequencies: {}")
    assert default_kind(tree, Request()) == "campbell"
    _, artists = draw(tree)
    (panel,) = artists["panels"]
    assert not panel["orders"]
    np.testing.assert_allclose(panel["modes"][0].get_xdata(), [0.2, 1.0, 5.0])


def test_natural_frequencies_that_follow_the_speed() -> None:
    """A disc that tilts about both axes, on a mesh: I q'' + W I_p (b', -a') + k q, a forward and a backward motion."""
    rotor = {
        "kind": "matrices", "mass": [[1.0, 0], [0, 1.0]], "stiffness": [[4.0, 0], [0, 4.5]],
        "meshes": [{"direction": [0, 1.0], "mean_stiffness": 0.5, "epsilon": 0.3, "contact_ratio": 1.5}],
        "rotation": {"speed_ratio": "1/4", "gyroscopic": [[0, 1.5], [-1.5, 0]]},
    }  # fmt: skip
    config = {
        "system": rotor,
        "sweep": {"mesh_frequency": {"start": 1.0, "stop": 6.0, "num": 101}},
        "methods": {"natural_frequencies": {}, "floquet": {}},
    }
    tree = gearstab.sweep(gearstab.load(config))
    _, artists = draw(tree, "campbell", Request())
    (panel,) = artists["panels"]
    backward, forward = (line.get_ydata() for line in panel["modes"])
    assert (np.diff(forward) > 0).all()
    assert (np.diff(backward) < 0).all()
    # In the stiffer of two directions only the sum is that of the plane: w_1^2 w_2^2 = k_1 k_2.
    np.testing.assert_allclose(forward * backward, np.sqrt(4.0 * 5.0), rtol=1e-12)
    unstable = tree["floquet/stable"].values == 0
    assert unstable.any()
    spans = [path.get_extents().intervalx for path in panel["bands"].get_paths()]
    speeds = np.linspace(1.0, 6.0, 101)
    np.testing.assert_array_equal([any(a < w < b for a, b in spans) for w in speeds], unstable)


def test_every_mode_below_the_top_is_named_once() -> None:
    """Thirty masses in a row, of which many frequencies lie side by side: neighbours share a name."""
    count = 30
    masses = (np.eye(count) * 2 - np.eye(count, k=1) - np.eye(count, k=-1)).tolist()
    mesh = f"{{direction: {[1.0] + [0.0] * (count - 1)}, mean_stiffness: 0.1, epsilon: 0.1, contact_ratio: 1.5}}"
    system = f"system: {{kind: matrices, mass: {np.eye(count).tolist()}, stiffness: {masses}, meshes: [{mesh}]}}\n"
    tree = swept("mesh_frequency: {start: 0.5, stop: 4, num: 5}", "natural_frequencies: {}", system)
    _, artists = draw(tree, "campbell")
    numbers: list[int] = []
    for text in artists["panels"][0]["mode_names"].texts:
        for part in text.get_text().strip("$").removeprefix(r"\omega_{").rstrip("}").split(","):
            first, _, last = part.partition("\\text{\N{EN DASH}}")
            numbers += range(int(first), int(last or first) + 1)
    assert sorted(numbers) == list(range(1, count + 1))


@pytest.mark.parametrize("slopes", [(0.5, 1.0, 1.5), (0.5,), (0.5, 1.0, 40.0), (4000.0,)])
def test_orders_along_the_edge_of_the_frame_have_numbers_too(slopes) -> None:
    """A frame of 1000 by 10, whose numbers are about 40 high: lines below that, or that leave it at once."""
    figure, ax = new_frame(Request(dpi=100), 1.0)
    ax.set(xlim=(0, 10), ylim=(0, 1000))
    orders = [draw_order(ax, slope, 0.0, k + 1, "blue", "") for k, slope in enumerate(slopes)]
    settle(figure)
    number_orders(ax, orders, [], [])
    figure.draw_without_rendering()
    written = [text.get_text().removesuffix(r"$\times$") for text in ax.texts]
    assert sorted(", ".join(written).split(", ")) == [f"{0.5 * (k + 1):g}" for k in range(len(slopes))]
    frame = ax.get_window_extent()
    for text in ax.texts:
        box = text.get_window_extent()
        assert frame.x0 <= box.x0 < box.x1 <= frame.x1
        assert frame.y0 <= box.y0 < box.y1 <= frame.y1
