"""Orders of the forces of bearings and shafts over the speed, and levels in dB."""

import numpy as np
import pytest

import gearstab
from gearstab.errors import PlotError
from gearstab.plots import draw

TEETH = 20
CONFIG = {
    "title": "orders",
    "system": {
        "kind": "gearbox",
        "damping_ratio": 0.03,
        "gears": {"module": "2 mm", "pressure_angle": "20 deg", "face_width": "20 mm"},
        "rotors": [
            {"name": "motor", "inertia": 0.01, "teeth": TEETH, "mass": 1.0, "support": {"stiffness": 1e8}},
            {"name": "machine", "inertia": 0.03, "teeth": 60},
        ],
        "meshes": [{"name": "mesh", "gears": ["motor", "machine"]}],
        "input": {"rotor": "motor", "torque": 20.0},
        "outputs": [{"rotor": "machine"}],
    },
    "sweep": {"input_speed": {"start": "2000 rpm", "stop": "4000 rpm", "num": 5}},
    "methods": {"response": {"bearings": True}},
}


@pytest.fixture(scope="module")
def tree():
    return gearstab.sweep(CONFIG)


def test_orders_are_labelled_by_turns_of_the_input_shaft(tree):
    _, artists = draw(tree, "orders")
    found = tree["response"]["bearing_force_harmonic"]
    largest = np.sort(np.argsort(-found.max(("input_speed", "bearing")).values)[:4])
    assert len(artists["lines"]) == 4 * found.sizes["bearing"]
    for line, order in zip(artists["lines"], largest, strict=False):
        multiple = float(found["mesh_order"][order])
        assert line.get_label().startswith(f"order {TEETH * multiple:g} (")
        np.testing.assert_allclose(line.get_ydata(), found[:, order, 0])
        np.testing.assert_allclose(line.get_xdata(), np.linspace(2000, 4000, 5))


@pytest.mark.parametrize("kind", ["orders", "speeds"])
def test_levels_refer_to_a_micronewton(tree, kind):
    variable = {"orders": "bearing_force_harmonic", "speeds": "bearing_force_peak"}[kind]
    figure, artists = draw(tree, kind, variable=variable, select={"bearing": "motor.y"}, unit=["dB", "input_speed=Hz"])
    values = tree["response"][variable].sel(bearing="motor.y").values.reshape(5, -1)
    np.testing.assert_allclose(artists["lines"][0].get_ydata(), 120 + 20 * np.log10(values[:, 0]), rtol=1e-12)
    np.testing.assert_allclose(artists["lines"][0].get_xdata(), np.linspace(2000, 4000, 5) / 60)
    assert "dB re 1" in figure.axes[0].get_ylabel().replace("\n", " ")


def test_what_cannot_be_drawn_is_one_line(tree):
    with pytest.raises(PlotError, match=r"kind modes shows no amplitudes as levels; --kind: speeds, orders"):
        draw(tree, "modes", unit=["dB"])
    with pytest.raises(
        PlotError, match=r"no variable 'growth_rate' with orders over the speed; there is bearing_force"
    ):
        draw(tree, "orders", variable="growth_rate")
    with pytest.raises(PlotError, match=r"no axis 'epsilon' to select in this figure; there is mesh_order, bearing"):
        draw(tree, "orders", select={"epsilon": "0.1"})
    without = gearstab.sweep({**CONFIG, "methods": {"response": {}}})
    with pytest.raises(PlotError, match=r"methods\.response with bearings: true"):
        draw(without, "orders")
