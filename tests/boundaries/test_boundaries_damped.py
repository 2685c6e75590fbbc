"""Edges of instability regions of damped systems."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from scipy.optimize import brentq
from tongues import disagreements, train

from gearstab.floquet import solve
from gearstab.floquet.boundaries import boundaries
from gearstab.mesh import Mesh
from gearstab.modal import mean_modes
from gearstab.perturbation import first_order
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
