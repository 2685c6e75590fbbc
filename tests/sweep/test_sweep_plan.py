"""The division of a grid: every point in one block, blocks of a useful size, the same on every machine."""

from __future__ import annotations

from dataclasses import replace
from math import ceil, prod

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import CONFIGS, opened, scene_text, succeeds

from gearstab.config import load
from gearstab.errors import UserError
from gearstab.sweep import plan
from gearstab.sweep import progress as room
from gearstab.sweep.plan import FEW, LONGEST, MOST, Layout, chunk_shape, shared_points
from gearstab.sweep.progress import Bar

FIG3 = CONFIGS / "lin_parker_2002" / "fig3.yaml"
FLOQUET = next(layout.method for layout in plan(load(FIG3)).layouts if layout.method.name == "floquet")

shapes = st.lists(st.integers(1, 9), min_size=0, max_size=4).map(tuple)


@given(shapes, st.integers(1, 200), st.data())
def test_blocks_cover_every_point_once(shape: tuple[int, ...], wanted: int, data: st.DataObject) -> None:
    inner = data.draw(st.sampled_from([None, *range(len(shape))]))
    chunk = chunk_shape(shape, inner, wanted)
    assert prod(chunk) <= max(wanted, 1)
    layout = Layout(FLOQUET, tuple("abcd"[: len(shape)]), shape, chunk, 1.0)
    hits = np.zeros(shape, dtype=int)
    blocks = list(layout.blocks())
    for number, block in enumerate(blocks):
        assert block.number == number
        assert all(s % c == 0 for s, c in zip(block.start, chunk, strict=True))
        hits[tuple(slice(s, s + n) for s, n in zip(block.start, block.shape, strict=True))] += 1
    assert np.all(hits == 1)
    assert len(blocks) == layout.count


@given(st.integers(1, 10**6), st.integers(1, 10**6))
def test_a_long_axis_is_cut_into_nearly_equal_pieces(size: int, wanted: int) -> None:
    (chunk,) = chunk_shape((size,), 0, wanted)
    pieces = ceil(size / chunk)
    assert pieces == ceil(size / wanted)
    assert chunk * pieces - size < pieces


def layouts(*overrides: str) -> dict[str, Layout]:
    found = plan(load(FIG3, overrides))
    return {layout.method.name: layout for layout in found.layouts}


def test_a_small_map_is_one_block_and_methods_without_frequency_have_none_of_it() -> None:
    found = layouts()
    assert found["floquet"].shape == found["floquet"].chunk == (1000, 101)
    assert found["perturbation"].shape == (101,)
    assert found["floquet"].count == 1


def test_large_maps_have_blocks_of_whole_frequency_axes() -> None:
    layout = layouts("sweep.mesh_frequency.num=2000", "sweep.epsilon.num=100000")["floquet"]
    assert layout.chunk[0] == 2000
    assert MOST / 2 < prod(layout.chunk) <= MOST


def test_a_very_long_frequency_axis_is_divided() -> None:
    layout = layouts("sweep.mesh_frequency.num=50000000")["floquet"]
    assert layout.chunk[1] == 1
    assert MOST / 2 < layout.chunk[0] <= MOST


def test_costly_points_make_small_blocks() -> None:
    plain = layouts("sweep.epsilon.num=1000")["floquet"]
    exact = layouts("sweep.epsilon.num=1000", "methods.floquet.exponents=true")["floquet"]
    assert prod(exact.chunk) < prod(plain.chunk) / 2


def test_costly_rows_share_their_preparation_and_a_few_are_divided_for_many_processors() -> None:
    many = plan(load(CONFIGS / "kuria_kihiu_2008" / "map.yaml")).layouts[0]
    assert (many.shape, many.chunk) == ((500, 20), (500, 1))
    few = plan(load(CONFIGS / "kuria_kihiu_2008" / "map_exact.yaml")).layouts[0]
    assert few.shape == (81, 5)
    assert FEW <= few.count <= 2 * FEW


@given(st.integers(1, 10**7), st.integers(1, 1000), st.floats(1, 1e12))
def test_points_that_are_computed_together_are_neither_too_many_nor_too_dear(
    length: int, rows: int, cost: float
) -> None:
    points = shared_points(length, rows, cost)
    assert 1 <= points <= min(length, MOST)
    assert points == 1 or points * cost < LONGEST + cost
    assert rows >= FEW or points <= ceil(length * rows / FEW)


def test_what_changes_numbers_changes_the_digest_of_parts() -> None:
    base = plan(load(FIG3))
    assert base.digest == plan(load(FIG3)).digest
    assert base.digest == plan(load(FIG3, ["title=Another"])).digest
    for other in ("sweep.epsilon.num=102", "system.input_shaft_stiffness=0.6", "methods.perturbation.harmonics=4"):
        assert base.digest != plan(load(FIG3, [other])).digest
    # Blocks of another division would not be chunks of the result.
    first, *rest = base.layouts
    halved = replace(first, chunk=tuple((size + 1) // 2 for size in first.chunk))
    assert base.digest != replace(base, layouts=(halved, *rest)).digest


def test_an_unknown_kernel_is_the_users_mistake(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GEARSTAB_KERNEL", "fortran")
    with pytest.raises(UserError, match="fortran"):
        plan(load(FIG3))


# --- the bar of a sweep: it moves before the first block is done, and then says how far the sweep is


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


# --- cases and ties that set the mesh frequency: points of operation instead of a grid


SYSTEM = scene_text("operating_points")
METHODS = "methods: {floquet: {}}\n"


def growth(folder, sweep, methods=METHODS):
    (folder / "points.yaml").write_text(SYSTEM + f"sweep:\n  {sweep}\n" + methods)
    target = folder / "points.h5"
    arguments = ["sweep", str(folder / "points.yaml"), "-o", str(target), "--overwrite", "-q"]
    succeeds(*arguments)
    return opened(target)["floquet"].to_dataset()


def test_points_agree_with_the_grid(tmp_path):
    cases = "[{label: A, mesh_frequency: 4.2, phasing: 0}, {label: B, mesh_frequency: 4.2, phasing: 0.4}]"
    points = growth(tmp_path, f"case: {cases}\n  damping_ratio: [0, 0.01]")
    assert points["growth_rate"].dims == ("case", "damping_ratio")
    np.testing.assert_array_equal(points["mesh_frequency"], [4.2, 4.2])
    grid = growth(tmp_path, "phasing: [0, 0.4]\n  mesh_frequency: [2.0, 4.2]\n  damping_ratio: [0, 0.01]")
    # Stacks of another shape, whose products may be summed in another order.
    same = grid["growth_rate"].sel(mesh_frequency=4.2)
    np.testing.assert_allclose(points["growth_rate"], same, rtol=1e-12, atol=1e-13)


def test_tied_to_another_parameter(tmp_path):
    both = growth(tmp_path, "run: {targets: [mesh_frequency, phasing], values: [[2.0, 4.2, 5.0], [0.0, 0.0, 0.4]]}")
    grid = growth(tmp_path, "phasing: [0, 0.4]\n  mesh_frequency: [2.0, 4.2, 5.0]")["growth_rate"]
    np.testing.assert_allclose(both["growth_rate"], [grid[0, 0], grid[0, 1], grid[1, 2]], rtol=1e-12, atol=1e-13)
