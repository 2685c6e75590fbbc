"""Compiled products of segments whose generators go with the mesh frequency, against their form in NumPy."""

import numpy as np
import numpy_kernel
import pytest

from gearstab import ckernel
from gearstab.floquet.kernel import c_kernel
from gearstab.floquet.kernel.damped import Generators
from gearstab.floquet.segments.pattern import Succession
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
