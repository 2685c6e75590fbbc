"""Compiled eigenvalues against those of NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from gearstab import ckernel
from gearstab.propagation.magnus import eigenvalues


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
