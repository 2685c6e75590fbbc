"""The page that leads from a drawing to a report: its file is valid, its commands run, its numbers are right."""

import json
import re
import shlex
from fractions import Fraction
from pathlib import Path

import pytest
from scenes import DOCS, ran

PAGE = (DOCS / "guide" / "drivetrain.md").read_text()
(CONFIG,) = re.findall(r"^```yaml\n(.*?)^```$", PAGE, re.M | re.S)
COMMANDS = "".join(re.findall(r"^```sh\n(.*?)^```$", PAGE, re.M | re.S)).splitlines()


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "winch.yaml").write_text(CONFIG)
    return tmp_path


@pytest.mark.slow  # half a minute; a reducer goes the same way in test_walks.py
def test_the_walk_from_the_drawing_to_the_report(folder: Path) -> None:
    for line in COMMANDS:
        done = ran(*shlex.split(line)[1:])
        assert done.exit_code == 0, line
    assert {line.split()[1] for line in COMMANDS} == {"check", "info", "sweep", "plot", "report"}
    assert all((folder / name).stat().st_size > 10_000 for name in ("map.png", "campbell.png", "winch.html"))
    assert "Stable in the whole operating range" in (folder / "winch.html").read_text()


def test_the_numbers_of_the_page(folder: Path) -> None:
    """Willis: a pair 21/64, a set 24/96 whose ring is held."""
    pair, carrier = Fraction(-21, 64), Fraction(24, 24 + 96)
    drum, sun = 1500 * abs(pair) * carrier, abs(pair)
    assert f"{float(drum):.2f} rpm at the drum" in PAGE
    of_set = 24 * sun * (1 - carrier)
    assert f"{float(of_set * 25):.1f} Hz" in PAGE
    assert f"{Fraction(21) / of_set} times as" in PAGE.replace("\n", " ")
    meshes = {mesh["name"]: mesh for mesh in json.loads(ran("info", "winch.yaml", "--json").stdout)["meshes"]}
    first = Fraction(meshes["first"]["frequency_ratio"]) / Fraction(meshes["set.sun.1"]["frequency_ratio"])
    assert first == Fraction(21) / of_set


@pytest.mark.parametrize(
    ("right", "wrong"), [("teeth: 96", "teeth: 97"), ("held: ring, ", "")], ids=["assembly", "nothing held"]
)
def test_the_slips_of_the_page(folder: Path, right: str, wrong: str) -> None:
    (folder / "winch.yaml").write_text(CONFIG.replace(right, wrong))
    done = ran("check", "winch.yaml")
    assert done.exit_code == 2
    (line,) = done.stderr.splitlines()
    assert line in [own.strip() for own in PAGE.splitlines()], line
