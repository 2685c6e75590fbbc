"""Regions ranked by what they do in a range, and what closes them, against monodromy matrices made of exponentials."""

from dataclasses import replace

import numpy as np
import planetary_gears
import pytest
from driven import monodromy
from naming import Unnamed, assign, below, center, near
from tongues import train

from gearstab.floquet.boundaries.names import Root
from gearstab.floquet.kernel import c_boundaries
from gearstab.perturbation import first_order
from gearstab.perturbation.remedies import RankedRegion, contact_ratios, phasing, rank, resonance, strength
from gearstab.system import GearSystem
from gearstab.systems import build

EPSILON = 0.002
"""So small that errors of second order, about epsilon of a width, are below the tolerances."""


def growth_rates(system: GearSystem, omega: np.ndarray) -> np.ndarray:
    """Largest real part of the characteristic exponents, from products of matrix exponentials."""
    largest = np.abs(np.linalg.eigvals(monodromy(system, omega))).max(axis=-1)
    return np.log(largest) * omega / (2 * np.pi * float(system.common_period()[0]))


def peak(system: GearSystem, region: RankedRegion) -> float:
    """The largest growth rate around a region, wherever second order has moved it to."""
    middle, half = 0.5 * (region.lower + region.upper), region.upper - region.lower
    return float(growth_rates(system, np.linspace(middle - half, middle + half, 401)).max())


def labelled(system: GearSystem, label: str, low: float = 0.3, high: float = 7.0) -> RankedRegion:
    found = rank(system, low, high, 3, most=1000, nearest=1000)
    return next(region for region in (*found.open, *found.closest) if region.tongue.label == label)


def with_ratios(system: GearSystem, ratios: dict[int, float]) -> GearSystem:
    meshes = list(system.meshes)
    for i, ratio in ratios.items():
        meshes[i] = replace(meshes[i], waveform=replace(meshes[i].waveform, contact_ratio=np.asarray(ratio)))
    return replace(system, meshes=tuple(meshes))


def with_lag(system: GearSystem, mesh: int, shift: float) -> GearSystem:
    meshes = list(system.meshes)
    meshes[mesh] = replace(meshes[mesh], lag=np.asarray(meshes[mesh].lag) + shift)
    return replace(system, meshes=tuple(meshes))


LABELS = ["2w3", "2w2", "w1+w2", "2w3/3", "w2", "w2+w3", "(w1+w2)/2"]
SINGLES = [[0], [1]]
UNLIKE = {"contact_ratio": (1.4, 1.65), "phasing": 0.1, "epsilon": EPSILON}


@pytest.mark.parametrize("damping", [0.0, 0.001])
@pytest.mark.parametrize("label", LABELS)
def test_growth_in_the_middle(label: str, damping: float) -> None:
    region = labelled(train(**UNLIKE, damping_ratio=damping), label)
    found = peak(train(**UNLIKE, damping_ratio=damping), region) if not np.isnan(region.lower) else None
    if found is None:
        assert region.amplitudes.growth_rate < 0
    else:
        # 401 points see all but 1e-4 of a parabola's top; the rest is of second order, relative to the growth without.
        assert found == pytest.approx(region.amplitudes.growth_rate, abs=0.03 * strength(region.amplitudes.coupling))


@pytest.mark.parametrize("label", LABELS)
def test_the_damping_ratio_that_closes(label: str) -> None:
    region = labelled(train(**UNLIKE), label)
    zeta = region.amplitudes.damping_ratio
    assert peak(train(**UNLIKE, damping_ratio=1.05 * zeta), region) < 0
    assert peak(train(**UNLIKE, damping_ratio=0.95 * zeta), region) > 0


@pytest.mark.parametrize("label", LABELS)
def test_contact_ratios_that_close(label: str) -> None:
    system = train(**UNLIKE)
    region = labelled(system, label)
    ratios = contact_ratios(system, region.amplitudes, SINGLES)
    assert ratios
    assert all(abs(ratio - old) < 0.5 for ratio, old in zip(ratios.values(), (1.4, 1.65), strict=True))
    assert peak(with_ratios(system, ratios), region) < 0.05 * peak(system, region)


def test_one_contact_ratio_is_enough_where_damping_closes_the_rest() -> None:
    """Without the second mesh's part the region is closed, not without the first's."""
    system = train(contact_ratio=1.4, epsilon=(0.02, 0.1), damping_ratio=0.012)
    region = labelled(system, "2w3")
    assert contact_ratios(system, region.amplitudes, SINGLES) == {1: 1.0}
    assert peak(system, region) > 0 > peak(with_ratios(system, {1: 1.0}), region)


@pytest.mark.parametrize("label", LABELS)
def test_the_best_phasing(label: str) -> None:
    system = train(**UNLIKE)
    region = labelled(system, label)
    best = phasing(region.amplitudes)
    assert best is not None
    assert best.mesh == 1
    assert abs(best.shift) <= 0.5 / region.amplitudes.harmonics[1] + 1e-12
    before = peak(system, region)
    assert peak(with_lag(system, 1, best.shift), region) == pytest.approx(best.left * before, abs=0.05 * before)
    for other in np.linspace(0, 1, 13):
        assert peak(with_lag(system, 1, other), region) > (best.left - 0.05) * before


def test_a_phasing_closes_where_both_meshes_are_as_strong() -> None:
    """Lin & Parker 2002, (21): a star of two equal meshes on one gear, 2 w of the symmetric mode."""
    p = {
        "kind": "matrices", "mass": np.eye(3), "stiffness": np.zeros((3, 3)),
        "meshes": [
            {"name": n, "direction": d, "mean_stiffness": 1.0, "epsilon": EPSILON, "contact_ratio": 1.5,
             "lag": 0.0}
            for n, d in (("left", [1, -1, 0]), ("right", [0, -1, 1]))
        ],
    }  # fmt: skip
    system = build(p)
    region = labelled(system, "2w3", 1.0, 8.0)
    best = phasing(region.amplitudes)
    assert best is not None
    assert best.closes
    assert abs(best.shift) == pytest.approx(0.5)
    assert peak(with_lag(system, 1, best.shift), region) < 1e-3 * peak(system, region)


def test_the_share_of_the_range_is_that_of_a_raster() -> None:
    """All regions together take as much of the range as points that are unstable; the widest one is the first."""
    system = train(**UNLIKE | {"epsilon": 0.1})
    low, high = 1.0, 5.45  # cuts 2w3 in half
    omega = np.linspace(low, high, 4001)
    unstable = growth_rates(system, omega) > 1e-7
    found = rank(system, low, high, 1, most=1000)
    assert found.harmonics > 1
    # Regions do not overlap here; second order moves edges by some epsilon^2, of which the cut ones feel all.
    assert sum(region.inside for region in found.open) / (high - low) == pytest.approx(unstable.mean(), abs=0.006)
    steps = np.flatnonzero(np.diff(unstable.astype(int))) + 1
    runs = np.split(np.arange(len(omega)), steps)
    longest = max((run for run in runs if unstable[run[0]]), key=len)
    first = found.open[0]
    assert first.tongue.label == "2w3"
    assert first.upper > high  # not all of it is in the range
    assert len(longest) / len(omega) == pytest.approx(first.inside / (high - low), abs=0.005)
    assert [r.inside for r in found.open] == sorted((r.inside for r in found.open), reverse=True)


def test_what_damping_closes_is_counted_and_the_next_to_open_are_named() -> None:
    system = train(**UNLIKE, damping_ratio=0.05)
    found = rank(system, 0.3, 7.0, 3)
    assert (found.open, found.opened) == ((), 0)
    assert len(found.closest) == 3 <= found.closed
    first = found.closest[0]
    assert first.threshold == min(region.threshold for region in found.closest)
    opened = train(**UNLIKE | {"epsilon": EPSILON * first.threshold * 1.02}, damping_ratio=0.05)
    assert rank(opened, 0.3, 7.0, 3).open[0].tongue.label == first.tongue.label


def test_a_mode_without_damping_leaves_no_end() -> None:
    system = train(**UNLIKE, damping={"modal": [0.01, 0.0, 0.01]})
    region = labelled(system, "w1+w2")
    assert region.endless
    assert np.isfinite([region.lower, region.upper]).all()
    assert region.amplitudes.growth_rate > 0


def test_repeated_frequencies_are_solved_as_groups() -> None:
    """The growth in the middle is half of sigma_max(G), which is the half-width in nu of first_order."""
    system = planetary_gears.planetary(phases=planetary_gears.SEQUENTIAL)
    found = first_order(system, 1)
    open_ = [k for k in range(len(found.index)) if found.half_width[k] > 1e-6]
    assert len(open_) > 10
    for k in open_:
        tongue = found.index[k]
        growth = resonance(system, tongue).growth_rate
        assert 2 * growth == pytest.approx(found.half_width[k] * tongue.frequency_ratio, rel=1e-10)


# --- names of regions by the compiled kernel (boundaries/naming/names.c) against every assignment of roots scored


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
    shares = [
        (k, root.p, root.q, root.cycles, s) for k, (_, region) in enumerate(flat) for root, s in region.shares.items()
    ]
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
