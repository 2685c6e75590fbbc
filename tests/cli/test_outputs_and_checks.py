"""Many configurations at once, quiet commands, names of outputs, bytes that a date does not change."""

import csv
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner
from scenes import TRAIN, ran, refused, scene_text, succeeds, written

import gearstab as gs
from gearstab.cli import group
from gearstab.errors import OutputError, SettingError
from gearstab.results.export import safe
from gearstab.results.provenance import now

PAIR = scene_text("outputs_and_checks")
BAD = PAIR.replace("epsilon: 0.3", "epsilon: much")


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("result")
    succeeds("sweep", written(folder, PAIR), "-o", folder / "out.h5", "-q")
    return folder / "out.h5"


def test_check_takes_many_files_and_standard_input(tmp_path: Path) -> None:
    good, bad = written(tmp_path, PAIR, "good.yaml"), written(tmp_path, BAD, "bad.yaml")
    done = CliRunner().invoke(group, ["check", str(bad), str(good), "-"], input=TRAIN)
    assert done.exit_code == 2
    assert done.stdout.splitlines() == [
        f"{good}: valid gear_pair; mesh_frequency (5) = 5 points; methods floquet, boundaries",
        "standard input: valid two_stage",
    ]
    assert done.stderr.startswith(f"{bad}:6: system.meshes.0.epsilon: must be a number")
    done = CliRunner().invoke(group, ["check", "-", str(good), "--json"], input=BAD)
    assert done.exit_code == 2
    first, second = json.loads(done.stdout)
    assert (first["file"], first["valid"], first["problems"][0]["line"]) == ("standard input", False, 6)
    assert (second["file"], second["valid"]) == (str(good), True)
    assert json.loads(ran("check", good, "--json").stdout)["valid"]
    assert ran("check").exit_code == 2


@pytest.mark.parametrize("words", [["plot", "-o", "a.png"], ["plot", "-o", "b.svg"], ["export", "-o", "a.csv"]])
def test_quiet_commands_say_nothing(result: Path, words: list[str], tmp_path: Path) -> None:
    command, option, name = words
    done = ran(command, result, option, tmp_path / name, "-q")
    assert (done.exit_code, done.output) == (0, "")
    assert (tmp_path / name).stat().st_size > 0


def test_an_output_without_an_ending_is_one_line(result: Path, tmp_path: Path) -> None:
    said = refused("plot", result, "-o", tmp_path / "figure")
    assert said == f"{tmp_path / 'figure'}: the name of a figure needs an ending; use .png, .pdf, .svg or .html\n"
    with pytest.raises(OutputError, match=r"model: the name of a model needs an ending; use \.mat or \.npz$"):
        gs.export_matrices(gs.build(written(tmp_path, PAIR)), tmp_path / "model")


def test_a_page_of_one_axis_is_one_line(result: Path, tmp_path: Path) -> None:
    done = ran("plot", result, "-o", tmp_path / "page.html")
    assert (done.exit_code, len(done.output.splitlines())) == (2, 1)
    assert "needs two axes with several values; there is mesh_frequency (5)" in done.output


@pytest.mark.parametrize("text", ["=1+1", "+cmd", "-2w1", "@SUM(A1)", "\t=1", "w1", "2w1", ""])
def test_no_text_of_a_table_is_a_formula(text: str) -> None:
    assert safe(text).lstrip("'") == text
    assert not safe(text).startswith(("=", "+", "-", "@", "\t", "\r"))


def test_labels_of_cases_are_safe_in_tables(tmp_path: Path) -> None:
    cases = "case: [{label: '=1+1', epsilon: 0.2}, {label: plain, epsilon: 0.3}]"
    config = written(tmp_path, PAIR.replace("sweep: {", f"sweep: {{{cases}, "))
    succeeds("sweep", config, "-o", tmp_path / "out.h5", "-q")
    succeeds("export", tmp_path / "out.h5", "-o", tmp_path / "out.csv")
    with (tmp_path / "out.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert {row["case"] for row in rows} == {"'=1+1", "plain"}
    # Negative numbers stay numbers.
    assert min(float(row["growth_rate"]) for row in rows) < 0


def test_a_given_date_makes_equal_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86400")
    config = written(tmp_path, PAIR)
    for name in "ab":
        succeeds("sweep", config, "-o", tmp_path / f"{name}.h5", "-q")
        for ending in ("png", "svg", "pdf"):
            succeeds("plot", tmp_path / f"{name}.h5", "-o", tmp_path / f"{name}.{ending}", "--dpi", "50")
    for ending in ("h5", "png", "svg", "pdf"):
        assert (tmp_path / f"a.{ending}").read_bytes() == (tmp_path / f"b.{ending}").read_bytes(), ending
    assert json.loads(ran("info", tmp_path / "a.h5", "--json").output)["provenance"]["created"] == (
        "1970-01-02T00:00:00+00:00"
    )
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "yesterday")
    with pytest.raises(SettingError, match=r"^SOURCE_DATE_EPOCH is 'yesterday'; it is a number of seconds since 1970$"):
        now()


@pytest.mark.parametrize("where", ["entry", "matrix", "axis", "rotor", "assembly"])
def test_masked_entries_are_refused(where: str) -> None:
    masked = np.ma.array([[1.0, 0.0], [0.0, 2.0]], mask=[[False, False], [False, True]])
    mesh = {"direction": [1.0, 1.0], "mean_stiffness": 1.0, "epsilon": 0.1, "contact_ratio": 1.5}
    system = {"kind": "matrices", "mass": np.eye(2), "stiffness": np.eye(2), "meshes": [mesh]}
    made = {
        "entry": lambda: gs.load({"system": system | {"mass": masked}}),
        "matrix": lambda: gs.from_matrices(np.eye(2), masked, meshes=[mesh]),
        "rotor": lambda: gs.from_ross(SimpleNamespace(K=lambda speed: masked), [mesh]),
        "assembly": lambda: gs.from_opentorsion(
            SimpleNamespace(dofs=2, gear_elements=None, elastic_gear_elements=None, K=masked), [mesh]
        ),
        "axis": lambda: gs.load({"system": system, "sweep": {"mesh_frequency": masked[1]}, "methods": {"floquet": {}}}),
    }
    with pytest.raises(ValueError, match="masked entries, which have no value"):
        made[where]()
    with pytest.raises(ValueError, match="mesh frequencies must be positive numbers"):
        gs.floquet({"system": system}, masked[1] + 1.0)
    # A mask that hides nothing is none.
    assert gs.load({"system": system | {"mass": np.ma.array(np.eye(2))}}).kind == "matrices"


def test_the_rotor_of_a_wind_turbine_is_no_doubt(tmp_path: Path) -> None:
    heavy = PAIR.replace("equivalent_mass: 1.0", "equivalent_mass: 8.0e+7").replace(
        "stiffness: 1.0", "stiffness: 1.0e+9"
    )
    done = ran("check", written(tmp_path, heavy))
    assert (done.exit_code, done.stderr) == (0, "")
    done = ran("check", written(tmp_path, heavy.replace("8.0e+7", "8.0e+11")))
    assert "system.equivalent_mass: 8e+11 kg is far from what gears have" in done.stderr
