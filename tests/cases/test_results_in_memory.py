"""Results held in memory, written by other programs, or with nothing in them."""

import runpy
from pathlib import Path

import numpy as np
import pytest
from scenes import ran

from gearstab.plots import draw
from gearstab.results import open_result

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


def test_a2_the_diagram_of_a_sweep_without_a_region_is_drawn(tmp_path: Path) -> None:
    out = tmp_path / "a2.h5"
    assert ran("sweep", CASES / "a2_campbell_no_region.yaml", "-o", out, "-q").exit_code == 0
    with open_result(out) as tree:
        assert tree["boundaries"].sizes["tongue"] == 0
        (panel,) = draw(tree, "campbell", dpi=50)[1]["panels"]
    # The natural frequency at 1 and three orders that meet it, with nothing that grows.
    assert [line.get_ydata()[0] for line in panel["modes"]] == [pytest.approx(1.0, abs=1e-12)]
    assert len(panel["orders"]) >= 3
    assert not any(mark for mark in panel["regions"].values())
    assert panel["bands"] is None


def test_plot_zero_size_a_run_that_turns_back_at_once_is_drawn(tmp_path: Path) -> None:
    out = tmp_path / "pair.h5"
    assert ran("respond", CASES / "plot_zero_size.yaml", "-o", out).exit_code == 0
    done = ran("plot", out, "-o", tmp_path / "pair.png")
    assert done.exit_code == 0, done.output
    with open_result(out) as tree:
        assert (np.diff(tree["response"]["cycle"]) < 0).all()
        _, artists = draw(tree, dpi=50)
        assert artists["deflection"] is not None
        samples = tree["response"].sizes["time"]
        assert len(artists["deflection"].get_xdata()) == samples == 126
