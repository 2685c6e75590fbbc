"""Edges of instability regions of damped systems."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from random_rotors import random_rotor
from scipy.optimize import brentq
from tongues import disagreements, train

from gearstab.floquet import solve
from gearstab.floquet.boundaries import boundaries
from gearstab.mesh import Mesh
from gearstab.modal import mean_modes
from gearstab.perturbation import first_order
from gearstab.rotation import Rotation
from gearstab.system import GearSystem
from gearstab.systems import build
from gearstab.waveforms import Rectangular


def half_trace(omega: float, epsilon: float, decay: float) -> float:
    """Half trace of the undamped companion of a gear pair, u'' + (k(t) - decay^2) u = 0, m = k_g = 1, c = 1.5."""
    half, a, b = np.pi / omega, np.sqrt(1 + epsilon - decay**2), np.sqrt(1 - epsilon - decay**2)
    return np.cos(a * half) * np.cos(b * half) - 0.5 * (a / b + b / a) * np.sin(a * half) * np.sin(b * half)


def test_gear_pair_against_the_closed_form() -> None:
    """The growth of the companion equals the decay: |trace/2| = cosh(zeta w T)."""
    zeta, epsilon = 0.02, 0.4
    mesh = {"name": "mesh", "mean_stiffness": 1.0, "epsilon": np.array([epsilon]), "contact_ratio": 1.5}
    pair = build({"kind": "gear_pair", "equivalent_mass": 1.0, "damping_ratio": zeta, "meshes": [mesh]})
    found = boundaries(pair, 0.3, 3.0, tolerance=1e-12)

    def excess(omega: float) -> float:
        return np.log(np.abs(half_trace(omega, epsilon, zeta))) - np.log(np.cosh(zeta * 2 * np.pi / omega))

    omega = 1 / np.linspace(1 / 3.0, 1 / 0.3, 100_001)
    value = np.array([excess(x) for x in omega])
    edges = [
        brentq(excess, omega[k + 1], omega[k], xtol=1e-15, rtol=1e-15)
        for k in np.flatnonzero(value[1:] * value[:-1] < 0)
    ]
    ours = np.sort(np.concatenate([found.lower, found.upper]))
    assert len(edges) >= 6
    np.testing.assert_allclose(ours, np.sort(edges), rtol=1e-11)


@pytest.mark.parametrize("tooth_ratio", ["1", "3/5"])
@pytest.mark.parametrize("zeta", [0.001, 0.01])
def test_modal_damping_against_flags(zeta: float, tooth_ratio: str) -> None:
    epsilon = np.array([0.02, 0.1, 0.3, 0.5])
    system = train((1.37, 1.62), 0.2, tooth_ratio, (epsilon, epsilon), damping_ratio=zeta)
    found = boundaries(system, 1.0, 7.0)
    assert disagreements(found, system, 1.0, 7.0, 3000) == {}
    assert found.tolerance.max() < 1e-10
    # The growth rate changes its sign within 1e-9 of each edge; growth of 1e-10 a period or less is told as none.
    for row in range(4):
        mine = (found.row == row) & ~found.cut.any(axis=1)
        for edges, side in ((found.lower, -1), (found.upper, 1)):
            outside = solve(system, edges[mine] * (1 + side * 1e-9)).growth_rate[row]
            within = solve(system, edges[mine] * (1 - side * 1e-8)).growth_rate[row]
            assert (outside < 0).all()
            # 0 where so little growth per period counts as stable; 1e-9 outside it is negative.
            assert (within >= 0).all()


def test_damping_closes_tongues() -> None:
    """At epsilon = 0.02 and two per cent nothing is left; without damping there are many regions."""
    assert len(boundaries(train(epsilon=(0.02, 0.02), damping_ratio=0.02), 0.9, 7.0).row) == 0
    assert len(boundaries(train(epsilon=(0.02, 0.02)), 0.9, 7.0).row) > 10


def test_unequal_damping_widens_as_predicted() -> None:
    """mu_p << mu_q: an open tongue is wider than the undamped one, by (mu_p + mu_q)/(2 sqrt(mu_p mu_q)) for small
    damping."""
    ratios = [1e-3, 2e-5, 5e-7]
    system = train(epsilon=(0.005, 0.005), damping={"modal": ratios})
    found = boundaries(system, 3.5, 3.9)
    theory = first_order(system, 1)
    k = [t.label for t in theory.index].index("w2+w3")
    damped, free = theory.half_width[k], first_order(train(epsilon=(0.005, 0.005)), 1).half_width[k]
    assert damped > 1.5 * free
    assert found.labels() == ["w2+w3"]
    # First order: the error is of the relative size epsilon.
    assert found.upper[0] - found.lower[0] == pytest.approx(2 * damped, rel=0.02)


def test_names_are_those_of_the_undamped_regions() -> None:
    free = boundaries(train((1.37, 1.62), 0.2, 1, (0.3, 0.3)), 1.1, 7.0)
    damped = boundaries(train((1.37, 1.62), 0.2, 1, (0.3, 0.3), damping_ratio=0.002), 1.1, 7.0)
    names = {members: 0.5 * (a + b) for members, a, b in zip(free.members, free.lower, free.upper, strict=True)}
    assert len(damped.row) > 8
    for members, a, b in zip(damped.members, damped.lower, damped.upper, strict=True):
        centre = next(c for own, c in names.items() if set(members) <= set(own))
        assert centre == pytest.approx(0.5 * (a + b), rel=0.02)


@pytest.mark.parametrize("ratios", [[0.0, 0.01, 0.003], [0.02, 0.0005, 0.01]])
def test_strongly_unequal_damping(ratios: list[float]) -> None:
    epsilon = np.array([0.1, 0.4])
    system = train((1.37, 1.62), 0.2, 1, (epsilon, epsilon), damping={"modal": ratios})
    found = boundaries(system, 1.1, 7.0)
    assert disagreements(found, system, 1.1, 7.0, 3000) == {}


def test_negative_damping_is_unstable_everywhere() -> None:
    system = train(epsilon=(0.05, 0.05), damping={"modal": [-0.01, 0.01, 0.01]})
    found = boundaries(system, 2.0, 3.0)
    assert (found.lower.tolist(), found.upper.tolist()) == ([2.0], [3.0])
    assert found.cut.all()


def test_rigid_mode_and_five_coordinates() -> None:
    epsilon = np.array([0.2, 0.5])
    rigid = train((1.37, 1.62), 0.2, 1, (epsilon, epsilon), input_shaft_stiffness=0.0, damping_ratio=0.003)
    assert disagreements(boundaries(rigid, 1.0, 7.0), rigid, 1.0, 7.0, 2000) == {}
    rng = np.random.default_rng(5)
    meshes = [
        {"name": f"m{k}", "direction": rng.normal(size=5), "mean_stiffness": 1.0, "epsilon": np.array([0.3]),
         "contact_ratio": 1.5, "frequency_ratio": r}
        for k, r in enumerate((Fraction(1), Fraction(1, 2)))
    ]  # fmt: skip
    mass, stiffness = np.diag(rng.uniform(0.5, 2, 5)), np.diag(rng.uniform(0.5, 3, 5))
    system = build({"kind": "matrices", "mass": mass, "stiffness": stiffness, "meshes": meshes, "damping_ratio": 0.004})
    assert disagreements(boundaries(system, 1.0, 5.0), system, 1.0, 5.0, 2000) == {}


@pytest.mark.parametrize("ratios", [[0.0, 0.02, 0.05], [0.05, 0.0], [0.001, 0.01]])
def test_rows_that_differ_by_their_damping_alone(ratios: list[float]) -> None:
    """Every row is that of the system by itself."""

    def pair(damping: object) -> GearSystem:
        mesh = {"name": "mesh", "mean_stiffness": 1.0, "epsilon": 0.3, "contact_ratio": 1.4, "damping": damping}
        return build({"kind": "gear_pair", "equivalent_mass": 1.0, "meshes": [mesh]})

    together = boundaries(pair(np.array(ratios)), 0.5, 3.0)
    for row, ratio in enumerate(ratios):
        alone = boundaries(pair(ratio), 0.5, 3.0)
        assert len(alone.lower) > 0
        mine = together.row == row
        np.testing.assert_allclose(together.lower[mine], alone.lower, rtol=2e-10)
        np.testing.assert_allclose(together.upper[mine], alone.upper, rtol=2e-10)
        assert [together.labels()[k] for k in np.flatnonzero(mine)] == list(alone.labels())


def test_a_region_without_an_undamped_one_keeps_its_name() -> None:
    """Unequal damping opens a combination tongue that is narrower than the width floor without it."""
    mesh = Mesh("mesh", np.array([1.0, 0.7]), np.asarray(1.0), np.asarray(0.02), Rectangular(1.5))
    free = GearSystem(np.eye(2), np.diag([0.5, 2.0]), (mesh,))
    modes = mean_modes(free)
    uneven = modes.shapes @ np.diag([1e-6, 1e-3]) @ modes.shapes.T
    total = float(modes.natural_frequency.sum())
    assert boundaries(free, 0.96 * total, 1.04 * total, width_floor=0.015).labels() == []
    found = boundaries(replace(free, damping=uneven), 0.96 * total, 1.04 * total, width_floor=0.015)
    assert found.labels() == ["w1+w2"]
    assert np.isfinite(found.arranged().boundary_frequency).all()


# --- edges of damped systems that turn, of whose mean modes one or two are not damped at all


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
