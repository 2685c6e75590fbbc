"""The forecast of what a response costs: said before it begins, by counts that were calibrated."""

import time
from math import tau
from pathlib import Path

import pytest
from scenes import ROOT, scene_text, succeeds
from systems import train

from gearstab.config import load
from gearstab.response.command import computed, effort

CONFIGS = ROOT / "configs"
SMOOTH = scene_text("respond_effort_smooth")
CASES = {
    "history": (CONFIGS / "lin_parker_2002" / "fig9a.yaml", "respond.cycles=9000"),
    "a long period": (CONFIGS / "lin_parker_2002" / "fig9a.yaml", 'system.tooth_ratio="101/97"'),
    "steady state": (CONFIGS / "response" / "two_stage_steady.yaml", 'system.tooth_ratio="401/397"'),
    "a gearbox": (CONFIGS / "kuria_kihiu_2008" / "steady.yaml", "respond.samples_per_cycle=20"),
    "smooth waves": (Path("smooth.yaml"), "respond.cycles=4000"),
    "smooth waves, steady": (Path("smooth.yaml"), "respond={mesh_frequency: 0.5, steady_state: true}"),
    "run-up": (CONFIGS / "response" / "run_up.yaml", "title=A"),
    "smooth run-up": (Path("smooth.yaml"), "respond={mesh_frequency: 0.5, ramp: {to: 2.0, rate: 0.001}}"),
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "smooth.yaml").write_text(SMOOTH)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def forecast(monkeypatch: pytest.MonkeyPatch, path: Path, option: str) -> tuple[float, float]:
    """Seconds of the forecast, and those that the processor took."""
    found: list[float] = []

    def said(seconds: float, why: str) -> str | None:
        found.append(seconds)
        return why

    monkeypatch.setattr(effort, "warning", said)
    config, told = load(path, [option], needs=("respond",)), []
    start = time.process_time()
    computed(config, told.append)
    seconds = time.process_time() - start
    assert len(told) == len(found) == 1
    return found[0], seconds


SHORT = {
    "history": (CASES["history"][0], "respond.cycles=20"),
    "steady state": (CASES["steady state"][0], "title=A"),
    "smooth waves": (
        CASES["smooth waves"][0],
        "respond={mesh_frequency: 5, cycles: 2, initial: {velocity: [1, 0, 0]}}",
    ),
    "run-up": (CASES["run-up"][0], "respond.samples_per_cycle=5"),
}


@pytest.mark.parametrize("name", SHORT)
def test_it_is_said_where_it_is_long(folder: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    path, option = SHORT[name]
    for limit, quiet, told in ((20.0, [], False), (1e-9, [], True), (1e-9, ["-q"], False)):
        monkeypatch.setattr(effort, "LONG", limit)
        done = succeeds("respond", path, "--set", option, "-o", "out.h5", *quiet)
        assert ("note: this takes some " in done.stderr) is told


@pytest.mark.parametrize(("cycles", "samples"), [(50_000, 100), (1000, 5000)])
def test_more_work_takes_longer_in_proportion(monkeypatch: pytest.MonkeyPatch, cycles: int, samples: int) -> None:
    """A long history of few states is nearly all samples."""
    found: list[float] = []
    monkeypatch.setattr(effort, "warning", lambda seconds, why: found.append(seconds))
    for number, each in ((1000, 100), (cycles, samples)):
        effort.linear_motion(train(), 1.0, number * tau, each)
    assert found[1] / found[0] == pytest.approx(50, rel=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_it_is_right_within_a_factor(folder: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """A factor of two on the machine of its calibration, alone; others, and those under load, may be twice as slow."""
    said, took = forecast(monkeypatch, *CASES[name])
    assert 1 / 4 < said / took < 4
