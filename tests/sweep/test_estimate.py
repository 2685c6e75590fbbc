"""The time that a dry run foretells, by a clock that goes as the blocks say."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import pytest
from sweep_faults import CONFIG, faulty

from gearstab.sweep import Plan, estimate
from gearstab.sweep.plan import Block


@dataclass
class Clock:
    """Every block takes so long, and so long more for each of its points."""

    block: float
    point: float
    now: float = 0.0
    blocks: int = 0

    def process_time(self) -> float:
        return self.now

    def compute(self, plan: Plan, block: Block) -> Clock:
        self.now += self.block + self.point * block.points
        self.blocks += 1
        return self

    def size(self) -> int:
        return 1


@pytest.mark.parametrize(
    ("block", "point", "most"),
    [
        (0.0, 0.5e-3, 7),  # grows samples until they are long enough
        (6.0, 1.0, 2),  # shares work among the points of a block: 8 blocks of 3
        (0.0, 8.0, 2),
        (8.0, 0.0, 2),
    ],
)
def test_the_time_is_that_of_all_blocks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, block: float, point: float, most: int
) -> None:
    (tmp_path / "train.yaml").write_text(CONFIG)
    plan, clock = faulty(tmp_path / "train.yaml"), Clock(block, point)
    monkeypatch.setattr(estimate, "time", clock)
    monkeypatch.setattr(estimate, "compute", clock.compute)
    (found,) = estimate.estimate(plan, 1).methods
    assert found.work == pytest.approx(8 * (block + 3 * point), rel=1e-12)
    assert clock.blocks <= most


def test_samples_of_less_than_a_block_tell_what_its_points_share(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "train.yaml").write_text(CONFIG)
    plan, clock = faulty(tmp_path / "train.yaml"), Clock(0.2, 0.001)
    large = replace(plan, layouts=(replace(plan.layouts[0], shape=(40, 500), chunk=(1, 500)),))
    monkeypatch.setattr(estimate, "time", clock)
    monkeypatch.setattr(estimate, "compute", clock.compute)
    (found,) = estimate.estimate(large, 1).methods
    assert found.work == pytest.approx(40 * (0.2 + 500 * 0.001), rel=1e-9)
    assert clock.now < 1.0
