"""Figures and their stored references: every figure has one, and a number or a picture that changes is noticed."""

import copy
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from ruamel.yaml import YAML
from scenes import CONFIGS, CONFIGURATIONS, DATA, ROOT

STORED = DATA / "figures"
QUICK = "lin_parker_2002/fig3"
"""A figure of a few seconds, with growth rates, first-order and exact boundaries."""


@pytest.fixture(scope="module")
def scripts() -> Iterator[Path]:
    """The folder of the scripts on the path."""
    folder = ROOT / "scripts"
    sys.path.insert(0, str(folder))
    yield folder
    sys.path.remove(str(folder))


@pytest.fixture(scope="module")
def figures(scripts: Path) -> ModuleType:
    import figures

    return figures


@pytest.fixture(scope="module")
def references(scripts: Path) -> ModuleType:
    import references

    return references


@pytest.fixture(scope="module")
def made(figures: ModuleType, tmp_path_factory: pytest.TempPathFactory):
    """A figure made now."""
    (figure,) = figures.chosen([QUICK], tmp_path_factory.mktemp("results"))
    figures.make(figure)
    return figure


def configured() -> set[str]:
    """The configurations that are figures: what is swept or responds; benchmarks have their numbers in the file."""
    paths = [path for path in CONFIGURATIONS if not YAML(typ="safe").load(path.read_text()).get("design")]
    return {path.relative_to(CONFIGS).with_suffix("").as_posix() for path in paths}


def test_every_reference_has_a_figure(references: ModuleType, tmp_path: Path) -> None:
    """A figure without reference differs in `make check-figures`, with the command that writes one."""
    stored = {path.relative_to(STORED).with_suffix("").as_posix() for path in STORED.rglob("*.json")}
    assert stored <= configured()
    assert len(stored) > 50
    (line,) = references.differences("none/such", tmp_path, [])
    assert "--update none/such" in line


def test_references_are_small_and_hold_numbers() -> None:
    for path in STORED.rglob("*.json"):
        assert path.stat().st_size < 40_000, path
        reference = json.loads(path.read_text())
        cells = [cell for entry in reference["variables"].values() for cell in entry.get("cells", [])]
        assert any(cell is not None for cell in cells), path
        assert reference["pictures"], path


def test_a_figure_agrees_with_its_reference(made, references: ModuleType) -> None:
    assert references.differences(made.name, made.result, list(made.pictures)) == []


VARIABLES = ("floquet/growth_rate", "boundaries/boundary_frequency", "perturbation/boundary_frequency")


@pytest.mark.parametrize("name", VARIABLES)
def test_a_number_that_changes_everywhere_is_noticed(made, references: ModuleType, name: str) -> None:
    """By a thousandth: less than a line in a picture is wide."""
    now = references.of_result(made.result)
    then = copy.deepcopy(now)
    then[name]["cells"] = [None if cell is None else 1.001 * cell for cell in then[name]["cells"]]
    assert references.of_variables(now, now) == []
    (line,) = references.of_variables(now, then)
    assert line.startswith(f"{name}: ")


@pytest.mark.parametrize("name", VARIABLES)
def test_a_change_between_the_stored_cells_is_noticed(made, references: ModuleType, name: str) -> None:
    """The mean sees it."""
    now = references.of_result(made.result)
    then = copy.deepcopy(now)
    then[name]["mean"] *= 1.0002
    (line,) = references.of_variables(now, then)
    assert line.startswith(f"{name}: mean")


def test_points_that_change_sides_are_noticed(made, references: ModuleType) -> None:
    now = references.of_result(made.result)
    then = copy.deepcopy(now)
    counts = then["floquet/stable"]["counts"]  # of 101,000, of which ten may change
    counts["0"], counts["1"] = counts["0"] + 20, counts["1"] - 20
    (line,) = references.of_variables(now, then)
    assert line.startswith("floquet/stable: counts")


def test_rounding_is_no_difference(made, references: ModuleType) -> None:
    """Another processor's sums differ in the last digits."""
    now = references.of_result(made.result)
    then = copy.deepcopy(now)
    rng = np.random.default_rng(1)
    for entry in then.values():
        if "cells" in entry:
            entry["cells"] = [c if c is None else c * (1 + 1e-9 * rng.standard_normal()) for c in entry["cells"]]
    assert references.of_variables(now, then) == []


def test_what_is_gone_or_new_is_noticed(made, references: ModuleType) -> None:
    now = references.of_result(made.result)
    less = {name: entry for name, entry in now.items() if name != VARIABLES[0]}
    assert references.of_variables(less, now) == [f"{VARIABLES[0]} is gone"]
    assert references.of_variables(now, less) == [f"{VARIABLES[0]} is new"]


def test_a_picture_that_changes_is_noticed(made, figures: ModuleType, references: ModuleType, tmp_path: Path) -> None:
    (path, options), *_ = made.pictures.items()
    rows = references.of_picture(path)
    assert references.of_images("same", rows, rows) == []
    for changes in (["--no-title"], ["--kind", "boundaries"]):
        other = tmp_path / "other.png"
        figures.run(["plot", str(made.result), "-o", str(other), *options, *changes])
        assert references.of_images("other", references.of_picture(other), rows), changes


def test_the_quickest_are_chosen_within_a_time(figures: ModuleType, references: ModuleType, tmp_path: Path) -> None:
    every = figures.every(tmp_path)
    found = figures.quickest(every, 30.0)
    assert 0 < len(found) < len(every)
    assert sum(references.seconds(figure.name) for figure in found) <= 30.0
    slowest = max(references.seconds(figure.name) for figure in found)
    assert all(references.seconds(figure.name) >= slowest for figure in every if figure not in found)


def test_ci_checks_what_takes_two_minutes_and_the_workflow_all() -> None:
    assert "check-figures FIGURES='--within 120'" in (ROOT / ".ci" / "run").read_text()
    assert "figures.py --check\n" in (ROOT / ".github" / "workflows" / "ci.yml").read_text()
