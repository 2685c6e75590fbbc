"""The compiled search against halving by counts: regions, edges, names."""

from fractions import Fraction

import krein_search
import numpy as np
import pytest
from scenes import scene_data
from systems import KINDS, system
from tongues import train

from gearstab.ckernel import library
from gearstab.config import load
from gearstab.floquet.boundaries import boundaries
from gearstab.floquet.boundaries import undamped as compiled
from gearstab.floquet.boundaries.parts import Interval, Intervals, separated
from gearstab.floquet.kernel import c_boundaries, c_kernel
from gearstab.floquet.segments.pattern import Pattern, prepare
from gearstab.mesh import Mesh
from gearstab.system import GearSystem
from gearstab.systems import build
from gearstab.waveforms import Rectangular

TOLERANCE, FLOOR = 1e-10, 1e-6


def random_train(seed: int) -> GearSystem:
    """A chain of one to six masses with one to three meshes, whose ratios have denominators up to seven."""
    rng = np.random.default_rng([77, seed])
    n = int(rng.integers(1, 7))
    difference = np.eye(n) - np.eye(n, k=-1)
    mass, stiffness = np.diag(rng.uniform(0.4, 2.5, n)), difference.T @ np.diag(rng.uniform(0.3, 3, n)) @ difference
    meshes = []
    for i in range(int(rng.integers(1, 4))):
        direction = np.ones(1)
        if n > 1:
            p, direction = int(rng.integers(1, n)), np.zeros(n)
            direction[p - 1 : p + 1] = rng.choice([-1, 1]) * rng.uniform(0.5, 2), 1
        ratio = Fraction(1) if i == 0 else Fraction(int(rng.integers(1, 9)), int(rng.integers(1, 8)))
        level, epsilon = np.array(rng.uniform(0.5, 2)), np.array([rng.uniform(0.01, 0.5)])
        wave = Rectangular(rng.uniform(1.1, 2.9))
        meshes.append(Mesh(f"m{i}", direction, level, epsilon, wave, ratio, rng.uniform()))
    return GearSystem(mass, stiffness, tuple(meshes))


def patterns(item: GearSystem, start: float, stop: float) -> list[tuple[Pattern, np.ndarray, np.ndarray]]:
    found = []
    for pattern in prepare(item):
        for part in separated(pattern, True):
            rate = part.pattern.elastic.rate
            found.append((part.pattern, rate / stop, rate / start))
    return found


def unstable(intervals: Intervals, row: int) -> np.ndarray:
    """``(I, 2)``; stable gaps narrower than the floor may be found or not: they are closed."""
    merged: list[list[float]] = []
    for i in sorted(intervals.subset(np.flatnonzero(intervals.row == row)), key=lambda i: i.start):
        if merged and i.start - merged[-1][1] < FLOOR * i.start:
            merged[-1][1] = i.stop
        else:
            merged.append([i.start, i.stop])
    return np.array(merged).reshape(-1, 2)


def place(interval: Interval) -> tuple[int, str, str]:
    return interval.row, f"{interval.start:.7e}", f"{interval.stop:.7e}"


def check(found: Intervals, known: Intervals, rows: int) -> int:
    """The same regions but for what is narrower than the floor; the number of edges compared."""
    compared = 0
    for row in range(rows):
        own, other = unstable(found, row), unstable(known, row)
        # Regions next to the floor may be on either side of it.
        own, other = (v[v[:, 1] - v[:, 0] > 1.01 * FLOOR * v[:, 0]] for v in (own, other))
        assert len(own) == len(other)
        apart = np.abs(own / other - 1)
        # A region may have swallowed another one, narrower than the floor, beside it.
        assert ((apart < 3e-10) | ((apart > 1e-8) & (apart < FLOOR))).all()
        compared += own.size
    return compared


@pytest.mark.parametrize("seed", range(30))
def test_random_trains(seed: int) -> None:
    """One to six coordinates: every region, its edges, and the collisions below and inside it."""
    item = random_train(seed)
    cycles = float(item.common_period()[0])
    highest = np.sqrt(np.linalg.eigvals(np.linalg.solve(item.mass, item.stiffness)).real.max() + 2)
    for pattern, first, last in patterns(item, max(0.4, min(0.1 * cycles, 2.0) * highest), 3 * highest):
        found = compiled.search(pattern, first, last, TOLERANCE, FLOOR).intervals
        known = krein_search.search(pattern, first, last, TOLERANCE, FLOOR)
        check(found, known, len(first))
        places = {(round(i.start, 8), round(i.stop, 8)): (i.passed, i.meetings) for i in known if not any(i.cut)}
        same = [(round(i.start, 8), round(i.stop, 8)) for i in found]
        for i, place in zip(found, same, strict=True):
            assert (i.passed, i.meetings) == places.get(place, (i.passed, i.meetings))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("n", [2, 3, 4])
def test_kinds(n: int, kind: str) -> None:
    """Free and rigid modes, negative stiffness, several ratios."""
    item = system(n, kind, 1, epsilon=0.5)
    for pattern, first, last in patterns(item, 0.7, 9.0):
        found = compiled.search(pattern, first, last, TOLERANCE, FLOOR).intervals
        check(found, krein_search.search(pattern, first, last, TOLERANCE, FLOOR), len(first))


def test_results_do_not_depend_on_threads_or_instructions(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(c_boundaries, "RUN", 6)
    epsilon = np.linspace(0.02, 0.5, 3 * c_boundaries.RUN + 5)
    ((pattern, first, last),) = patterns(train(tooth_ratio="3/5", epsilon=(epsilon, epsilon)), 0.7, 7.0)
    edges, reach = c_boundaries.edges(pattern, pattern, first, last, TOLERANCE, FLOOR, FLOOR, 1.0, limit=1)
    again, same = c_boundaries.edges(pattern, pattern, first, last, TOLERANCE, FLOOR, FLOOR, 1.0, limit=3)
    np.testing.assert_array_equal(edges, again)
    np.testing.assert_array_equal(reach, same)
    known = compiled.search(pattern, first, last, TOLERANCE, FLOOR).intervals
    for level in library.levels():
        # Rounding decides only what is narrower than the floor.
        monkeypatch.setenv("GEARSTAB_SIMD", level)
        assert check(compiled.search(pattern, first, last, TOLERANCE, FLOOR).intervals, known, len(first)) > 1000


def test_rows_that_go_to_the_kernel_in_portions_keep_their_numbers(monkeypatch: pytest.MonkeyPatch) -> None:
    epsilon = np.linspace(0.02, 0.5, 23)
    ((pattern, first, last),) = patterns(train(epsilon=(epsilon, epsilon)), 1.0, 7.0)
    whole = compiled.search(pattern, first, last, TOLERANCE, FLOOR)
    monkeypatch.setattr(c_kernel, "ENTRIES_AT_ONCE", 7 * len(pattern.states) * pattern.size**2)
    portions = compiled.search(pattern, first, last, TOLERANCE, FLOOR)
    assert check(portions.intervals, whole.intervals, len(first)) > 300


def test_regions_do_not_depend_on_the_rows_before() -> None:
    """Points begin at the edges of the row before: rows in any order find what each finds alone."""
    given = np.random.default_rng(5)
    epsilon = np.concatenate([given.uniform(0.02, 0.5, 12), np.full(3, 0.3), np.linspace(0.3, 0.31, 6)])
    ((pattern, first, last),) = patterns(train(tooth_ratio="3/5", epsilon=(epsilon, epsilon)), 0.7, 7.0)
    together = compiled.search(pattern, first, last, TOLERANCE, FLOOR)
    for row in range(len(epsilon)):
        only = np.array([row])
        found = compiled.search(pattern.subset(only), first[only], last[only], TOLERANCE, FLOOR)
        own = together.intervals.row == row
        assert len(found.intervals.row) == own.sum() > 30
        for side in ("start", "stop"):
            edges = getattr(together.intervals, side)[own]
            np.testing.assert_allclose(edges, getattr(found.intervals, side), rtol=2 * TOLERANCE)


@pytest.mark.parametrize("density", [0.12, 0.6, 1.3])
def test_regions_do_not_depend_on_the_density_of_the_scan(density: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """A tongue that a third multiplier overtakes may count for nothing: the search may not pass over its gaps."""
    epsilon = np.linspace(0.02, 0.5, 9)
    item = train(contact_ratio=(1.5, 1.7), tooth_ratio="3/5", epsilon=(epsilon, epsilon))
    ((pattern, first, last),) = patterns(item, 0.35, 7.0)
    known = compiled.search(pattern, first, last, TOLERANCE, FLOOR).intervals
    monkeypatch.setattr(compiled, "DENSITY", density)
    assert check(compiled.search(pattern, first, last, TOLERANCE, FLOOR).intervals, known, len(first)) > 1500


@pytest.mark.parametrize("ratio", [1, "3/5", "5/7"])
def test_no_edge_is_taken_too_early(ratio: int | str) -> None:
    """An edge follows from a cubic where nothing bends it: no third multiplier near it, and no mirror image."""
    epsilon = np.linspace(0.01, 0.9, 40)
    item = train(contact_ratio=(1.5, 1.43), tooth_ratio=ratio, epsilon=(epsilon, epsilon))
    ((pattern, first, last),) = patterns(item, 0.5, 7.0)
    found = compiled.search(pattern, first, last, TOLERANCE, FLOOR).intervals
    exact = compiled.search(pattern, first, last, 1e-13, FLOOR).intervals
    assert len(found) == len(exact) > 900
    for name in ("start", "stop"):
        np.testing.assert_allclose(getattr(found, name), getattr(exact, name), rtol=TOLERANCE)


def test_no_rows_and_no_regions() -> None:
    ((pattern, first, _),) = patterns(train(epsilon=(np.array([0.1]), np.array([0.1]))), 1.0, 7.0)
    edges, reach = c_boundaries.edges(pattern, pattern, first, first * 1.0001, TOLERANCE, FLOOR, FLOOR, 1.0)
    assert len(edges) == 0
    assert reach["evaluations"][0] > 0
    mean, turn, none = np.ones((1, 3)), np.eye(3)[None], np.zeros(0)
    assert len(c_boundaries.shares(pattern, pattern, mean, turn, none.astype(int), none)) == 0


def test_names_of_a_row_with_very_many_regions() -> None:
    """One coordinate with w = 1 has its tongue M at 1/Omega = M/2; no share is large enough to settle a name alone.

    A matrix of all regions and all roots would take 80 GB.
    """
    count = 100_000
    number = np.arange(1, count + 1)
    odd = (number % 2).astype(bool)
    passed = np.stack([(number - 1) // 2, number // 2, 0 * number], axis=1)
    meetings = np.stack([~odd, odd, 0 * odd], axis=1).astype(np.int64)
    found = np.zeros(count, dtype=c_boundaries.SHARE)
    found["point"], found["cycles"], found["share"] = np.arange(count), number, 0.4
    row = np.zeros(count, dtype=np.int64)
    names = c_boundaries.names(np.ones((1, 1)), 1.0, row, 0.5 * number, passed, meetings, found)
    assert names["region"].tolist() == list(range(count))
    assert names["cycles"].tolist() == number.tolist()


PLANETS = scene_data("boundaries_planets")


def test_regions_of_modes_of_one_frequency_stand_under_the_first_of_them() -> None:
    # The planets' modes 3 and 4 have one frequency: which of their combinations grows is a matter of rounding.
    planets = build(load({"system": PLANETS}).system)
    found = {name for label in boundaries(planets, 1.8, 5.0).labels() for name in label.split(" & ")}
    assert {"2w3", "w3"} <= found
    assert not any("w4" in name for name in found)
