"""The damping that makes a system stable."""

from dataclasses import replace

import numpy as np
import pytest
from mpmath import mp
from systems import train

from gearstab.floquet import required_damping as module
from gearstab.floquet import solve
from gearstab.floquet.required_damping import FLAGS, RESOLVED, growths, required_damping
from gearstab.floquet.stability import DAMPED_ON_CIRCLE
from gearstab.mesh import Mesh
from gearstab.modal import mean_modes, modal_damping_matrix
from gearstab.perturbation import first_order
from gearstab.system import GearSystem
from gearstab.waveforms import Fourier, Rectangular, Trapezoidal


def with_ratio(system, value):
    mean = system.mean_stiffness_matrix()
    return replace(system, damping=modal_damping_matrix(system.mass, mean, np.full(3, value)))


def bisected(stable, low, high, rounds=40):
    """The end of [low, high] from which on ``stable`` holds."""
    for _ in range(rounds):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if stable(middle) else (middle, high)
    return high


def test_bisection_on_the_growth_map():
    system = train()
    omega = np.linspace(0.4, 7.0, 67)
    found = required_damping(system, omega, tolerance=1e-8).value[0]
    free = solve(system, omega).stable[0]
    assert np.all(found[free == 0] > 0)
    for k in np.flatnonzero(found > 0)[::4]:
        wanted = bisected(lambda z, k=k: solve(with_ratio(system, z), omega[k]).stable[0, 0] == 1, 0.0, 0.5)
        assert found[k] == pytest.approx(wanted, rel=2e-8)


def test_value_is_on_the_stable_side():
    system = train()
    omega = np.linspace(0.4, 7.0, 40)
    found = required_damping(system, omega).value[0]
    for k in np.flatnonzero(found > 0):
        assert solve(with_ratio(system, found[k]), omega[k]).stable[0, 0] == 1
        assert solve(with_ratio(system, found[k] * (1 - 2e-6)), omega[k]).stable[0, 0] == 0


def growth_in_forty_digits(epsilon, ratio, omega):
    """Growth a period of the train at equal modal damping ratios: both meshes are stiff for its first half."""
    with mp.workdps(40):
        system = train(epsilon)
        mass, mean = (mp.matrix(a.tolist()) for a in (system.mass, system.mean_stiffness_matrix()))
        outer = mp.matrix(sum(np.outer(mesh.direction, mesh.direction) for mesh in system.meshes).tolist())
        inverse = mp.inverse(mass)
        half = mp.diag([mp.sqrt(mass[k, k]) for k in range(3)])
        squares, shapes = mp.eigsy(half**-1 * mean * half**-1)
        damping = half * shapes * mp.diag([2 * mp.mpf(ratio) * mp.sqrt(w) for w in squares]) * shapes.T * half
        monodromy = mp.eye(6)
        for level in (mp.mpf(epsilon), -mp.mpf(epsilon)):
            rate = mp.zeros(6)
            rate[:3, 3:] = mp.eye(3)
            rate[3:, :3], rate[3:, 3:] = -inverse * (mean + level * outer), -inverse * damping
            monodromy = mp.expm(rate * mp.pi / mp.mpf(omega)) * monodromy
        return float(mp.log(max(abs(value) for value in mp.eig(monodromy)[0])))


@pytest.mark.parametrize(("epsilon", "omega"), [(0.5, 1.14), (0.3, 2.0), (0.3, 5.4)])
def test_no_growth_is_left_and_the_tolerance_holds(epsilon, omega):
    # At 1.14 the growth falls by 1e-10 a period for a millionth of the value: a threshold of 1e-10 would cost 1e-6.
    found = required_damping(train(epsilon), np.array([omega]), tolerance=1e-9).value[0, 0]
    # The kernel rounds the growth of one period of two intervals to some 1e-15.
    assert growth_in_forty_digits(epsilon, found, omega) <= 2e-14
    assert growth_in_forty_digits(epsilon, found * (1 - 2e-9), omega) > 0


@pytest.mark.parametrize("mode", [1, 2, 3])
def test_primary_tongues_of_first_order(mode):
    # zeta = sqrt(s^2 - d^2)/(2 w) at the distance d from the middle of a tongue of half-width s = O(epsilon) in Omega;
    # second order moves the tongue by O(epsilon^2): the difference falls by four when epsilon halves.
    difference = []
    for epsilon in (0.08, 0.04, 0.02):
        system = train(epsilon)
        tongues = first_order(system, 1)
        k = tongues.label.index(f"2w{mode}")
        middle, half = tongues.center_frequency[k], tongues.half_width[k]
        d = np.linspace(-0.6, 0.6, 5) * half
        wanted = np.sqrt(half**2 - d**2) / middle
        difference.append(np.abs(required_damping(system, middle + d).value[0] - wanted).max())
    assert np.all(np.diff(np.log2(difference)) < -1.7)


def test_threshold_of_first_order_theory_at_the_required_damping():
    # A tongue that damping has just closed has the threshold 1 (factor on epsilon at which it opens) in first order.
    system = train(0.02)
    free = first_order(system, 1)
    for k, label in enumerate(free.label):
        if label not in ("2w2", "2w3", "w2+w3"):
            continue
        omega = free.center_frequency[k] + np.linspace(-0.3, 0.3, 31) * free.half_width[k]
        largest = required_damping(system, omega).value.max()
        damped = first_order(with_ratio(system, largest), 1)
        assert damped.threshold[damped.label.index(label)] == pytest.approx(1.0, abs=0.01)


def test_one_degree_of_freedom_is_the_growth_itself():
    # q'' + 2 z w q' + k(t) q = 0 decays uniformly: z w = growth of the undamped system with k - (z w)^2.
    mesh = Mesh("mesh", np.array([1.0]), np.asarray(1.0), np.asarray(0.3), Rectangular(1.5))
    system = GearSystem(np.eye(1), np.zeros((1, 1)), (mesh,))
    omega = np.array([0.97, 2.0, 2.05, 3.0])
    found = required_damping(system, omega, tolerance=1e-10).value[0]
    for w, z in zip(omega, found, strict=True):
        shifted = replace(system, stiffness=np.array([[-(z**2)]]))
        assert solve(shifted, w).growth_rate[0, 0] == pytest.approx(z, abs=1e-9)
    assert found[1] > 0.05


def test_rows_and_frequencies_of_their_own():
    epsilon = np.array([0.1, 0.3])
    omega = np.array([[2.0, 5.4], [2.1, 5.5]])
    both = required_damping(train(epsilon), omega).value
    for row in range(2):
        np.testing.assert_allclose(both[row], required_damping(train(epsilon[row]), omega[row]).value[0], rtol=1e-5)


def test_factor_on_the_damping_given():
    system = with_ratio(train(), 0.004)
    omega = np.linspace(0.4, 7.0, 40)
    factor = required_damping(system, omega, of="factor", tolerance=1e-8)
    ratio = required_damping(system, omega, tolerance=1e-8)
    np.testing.assert_allclose(factor.value * 0.004, ratio.value, rtol=3e-8)
    with pytest.raises(ValueError, match="factor"):
        required_damping(train(), omega, of="factor")


def test_more_than_the_largest_damping():
    omega = np.array([5.42, 6.9])
    found = required_damping(train(), omega, largest=0.01)
    assert np.isnan(found.value[0, 0])
    assert found.status[0, 0] == FLAGS["beyond"]
    assert found.value[0, 1] == 0


def test_damping_that_destabilises_is_marked():
    # Stable without damping, beside a combination tongue of modes that decay as differently as w1 and w3: damping
    # widens the tongue over this frequency first and closes it later. The largest zero is given.
    system = train(0.3)
    tongues = first_order(system, 1)
    k = tongues.label.index("w1+w3")
    middle, half = tongues.center_frequency[k], tongues.half_width[k]
    omega = middle + half * np.linspace(-3, 3, 121)
    found = required_damping(system, omega)
    marked = np.flatnonzero(found.status[0] & FLAGS["not_monotone"])
    assert len(marked) > 0
    for k in marked[:: max(1, len(marked) // 5)]:
        value = found.value[0, k]
        lower = value * 0.5 ** np.arange(1, 12)
        verdicts = [solve(with_ratio(system, z), omega[k]).stable[0, 0] for z in lower]
        assert solve(system, omega[k]).stable[0, 0] == 1
        assert 0 in verdicts
        assert solve(with_ratio(system, 1.01 * value), omega[k]).stable[0, 0] == 1


def test_smooth_and_mixed_waves():
    # Bisected on error-controlled growth rates; rows with and without kinks, and tongues of two shapes.
    system = train(np.array([0.2, 0.3]))
    smooth = replace(system.meshes[0], waveform=Fourier(np.array([0.5, 0.1]), np.array([0.0, 0.1])))
    kinked = replace(system.meshes[1], waveform=Trapezoidal(np.asarray(1.5), np.asarray(0.1)))
    mixed = replace(system, meshes=(smooth, kinked))
    omega = np.array([2.0, 5.4, 6.9])
    found = required_damping(mixed, omega)
    for row in range(2):
        one = replace(mixed, meshes=tuple(replace(mesh, epsilon=mesh.epsilon[row]) for mesh in mixed.meshes))
        for k in range(2):

            def stable(ratio, one=one, k=k):
                return solve(with_ratio(one, ratio), omega[k], tolerance=1e-9).stable[0, 0] == 1

            # The interval halved 14 times.
            assert found.value[row, k] == pytest.approx(bisected(stable, 0.0, 0.2, 14), abs=2e-5)
    np.testing.assert_array_equal(found.value[:, 2], 0.0)


def test_as_many_steps_as_the_growth_needs(monkeypatch):
    """Long periods of smooth waves: three doublings, of which two would leave more than the bound."""
    system, level = train(0.3), 0.002
    wave = Fourier(np.array([0.5, 0.1]), np.array([0.0, 0.1]))
    smooth = replace(system, meshes=tuple(replace(mesh, waveform=wave) for mesh in system.meshes))
    omega = np.array([[0.03, 0.05]])
    expected = solve(with_ratio(smooth, level), omega[0], tolerance=1e-12).growth_rate * 2 * np.pi / omega
    found = {}
    for doublings in (2, 3, module.MOST_DOUBLINGS):
        monkeypatch.setattr(module, "MOST_DOUBLINGS", doublings)
        (part,) = growths(smooth, "damping_ratio", omega, level)
        found[doublings] = part.at_level(level)
    # A bound of rounding errors is subtracted.
    errors = {doublings: np.abs(own + DAMPED_ON_CIRCLE - expected).max() for doublings, own in found.items()}
    assert errors[3] < RESOLVED < errors[2]
    np.testing.assert_array_equal(found[module.MOST_DOUBLINGS], found[3])


def test_integer_contact_ratio_needs_none():
    found = required_damping(train(contact_ratio=2.0), np.linspace(0.5, 7.0, 20))
    np.testing.assert_array_equal(found.value, 0.0)
    np.testing.assert_array_equal(found.status, 0)


def test_rigid_body_modes_take_no_part():
    free = replace(train(), stiffness=np.zeros((3, 3)))
    frequencies = mean_modes(free).natural_frequency
    assert frequencies[0] == 0
    found = required_damping(free, np.array([2 * frequencies[1], 2 * frequencies[2]]))
    assert np.all((found.value > 0.01) & (found.value < 0.2))
