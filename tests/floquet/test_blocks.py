"""Block reduction: identical answers with and without it, blocks known from symmetry, what is left out is rounding."""

from dataclasses import replace

import numpy as np
import pytest
from driven import monodromy
from hypothesis import given, settings
from hypothesis import strategies as st
from planetary_gears import cyclic
from scipy.optimize import linear_sum_assignment
from systems import HARD_CASES, random_split, rotated, star, train

from gearstab.floquet import solve
from gearstab.floquet.dispatch import reduction
from gearstab.floquet.segments import reduction as elastic_reduction
from gearstab.floquet.segments.blocks import split
from gearstab.floquet.segments.decouple import DISCARDED, adapted, components
from gearstab.floquet.segments.pattern import prepare
from gearstab.mesh import Mesh
from gearstab.system import GearSystem
from gearstab.waveforms import Rectangular

OMEGA = np.linspace(0.6, 5.8, 27)


def sizes(system):
    """(size, copies) of the blocks of a single system that vary, in no particular order; number of still modes."""
    (pattern,) = prepare(system)
    blocks = split(pattern)
    moving = sorted((b.pattern.size, b.copies) for b in blocks if not b.constant)
    return moving, sum(b.pattern.size * b.copies for b in blocks if b.constant)


def multiplier_distance(system, omega, first, second):
    """Largest distance of the multipliers of two sets of exponents ``(P, 2n)``, matched one to one."""
    period = 2 * np.pi * float(system.common_period()[0]) / omega
    worst = 0.0
    for a, b, t in zip(first, second, period, strict=True):
        distance = np.abs(np.exp(a[:, None] * t) - np.exp(b[None, :] * t))
        worst = max(worst, distance[linear_sum_assignment(distance)].max())
    return worst


def assert_same(system, omega=OMEGA, exponents=True):
    with_it = solve(system, omega, exponents)
    without = solve(system, omega, exponents, reduction=False)
    assert np.array_equal(with_it.stable, without.stable)
    # The whole system has double multipliers, whose growth a kernel knows to the square root of its rounding at worst.
    assert np.abs(with_it.growth_rate - without.growth_rate).max() < 1e-9
    if exponents:
        # A double multiplier of the whole parts by the square root of rounding.
        worst = max(
            multiplier_distance(system, omega, a, b) for a, b in zip(with_it.exponents, without.exponents, strict=True)
        )
        assert worst < 1e-7


@pytest.mark.parametrize("planets", [3, 4, 5, 6])
@pytest.mark.parametrize("in_phase", [True, False])
def test_cyclic_gears_agree_with_the_whole(planets, in_phase):
    phases = None if in_phase else np.arange(planets) / planets
    assert_same(cyclic(planets, phases))


def test_elastic_ring_agrees_with_the_whole():
    system = cyclic(4, harmonics=6)
    assert_same(system, np.array([1.3, 2.1, 3.3, 4.7]))
    assert sizes(system)[1] > 0


def test_damped_gear_agrees_with_the_whole():
    system = cyclic(4, damping=0.01)
    assert len(sizes(system)[0]) > 1
    assert_same(system)


def dashpots(system, *coordinates):
    """The system with dashpots between ground and some of its coordinates."""
    extra = np.zeros_like(system.mass)
    extra[coordinates, coordinates] = 0.05
    return replace(system, damping=system.damping + extra)


@pytest.mark.parametrize(
    ("coordinates", "expected"), [((), [(5, 1), (5, 2)]), ((6,), [(5, 1), (10, 1)]), ((6, 10), [(15, 1)])]
)
def test_damping_joins_what_it_couples(coordinates, expected):
    """A dashpot between ground and one planet breaks the symmetry, but one combination of the copies does not move it;
    with one more in another direction at another planet there is none.
    """
    system = dashpots(cyclic(3, damping=0.01), *coordinates)
    assert sizes(system) == (expected, 0)
    assert_same(system)


@pytest.mark.parametrize("planets", [3, 4, 5, 6])
def test_blocks_are_those_of_the_symmetry(planets):
    """In phase: rotations of sun, ring and three coordinates of the planets for T = 0; for T = 1 two identical blocks
    with the translations of sun and ring; for T >= 2 planets alone, two for each T < N/2 and one for T = N/2.
    """
    moving, still = sizes(cyclic(planets))
    assert still == 0
    # Without an elastic ring all planet modes are alike, of which there are N - 3.
    expected = {3: [(5, 1), (5, 2)], 4: [(3, 1), (5, 1), (5, 2)], 5: [(3, 2), (5, 1), (5, 2)]}
    assert moving == expected.get(planets, [(3, planets - 3), (5, 1), (5, 2)])


def test_sequential_phases_couple_the_types():
    moving, _ = sizes(cyclic(4, np.arange(4) / 4))
    assert moving == [(18, 1)]


def test_hub_with_satellites_has_three_blocks():
    """Star: the sum of the satellites with the hub, and two identical satellite modes."""
    assert sizes(star())[0] == [(1, 2), (2, 1)]
    assert_same(star(), np.linspace(0.5, 6, 60))


def test_what_is_left_out_is_rounding():
    """The states' stiffness between blocks, in the basis of all blocks, copies included through their complement."""
    (pattern,) = prepare(cyclic(5, harmonics=12))
    k = pattern.stiffness[0]
    for block in split(pattern):
        q = block.basis[0]
        outside = np.linalg.svd(q.T)[2][q.shape[1] :].T
        size = np.sqrt(np.abs(np.diagonal(q.T @ k[0] @ q)))[:, None]
        size = size * np.sqrt(np.abs(np.diagonal(outside.T @ k[0] @ outside)))
        # Rows of K up to 3e4 times the slowest squared frequency, eps = 2e-16 each.
        assert np.abs(q.T @ k @ outside / size).max() < 1e-10
        assert np.abs(q.T @ q - np.eye(q.shape[1])).max() < 1e-13


@pytest.mark.parametrize("system", [star(), cyclic(4), cyclic(5, harmonics=8)], ids=["star", "four", "elastic"])
def test_the_basis_of_a_degenerate_pair_does_not_matter(monkeypatch, system):
    first = solve(system, OMEGA)
    for seed in (1, 2):
        monkeypatch.setattr(elastic_reduction, "mean_modes", rotated(seed))
        again = solve(system, OMEGA)
        assert np.array_equal(first.stable, again.stable)
        assert np.abs(first.growth_rate - again.growth_rate).max() < 1e-12


def test_modes_without_mesh_deflection_are_known_exactly():
    """Two rotors joined by a shaft, one of which meshes with nothing that deflects in the second mode."""
    mass, shaft = np.diag([1.0, 1.0, 2.0]), np.array([[2.0, -1, 0], [-1, 2.0, 0], [0, 0, 0.7]])
    g = np.array([1.0, 1.0, 1.0])
    system = GearSystem(mass, shaft, (Mesh("m", g, 1.0, 0.4, Rectangular(1.5)),))
    # (1, -1, 0)/sqrt 2 does not deflect the mesh: w^2 = 3.
    assert len(reduction(system).dropped) == 1
    omega = np.array([0.9, 2.3])
    found = solve(system, omega, exponents=True)
    period = 2 * np.pi / omega
    angle = np.angle(np.exp(1j * np.sqrt(3.0) * period)) / period
    for k in range(2):
        assert np.abs(found.exponents[0, k] - 1j * angle[k]).min() < 1e-14
    assert_same(system)


@pytest.mark.parametrize("zeta", [0.002, 0.03])
def test_a_damped_mode_without_mesh_deflection_decays_as_it_must(zeta):
    mass, shaft = np.eye(2), np.array([[2.0, -1], [-1, 2.0]])
    g = np.array([1.0, 1.0])
    c = 2 * zeta * np.sqrt(3.0) * 0.5 * np.array([[1.0, -1], [-1, 1]]) + 0.4 * np.ones((2, 2))
    system = GearSystem(mass, shaft, (Mesh("m", g, 1.0, 0.1, Rectangular(1.5)),), c)
    found = solve(system, np.array([1.1]), exponents=True)
    # The other mode is damped more: the growth rate is that of the mode without mesh deflection, -zeta w.
    assert found.growth_rate[0, 0] == pytest.approx(-zeta * np.sqrt(3.0), abs=1e-14)
    assert found.exponents.shape == (1, 1, 4)
    assert found.stable[0, 0] == 1


def test_an_unstable_mode_without_mesh_deflection_counts():
    """K0 negative along (1, -1): no mesh holds it, it grows with exp(t)."""
    shaft = np.array([[1.0, 2.0], [2.0, 1.0]])
    system = GearSystem(np.eye(2), shaft, (Mesh("m", np.array([1.0, 1.0]), 1.0, 0.1, Rectangular(1.5)),))
    found = solve(system, np.array([1.7, 2.9]))
    assert np.all(found.stable == 0)
    assert found.growth_rate == pytest.approx(np.ones((1, 2)), abs=1e-13)


def test_rows_may_split_differently():
    """epsilon = 0 (nothing varies), equal and unequal amplitudes of the first two satellites in one batch."""
    epsilon = np.array([0.0, 0.2, 0.2, 0.35])
    other = np.array([0.0, 0.2, 0.1, 0.35])
    base = star()
    meshes = tuple(replace(m, epsilon=other if i == 0 else epsilon) for i, m in enumerate(base.meshes))
    system = replace(base, meshes=meshes)
    omega = np.linspace(0.7, 5, 19)
    together = solve(system, omega, exponents=True)
    for r in range(4):
        parts = tuple(replace(m, epsilon=float(m.epsilon[r])) for m in meshes)
        alone = solve(replace(base, meshes=parts), omega, exponents=True, reduction=False)
        assert np.array_equal(together.stable[r], alone.stable[0])
        assert np.abs(together.growth_rate[r] - alone.growth_rate[0]).max() < 1e-9
        # Double multipliers of the whole.
        assert multiplier_distance(base, omega, together.exponents[r], alone.exponents[0]) < 1e-6


def test_a_free_damped_gear_keeps_its_rigid_exponents():
    """Free-free star with a dashpot at the hub: damping couples the rigid mode to one block only."""
    base = star()
    dashpot = np.diag([0.05, 0, 0, 0])
    system = replace(base, stiffness=np.zeros((4, 4)), damping=dashpot + 0.01 * star().mean_stiffness_matrix())
    assert len(sizes(system)[0]) == 2
    assert_same(system, np.linspace(0.8, 4, 9))


def test_a_train_is_one_block():
    assert sizes(train())[0] == [(3, 1)]
    assert reduction(train()).text() == "one block of 3 modes"


@pytest.mark.parametrize("case", [c for c in HARD_CASES if c.system.size < 10], ids=lambda c: c.name)
def test_hard_cases_agree_with_the_whole(case):
    assert_same(case.system, np.array(case.omega), exponents=False)


@settings(max_examples=15)
@given(st.integers(0, 10**6), st.lists(st.integers(1, 4), min_size=1, max_size=3), st.integers(1, 3))
def test_hidden_blocks_are_found(seed, groups, copies):
    system = random_split(np.random.default_rng(seed), groups, copies)
    moving, still = sizes(system)
    # Nothing finer exists: one mesh couples all modes of its part.
    assert sorted(size for size, many in moving for _ in range(many)) == sorted([groups[0]] * copies + groups[1:])
    assert still == 0
    if groups[0] > 1 or len(groups) == 1:
        assert (groups[0], copies) in moving
    assert_same(system, np.array([0.9, 2.4]), exponents=False)


def test_growth_of_a_split_system_against_matrix_exponentials():
    """One number by a third way: the product of exponentials of the first-order system, in the original coordinates."""
    system, omega = cyclic(3), 2.05
    result = solve(system, np.array([omega]))
    largest = np.log(np.abs(np.linalg.eigvals(monodromy(system, [omega]))).max()) * omega / (2 * np.pi)
    assert result.growth_rate[0, 0] == pytest.approx(largest, abs=1e-7)


def test_components_of_graphs():
    linked = np.zeros((2, 5, 5), dtype=bool)
    for r, edges in enumerate([[(0, 1), (1, 2), (2, 3), (3, 4)], [(1, 4), (0, 3)]]):
        for a, b in edges:
            linked[r, a, b] = linked[r, b, a] = True
    assert components(linked).tolist() == [[0, 0, 0, 0, 0], [0, 1, 2, 0, 1]]


def test_adapted_basis_separates_copies_of_a_block():
    """Three copies of a 2 x 2 family, hidden in two threefold eigenspaces."""
    rng = np.random.default_rng(4)
    family = []
    turn = [np.linalg.qr(rng.standard_normal((3, 3)))[0] for _ in range(2)]
    hidden = np.block([[turn[0], np.zeros((3, 3))], [np.zeros((3, 3)), turn[1]]])
    for _ in range(3):
        small = rng.standard_normal((2, 2))
        family.append(hidden @ np.kron(small + small.T, np.eye(3)) @ hidden.T)
    values = np.array([[1.0, 1, 1, 2, 2, 2]])
    basis, coupling = adapted(values, np.array(family)[None], np.array([DISCARDED]))
    label = components(coupling > 1e-12)[0]
    assert sorted(np.bincount(label, minlength=6).tolist()) == [0, 0, 0, 2, 2, 2]
    assert np.abs(basis[0].T @ basis[0] - np.eye(6)).max() < 1e-14
