"""Figures of modes: where the drawn bodies are against the displacements of the mode, and what can be chosen."""

import numpy as np
import plot_results as planetary
import pytest
from plot_results import tree

from gearstab.config import load
from gearstab.errors import PlotError
from gearstab.plots import default_kind, draw
from gearstab.plots.drawing.gear_bodies import LARGEST, displaced, layout_of, mesh_deflection, ring_shape
from gearstab.plots.view import Request
from gearstab.results import open_result
from gearstab.sweep import plan, run

ANGLE = np.linspace(0, 2 * np.pi, 361)
FOUR = layout_of(planetary.names(4, 2))


@pytest.fixture(scope="module")
def table_1():
    """(result, figure, artists) of the gear of Parker's Table 1."""
    made = planetary.planetary(harmonics=6)
    return made, *draw(made, "modes", dpi=60)


def entries_of(made, p):
    modes = made["modes"]
    return dict(zip(modes["dof"].values, modes["mode_shape"].values[p], strict=True))


def points(line):
    return np.array(line.get_data())


def titles(artists):
    return [ax.get_title() + ax.get_title(loc="left") for ax in artists["axes"]]


# --- pictures


def test_the_result_of_modes_alone_is_drawn_as_modes():
    assert default_kind(planetary.planetary(), Request()) == "modes"


def test_headings_give_frequency_type_and_T(table_1):
    """Table 1 to its printed digits; the purely ring mode has no T."""
    found = titles(table_1[2])
    assert found[:4] == [
        "$\\omega_{1}$ = 0.9184\ntranslational, $T$ = 1", "$\\omega_{2}$ = 0.9184\ntranslational, $T$ = 1",
        "$\\omega_{3}$ = 1.113\nrotational, $T$ = 0", "$\\omega_{4}$ = 2.438\nplanet, $T$ = 2",
    ]  # fmt: skip
    assert found[7] == "$\\omega_{8}$ = 4.756\npurely ring"


def test_the_first_twelve_of_many_modes_are_drawn(table_1):
    _, figure, artists = table_1
    assert len(artists["pictures"]) == 12
    assert "Modes 1 to 12 of 31." in figure.legends[0].get_title().get_text().replace("\n", " ")


def test_the_same_largest_displacement_in_every_mode(table_1):
    made, _, artists = table_1
    rest = np.array([np.cos(ANGLE), np.sin(ANGLE)])
    for p, picture in enumerate(artists["pictures"]):
        found = displaced(FOUR, entries_of(made, p), ANGLE)
        moved = [np.hypot(*(centre)) + abs(found.turns[b]) * radius(b) for b, centre in found.centres.items()]
        # The ring's points go along the tangent by an angle, so that they move by the chord of it and not by the arc.
        ring = np.hypot(*(points(picture["ring"]) - rest)).max()
        assert max(*moved, ring) == pytest.approx(LARGEST, rel=0.02)


def radius(body):
    return {"sun": FOUR.sun, "carrier": FOUR.orbit}.get(body, FOUR.planet)


def test_mesh_deflections_follow_from_the_displacements_drawn(table_1):
    """Relative displacement of two teeth along their line of action: all signs and directions of the drawing."""
    made, a = table_1[0], planetary.PRESSURE_ANGLE
    for p in range(12):
        entries, found = entries_of(made, p), displaced(FOUR, entries_of(made, p), ANGLE)
        v, w = ring_shape(entries, FOUR.angles)
        scale = found.ring_turn / entries["ring_rotation"]
        ring = np.array([entries["ring_x"], entries["ring_y"]]) * scale
        drawn = {"sun": [], "ring": []}
        for n, psi in enumerate(FOUR.angles, start=1):
            out, along = np.array([np.cos(psi), np.sin(psi)]), np.array([-np.sin(psi), np.cos(psi)])
            planet, turn = found.centres[f"planet{n}"], found.turns[f"planet{n}"] * FOUR.planet
            line = along * np.cos(a) + out * np.sin(a)
            drawn["sun"].append((found.centres["sun"] - planet) @ line + found.turns["sun"] * FOUR.sun + turn)
            line = along * np.cos(a) - out * np.sin(a)
            point = ring + scale * (v[n - 1] * along + w[n - 1] * out)
            drawn["ring"].append((point - planet) @ line + found.ring_turn - turn)
        expected = scale * made["modes"]["mesh_deflection"].values[p]
        # Rotations of stiffly held bodies are differences of displacements a thousand times as large.
        np.testing.assert_allclose([*drawn["sun"], *drawn["ring"]], expected, atol=1e-9)


def test_the_ring_is_inextensible_and_bends_outwards_by_minus_the_slope_of_v():
    entries = {"ring_c2": 0.3, "ring_s3": -0.2}
    v, w = ring_shape(entries, ANGLE)
    np.testing.assert_allclose(v, 0.3 * np.cos(2 * ANGLE) - 0.2 * np.sin(3 * ANGLE), atol=1e-15)
    # Central differences over a step of 1 degree: their error is at most 27/6 times its square times 0.2.
    np.testing.assert_allclose(w[1:-1], -(v[2:] - v[:-2]) / (ANGLE[2] - ANGLE[0]), atol=1e-3)


def test_purely_ring_modes_leave_all_gears_at_rest_and_have_no_mesh_dots(table_1):
    picture = table_1[2]["pictures"][7]
    assert picture["meshes"] == {}
    np.testing.assert_allclose(np.hypot(*points(picture["sun"])), FOUR.sun, atol=1e-6)
    assert np.ptp(np.hypot(*points(picture["ring"]))) > LARGEST


def test_mesh_dots_show_sign_and_size(table_1):
    made, _, artists = table_1
    deflection = made["modes"]["mesh_deflection"].values
    for p in (0, 2, 3):
        dots = artists["pictures"][p]["meshes"]
        largest = max(np.abs(deflection[p]))
        for k, name in enumerate(made["modes"]["mesh"].values):
            full = dots[name].get_markerfacecolor() != "white"
            assert full == (deflection[p, k] > 0)
            assert (dots[name].get_markersize() / 5.5) ** 2 == pytest.approx(abs(deflection[p, k]) / largest)


def test_a_carrier_without_planet_translations_takes_the_planets_along():
    """The purely rotational model: centres of the planets move with the carrier."""
    entries = {"sun_rotation": 0.0, "carrier_rotation": 1.0, "planet1_rotation": 0.0}
    found = displaced(FOUR, entries, ANGLE)
    for n, psi in enumerate(FOUR.angles, start=1):
        np.testing.assert_allclose(
            found.centres[f"planet{n}"], LARGEST * np.array([-np.sin(psi), np.cos(psi)]), atol=1e-15
        )
    assert found.turns["carrier"] == pytest.approx(LARGEST / FOUR.orbit)
    dofs = planetary.names(3, 1, "rotational")
    made = planetary.small(dofs, [np.eye(len(dofs))[0]], ["sun1", "ring1"], [[1.0, -1.0]])
    _, artists = draw(made, "modes", dpi=60)
    assert len(artists["pictures"][0]["planets"]) == 3


def test_a_mode_without_any_displacement_is_drawn_at_rest():
    found = displaced(FOUR, {}, ANGLE)
    np.testing.assert_allclose(np.hypot(*found.ring), 1.0)


@pytest.mark.parametrize("planets", range(3, 12))
def test_planets_touch_sun_and_ring_but_never_each_other(planets):
    layout = layout_of(planetary.names(planets, 2))
    assert layout.planets == planets
    assert layout.sun + 2 * layout.planet == pytest.approx(1.0)
    assert 2 * layout.orbit * np.sin(np.pi / planets) > 2.2 * layout.planet


# --- charts


def test_other_systems_get_a_chart_of_entries_and_mesh_deflections():
    shapes, deflections = [[1.0, -0.5, 0.2], [0.1, 0.9, -0.3]], [[2.0, 1e-17], [3.0, -1.0]]
    types = {"mode_type": ("mode", ["elastic", "no mesh deflection"])}
    made = planetary.small(["x1", "x2", "shaft_end"], shapes, ["first", "second"], deflections, **types)
    _, artists = draw(made, "modes", dpi=60)
    np.testing.assert_array_equal([line.get_ydata() for line in artists["shapes"]], shapes)
    np.testing.assert_array_equal([line.get_ydata() for line in artists["deflections"]], [[2.0, 0.0], [3.0, -1.0]])
    names = [label.get_text() for label in artists["axes"][-1].get_xticklabels()]
    assert names == ["$x_{1}$", "$x_{2}$", "shaft end", "first", "second"]
    assert titles(artists) == [
        r"$\omega_{1}$ = 1 rad/s,  elastic", r"$\omega_{2}$ = 2 rad/s,  no mesh deflection"
    ]  # fmt: skip


def test_rounding_in_a_mesh_deflection_is_no_deflection():
    made = planetary.small(["x1"], [[1.0], [1.0]], ["a"], [[1.0], [1e-13]])
    np.testing.assert_array_equal(mesh_deflection(made["modes"].to_dataset()), [[1.0], [0.0]])


def test_modes_of_negative_stiffness_have_an_imaginary_frequency():
    made = planetary.small(["x1"], [[1.0]], ["a"], [[1.0]])
    made["modes"]["natural_frequency"].values[:] = np.nan
    _, artists = draw(made, "modes", dpi=60)
    assert titles(artists) == [r"$\omega_{1}$ = imaginary"]


# --- what can be chosen


@pytest.mark.parametrize(
    ("select", "expected"),
    [
        ({"mode": "3"}, [3]),
        ({"mode": "1,5-7"}, [1, 5, 6, 7]),
        ({"mode_type": "rotational"}, [3, 7]),
        ({"mode": "1-5", "mode_type": "planet"}, [4]),
    ],
)
def test_modes_are_selected_by_number_and_type(select, expected):
    _, artists = draw(planetary.planetary(harmonics=3), "modes", select=select, dpi=60)
    assert [int(title.split("{")[1].split("}")[0]) for title in titles(artists)] == expected


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"select": {"mode": "0"}}, "modes 1 to 25"),
        ({"select": {"mode": "one"}}, "write numbers and ranges"),
        ({"select": {"mode": "7-5"}}, "modes 1 to 25"),
        ({"select": {"mode": "1-13"}}, "too many"),
        ({"select": {"mode_type": "bending"}}, "no mode is of type 'bending'"),
        ({"select": {"mode": "1", "mode_type": "planet"}}, "none of the modes selected"),
        ({"select": {"epsilon": "0.1"}}, "use mode or mode_type"),
        ({"x": "mode"}, "has no --x"),
        ({"size": "triple"}, "size 'triple' is not known"),
    ],
)
def test_what_cannot_be_drawn_is_said_in_one_line(options, message):
    with pytest.raises(PlotError, match=message) as caught:
        draw(planetary.planetary(harmonics=3), "modes", **options)
    assert "\n" not in str(caught.value)


def test_a_result_without_mode_shapes_has_no_figure_of_modes():
    with pytest.raises(PlotError, match="no mode shapes"):
        draw(tree(), "modes")


# --- with the program's own results


def test_a_result_of_a_sweep_is_drawn_with_types_and_bodies(root, tmp_path):
    """From the configuration of Table 1 to the figure; coordinates and meshes have the names that the pictures read."""
    config = load(root / "configs" / "parker_2009" / "table1.yaml", ["ring.harmonics=6"])
    run(plan(config), tmp_path / "modes.h5")
    with open_result(tmp_path / "modes.h5") as made:
        _, artists = draw(made, "modes", select={"mode": "1-9"}, dpi=60)
        assert list(made["modes"]["dof"].values) == planetary.names(4, 6)
    by_hand = draw(planetary.planetary(harmonics=6), "modes", select={"mode": "1-9"}, dpi=60)[1]
    assert [t.replace(" rad/s", "") for t in titles(artists)] == titles(by_hand)
    for picture, expected in zip(artists["pictures"], by_hand["pictures"], strict=True):
        assert bool(picture["meshes"]) == bool(expected["meshes"])
