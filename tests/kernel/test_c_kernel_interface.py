"""The arguments of the compiled kernel, and its eigensolver for small matrices."""

import os

import mpmath as mp
import numpy as np
import pytest
from systems import patterns, system

from gearstab import ckernel
from gearstab.floquet.kernel import c_kernel
from gearstab.floquet.kernel.decision import DOUBTFUL
from gearstab.grouping import equal_rows


class TestArguments:
    """Arrays of wrong sizes are refused, never read beyond their ends."""

    def arguments(self):
        ((pattern, omega), *_) = patterns(system(2, "one mesh", 1), 5)
        numbers, *arrays = c_kernel.pattern_arguments(pattern)
        rows, points = omega.shape
        result = [np.zeros(omega.shape, dtype=np.int8), np.zeros(omega.shape)]
        return ["plain", numbers, *arrays, 0, rows, points, np.ascontiguousarray(omega), *result]

    def test_right_sizes_are_accepted(self):
        ckernel.library.scan(*self.arguments())

    @pytest.mark.parametrize("position", [2, 3, 4, 5, 9, 10, 11])
    def test_short_arrays(self, position):
        changed = self.arguments()
        changed[position] = changed[position].ravel()[:-1].copy()
        with pytest.raises(ValueError, match="shapes"):
            ckernel.library.scan(*changed)

    @pytest.mark.parametrize(("position", "value"), [(6, -1), (7, 10**6), (8, 6), (8, -1), (8, 2**62)])
    def test_wrong_numbers(self, position, value):
        changed = self.arguments()
        changed[position] = value
        with pytest.raises(ValueError, match="shapes"):
            ckernel.library.scan(*changed)

    @pytest.mark.parametrize("state", [-1, 10**9])
    def test_states_that_do_not_exist(self, state):
        changed = self.arguments()
        changed[4] = np.full_like(changed[4], state)
        with pytest.raises(ValueError, match="shapes"):
            ckernel.library.scan(*changed)

    @pytest.mark.parametrize(
        ("position", "kind"),
        [(2, "i8"), (3, "f4"), (4, "f8"), (4, "i4"), (4, "u8"), (5, ">f8"), (9, "c16"), (10, "u1"), (10, "?")],
    )
    def test_items_of_another_type(self, position, kind):
        """Also of the same size, which the number of bytes would not tell."""
        changed = self.arguments()
        changed[position] = changed[position].astype(kind)
        with pytest.raises(TypeError, match="items of type"):
            ckernel.library.scan(*changed)

    @pytest.mark.parametrize("given", [slice(0, 0), slice(0, 1), slice(0, 2), slice(0, 5), slice(0, 7), slice(0, 11)])
    def test_missing_arguments(self, given):
        with pytest.raises(TypeError, match="missing"):
            ckernel.library.scan(*self.arguments()[given])

    def test_arguments_too_many(self):
        extra = np.zeros(0, dtype=complex), np.ones(self.arguments()[9].shape), 0
        with pytest.raises(TypeError, match="too many"):
            ckernel.library.scan(*self.arguments(), *extra)

    @pytest.mark.parametrize(("position", "value"), [(0, 1), (1, 3), (1, (1, 2, 3)), (6, 0.5), (6, None), (6, 2**80)])
    def test_arguments_of_another_kind(self, position, value):
        changed = self.arguments()
        changed[position] = value
        with pytest.raises((TypeError, OverflowError)):
            ckernel.library.scan(*changed)

    def test_no_coordinates(self):
        changed = self.arguments()
        changed[1] = (*changed[1][:3], 0, *changed[1][4:])
        with pytest.raises(ValueError, match="shapes"):
            ckernel.library.scan(*changed)

    def test_bytes_are_no_numbers(self):
        changed = self.arguments()
        changed[9] = changed[9].tobytes()
        with pytest.raises(TypeError, match="items of type"):
            ckernel.library.scan(*changed)

    def test_arrays_that_are_not_contiguous(self):
        changed = self.arguments()
        changed[9] = np.repeat(changed[9], 2, axis=1)[:, ::2]
        with pytest.raises((BufferError, ValueError), match="contiguous"):
            ckernel.library.scan(*changed)

    def test_complex_results_may_be_left_out(self):
        extra = [np.zeros((0,), dtype=complex), np.ones(self.arguments()[9].shape)]
        ckernel.library.scan(*self.arguments(), *extra)

    def test_verdicts_go_by_the_thresholds_given(self):
        changed = self.arguments()
        ckernel.library.scan(*changed)
        assert np.any(changed[10] != DOUBTFUL)
        changed[1] = (*changed[1][:5], (1e9, *changed[1][5][1:]))
        ckernel.library.scan(*changed)
        assert np.all(changed[10] == DOUBTFUL)

    def test_memory_that_is_not_needed_is_not_asked_for(self):
        """Polynomials over the mesh frequency for a million points of 60 coordinates would take 57 GB."""
        resource = pytest.importorskip("resource")
        if "asan" in os.environ.get("LD_PRELOAD", ""):
            pytest.skip("the address sanitizer needs the whole address space")
        n, points = 60, 10**6
        arrays = [np.ones((1, 1, n)), np.ones((1, 1)), np.zeros(1, dtype=np.int64), np.eye(n)[None, None]]
        result = [np.ones((1, points), dtype=np.int8), np.ones((1, points)), np.zeros(0, complex), np.ones((1, points))]
        before = resource.getrlimit(resource.RLIMIT_AS)
        try:
            resource.setrlimit(resource.RLIMIT_AS, (min(1 << 35, before[1] if before[1] > 0 else 1 << 35), before[1]))
            # No rows are computed, but room for them is made.
            ckernel.library.scan(
                "plain", (1, 1, 1, n, 1.0, c_kernel.LIMITS), *arrays, 0, 0, points, np.ones((1, points)), *result
            )
        finally:
            resource.setrlimit(resource.RLIMIT_AS, before)

    def test_unpaired_frequencies(self):
        """Three non-zero frequencies in three places."""
        one = np.ones((1, 1, 3))
        with pytest.raises(ValueError, match="shapes"):
            ckernel.library.scan_damped(
                "plain", (1, 1, 1, 1, 3, -1, 1.0), one, one, np.ones((1, 1)), np.zeros(1, dtype=np.int64),
                np.zeros(1, dtype=np.int64), np.ones((1, 1, 3, 3)), *np.ones((2, 0)), 0, 1, 1, *np.ones((3, 1, 1)),
            )  # fmt: skip

    def test_unknown_level(self):
        changed = self.arguments()
        changed[0] = "sse9"
        with pytest.raises(ValueError, match="sse9"):
            ckernel.library.scan(*changed)

    def test_read_only_results(self):
        changed = self.arguments()
        changed[-1].flags.writeable = False
        with pytest.raises((BufferError, TypeError, ValueError)):
            ckernel.library.scan(*changed)


@pytest.mark.parametrize("level", ckernel.library.levels())
class TestSymmetricEigenproblems:
    @pytest.mark.parametrize("n", [1, 2, 3, 5, 8, 12])
    def test_random_matrices(self, level, n, monkeypatch):
        monkeypatch.setenv("GEARSTAB_SIMD", level)
        a = np.random.default_rng(n).standard_normal((2, 7, n, n))
        a = a + np.swapaxes(a, -1, -2)
        values, vectors = ckernel.symmetric_eigen(a)
        # Rounding errors of some n eps of the norm, as LAPACK's.
        tolerance = 40 * n * np.finfo(float).eps
        np.testing.assert_allclose(values, np.linalg.eigvalsh(a), atol=tolerance)
        np.testing.assert_allclose(a @ vectors, vectors * values[..., None, :], atol=tolerance)
        unit = np.swapaxes(vectors, -1, -2) @ vectors
        np.testing.assert_allclose(unit, np.broadcast_to(np.eye(n), unit.shape), atol=tolerance)

    @pytest.mark.parametrize(
        "matrix", [np.zeros((3, 3)), np.eye(4), np.ones((3, 3)), np.diag([3.0, -1.0, 2.0]), np.eye(5)[::-1].copy()]
    )
    def test_multiple_eigenvalues(self, level, matrix, monkeypatch):
        monkeypatch.setenv("GEARSTAB_SIMD", level)
        values, vectors = ckernel.symmetric_eigen(matrix)
        np.testing.assert_allclose(values, np.linalg.eigvalsh(matrix), atol=1e-15 * len(matrix))
        np.testing.assert_allclose(vectors @ np.diag(values) @ vectors.T, matrix, atol=1e-15 * len(matrix))

    def test_small_eigenvalues_beside_large_ones_keep_their_digits(self, level, monkeypatch):
        """D A D with well-conditioned A and D over ten decades: relative accuracy (Demmel & Veselic 1992)."""
        monkeypatch.setenv("GEARSTAB_SIMD", level)
        rng = np.random.default_rng(4)
        for n in (2, 3, 5):
            b = rng.standard_normal((n, n))
            d = 10.0 ** rng.uniform(-5, 5, n)
            graded = d[:, None] * (b @ b.T + n * np.eye(n)) * d
            with mp.workdps(60):
                exact = np.array([float(v) for v in sorted(mp.eigsy(mp.matrix(graded.tolist()), eigvals_only=True))])
            np.testing.assert_allclose(ckernel.symmetric_eigen(graded)[0], exact, rtol=1e-14)

    def test_empty_batches(self, level, monkeypatch):
        monkeypatch.setenv("GEARSTAB_SIMD", level)
        values, vectors = ckernel.symmetric_eigen(np.zeros((0, 3, 3)))
        assert (values.shape, vectors.shape) == ((0, 3), (0, 3, 3))


@pytest.mark.parametrize("columns", [1, 3, 90])
def test_equal_rows(columns):
    """As numpy.unique finds them; 90 columns of five values exceed one integer."""
    table = np.random.default_rng(columns).integers(-1, 4, (60, columns))
    table = np.concatenate([table, table[::3], table[::7]])
    keys, inverse = np.unique(table, axis=0, return_inverse=True)
    found = list(equal_rows(table))
    assert len(found) == len(keys)
    for k, (members, row) in enumerate(found):
        np.testing.assert_array_equal(row, keys[k])
        np.testing.assert_array_equal(members, np.flatnonzero(np.ravel(inverse) == k))
