"""The division of a grid: every point in one block, blocks of a useful size, the same on every machine."""

from dataclasses import replace
from math import ceil, prod

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import CONFIGS

from gearstab.config import load
from gearstab.errors import UserError
from gearstab.sweep import plan
from gearstab.sweep.layout import Layout
from gearstab.sweep.plan import FEW, LONGEST, MOST, chunk_shape, shared_points

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
