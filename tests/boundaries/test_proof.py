"""Lyapunov functions with a radius, and what they prove of damped systems."""

from dataclasses import replace

import numpy as np
import numpy_chain
import numpy_lyapunov
import pytest
from random_trains import missed, random_train
from scipy.linalg import expm
from test_boundaries_damped import half_trace
from tongues import train

from gearstab import ckernel
from gearstab.floquet import solve
from gearstab.floquet.boundaries import boundaries
from gearstab.floquet.boundaries.parts import Coverage, complement
from gearstab.floquet.kernel import c_points
from gearstab.floquet.kernel.chain import Chain, chain
from gearstab.floquet.kernel.damped import Generators
from gearstab.floquet.segments.pattern import prepare
from gearstab.system import GearSystem
from gearstab.systems import build

LEVELS = ckernel.library.levels()


def flow_of(system: GearSystem) -> Chain:
    """The only pattern of a system, in its own units of time where it has one row."""
    (pattern,) = prepare(system)
    return chain(pattern)


def points_of(system: GearSystem, start: float, stop: float, count: int) -> tuple[Chain, np.ndarray, np.ndarray]:
    """(chain, row, 1/Omega in its units) of some points of a system with one row."""
    (pattern,) = prepare(system)
    cycle = pattern.elastic.rate[0] / np.geomspace(start, stop, count)
    return chain(pattern), np.zeros(count, dtype=int), cycle


def monodromy(flow: Chain, cycle: float) -> np.ndarray:
    """Monodromy of row 0, by SciPy's matrix exponential of the generators themselves."""
    period, product = float(flow.period(np.array(cycle))), np.eye(flow.size)
    for s, state in enumerate(flow.states):
        product = expm(flow.generator.matrix[0, state] * flow.fractions[0, s] * period) @ product
    return product


@pytest.mark.parametrize("seed", range(6))
def test_moduli_are_those_of_matrix_exponentials(seed: int) -> None:
    flow, row, cycle = points_of(*random_train(seed), 7)
    expected = [-np.sort(-np.log(np.abs(np.linalg.eigvals(monodromy(flow, float(c)))))) for c in cycle]
    for ours in (numpy_chain, c_points):
        # A small multiplier is right to eps times the size of the matrix.
        lost = np.maximum(1e-9, 1e-12 * np.exp(-np.array(expected)))
        assert (np.abs(ours.moduli(flow, row, cycle) - expected) < lost).all()


@pytest.mark.parametrize("seed", range(3))
def test_products_and_moduli_without_eigenvectors(seed: int) -> None:
    """Exponentials serve states without eigenvectors, as those with two equal exponents."""
    flow, row, cycle = points_of(*random_train(seed), 7)
    flow = replace(flow, sound=np.zeros_like(flow.sound))
    product, scale = c_points.products(flow, row, cycle)
    expected = np.array([monodromy(flow, float(c)) for c in cycle])
    size = np.abs(expected).max(axis=(1, 2), keepdims=True)
    np.testing.assert_allclose(product * np.exp(scale)[:, None, None] / size, expected / size, atol=1e-11)
    moduli = -np.sort(-np.log(np.abs(np.linalg.eigvals(expected))), axis=1)
    np.testing.assert_allclose(c_points.moduli(flow, row, cycle)[:, 0], moduli[:, 0], atol=1e-9)


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("seed", range(8))
def test_the_kernel_proves_what_numpy_does(seed: int, level: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GEARSTAB_SIMD", level)
    flow, row, cycle = points_of(*random_train(seed), 41)
    logs = numpy_chain.moduli(flow, row, cycle)
    tried = np.abs(logs[:, 0]) > 1e-3
    row, cycle, growth = row[tried], cycle[tried], logs[tried, 0]
    ours, expected = c_points.radii(flow, row, cycle, growth), numpy_lyapunov.radii(flow, row, cycle, growth)
    # A radius is found within 2^(1/16); a pivot near 0 may pass in one and fail in the other.
    np.testing.assert_allclose(ours, expected, rtol=0.1, atol=1e-6)
    alone = [c_points.radii(flow, row[k : k + 1], cycle[k : k + 1], growth[k : k + 1])[0] for k in (0, len(row) // 2)]
    np.testing.assert_array_equal(alone, ours[[0, len(row) // 2]])
    one, two = c_points.products(flow, row, cycle), numpy_chain.products(flow, row, cycle)
    np.testing.assert_allclose(
        one[0] * np.exp(one[1])[:, None, None], two[0] * np.exp(two[1])[:, None, None], rtol=1e-9, atol=1e-10
    )


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("seed", range(8))
def test_the_kernel_proves_what_numpy_does_of_speeds_that_follow(
    seed: int, level: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GEARSTAB_SIMD", level)
    random = np.random.default_rng(seed)
    flow, row, cycle = points_of(*random_train(seed), 19)
    n, m = len(flow.frequencies[0]), flow.size
    drag = 0.05 * random.normal(size=(2, n, n))
    by_speed = np.zeros((1, 2, m, m))
    by_speed[0, 0, n : 2 * n, n : 2 * n] = drag[0] - drag[0].T
    by_speed[0, 1, n : 2 * n, :n] = 0.1 * drag[1]
    turning = Generators(flow.generator.matrix, by_speed, np.array([[[1.0, 1.0, 0.0], [0.5, 2.0, 0.01]]]))
    flow = replace(flow, following=turning)
    own, each = flow.at(row, cycle, slopes=True)
    growth = numpy_chain.moduli(own, each, cycle)[:, 0]
    ours, expected = c_points.radii(flow, row, cycle, growth), numpy_lyapunov.radii(own, each, cycle, growth)
    assert np.count_nonzero(expected) > len(expected) / 4
    # As above.
    np.testing.assert_allclose(ours, expected, rtol=0.1, atol=1e-6)


def test_of_many_coordinates_the_equation_is_solved_by_eigenvectors(monkeypatch: pytest.MonkeyPatch) -> None:
    flow, row, cycle = points_of(train((1.37, 1.62), 0.3, 1, (0.3, 0.3), damping_ratio=0.005), 1.1, 6.5, 80)
    growth = c_points.moduli(flow, row, cycle)[:, 0]
    outside = growth > 1e-3
    expected = c_points.radii(flow, row, cycle, growth)[outside]
    monkeypatch.setattr(c_points, "UNKNOWNS", 0)
    found = c_points.radii(flow, row, cycle, growth)[outside]
    assert np.count_nonzero(expected) > 4
    np.testing.assert_allclose(found, expected, rtol=0.1, atol=1e-6)


@pytest.mark.parametrize("seed", range(10))
def test_no_multiplier_crosses_the_circle_within_a_radius(seed: int) -> None:
    flow, row, cycle = points_of(*random_train(seed), 60)
    logs = c_points.moduli(flow, row, cycle)
    tried = np.abs(logs[:, 0]) > 1e-6
    row, cycle, logs = row[tried], cycle[tried], logs[tried]
    radius = c_points.radii(flow, row, cycle, logs[:, 0])
    assert (radius[logs[:, 0] < 0].max(axis=1) > 0).mean() > 0.9
    outside = (logs > 0).sum(axis=1)
    for part in np.concatenate([np.linspace(-1, 1, 21), [-0.999, 0.999]]):
        stretched = cycle * (1 + np.where(part > 0, part * radius[:, 0], part * radius[:, 1]))
        there = c_points.moduli(flow, row, stretched)
        proved = (radius > 0).all(axis=1)
        assert ((there > 0).sum(axis=1) == outside)[proved].all()


def test_the_lyapunov_function_decreases_for_all_stretchings_within_its_radius() -> None:
    """M(eta)^T P M(eta) < P with matrices from the generators, not from the proof's own steps."""
    flow, row, cycle = points_of(train((1.37, 1.62), 0.2, 1, (0.3, 0.3), damping_ratio=0.01), 1.1, 6.5, 25)
    logs = numpy_chain.moduli(flow, row, cycle)
    stable = logs[:, 0] < 0
    row, cycle, logs = row[stable], cycle[stable], logs[stable]
    rate = -c_points.PART * logs[:, 0] / flow.period(cycle)
    form = numpy_lyapunov.doubled(*numpy_lyapunov.Sweep(flow, row, flow.period(cycle), rate).equation())
    radius = numpy_lyapunov.radii(flow, row, cycle, logs[:, 0])
    inverse = flow.inverse[0, flow.states[0]]
    assert (radius > 1e-3).all(axis=1).sum() > 10
    for k in np.flatnonzero((radius > 0).all(axis=1)):
        p = inverse.T @ form[k] @ inverse
        assert np.linalg.eigvalsh(p)[0] > 0
        for eta in np.linspace(-radius[k, 1], radius[k, 0], 9):
            m = monodromy(flow, float(cycle[k] * (1 + eta)))
            assert np.linalg.eigvalsh(p - m.T @ p @ m)[0] > 0


def test_a_radius_does_not_reach_over_the_closed_form_edge() -> None:
    """Edge of a gear pair: growth of the undamped companion equals the decay."""
    zeta, epsilon = 0.02, 0.4
    mesh = {"name": "mesh", "mean_stiffness": 1.0, "epsilon": epsilon, "contact_ratio": 1.5}
    pair = build({"kind": "gear_pair", "equivalent_mass": 1.0, "damping_ratio": zeta, "meshes": [mesh]})

    def excess(omega: np.ndarray) -> np.ndarray:
        trace = np.array([half_trace(x, epsilon, zeta) for x in omega])
        return np.log(np.abs(trace)) - np.log(np.cosh(zeta * 2 * np.pi / omega))

    fine = 1 / np.linspace(1 / 2.4, 1 / 1.6, 20_001)
    change = np.flatnonzero(np.diff(excess(fine) > 0))
    edges = 0.5 * (fine[change] + fine[change + 1])
    assert len(edges) == 2
    away = np.geomspace(1e-4, 0.1, 20)
    omega = np.concatenate([edge * (1 + sign * away) for edge in edges for sign in (-1, 1)])
    (pattern,) = prepare(pair)
    flow, row, cycle = chain(pattern), np.zeros(len(omega), dtype=int), pattern.elastic.rate[0] / omega
    growth = c_points.moduli(flow, row, cycle)[:, 0]
    np.testing.assert_array_equal(growth > 0, excess(omega) > 0)
    radius = c_points.radii(flow, row, cycle, growth)
    low, high = omega / (1 + radius[:, 0]), omega / (1 - radius[:, 1])
    for edge in edges:
        assert not ((low < edge * (1 - 1e-5)) & (high > edge * (1 + 1e-5))).any()
    assert (radius > 0).mean() > 0.9


def test_nothing_is_proved_where_a_form_is_not_definite() -> None:
    """An undamped mode: the loss of its action is 0."""
    flow, row, cycle = points_of(train((1.37, 1.62), 0.2, 1, (0.3, 0.3), damping={"modal": [0, 0.01, 0.01]}), 2, 3, 9)
    logs = c_points.moduli(flow, row, cycle)
    radius = c_points.radii(flow, row, cycle, logs[:, 0])
    stable = np.abs(logs[:, 0]) < 1e-9
    assert (radius[stable].min(axis=1) == 0).all()


def test_rounding_takes_proofs_away() -> None:
    flow, row, cycle = points_of(train((1.37, 1.62), 0.2, 1, (0.3, 0.3), damping_ratio=0.01), 1.1, 6.5, 25)
    growth = c_points.moduli(flow, row, cycle)[:, 0]
    exact, rough = (c_points.radii(replace(flow, rounding=error), row, cycle, growth) for error in (1e-13, 1e-3))
    assert (rough <= 1.05 * exact + 1e-12).all()
    assert (rough == 0).mean() > (exact == 0).mean()


def unstable_inside(system: GearSystem, proved: np.ndarray, points: int, seed: int) -> np.ndarray:
    """Random mesh frequencies in proved stretches at which the system grows."""
    rng = np.random.default_rng(seed)
    width = np.diff(proved, axis=1)[:, 0]
    k = rng.choice(len(width), points, p=width / width.sum())
    omega = proved[k, 0] + width[k] * rng.random(points)
    return omega[solve(system, omega).growth_rate[0] > 0]


def contradictions(seed: int, raster: int, points: int) -> tuple[list[float], list[float], float]:
    """(missed or false in a refined raster, unstable in proved stretches, share of the stable part that is proved)."""
    system, start, stop = random_train(seed)
    found = boundaries(system, start, stop)
    inside = unstable_inside(system, found.proved[0], points, seed) if len(found.proved[0]) else np.empty(0)
    share = float(found.stable_share(found.proved)[0])
    return missed(system, found, start, stop, raster), inside.tolist(), share


@pytest.mark.parametrize("seed", range(8))
def test_random_trains_against_a_refined_raster(seed: int) -> None:
    wrong, unstable, share = contradictions(seed, 2000, 5000)
    assert wrong == []
    assert unstable == []
    assert share > 0.999


@pytest.mark.slow
@pytest.mark.parametrize("part", range(10))
def test_no_tongue_is_missed_in_two_hundred_random_trains(part: int) -> None:
    """200 trains; 10^6 random points in what is proved."""
    shares = []
    for seed in range(20 * part, 20 * part + 20):
        wrong, unstable, share = contradictions(seed, 4000, 5000)
        assert wrong == [], seed
        assert unstable == [], seed
        shares.append(share)
    assert min(shares) > 0.99


def test_what_is_proved_counted_and_unstable_is_the_whole_range() -> None:
    epsilon = np.array([0.05, 0.3, 0.5])
    system = train((1.37, 1.62), 0.2, "3/5", (epsilon, epsilon), damping_ratio=0.01)
    found = boundaries(system, 1.0, 7.0)
    proved, counted = (found.stable_share(parts) for parts in (found.proved, found.counted))
    assert (proved > 0.9999).all()
    # What is left lies beside edges, within the width floor and the rounding of what is near.
    assert (proved + counted > 1 - 2e-5).all()
    for row in range(3):
        parts = found.proved[row]
        assert (parts[:, 1] > parts[:, 0]).all()
        assert (parts[1:, 0] >= parts[:-1, 1]).all()
        for low, high in zip(found.lower[found.row == row], found.upper[found.row == row], strict=True):
            assert not ((parts[:, 0] < high * (1 - 1e-9)) & (parts[:, 1] > low * (1 + 1e-9))).any()


def test_without_damping_everything_is_counted_and_nothing_proved() -> None:
    found = boundaries(train((1.37, 1.62), 0.2, 1, (0.3, 0.3)), 1.0, 7.0)
    assert [len(parts) for parts in found.proved] == [0]
    np.testing.assert_allclose(found.stable_share(found.counted), 1.0, rtol=1e-12)


def test_a_small_budget_proves_less_and_says_so() -> None:
    system = train((1.37, 1.62), 0.2, "49/50", (0.3, 0.3), damping_ratio=0.01)
    full, half = boundaries(system, 1.0, 7.0), boundaries(system, 1.0, 7.0, budget=1e7)
    shares = [found.stable_share(found.proved)[0] for found in (full, half)]
    assert shares[0] > 0.999
    assert shares[1] < 0.9
    assert half.stable_share(half.counted)[0] < 1 - shares[1] + 1e-12
    assert half.evaluations[0] < full.evaluations[0]


def test_results_do_not_depend_on_the_number_of_threads() -> None:
    system = train((1.37, 1.62), 0.2, "3/5", (0.3, 0.3), damping_ratio=0.005)
    found = []
    for threads in (1, 2):
        with ckernel.using(threads=threads):
            found.append(boundaries(system, 1.0, 7.0))
    np.testing.assert_array_equal(found[0].lower, found[1].lower)
    np.testing.assert_array_equal(found[0].proved[0], found[1].proved[0])


def test_parts_of_a_system_count_where_all_are_known() -> None:
    """Two parts, each with its own stretches; what is unstable of one is nothing stable."""
    coverage = Coverage(1, 0.0, 10.0)
    coverage.add(0, np.array([[0.0, 6.0]]), np.array([[6.0, 10.0]]))
    coverage.add(0, np.array([[4.0, 10.0]]), np.empty((0, 2)))
    proved, counted = coverage.of(0, np.array([[2.0, 4.5]]))
    np.testing.assert_array_equal(proved, [[4.5, 6.0]])
    np.testing.assert_array_equal(counted, [[6.0, 10.0]])
    np.testing.assert_array_equal(complement(np.array([[3.0, 4.0], [1.0, 3.5]]), 0.0, 5.0), [[0.0, 1.0], [4.0, 5.0]])
    assert len(complement(np.array([[-1.0, 9.0]]), 0.0, 5.0)) == 0
