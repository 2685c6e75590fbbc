"""First steps: a configuration to start from, what is said without one, mistakes as JSON, completion in the shell."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scenes import TRAIN, code, ran, refused, succeeds, written

import gearstab as gs
from gearstab.cli import COMMANDS
from gearstab.config.model.reading import descriptions, field_types
from gearstab.config.schema import commented, starts
from gearstab.info.configuration import HARMONICS
from gearstab.perturbation.multiple_scales import first_order
from gearstab.sweep import plan
from gearstab.systems import KINDS

STARTS = starts()
SMALL = {"mesh_frequency": 7, "input_speed": 7, "epsilon": 2}


def test_every_kind_has_a_start() -> None:
    assert STARTS.keys() == KINDS.keys()
    listed = succeeds("init")
    assert [line.split()[0] for line in listed.stdout.splitlines()] == list(KINDS)


@pytest.mark.parametrize("kind", STARTS)
def test_a_start_is_right_and_sweeps(kind: str, tmp_path: Path) -> None:
    printed = succeeds("init", kind)
    config = written(tmp_path, printed.stdout)
    checked = ran("check", config)
    assert (checked.exit_code, checked.stderr) == (0, "")
    few = [f"sweep.{name}.num={SMALL[name]}" for name in gs.load(config).document.data["sweep"]]
    options = [word for text in few for word in ("--set", text)]
    succeeds("sweep", config, "-o", tmp_path / "out.h5", *options)
    succeeds("plot", tmp_path / "out.h5", "--dpi", "50")


@pytest.mark.parametrize("kind", STARTS)
def test_a_start_shows_what_there_is_to_see(kind: str) -> None:
    """Regions of instability lie in its range, at epsilon of its base values or of its axis."""
    config = gs.load(start_data(kind))
    low, high = plan(config).mesh_frequency_range
    found = first_order(gs.build(config, damping_ratio=0.0), HARMONICS)
    inside = (low < found.center_frequency) & (found.center_frequency < high)
    assert (inside & (found.half_width > 0) & np.isfinite(found.half_width)).any()


def start_data(kind: str) -> dict:
    start = STARTS[kind]
    sweep = {name: spec for name, (spec, _) in start.sweep.items()}
    return {"title": start.title, "system": start.system, "sweep": sweep, "methods": {"floquet": {}}}


@pytest.mark.parametrize("kind", STARTS)
def test_comments_are_the_descriptions_of_the_keys(kind: str) -> None:
    text = commented(kind)
    for name, description in descriptions(KINDS[kind]).items():
        line = next((line for line in text.splitlines() if re.match(rf"  {name}:", line)), None)
        if line is None:
            others = next(line for line in text.splitlines() if line.startswith("  # more keys: "))
            assert re.search(rf"\b{name}\b", others)
        else:
            assert description.rstrip(".") in line
    assert set(field_types(KINDS[kind])) == set(KINDS[kind].model_fields) == set(descriptions(KINDS[kind]))


@pytest.mark.parametrize(
    ("kind", "remedy"),
    [
        ("two_stages", "did you mean 'two_stage'?"),
        ("bicycle", "available: gear_pair, two_stage, planetary, gearbox, matrices"),
    ],
)
def test_an_unknown_kind_is_corrected(kind: str, remedy: str) -> None:
    assert refused("init", kind).strip() == f"there is no kind of system '{kind}'; {remedy}"


@pytest.mark.parametrize("command", ["sweep", "check", "info", "respond", "bench"])
def test_without_a_configuration_the_way_to_one_is_said(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert code(command) == 2
    said = capsys.readouterr().err
    assert "Missing argument 'CONFIG" in said
    assert "gearstab init two_stage > train.yaml" in said


@pytest.mark.parametrize("command", ["plot", "export"])
def test_without_a_result_the_way_to_one_is_said(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert code(command) == 2
    said = capsys.readouterr().err
    assert "Missing argument 'RESULT" in said
    assert "gearstab sweep train.yaml" in said


def test_a_check_as_json(tmp_path: Path) -> None:
    right = ran("check", written(tmp_path, TRAIN), "--json", "--set", "damping_ratio=3")
    found = json.loads(right.stdout)
    assert (right.exit_code, found["valid"], found["problems"]) == (0, True, [])
    assert found["summary"] == "valid two_stage"
    assert [(p["path"], p["value"]) for p in found["doubts"]] == [("system.damping_ratio", "3")]
    assert found["doubts"][0]["code"] == "unusual"
    path = written(tmp_path, TRAIN.replace("inertias: [1.0, 0.3, 4.0]", "inertias: [1.0, -0.3, 4.0]"))
    wrong = ran("check", path, "--json")
    found = json.loads(wrong.stdout)
    assert (wrong.exit_code, found["valid"], found["summary"], wrong.stderr) == (2, False, None, "")
    (problem,) = found["problems"]
    expected = {"file": str(path), "line": 4, "path": "system.inertias.1", "value": "-0.3", "code": "out_of_range"}
    assert {name: problem[name] for name in expected} == expected
    assert problem["message"]
    assert problem["hint"]


def completed(words: str, count: int) -> list[str]:
    """Words that a shell offers for the last of some words."""
    program = "from gearstab.__main__ import main; main()"
    environment = os.environ | {"_GEARSTAB_COMPLETE": "bash_complete", "COMP_WORDS": words, "COMP_CWORD": str(count)}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    return [line.split(",")[1] for line in done.stdout.splitlines()]


def test_a_shell_completes_commands_and_kinds() -> None:
    assert completed("gearstab ", 1) == list(COMMANDS)
    assert completed("gearstab sw", 1) == ["sweep"]
    assert completed("gearstab init g", 2) == ["gear_pair", "gearbox"]
    assert "--dry-run" in completed("gearstab sweep --", 2)
