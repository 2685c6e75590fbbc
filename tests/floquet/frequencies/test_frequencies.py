"""Many mesh frequencies: long common periods, one frequency at a time, Lyapunov exponents."""

from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
import pytest
import systems
from scipy.optimize import brentq

from gearstab.floquet import STATUS_FLAGS, frequencies, solve
from gearstab.floquet.frequencies import chosen, common_period, groups, lyapunov
from gearstab.floquet.kernel import c_kernel, factors
from gearstab.floquet.segments.pattern import prepare, window
from gearstab.mesh import Mesh, PeriodicTerm
from gearstab.modal import mean_modes, modal_damping_matrix
from gearstab.system import GearSystem
from gearstab.waveforms import Fourier, Rectangular, Scaled, Trapezoidal

GOLDEN = (np.sqrt(5) - 1) / 2


def train(ratio="3/5", epsilon=(0.3, 0.3), damping_ratio=0.0, lag=0.0):
    """Lin & Parker's train with a second mesh of any frequency."""
    system = systems.train(epsilon, (1.5, 1.3), lag, ratio)
    if not damping_ratio:
        return system
    ratios = np.full(3, damping_ratio)
    return replace(system, damping=modal_damping_matrix(system.mass, system.mean_stiffness_matrix(), ratios))


class TestLongPeriods:
    def test_memory_bound_does_not_change_anything(self, monkeypatch):
        system = train(Fraction(7, 17), damping_ratio=0.01).over((5,))
        omega = np.linspace(1.0, 4.0, 7)
        for item in (system, replace(system, damping=None)):
            plain = solve(item, omega, exponents=True)
            with monkeypatch.context() as patch:
                patch.setattr(c_kernel, "ENTRIES_AT_ONCE", 1)
                patch.setattr(factors, "ENTRIES_AT_ONCE", 1)
                again = solve(item, omega, exponents=True)
            # Stacks of matrices and single ones may be multiplied in another order.
            np.testing.assert_allclose(plain.growth_rate, again.growth_rate, rtol=1e-12, atol=1e-12)
            np.testing.assert_allclose(plain.exponents, again.exponents, atol=1e-11)

    @pytest.mark.parametrize("damping_ratio", [0.0, 0.02])
    def test_a_period_repeated_many_times_has_the_same_growth(self, damping_ratio):
        # r = 1/2 written as 1/2 + 5e-4: the common period is 2,000 cycles, of growths up to e^200.
        omega = np.array([2 * 0.5412, 3.3])
        close = Fraction(1001, 2000)
        found = solve(train(close, epsilon=(0.4, 0.0), damping_ratio=damping_ratio), omega)
        exact = solve(train(Fraction(1, 2), epsilon=(0.4, 0.0), damping_ratio=damping_ratio), omega)
        # Only the first mesh varies: the growth rates agree but for the rounding of 2,000 periods.
        np.testing.assert_allclose(found.growth_rate, exact.growth_rate, atol=1e-9)

    def test_preparation_of_a_window_of_a_whole_period_is_that_of_the_period(self):
        system = train(lag=np.array([0.0, 0.3]))
        for whole, part in zip(prepare(system), window(system, 5.0), strict=True):
            np.testing.assert_allclose(whole.fractions.sum(axis=1), 1.0, rtol=1e-15)
            np.testing.assert_allclose(part.fractions.sum(axis=1), 1.0, rtol=1e-15)
            share = [np.bincount(p.states, p.fractions[0], minlength=4) for p in (whole, part)]
            np.testing.assert_allclose(*share, atol=1e-14)


class TestPerMesh:
    @pytest.mark.parametrize("damping_ratio", [0.0, 0.01])
    @pytest.mark.parametrize("which", [0, 1])
    def test_exact_where_one_mesh_varies(self, which, damping_ratio):
        epsilon = (0.4, 0.0) if which == 0 else (0.0, 0.4)
        system = train(epsilon=epsilon, damping_ratio=damping_ratio)
        omega = np.linspace(0.8, 8.0, 60)
        exact, found = solve(system, omega), frequencies.solve(system, omega, solve)
        # The rounding errors of one and of five or three periods.
        np.testing.assert_allclose(found.growth_rate, exact.growth_rate, atol=1e-11)
        np.testing.assert_array_equal(found.stable, exact.stable)
        assert np.any(found.growth_rate > 0.01)
        np.testing.assert_array_equal(found.by_mesh[..., which], found.growth_rate)

    def test_a_mesh_that_does_not_vary_has_no_say(self):
        # Row 0 varies in both meshes, row 1 in the first only, row 2 in none: there the constant system is the answer.
        system = train(epsilon=(np.array([0.4, 0.4, 0.0]), np.array([0.4, 0.0, 0.0])), damping_ratio=0.01)
        found = frequencies.solve(system, np.array([0.9]), solve)
        np.testing.assert_array_equal(found.growth_rate[0], found.by_mesh[0].max(axis=-1))
        np.testing.assert_array_equal(found.growth_rate[1], found.by_mesh[1, :, 0])
        assert found.growth_rate[1, 0] < found.by_mesh[1, 0, 1]
        np.testing.assert_allclose(found.growth_rate[2], -0.01 * train_frequency(1), rtol=1e-12)

    def test_meshes_of_one_frequency_vary_together(self):
        system = train(ratio=Fraction(1))
        omega = np.linspace(0.8, 8.0, 60)
        found = frequencies.solve(system, omega, solve)
        assert [group.name for group in groups(system)] == ["first+second"]
        np.testing.assert_allclose(found.growth_rate, solve(system, omega).growth_rate, rtol=1e-12, atol=1e-12)

    def test_difference_from_the_exact_result_is_of_higher_order(self):
        # In the middle of a tongue of the first mesh that meets none of the second one, growth is proportional to
        # epsilon. What the other mesh does to it is to move the tongue by O(epsilon^2), which costs O(epsilon^3).
        omega = np.array([2 * train_frequency(3)])
        difference = []
        for epsilon in (0.1, 0.05, 0.025):
            system = train(Fraction(7, 17), (epsilon, epsilon))
            exact, found = solve(system, omega), frequencies.solve(system, omega, solve)
            assert found.growth_rate > 0.4 * epsilon
            difference.append(float(np.abs(exact.growth_rate - found.growth_rate)[0, 0]))
        slopes = np.diff(np.log(difference)) / np.log(0.5)
        assert np.all(slopes > 2.8)

    def test_terms_keep_their_mean(self):
        # A term that follows the wave of a mesh of another frequency: its mean stays, its variation goes.
        system = train()
        u = np.array([0.0, 0.0, 1.0])
        term = PeriodicTerm("term", u, u, stiffness=Scaled(Rectangular(1.25), 0.2, 0.3), frequency_ratio=Fraction(1, 7))
        (first, *_) = groups(replace(system, terms=(term,)))
        frozen = frequencies.alone(replace(system, terms=(term,)), first)
        assert frozen.terms[0].stiffness.value(np.array(0.1)) == pytest.approx(0.2, rel=1e-14)
        assert np.all(frozen.meshes[1].epsilon == 0)


def random_system(rng, points):
    """A system of 2 to 5 coordinates and 2 or 3 meshes of small frequency ratios, and mesh frequencies."""
    n, count = int(rng.integers(2, 6)), int(rng.integers(2, 4))
    root = rng.standard_normal((n, n))
    ratios = [Fraction(1)] + [Fraction(int(rng.integers(1, 12)), int(rng.integers(1, 12))) for _ in range(count - 1)]
    meshes = tuple(
        Mesh(
            f"m{i}", rng.standard_normal(n), np.asarray(rng.uniform(0.5, 2)), np.asarray(rng.uniform(0.05, 0.45)),
            Rectangular(np.asarray(1 + rng.uniform(0.2, 0.8))), ratio, rng.uniform(),
        )
        for i, ratio in enumerate(ratios)
    )  # fmt: skip
    damping = np.diag(rng.uniform(0, 1, n)) * 10 ** rng.uniform(-3.5, -1)
    system = GearSystem(
        np.diag(rng.uniform(0.3, 3, n)), 0.3 * root @ root.T, meshes, damping if rng.uniform() < 0.7 else None
    )
    return system, rng.uniform(0.3, 2.3, points) * np.sqrt(mean_modes(system).squared_frequency.max())


def train_frequency(mode):
    return float(mean_modes(train()).natural_frequency[mode - 1])


class TestLyapunov:
    @pytest.mark.parametrize("damping_ratio", [0.0, 0.002, 0.02])
    def test_within_its_interval_of_the_exact_growth(self, damping_ratio):
        # Intervals of 99.9 % at 40 points: of independent ones one in 25 runs would have a point outside. They are far
        # wider than the errors where a window holds several beats, which are slow near the edges of tongues.
        system = train(damping_ratio=damping_ratio)
        omega = np.linspace(0.8, 8.0, 40)
        exact = solve(system, omega)
        found = lyapunov.solve(system, omega, cycles=300, confidence=0.999)
        assert np.all(np.abs(found.growth_rate - exact.growth_rate) <= found.interval)
        assert np.median(found.interval) < 0.01
        sure = found.status & STATUS_FLAGS["undecided"] == 0
        grows = (exact.growth_rate > 2 * found.interval) | (exact.growth_rate < -2 * found.interval)
        assert np.all(found.stable[sure & grows] == exact.stable[sure & grows])
        assert np.all(found.status & STATUS_FLAGS["lyapunov"])

    def test_intervals_hold_over_random_systems(self):
        # 95 % intervals of windows much too short for some: of 1,440 points 6 were outside when this was written.
        outside, points = 0, 0
        for seed in range(14):
            system, omega = random_system(np.random.default_rng(seed), 8)
            exact, found = solve(system, omega), lyapunov.solve(system, omega, cycles=50)
            outside += int(np.sum(np.abs(found.growth_rate - exact.growth_rate) > found.interval + 1e-9))
            points += len(omega)
        assert outside <= 0.05 * points

    def test_longer_windows_narrow_the_interval(self):
        system, omega = train(GOLDEN, damping_ratio=0.002), np.linspace(0.8, 8.0, 24)
        short = lyapunov.solve(system, omega, cycles=100).interval
        long = lyapunov.solve(system, omega, cycles=800).interval
        assert np.median(long / short) < 0.3

    def test_fibonacci_ratios_approach_the_golden_ratio(self):
        # Exact growth rates over the common period of 89 cycles (ratio 55/89, off by 6e-5) and the estimate at the
        # golden ratio itself, which has none, are those of one system but for the detuning.
        omega = np.linspace(1.0, 7.0, 40)
        found = lyapunov.solve(train(GOLDEN, damping_ratio=0.01), omega, cycles=500)
        distance = []
        for ratio in (Fraction(5, 8), Fraction(13, 21), Fraction(55, 89)):
            exact = solve(train(ratio, damping_ratio=0.01), omega).growth_rate
            distance.append(np.abs(exact - found.growth_rate).max())
        assert distance[0] > distance[1] > distance[2]
        assert np.all(np.abs(exact - found.growth_rate) <= found.interval + 1e-3)

    def test_reproducible_and_not_dependent_on_the_start(self):
        system, omega = train(GOLDEN, damping_ratio=0.002), np.linspace(1.0, 7.0, 16)
        first, again = (lyapunov.solve(system, omega, cycles=200) for _ in range(2))
        other = lyapunov.solve(system, omega, cycles=200, seed=7)
        np.testing.assert_array_equal(first.growth_rate, again.growth_rate)
        assert not np.array_equal(first.growth_rate, other.growth_rate)
        assert np.all(np.abs(first.growth_rate - other.growth_rate) <= first.interval + other.interval)

    def test_constant_stiffness_is_exact(self):
        # Modal damping ratios zeta = 0.01 decay at zeta w_1.
        found = lyapunov.solve(train(GOLDEN, (0.0, 0.0), 0.01), np.array([1.0, 3.0]), cycles=50)
        np.testing.assert_allclose(found.growth_rate, -0.01 * train_frequency(1), rtol=1e-12)
        np.testing.assert_array_equal(found.interval, 0.0)
        assert np.all(found.stable == 1)

    def test_uniform_decay_shifts_the_growth(self):
        # C = alpha M: every exponent moves by -alpha/2 of the system with stiffness K - alpha^2/4 M, 1e-4 of K here.
        system, omega = train(GOLDEN, (0.4, 0.4)), np.array([2 * train_frequency(2)])
        damped = replace(system, damping=0.02 * system.mass)
        free, found = (lyapunov.solve(s, omega, cycles=300) for s in (system, damped))
        np.testing.assert_allclose(found.growth_rate, free.growth_rate - 0.01, atol=float(found.interval[0, 0]))
        assert found.growth_rate > 0

    def test_rows_of_their_own_lags_and_rigid_bodies(self):
        free = replace(train(), stiffness=np.zeros((3, 3)))
        batch = replace(free, meshes=(free.meshes[0], replace(free.meshes[1], lag=np.array([0.0, 0.37]))))
        omega = np.linspace(1.5, 6.0, 20)
        exact, found = solve(batch, omega), lyapunov.solve(batch, omega, cycles=300, confidence=0.999)
        assert np.all(np.abs(found.growth_rate - exact.growth_rate) <= found.interval)
        assert np.any(exact.growth_rate > 0.01)

    def test_strong_damping_without_a_basis_of_modes(self):
        # Critical damping of every mode of the mean system: the states' generators are nearly defective.
        system, omega = train(damping_ratio=1.0), np.array([1.0, 2.5])
        exact, found = solve(system, omega), lyapunov.solve(system, omega, cycles=60)
        assert np.all(np.abs(found.growth_rate - exact.growth_rate) <= found.interval + 1e-6)

    @pytest.mark.parametrize("damping_ratio", [0.0, 0.005])
    def test_smooth_and_mixed_waves(self, damping_ratio):
        # Against the error-controlled Floquet analysis of the common period of five cycles.
        system = train(damping_ratio=damping_ratio)
        smooth = replace(system.meshes[0], waveform=Fourier(np.array([0.5, 0.1]), np.array([0.0, 0.1])))
        kinked = replace(system.meshes[1], waveform=Trapezoidal(np.array([1.5, 1.3]), np.array([0.1, 0.2])))
        mixed = replace(system, meshes=(smooth, kinked))
        omega = np.array([2.0, 5.4, 6.5])
        exact, found = solve(mixed, omega), lyapunov.solve(mixed, omega, cycles=50, confidence=0.999)
        errors = np.abs(found.growth_rate - exact.growth_rate)
        assert np.all(errors <= found.interval)
        # What is left of the oscillation of ln |x|, some units, after weighted averaging over a time of 150 to 500.
        assert errors.max() < 0.02
        assert np.all(exact.growth_rate[:, 1] > 0.03)

    def test_jumps_cut_into_magnus_steps_are_the_exact_segments(self):
        # A rectangular wave that does not tell what it is goes the other way; every piece is constant and exact.
        @dataclass(frozen=True)
        class Disguised(Rectangular):
            piecewise_constant = False

        system = train(GOLDEN, damping_ratio=0.002, lag=np.array([0.0, 0.2]))
        hidden = tuple(replace(mesh, waveform=Disguised(mesh.waveform.contact_ratio)) for mesh in system.meshes)
        omega = np.array([2.0, 5.4])
        plain = lyapunov.solve(system, omega, cycles=60)
        found = lyapunov.solve(replace(system, meshes=hidden), omega, cycles=60)
        # Rounding of some hundred segments; records are made at other times, which moves averages by far less than
        # the interval.
        np.testing.assert_allclose(found.growth_rate, plain.growth_rate, atol=0.02 * plain.interval.max())

    def test_intervals_that_contain_zero_are_undecided(self):
        # On an edge of a region the growth is zero, well inside and outside of it is not; without damping zero decides.
        system = train(damping_ratio=0.02)
        inside, outside = 5.4, 7.5
        edge = brentq(lambda omega: float(solve(system, np.array([omega])).growth_rate[0, 0]), inside, outside)
        found = lyapunov.solve(system, np.array([inside, edge, outside]), cycles=100)
        undecided = found.status[0] & STATUS_FLAGS["undecided"] != 0
        np.testing.assert_array_equal(undecided, [False, True, False])
        assert found.stable[0, [0, 2]].tolist() == [0, 1]
        free = lyapunov.solve(train(), np.array([inside, outside]), cycles=100)
        assert not np.any(free.status & STATUS_FLAGS["undecided"])

    @pytest.mark.parametrize(
        ("waves", "cycles"), [(None, 20), ((Fourier(np.array([0.0]), np.array([0.5])),) * 2, 4)],
        ids=["jumps", "smooth"],
    )  # fmt: skip
    def test_rows_of_negative_stiffness_are_marked(self, waves, cycles):
        epsilon = np.array([0.3, 1.4, 0.9, 2.5])
        system = systems.train(epsilon, (1.5, 1.5), ratio=GOLDEN, waves=waves)
        softest = system.stiffness_matrix([mesh.lowest_stiffness for mesh in system.meshes])
        # Without a common period both meshes are at their softest at once, sooner or later.
        expected = np.linalg.eigvalsh(softest)[:, 0] < 0
        assert 0 < expected.sum() < 4
        found = lyapunov.solve(system, np.array([3.0]), cycles=cycles)
        np.testing.assert_array_equal(found.status[:, 0] & STATUS_FLAGS["negative_stiffness"] != 0, expected)

    def test_other_periodic_terms_are_refused(self):
        u = np.array([1.0, 0.0, 0.0])
        term = PeriodicTerm("friction", u, u, stiffness=Scaled(Rectangular(1.5), 0.0, 0.1))
        with pytest.raises(ValueError, match="supports only periodic mesh stiffness"):
            lyapunov.solve(replace(train(GOLDEN), terms=(term,)), np.array([1.0]))
        assert chosen(replace(train(GOLDEN), terms=(term,)), "auto").name == "per_mesh"


class TestChoice:
    def test_short_periods_are_solved_exactly(self):
        assert chosen(train(), "auto").name == "common_period"
        found = common_period(train())
        assert (found.cycles, found.mesh_cycles, found.segments) == (5.0, (5, 3), 16)
        # Two of the 16 jumps meet one of the other mesh.
        assert "14 segments" in chosen(train(), "auto").reason

    def test_long_or_no_periods_are_not(self):
        far = train(Fraction(10007, 20011))
        assert chosen(far, "auto").name == "lyapunov"
        assert "more than 20,000" in chosen(far, "auto").reason
        assert chosen(far, "auto", affordable=10**6).name == "common_period"
        assert chosen(train(GOLDEN), "auto").name == "lyapunov"
        assert "no common period" in chosen(train(GOLDEN), "auto").reason
        assert chosen(train(GOLDEN), "per_mesh").name == "per_mesh"

    def test_smooth_waves_take_many_exponentials(self):
        # Each period of the smooth first mesh counts for 40 segments.
        system = train(Fraction(999, 1801))
        smooth = replace(system.meshes[0], waveform=Fourier(np.array([0.5]), np.array([0.0])))
        assert chosen(system, "auto").name == "common_period"
        assert chosen(replace(system, meshes=(smooth, system.meshes[1])), "auto").name == "lyapunov"

    def test_a_window_longer_than_the_common_period_is_not_taken(self):
        """Its 500 cycles of the slower mesh would have 902 of the first one."""
        system = train(Fraction(333, 601))
        assert chosen(system, "auto", affordable=100).name == "common_period"
        assert chosen(system, "auto", affordable=100, cycles=300).name == "lyapunov"

    def test_one_varying_mesh_needs_no_common_period(self):
        assert chosen(train(GOLDEN, (0.3, 0.0)), "auto").name == "per_mesh"

    def test_what_there_is_not(self):
        with pytest.raises(ValueError, match="no common period"):
            chosen(train(GOLDEN), "common_period")
