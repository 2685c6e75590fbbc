"""Rigid-body modes that damping holds, feeds or leaves alone, against the monodromy matrix of the whole system.

The reference propagates all 2n states, q and q', by matrix exponentials of the physical matrices: no modes, nothing
left out. A rigid-body mode makes two multipliers 1 that are one defective one, which rounding moves by some 1e-8.
"""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from driven import monodromy

from gearstab.floquet import frequencies, solve
from gearstab.floquet.boundaries import boundaries
from gearstab.floquet.frequencies import lyapunov
from gearstab.floquet.required_damping import FLAGS, required_damping
from gearstab.mesh import Mesh, PeriodicForce, PeriodicTerm
from gearstab.response import free_response, steady_state
from gearstab.system import GearSystem
from gearstab.waveforms import Fourier, Rectangular, Scaled, Trapezoidal

CLEAR = 1e-6
"""Growth a period beyond the rounding of a defective multiplier."""
JUMPS = Rectangular(1.4), Rectangular(1.7)
HELD, FED, COUPLED, FREE = "held", "fed", "coupled", "free"


def train(rng, kind, waves=JUMPS, ratio=Fraction(1, 2), bodies=4, rigid=1):
    """A chain of bodies, springs alternating with meshes, free as a whole; ``rigid`` copies side by side."""
    size = bodies * rigid
    mass = np.diag(rng.uniform(0.5, 2.0, size))
    stiffness, directions = np.zeros((size, size)), []
    for part in range(rigid):
        for k in range(bodies - 1):
            g = np.zeros(size)
            g[[part * bodies + k, part * bodies + k + 1]] = rng.uniform(0.5, 1.5), -rng.uniform(0.5, 1.5)
            if k % 2 and len(directions) < len(waves):
                directions.append(g)
            else:
                stiffness += rng.uniform(0.5, 3.0) * np.outer(g, g)
    directions += [directions[-1]] * (len(waves) - len(directions))
    ratios = [Fraction(1), ratio]
    meshes = tuple(
        Mesh(f"m{i}", g, np.asarray(rng.uniform(0.6, 2.0)), np.asarray(0.3), wave, ratios[i], rng.uniform())
        for i, (g, wave) in enumerate(zip(directions, waves, strict=True))
    )
    still = GearSystem(mass, stiffness, meshes)
    shapes = null_space(still)
    # Proportional to what springs and meshes are made of: it does not feel the rigid-body motion.
    elastic = 0.02 * still.mean_stiffness_matrix()
    weight = mass @ shapes
    drag = {
        HELD: elastic + rng.uniform(0.01, 0.05) * weight @ weight.T,
        FED: elastic - rng.uniform(0.01, 0.05) * weight @ weight.T,
        FREE: elastic,
    }
    if kind == COUPLED:
        uneven = rng.standard_normal((size, size))
        return replace(still, damping=elastic + 0.02 * (uneven + uneven.T))
    return replace(still, damping=drag[kind])


def null_space(system):
    """``(n, k)``, rigid-body modes, normalised by the mass matrix."""
    root = np.diag(1 / np.sqrt(np.diag(system.mass)))
    values, vectors = np.linalg.eigh(root @ system.mean_stiffness_matrix() @ root)
    return root @ vectors[:, np.abs(values) < 1e-12 * values.max()]


def multipliers(system, omega, steps=1):
    """All 2n multipliers of a common period, by descending size, and the period."""
    (values,) = np.linalg.eigvals(monodromy(system, [omega], steps))
    return values[np.argsort(-np.abs(values))], 2 * np.pi * float(system.common_period()[0]) / omega


def expected(system, omega, steps=1):
    """The growth rate, 0 if nothing grows beyond what a defective multiplier 1 seems to."""
    values, period = multipliers(system, omega, steps)
    largest = np.log(np.abs(values[0]))
    return largest / period if largest > CLEAR else 0.0


KINDS = (HELD, FED, COUPLED, FREE)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(4))
def test_the_verdict_is_that_of_the_whole_system(kind, seed):
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    system = train(rng, kind, rigid=1 + seed % 2)
    omega = np.geomspace(0.3, 6.0, 12)
    found = solve(system, omega, exponents=True)
    for k, frequency in enumerate(omega):
        growth = expected(system, frequency)
        assert found.stable[0, k] == (growth == 0)
        if growth:
            assert found.growth_rate[0, k] == pytest.approx(growth, abs=1e-9)
            assert found.exponents[0, k].real.max() == pytest.approx(growth, abs=1e-9)
        else:
            assert found.growth_rate[0, k] < 1e-10


@pytest.mark.parametrize("kind", KINDS)
def test_other_ways_agree(kind):
    """General systems, one mesh frequency at a time, Lyapunov exponents."""
    rng = np.random.default_rng([7, KINDS.index(kind)])
    system = train(rng, kind)
    omega = np.array([0.45, 1.3, 2.9, 5.1])
    exact = solve(system, omega)
    nothing = Scaled(Rectangular(1.5), 0.0, np.asarray(0.0))
    term = PeriodicTerm("nothing", system.meshes[0].direction, system.meshes[0].direction, stiffness=nothing)
    general = solve(replace(system, terms=(term,)), omega)
    np.testing.assert_array_equal(general.stable, exact.stable)
    np.testing.assert_allclose(general.growth_rate, exact.growth_rate, atol=1e-9)
    one = replace(system, meshes=(system.meshes[0], replace(system.meshes[1], epsilon=np.asarray(0.0))))
    alone = frequencies.solve(one, omega, solve)
    np.testing.assert_allclose(alone.growth_rate, solve(one, omega).growth_rate, atol=1e-9)
    estimated = lyapunov.solve(system, omega, cycles=400)
    assert np.all(np.abs(estimated.growth_rate - exact.growth_rate) <= estimated.interval + 1e-4)
    assert np.all(estimated.stable[exact.growth_rate > 1e-3] == 0)


def test_smooth_waves():
    for kind in KINDS:
        rng = np.random.default_rng([3, KINDS.index(kind)])
        waves = (Fourier(np.array([0.0]), np.array([0.5])), Trapezoidal(1.5, 0.2))
        system = train(rng, kind, waves, Fraction(1))
        omega = np.array([0.9, 2.3])
        found = solve(system, omega)
        for k, frequency in enumerate(omega):
            growth = expected(system, frequency, steps=400)
            assert found.stable[0, k] == (growth == 0)
            if growth:
                assert found.growth_rate[0, k] == pytest.approx(growth, rel=1e-3)


def two_masses(drag, epsilon=0.3):
    mesh = Mesh("mesh", np.array([1.0, -1.0]), np.asarray(1.0), np.asarray(epsilon), Rectangular(1.5))
    return GearSystem(np.eye(2), np.zeros((2, 2)), (mesh,), np.asarray(drag, dtype=float))


FALLING = [[0.0, -0.02], [-0.02, 0.0]]
"""A rigid-body mode that grows with 0.02, an elastic one of damping ratio 0.007."""
MOTOR = [[-0.02, 0.0], [0.0, 0.0]]
"""A torque that rises with the speed of one of the two."""


def test_a_falling_characteristic_is_unstable_at_every_speed():
    system = two_masses(FALLING)
    found = solve(system, np.array([1.0, 2.0]))
    np.testing.assert_array_equal(found.stable, 0)
    np.testing.assert_allclose(found.growth_rate, 0.02, rtol=1e-12)
    history = free_response(system, 2.0, np.array([0.1, 0.0]), np.array([0.01, 0.01]), 600.0)
    assert history.growth_rate == pytest.approx(0.02, rel=1e-12)
    assert "unstable" in history.findings
    middle = history.displacement.mean(axis=1)
    # The mean velocity obeys v' = 0.02 v.
    np.testing.assert_allclose(middle, 0.05 + 0.01 / 0.02 * np.expm1(0.02 * history.time), rtol=1e-9)


@pytest.mark.parametrize(("drag", "count"), [(FALLING, 1), (MOTOR, 2)])
def test_boundaries_are_those_of_the_range(drag, count):
    found = boundaries(two_masses(drag), 0.5, 4.0)
    assert (found.lower.tolist(), found.upper.tolist()) == ([0.5], [4.0])
    assert found.cut.all()
    first = found.members[0][0]
    assert (first.kind, first.mode_p, first.frequency_ratio) == ("self-excited", 1, 0.0)
    assert "mode 1 self-excited" in found.labels()[0]
    # It comes out of the arrangement by tongues, where a region without a name would be lost.
    edges = found.arranged()
    assert edges.index[0][0] == first
    np.testing.assert_array_equal(edges.boundary_frequency[0, :, 0], [0.5, 4.0])


def test_a_mode_that_no_mesh_moves_keeps_its_region():
    """An elastic mode without mesh deflection and with negative damping: a block of its own, without tongues."""
    base = two_masses(0.02 * np.eye(2))
    size = 3
    grown = replace(
        base,
        mass=np.eye(size),
        stiffness=np.diag([0.2, 0.2, 1.7]),
        damping=np.diag([0.02, 0.02, -0.01]),
        meshes=(replace(base.meshes[0], direction=np.array([1.0, -1.0, 0.0])),),
    )
    assert np.all(solve(grown, np.array([0.7, 1.9])).stable == 0)
    found = boundaries(grown, 0.5, 4.0)
    assert (found.lower.tolist(), found.upper.tolist()) == ([0.5], [4.0])
    assert found.members[0][0].label.endswith("self-excited")
    required = required_damping(grown, np.array([0.7, 1.9]), of="factor")
    assert np.all(np.isnan(required.value))


def test_no_damping_ratio_holds_a_rigid_body():
    for drag in (FALLING, MOTOR):
        for of in ("damping_ratio", "factor"):
            found = required_damping(two_masses(drag), np.array([0.8, 2.7]), of=of)
            assert np.all(np.isnan(found.value))
            assert np.all(found.status & FLAGS["rigid_body"])
    found = required_damping(two_masses(0.02 * np.eye(2)), np.array([0.8, 2.7]))
    assert np.all(found.status & FLAGS["rigid_body"] == 0)
    assert np.all(np.isfinite(found.value))


def test_one_row_of_a_batch():
    drag = np.array([np.zeros((2, 2)), FALLING, MOTOR, 0.02 * np.eye(2), 0.02 * np.array([[1, -1], [-1, 1]])])
    system = two_masses(drag, epsilon=0.0)
    omega = np.array([1.1, 2.2])
    assert solve(system, omega).stable.tolist() == [[1, 1], [0, 0], [0, 0], [1, 1], [1, 1]]
    # A decay of its own takes no part: that of the elastic mode remains, and of none where there is no damping.
    np.testing.assert_allclose(solve(system, omega).growth_rate[[0, 1, 3, 4], 0], [0, 0.02, -0.01, -0.02], atol=1e-12)
    found = boundaries(system, 0.5, 4.0)
    assert set(found.row.tolist()) == {1, 2}


def test_two_rigid_bodies_of_which_one_is_held():
    """Any mixture of the two is a mode; what nothing damps is left out, so that the growth rate is that of the rest."""
    pair = np.array([[1.0, -1.0], [-1.0, 1.0]])
    first = np.zeros((4, 4))
    first[:2, :2] = pair
    second = np.zeros((4, 4))
    second[2:, 2:] = pair
    mesh = Mesh("mesh", np.array([1.0, -1.0, 0.0, 0.0]), np.asarray(1.0), np.asarray(0.2), Rectangular(1.5))
    drag = 0.03 * (first + second)
    drag[0, 0] += 0.05
    system = GearSystem(np.eye(4), 2.0 * second, (mesh,), drag)
    omega = np.array([0.9, 3.3])
    found = solve(system, omega)
    nothing = Scaled(Rectangular(1.5), 0.0, np.asarray(0.0))
    term = PeriodicTerm("nothing", mesh.direction, mesh.direction, stiffness=nothing)
    for result in (found, solve(replace(system, terms=(term,)), omega)):
        for k, frequency in enumerate(omega):
            values, period = multipliers(system, frequency)
            # Both exponents of the second rigid body and the position of the first are zero.
            rest = np.sort(np.log(np.abs(values)) / period)[:-3]
            assert result.growth_rate[0, k] == pytest.approx(rest.max(), abs=1e-9)


def test_the_steady_state_repels():
    force = PeriodicForce("push", np.array([1.0, 0.0]), Rectangular(1.5))
    found = steady_state(replace(two_masses(FALLING), forces=(force,)), 2.0)
    assert "unstable" in found.findings
