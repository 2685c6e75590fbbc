"""Gears of cyclic symmetry: modes of one frequency, or nearly so, come in twins; their edges and their names."""

import numpy as np
import pytest
from planetary_gears import SEQUENTIAL, parameters, with_epsilon

from gearstab.floquet.boundaries import boundaries
from gearstab.floquet.boundaries.undamped import search
from gearstab.floquet.segments.blocks import split
from gearstab.floquet.segments.pattern import Pattern, prepare
from gearstab.systems import build

GROWN = 3e-8
"""ln |lambda|: wrong by the root of 1e-16 beside an edge, and 1e-6 in a distance of 1e-10 from it."""


def half(pattern: Pattern) -> list[np.ndarray]:
    """Hermitian matrices (m, m) of the states of 2m coordinates, on half of which a quarter turn of the gear is i."""
    stiffness = pattern.stiffness[0]
    _, modes = np.linalg.eigh(stiffness[0])
    states = np.swapaxes(modes, 0, 1) @ stiffness @ modes
    turn, count = np.array([[0.0, -1.0], [1.0, 0.0]]), len(modes) // 2
    couplings = states.reshape(-1, count, 2, count, 2).transpose(0, 1, 3, 2, 4)
    sign = np.zeros(count)
    sign[0] = 1
    while (sign == 0).any():
        i, j = np.nonzero((sign[:, None] != 0) & (sign == 0) & (np.abs(couplings).max(axis=(0, 3, 4)) > 1e-6))
        own = couplings[np.abs(couplings[:, i[0], j[0]]).max(axis=(1, 2)).argmax(), i[0], j[0]]
        alike = np.abs(turn @ own - own @ turn).max() < np.abs(turn @ own + own @ turn).max()
        sign[j[0]] = sign[i[0]] if alike else -sign[i[0]]
    quarter = modes @ np.kron(np.diag(sign), turn) @ modes.T
    assert all(np.abs(quarter @ k - k @ quarter).max() < 1e-12 * np.abs(k).max() for k in stiffness)
    values, vectors = np.linalg.eig(quarter)
    basis = np.linalg.qr(vectors[:, values.imag > 0])[0]
    return [basis.conj().T @ k @ basis for k in stiffness]


def growth(states: list[np.ndarray], pattern: Pattern, cycle: float) -> float:
    """The largest ln |lambda|, from matrices that are half as large and have no nearly equal multipliers."""
    m = len(states[0])
    eigen = [np.linalg.eigh(k) for k in states]
    x = np.eye(2 * m, dtype=complex)
    for fraction, state in zip(pattern.fractions[0], pattern.states, strict=True):
        w, modes = np.sqrt(eigen[state][0])[:, None], eigen[state][1]
        angle = w * (2 * np.pi * pattern.cycles * cycle * fraction)
        u, v = modes.conj().T @ x[:m], modes.conj().T @ x[m:]
        x[:m] = modes @ (np.cos(angle) * u + np.sin(angle) / w * v)
        x[m:] = modes @ (-w * np.sin(angle) * u + np.cos(angle) * v)
    return float(np.log(np.abs(np.linalg.eigvals(x))).max())


@pytest.fixture(scope="module")
def twins() -> Pattern:
    """30 coordinates of Parker's elastic ring, with the ring's meshes half a period after the sun's."""
    (pattern,) = prepare(build(with_epsilon(parameters(harmonics=20), 0.2)))
    return max((block.pattern for block in split(pattern)), key=lambda part: part.size)


EDGES = [(99.136, 1e-9), (63.4386, 1e-4), (95.148, 1e-4), (126.86364, 1e-4), (126.8775, 1e-9)]
"""Where regions of twins are, and the largest error of their edges, relative: beside 1 less is known."""


@pytest.mark.parametrize(("cycle", "stated"), EDGES)
def test_edges_of_nearly_identical_twins(twins: Pattern, cycle: float, stated: float) -> None:
    """A pair that leaves the circle beside its twin was once taken for rounding errors, up to 2e-9 after the edge."""
    found = search(twins, np.array([cycle - 0.01]), np.array([cycle + 0.01]), 1e-10, 1e-6).intervals
    states = half(twins)
    assert len(found.start) > 0
    assert not found.cut.any()
    assert found.error.max() < stated * cycle
    for edges, errors in zip(np.stack([found.start, found.stop], axis=1), found.error, strict=True):
        for edge, error, inwards in zip(edges, errors, (1, -1), strict=True):
            aside = inwards * max(error, 1e-10 * edge)
            if 2 * error < edges[1] - edges[0]:
                assert growth(states, twins, edge + aside) > GROWN
            assert growth(states, twins, edge - aside) < GROWN


@pytest.mark.parametrize("harmonics", [1, 6, 12])
def test_coordinates_of_blocks_are_modes_of_the_mean_system(harmonics: int) -> None:
    (pattern,) = prepare(build(with_epsilon(parameters(harmonics=harmonics, phases=SEQUENTIAL), 0.2)))
    frequencies = []
    for block in split(pattern):
        part = block.pattern
        mean = np.einsum("s,sij->ij", part.fractions[0], part.stiffness[0][part.states])
        assert np.abs(mean - np.diag(np.diag(mean))).max() < 1e-14 * np.abs(mean).max()
        frequencies += [np.diag(mean)] * block.copies
    whole = np.einsum("s,sij->ij", pattern.fractions[0], pattern.stiffness[0][pattern.states])
    np.testing.assert_allclose(np.sort(np.concatenate(frequencies)), np.sort(np.diag(whole)), rtol=1e-9)


def test_names_by_blocks_are_those_of_the_whole() -> None:
    """Modes of nearly equal frequencies were once mixed to separate the blocks, and regions named after a mixture."""
    system = build(with_epsilon(parameters(harmonics=6, phases=SEQUENTIAL), 0.2))
    split_up, whole = boundaries(system, 4.4, 5.4), boundaries(system, 4.4, 5.4, reduction=False)
    np.testing.assert_allclose(split_up.lower, whole.lower, rtol=1e-8)
    first, second = (
        [names[0].label if len(names) == 1 else "" for names in found.members] for found in (split_up, whole)
    )
    both = [(a, b) for a, b in zip(first, second, strict=True) if a and b]
    assert len(both) > 50
    assert all(a == b for a, b in both)
