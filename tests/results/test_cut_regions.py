"""The flags ``cut_below`` and ``cut_above`` name the end of the range at which a region is cut off."""

import pytest

import gearstab as gs
from gearstab.floquet.boundaries.regions import BOUNDARY_FLAGS


@pytest.mark.parametrize("damping", [0.0, 0.01])
@pytest.mark.parametrize(
    ("lower", "upper", "flags"),
    [(2.0, 2.6, {"cut_below"}), (1.6, 2.0, {"cut_above"}), (1.98, 2.02, {"cut_below", "cut_above"}), (1.6, 2.6, set())],
)
def test_the_end_at_which_a_region_goes_on(damping: float, lower: float, upper: float, flags: set[str]) -> None:
    mesh = {"mean_stiffness": 1.0, "epsilon": 0.3, "contact_ratio": 1.5}
    pair = {"kind": "gear_pair", "equivalent_mass": 1.0, "damping_ratio": damping, "meshes": [mesh]}
    # The region at twice the natural frequency 1 has the half width epsilon 2/pi = 0.19 to first order.
    found = gs.boundaries(pair, lower, upper)
    region = list(found.label).index("2w1")
    low, high = found.boundary_frequency[region, :]
    status = int(found.status[region])
    assert {name for name in ("cut_below", "cut_above") if status & BOUNDARY_FLAGS[name]} == flags
    # What is cut off ends at the end of the range, and there the motion grows.
    assert (low == lower, high == upper) == ("cut_below" in flags, "cut_above" in flags)
    ends = gs.floquet(pair, [lower, upper]).growth_rate > 0
    assert ends.tolist() == ["cut_below" in flags, "cut_above" in flags]
