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
