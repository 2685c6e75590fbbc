"""The Floquet core against closed forms, other formulations of the same product, and its own invariants."""

from __future__ import annotations

import json
from fractions import Fraction

import numpy as np
import numpy_kernel
import pytest
from driven import monodromy
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import DATA
from scipy.linalg import expm
from systems import pair, two_stage

from gearstab.floquet import STATUS_FLAGS, solve
from gearstab.floquet.kernel import c_kernel, damped, decision, factors
from gearstab.floquet.kernel.decision import growth_of
from gearstab.floquet.segments.pattern import prepare
from gearstab.mesh import Mesh
from gearstab.modal import mean_modes
from gearstab.system import GearSystem
from gearstab.systems import build
from gearstab.waveforms import Rectangular


def train(ratio=1, epsilon=0.3, contact_ratio=1.5, phasing=0.0, shaft=0.5, **changes):
    return build(two_stage(ratio, epsilon, contact_ratio, phasing, input_shaft_stiffness=shaft, **changes))


def random_system(rng, n, meshes=3, damping=False):
    root = rng.normal(size=(n, n))
    mass = root @ root.T + n * np.eye(n)
    spring = rng.normal(size=(n, n))
    ratios = [Fraction(1), Fraction(1, 2), Fraction(3)][:meshes]
    items = tuple(
        Mesh(
            f"m{i}",
            rng.normal(size=n),
            rng.uniform(1, 3),
            rng.uniform(0.05, 0.4),
            Rectangular(rng.uniform(1, 3)),
            r,
            rng.uniform(),
        )
        for i, r in enumerate(ratios)
    )
    drag = rng.normal(size=(n, n))
    return GearSystem(mass, spring @ spring.T, items, 0.02 * drag @ drag.T if damping else None)


@pytest.mark.parametrize("case", range(10))
def test_edges_of_the_reference(case):
    """Every edge computed independently lies between our verdicts 3e-6 to its left and to its right.

    The reference's edges are where rho - 1 = 1e-6, within 1e-6 of the true ones for tongues of its widths.
    """
    item = json.loads((DATA / "lin_parker_2002_edges.json").read_text())["cases"][case]
    edges = np.array(item["edges"])
    system = train(item["R"], item["epsilon"], item["contact_ratio"], item["phasing"])
    below, above = solve(system, edges - 3e-6).stable, solve(system, edges + 3e-6).stable
    np.testing.assert_array_equal(below[0] ^ above[0], 1)


@pytest.mark.parametrize("omega", [0.05, 0.4, 1.3, 3.1])
def test_meissner(omega):
    """One degree of freedom with two levels: tr M = 2 c1 c2 - (w1/w2 + w2/w1) s1 s2 (Meissner 1918)."""
    result = solve(build(pair()), np.array([omega]), exponents=True)
    w1, w2 = np.sqrt(1.3), np.sqrt(0.7)
    half = np.pi / omega
    trace = 2 * np.cos(w1 * half) * np.cos(w2 * half) - (w1 / w2 + w2 / w1) * np.sin(w1 * half) * np.sin(w2 * half)
    expected = np.arccosh(max(abs(trace) / 2, 1.0)) / (2 * half)
    # Phases of up to w half = 70 rad are right to 1e-14; the period divides.
    np.testing.assert_allclose(result.growth_rate[0, 0], expected, rtol=1e-11, atol=1e-14)
    assert result.stable[0, 0] == (abs(trace) < 2)


@pytest.mark.parametrize("damping", [False, True])
@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_exponents_equal_those_of_matrix_exponentials(n, damping):
    rng = np.random.default_rng(n)
    for _ in range(4):
        system = random_system(rng, n, damping=damping)
        omega = rng.uniform(0.5, 2.0)
        found = solve(system, np.array([omega]), exponents=True)
        period = 2 * np.pi * float(system.common_period()[0]) / omega
        ours = np.exp(found.exponents[0, 0] * period)
        (theirs,) = np.linalg.eigvals(monodromy(system, [omega]))
        distance = np.abs(ours[:, None] - theirs).min(axis=1)
        # expm of norms of some 100 keeps 1e-12; a nearly double multiplier shows its square root.
        assert distance.max() < 1e-6
        assert np.median(distance) < 1e-11 * max(1, np.abs(theirs).max())
        growth = np.log(np.abs(theirs).max()) / period
        np.testing.assert_allclose(found.growth_rate[0, 0], growth, atol=2e-7 / period)


def test_without_variation_the_multipliers_turn_with_the_natural_frequencies():
    system = train(epsilon=0.0)
    omega = np.array([0.3, 2.0])
    found = solve(system, omega, exponents=True)
    w = mean_modes(system).natural_frequency
    for k, frequency in enumerate(omega):
        expected = np.concatenate([w, -w])
        offset = (found.exponents[0, k].imag[:, None] - expected) / frequency
        assert np.abs(offset - np.rint(offset)).min(axis=1).max() < 1e-13
    assert np.all(found.growth_rate == 0)
    assert np.all(found.stable == 1)


@pytest.mark.parametrize("contact", [1.0, 2.0, 3.0])
def test_integer_contact_ratio_gives_no_tongue(contact):
    found = solve(train(contact_ratio=(contact, contact)), np.linspace(0.2, 7, 500))
    assert np.all(found.stable == 1)
    assert np.all(found.growth_rate == 0)


@given(st.floats(0, 1), st.floats(0.5, 6))
@settings(max_examples=30, deadline=None)
def test_time_origin_does_not_matter(lag, omega):
    def shifted(lags):
        g = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 1.0]])
        meshes = tuple(
            Mesh(str(i), g[i], 1.0, 0.3, Rectangular(1.5 + 0.07 * i), Fraction(1 + i), lag)
            for i, lag in enumerate(lags)
        )
        return GearSystem(np.diag([1.0, 0.3, 4.0]), np.diag([0.5, 0, 0]), meshes)

    a = solve(shifted([0.0, 0.2]), np.array([omega]), exponents=True)
    b = solve(shifted([lag, 0.2 + 2 * lag]), np.array([omega]), exponents=True)
    # Near a boundary exponents move like the square root of a rounding error.
    np.testing.assert_allclose(np.sort(a.exponents.real), np.sort(b.exponents.real), atol=1e-7)
    np.testing.assert_allclose(a.growth_rate, b.growth_rate, atol=1e-7)


@pytest.mark.parametrize("kind", ["damping_ratio", "rayleigh", "matrix", "mesh"])
def test_determinant_tells_the_damping(kind):
    """det M = exp(-T tr(M^-1 C)): the exponents add up to -tr(M^-1 C), for short and long periods alike."""
    extra = {
        "damping_ratio": {"damping_ratio": 0.03},
        "rayleigh": {"damping": {"rayleigh": [0.02, 0.01]}},
        "matrix": {"damping": {"matrix": [[0.02, 0.01, 0], [0.01, 0.03, 0], [0, 0, 0.05]]}},
        "mesh": {},
    }[kind]
    system = train("2/3", **extra)
    if kind == "mesh":
        drag = 0.02 * system.meshes[0].outer + 0.05 * system.meshes[1].outer
        system = GearSystem(system.mass, system.stiffness, system.meshes, drag)
    found = solve(system, np.array([0.01, 0.3, 2.0, 6.0]), exponents=True)
    trace = np.trace(np.linalg.solve(system.mass, system.damping))
    np.testing.assert_allclose(found.exponents.sum(axis=-1), -trace, rtol=1e-12)
    np.testing.assert_allclose(found.growth_rate, found.exponents.real.max(axis=-1), atol=1e-13)


def test_mass_proportional_damping_is_a_shift():
    """C = alpha M shifts every exponent by -alpha/2 of the system with K - alpha^2/4 M; general damping must agree."""
    alpha = 0.04
    omega = np.linspace(0.4, 6, 57)
    shifted = solve(train(damping={"rayleigh": [alpha, 0.0]}), omega, exponents=True)
    # A hair of stiffness-proportional damping forces the general path.
    general = solve(train(damping={"rayleigh": [alpha, 1e-11]}), omega, exponents=True)
    np.testing.assert_allclose(shifted.growth_rate, general.growth_rate, atol=1e-9)
    np.testing.assert_array_equal(shifted.stable, general.stable)
    assert shifted.growth_rate.min() == pytest.approx(-alpha / 2, abs=1e-15)


@pytest.mark.parametrize("zeta", [0.999, 1.0, 1.001, 3.0])
def test_critical_and_overdamped_pair(zeta):
    found = solve(build(pair({"epsilon": 0.0}, damping_ratio=zeta)), np.array([0.5, 2.0]), exponents=True)
    roots = np.roots([1, 2 * zeta, 1])
    np.testing.assert_allclose(found.growth_rate[0], roots.real.max(), atol=1e-7)
    np.testing.assert_allclose(found.exponents[0].sum(axis=-1).real, -2 * zeta, rtol=1e-12)


def test_critically_damped_mode_of_a_train():
    """Where a state's generator is defective the exponential takes over; the determinant still tells the damping."""
    system = train(epsilon=0.0, damping={"modal": [1.0, 0.3, 0.1]})
    found = solve(system, np.array([0.7, 3.0]), exponents=True)
    w = mean_modes(system).natural_frequency
    expected = np.sort(
        np.concatenate([np.roots([1, 2 * z * x, x * x]) for z, x in zip([1, 0.3, 0.1], w, strict=True)]).real
    )
    for k in range(2):
        np.testing.assert_allclose(np.sort(found.exponents[0, k].real), expected, atol=1e-7)


def test_rigid_modes_take_no_part():
    omega = np.linspace(0.3, 6, 200)
    found = solve(train(shaft=0.0), omega, exponents=True)
    assert np.all(np.abs(found.exponents).min(axis=-1) == 0)
    # The same elastic system written in its two mesh deflections.
    free = GearSystem(
        np.linalg.inv([[1 + 1 / 0.3, 1 / 0.3], [1 / 0.3, 1 / 0.3 + 0.25]]),
        np.zeros((2, 2)),
        tuple(Mesh(str(i), np.eye(2)[i], 1.0, 0.3, Rectangular(1.5)) for i in range(2)),
    )
    same = solve(free, omega)
    np.testing.assert_array_equal(found.stable, same.stable)
    np.testing.assert_allclose(found.growth_rate, same.growth_rate, atol=1e-8)


def test_a_batch_equals_its_rows():
    shaft = np.array([0.5, 0.0, 1.0, 0.0])
    epsilon = np.array([0.0, 0.2, 0.3, 0.0])
    contact = (np.array([1.5, 1.2, 2.0, 1.7]), 1.5)
    omega = np.linspace(0.5, 6, 40) + 0.1 * np.arange(4)[:, None]
    ratio = np.array([0.0, 0.01, 0.0, 0.02])
    whole = solve(train("1/2", epsilon, contact, 0.3, shaft, damping_ratio=ratio), omega, exponents=True)
    for r in range(4):
        one = solve(
            train("1/2", epsilon[r], (contact[0][r], 1.5), 0.3, shaft[r], damping_ratio=ratio[r]),
            omega[r],
            exponents=True,
        )
        np.testing.assert_array_equal(whole.stable[r], one.stable[0])
        np.testing.assert_allclose(whole.growth_rate[r], one.growth_rate[0], atol=1e-12)


def test_every_row_is_in_exactly_one_pattern():
    system = train("3/5", np.linspace(0, 0.5, 11), (np.linspace(1, 2, 11), 1.5), 0.0, np.tile([0.5, 0.0], 6)[:11])
    patterns = prepare(system)
    np.testing.assert_array_equal(np.sort(np.concatenate([p.rows for p in patterns])), np.arange(11))
    for p in patterns:
        np.testing.assert_allclose(p.fractions.sum(axis=1), 1, rtol=1e-14)


def test_growth_beyond_double_precision():
    """A negative stiffness level over a long period: |lambda| > 1e300, and the quasi-static growth is known.

    Half of the period k = 1 - eps < 0: x grows like exp(sqrt(eps - 1) t); the other half it turns. The growth rate
    tends to sqrt(eps - 1)/2 for long periods, with a relative error of (ln 4)/(growth per period).
    """
    result = solve(build(pair({"epsilon": 2.0})), np.array([0.002]), exponents=True)
    period = 2 * np.pi / 0.002
    assert result.growth_rate[0, 0] * period > np.log(1e300)
    assert result.growth_rate[0, 0] == pytest.approx(0.5, rel=5e-3)
    expected = STATUS_FLAGS["negative_stiffness"] | STATUS_FLAGS["rescaled"]
    assert result.status[0, 0] & expected == expected
    assert result.exponents[0, 0].sum() == pytest.approx(0, abs=1e-14)


def test_symplectic_products():
    rng = np.random.default_rng(7)
    system = random_system(rng, 4)
    (pattern,) = prepare(system)
    m, scale = c_kernel.monodromy(pattern, 0, np.array([0.3, 1.1, 4.0]) / pattern.elastic.rate[0])
    j = decision.symplectic_form(4)
    assert np.abs(np.swapaxes(m, -1, -2) @ j @ m - j).max() < 1e-11 * np.abs(m).max() ** 2
    assert np.all(scale == 0)
    chain = factors.factors(pattern, 0, np.array([1.1]) / pattern.elastic.rate[0])
    total = np.eye(8)
    for factor in chain:
        total = factor[0] @ total
    np.testing.assert_allclose(total, m[1], atol=1e-11 * np.abs(m[1]).max())


@pytest.mark.parametrize("n", [1, 2, 3])
def test_invariants_are_those_of_the_eigenvalues(n):
    rng = np.random.default_rng(n)
    (pattern,) = prepare(random_system(rng, n))
    m, _ = numpy_kernel.propagate(pattern, 0, np.linspace(0.4, 3, 50))
    s = np.atleast_2d(numpy_kernel.coefficients(m))
    values = np.linalg.eigvals(np.moveaxis(m, -1, 0))
    for k in range(50):
        rho = values[k] + 1 / values[k]
        doubled = np.poly(np.concatenate(list([numpy_kernel.roots(s[:, k : k + 1])[:, 0]] * 2)))
        np.testing.assert_allclose(doubled, np.poly(rho), rtol=1e-9, atol=1e-9 * np.abs(doubled).max())


@pytest.mark.parametrize(
    "case", [[1.0, -1.5, 0.3], [1.0, 1.0 + 1e-4, -0.5], [0.5 + 1.2j, 0.5 - 1.2j, 1.9], [0.0, 0.0, 0.0]]
)
def test_roots_of_cubics(case):
    p = np.poly(case).real
    found = numpy_kernel.roots(np.array([[-p[1]], [p[2]], [-p[3]]]))[:, 0]
    for root in case:
        # Roots 1e-4 apart lose four digits of the coefficients between them.
        assert np.abs(found - root).min() < 1e-11


def test_growth_of_a_large_root():
    """Only the largest root tells the growth; the small ones may drown in its rounding error."""
    p = np.poly([1e8, 1.0, -0.5])
    found = growth_of(numpy_kernel.roots(np.array([[-p[1]], [p[2]], [-p[3]]])))
    assert found[0] == pytest.approx(np.arccosh(0.5e8), rel=1e-14)


def test_krein_rule_on_matrices_made_for_it():
    def turn(*angles):
        c, s = np.diag(np.cos(angles)), np.diag(np.sin(angles))
        return np.block([[c, s], [-s, c]])

    stable, growth, _ = decision.conservative(
        np.stack([turn(0.3, 1.2), turn(0.7, 0.7), turn(0.7, -0.7), turn(np.pi, 0.1)])
    )
    assert stable.all()
    assert np.all(growth == 0)
    # A double multiplier of definite kind, perturbed symplectically, cannot leave the circle; of mixed kind it can.
    rng = np.random.default_rng(3)
    h = rng.normal(size=(4, 4))
    kick = expm(1e-9 * decision.symplectic_form(2) @ (h + h.T))
    stable, _, _ = decision.conservative(np.stack([turn(0.7, 0.7) @ kick]))
    assert stable.all()
    mixed = turn(0.7, -0.7) @ expm(
        1e-7 * decision.symplectic_form(2) @ np.array([[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, 0, -1], [0, 0, -1, 0]])
    )
    stable, growth, _ = decision.conservative(mixed[None])
    assert not stable[0]
    assert growth[0] == pytest.approx(1e-7, rel=1e-3)
    jordan = np.block([[np.eye(2), np.diag([1e-3, 0.2])], [np.zeros((2, 2)), np.eye(2)]])
    assert decision.conservative(jordan[None])[1][0] < 1e-7


def test_graded_products_keep_the_smallest_multiplier():
    """A product of 60 known upper triangular matrices, multipliers from e^120 to e^-120."""
    rng = np.random.default_rng(11)
    size, rounds = 5, 60
    logs = np.array([2.0, 0.5, 0.45, -0.3, -2.0])
    q = [np.linalg.qr(rng.normal(size=(size, size)))[0] for _ in range(rounds)]
    chain = []
    for k in range(rounds):
        triangle = np.triu(0.3 * rng.normal(size=(size, size)), 1) + np.diag(np.exp(logs))
        chain.append((q[(k + 1) % rounds] @ triangle @ q[k].T)[None])
    found = np.sort(c_kernel.graded(chain)[0].real)[::-1]
    np.testing.assert_allclose(found, logs * rounds, atol=1e-12 * rounds)


def test_general_damping_by_two_ways():
    """Diagonalised generators against scaling and squaring."""
    system = random_system(np.random.default_rng(5), 3, damping=True)
    (pattern,) = prepare(system)
    generator = damped.generators(pattern)
    omega = np.array([0.3, 1.0, 2.5])
    (m,), (scale,) = numpy_kernel.products_damped(pattern, generator, omega[None])
    for k in range(3):
        total = np.eye(6)
        for s, state in enumerate(pattern.states):
            total = expm(generator.matrix[0, state] * pattern.durations(0, omega)[s, k]) @ total
        np.testing.assert_allclose(m[k] * np.exp(scale[k]), total, atol=1e-11)
