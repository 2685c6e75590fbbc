"""Texts with units: what they mean in each field, and which are refused, with a remedy that is not a wrong number."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import CONFIGS, problems, read, scene_text, succeeds, table, written

from gearstab.config import Problem
from gearstab.config.model.units import KNOWN, UnitError, hint_of, scale, to_si
from gearstab.results.display import unit_of
from gearstab.systems import build

MIXED = scene_text("config_units_mixed")
PLANETARY = scene_text("config_units_planetary")


def first_problem(folder: Path, text: str, *overrides: str) -> Problem:
    (found,) = problems(folder, text, *overrides)
    return found


READINGS = [
    pytest.param(scene["scene"], row, id=row["set"])
    for scene in table("readings")["scene"]
    for row in scene["readings"]
]


@pytest.mark.parametrize(("scene", "row"), READINGS)
def test_what_is_written_is_read_as_this(tmp_path, scene, row):
    """Texts with units, exact ratios, and values put in by every form of a path."""
    found = read(tmp_path, scene_text(scene), row["set"]).system
    for key in row["path"].split("."):
        found = found[int(key) if key.isdigit() else key]
    expected = Fraction(row["value"]) if isinstance(found, Fraction) else row["value"]
    assert found == (pytest.approx(expected, rel=1e-14) if isinstance(found, float) else expected)


def test_units_of_axes_are_those_of_their_very_number(tmp_path):
    text = MIXED + "sweep: {mesh_frequency: [1, 2], load.1: [1, 2], stiffness.0.0: [1, 2]}\nmethods: {floquet: {}}\n"
    assert [axis.units for axis in read(tmp_path, text).axes] == ["rad/s", "N m", "N/m"]


# ---- coordinates of matrices


def test_one_unit_may_stand_for_all_coordinates(tmp_path):
    system = build(read(tmp_path, MIXED, "coordinate_units=rad").system)
    assert system.coordinate_units == ("rad", "rad")


def test_inertias_tell_which_coordinates_turn(tmp_path):
    text = MIXED.replace("  coordinate_units: [m, rad]\n", "").replace("0.01]]", "100 kg cm^2]]")
    config = read(tmp_path, text)
    assert build(config.system).coordinate_units == ("m", "rad")
    assert config.tree["system"]["coordinate_units"] == ["m", "rad"]


def test_torsional_meshes(tmp_path):
    text = """\
system:
  kind: matrices
  mass: [[0.01, 0], [0, 0.02]]
  stiffness: [[100, 0], [0, 0]]
  coordinate_units: rad
  deflection_unit: rad
  meshes: [{direction: [1, -0.5], mean_stiffness: 2 kN m, epsilon: 0.2, contact_ratio: 1.5, backlash: 0.1 deg}]
  load: [0, 100 N m]
respond: {mesh_frequency: 500, cycles: 3, initial: {displacement: [0, 0], velocity: [0, 0]}}
"""
    assert first_problem(tmp_path, text, "meshes.0.backlash=1 mm").path == "system.meshes.0.backlash"
    path, out = written(tmp_path, text, "scene.yaml"), tmp_path / "out.h5"
    succeeds("respond", path, "-o", out)
    expected = {
        "displacement": "rad", "velocity": "rad/s", "mesh_deflection": "rad", "mesh_force": "N m", "play": "rad",
        "event_velocity": "rad/s", "peak_to_peak": "rad", "time": "s", "energy": "J", "event_time": "s",
    }  # fmt: skip
    with h5py.File(out) as file:
        response, modes = file["response"], file["modes"]
        assert {name: response[name].attrs["units"] for name in expected} == expected
        assert {modes[name].attrs["units"] for name in ("mode_shape", "mesh_deflection")} == {"kg^-1/2 m^-1"}
        assert list(modes["dof_units"].asstr()) == ["rad", "rad"]


# ---- models without units

NONE = scene_text("config_units_none")


def units_in(path: Path) -> dict[str, str]:
    found = {}
    with h5py.File(path) as file:
        file.visititems(lambda name, item: found.update({name: item.attrs.get("units", "1")}))
    return found


@pytest.mark.parametrize(
    ("command", "changes"),
    [("sweep", []), ("respond", []), ("respond", ["--set", "meshes.0.backlash=2"])],
    ids=["sweep", "respond", "backlash"],
)
def test_results_of_a_model_without_units_have_none(tmp_path, command, changes):
    path, out = written(tmp_path, NONE, "scene.yaml"), tmp_path / "out.h5"
    succeeds(command, path, "-o", out, *changes)
    assert set(units_in(out).values()) == {"1"}
    with h5py.File(out) as file:
        assert set(file["modes/dof_units"].asstr()) == {"1"}
        comments = [group.attrs.get("comment", "") for group in file.values()]
    assert not any(unit in comment for comment in comments for unit in ("(s)", "1/s", "rad"))


def test_a_rotating_pair_without_units(tmp_path):
    path, out = tmp_path / "scene.yaml", tmp_path / "out.h5"
    path.write_text("""\
system: {kind: gear_pair, units: none, teeth: [20, 40], inertias: [1.0, 16.0], torsional_stiffness: [1.0, 2.0],
         contact_ratio: 1.5, torque: 0.01, damping_ratio: 0.1}
respond: {speed: 0.01, cycles: 20}
""")
    succeeds("respond", path, "-o", out)
    assert set(units_in(out).values()) == {"1"}


def test_a_scaled_planetary_gear_has_lengths_only(tmp_path):
    """Masses, stiffnesses and times are scaled, displacements are not: forces over a stiffness are lengths."""
    config = read(tmp_path, PLANETARY, "scaling=dimensionless")
    system = build(config.system)
    expected = {"rad/s": "1", "1/s": "1", "kg^-1/2": "1", "m": "m", "m/s": "m", "N": "m", "J": "m^2", "s": "1"}
    expected |= {"N^2 s": "m^2", "m^2 s": "m^2", "1": "1"}
    assert {unit: unit_of(system, unit) for unit in expected} == expected
    found = first_problem(
        tmp_path, PLANETARY + "respond: {mesh_frequency: 600 rpm, cycles: 3}\n", "scaling=dimensionless"
    )
    assert found.path == "respond.mesh_frequency"


def test_a_gearbox_has_units(tmp_path):
    text = (CONFIGS / "kuria_kihiu_2008" / "map.yaml").read_text()
    assert first_problem(tmp_path, text, "system.units=none").path == "system.units"


# ---- the parser of quantities


@given(st.floats(1e-6, 1e6), st.sampled_from(["", "-", "+"]))
def test_per_cent_and_angles_are_fractions(value, sign):
    number = float(f"{sign}{value!r}")
    assert to_si(f"{sign}{value!r} %", ()) == number / 100
    assert to_si(f"{sign}{value!r} deg", (), turns=True) == pytest.approx(number / 360, rel=1e-14)


COMMAS = [("0,02", "0.02"), ("-0,5 mm", "-0.5 mm"), (",5", "0.5"), ("1,234", "1234 if"), ("1.234,5", "separators")]


@pytest.mark.parametrize("units", [(), ("m",)], ids=["dimensionless", "length"])
@pytest.mark.parametrize(("text", "hint"), COMMAS)
def test_decimal_commas(text, hint, units):
    with pytest.raises(UnitError, match="comma") as caught:
        to_si(text, units)
    assert hint in hint_of(caught.value)


@pytest.mark.parametrize(("unit", "si"), KNOWN)
def test_the_most_usual_units_are_what_pint_takes_them_for(unit: str, si: str) -> None:
    assert scale(unit, si) == pytest.approx(to_si(f"1 {unit}", (si,)), rel=1e-15)


@pytest.mark.parametrize(
    ("unit", "left"),
    [
        ("m", "m"), ("m/s", "m"), ("rad/s", "1"), ("N", "m"), ("N/m", "1"), ("N m", "m^2"), ("J", "m^2"), ("1", "1"),
        ("N/m^2", "m^-1"), ("Pa", "m^-1"), ("m^2 s", "m^2"), ("N^2 s", "m^2"), ("kg^-1/2", "1"), ("1/s", "1"),
    ],
)  # fmt: skip
def test_units_where_times_and_masses_have_none(unit: str, left: str) -> None:
    """With masses and times without a unit a force is a length, energy the square of one, a stiffness a number."""
    system: Any = SimpleNamespace(dimensionless=("mass", "time"))
    assert unit_of(system, unit) == left
