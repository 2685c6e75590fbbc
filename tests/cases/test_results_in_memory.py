"""Results held in memory, written by other programs, or with nothing in them."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest
from scenes import ran

CASES = Path(__file__).parent


def test_d2_a_result_that_xarray_saved_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(CASES / "d2_to_netcdf.py"))
    for words in (["info", "pair.nc"], ["plot", "pair.nc"], ["export", "pair.nc", "-o", "pair.csv"]):
        done = ran(*words)
        assert (done.exit_code, "ResultError" in done.output) == (0, False), done.output
    # 21 mesh frequencies and three values of epsilon, with a line of names.
    assert len((tmp_path / "pair.csv").read_text().splitlines()) == 64
    assert (tmp_path / "pair.png").read_bytes().startswith(b"\x89PNG")
