"""The exact motion along a path, against direct integration of the time-varying equation."""

from fractions import Fraction

import numpy as np
import pytest
from driven import integrated_along
from systems import train

from gearstab.mesh import Mesh
from gearstab.modal import modal_damping_matrix
from gearstab.passage import propagator
from gearstab.passage.propagator import best_pair, growth, motion, motions
from gearstab.propagation.magnus import product
from gearstab.propagation.path import Path
from gearstab.system import GearSystem
from gearstab.waveforms import Fourier, Rectangular, Trapezoidal


def chain(waves, ratios, damping=0.01, epsilon=0.3):
    """Three masses on a spring, two meshes between them."""
    stiffness = np.zeros((3, 3))
    stiffness[0, 0] = 0.5
    mass = np.diag([1.0, 0.3, 4.0])
    directions = np.array([[1.0, -1.0, 0.0], [0.0, 1.0, 1.0]])
    meshes = tuple(
        Mesh(f"{k}", directions[k], np.array(1.0 + 0.3 * k), np.array(epsilon), waves[k], ratios[k], np.array(0.2 * k))
        for k in range(2)
    )
    bare = GearSystem(mass, stiffness, meshes)
    matrix = None if damping is None else modal_damping_matrix(mass, bare.mean_stiffness_matrix(), np.full(3, damping))
    return GearSystem(mass, stiffness, meshes, matrix)


def rectangular():
    return chain([Rectangular(np.array(1.5)), Rectangular(np.array(1.7))], [Fraction(1), Fraction(3, 5)])


def trapezoidal():
    waves = [Trapezoidal(np.array(1.5), np.array(0.2)), Rectangular(np.array(1.6))]
    return chain(waves, [Fraction(1), Fraction(3, 5)])


def through(system, path):
    """Phi(T, 0) of (q, q')."""
    return integrated_along(system, path, path.time[[0, -1]], np.eye(2 * system.size))[-1]


def amplitude(system, propagator):
    """Largest ratio of the square roots of the energy of the mean system, after over before."""
    n = system.size
    weight = np.zeros((2 * n, 2 * n))
    weight[:n, :n] = np.linalg.cholesky(system.mean_stiffness_matrix()).T
    weight[n:, n:] = np.linalg.cholesky(system.mass).T
    return np.linalg.norm(weight @ propagator @ np.linalg.inv(weight), 2)


PATHS = {
    "slow": Path.ramp(1.8, 2.4, 0.01), "fast": Path.ramp(1.0, 6.0, 3.0), "in a cycle": Path.ramp(1.0, 6.0, 40.0),
    "downwards": Path.ramp(1.0, 3.0, -0.2),
    "measured": Path(np.array([0.0, 4.0, 9.0, 10.0, 16.0]), np.array([1.5, 2.5, 2.5, 1.9, 3.0])),
}  # fmt: skip


@pytest.mark.parametrize("make", [rectangular, trapezoidal])
@pytest.mark.parametrize("which", PATHS)
def test_direct_integration_says_the_same(which, make):
    system, path = make(), PATHS[which]
    whole, scale = np.eye(6), 0.0
    for chunk in motion(system).chunks(path, 7):
        whole, scale = chunk.matrix @ whole, scale + chunk.scale
    reference = through(system, path)
    # The state of the propagator is another one, of the same energy.
    assert np.exp(scale) * np.linalg.norm(whole, 2) == pytest.approx(amplitude(system, reference), rel=1e-6)
    found = growth(motion(system), path)
    assert np.exp(found.through) == pytest.approx(amplitude(system, reference), rel=1e-6)
    assert found.largest >= found.through


def test_a_smooth_wave():
    wave = Fourier(np.array([0.3, 0.1]), np.array([0.2, -0.05]))
    system = chain([wave, wave], [Fraction(1), Fraction(2)])
    path = Path.ramp(1.5, 2.5, 0.05)
    assert np.exp(growth(motion(system), path).through) == pytest.approx(
        amplitude(system, through(system, path)), rel=1e-6
    )


def largest_of_all_pairs(chunks):
    best = 0.0
    for i in range(len(chunks)):
        whole, scale = np.eye(6), 0.0
        for chunk in chunks[i:]:
            whole, scale = chunk.matrix @ whole, scale + chunk.scale
            best = max(best, scale + np.log(np.linalg.norm(whole, 2)))
    return best


def test_largest_growth_is_that_of_all_pairs_of_moments(monkeypatch):
    system, path = rectangular(), Path.ramp(1.0, 3.0, -0.02)
    every = list(motion(system).chunks(path, 1))
    assert len(every) > 90
    largest = largest_of_all_pairs(every)
    assert best_pair(every)[0] == pytest.approx(largest, rel=1e-12)
    assert growth(motion(system), path).largest == pytest.approx(largest, rel=1e-12)
    # Found from few moments first: no other stretch, but a little less than the best one.
    monkeypatch.setattr(propagator, "MOMENTS", 20)
    coarse = best_pair(list(motion(system).chunks(path, -(-len(every) // 20))))[0]
    refined = growth(motion(system), path).largest
    assert coarse < refined <= largest + 1e-12
    assert refined > largest - 0.1


def test_growth_beyond_double_precision_is_a_number():
    # 1463 e-folds: a ramp so slow that the amplitude has no floating-point number.
    system = chain([Rectangular(np.array(1.5))] * 2, [1, 1], None, 0.4)
    system = GearSystem(system.mass, system.stiffness, tuple(_exact(mesh) for mesh in system.meshes))
    slow, slower = (growth(motion(system), Path.ramp(5.0, 5.8, rate)).largest for rate in (2e-3, 1e-4))
    assert slower > 1000
    # The integral of the growth rate goes as the inverse rate; what there is more is not above 1.5 e-folds.
    assert slower == pytest.approx(20 * slow, abs=20 * 1.5)


def _exact(mesh):
    from dataclasses import replace

    return replace(mesh, frequency_ratio=Fraction(1))


def test_phase_and_moment_are_inverse():
    path = PATHS["measured"]
    time = np.linspace(0.0, path.time[-1], 101)
    assert path.moment(path.phase_at(time)) == pytest.approx(time, abs=1e-12)
    fine = np.linspace(0.0, path.time[-1], 200_001)
    speed = np.interp(fine, path.time, path.mesh_frequency)
    area = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(fine))])
    assert path.phase_at(fine) == pytest.approx(area, abs=1e-9)


def test_a_product_is_in_the_order_of_time():
    random = np.random.default_rng(0)
    matrices = random.normal(size=(13, 3, 3)) * 10.0 ** random.uniform(-40, 40, (13, 1, 1))
    found, scale = product(matrices)
    expected, size = np.eye(3), 0.0
    for matrix in matrices:
        expected = matrix @ expected
        size, expected = size + np.log(np.abs(expected).max()), expected / np.abs(expected).max()
    assert found / np.abs(found).max() == pytest.approx(expected, rel=1e-10, abs=1e-12)
    assert scale + np.log(np.abs(found).max()) == pytest.approx(size, rel=1e-10)


def test_rows_of_a_batch_are_systems_of_their_own():
    from dataclasses import replace

    base = train(0.3)
    epsilon = np.array([0.1, 0.2, 0.3])
    batch = replace(base, meshes=tuple(replace(mesh, epsilon=epsilon) for mesh in base.meshes))
    path = Path.ramp(1.5, 2.5, 0.1)
    for one, value in zip(motions(batch), epsilon, strict=True):
        alone = replace(base, meshes=tuple(replace(mesh, epsilon=np.array(value)) for mesh in base.meshes))
        assert growth(one, path).largest == pytest.approx(growth(motion(alone), path).largest, rel=1e-9)
