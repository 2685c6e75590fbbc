"""The page on extending the package names what is there."""

from __future__ import annotations

import re

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
