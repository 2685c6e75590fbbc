"""Complex modes of lightly damped states against those of NumPy's general eigenproblem."""

from fractions import Fraction

import numpy as np
import pytest

from gearstab.floquet import solve
from gearstab.floquet.kernel import damped
from gearstab.floquet.kernel.damped import Generators
from gearstab.system import Array
from gearstab.systems import build


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
