"""Collisions of large systems that are enclosed by counts at a few angles: the counts, and what is found with them."""

from itertools import pairwise

import krein_search
import numpy as np
import pytest
from systems import KINDS, system

from gearstab.ckernel import library
from gearstab.floquet.boundaries import undamped
from gearstab.floquet.boundaries.counting.krein import spectrum
from gearstab.floquet.boundaries.parts import Intervals
from gearstab.floquet.kernel import c_kernel
from gearstab.floquet.segments.pattern import Pattern, prepare
from gearstab.mesh import Mesh
from gearstab.system import Array, GearSystem
from gearstab.waveforms import Rectangular

TOLERANCE, FLOOR = 1e-10, 1e-6


def below(pattern: Pattern, level: str, cycle: Array, angle: Array) -> Array:
    """Counts of the kernel at points of the first row."""
    found = np.empty(angle.shape, dtype=np.int64)
    arguments = c_kernel.pattern_arguments(pattern, slice(0, 1))
    library.below(level, *arguments, 0, 1, len(cycle), angle.shape[1], cycle, angle, found)
    return found


@pytest.mark.parametrize("level", library.levels())
@pytest.mark.parametrize("n", [1, 2, 3, 5, 6, 7, 8, 14, 19])
def test_counts_at_angles(n: int, level: str) -> None:
    """The counts are those of NumPy's eigenvalues, their differences those of the multipliers in between, by sign."""
    rng = np.random.default_rng(n)
    seen = 0
    for kind in KINDS:
        (pattern,) = (item for item in prepare(system(n, kind, 3)) if item.size)
        cycle, angle = rng.uniform(0.1, 2.0, 9), np.sort(rng.uniform(0.0, np.pi, (9, 5)), axis=1)
        angle[:, 0], angle[:, -1] = 0.0, np.pi
        found = below(pattern, level, cycle, angle)
        matrix, scale = c_kernel.monodromy(pattern, 0, 1 / cycle)
        known = (found >= 0).all(axis=1)
        assert not np.any(known & (scale != 0))
        np.testing.assert_array_equal(found[known], krein_search.below(matrix[known], angle[known]))
        spectra = spectrum(matrix[known])
        for k, own in enumerate(np.flatnonzero(known)):
            upper = ~spectra.off[k] & (spectra.values[k].imag > 0)
            phase, sign = np.angle(spectra.values[k][upper]), np.sign(spectra.sign[k][upper])
            passed = [-sign[(phase > low) & (phase < high)].sum() for low, high in pairwise(angle[own])]
            np.testing.assert_array_equal(np.diff(found[own]), passed)
        seen += known.sum()
    assert seen > 20


def twins(half: int, seed: int) -> GearSystem:
    """A Hermitian problem of half the size: every multiplier comes twice, almost."""
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(half, half)) + 1j * rng.normal(size=(half, half)))[0]
    mean = turn @ np.diag(10 ** rng.uniform(-1, 1.2, half)) @ turn.conj().T
    stiffness, meshes = np.block([[mean.real, -mean.imag], [mean.imag, mean.real]]), []
    for k in range(2):
        way = 0.3 * (rng.normal(size=half) + 1j * rng.normal(size=half))
        for j, part in enumerate((way, 1j * way)):
            direction, wave = np.concatenate([part.real, part.imag]), Rectangular(1.3 + 0.3 * k)
            meshes.append(Mesh(f"m{k}{j}", direction, np.array(1.0), np.array([0.2]), wave, lag=0.37 * k))
    return GearSystem(np.eye(2 * half), 0.5 * (stiffness + stiffness.T), tuple(meshes))


def chain(size: int) -> GearSystem:
    """Masses in a row with two meshes, far apart in stiffness."""
    rng = np.random.default_rng(size)
    steps = np.eye(size) - np.eye(size, k=-1)
    meshes = []
    for p in (3, 9):
        wave = Rectangular(1.2 + 0.02 * p)
        meshes.append(Mesh(f"m{p}", steps[p], np.array(2.0), np.array([0.3]), wave, lag=0.1 * p))
    return GearSystem(np.eye(size), steps.T @ np.diag(10 ** rng.uniform(0, 1.5, size)) @ steps, tuple(meshes))


@pytest.mark.parametrize(
    ("item", "start", "stop"), [(twins(8, 1), 0.5, 0.6), (twins(10, 2), 0.4, 0.45), (chain(15), 0.5, 0.6)]
)
def test_regions_of_many_coordinates(item: GearSystem, start: float, stop: float) -> None:
    """The search finds what counts and halving find."""
    (pattern,) = prepare(item)
    first, last = pattern.elastic.rate / stop, pattern.elastic.rate / start
    found = undamped.search(pattern, first, last, TOLERANCE, FLOOR)
    known = krein_search.search(pattern, first, last, TOLERANCE, FLOOR)
    own, other = (wide(intervals) for intervals in (found.intervals, known))
    assert len(own) == len(other) > 5
    np.testing.assert_allclose(own, other, rtol=3e-9)


def wide(found: Intervals) -> Array:
    """Edges of what is wider than the floor; stable gaps narrower than it may be found or not."""
    merged: list[list[float]] = []
    for start, stop in sorted(zip(found.start.tolist(), found.stop.tolist(), strict=True)):
        if merged and start - merged[-1][1] < FLOOR * start:
            merged[-1][1] = stop
        else:
            merged.append([start, stop])
    edges = np.array(merged)
    return edges[edges[:, 1] - edges[:, 0] > 1.01 * FLOOR * edges[:, 0]]
