"""No tongue and no stable gap is missed where damping is light and terms are periodic: against rasters.

Rasters come from products of exponentials and LAPACK; they look at extrema of the growth rate and about the regions of
the same system without damping, which another search counts. The search itself pursues meetings of multipliers.
"""

from collections.abc import Iterable
from dataclasses import replace

import pytest
from random_trains import light_contradictions, light_train

from gearstab.floquet.boundaries import BOUNDARY_FLAGS, boundaries
from gearstab.floquet.boundaries.regions import sampled

HARD = (16, 20, 27, 34, 38, 1010, 2114, 2234, 2296, 2604, 2674, 3004, 3015, 3450, 3777)
"""Gaps where multipliers meet inside of a region or change their kind; a tongue in part kept stable by damping; a
tongue of 2e-5 at 3e-4 beside a wide one, one of whose multipliers it shares; a gap some widths beside a meeting, where
both grow equally; a tongue about which two phases turn at a rate of their own; a gap where three multipliers meet; a
gap and a tongue beside a meeting, where a complex coupling has the least and the most growth;
tongues within the phases that they lock, where the modes are damped strongly; growth barely above zero between samples,
steep on one side only; a gap in a corner whose branches fall faster than their lines."""


def check(seeds: Iterable[int]) -> tuple[int, int]:
    """Numbers of raster points and of regions of some trains, none of which has contradictions."""
    points = regions = 0
    for seed in seeds:
        system, start, stop = light_train(seed)
        found = boundaries(system, start, stop)
        count, wrong = light_contradictions(system, found, start, stop)
        assert wrong == [], seed
        points, regions = points + count, regions + len(found.row)
    return points, regions


def test_no_region_of_lightly_damped_trains_is_missed() -> None:
    assert check(HARD)[1] > 50


def test_the_raster_notices_a_region_that_is_left_out() -> None:
    system, start, stop = light_train(34)
    found = boundaries(system, start, stop)
    kept = found.row[1:]
    less = replace(found, row=kept, lower=found.lower[1:], upper=found.upper[1:])
    assert len(light_contradictions(system, less, start, stop)[1]) > 0


def test_what_the_budget_does_not_cover_is_said() -> None:
    system, start, stop = light_train(34)
    whole, part = (boundaries(system, start, stop, budget=budget) for budget in (4e9, 1e4))
    assert not whole.coarse[0]
    assert part.coarse[0]
    # The range over the fewest samples of a scan.
    assert part.sampled_step[0] == pytest.approx(4.3e-3, rel=0.02)
    for found, name in ((whole, "sampled"), (part, "coarse")):
        flags = found.arranged().flags
        assert (flags & BOUNDARY_FLAGS[name] > 0).all()
        assert not (flags & (BOUNDARY_FLAGS["sampled"] | BOUNDARY_FLAGS["coarse"]) == 192).any()


def test_one_line_says_what_is_not_covered() -> None:
    system, start, stop = light_train(34)
    whole, part = (boundaries(system, start, stop, budget=budget) for budget in (4e9, 1e4))
    words = "100 % of the stable mesh frequencies are neither proved nor counted: sampled where two multipliers meet"
    assert str(whole.uncovered()).startswith(words)
    assert "equal steps" not in str(whole.uncovered())
    assert "to a step of 0.0043 of them; those in equal steps only" in str(part.uncovered())
    assert "2 of 3 systems" in sampled(0.1, 2, 3)
    # Without damping all is counted.
    assert boundaries(replace(system, damping=None, terms=()), start, stop).uncovered() is None


@pytest.mark.slow
@pytest.mark.parametrize("part", range(10))
def test_no_region_is_missed_in_three_hundred_lightly_damped_trains(part: int) -> None:
    points, regions = check(range(30 * part, 30 * part + 30))
    assert points > 50_000
    assert regions > 50
