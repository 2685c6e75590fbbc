"""The examples of the page on Python run, one after the other as a reader would type them."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import get_args

import matplotlib.pyplot as plt
import pytest
from scenes import CONFIGS, DOCS

import gearstab as gs
from gearstab.config.document.problems import CODES, Code

PAGE = (DOCS / "api.md").read_text()
BLOCKS = re.findall(r"^```python\n(.*?)^```$", PAGE, re.M | re.S)


def test_every_example_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(CONFIGS / "lin_parker_2002", tmp_path / "configs" / "lin_parker_2002")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for block in BLOCKS:
        if "from ross" in block:  # tests/exchange/test_ross.py runs it where ROSS is installed
            continue
        exec(compile(block, "docs/api.md", "exec"), names)
    plt.close("all")
    assert (tmp_path / "map.png").stat().st_size > 10_000
    assert (tmp_path / "pair.h5").exists()


def test_every_public_function_is_on_the_page() -> None:
    assert [name for name in gs.__all__ if f"`gs.{name}(" not in PAGE and f"`gs.{name}`" not in PAGE] == []


def test_codes_of_mistakes_are_listed() -> None:
    assert dict(re.findall(r"^\| `(\w+)` \| (.*) \|$", PAGE, re.M)) == CODES
    assert set(get_args(Code)) == set(CODES)
