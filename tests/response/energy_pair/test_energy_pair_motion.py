"""Motion of a gear pair with constant stiffness, jumps, and when the rotation leaves its region."""

from __future__ import annotations

from math import tau

import numpy as np
import pytest
from energy_pair_reference import KAPPA
from hypothesis import given
from hypothesis import strategies as st

from gearstab.response.rotating_pair.exits import first_exit
from gearstab.response.rotating_pair.motion import Arc, Law, free_basis


@given(
    phi=st.floats(-0.5, 0.5), rate=st.floats(-0.5, 0.5), speed=st.floats(0.01, 1.0),
    direction=st.sampled_from([-1, 1]), region=st.sampled_from([0, 1]), m=st.floats(-0.99, 0.99),
)  # fmt: skip
def test_a_jump_takes_exactly_the_strain_energy(
    phi: float, rate: float, speed: float, direction: int, region: int, m: float
) -> None:
    one = Law(m, 0.05, 0.01, KAPPA, (0.0, 1.73, tau), m, True)
    before = (phi, rate, 1.73, direction * speed)
    new_rate, new_speed, passed = one.cross(region, before, direction)
    after = (phi, new_rate, 1.73, new_speed)
    beyond = 1 - region if passed else region
    size = 1 / (1 - m**2)
    assert one.energy(beyond, after) == pytest.approx(one.energy(region, before), abs=4e-15 * size)
    # phi' - m theta' is kept where the gears pass, and theta' goes on in its direction.
    if passed:
        assert new_rate - m * new_speed == pytest.approx(rate - m * before[3], abs=1e-15)
        assert new_speed * direction >= 0
    else:
        assert new_speed == -before[3]
        assert speed**2 <= abs(KAPPA[1] - KAPPA[0]) * phi**2 * (1 + 1e-14)


@given(
    kappa=st.floats(0.3, 2.0), zeta=st.floats(0.0, 2.0), t=st.floats(0.0, 30.0), phi=st.floats(-1, 1),
    rate=st.floats(-1, 1), speed=st.floats(-1, 1), drive=st.floats(-0.1, 0.1),
)  # fmt: skip
def test_the_motion_is_the_exponential_of_its_matrix(
    kappa: float, zeta: float, t: float, phi: float, rate: float, speed: float, drive: float
) -> None:
    """Over- and underdamped, with and without drive: against scipy's matrix exponential of the first-order system."""
    from scipy.linalg import expm

    load, m = 0.02, 0.6
    matrix = np.array([
        [0, 1, 0, 0, 0],
        [-kappa, -2 * zeta, 0, 0, load + m * drive],
        [0, 0, 0, 1, 0],
        [-m * kappa, -2 * m * zeta, 0, 0, m * load + drive],
        [0, 0, 0, 0, 0],
    ])  # fmt: skip
    expected = (expm(matrix * t) @ [phi, rate, 0.3, speed, 1.0])[:4]
    arc = Arc((phi, rate, 0.3, speed), kappa, zeta, load, m, drive)
    # The exponential scales by the norm of the matrix times t, some 100.
    np.testing.assert_allclose(arc.at(t), expected, atol=1e-11 * max(1.0, t**2))
    np.testing.assert_allclose(np.ravel(arc.samples(np.array([t]))), arc.at(t), rtol=1e-12, atol=1e-13)
    assert arc.turned(t) == pytest.approx(expected[2] - 0.3, abs=1e-11 * max(1.0, t**2))
    assert arc.speed(t) == pytest.approx(expected[3], abs=1e-11 * max(1.0, t))
    acceleration = (matrix[3] @ [*expected, 1.0]).item()
    assert arc.acceleration(t) == pytest.approx(acceleration, abs=1e-11 * max(1.0, t))


def test_the_basis_of_critical_damping() -> None:
    s, c, u = free_basis(np.array([2.0]), np.array([1.44]), np.array([1.2]))
    decay = np.exp(-2.4)
    assert s == pytest.approx(2 * decay)
    assert c == pytest.approx(decay * (1 - 2.4))
    assert u == pytest.approx((1 - decay * (1 + 2.4)) / 1.44)


@given(
    zeta=st.sampled_from([0.0, 0.01, 0.3, 1.5]), rate=st.floats(-2, 2), speed=st.floats(-1, 1),
    phi=st.floats(-1, 1), begin=st.floats(0.02, 0.98), drive=st.sampled_from([0.0, 0.0, 0.003, -0.02]),
)  # fmt: skip
def test_no_exit_is_missed(zeta: float, rate: float, speed: float, phi: float, begin: float, drive: float) -> None:
    """Against a dense table: theta has not been outside before the exit, and is on the boundary there."""
    arc = Arc((phi, rate, 0.0, speed), 0.7, zeta, 0.02, 0.88, drive)
    lower, upper = -begin * 0.5, (1 - begin) * 0.5
    found = first_exit(arc, lower, upper, 200.0)
    end = 200.0 if found is None else found.time
    times = np.linspace(0, end, 4001)
    turned = np.array([arc.turned(float(t)) for t in times])
    assert np.all((turned >= lower - 1e-12) & (turned <= upper + 1e-12))
    if found is not None:
        boundary = upper if found.direction > 0 else lower
        assert arc.turned(found.time) == pytest.approx(boundary, abs=1e-12)
        assert arc.speed(found.time) * found.direction >= -1e-7


def test_a_short_excursion_beyond_the_boundary_is_seen() -> None:
    """theta touches the boundary for one part in a million of a period only."""
    arc = Arc((0.0, 0.3, 0.0, 0.3 * 0.88 + 0.01), 1.0, 0.0, 0.0, 0.88)
    times = np.linspace(1.0, 3.0, 200_001)
    top = max(arc.turned(float(t)) for t in times)
    found = first_exit(arc, -1.0, top - 1e-13, 10.0)
    assert found is not None
    assert found.time < 3.0
    assert first_exit(arc, -1.0, top + 1e-9, 3.0) is None


def test_a_gear_that_all_but_stands_still_leaves_after_a_long_time() -> None:
    """Without damping theta swings for a million periods while it drifts; the exit is found without counting them."""
    speed = 1e-7
    arc = Arc((0.02, 0.0, 0.0, speed), 1.0, 0.0, 0.01, 0.88)
    found = first_exit(arc, -1.0, 1.0)
    assert found is not None
    # 1 less the swing, 0.88 (cos t - 1)/100 <= 0, over the drift.
    assert 1 / speed <= found.time <= 1 / speed + 10 * tau
    assert arc.turned(found.time) == pytest.approx(1.0, abs=1e-9)
