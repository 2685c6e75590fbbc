"""The bar of a sweep: it moves before the first block is done, and then says how far the sweep is."""

from __future__ import annotations

from gearstab.sweep.bar import Bar


def test_the_bar_moves_before_the_first_block_is_done() -> None:
    bar = Bar(lambda text: None)
    bar.begin("floquet", 100, 0)
    bar.advance(0, 0, 0)
    assert bar._progress is not None
    (task,) = bar._progress.tasks
    try:
        # Without a total rich lets the bar run to and fro.
        assert task.total is None
        assert bar._progress.columns[1].render(task).total is None
        bar.advance(25, 5, 0)
        assert (task.total, task.completed) == (100, 25)
        bar.begin("boundaries", 10, 4)
        assert bar._progress.tasks[1].percentage == 40
    finally:
        bar.end()
