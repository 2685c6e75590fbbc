"""Valid values that are hardly meant: one line on standard error, the same exit code, nothing for sensible models."""

from pathlib import Path

import pytest
from scenes import CONFIGURATIONS, ran, scene_text, succeeds, table, written

from gearstab.config import load

GEARBOX = scene_text("doubts_gearbox")
PAIR = scene_text("doubts_pair")
DIMENSIONLESS = scene_text("doubts_dimensionless")


def doubts(folder: Path, text: str, *overrides: str) -> list[tuple[str, str]]:
    path = written(folder, text, "scene.yaml")
    return [(doubt.path, f"{doubt.message}; {doubt.hint}") for doubt in load(path, overrides).doubts]


SLIPS = [
    pytest.param(scene["scene"], slip, id=" ".join(slip["set"])[:50])
    for scene in table("doubts")["scene"]
    for slip in scene["doubts"]
]


@pytest.mark.parametrize(("scene", "slip"), SLIPS)
def test_slips_are_named_with_what_was_likely_meant(tmp_path, scene, slip):
    ((place, message),) = doubts(tmp_path, scene_text(scene), *slip["set"])
    assert place == slip["path"]
    assert slip["says"] in message


@pytest.mark.parametrize("text", [GEARBOX, PAIR, DIMENSIONLESS], ids=["gearbox", "pair", "dimensionless"])
def test_sensible_models_are_silent(tmp_path, text):
    assert doubts(tmp_path, text) == []


@pytest.mark.parametrize("units", [[], ["units=none"]], ids=["unsaid", "said"])
def test_models_without_units_are_silent(tmp_path, units):
    """Whether they say that they have none or not: no gear's mesh is as soft as 1 N/m."""
    text = DIMENSIONLESS.replace(
        "methods:", "respond: {mesh_frequency: 1, cycles: 3, initial: {velocity: [1]}}\nmethods:"
    )
    assert doubts(tmp_path, text, *units, "equivalent_mass=1.0e+8") == []


MATRICES = scene_text("doubts_matrices")


def test_matrices_are_judged_by_their_diagonal(tmp_path):
    """Rounding beside the diagonal is no mass, and a rotation has an inertia, in kg m^2."""
    assert doubts(tmp_path, MATRICES) == []
    ((place, message),) = doubts(tmp_path, MATRICES, "coordinate_units=m")
    assert place == "system.mass.1.1"
    assert "3e-09 kg is far" in message


@pytest.mark.parametrize("path", CONFIGURATIONS, ids=lambda p: p.stem)
def test_the_configurations_of_the_repository_are_silent(path):
    assert load(path).doubts == ()


COMMANDS = [
    ["check"],
    ["info"],
    ["sweep", "-o", "out.h5", "-j", "1"],
    ["sweep", "--dry-run"],
    ["respond", "-o", "r.h5"],
]


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_commands_say_it_on_standard_error(tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    Path("scene.yaml").write_text(PAIR.replace("80 um", "80"))
    name, *rest = command
    done = succeeds(name, "scene.yaml", *rest)
    said = [line for line in done.stderr.splitlines() if line.startswith("warning: ")]
    (line,) = [line for line in said if "backlash" in line and "scene.yaml:6: " in line]
    assert '"80 um"' in line
    assert "warning: scene" not in done.stdout
    if name in ("sweep", "respond"):
        quiet = ran(name, "scene.yaml", *rest, "-q")
        assert "warning: scene" not in quiet.stderr


EQUAL = [
    "sweep.epsilon={start: 0.1, stop: 0.1, num: 3}",
    "sweep.epsilon=[0.1, 0.2, 0.1]",
    "sweep.mesh_frequency=[2, 2]",
]


@pytest.mark.parametrize("kind", [[], ["--kind", "map"], ["--kind", "curve"]], ids=["default", "map", "curve"])
@pytest.mark.parametrize("override", EQUAL)
def test_results_with_equal_values_on_an_axis_are_drawn(tmp_path, override, kind):
    """A figure or a line that says what it needs; no warning of matplotlib's, which would be an error here."""
    path, out = written(tmp_path, PAIR, "scene.yaml"), tmp_path / "out.h5"
    succeeds("sweep", path, "-o", out, "-j", "1", "--set", override)
    drawn = ran("plot", out, "-o", tmp_path / "a.png", *kind)
    assert drawn.exit_code in ((0, 2) if kind else (0,)), drawn.output
    assert drawn.exception is None or isinstance(drawn.exception, SystemExit)
