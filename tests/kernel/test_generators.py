"""Compiled products of segments whose generators go with the mesh frequency, against their form in NumPy."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import numpy_kernel
import numpy_matrices
import pytest

from gearstab import ckernel
from gearstab.ckernel import eigenvalues, exponentials
from gearstab.floquet.kernel import c_kernel
from gearstab.floquet.kernel.damped import Generators
from gearstab.floquet.segments.pattern import Succession
from gearstab.modal import symmetric_eigen
from gearstab.system import Array

SHAPES = [
    # rows, states, terms, n, rigid velocities, points
    (1, 1, 0, 1, 0, 3), (2, 2, 1, 2, 0, 65), (1, 3, 2, 3, 0, 300), (3, 2, 3, 2, 1, 17), (1, 4, 2, 5, 0, 9),
]  # fmt: skip


@pytest.fixture(params=ckernel.library.levels())
def level(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GEARSTAB_SIMD", str(request.param))


def stacked(rows: int, states: int, terms: int, n: int, rigid: int, symplectic: bool) -> tuple[Succession, Generators]:
    """States [[0, 1, 0], [-K, -C, ..], ..] and matrices that act with W and W^2/(1 - a W^2), each state met twice."""
    rng = np.random.default_rng([rows, states, terms, n, rigid])
    m = 2 * n + rigid
    root = rng.normal(size=(rows, states, n, n))
    matrix = np.zeros((rows, states, m, m))
    matrix[..., :n, n : 2 * n] = np.eye(n)
    matrix[..., n : 2 * n, :n] = -root @ np.swapaxes(root, -1, -2) / n - 0.5 * np.eye(n)
    by_speed, laws = np.zeros((rows, terms, m, m)), np.zeros((rows, terms, 3))
    laws[..., 0] = rng.uniform(-0.3, 0.3, (rows, terms))
    for k in range(terms):
        laws[:, k, 1:] = (1, 0) if k % 2 == 0 else (2, 0.1)
        some = rng.normal(size=(rows, m - n, m - n)) if k % 2 == 0 else rng.normal(size=(rows, m - n, n))
        if k % 2 == 0:
            by_speed[:, k, n:, n:] = some - np.swapaxes(some, -1, -2)
        else:
            by_speed[:, k, n:, :n] = some
            by_speed[:, k, n : 2 * n, :n] = some[:, :n] + np.swapaxes(some[:, :n], -1, -2)
    if not symplectic:
        matrix[..., n:, n:] = -0.02 * rng.normal(size=(rows, states, m - n, m - n)) - 0.05 * np.eye(m - n)
    order = np.concatenate([rng.permutation(states), rng.permutation(states)])
    fractions = rng.dirichlet(np.ones(2 * states), rows)
    place = np.arange(rows)
    return Succession(place, 2.0, fractions, 0.0 * place, order), Generators(matrix, by_speed, laws, symplectic)


def conditioned(product: Array) -> Array:
    """By how much an error of a matrix, over its size, moves ln of its largest eigenvalue; 1e8 at most."""
    values, right = np.linalg.eig(product)
    first = np.abs(values).argmax(axis=-1)[..., None]
    left = np.linalg.inv(right)
    sizes = np.linalg.norm(right, axis=-2) * np.linalg.norm(left, axis=-1)
    pick = np.take_along_axis(sizes / np.abs(values), first, axis=-1)[..., 0]
    return np.minimum(np.linalg.norm(product, axis=(-2, -1)) * pick, 1e8)


@pytest.mark.usefixtures("level")
@pytest.mark.parametrize("symplectic", [False, True])
@pytest.mark.parametrize("shape", SHAPES)
def test_growth_and_multipliers_are_those_of_numpy(shape: tuple[int, ...], symplectic: bool) -> None:
    *sizes, points = shape
    if symplectic and sizes[-1]:
        pytest.skip("velocities without positions are no symplectic pairs")
    segments, generator = stacked(*sizes, symplectic)
    # In order, so that polynomials pay for long rows, from a fifth of a radian to some tens a period.
    omega = np.broadcast_to(np.geomspace(0.4, 30.0, points), (sizes[0], points))
    product, size = numpy_kernel.products_damped(segments, generator, omega)
    expected = numpy_kernel.scan_damped(segments, generator, omega)[0]
    growth = c_kernel.scan_damped(segments, generator, omega)[0]
    also, scale, values = c_kernel.multipliers_damped(segments, generator, omega)
    # Either product is right to 1e-16 times the norm of all exponents, some hundreds; ten times that for others.
    allowed = 1e-13 * (1 + 10 / omega) * conditioned(product)
    assert np.all(np.abs(growth - expected) <= allowed)
    assert np.all(np.abs(also - expected) <= allowed)
    # Symmetric functions of multipliers know no condition.
    ours = np.sum(values, axis=-1) * np.exp(scale - size)
    np.testing.assert_allclose(ours, np.trace(product, axis1=-2, axis2=-1), atol=3e-12 * sizes[3])


@pytest.mark.usefixtures("level")
def test_a_pattern_without_speeds_is_that_of_its_modes() -> None:
    segments, generator = stacked(2, 3, 0, 3, 0, False)
    omega = np.broadcast_to(np.geomspace(0.4, 30.0, 40), (2, 40))
    ours, modal = (c_kernel.scan_damped(segments, one, omega)[0] for one in (generator, Generators(generator.matrix)))
    np.testing.assert_allclose(ours, modal, rtol=0, atol=1e-11)


@pytest.mark.usefixtures("level")
def test_points_have_the_same_bits_in_threads() -> None:
    segments, generator = stacked(3, 2, 2, 3, 0, False)
    omega = np.broadcast_to(np.geomspace(0.4, 30.0, 501), (3, 501))
    one, two = (c_kernel.scan_damped(segments, generator, omega, limit)[0] for limit in (1, 2))
    np.testing.assert_array_equal(one, two)


def test_sizes_that_do_not_fit_are_refused() -> None:
    segments, generator = stacked(1, 2, 1, 2, 0, False)
    given = list(c_kernel._of_generators(segments, generator, np.ones((1, 1)), True))
    room = [np.ones((1, 1)), np.empty((1, 1)), np.empty((1, 1))]
    ckernel.library.scan_damped("plain", *given, 0, 1, 1, *room)
    for index, wrong in ((0, (1, 4, 2, 1, 4, 1, 2.0)), (6, np.ones((1, 1, 2, 2))), (7, np.ones((1, 1, 2)))):
        with pytest.raises(ValueError, match="shapes"):
            ckernel.library.scan_damped("plain", *given[:index], wrong, *given[index + 1 :], 0, 1, 1, *room)
    with pytest.raises(ValueError, match="shapes"):
        ckernel.library.exponents("plain", *given, 0, 1, 1, room[0], np.empty((1, 1, 4), dtype=complex))


# --- compiled eigenvalues and exponentials against those of NumPy


@pytest.mark.usefixtures("level")
@pytest.mark.parametrize("size", [1, 2, 3, 5, 8])
def test_eigenvalues(size: int) -> None:
    matrix = np.random.default_rng(size).normal(size=(13, size, size))
    matrix[3, 0, 0] = np.nan
    matrix[5] = np.eye(size)
    found = eigenvalues(matrix)
    assert np.isnan(found[3]).all()
    for k in set(range(13)) - {3}:
        expected = np.linalg.eigvals(matrix[k])
        gaps = np.abs(found[k][:, None] - expected[None])
        # Eigenvalues of such matrices are known to eps times a condition number of at most some hundreds.
        assert max(gaps.min(axis=0).max(), gaps.min(axis=1).max()) < 1e-12


@pytest.mark.usefixtures("level")
def test_eigenvalues_of_two_equal_blocks_that_are_just_coupled() -> None:
    """Entries of a rounding error join the blocks for some sweeps; eigenvalues stay as they are."""
    random = np.random.default_rng(1)
    for _ in range(400):
        block = np.triu(random.normal(size=(3, 3)), -1)
        matrix = np.kron(np.eye(2), block)
        matrix[3, 2], matrix[:3, 3:] = 3e-16 * random.normal(), 1e-16 * random.normal(size=(3, 3))
        expected, vectors = np.linalg.eig(block)
        gaps = np.abs(eigenvalues(matrix[None])[0][:, None] - expected).min(axis=1)
        # Some rounding errors of matrices of order one, times the condition of the eigenvectors.
        assert gaps.max() < 5e-14 * np.linalg.cond(vectors)


@pytest.mark.usefixtures("level")
@pytest.mark.parametrize("size", [1, 2, 3, 4, 5, 6, 9, 12])
@pytest.mark.parametrize("count", [1, 7, 17])
def test_exponentials(size: int, count: int) -> None:
    """Matrices of very different sizes side by side; the last one decays by more than numbers hold."""
    random = np.random.default_rng(size)
    matrix = random.normal(size=(count, size, size)) * 10.0 ** random.uniform(-9, 1.3, size=(count, 1, 1))
    if count > 1:
        matrix[1, 0, 0], matrix[2], matrix[-1] = np.nan, 0.0, -900 * np.eye(size) + matrix[-1]
    found = exponentials(matrix)
    for k in range(count):
        if not np.isfinite(matrix[k]).all():
            assert np.isnan(found[k]).all()
            continue
        expected = numpy_matrices.exponential(matrix[k])
        # Squaring magnifies the rounding errors of a small part as often as that is added up.
        size_of = max(1.0, np.abs(matrix[k]).sum(axis=0).max())
        assert np.abs(found[k] - expected).max() < 1e-15 * size * size_of * np.abs(expected).max() + 1e-300


def test_exponentials_of_no_matrices() -> None:
    assert exponentials(np.empty((0, 3, 3))).shape == (0, 3, 3)
    assert exponentials(np.empty((2, 0, 0))).shape == (2, 0, 0)


# --- eigenproblems of symmetric matrices of any order


@pytest.mark.parametrize("n", [8, 15, 30])
def test_eigenvectors_of_the_states_of_a_wave_do_not_drift(n):
    """A product of hundreds of changes of modes adds up by how much their lengths are wrong: LAPACK's by 3 to 4 eps
    each, a third of an eps and more on the average.
    """
    rng = np.random.default_rng(n)
    first, second = rng.standard_normal((2, n, n))
    wave = np.linspace(0, 1, 400)[:, None, None]
    _, vectors = symmetric_eigen(first @ first.T + wave * (second + second.T))
    exact = vectors.astype(np.longdouble)
    excess = np.einsum("kij,kij->kj", exact, exact) - 1
    eps = np.finfo(float).eps
    # Entries of n^(-1/2) that are rounded to eps/2 at most change the squared length by some 0.6 eps.
    assert excess.std() < eps
    assert np.abs(excess.mean(axis=0)).max() < 0.2 * eps


def test_small_eigenvalues_beside_large_ones_keep_their_digits():
    """D A D with well-conditioned A and D over eight decades: relative accuracy (Demmel & Veselic 1992)."""
    n = 14
    rng = np.random.default_rng(4)
    b = rng.standard_normal((n, n))
    d = 10.0 ** np.linspace(-4, 4, n)
    graded = d[:, None] * (b @ b.T + n * np.eye(n)) * d
    with mp.workdps(60):
        exact = np.array([float(v) for v in sorted(mp.eigsy(mp.matrix(graded.tolist()), eigvals_only=True))])
    values, vectors = symmetric_eigen(np.stack([graded, graded[::-1, ::-1]]))
    # Some n eps, by the condition of A.
    np.testing.assert_allclose(values, [exact, exact], rtol=1e-13)
    np.testing.assert_allclose(np.swapaxes(vectors, 1, 2) @ vectors, [np.eye(n)] * 2, atol=1e-14)
