"""Units in which a reader sees a result: as they were typed, or as they are asked for; files stay SI."""

import csv
import io
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scenes import ran, refused, scene_text, succeeds, written

from gearstab.errors import ResultError
from gearstab.plots import draw
from gearstab.results import open_result
from gearstab.results.display import in_display_units, number_of

RPM = np.pi / 30
TEETH = 19
GEARBOX = scene_text("display_gearbox")


def stored(factory: pytest.TempPathFactory, command: str, text: str) -> Path:
    """The result that a command writes of a configuration."""
    folder = factory.mktemp(command)
    succeeds(command, written(folder, text), "-o", folder / "r.h5", "-q")
    return folder / "r.h5"


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return stored(tmp_path_factory, "sweep", GEARBOX)


@pytest.fixture
def tree(result: Path) -> Iterator[xr.DataTree]:
    with open_result(result) as opened:
        yield opened


def table(result: Path, *options: str) -> list[dict[str, str]]:
    done = succeeds("export", result, "-o", "-", *options)
    return list(csv.DictReader(io.StringIO(done.stdout)))


def test_the_file_is_in_si_units_and_knows_the_typed_one(tree: xr.DataTree) -> None:
    speed = tree["input_speed"]
    np.testing.assert_allclose(speed.values, np.linspace(20000, 80000, 31) * RPM, rtol=1e-14)
    assert (speed.attrs["units"], speed.attrs["display_units"]) == ("rad/s", "rpm")
    assert speed.attrs["display_scale"] == pytest.approx(RPM, rel=1e-15)


def test_maps_and_their_boundaries_are_in_the_typed_unit(tree: xr.DataTree) -> None:
    figure, artists = draw(tree, "map")
    assert figure.axes[0].get_xlabel() == "input speed (rpm)"
    assert figure.axes[0].get_xlim() == (20000, 80000)
    edges = tree["boundaries"]["boundary_frequency"].values / (TEETH * RPM)
    drawn = np.concatenate([path.vertices[:, 0] for path in artists["boundaries"].get_paths()])
    inside = edges[np.isfinite(edges)]
    assert drawn.size
    for speed in drawn:
        assert np.abs(inside - speed).min() < 1e-6 * speed
    hertz, _ = draw(tree, "map", unit=["Hz"])
    assert hertz.axes[0].get_xlim() == pytest.approx((20000 / 60, 80000 / 60))
    si, _ = draw(tree, "map", unit=["SI"])
    assert "rad" in si.axes[0].get_xlabel()
    assert si.axes[0].get_xlim() == pytest.approx((20000 * RPM, 80000 * RPM))


def test_boundaries_alone_are_over_the_speed_too(tree: xr.DataTree) -> None:
    del tree["floquet"]
    figure, _ = draw(tree, "boundaries")
    assert "input speed (rpm)" in (figure.axes[0].get_xlabel(), figure.axes[0].get_ylabel())


def test_a_value_with_a_unit_is_found_and_the_nearest_one_named(tree: xr.DataTree, result: Path) -> None:
    _, exact = draw(tree, "curve", select={"input_speed": "42000 rpm"})
    assert exact["nearest"] == []
    _, between = draw(tree, "curve", select={"input_speed": "700.1 Hz"})
    assert between["nearest"] == ["input_speed = 700.1 Hz is not one of its values; nearest: 42000 rpm"]
    done = ran("export", result, "-o", "-", "--select", "input_speed=43900rpm", "--select", "epsilon=0.3")
    assert "input_speed = 43900rpm is not one of its values; nearest: 44000 rpm" in done.stderr
    (row,) = csv.DictReader(io.StringIO(done.stdout))
    assert (row["input_speed (rpm)"], row["epsilon"]) == ("44000.0", "0.3")
    stored = tree["floquet"]["growth_rate"].sel(epsilon=0.3).isel(input_speed=12)
    assert float(row["growth_rate"]) == float(stored)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--select", "input_speed=7 kg"], "is not in rpm"),
        (["--select", "input_speed=90000"], "is outside the result: 20000 to 80000 rpm"),
        (["--select", "speed=3"], "there is no axis 'speed' in this table; there is input_speed, epsilon"),
        (["--select", "epsilon"], "write AXIS=VALUE"),
        (["--unit", "kg"], "--unit kg: is no unit of an axis of this result; there is input_speed (rad/s)"),
        (["--unit", "epsilon=rpm"], "is no unit of epsilon"),
        (["--unit", "input_speed=furlong"], "is no unit of input_speed"),
    ],
)
def test_mistakes_are_one_line(result: Path, options: list[str], words: str) -> None:
    assert words in refused("export", result, "-o", "-", *options)


def test_a_table_is_in_the_typed_unit_and_says_so(tree: xr.DataTree, result: Path) -> None:
    rows = table(result)
    assert [row["input_speed (rpm)"] for row in rows[:4]] == ["20000.0", "20000.0", "22000.0", "22000.0"]
    assert float(table(result, "--unit", "SI")[2]["input_speed"]) == float(tree["input_speed"].values[1])
    assert float(table(result, "--unit", "input_speed=Hz")[2]["input_speed (Hz)"]) == pytest.approx(22000 / 60)


def test_boundaries_of_a_table_are_input_speeds(tree: xr.DataTree, result: Path) -> None:
    rows = table(result, "--group", "perturbation", "--over", "tongue,side")
    found = [float(row["boundary_input_speed (rpm)"] or "nan") for row in rows]
    stored = tree["perturbation"]["boundary_frequency"].values.ravel()
    np.testing.assert_allclose(found, stored / (TEETH * RPM), rtol=1e-13)
    assert "boundary_frequency" not in rows[0]
    plain = table(result, "--group", "perturbation", "--over", "tongue,side", "--unit", "SI")
    np.testing.assert_array_equal([float(row["boundary_frequency"] or "nan") for row in plain], stored)


def test_a_tongue_is_selected_by_its_label(result: Path) -> None:
    rows = table(result, "--group", "perturbation", "--select", "tongue=2w2", "--select", "epsilon=0.3")
    assert {row["label"] for row in rows} == {"2w2"}
    assert len(rows) == 2  # both sides


def test_info_and_dry_run_say_what_was_typed(result: Path, tmp_path: Path) -> None:
    assert "20000 .. 80000  rpm" in ran("info", result).stdout
    assert "20000 .. 80000 rpm" in ran("sweep", written(tmp_path, GEARBOX), "--dry-run").stdout


def test_plain_numbers_stay_as_they_are(tmp_path: Path) -> None:
    text = GEARBOX.replace('"20000 rpm"', "2000").replace('"80000 rpm"', "8000")
    succeeds("sweep", written(tmp_path, text), "-o", tmp_path / "r.h5", "-q")
    with open_result(tmp_path / "r.h5") as opened:
        assert "display_units" not in opened["input_speed"].attrs
        assert in_display_units(opened) is opened
    assert float(table(tmp_path / "r.h5")[0]["input_speed"]) == 2000


def test_a_table_may_be_replaced_whatever_its_units(result: Path, tmp_path: Path) -> None:
    for _ in range(2):
        succeeds("export", result, "--group", "perturbation", "-o", tmp_path / "t.csv")


@pytest.mark.parametrize(
    ("text", "units", "number"),
    [("600 rpm", "rpm", 600), ("600", "rpm", 600), ("10 Hz", "rpm", 600), ("1 kHz", "rad/s", 2000 * np.pi),
     ("25mm", "m", 0.025), ("180 deg", "rad", np.pi), ("-3e2", "1", -300)],
)  # fmt: skip
def test_numbers_with_units(text: str, units: str, number: float) -> None:
    assert number_of(text, units) == pytest.approx(number, rel=1e-14)


@pytest.mark.parametrize(("text", "units"), [("fast", "rpm"), ("3 kg", "rpm"), ("3 rpm", "1"), ("3 zz", "m")])
def test_no_numbers(text: str, units: str) -> None:
    with pytest.raises(ValueError, match=r"is no|is not"):
        number_of(text, units)


def test_an_unknown_unit_is_refused(tree: xr.DataTree) -> None:
    with pytest.raises(ResultError, match="is no unit of an axis"):
        in_display_units(tree, ["furlong"])


MODES_OF_PAIR = scene_text("display_modes_of_pair")


@pytest.fixture(scope="module")
def response(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return stored(tmp_path_factory, "respond", MODES_OF_PAIR)


def test_the_harmonics_of_a_steady_state_are_at_the_orders_of_the_teeth(response: Path) -> None:
    # 20 teeth: the s-th harmonic of the mesh has the order 20 s, and 1500 rpm are 25 turns per second.
    orders = [float(row["frequency (order)"]) for row in table(response, "--over", "frequency", "--unit", "order")]
    np.testing.assert_allclose(orders, 20 * np.arange(len(orders)), rtol=1e-12)
    hertz = [float(row["frequency (Hz)"]) for row in table(response, "--over", "frequency", "--unit", "Hz")]
    np.testing.assert_allclose(hertz, 25 * np.array(orders), rtol=1e-12)
    for row in table(response, "--over", "peak", "--unit", "order"):
        assert float(row["peak_frequency (order)"]) % 20 == pytest.approx(0, abs=1e-9)


def test_a_spectrum_in_orders_marks_the_natural_frequency_at_its_order(response: Path) -> None:
    with open_result(response) as tree:
        figure, artists = draw(tree, "spectrum", unit=["order"])
        assert figure.axes[-1].get_xlabel() == "order of the input shaft"
        (mark,) = artists["modes"]
        assert mark.get_xdata()[0] == pytest.approx((2.0e8 / 0.5) ** 0.5 / (2 * np.pi) / 25)
        _, artists = draw(tree, "spectrum", unit=["Hz"])
        (mark,) = artists["modes"]
        assert mark.get_xdata()[0] == pytest.approx((2.0e8 / 0.5) ** 0.5 / (2 * np.pi))


def test_orders_that_do_not_exist_are_refused_in_one_line(result: Path, tmp_path: Path) -> None:
    assert "a mesh has the same order at every speed" in refused("export", result, "-o", "-", "--unit", "order")
    text = MODES_OF_PAIR.replace("  teeth: [20, 50]\n", "").replace('input_speed: "1500 rpm"', "mesh_frequency: 3000.0")
    succeeds("respond", written(tmp_path, text), "-o", tmp_path / "r.h5", "-q")
    assert "the speed of the input shaft is not known" in refused("info", tmp_path / "r.h5", "--unit", "order")


def test_info_shows_orders_of_meshes_and_frequencies_in_the_unit_asked_for(tmp_path: Path) -> None:
    config = written(tmp_path, MODES_OF_PAIR)
    shown = json.loads(ran("info", config, "--unit", "Hz", "--json").stdout)
    assert shown["meshes"][0]["order"] == 20
    assert shown["modes"][0]["natural_frequency"] == pytest.approx((2.0e8 / 0.5) ** 0.5 / (2 * np.pi))
    plain = json.loads(ran("info", config, "--json").stdout)
    for one, other in zip(plain["tongues"], shown["tongues"], strict=True):
        assert one["center_frequency"] == pytest.approx(2 * np.pi * other["center_frequency"])
        for edge, shown_edge in zip(one["boundary_frequency"], other["boundary_frequency"], strict=True):
            assert edge == (None if shown_edge is None else pytest.approx(2 * np.pi * shown_edge))
    refused("info", config, "--unit", "order")


def test_dangerous_speeds_in_another_unit_are_the_same_speeds(tmp_path: Path) -> None:
    config = written(tmp_path, GEARBOX)
    rpm, hertz = (
        json.loads(ran("info", config, *unit, "--json").stdout)["dangerous"] for unit in ([], ["--unit", "Hz"])
    )
    assert rpm["range"] == pytest.approx([20000, 80000])
    assert hertz["range"] == pytest.approx([20000 / 60, 80000 / 60])
    assert rpm["scale"] / hertz["scale"] == pytest.approx(1 / 60)
