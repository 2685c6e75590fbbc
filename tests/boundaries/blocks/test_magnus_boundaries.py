"""Boundaries of smooth mesh stiffness: Mathieu's characteristic values, verdicts on both sides, honest tolerances."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from krein_search import counts
from planetary_gears import cyclic
from scipy.optimize import brentq
from scipy.special import mathieu_a, mathieu_b
from systems import COSINE, GENERAL, TRAPEZOID, WAVE, oscillator, smooth_train

from gearstab.floquet import solve
from gearstab.floquet.boundaries import boundaries
from gearstab.floquet.boundaries.counting.points import exact
from gearstab.floquet.boundaries.damped.search import Limits
from gearstab.floquet.boundaries.smooth import SteppedPeriod
from gearstab.floquet.smooth.steps import CF4_2, divisions
from gearstab.waveforms import Rectangular, Trapezoidal


def mathieu_edges(epsilon, order):
    """Lower and upper edge in Omega of the region 2 w/order of y'' + (1 + 2 eps cos Omega t) y = 0.

    The transition curves a_m(q), b_m(q) at a = 4/Omega^2, q = a eps; a > 2 q keeps the stiffness positive.
    """
    found = []
    for curve in (mathieu_a, mathieu_b):

        def off(a, curve=curve):
            return float(curve(order, a * epsilon)) - a

        top = order**2 + 1.0
        while off(top) > 0:
            top *= 1.5
        found.append(2 / np.sqrt(brentq(off, 0.2 * order**2, top, xtol=1e-14, rtol=1e-15)))
    return sorted(found)


class TestMathieu:
    @pytest.mark.parametrize("epsilon", [0.05, 0.2, 0.45])
    def test_transition_curves(self, epsilon):
        """The product's edges are within their stored tolerance of scipy's curves, and that is below 1e-10."""
        found = boundaries(oscillator(COSINE, epsilon), 0.36, 4.0, 1e-11, 1e-9)
        names = {"2w1": 1, "w1": 2, "2w1/3": 3, "w1/2": 4, "2w1/5": 5}
        assert set(names) - {"2w1/5", "w1/2"} <= set(found.labels())
        for label, lower, upper, tolerance, cut in zip(
            found.labels(), found.lower, found.upper, found.tolerance, found.cut, strict=True
        ):
            if cut.any():
                continue
            assert tolerance < 2e-11
            for edge, known in zip((lower, upper), mathieu_edges(epsilon, names[label]), strict=True):
                # scipy's characteristic values are right to some 1e-14.
                assert abs(edge - known) <= (tolerance + 1e-13) * known

    def test_edges_of_too_few_steps_are_followed_to_where_more_have_them(self, monkeypatch):
        # Wrong by some 1e-8 at first, which is far below the width floor: nothing is searched twice.
        monkeypatch.setattr(SteppedPeriod, "resolution", 2)
        found = boundaries(oscillator(COSINE, 0.3), 1.3, 4.0, 1e-11, 1e-5)
        np.testing.assert_allclose((found.lower[0], found.upper[0]), mathieu_edges(0.3, 1), rtol=2e-11)
        assert found.tolerance[0] < 2e-11

    def test_a_coarse_tolerance_is_kept_too(self):
        found = boundaries(oscillator(COSINE, 0.3), 1.3, 4.0, 1e-5)
        (lower, upper), known = (found.lower[0], found.upper[0]), mathieu_edges(0.3, 1)
        np.testing.assert_allclose((lower, upper), known, rtol=float(found.tolerance[0]))
        assert found.tolerance[0] < 2e-5


def check_edges(found, systems, least=0.0):
    """Just inside every edge there is growth, just outside there is none, by the other method.

    least: part of the width by which the points inside are inside, where growth nearer to the edge is below what
    counts as unstable (1e-10 a period with damping, what rounding leaves of symplecticity in large systems).
    """
    assert len(found.row)
    for row, lower, upper, tolerance, cut in zip(
        found.row, found.lower, found.upper, found.tolerance, found.cut, strict=True
    ):
        near, inside = 3 * tolerance, max(3 * tolerance, least * (upper / lower - 1))
        omega = np.array([lower * (1 - near), lower * (1 + inside), upper * (1 - inside), upper * (1 + near)])
        verdict = solve(systems[row], omega, tolerance=1e-13).stable[0]
        expected = np.array([1, 0, 0, 1])
        kept = np.repeat(~cut, 2)
        np.testing.assert_array_equal(verdict[kept], expected[kept])


class TestEdges:
    def test_conservative_rows(self):
        epsilon = np.array([0.0, 0.15, 0.3])
        found = boundaries(smooth_train(TRAPEZOID, WAVE, epsilon), 1.5, 6.5)
        check_edges(found, [smooth_train(TRAPEZOID, WAVE, e) for e in epsilon])
        assert set(found.row) == {1, 2}
        assert np.all(found.tolerance < 1.2e-10)

    @pytest.mark.slow
    def test_two_frequencies(self):
        system = smooth_train(WAVE, Rectangular(1.4), 0.2, Fraction(3, 5))
        check_edges(boundaries(system, 3.0, 6.5), [system])

    @pytest.mark.parametrize("damping", [0.03 * np.diag([1.0, 0.3, 4.0]), GENERAL], ids=["alike", "general"])
    def test_damped(self, damping):
        system = smooth_train(WAVE, TRAPEZOID, damping=damping)
        check_edges(boundaries(system, 1.5, 6.5), [system], least=1e-5)

    def test_ramps_of_no_width_are_a_rectangle(self):
        found = boundaries(smooth_train(Trapezoidal(1.4, 0.0), Trapezoidal(1.6, 0.0)), 1.0, 6.5)
        known = boundaries(smooth_train(Rectangular(1.4), Rectangular(1.6)), 1.0, 6.5)
        assert found.labels() == known.labels()
        # Each within 1e-10 of the truth.
        np.testing.assert_allclose(found.lower, known.lower, rtol=2e-10)
        np.testing.assert_allclose(found.upper, known.upper, rtol=2e-10)

    def test_many_modes(self):
        planetary = cyclic(3, epsilon=0.2)
        meshes = tuple(replace(m, waveform=Trapezoidal(m.waveform.contact_ratio, 0.1)) for m in planetary.meshes)
        system = replace(planetary, meshes=meshes)
        check_edges(boundaries(system, 5.0, 6.0, 1e-9, 1e-5), [system], least=1e-3)


class TestIntegers:
    def test_rough_segments_count_as_the_fine_ones_do(self):
        """The integers of the search are those of segments as fine as the matrices', where these may be asked."""
        (division,) = divisions(smooth_train(WAVE, TRAPEZOID, 0.4))

        limits = Limits(0.8, 7.0, 1e-10, 1e-6, 0.0)
        few = SteppedPeriod.of(division, limits).pattern(4)
        # Of positive durations, as the Morse index wants them, and far finer than the rough ones.
        many = division.pattern(CF4_2, 14)
        assert len(many.states) > 10 * len(few.states)
        assert len(exact(few).states) > len(few.states)
        cycle = np.linspace(*(limit[0] for limit in limits.cycles(many)), 300)
        row = np.zeros(len(cycle), dtype=int)
        ours, theirs = (counts(pattern, row, cycle) for pattern in (few, many))
        agree = ours.stable == theirs.stable
        # Only within 1e-6 of an edge may they differ.
        assert agree.mean() > 0.99
        known = agree & ours.known & theirs.known
        assert known.mean() > 0.95
        np.testing.assert_array_equal(ours.begun[known], theirs.begun[known])
        np.testing.assert_array_equal(ours.ended[known], theirs.ended[known])
