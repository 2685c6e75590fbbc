"""Compiled eigenvalues and exponentials against those of NumPy."""

from __future__ import annotations

import numpy as np
import numpy_matrices
import pytest

from gearstab import ckernel
from gearstab.ckernel import eigenvalues, exponentials


@pytest.fixture(params=ckernel.library.levels())
def level(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GEARSTAB_SIMD", str(request.param))


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
