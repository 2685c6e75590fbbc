"""E-folds by growth rates, and how far they are from the exact ones."""

import numpy as np
import pytest
from random_trains import light_train
from scipy.integrate import quad
from systems import train

from gearstab.floquet import solve
from gearstab.floquet.boundaries import boundaries
from gearstab.floquet.boundaries.damped import search
from gearstab.mesh import Mesh
from gearstab.modal import modal_damping_matrix
from gearstab.passage import STATUS_FLAGS, excess, gains, growth_over_speed, passage
from gearstab.propagation.path import Path
from gearstab.system import GearSystem
from gearstab.waveforms import Rectangular


def damped(ratio, epsilon=0.3):
    from dataclasses import replace

    system = train(epsilon)
    return replace(system, damping=modal_damping_matrix(system.mass, system.mean_stiffness_matrix(), np.full(3, ratio)))


def over_speed(system, low=0.9, high=7.0):
    found = boundaries(system, low, high)
    return growth_over_speed(system, found, 1e-9)[0], found


@pytest.mark.parametrize("ratio", [0.0, 0.01])
def test_quadrature_between_the_edges_says_the_same(ratio):
    system = damped(ratio) if ratio else train(0.3)
    over, found = over_speed(system)

    def rate(omega):
        return float(solve(system, np.array([omega])).growth_rate[0, 0])

    regions = np.flatnonzero(over.region >= 0)
    assert len(regions) == len(found.row)
    for k in regions[np.argsort(-over.gained[regions])][:4]:
        # With the roots at the edges taken out by the substitution that quad knows.
        low, high = over.edges[k], over.edges[k + 1]
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        expected = quad(lambda p, m=middle, h=half: rate(m + h * np.sin(p)) * h * np.cos(p), -np.pi / 2, np.pi / 2)[0]
        assert over.gained[k] == pytest.approx(expected, abs=over.error[k] + 1e-9, rel=2e-4)
        highest = max(rate(middle + half * x) for x in np.linspace(-0.99, 0.99, 61))
        assert over.peak[k] == pytest.approx(highest, rel=0.02)
    if not ratio:
        assert np.abs(over.gained[over.region < 0]).max(initial=0.0) == 0.0


def test_a_region_passed_slowly_gains_what_landau_and_zener_say():
    # One tongue of a gear pair: arccosh(exp g) between its two sides, g = int sigma dOmega/rate, as epsilon -> 0.
    mesh = Mesh("mesh", np.array([1.0]), np.array(1.0), np.array(0.05), Rectangular(np.array(1.5)))
    pair = GearSystem(np.eye(1), np.zeros((1, 1)), (mesh,))
    base = 0.0
    for rate in (1e-4, 3e-4, 1e-3):
        values, index = passage(pair, [Path.ramp(1.5, 2.5, rate)], 10.0, np.array([rate]), 1e-10, 1e-6)
        assert [key[0].label for key in index] == ["2w1"]
        g = values["growth"][0, 0]
        # Half of the ratio of stiffnesses is 0.05 e-folds, and the ends are not infinitely far.
        assert values["growth_through"][0, 0] == pytest.approx(np.arccosh(np.exp(g)), abs=0.2)
        best = values["growth_exact"][0, 0] - g
        assert np.arccosh(np.exp(g)) - g <= best <= excess(np.array(g)) + 0.05
        assert best > 0.75 * excess(np.array(g))
        assert values["growth_by_tongue"][0, 0, 0] == g
        base = base or g * rate
        assert g * rate == pytest.approx(base, rel=1e-12)
        assert values["slowest_rate"][0] == pytest.approx(base / np.log(10.0), rel=1e-12)
        # The middle of the tongue grows fastest.
        assert values["dwell_frequency"][0, 0] == pytest.approx(2.0, abs=0.01)


SLOW = pytest.mark.slow
"""Every path is followed for thousands of mesh cycles."""


@pytest.mark.parametrize("ratio", [0.0, pytest.param(0.003, marks=SLOW), 0.01, pytest.param(0.03, marks=SLOW)])
def test_the_exact_growth_is_within_the_stated_error(ratio):
    rates = np.array([0.01, 0.1, 1.0, 10.0, -0.03])
    random = np.random.default_rng(int(1000 * ratio))
    for _ in range(3):
        system = damped(ratio, random.uniform(0.05, 0.4)) if ratio else train(random.uniform(0.05, 0.4))
        paths = [Path.ramp(0.9, 7.0, rate) for rate in rates]
        values, _ = passage(system, paths, 10.0, rates, 1e-8, 1e-6)
        off = np.abs(values["growth_exact"] - values["growth"])
        assert np.all(off <= values["growth_error"])
        assert np.array_equal(values["status"] > 0, values["growth_exact"] > 30)
        assert np.all(values["growth_exact"] >= 0)


def test_dwelling_grows_at_the_growth_rate():
    system = train(0.3)
    over, _ = over_speed(system, 4.0, 7.0)
    speed = 5.4
    path = Path(np.array([0.0, 50.0]), np.array([speed, speed]))
    rate = float(solve(system, np.array([speed])).growth_rate[0, 0])
    assert rate > 0.2
    assert gains(over, path).largest()[0] == pytest.approx(50 * rate, rel=1e-6)
    path = Path(np.array([0.0, 1.0, 51.0]), np.array([5.3, speed, speed]))
    values, _ = passage(system, [path], 10.0, np.array([1.0]), 1e-8, 1e-6)
    assert values["growth_exact"][0, 0] == pytest.approx(values["growth"][0, 0], abs=values["growth_error"][0, 0])


def test_decay_between_regions_counts():
    # Two regions with a stable gap: with damping the sum of both is not reached.
    system = damped(0.02)
    over, _ = over_speed(system)
    positive = over.gained[over.region >= 0]
    slow = gains(over, Path.ramp(0.9, 7.0, 1.0)).largest()[0]
    assert slow == pytest.approx(positive.max(), rel=1e-9)
    free, _ = over_speed(train(0.3))
    every = gains(free, Path.ramp(0.9, 7.0, 1.0)).largest()[0]
    assert every == pytest.approx(free.gained[free.region >= 0].sum(), rel=1e-9)


def test_a_path_of_two_knots_is_a_ramp_and_may_turn():
    over, _ = over_speed(train(0.3))
    ramp, path = Path.ramp(1.0, 6.0, 0.1), Path(np.array([0.0, 50.0]), np.array([1.0, 6.0]))
    assert gains(over, ramp).largest()[0] == pytest.approx(gains(over, path).largest()[0], rel=1e-12)
    there_and_back = Path(np.array([0.0, 50.0, 100.0]), np.array([1.0, 6.0, 1.0]))
    once, twice = gains(over, path), gains(over, there_and_back)
    assert twice.gain.sum() == pytest.approx(2 * once.gain.sum(), rel=1e-9)
    inner = Path(np.array([0.0, 10.0, 50.0]), np.array([1.0, 2.0, 6.0]))
    assert gains(over, inner).gain.sum() == pytest.approx(once.gain.sum(), rel=1e-9)


@pytest.mark.parametrize(("pursuit", "flag"), [(search.PURSUIT, "sampled"), (0.0, "coarse")])
def test_status_says_how_regions_were_searched_that_are_neither_proved_nor_counted(monkeypatch, pursuit, flag):
    monkeypatch.setattr(search, "PURSUIT", pursuit)
    monkeypatch.setattr(search, "EQUAL", search.COARSEST)
    system, start, stop = light_train(34)
    values, _ = passage(system, [Path.ramp(start, stop, 1.0)], 10.0, np.array([1.0]), 1e-6, 1e-6)
    both = STATUS_FLAGS["sampled"] | STATUS_FLAGS["coarse"]
    assert (values["status"] & both == STATUS_FLAGS[flag]).all()
