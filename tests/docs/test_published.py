"""The published benchmark set: every file says where its numbers come from, all are met, and a wrong one is noticed."""

import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest
from ruamel.yaml import YAML
from scenes import CONFIGS, ROOT

FILES = sorted((CONFIGS / "benchmarks").glob("*.yaml"))
SLOW = ("auto_three_gears", "lin_parker_2002")


@pytest.fixture(scope="module")
def benchmarks() -> Iterator[ModuleType]:
    folder = str(ROOT / "scripts")
    sys.path.insert(0, folder)
    import benchmarks

    yield benchmarks
    sys.path.remove(folder)


def marked(path: Path) -> object:
    return pytest.param(path, marks=[pytest.mark.slow] if path.stem in SLOW else [], id=path.stem)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_file_says_where_its_numbers_come_from(path: Path, benchmarks: ModuleType) -> None:
    content = benchmarks.plain(path)
    assert {"title", "source", "doi", "configuration", "cases"} <= content.keys() <= benchmarks.KEYS
    assert content["doi"] == "" or content["doi"].startswith("10.")
    assert path.read_text().startswith("# ")
    values = [value for case in content["cases"] for value in case["values"]]
    assert values
    for value in values:
        assert {"name", "of", "published", "tolerance"} <= value.keys() <= benchmarks.VALUE_KEYS
        assert value["tolerance"] > 0


@pytest.mark.parametrize("path", [marked(path) for path in FILES])
def test_published_numbers_are_met(path: Path, benchmarks: ModuleType, tmp_path: Path) -> None:
    found = benchmarks.compared(path, benchmarks.Runs(tmp_path))
    assert [row for row in found if not row.expected] == []


def edited(folder: Path, **changes: object) -> Path:
    """A benchmark with other values of its first entry, beside the configurations it refers to."""
    content = YAML(typ="safe").load((CONFIGS / "benchmarks" / "cooley_parker_2012.yaml").read_text())
    content["configuration"] = str(CONFIGS / "cooley_parker_2012" / "at_rest.yaml")
    content["cases"][0]["values"] = [content["cases"][0]["values"][0] | changes]
    path = folder / "edited.yaml"
    with path.open("w") as file:
        YAML(typ="safe").dump(content, file)
    return path


def test_a_wrong_number_is_noticed(benchmarks: ModuleType, tmp_path: Path) -> None:
    """In the last digit printed."""
    (right,) = benchmarks.compared(edited(tmp_path), benchmarks.Runs(tmp_path))
    (wrong,) = benchmarks.compared(edited(tmp_path, published=0.9297), benchmarks.Runs(tmp_path))
    assert (right.verdict, right.expected) == ("agrees", True)
    assert (wrong.verdict, wrong.expected) == ("DIFFERS", False)


def test_a_difference_that_is_expected_must_be_there(benchmarks: ModuleType, tmp_path: Path) -> None:
    (row,) = benchmarks.compared(edited(tmp_path, differs="a misprint"), benchmarks.Runs(tmp_path))
    assert not row.expected
    (row,) = benchmarks.compared(edited(tmp_path, published=0.93, differs="a misprint"), benchmarks.Runs(tmp_path))
    assert (row.verdict, row.expected) == ("differs: a misprint", True)


def test_a_number_that_is_missing_does_not_agree(benchmarks: ModuleType) -> None:
    assert not benchmarks.Row("gone", float("nan"), 1.0, 1.0).agrees


def test_unknown_keys_are_refused(benchmarks: ModuleType, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="unknown keys: publishd"):
        benchmarks.compared(edited(tmp_path, publishd=0.93), benchmarks.Runs(tmp_path))
