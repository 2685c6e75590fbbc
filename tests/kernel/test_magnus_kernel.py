"""Magnus steps of the compiled kernel."""

from dataclasses import replace

import numpy as np
import numpy_kernel
import pytest
from planetary_gears import cyclic
from systems import SMOOTH_OMEGA, SMOOTH_SYSTEMS, WAVE, smooth_train, with_ramps

from gearstab import ckernel
from gearstab.floquet.kernel import c_kernel
from gearstab.floquet.kernel.decision import DOUBTFUL
from gearstab.floquet.segments.pattern import prepare
from gearstab.floquet.smooth import compare, steps
from gearstab.floquet.smooth.steps import CF6_5
from gearstab.mesh import Mesh
from gearstab.system import GearSystem
from gearstab.waveforms import Rectangular


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
