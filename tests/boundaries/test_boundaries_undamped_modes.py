"""Edges of damped systems that turn, of whose mean modes one or two are not damped at all."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from random_rotors import random_rotor

from gearstab.floquet import solve
from gearstab.floquet.boundaries import boundaries
from gearstab.mesh import Mesh, Rotation
from gearstab.system import GearSystem
from gearstab.waveforms import Rectangular

Array = np.ndarray
START, STOP = 0.8, 4.0


def beside(system: GearSystem, frequencies: Array, turn: Array) -> GearSystem:
    """A system and undamped oscillators that nothing couples with it, in coordinates that mix all."""
    n, more = system.size, len(frequencies)

    def mixed(matrix: Array, free: Array | float = 0.0) -> Array:
        whole = np.zeros((n + more, n + more))
        whole[:n, :n], whole[n:, n:] = matrix, free
        return turn.T @ whole @ turn

    (rotation,) = system.rotations
    own = {name: getattr(rotation, name) for name in ("gyroscopic", "circulatory", "centripetal")}
    turned = replace(rotation, **{name: mixed(matrix) for name, matrix in own.items() if matrix is not None})
    meshes = tuple(
        replace(mesh, direction=np.concatenate([mesh.direction, np.zeros(more)]) @ turn) for mesh in system.meshes
    )
    mass, stiffness = mixed(system.mass, np.eye(more)), mixed(system.stiffness, np.diag(frequencies**2))
    return GearSystem(mass, stiffness, meshes, mixed(system.damping_matrix), rotations=(turned,))


@pytest.mark.parametrize("seed", [1, 3, 5])
def test_oscillators_that_nothing_drives_change_nothing(seed: int) -> None:
    """Edges, and what is proved, are those of the system alone, whatever undamped oscillators stand beside it."""
    alone = random_rotor(seed, hamiltonian=False)
    rng = np.random.default_rng(seed)
    turn, _ = np.linalg.qr(rng.normal(size=(alone.size + 2, alone.size + 2)))
    both = boundaries(beside(alone, rng.uniform(1.0, 2.0, 2), turn), START, STOP)
    expected = boundaries(alone, START, STOP)
    # Two edges to 1e-10 of the mesh frequency each.
    np.testing.assert_allclose(both.lower, expected.lower, rtol=3e-10)
    np.testing.assert_allclose(both.upper, expected.upper, rtol=3e-10)
    assert both.stable_share(both.proved)[0] > 0.99
    assert both.sampled_step[0] == 0


@pytest.mark.parametrize("seed", [1, 3])
def test_an_undamped_rotor_beside_a_damped_one_is_counted(seed: int) -> None:
    """In coordinates that mix both; its collisions are counted, and regions named, as if it stood alone."""
    free, damped = random_rotor(seed, hamiltonian=True), random_rotor(seed + 40, hamiltonian=False)
    n, every = free.size, free.size + damped.size
    turn, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(every, every)))

    def mixed(first: Array | None, second: Array | None) -> Array:
        whole = np.zeros((every, every))
        whole[:n, :n] = 0.0 if first is None else first
        whole[n:, n:] = 0.0 if second is None else second
        return turn.T @ whole @ turn

    meshes = [replace(m, direction=np.append(m.direction, np.zeros(damped.size)) @ turn) for m in free.meshes]
    for m in damped.meshes:
        direction = np.append(np.zeros(n), m.direction) @ turn
        meshes.append(replace(m, name=f"other {m.name}", direction=direction))
    names = ("gyroscopic", "circulatory", "centripetal")
    rotations = [
        replace(r, **{name: mixed(*((getattr(r, name), None)[:: 1 - 2 * k])) for name in names})
        for k, rotor in enumerate((free, damped)) for r in rotor.rotations
    ]  # fmt: skip
    both = GearSystem(
        mixed(free.mass, damped.mass), mixed(free.stiffness, damped.stiffness), tuple(meshes),
        mixed(None, damped.damping), rotations=tuple(rotations),
    )  # fmt: skip
    found, alone = boundaries(both, START, STOP), [boundaries(own, START, STOP) for own in (free, damped)]
    share = found.stable_share(found.proved) + found.stable_share(found.counted)
    # The damped one is proved but for what lies beside edges.
    assert share[0] > 0.999
    assert found.sampled_step[0] == 0
    omega = np.random.default_rng(seed).uniform(START, STOP, 3000)
    expected = np.any([np.any((omega[:, None] > a.lower) & (omega[:, None] < a.upper), axis=1) for a in alone], axis=0)
    inside = np.any((omega[:, None] > found.lower) & (omega[:, None] < found.upper), axis=1)
    np.testing.assert_array_equal(inside, expected)
    assert sum(map(len, found.members)) == sum(len(members) for a in alone for members in a.members)


def partly_damped(seed: int) -> GearSystem:
    """Three to five modes that the mesh couples all, one or two of them undamped in the mean; the others whirl."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 6))
    frequency, ratio = np.sort(rng.uniform(0.6, 2.5, n)), 10 ** rng.uniform(-4, -2, n)
    shapes, _ = np.linalg.qr(rng.normal(size=(n, n)))
    undamped = rng.permutation(n)[: 1 + (n > 3)]
    ratio[undamped] = 0
    first, second, *_ = np.setdiff1d(np.arange(n), undamped)
    plane = np.outer(shapes[:, first], shapes[:, second])
    direction = rng.normal(size=n)
    mean = 0.5 * (frequency**2).min() / (direction @ direction)
    mesh = Mesh("m", direction, mean, rng.uniform(0.1, 0.4) * mean, Rectangular(rng.uniform(1.3, 1.7)), Fraction(1), 0)
    speed = {"speed": 0.3} if seed % 2 else {"speed_ratio": Fraction(1, 10)}
    rotation = Rotation(
        gyroscopic=rng.uniform(0.05, 0.5) * (plane - plane.T),
        circulatory=1e-3 * rng.uniform() * (plane - plane.T), **speed,
    )  # fmt: skip
    stiffness = (shapes * frequency**2) @ shapes.T - mean * np.outer(direction, direction)
    return GearSystem(
        np.eye(n), stiffness, (mesh,), (shapes * (2 * ratio * frequency)) @ shapes.T, rotations=(rotation,)
    )


@pytest.mark.parametrize("seed", range(12))
def test_undamped_modes_that_the_mesh_drives(seed: int) -> None:
    """No point of a raster contradicts the edges; that nothing is proved or counted is said."""
    system, omega = partly_damped(seed), np.linspace(START, STOP, 20_001)
    found = boundaries(system, START, STOP)
    growth = solve(system, omega).growth_rate[0]
    inside = np.any((omega[:, None] > found.lower) & (omega[:, None] < found.upper), axis=1)
    edges = np.concatenate([found.lower, found.upper])
    near = np.any(np.abs(omega[:, None] / edges - 1) < found.width_floor, axis=1)
    # Growth below what rounding makes is 0 there: regions of two undamped motions may grow as slowly as that.
    assert inside[(growth > 0) & ~near].all()
    assert (growth[inside & ~near] >= 0).all()
    assert len(found.lower) >= 3
    assert found.sampled_step[0] > 0
    assert not found.coarse[0]
