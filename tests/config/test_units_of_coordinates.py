"""The units of coordinates in results: rotations in rad, displacements in m, and both in one train."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenes import scene_text, succeeds, written

from gearstab.mesh import Mesh
from gearstab.modal import mean_modes
from gearstab.plots import draw
from gearstab.results import open_result
from gearstab.results.display import in_units_of
from gearstab.results.provenance import modes_group
from gearstab.results.variables.responses import RESPONSE, SPEED_RESPONSE
from gearstab.system import GearSystem
from gearstab.systems import build
from gearstab.waveforms import Rectangular

GEARBOX = scene_text("units_of_coordinates_gearbox")
SUPPORT = "{stiffness: 1.0e+8, damping_ratio: 0.05}"

PAIR = {
    "kind": "gear_pair", "teeth": [24, 96], "inertias": [2.89e-3, 0.7402], "torsional_stiffness": [1430, 2780],
    "single_contact_angle": 1.73, "torque": 63.15, "damping_ratio": 0.1,
}  # fmt: skip


def responded(folder: Path, support: str) -> Path:
    """The result of ``gearstab respond`` for the train, its pinion supported or not."""
    config, out = (
        written(
            folder, GEARBOX.replace(", support: SUPPORT", f", support: {support}" if support else ""), "train.yaml"
        ),
        folder / "train.h5",
    )
    succeeds("respond", config, "-o", out)
    return out


def test_a_torsional_gearbox_turns_in_radians(tmp_path: Path) -> None:
    with open_result(responded(tmp_path, "")) as tree:
        response, modes = tree["response"], tree["modes"]
        units = {name: response[name].attrs["units"] for name in ("displacement", "velocity", "mean_velocity")}
        assert units == {"displacement": "rad", "velocity": "rad/s", "mean_velocity": "rad/s"}
        assert response["mesh_deflection"].attrs["units"] == "m"
        assert modes["mode_shape"].attrs["units"] == "kg^-1/2 m^-1"
        assert modes["mesh_deflection"].attrs["units"] == "kg^-1/2"
        assert list(modes["dof_units"].values) == list(response["dof_units"].values) == ["rad"] * 3
        figure, _ = draw(tree, "response")
        assert [ax.get_ylabel().replace("\n", " ") for ax in figure.axes[:2]] == [
            "rotation, in (rad)", "rotation, pinion (rad)",
        ]  # fmt: skip


def test_a_train_with_supports_has_both_units(tmp_path: Path) -> None:
    with open_result(responded(tmp_path, SUPPORT)) as tree:
        displacement, shape = tree["response"]["displacement"], tree["modes"]["mode_shape"]
        assert list(displacement["dof_units"].values) == ["rad", "rad", "rad", "m", "m"]
        for data, turned, moved in ((displacement, "rad", "m"), (shape, "kg^-1/2 m^-1", "kg^-1/2")):
            assert data.attrs["units"] == "1"
            assert (data.attrs["units_of_rad"], data.attrs["units_of_m"]) == (turned, moved)
            assert "dof_units" in data.attrs["comment"]
        figure, _ = draw(tree, "response")
        labels = [ax.get_ylabel().replace("\n", " ") for ax in figure.axes]
        assert labels[2:5] == ["rotation, wheel (rad)", "displacement, pinion.x (m)", "displacement, pinion.y (m)"]
        figure, _ = draw(tree, "modes")
        label = figure.get_supylabel().replace("\n", " ")
        assert "rotations: kg$^{-1/2}$ m$^{-1}$, displacements: kg$^{-1/2}$" in label


def test_the_unit_of_a_mode_follows_a_change_of_the_unit_of_length() -> None:
    """In mm, kg and s an entry of unit kg^-1/2 m^-1 is a thousandth, one of kg^-1/2 stays: so it is."""

    def modes(length: float) -> tuple[np.ndarray, np.ndarray]:
        """Modes of a rotor of 0.02 kg m^2 and 3 kg on springs, with a mesh at 0.05 m; lengths times ``length``."""
        arm = np.array([0.05 * length, 1.0])
        mass = np.diag([0.02 * length**2, 3.0])
        mesh = Mesh("mesh", arm, np.array(2e6), np.array(0.0), Rectangular(np.array(1.5)))
        found = mean_modes(GearSystem(mass, np.diag([1e3 * length**2, 3e5]), (mesh,)))
        return found.natural_frequency, found.shapes

    frequency, metres = modes(1.0)
    again, millimetres = modes(1e3)
    np.testing.assert_allclose(again, frequency, rtol=1e-12)  # rounding of an eigenvalue problem of two
    np.testing.assert_allclose(np.abs(metres[0]), 1e3 * np.abs(millimetres[0]), rtol=1e-12)
    np.testing.assert_allclose(np.abs(metres[1]), np.abs(millimetres[1]), rtol=1e-12)


def test_a_pair_given_by_its_gears_has_torsional_meshes() -> None:
    system = build(PAIR)
    units = {field.variable.name: field.variable.units for field in modes_group(system).fields}
    assert units["mode_shape"] == units["mesh_deflection"] == "kg^-1/2 m^-1"
    swept = {v.name: v.units for v in in_units_of(system, SPEED_RESPONSE)}
    assert swept["mesh_force_peak"] == "N m"
    assert swept["transmission_error_rms"] == "rad"
    assert swept["dynamic_load_factor"] == "1"


@pytest.mark.parametrize("units", [(), ("m", "m")])
def test_metres_stay_what_they_were(units: tuple[str, ...]) -> None:
    system = GearSystem(np.eye(2), np.eye(2), (), units=units)
    assert system.coordinate_units == ("m", "m")
    assert in_units_of(system, RESPONSE) == RESPONSE


def test_an_axis_of_input_speed_says_what_mesh_frequency_it_gives(tmp_path: Path) -> None:
    swept = GEARBOX[: GEARBOX.index("respond:")].replace(", support: SUPPORT", "")
    config, out = (
        written(
            tmp_path, swept + 'sweep: {input_speed: ["600 rpm", "1200 rpm"]}\nmethods: {floquet: {}}\n', "train.yaml"
        ),
        tmp_path / "swept.h5",
    )
    succeeds("sweep", config, "-o", out)
    with open_result(out) as tree:
        # 20 teeth pass in every turn of the pinion, which turns with the input.
        assert tree["input_speed"].attrs["mesh_frequency_factor"] == 20
        np.testing.assert_allclose(tree["input_speed"].values, np.array([20, 40]) * np.pi, rtol=1e-12)
