"""The time that a dry run foretells, by a clock that goes as the blocks say; and that it never takes long itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import scene_text
from sweep_faults import CONFIG, faulty

from gearstab.cli.sweep import forecast as dry_run
from gearstab.interrupts import heed
from gearstab.methods import RANGE
from gearstab.sweep import Plan, forecast
from gearstab.sweep.forecast import within
from gearstab.sweep.plan import GridBlock


@dataclass
class Machine:
    """Every block takes so long, and more for each of its rows and points; at the beginning of the grid still more."""

    block: float
    point: float
    dearest: float = 1.0
    row: float = 0.0
    now: float = 0.0
    blocks: int = 0

    def thread_time(self) -> float:
        return self.now

    def compute(self, plan: Plan, block: GridBlock) -> Machine:
        place = 1 - (np.array(block.start) + 0.5 * np.array(block.shape)) / np.array(plan.layouts[0].shape)
        rows = prod(n for k, n in enumerate(block.shape) if k != plan.inner(plan.layouts[0]))
        self.now += (
            self.block + self.row * rows + self.point * block.points * (1 + (self.dearest - 1) * float(np.mean(place)))
        )
        self.blocks += 1
        return self

    def within(self, seconds: float, work: Callable[[], Any]) -> tuple[Any, float] | None:
        """The time of work that ends in time; else that of the machine is up."""
        before = self.now
        found = work()
        if self.now - before > seconds:
            self.now = before + seconds
            return None
        return found, self.now - before

    def size(self) -> int:
        return 1


@pytest.fixture
def plan(tmp_path: Path) -> Plan:
    (tmp_path / "train.yaml").write_text(CONFIG)
    return faulty(tmp_path / "train.yaml")


def on(machine: Machine, patch: pytest.MonkeyPatch) -> Machine:
    patch.setattr(forecast, "time", machine)
    patch.setattr(forecast, "compute", machine.compute)
    patch.setattr(forecast, "within", machine.within)
    return machine


@pytest.mark.parametrize(
    ("block", "point"), [(0.0, 1e-3), (0.01, 1e-3), (0.05, 0.0), (1e-4, 1e-5), (0.0, 0.2)], ids=str
)
def test_the_time_is_that_of_all_blocks(
    plan: Plan, monkeypatch: pytest.MonkeyPatch, block: float, point: float
) -> None:
    machine = on(Machine(block, point), monkeypatch)
    (found,) = forecast.estimate(plan, 1).methods
    # 8 blocks of 3 points.
    assert found.work == pytest.approx(8 * (block + 3 * point), rel=1e-9)
    assert machine.now <= forecast.BUDGET


def test_a_part_of_a_block_tells_of_all_of_it(plan: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    """Work that its points share counts once a sample: a tenth of it at the size that there is time for."""
    machine = on(Machine(0.05, 1e-3), monkeypatch)
    large = replace(plan, layouts=(replace(plan.layouts[0], shape=(40, 5000), chunk=(1, 5000)),))
    (found,) = forecast.estimate(large, 1).methods
    assert 1 <= found.work / (40 * (0.05 + 5000 * 1e-3)) < 1.1
    assert machine.now <= forecast.BUDGET


@pytest.mark.parametrize("row", [0.0, 1e-4, 0.01, 0.11], ids=str)
@pytest.mark.parametrize("chunk", [(1, 500), (7, 500), (20, 500), (1, 250)], ids=str)
def test_rows_of_mesh_frequencies_share_their_preparation(
    plan: Plan, monkeypatch: pytest.MonkeyPatch, row: float, chunk: tuple[int, int]
) -> None:
    """As in the map of a gearbox of four meshes, where 500 points take hardly longer than one."""
    on(Machine(1e-3, 5e-5, row=row), monkeypatch)
    large = replace(plan, layouts=(replace(plan.layouts[0], shape=(20, 500), chunk=chunk),))
    (found,) = forecast.estimate(large, 1).methods
    pieces = 20 * 500 // chunk[1]
    blocks = pieces / chunk[0] if pieces % chunk[0] == 0 else pieces // chunk[0] + 1
    # What a block takes besides its rows is taken for a part of theirs where no two rows are done in time.
    least, most = blocks * 1e-3, pieces * 1e-3
    rest = row * pieces + 20 * 500 * 5e-5
    assert 0.99 * (least + rest) <= found.work <= 1.01 * (most + rest)


def test_one_sample_does_not_tell_what_points_share(plan: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    on(Machine(0.6, 5e-5), monkeypatch)
    large = replace(plan, layouts=(replace(plan.layouts[0], shape=(20, 500), chunk=(1, 500)),))
    (found,) = forecast.estimate(large, 1, 0.7).methods
    assert found.seconds is None


def test_dearer_points_count(plan: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    """From the dearest to the cheapest a straight line: the average is what is found in the middle."""
    on(Machine(0.0, 1e-4, dearest=9.0), monkeypatch)
    large = replace(plan, layouts=(replace(plan.layouts[0], shape=(40, 5000), chunk=(1, 5000)),))
    (found,) = forecast.estimate(large, 1).methods
    assert found.work == pytest.approx(40 * 5000 * 1e-4 * 5, rel=0.1)


def test_a_point_that_takes_longer_than_there_is_time(plan: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    machine = on(Machine(100.0, 10.0), monkeypatch)
    found = forecast.estimate(plan, 1)
    assert found.methods[0].seconds is None
    assert found.methods[0].time == "not known (a sample took more than 6 s)"
    assert found.time == "not known: that of floquet"
    assert machine.now == pytest.approx(forecast.BUDGET)


def test_a_first_call_is_not_taken_for_the_others(plan: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    machine = on(Machine(0.0, 1e-3), monkeypatch)

    def compute(plan: Plan, block: GridBlock) -> Machine:
        machine.now += 0.3 * (machine.blocks == 0)
        return machine.compute(plan, block)

    monkeypatch.setattr(forecast, "compute", compute)
    (found,) = forecast.estimate(plan, 1).methods
    assert found.work == pytest.approx(24 * 1e-3, rel=1e-9)


class TestClock:
    def test_work_that_ends(self) -> None:
        found = within(30.0, lambda: sum(range(10**5)))
        assert found is not None
        assert found[0] == 4999950000
        assert found[1] >= 0

    def test_work_without_end_is_stopped(self) -> None:
        def endless() -> None:
            while True:
                heed()

        assert within(0.05, endless) is None

    def test_what_it_raises_is_raised(self) -> None:
        with pytest.raises(ZeroDivisionError):
            within(30.0, lambda: 1 // 0)


ENDLESS = scene_text("estimate_endless")


def test_a_search_without_end_says_so_before(tmp_path: Path) -> None:
    (tmp_path / "endless.yaml").write_text(ENDLESS)
    plan = planned(tmp_path / "endless.yaml")
    found = forecast.estimate(plan, 1, budget=0.5)
    (said,) = forecast.long_runs(plan, found)
    assert said.startswith("methods.boundaries may take very long; ")
    assert "not known (a sample took more than 0.5 s)" in dry_run(plan, found, tmp_path / "out.h5")


def test_parts_of_a_range_tell_of_all_of_it(plan: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    """A search takes 0.1 s, and 50 s for a unit of 1/Omega: far more than there is time for."""
    machine = on(Machine(1000.0, 0.0), monkeypatch)

    class Search:
        name, frequency, cost = "floquet", RANGE, lambda self: 1.0

        def once(self) -> tuple[Search, int]:
            return self, 3

        def of(self, system: object) -> Search:
            return self

        def run(self, ends: np.ndarray) -> None:
            machine.now += 0.02 + 50.0 * (1 / ends[0] - 1 / ends[1])

    layout = plan.layouts[0]
    ranges = replace(plan, layouts=(replace(layout, method=Search(), shape=(8,), chunk=(8,), dims=layout.dims[:1]),))
    low, high = ranges.mesh_frequency_range
    work = forecast._of_parts(ranges, ranges.layouts[0], forecast.Clock(5.0))
    assert work == pytest.approx(8 * 3 * (3 * 0.02 + 50.0 * (1 / low - 1 / high)), rel=1e-6)
    assert forecast._of_parts(ranges, ranges.layouts[0], forecast.Clock(0.01)) is None


def test_an_ordinary_sweep_says_nothing(tmp_path: Path) -> None:
    (tmp_path / "train.yaml").write_text(ENDLESS.replace('"999/1000"', "1").replace("0.00003", "0.35"))
    plan = planned(tmp_path / "train.yaml")
    assert forecast.long_runs(plan, forecast.estimate(plan, 1, budget=60.0)) == []


def planned(path: Path) -> Plan:
    from gearstab.config import load
    from gearstab.sweep import plan

    return plan(load(path, (), needs=("sweep", "methods")))
