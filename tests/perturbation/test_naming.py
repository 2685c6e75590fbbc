"""Names of regions by the compiled kernel (ckernel/boundaries/names.c) against every assignment of roots scored."""

import numpy as np
import pytest
from naming import Unnamed, assign, below, center, near

from gearstab.floquet.boundaries.names.labels import Root
from gearstab.floquet.kernel import c_boundaries


def regions(rng: np.random.Generator, frequency: np.ndarray, cycles: float, count: int) -> list[Unnamed]:
    """Regions near roots, displaced by up to a fifth, some merged, with shares of roots around, in ascending order."""
    places = np.sort(rng.uniform(0.3, 3.0, count))
    found = []
    for place in places:
        around = [Unnamed(place, {}, (0, 0, 0), (0, 0, 0))]
        roots = near(around, frequency, cycles)
        chosen = [roots[k] for k in rng.permutation(len(roots))[: rng.integers(0, 4)]]
        parts = rng.dirichlet(np.ones(len(chosen) + 1))[: len(chosen)] if chosen else []
        shares = dict(zip(chosen, map(float, parts), strict=True))
        meetings = tuple(int(k) for k in rng.choice([0, 0, 1, 2], 3))
        found.append(Unnamed(float(place), shares, below(place * rng.uniform(1.0, 1.02), frequency, cycles), meetings))
    return found


@pytest.mark.parametrize("seed", range(60))
def test_regions_get_the_roots_of_the_largest_total(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, cycles, rows = int(rng.integers(1, 5)), float(rng.integers(1, 4)), 3
    frequency = np.sort(rng.uniform(0.3, 2.0, (rows, n)), axis=1)
    every = [regions(rng, own, cycles, int(rng.integers(1, 7))) for own in frequency]
    flat = [(row, region) for row, own in enumerate(every) for region in own]
    shares = [(k, *vars(root).values(), s) for k, (_, region) in enumerate(flat) for root, s in region.shares.items()]
    names = c_boundaries.names(
        frequency,
        cycles,
        np.array([row for row, _ in flat]),
        np.array([region.cycle for _, region in flat]),
        np.array([region.passed for _, region in flat]),
        np.array([region.meetings for _, region in flat]),
        np.array(shares, dtype=c_boundaries.SHARE),
    )
    found: list[list[Root]] = [[] for _ in flat]
    for name in names:
        found[name["region"]].append(Root(int(name["p"]), int(name["q"]), int(name["cycles"])))
    expected = [roots for own, w in zip(every, frequency, strict=True) for roots in assign(own, w, cycles)]
    assert found == expected


def test_counts_and_centres_agree() -> None:
    """Going up, the count of a root's class rises by one at its centre."""
    frequency = np.array([0.43, 1.1, 1.7])
    root = Root(0, 2, 3)
    place = center(root, frequency, 2.0)
    before, after = (below(place * (1 + sign * 1e-9), frequency, 2.0) for sign in (-1, 1))
    assert np.subtract(after, before).tolist() == [0, 0, 1]
