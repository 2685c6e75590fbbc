"""The page on extending the package names what is there."""

import ast
import re

import pytest
from scenes import DOCS, ROOT

PAGE = (DOCS / "extending.md").read_text()


def test_every_file_that_is_named_is_there() -> None:
    named = re.findall(r"`((?:gearstab|tests|scripts|docs)/[\w/.]+)`", PAGE)
    assert len(named) > 25
    assert [path for path in named if not (ROOT / path).exists()] == []


def test_every_table_that_is_named_is_in_its_file() -> None:
    tables = re.findall(r"`([A-Z]+)`\s+in `([\w/.]+)`", PAGE)
    assert len(tables) == 5
    for table, path in tables:
        assert re.search(rf"^{table}\b.* = ", (ROOT / path).read_text(), re.MULTILINE), (table, path)


@pytest.mark.parametrize(
    ("name", "of", "table"),
    [
        ("trapezoidal", "waveforms/trapezoidal.py", "waveforms/__init__.py"),
        ("two_stage", "systems/two_stage.py", "systems/__init__.py"),
        ("surface", "plots/maps/surface.py", "plots/__init__.py"),
    ],
)
def test_what_is_there_is_known_to_its_file_and_its_table_alone(name: str, of: str, table: str) -> None:
    """As a text of its own, or by an import: so many files the next one has to touch."""
    room = ROOT / "gearstab"
    words = {name, name.title().replace("_", "")}
    knowing = set()
    for path in room.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            texts = {str(node.value)} if isinstance(node, ast.Constant) else set()
            texts |= {item.name for item in node.names} if isinstance(node, ast.ImportFrom) else set()
            if words & texts:
                knowing.add(path.relative_to(room).as_posix())
    assert knowing | {of} == {of, table}
