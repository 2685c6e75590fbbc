"""Eigenproblems of symmetric matrices of any order."""

import mpmath as mp
import numpy as np
import pytest

from gearstab.modal import symmetric_eigen


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
