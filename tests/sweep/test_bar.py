"""The bar of a sweep: it moves before the first block is done, and then says how far the sweep is."""

from __future__ import annotations

import pytest

from gearstab.sweep import progress as room
from gearstab.sweep.progress import Bar


class Clock:
    now = 0.0

    def monotonic(self) -> float:
        return self.now


def test_the_bar_goes_on_within_a_block(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the speed of the forecast, then with that so far; what is not done is never said to be."""
    clock = Clock()
    monkeypatch.setattr(room, "time", clock)
    bar = Bar(lambda text: None)
    bar.begin("boundaries", 100, 20, 40.0, 10)
    assert bar._progress is not None
    (task,) = bar._progress.tasks
    try:
        seen = []
        for clock.now in (0.0, 1.0, 3.0, 50.0):
            list(bar._progress.get_renderables())
            seen.append(task.completed)
        # 2 points a second, of which 10 come together.
        assert seen[0] == 20
        assert 21.5 < seen[1] < 22
        assert seen[1] < seen[2] < seen[3] < 30
        bar.advance(10, 0, 0)
        assert task.completed == 30
    finally:
        bar.end()


def test_the_bar_moves_before_the_first_block_is_done() -> None:
    bar = Bar(lambda text: None)
    bar.begin("floquet", 100, 0, None, 25)
    bar.advance(0, 0, 0)
    assert bar._progress is not None
    (task,) = bar._progress.tasks
    try:
        # Without a total rich lets the bar run to and fro.
        assert task.total is None
        assert bar._progress.columns[1].render(task).total is None
        bar.advance(25, 5, 0)
        assert (task.total, task.completed) == (100, 25)
        bar.begin("boundaries", 10, 4, None, 1)
        assert bar._progress.tasks[1].percentage == 40
    finally:
        bar.end()
