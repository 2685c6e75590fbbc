"""Smooth mesh stiffness: against an integrator in extended precision, closed forms, and what must not matter."""

from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import numpy as np
import periodic_reference as reference
import pytest
from planetary_gears import cyclic
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.special import mathieu_a, mathieu_b
from systems import (
    COSINE,
    GENERAL,
    SMOOTH_OMEGA,
    SMOOTH_SYSTEMS,
    TRAPEZOID,
    WAVE,
    oscillator,
    smooth_train,
    with_ramps,
)

import gearstab
from gearstab.floquet import STATUS_FLAGS, solve
from gearstab.floquet.smooth import control, steps
from gearstab.floquet.smooth.steps import CF4_2, CF6_5
from gearstab.waveforms import Fourier, Rectangular, Trapezoidal


def multipliers(system, omega, found):
    """``(P, 2n)`` from the exponents of a single system."""
    period = 2 * np.pi * float(system.common_period()[0]) / omega
    return np.exp(found.exponents[0] * period[:, None])


@pytest.fixture(scope="module")
def references():
    """Multipliers of all scenes; twice the steps change them by less than 1e-14."""
    if not reference.EXTENDED:
        pytest.skip("no extended precision here")
    return {
        name: reference.multipliers(system, SMOOTH_OMEGA, steps) for name, (system, steps) in SMOOTH_SYSTEMS.items()
    }


class TestSchemes:
    """The coefficients do what their source says."""

    @pytest.mark.parametrize("scheme", [CF4_2, CF6_5], ids=lambda s: s.name)
    def test_consistent_and_symmetric(self, scheme):
        assert scheme.durations.sum() == pytest.approx(1.0, abs=1e-15)
        # The sum over all exponentials is the Gauss-Legendre rule.
        np.testing.assert_allclose(scheme.weights.sum(axis=0), np.array([5, 8, 5]) / 18, rtol=0, atol=1e-15)
        np.testing.assert_allclose(scheme.weights[::-1, ::-1], scheme.weights, rtol=0, atol=1e-15)

    @pytest.mark.parametrize("scheme", [CF4_2, CF6_5], ids=lambda s: s.name)
    def test_order_on_matrices_that_do_not_commute(self, scheme):
        rng = np.random.default_rng(1)
        a, b, c, d = 0.7 * rng.standard_normal((4, 4, 4))

        def field(t):
            return a + b * np.sin(2 * t) + c * np.cos(3 * t) + d * np.exp(-t)

        exact = solve_ivp(
            lambda t, y: (field(t) @ y.reshape(4, 4)).ravel(),
            (0, 1),
            np.eye(4).ravel(),
            "DOP853",
            rtol=1e-13,
            atol=1e-14,
        ).y[:, -1]
        errors = []
        for count in (4, 8, 16):
            product = np.eye(4)
            for k in range(count):
                values = [field((k + x) / count) for x in scheme.nodes]
                for row in scheme.weights:
                    product = expm(sum(w * v for w, v in zip(row, values, strict=True)) / count) @ product
            errors.append(np.abs(product.ravel() - exact).max())
        slopes = np.log2(np.array(errors[:-1]) / errors[1:])
        # Measured 3.98, 4.04 and 5.98 for the last doubling.
        assert slopes[-1] > scheme.order - 0.1, slopes


class TestEstimate:
    """The estimate is never below the error, and not far above it."""

    @pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-9, 1e-12])
    @pytest.mark.parametrize("name", SMOOTH_SYSTEMS)
    def test_honest_and_within_the_tolerance(self, name, tolerance, references):
        system, _ = SMOOTH_SYSTEMS[name]
        found = solve(system, SMOOTH_OMEGA, exponents=True, tolerance=tolerance)
        error = reference.distance(multipliers(system, SMOOTH_OMEGA, found), references[name])
        estimate = found.error_estimate[0]
        assert np.all(error <= estimate), (error / estimate).max()
        flagged = found.status[0] & STATUS_FLAGS["not_converged"] > 0
        np.testing.assert_array_equal(flagged, estimate > tolerance)
        # At 1e-12 multipliers that nearly coincide are out of reach.
        assert flagged.mean() <= (0.3 if tolerance == 1e-12 else 0.0)
        # A reference of which 1e-15 is rounding does not tell ratios at 1e-12.
        assert np.median(estimate / np.maximum(error, 1e-15)) < 30

    @pytest.mark.parametrize("name", SMOOTH_SYSTEMS)
    def test_growth_is_as_right_as_the_largest_multiplier(self, name, references):
        system, _ = SMOOTH_SYSTEMS[name]
        found = solve(system, SMOOTH_OMEGA, tolerance=1e-9)
        largest = np.log(np.abs(references[name]).max(axis=1))
        period = 2 * np.pi * float(system.common_period()[0]) / SMOOTH_OMEGA
        growth = found.growth_rate[0] * period
        # Relative to multipliers below 1 an absolute error of theirs is the larger, the more they have decayed.
        allowed = found.error_estimate[0] * np.exp(np.maximum(-largest, 0.0)) + 1e-13
        # Rounding splits double multipliers of the reference on the circle by up to 1e-8.
        kept = (found.stable[0] == 0) | (np.abs(largest) > 1e-7)
        assert np.all(np.abs(growth - largest)[kept] <= allowed[kept])

    @pytest.mark.parametrize("name", ["Fourier", "trapezoids", "two frequencies", "decay of all alike"])
    def test_points_among_many_are_as_honest(self, name, references):
        system, _ = SMOOTH_SYSTEMS[name]
        # Many enough for matrices to be interpolated.
        omega = np.sort(np.concatenate([SMOOTH_OMEGA, np.linspace(0.7, 6.2, 900)]))
        chosen = np.searchsorted(omega, SMOOTH_OMEGA)
        largest = np.log(np.abs(references[name]).max(axis=1))
        for tolerance in (1e-4, 1e-9):
            found = solve(system, omega, exponents=True, tolerance=tolerance)
            estimate = found.error_estimate[0, chosen]
            error = reference.distance(multipliers(system, omega, found)[chosen], references[name])
            assert np.all(error <= estimate)
            growth = (found.growth_rate[0] * 2 * np.pi * float(system.common_period()[0]) / omega)[chosen]
            kept = (found.stable[0, chosen] == 0) | (np.abs(largest) > 1e-7)
            allowed = estimate * np.exp(np.maximum(-largest, 0.0)) + 1e-13
            assert np.all(np.abs(growth - largest)[kept] <= allowed[kept])

    def test_single_points_are_as_honest(self, references):
        name = "Fourier"
        system, _ = SMOOTH_SYSTEMS[name]
        for k in range(0, len(SMOOTH_OMEGA), 5):
            one = SMOOTH_OMEGA[k : k + 1]
            found = solve(system, one, exponents=True, tolerance=1e-7)
            error = reference.distance(multipliers(system, one, found), references[name][k : k + 1])
            assert error[0] <= found.error_estimate[0, 0] <= 1e-7

    def test_what_cannot_be_reached_is_said(self):
        found = solve(SMOOTH_SYSTEMS["Fourier"][0], SMOOTH_OMEGA, tolerance=1e-17)
        assert np.all(found.status & STATUS_FLAGS["not_converged"])
        assert np.all(found.error_estimate > 1e-17)
        assert np.median(found.error_estimate) < 1e-12

    def test_fast_variation_is_not_overlooked(self):
        # Thirty cycles of the wave's highest harmonic a period, far more than the first steps could see.
        wave = Fourier(np.zeros(30), np.append(np.zeros(29), 1.0))
        system = oscillator(wave, 0.45)
        omega = np.array([0.0668, 0.5])
        found = solve(system, omega, exponents=True, tolerance=1e-6)
        exact = reference.multipliers(system, omega, 100)
        assert np.all(reference.distance(multipliers(system, omega, found), exact) <= found.error_estimate[0])


class TestIdentities:
    """Same answers in different words."""

    def test_ramps_of_no_width_are_a_rectangle(self):
        ramps = smooth_train(Trapezoidal(1.4, 0.0), Trapezoidal(1.6, 0.0))
        jumps = smooth_train(Rectangular(1.4), Rectangular(1.6))
        found, exact = solve(ramps, SMOOTH_OMEGA, exponents=True), solve(jumps, SMOOTH_OMEGA, exponents=True)
        np.testing.assert_allclose(found.growth_rate, exact.growth_rate, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(found.stable, exact.stable)
        assert exact.error_estimate is None
        assert found.error_estimate.max() < 1e-13

    def test_nothing_varies(self):
        found = solve(smooth_train(WAVE, TRAPEZOID, 0.0), SMOOTH_OMEGA, exponents=True)
        exact = solve(smooth_train(Rectangular(1.5), Rectangular(1.5), 0.0), SMOOTH_OMEGA, exponents=True)
        np.testing.assert_array_equal(found.growth_rate, 0.0)
        np.testing.assert_allclose(found.exponents, exact.exponents, rtol=0, atol=1e-12)

    def test_origin_of_time(self):
        system = smooth_train(WAVE, TRAPEZOID, 0.3, Fraction(1, 2))
        moved = replace(
            system, meshes=tuple(replace(m, lag=m.lag + 0.237 * float(m.frequency_ratio)) for m in system.meshes)
        )
        first, second = (solve(s, SMOOTH_OMEGA, exponents=True, tolerance=1e-10) for s in (system, moved))
        gap = reference.distance(multipliers(system, SMOOTH_OMEGA, first), multipliers(moved, SMOOTH_OMEGA, second))
        assert np.all(gap <= first.error_estimate[0] + second.error_estimate[0])
        np.testing.assert_array_equal(first.stable, second.stable)

    def test_multipliers_of_a_damped_system_have_the_determinant_of_liouville(self):
        system = smooth_train(WAVE, TRAPEZOID, 0.3, damping=GENERAL)
        found = solve(system, SMOOTH_OMEGA, exponents=True, tolerance=1e-6)
        # det M = exp(-T tr M^-1 C) holds for every Magnus step, whatever its length.
        trace = np.trace(np.linalg.solve(system.mass, system.damping))
        np.testing.assert_allclose(found.exponents[0].sum(axis=1).real, -trace, rtol=1e-11)

    def test_rows_of_a_batch_are_systems_of_their_own(self):
        contact, epsilon = np.array([1.2, 1.5, 2.0, 1.9]), np.array([0.3, 0.0, 0.4, 0.2])
        rows = smooth_train(Trapezoidal(contact, 0.15), WAVE, epsilon, lag=np.array([0.0, 0.2, 0.3, 0.3]))
        found = solve(rows, SMOOTH_OMEGA, tolerance=1e-10)
        for k in range(4):
            wave = Trapezoidal(contact[k], 0.15)
            one = solve(smooth_train(wave, WAVE, epsilon[k], lag=rows.meshes[1].lag[k]), SMOOTH_OMEGA, tolerance=1e-10)
            period = 2 * np.pi / SMOOTH_OMEGA
            gap = np.abs(found.growth_rate[k] - one.growth_rate[0]) * period
            assert np.all(gap <= found.error_estimate[k] + one.error_estimate[0])
            np.testing.assert_array_equal(found.stable[k], one.stable[0])

    def test_blocks(self):
        system, omega = with_ramps(cyclic(4, epsilon=0.3)), np.linspace(0.9, 5.8, 12)
        split, whole = (solve(system, omega, reduction=r, tolerance=1e-8) for r in (True, False))
        gap = np.abs(split.growth_rate - whole.growth_rate) * 2 * np.pi / omega
        assert np.all(gap <= split.error_estimate + whole.error_estimate)
        np.testing.assert_array_equal(split.stable, whole.stable)
        (division,) = steps.divisions(system)
        assert division.elastic.static.shape[-1] == 18


class TestMathieu:
    """y'' + (1 + 2 eps cos Omega t) y = 0: a = 4/Omega^2, q = a eps in the notation of scipy."""

    def test_verdicts(self):
        rng = np.random.default_rng(5)
        omega = rng.uniform(0.5, 4.0, 400)
        for epsilon in (0.1, 0.45):
            a = 4 / omega**2
            q = a * epsilon
            order = np.arange(0, 8)
            upper = np.array([[mathieu_a(m, x) for x in q] for m in order])
            lower = np.array([[mathieu_b(m + 1, x) for x in q] for m in order])
            # Stable between a_m and b_(m + 1).
            stable = np.any((a > upper) & (a < lower), axis=0)
            sure = np.abs(np.concatenate([upper, lower]) - a).min(axis=0) > 1e-8
            found = solve(oscillator(COSINE, epsilon), omega)
            np.testing.assert_array_equal(found.stable[0][sure], stable[sure])

    def test_points_at_an_edge_are_marked(self):
        epsilon = 0.3
        edge = 2 / np.sqrt(_edge(lambda q: mathieu_b(1, q), epsilon))
        found = solve(oscillator(COSINE, epsilon), edge * (1 + np.array([-1e-12, 1e-12, 1e-3])), tolerance=1e-7)
        near = found.status[0] & STATUS_FLAGS["near_boundary"] > 0
        assert near[:2].any()
        assert not near[2]

    def test_negative_stiffness_is_marked_where_it_occurs(self):
        soft, stiff = (
            solve(oscillator(COSINE, e), SMOOTH_OMEGA).status & STATUS_FLAGS["negative_stiffness"] for e in (0.6, 0.4)
        )
        assert np.all(soft)
        assert not np.any(stiff)


def _edge(curve, epsilon):
    """a with a = curve(a eps)."""
    a = 1.0
    for _ in range(200):
        a = float(curve(a * epsilon))
    return a


class TestStrongGrowth:
    """Beyond 2^200 a period the matrix is scaled: growth is compared, and right, as elsewhere."""

    def test_growth_is_within_the_estimate(self):
        # x'' + (1 + 2 cos(Omega t)) x = 0: growth of e^311 and more. At 0.0051 the largest multiplier is a small part
        # of the matrix, which rounding errors grow by.
        system, omega = oscillator(replace(COSINE, cos=np.array([0.5])), 2.0), np.array([0.005, 0.0051])
        found = solve(system, omega)
        assert np.all(found.status & STATUS_FLAGS["rescaled"])
        # By reference.multipliers in 4,000 steps.
        expected = [0.2590220806922838, 0.2528016852124215]
        error = np.abs(found.growth_rate[0] - expected) * 2 * np.pi / omega
        assert np.all(error <= found.error_estimate[0])
        assert found.error_estimate[0, 0] < 1e-9
        assert found.error_estimate[0, 1] < 1e-7
        # 10,000 steps of fourth order leave 5e-8.
        assert reference.growth_rate(system, omega[0], 10_000) == pytest.approx(expected[0], abs=1e-10)

    @pytest.mark.parametrize(("entries", "largest"), [(0, 20.0), (control.MOST_ENTRIES, 1e-4)])
    def test_estimates_of_too_few_steps_cover_the_error(self, monkeypatch, entries, largest):
        # 4,519 cycles in a common period. In 65,536 segments multipliers are wrong by a turn, and as near as others.
        monkeypatch.setattr(control, "MOST_ENTRIES", entries)
        wave = {"mean_stiffness": 1.0, "epsilon": 0.3, "waveform": {"kind": "fourier", "cos": [0.5], "sin": [0.0]}}
        train = {
            "kind": "two_stage",
            "inertias": [1.0, 0.3, 4.0],
            "input_shaft_stiffness": 0.5,
            "tooth_ratio": "4519/3",
        }
        train["meshes"] = [{"name": name, **wave} for name in ("first", "second")]
        omega = np.array([1.5, 2.5, 3.5])
        config = {"system": train, "sweep": {"mesh_frequency": [1.5, 3.5]}, "methods": {"floquet": {}}}
        found = solve(gearstab.build(gearstab.load(config)), omega)
        # In 2^20 segments; the last two by reference.growth_rate, extrapolated from 4,519 * 32 steps, too.
        error = found.growth_rate[0] * 2 * np.pi * 4519 / omega - [0.152501, 3.38567, 79.7524]
        # The references have six digits.
        assert np.all(np.abs(error) < found.error_estimate[0] + 5e-5)
        assert found.error_estimate.max() < largest
        assert (found.status & STATUS_FLAGS["not_converged"] > 0).all()

    def test_too_few_steps_are_not_taken_for_convergence(self, monkeypatch):
        # 4,519 cycles of a mesh in a common period take more exponentials than there may be.
        monkeypatch.setattr(control, "MOST_ENTRIES", 0)
        system = smooth_train(COSINE, COSINE, 0.45, Fraction(4519, 3))
        found = solve(system, np.array([0.0013]))
        assert found.growth_rate[0, 0] * 2 * np.pi * 3 / 0.0013 > 140
        assert found.status[0, 0] & STATUS_FLAGS["not_converged"]

    def test_growth_all_the_time(self):
        # Few steps do.
        system, omega, tolerance = oscillator(replace(COSINE, cos=np.array([0.5])), -0.5, -1.0), 0.04, 1e-5
        found = solve(system, np.array([omega]), tolerance=tolerance)
        period, growth = 2 * np.pi / omega, found.growth_rate[0, 0]
        assert growth * period > 150
        assert found.error_estimate[0, 0] <= tolerance
        # 4,000 steps of fourth order leave 3e-10.
        error = np.abs(growth - reference.growth_rate(system, omega, 4_000)) * period
        assert error <= found.error_estimate[0, 0] + 1e-9


class TestDivision:
    """The period is cut where it should be."""

    def test_constant_pieces_are_one_segment(self):
        (division,) = steps.divisions(smooth_train(TRAPEZOID, TRAPEZOID, lag=0.0))
        np.testing.assert_allclose(division.length.sum(axis=1), 1.0)
        assert division.constant.tolist() == [True, False, True, False]
        counts = [division.counts(k) for k in range(6)]
        for k in range(4):
            np.testing.assert_array_equal(counts[k + 2], np.where(division.constant, 1, 2 * counts[k]))
        pattern = division.pattern(CF4_2, 0)
        assert len(pattern.states) == 2 + 2 * (counts[0].sum() - 2)
        np.testing.assert_allclose(pattern.fractions.sum(axis=1), 1.0)

    def test_jumps_of_what_does_not_vary_cut_nothing(self):
        system = smooth_train(Rectangular(1.5), WAVE)
        meshes = (replace(system.meshes[0], epsilon=np.array(0.0)), system.meshes[1])
        (division,) = steps.divisions(replace(system, meshes=meshes))
        assert division.length.shape == (1, 1)

    def test_mean_of_the_exponentials_is_the_mean_stiffness(self):
        for name in ("Fourier", "trapezoids", "samples"):
            for division in steps.divisions(SMOOTH_SYSTEMS[name][0]):
                pattern = division.pattern(CF6_5, 4)
                mean = np.einsum("rs,rsm->rm", pattern.fractions, pattern.levels)
                # Gauss-Legendre nodes on analytic pieces: exact for ramps and cubics.
                np.testing.assert_allclose(mean, division.functions.offsets(division.rows), rtol=0, atol=1e-9)


def test_an_estimate_holds_what_rounding_leaves(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two resolutions that agree to the last digit may both be wrong by their rounding."""
    change, rounding = np.array([[0.0, 0.0, 0.0, 1e-9]]), np.array([[1e-13, 2e-13, 0.0, 3e-13]])
    monkeypatch.setattr(control, "difference", lambda *_: (change, rounding))
    answer: Any = SimpleNamespace(rounding=rounding)
    error, part, _ = control.estimated(answer, answer, 0 * change, 0.5, change >= 0)
    np.testing.assert_array_equal(part, rounding)
    np.testing.assert_allclose(error, 0.5 * change + rounding, rtol=1e-15)
