"""Complex modes of lightly damped states against those of NumPy's general eigenproblem."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import numpy_kernel
import pytest
from planetary_gears import cyclic
from systems import SMOOTH_OMEGA, SMOOTH_SYSTEMS, WAVE, smooth_train, with_ramps

from gearstab import ckernel
from gearstab.floquet import solve
from gearstab.floquet.kernel import c_kernel, damped
from gearstab.floquet.kernel.damped import Generators
from gearstab.floquet.kernel.decision import DOUBTFUL
from gearstab.floquet.segments.pattern import prepare
from gearstab.floquet.smooth import compare, steps
from gearstab.floquet.smooth.schemes import CF6_5
from gearstab.mesh import Mesh
from gearstab.system import Array, GearSystem
from gearstab.systems import build
from gearstab.waveforms import Rectangular


def states(n: int, ratio: float, spread: float = 0.2, count: int = 200) -> Array:
    """Generators of random states with frequencies near 1, 2, ..., n and nearly modal damping."""
    rng = np.random.default_rng(n)
    root, other = rng.normal(size=(2, count, n, n))
    stiffness = np.diag(np.arange(1.0, n + 1) ** 2) + 0.05 * root @ np.swapaxes(root, 1, 2)
    stiffness = 0.5 * (stiffness + np.swapaxes(stiffness, 1, 2))
    squared, shapes = np.linalg.eigh(stiffness)
    damping = 2 * ratio * (shapes * np.sqrt(squared)[:, None, :]) @ np.swapaxes(shapes, 1, 2)
    damping += spread * ratio * (other + np.swapaxes(other, 1, 2))
    return generators(stiffness, 0.5 * (damping + np.swapaxes(damping, 1, 2)))


def generators(stiffness: Array, damping: Array) -> Array:
    count, n = stiffness.shape[:2]
    matrix = np.zeros((count, 2 * n, 2 * n))
    matrix[:, :n, n:] = np.eye(n)
    matrix[:, n:, :n], matrix[:, n:, n:] = -stiffness, -damping
    return matrix


def assert_modes(matrix: Array) -> None:
    """Values as of eig, A = X L X^-1 and X^-1 X = 1, columns of length 1, pairs beside each other."""
    values, vectors, inverse = (part[0] for part in Generators(matrix[None]).eigen)
    expected = np.linalg.eigvals(matrix)
    for ours, theirs in zip(values, expected, strict=True):
        apart = np.abs(ours[:, None] - theirs)
        assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) < 1e-10 * np.abs(theirs).max()
    size = np.abs(matrix).max()
    assert (vectors * values[:, None, :]) @ inverse == pytest.approx(matrix, abs=1e-12 * size)
    assert inverse @ vectors == pytest.approx(np.broadcast_to(np.eye(matrix.shape[-1]), matrix.shape), abs=1e-12)
    assert np.linalg.norm(vectors, axis=1) == pytest.approx(1.0, abs=1e-13)
    pairs = np.flatnonzero(values[0].imag > 0)
    assert np.array_equal(values[0, pairs + 1], values[0, pairs].conj())


@pytest.mark.parametrize("n", [1, 2, 3, 7])
@pytest.mark.parametrize("ratio", [1e-6, 0.01, 0.1, 0.4])
def test_modes_are_those_of_the_general_eigenproblem(n: int, ratio: float) -> None:
    assert_modes(states(n, ratio))


def test_most_lightly_damped_states_are_found_without_it(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[int] = []
    general = np.linalg.eig
    monkeypatch.setattr(np.linalg, "eig", lambda a: given.append(len(a)) or general(a))
    assert_modes(states(3, 0.01))
    assert given == []


def test_what_is_not_lightly_damped_is_left_to_the_general_eigenproblem() -> None:
    """Equal frequencies that damping couples, critical and strong damping, an unstable state, no symmetry."""
    frequencies = np.array([[1.0, 1.0], [1.0, 4.0], [1.0, 4.0], [-0.5, 2.0], [1.0, 1.0 + 1e-9]])
    damping = np.array([
        [[0.02, 0.01], [0.01, 0.05]], [[1.9, 0.3], [0.3, 0.1]], [[9.0, 0.1], [0.1, 8.0]], [[0.02, 0.0], [0.0, 0.05]],
        [[0.02, 0.01], [0.01, 0.05]],
    ])  # fmt: skip
    matrix = generators(frequencies[:, :, None] * np.eye(2), damping)
    assert_modes(matrix)
    twisted = states(3, 0.01)
    twisted[:, 3, 4] += 0.05
    assert_modes(twisted)


@pytest.mark.parametrize("proportional", [0.0, 0.02])
def test_identical_parts_are_found_without_it(proportional: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Modes of equal frequency and damping, in a basis in which rounding couples them."""
    rng = np.random.default_rng(5)
    basis = np.linalg.qr(rng.standard_normal((200, 5, 5)))[0]
    back = np.swapaxes(basis, 1, 2)
    stiffness = basis * np.array([1.0, 1.0, 2.5, 4.0, 4.0]) @ back
    stiffness = 0.5 * (stiffness + np.swapaxes(stiffness, 1, 2))
    damping = 0.01 * basis @ back + proportional * stiffness
    damping = 0.5 * (damping + np.swapaxes(damping, 1, 2))
    given: list[int] = []
    general = np.linalg.eig
    monkeypatch.setattr(np.linalg, "eig", lambda a: given.append(len(a)) or general(a))
    assert_modes(generators(stiffness, damping))
    assert given == []


def test_nearly_identical_parts() -> None:
    """Whatever the distance of two frequencies and what damping couples them by: inverse to what it can be."""
    rng = np.random.default_rng(6)
    count, n = 2000, 4
    squared = rng.uniform(0.5, 5.0, (count, n))
    squared[:, 1] = squared[:, 0] * (1 + 10.0 ** rng.uniform(-17, -4, count))
    basis = np.linalg.qr(rng.standard_normal((count, n, n)))[0]
    coupling = rng.standard_normal((count, n, n)) * 10.0 ** rng.uniform(-18, -3, (count, 1, 1))
    stiffness, damping = basis * squared[:, None] @ np.swapaxes(basis, 1, 2), 0.02 * np.eye(n) + coupling
    matrix = generators(*(0.5 * (part + np.swapaxes(part, 1, 2)) for part in (stiffness, damping)))
    values, vectors, inverse, sound = (part[0] for part in Generators(matrix[None])._diagonal)
    assert sound.mean() > 0.9
    # Vectors of nearly equal multipliers are what the general eigenproblem leaves of them: some digits over eps.
    np.testing.assert_allclose(
        (inverse @ vectors)[sound], np.broadcast_to(np.eye(2 * n), vectors[sound].shape), atol=1e-10
    )
    again = ((vectors * values[:, None, :]) @ inverse)[sound]
    np.testing.assert_allclose(again, matrix[sound], atol=1e-10)


def test_growth_rates_are_those_of_the_general_eigenproblem(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = {"mean_stiffness": 1.0, "epsilon": 0.3, "contact_ratio": 1.5}
    p = {"kind": "two_stage", "inertias": [1.0, 0.3, 4.0], "input_shaft_stiffness": 0.5, "tooth_ratio": Fraction(1)}
    p |= {"damping_ratio": 0.02, "meshes": [mesh | {"name": "first"}, mesh | {"name": "second", "phasing": 0.2}]}
    omega = np.linspace(0.4, 6.5, 800)
    found = solve(build(p), omega).growth_rate
    monkeypatch.setattr(damped, "SYMMETRIC", -1.0)  # no state is taken for a lightly damped one
    assert found == pytest.approx(solve(build(p), omega).growth_rate, abs=1e-10)


# --- Magnus steps of the compiled kernel


class TestKernel:
    """Functions of the kernel for Magnus steps."""

    @pytest.mark.parametrize("module", [numpy_kernel, c_kernel], ids=["numpy", "c"])
    @pytest.mark.parametrize("epsilon", [0.4, 1.0, 1.6])
    def test_segments_that_run_backwards_undo_what_was_done(self, module, epsilon):
        # Softer levels above, at and below zero: oscillating, free and growing modes.
        mesh = Mesh("m", np.array([1.0, -0.4]), np.array(1.0), np.array(epsilon), Rectangular(1.5))
        system = GearSystem(np.eye(2), np.diag([0.0, 0.7]), (mesh,))
        (pattern,) = prepare(system)
        there_and_back = replace(
            pattern,
            states=np.concatenate([pattern.states, pattern.states[::-1]]),
            fractions=np.concatenate([pattern.fractions, -pattern.fractions[:, ::-1]], axis=1),
        )
        matrix, scale = module.monodromy(there_and_back, 0, np.array([0.7, 1.3, 4.0]))
        found = matrix * np.exp(scale)[:, None, None]
        # A factor exp(growth) on the way out is lost in rounding on the way back.
        np.testing.assert_allclose(found, np.broadcast_to(np.eye(4), found.shape), rtol=0, atol=1e-9)

    def test_traces_come_with_a_scan(self):
        (division,) = steps.divisions(smooth_train(WAVE, WAVE))
        pattern = division.pattern(CF6_5, 2)
        omega = SMOOTH_OMEGA[None] / division.elastic.rate[:, None]
        verdict, growth, rho, _ = c_kernel.scan_traces(pattern, omega)
        plain = c_kernel.scan(pattern, omega)
        np.testing.assert_array_equal(verdict, plain[0])
        np.testing.assert_array_equal(growth, plain[1])
        matrix, _ = numpy_kernel.monodromy(pattern, 0, omega[0])
        both = np.linalg.eigvals(matrix)
        expected = both + 1 / both
        gap = np.abs(expected[:, :, None] - rho[0][:, None, :])
        # Nearly double ones are known to the root of the rounding error.
        assert gap.min(axis=2).max() < 1e-6
        assert gap.min(axis=1).max() < 1e-6

    @pytest.mark.parametrize("level", ckernel.library.levels())
    @pytest.mark.parametrize("name", ["one coordinate", "Fourier", "planets"])
    def test_interpolated_matrices_are_those_of_propagation(self, name, level, monkeypatch):
        monkeypatch.setenv("GEARSTAB_SIMD", level)
        system = SMOOTH_SYSTEMS[name][0] if name in SMOOTH_SYSTEMS else with_ramps(cyclic(3, epsilon=0.3))
        (division,) = steps.divisions(system)
        pattern = division.pattern(CF6_5, 2)
        # Vectors of points in any order straddle panels and are propagated.
        for omega in (np.random.default_rng(4).uniform(0.4, 7.0, 300), np.linspace(0.4, 7.0, 1200)):
            asked = omega[None] / division.elastic.rate[:, None]
            plain, near = (compare.scan(pattern, asked, interpolate) for interpolate in (False, True))
            used = near.rounding > plain.rounding
            np.testing.assert_array_equal(near.values[~used], plain.values[~used])
            # The sum of all traces is that of the matrix, which no coincidence of multipliers makes less certain.
            gap = np.abs(near.values.sum(axis=-1) - plain.values.sum(axis=-1))
            size = np.maximum(np.abs(plain.values).max(axis=-1), 1.0)
            assert np.all(gap[used] <= (pattern.size * near.rounding * size)[used])
            sure = (near.verdict != DOUBTFUL) & (plain.verdict != DOUBTFUL)
            np.testing.assert_array_equal(near.verdict[sure], plain.verdict[sure])
            np.testing.assert_allclose(near.growth[sure], plain.growth[sure], rtol=1e-9, atol=1e-12)
        assert used.mean() > 0.5

    def test_changes_of_traces(self):
        rng = np.random.default_rng(2)
        rho = rng.standard_normal((3, 40, 4)) * 2 + 1j * rng.standard_normal((3, 40, 4)) * rng.integers(
            0, 2, (3, 40, 1)
        )
        other = rho[..., ::-1] + 1e-3 * rng.standard_normal(rho.shape)
        rho[0, 0] = other[0, 0] = 2.0
        ours, theirs = (m.trace_change(rho, other, 1.5) for m in (c_kernel, numpy_kernel))
        for a, b in zip(ours, theirs, strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-300)
        ours, theirs = (m.trace_condition(rho[0], np.full(40, 1e-13)) for m in (c_kernel, numpy_kernel))
        np.testing.assert_allclose(ours, theirs, rtol=1e-12, atol=0)

    def test_rounding_of_a_thousand_exponentials(self):
        (division,) = steps.divisions(smooth_train(WAVE, WAVE))
        pattern = division.pattern(CF6_5, 9)
        assert len(pattern.states) > 1000
        omega = np.array([1.0, 2.0, 5.0]) / division.elastic.rate[0]
        matrix, _ = c_kernel.monodromy(pattern, 0, omega)
        # Eigenvectors that are 1e-16 too long, all of them, would make it 1e-13 times as much.
        np.testing.assert_allclose(np.linalg.det(matrix), 1.0, rtol=0, atol=1e-13)
        assert np.all(compare.rounding(pattern, omega[None]) < 1e-12)
