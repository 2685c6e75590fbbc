"""Regions of one degree of freedom down to 1e-11 of the speed, against their closed form in forty digits."""

import numpy as np
import pytest
from mpmath import mp
from scipy.optimize import brentq
from systems import oscillator, train

from gearstab.floquet import solve
from gearstab.floquet.boundaries import boundaries
from gearstab.methods.boundaries import BoundariesOptions
from gearstab.waveforms import Rectangular

EPSILON = 0.3
# Both levels turn by the same angle at this share of the stiffer one: regions of even order are closed there.
CLOSED = brentq(
    lambda d: np.sqrt(1 + 2 * EPSILON * (1 - d)) * d - np.sqrt(1 - 2 * EPSILON * d) * (1 - d), 0.2, 0.8, xtol=1e-16
)


def edges(contact_ratio: float, order: int) -> tuple[float, float]:
    """Return the edges of the region of an even order: trace/2 = cos a cos b - (p/q + q/p)/2 sin a sin b is 1 there."""
    with mp.workdps(40):
        share, epsilon = mp.mpf(contact_ratio) - 1, mp.mpf(EPSILON)
        stiff, soft = mp.sqrt(1 + 2 * epsilon * (1 - share)), mp.sqrt(1 - 2 * epsilon * share)

        def beyond(omega):
            a, b = (2 * mp.pi * x / omega for x in (stiff * share, soft * (1 - share)))
            return mp.cos(a) * mp.cos(b) - (stiff / soft + soft / stiff) / 2 * mp.sin(a) * mp.sin(b) - 1

        middle = mp.findroot(lambda x: mp.diff(beyond, x), 2 * (stiff * share + soft * (1 - share)) / order)
        half = mp.sqrt(-2 * beyond(middle) / mp.diff(beyond, middle, 2))
        low, high = (mp.findroot(beyond, middle + side * half) for side in (-1, 1))
        return float(low), float(high)


@pytest.mark.parametrize("floor", [1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("times", [1.5, 7.0, 1e2])
def test_regions_a_little_wider_than_the_floor(floor: float, times: float) -> None:
    contact_ratio = 1 + CLOSED + times * floor / 0.63  # the width over the distance from CLOSED
    for order in (2, 4, 12):
        low, high = edges(contact_ratio, order)
        assert high - low == pytest.approx(times * floor * low, rel=0.01 if times * floor < 1e-4 else 0.1)
        system = oscillator(Rectangular(contact_ratio), EPSILON)
        found = boundaries(system, 0.99 * low, 1.01 * high, width_floor=floor)
        assert len(found.row) == 1
        # Stated tolerances hold; rounding moves an edge by 64 eps at most, and the closed form rounds to eps.
        slack = np.maximum(found.tolerance[0], 2**-46) * low
        assert np.all(np.abs([found.lower[0] - low, found.upper[0] - high]) <= slack)


def test_floors_that_no_rounding_allows() -> None:
    system = oscillator(Rectangular(1.5), EPSILON)
    with pytest.raises(ValueError, match="width floor >= 1e-12"):
        boundaries(system, 1.0, 2.0, width_floor=9e-13)
    with pytest.raises(ValueError, match=r"greater than or equal to 0\.000000000001"):
        BoundariesOptions(width_floor=9e-13)


def test_a_stable_gap_is_kept_by_a_floor_below_it() -> None:
    """Between 3w3/22 and (w2+w3)/10 of the train of ratio 3/5, 7e-8 wide: in forty digits nothing grows there.

    Searches with the usual floor of 1e-6 keep or close it, as their samples fall.
    """
    system = train(0.5 * 16 / 26, ratio="5/3")
    found = boundaries(system, 0.366, 0.3695, width_floor=1e-8)
    k = int(np.flatnonzero(np.abs(found.upper - 0.3688691246974) < 1e-9)[0])
    low, high = found.upper[k], found.lower[k + 1]
    assert high / low - 1 == pytest.approx(7.21e-8, rel=0.01)
    places = np.array([low - 3 * (high - low), 0.5 * (low + high), high + 3 * (high - low)])
    assert solve(system, places).stable[0].tolist() == [0, 1, 0]
