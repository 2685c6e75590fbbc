"""Smooth mesh stiffness searched block by block: the edges of the whole, of each part alone, and of a raster."""

from dataclasses import replace

import numpy as np
import pytest
from planetary_gears import cyclic, planetary
from systems import COSINE, CURVE, GENERAL, LINES, TRAPEZOID, WAVE, oscillator, smooth_train, with_ramps
from test_boundaries_blocks import edges, joined, mode_types

from gearstab.floquet import solve
from gearstab.floquet.boundaries import Boundaries, boundaries
from gearstab.floquet.boundaries.smooth import parts
from gearstab.system import GearSystem
from gearstab.waveforms import Rectangular, Waveform


def waved(system: GearSystem, sun: Waveform, ring: Waveform) -> GearSystem:
    """A planetary gear with other waves."""
    waves = {"s": sun, "r": ring}
    return replace(system, meshes=tuple(replace(m, waveform=waves[m.name[0]]) for m in system.meshes))


def beside(first: GearSystem, second: GearSystem, damping: np.ndarray | None = None) -> GearSystem:
    """Two systems that know nothing of each other, as one."""
    n, m = first.size, second.size

    def diagonal(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.block([[a, np.zeros((n, m))], [np.zeros((m, n)), b]])

    meshes = [replace(mesh, direction=np.pad(mesh.direction, (0, m))) for mesh in first.meshes]
    meshes += [
        replace(mesh, direction=np.pad(mesh.direction, (n, 0)), name=f"other {mesh.name}") for mesh in second.meshes
    ]
    return GearSystem(
        diagonal(first.mass, second.mass), diagonal(first.stiffness, second.stiffness), tuple(meshes), damping
    )


COPIES = 5e-8
"""Searched as a whole, copies of a block have their multipliers at the same places, where rounding moves edges by some
square roots of eps, 1.5e-8; blocks are right to their tolerance."""


def same(found: Boundaries, known: Boundaries, rounding: float = 1e-13) -> None:
    """The same regions, each edge within the tolerances of both, and the same names where one name is all there is."""
    np.testing.assert_array_equal(found.row, known.row)
    np.testing.assert_array_equal(found.cut, known.cut)
    assert len(found.row)
    for own, other, near in zip(edges(found), edges(known), found.tolerance + known.tolerance, strict=True):
        np.testing.assert_allclose(own, other, rtol=near + rounding)
    for own, other in zip(found.members, known.members, strict=True):
        assert own == other or len(own) > 1 or len(other) > 1


def check_raster(found: Boundaries, system: GearSystem, points: int = 150) -> None:
    """Check that points are unstable by the other method just where they lie in a region."""
    omega = np.linspace(*found.limits, points)
    inside = np.zeros((found.rows, points), dtype=bool)
    for row, (lower, upper) in zip(found.row, edges(found), strict=True):
        inside[row] |= (omega >= lower) & (omega <= upper)
    assert inside.any()
    assert not inside.all()
    np.testing.assert_array_equal(solve(system, omega).stable.reshape(inside.shape) == 0, inside)


RAMPS = TRAPEZOID, replace(TRAPEZOID, contact_ratio=1.6)
WAVES = {"sinusoids": (COSINE, COSINE), "series": (WAVE, COSINE), "ramps": RAMPS, "samples": (LINES, CURVE)}


class TestPlanetary:
    @pytest.mark.parametrize("waves", WAVES.values(), ids=WAVES)
    def test_meshes_in_phase(self, waves):
        system = waved(cyclic(3, epsilon=0.2), *waves)
        found = boundaries(system, 5.0, 5.6, 1e-9, 1e-5)
        same(found, boundaries(system, 5.0, 5.6, 1e-9, 1e-5, reduction=False), COPIES)
        same(found, boundaries(system, 5.0, 5.6, 1e-11, 1e-5))
        check_raster(found, system)

    def test_modes_of_one_type_only_are_named_together(self):
        system = with_ramps(planetary())
        sizes = sorted((part.pattern.size, part.copies) for part, division in parts(system, True) if division)
        assert sizes == [(3, 1), (6, 1), (12, 1)]
        found = boundaries(system, 5.0, 6.0, 1e-10, 1e-5)
        same(found, boundaries(system, 5.0, 6.0, 1e-10, 1e-5, reduction=False), COPIES)
        kinds = mode_types(system)
        assert all(kinds[t.mode_p - 1] == kinds[t.mode_q - 1] for members in found.members for t in members)

    @pytest.mark.parametrize("kind", ["stiffness", "mass"])
    def test_damped(self, kind):
        """In proportion to the stiffness, and to the mass: uniform."""
        system = waved(cyclic(3, epsilon=0.2), *RAMPS)
        drag = 0.003 * system.mean_stiffness_matrix() if kind == "stiffness" else 0.01 * system.mass
        system = replace(system, damping=drag)
        found = boundaries(system, 5.2, 5.6, 1e-9, 1e-5)
        same(found, boundaries(system, 5.2, 5.6, 1e-9, 1e-5, reduction=False), COPIES)
        check_raster(found, system)

    @pytest.mark.slow
    def test_rows_with_and_without_damping(self):
        system = with_ramps(planetary())
        ratios = np.array([0.0, 1e-4, 1e-3])[:, None, None]
        system = replace(system, damping=ratios * system.mean_stiffness_matrix())
        found = boundaries(system, 5.3, 6.0, 1e-10, 1e-5)
        same(found, boundaries(system, 5.3, 6.0, 1e-10, 1e-5, reduction=False), COPIES)
        check_raster(found, system, 800)


class TestApart:
    """A train and an oscillator beside it: the regions of both, each searched by itself."""

    @pytest.mark.parametrize("drag", [None, 0.02 * np.eye(3), 0.03 * np.diag([1.0, 0.3, 4.0]), GENERAL])
    @pytest.mark.parametrize("wave", [COSINE, Rectangular(1.4)], ids=["smooth", "jumps"])
    def test_regions_are_united(self, drag, wave):
        train = smooth_train(TRAPEZOID, WAVE, damping=drag)
        other = oscillator(wave, 0.4, 3.3, damping=None if drag is None else 0.02)
        total = None if drag is None else np.pad(drag, (0, 1)) + np.diag([0.0, 0.0, 0.0, 0.02])
        system = beside(train, other, total)
        found = boundaries(system, 1.5, 6.5)
        each = [boundaries(one, 1.5, 6.5) for one in (train, other)]
        assert len(found.row) < sum(len(one.row) for one in each) or drag is not None
        # All are right to 1e-10, with some share of the steps' error.
        np.testing.assert_allclose(edges(found), joined(*each), rtol=3e-10)
        check_raster(found, system)

    def test_identical_parts_are_searched_once(self):
        one = smooth_train(TRAPEZOID, WAVE)
        twins, single = boundaries(beside(one, one), 1.5, 6.5), boundaries(one, 1.5, 6.5)
        np.testing.assert_allclose(edges(twins), edges(single), rtol=3e-10)
        # Searched twice it would take twice as many.
        assert twins.evaluations.sum() < 1.5 * single.evaluations.sum()
        np.testing.assert_array_equal(twins.contacts, 2 * single.contacts)

    def test_rows_that_split_differently(self):
        """In one row the second part's stiffness does not vary, in another both parts are alike."""
        epsilon = np.array([0.4, 0.0, 0.2])
        system = beside(oscillator(COSINE, 0.4), oscillator(COSINE, epsilon))
        found = boundaries(system, 0.6, 4.0)
        for row, own in enumerate(epsilon):
            each = [boundaries(oscillator(COSINE, e), 0.6, 4.0) for e in (0.4, own)]
            np.testing.assert_allclose(edges(found)[found.row == row], joined(*each), rtol=3e-10)

    @pytest.mark.parametrize("still", [0.0, 0.3])
    def test_a_mode_that_no_mesh_deflects_needs_no_steps(self, still):
        mesh = replace(oscillator(COSINE, 0.4).meshes[0], direction=np.array([1.0, 0.0]))
        drag = np.diag([0.02, still])
        system = GearSystem(np.eye(2), np.diag([0.0, 7.0]), (mesh,), drag)
        assert sorted(division is None for _, division in parts(system, True)) == [False, True]
        found, one = boundaries(system, 0.6, 4.0), boundaries(oscillator(COSINE, 0.4, damping=0.02), 0.6, 4.0)
        np.testing.assert_allclose(edges(found), edges(one), rtol=3e-10)
        assert {(t.mode_p, t.mode_q) for members in found.members for t in members} == {(1, 1)}

    def test_a_still_mode_that_grows_by_itself_is_unstable_everywhere(self):
        mesh = replace(oscillator(COSINE, 0.4).meshes[0], direction=np.array([1.0, 0.0]))
        system = GearSystem(np.eye(2), np.diag([0.0, 7.0]), (mesh,), np.diag([0.02, -0.01]))
        found = boundaries(system, 0.6, 4.0)
        np.testing.assert_allclose(edges(found), [[0.6, 4.0]], rtol=1e-15)
        assert found.members[0][0].label == "mode 2 self-excited"
