"""The amplitude equations of two groups of modes: closed forms, brute force, and the ends of the damping range."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from gearstab.perturbation.damped import group_pair, single_pair

rate = st.floats(1e-3, 1.0)


def rates(sigma: np.ndarray, g: np.ndarray, d_p: np.ndarray, d_q: np.ndarray) -> np.ndarray:
    """Largest growth rate of a' = -(D_P + i sigma/2) a + i G b/2, b' = -i G^H a/2 - (D_Q - i sigma/2) b."""
    p, q = g.shape
    found = []
    for s in np.atleast_1d(sigma):
        top = np.hstack([-d_p - 0.5j * s * np.eye(p), 0.5j * g])
        bottom = np.hstack([-0.5j * g.conj().T, -d_q + 0.5j * s * np.eye(q)])
        found.append(np.linalg.eigvals(np.vstack([top, bottom])).real.max())
    return np.array(found)


@given(rate, rate, st.floats(0.0, 5.0))
def test_closed_form_is_where_the_growth_vanishes(mu_p: float, mu_q: float, g: float) -> None:
    width, threshold = (float(v) for v in single_pair(np.asarray(g), np.asarray(mu_p), np.asarray(mu_q)))
    blocks = np.array([[g]]), np.array([[mu_p]]), np.array([[mu_q]])
    assert (width > 0) == (threshold < 1)
    if width > 1e-6:
        # Growth is smooth in sigma; its slope at the edge may be as small as the edge is near the centre.
        assert rates(width, *blocks)[0] == pytest.approx(0, abs=1e-12 * (g + mu_p + mu_q))
        assert rates(0.99 * width, *blocks)[0] > 0 > rates(1.01 * width, *blocks)[0]
    elif threshold > 1.001:
        assert rates(0.0, *blocks)[0] < 0


def test_limits_of_the_closed_form() -> None:
    """Equal damping: sqrt(G^2 - 4 mu^2). Both rates to zero: (1 + r)/(2 sqrt(r)) G, r their ratio; G only for r = 1."""
    mu = np.array([0.1, 0.2, 0.4])
    width, _ = single_pair(np.asarray(1.0), mu, mu)
    assert_allclose(width, np.sqrt(1 - 4 * mu**2), rtol=1e-14)
    ratio = np.array([1.0, 4.0, 100.0])
    width, _ = single_pair(np.asarray(1.0), np.asarray(1e-9), 1e-9 * ratio)
    assert_allclose(width, (1 + ratio) / (2 * np.sqrt(ratio)), rtol=1e-6)
    width, threshold = single_pair(np.asarray(1.0), np.asarray(0.0), np.asarray(0.0))
    assert (width, threshold) == (1.0, 0.0)


def test_one_sided_negative_and_uncoupled_damping() -> None:
    coupling = np.array([1.0, 0.0, 1.0, 0.0, 0.0])
    mu_p, mu_q = np.array([0.0, 0.0, -0.1, -0.1, 0.2]), np.array([0.1, 0.1, 0.2, 0.2, 0.2])
    width, threshold = single_pair(coupling, mu_p, mu_q)
    assert_array_equal(width, [np.inf, 0.0, np.inf, np.inf, 0.0])
    assert_array_equal(threshold, [0.0, np.inf, 0.0, 0.0, np.inf])


def random_block(seed: int, p: int, q: int, size: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    g = size * (rng.normal(size=(p, q)) + 1j * rng.normal(size=(p, q)))
    dampings = []
    for n in (p, q):
        factor = rng.normal(size=(n, n)) * np.geomspace(0.05, 1, n)
        dampings.append(0.1 * (factor @ factor.T + 0.05 * np.eye(n)))
    return g, dampings[0], dampings[1]


@pytest.mark.parametrize(("p", "q"), [(1, 2), (2, 1), (2, 2), (3, 2)])
def test_groups_against_brute_force(p: int, q: int) -> None:
    """The outermost zero of the growth on a fine grid of detunings."""
    blocks = [random_block(seed, p, q, size) for seed in range(6) for size in (0.2, 1.0, 3.0)]
    width, threshold = group_pair(*(np.array(part) for part in zip(*blocks, strict=True)))
    assert (width > 0).any()
    for w, t, (g, d_p, d_q) in zip(width, threshold, blocks, strict=True):
        assert (t < 1) == (w > 0)
        grid = np.linspace(0, max(2 * w, 1.0), 1001)
        unstable = grid[rates(grid, g, d_p, d_q) > 0]
        assert (unstable.max() if len(unstable) else 0.0) == pytest.approx(w, abs=1.01 * grid[1])
        assert rates(0.0, g * t * 1.001, d_p, d_q)[0] > 0 > rates(0.0, g * t * 0.999, d_p, d_q)[0]
        if w > 0:
            assert rates(w, g, d_p, d_q)[0] == pytest.approx(0, abs=1e-12)


def test_isotropic_damping_of_a_group_is_the_closed_form_of_its_largest_singular_value() -> None:
    g = random_block(3, 2, 2, 1.0)[0]
    largest = np.linalg.svd(g, compute_uv=False)[0]
    width, threshold = group_pair(g[None], 0.1 * np.eye(2)[None], 0.4 * np.eye(2)[None])
    expected = single_pair(largest, np.asarray(0.1), np.asarray(0.4))
    assert_allclose([width[0], threshold[0]], expected, rtol=1e-12)
    width, threshold = group_pair(g[None], np.zeros((1, 2, 2)), np.zeros((1, 2, 2)))
    assert_allclose([width[0], threshold[0]], [largest, 0.0], rtol=1e-14)


def test_groups_do_not_depend_on_their_basis() -> None:
    g, d_p, d_q = random_block(1, 2, 2, 2.0)
    turn = np.linalg.qr(np.random.default_rng(7).normal(size=(2, 2)))[0]
    plain = group_pair(g[None], d_p[None], d_q[None])
    turned = group_pair((turn.T @ g)[None], (turn.T @ d_p @ turn)[None], d_q[None])
    assert_allclose(turned, plain, rtol=1e-12)


def test_partly_damped_groups() -> None:
    """A pair of which one direction is undamped: unbounded only if that one is coupled to a damped one."""
    damping = np.diag([0.0, 0.1])[None]
    alone = np.array([[[1.0, 0.0], [0.0, 3.0]]], dtype=complex)
    width, threshold = group_pair(alone, damping, damping)
    assert_allclose(width, np.sqrt(9 - 4 * 0.01), rtol=1e-12)
    assert_array_equal(threshold, 0.0)
    closed = np.array([[[1.0, 0.0], [0.0, 0.1]]], dtype=complex)
    assert_allclose(group_pair(closed, damping, damping)[0], 1.0, rtol=1e-12)
    assert_array_equal(group_pair(alone, -damping, damping), [[np.inf], [0.0]])


def test_undamped_directions_coupled_to_damped_ones() -> None:
    """Far away the coupling within the group damps (finite width), that to the other group drives (infinite)."""
    damping = np.diag([0.0, 0.1])
    ended, endless = (
        np.array([[1.0, 0.5], [0.5, 3.0]], dtype=complex),
        np.array([[0.0, 1.0], [1.0, 0.0]], dtype=complex),
    )
    batch = group_pair(
        np.array([ended, endless, ended]), np.array([damping, damping, 0 * damping]), np.array([damping] * 3)
    )
    assert_array_equal(np.isinf(batch[0]), [False, True, True])
    assert_array_equal(batch[1], 0.0)
    width = batch[0][0]
    # The growth falls off as sigma^-2: 1e-8 of the coupling at 1e3, well above rounding.
    far = np.array([1.001 * width, 3 * width, 30 * width, 1000.0])
    assert (rates(far, ended, damping, damping) < 0).all()
    assert rates(0.999 * width, ended, damping, damping)[0] > 0
    assert (rates(far, endless, damping, damping) > 0).all()
    assert (rates(far, ended, 0 * damping, damping) > 0).all()
