"""Regions of a batch arranged over tongues and rows: occurrences, flags, and where a merged region stands."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gearstab.floquet.boundaries import Boundaries
from gearstab.floquet.boundaries.names import Names, Root, coupled
from gearstab.floquet.boundaries.parts import Interval, Intervals
from gearstab.floquet.boundaries.regions import BOUNDARY_FLAGS, union
from gearstab.perturbation.tongues import Tongue

LOW, HIGH = 1.0, 10.0
FIRST, SECOND = (Tongue(1, 1, 1, "a", "primary", "2w1", 1.0), Tongue(1, 2, 1, "a", "combination", "w1+w2", 1.0))
THIRD = Tongue(2, 2, 2, "a", "secondary", "w2", 2.0)

TABLE = [
    (0, 1.0, 1.5, (FIRST,)),
    (0, 2.0, 3.0, (SECOND,)),
    (0, 4.0, 5.0, (FIRST,)),
    (1, 2.5, 4.5, (SECOND, FIRST)),
    (1, 9.0, 10.0, (THIRD,)),
]
"""Row, edges and tongues of each region."""


@pytest.fixture
def regions() -> Boundaries:
    row, lower, upper = (np.array(column) for column in list(zip(*TABLE, strict=True))[:3])
    tongues = (SECOND, FIRST, THIRD)
    owner = np.repeat(np.arange(len(TABLE)), [len(own) for *_, own in TABLE])
    member = np.array([tongues.index(tongue) for *_, own in TABLE for tongue in own])
    nothing = (np.zeros((0, 2)),) * 2
    return Boundaries(
        2, row, lower, upper, np.full(len(TABLE), 1e-10), np.stack([lower == LOW, upper == HIGH], axis=1), tongues,
        owner, member, np.zeros(2, dtype=int), np.zeros(2, dtype=int), 1e-6, nothing, nothing, np.zeros(2),
        np.zeros(2, dtype=bool), (LOW, HIGH),
    )  # fmt: skip


def test_every_region_stands_once_under_its_first_tongue(regions: Boundaries) -> None:
    found = regions.arranged()
    assert found.index == ((FIRST, 0), (FIRST, 1), (SECOND, 0), (THIRD, 0))
    nan = np.nan
    np.testing.assert_array_equal(found.boundary_frequency[:, 0], [[1.0, nan], [4.0, nan], [2.0, 2.5], [nan, 9.0]])
    np.testing.assert_array_equal(found.boundary_frequency[:, 1], [[1.5, nan], [5.0, nan], [3.0, 4.5], [nan, 10.0]])
    # The merged region of the second row stands under SECOND, for FIRST too.
    np.testing.assert_array_equal(found.holder, [[0, 2], [1, -1], [2, 2], [-1, 3]])
    assert regions.labels() == ["2w1", "w1+w2", "2w1", "w1+w2 & 2w1", "w2"]
    assert regions.leading() == [(FIRST, 0), (SECOND, 0), (FIRST, 1), (SECOND, 0), (THIRD, 0)]
    assert union([found.index[2:], found.index[:3]]) == found.index


def test_flags_of_a_tongue(regions: Boundaries) -> None:
    bits = {name: BOUNDARY_FLAGS[name] for name in ("open", "merged", "absorbed", "cut_below", "cut_above", "split")}
    opened, merged, absorbed, below, above, several = bits.values()
    np.testing.assert_array_equal(
        regions.arranged().flags,
        [
            [opened | below | several, absorbed],
            [opened | several, 0],
            [opened, opened | merged],
            [0, opened | above],
        ],
    )


@pytest.mark.parametrize(("coarse", "name"), [(False, "sampled"), (True, "coarse")])
def test_rows_that_were_sampled_are_marked(regions: Boundaries, coarse: bool, name: str) -> None:
    other = replace(regions, sampled_step=np.array([0.0, 0.01]), coarse=np.array([False, coarse]))
    added = other.arranged().flags - regions.arranged().flags
    np.testing.assert_array_equal(added, [[0, BOUNDARY_FLAGS[name]]] * 4)


def test_edges_within_the_range(regions: Boundaries) -> None:
    np.testing.assert_array_equal(regions.edges_of(0), [1.5, 2.0, 3.0, 4.0, 5.0])
    np.testing.assert_array_equal(regions.edges_of(1), [2.5, 4.5, 9.0])


def test_shares_of_what_is_stable(regions: Boundaries) -> None:
    """Stable are 9 - 2.5 of the first row and 9 - 3 of the second."""
    stretches = (np.array([[3.0, 4.0], [5.0, 7.25]]), np.array([[1.0, 2.5], [4.5, 9.0]]))
    np.testing.assert_allclose(regions.stable_share(stretches), [3.25 / 6.5, 1.0], rtol=1e-15)


ROOTS = [
    (Root(0, 2, 1), Root(0, 1, 3)),
    (Root(0, 2, 1),),
    (Root(1, 1, 2), Root(2, 2, 4)),
    (Root(1, 2, 1), Root(0, 2, 5)),
]
"""Roots of each region; the mesh a deflects modes 0 and 1, b mode 2 alone, so that 0 and 1 do not act on 2."""


def test_names_as_columns() -> None:
    names = Names.of(ROOTS)
    np.testing.assert_array_equal(names.owner, [0, 0, 1, 2, 2, 3, 3])
    np.testing.assert_array_equal(names.root[:2], [[0, 2, 1], [0, 1, 3]])
    assert names.roots(4) == ROOTS


def test_modes_that_do_not_act_on_each_other_give_no_name() -> None:
    directions = np.array([[[0.5, -0.3, 1e-12], [0.0, 0.0, 0.7]]])
    pattern: Any = SimpleNamespace(elastic=SimpleNamespace(directions=directions))
    intervals: Any = Intervals.of(Interval(0, 1.0 + k, 1.5 + k, (0, 0, 0), (0, 0, 1)) for k in range(len(ROOTS)))
    found = coupled(pattern, intervals, Names.of(ROOTS)).roots(len(ROOTS))
    # A region of which nothing is left keeps its leading name.
    assert found == [ROOTS[0][1:], ROOTS[1], ROOTS[2], ROOTS[3][:1]]
