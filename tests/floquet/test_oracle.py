"""The high-precision reference itself, against what is known otherwise."""

import math
from dataclasses import replace
from fractions import Fraction

import mpmath as mp
import numpy as np
import pytest
from oracle import Plain, PlainMesh, assert_exponents_match, plain, rigid_modes, segments, solve, verdict
from systems import two_stage

from gearstab.systems import build

DIGITS = 40
# The reference promises DIGITS digits; five are left for the closed forms below, which are evaluated at DIGITS + 20.
CLOSE = mp.mpf(10) ** (5 - DIGITS)


def train(*ratio: Fraction, **changes: object) -> Plain:
    """Lin & Parker's three masses and two meshes."""
    meshes = {"epsilon": (0.3, 0.25), "contact_ratio": (1.47, 1.57), "phasing": 0.1}
    return plain(build(two_stage(*ratio, **meshes | changes)))


def single(
    epsilon: float, contact_ratio: float, damping: float = 0.0, mean: float = 1.7, mass: float = 0.8, lag: float = 0.0
) -> Plain:
    mesh = PlainMesh([1.0], mean, epsilon, contact_ratio, lag)
    return Plain([[mass]], [[0.0]], [mesh], [[damping]] if damping else None)


def hill_trace(p: Plain, omega: float) -> mp.mpf:
    """Trace of the monodromy of m x'' + c x' + k(t) x = 0 with two levels: x = exp(-c t/2m) y and Meissner's for y.

    tr = 2 cos a cos b - (w1/w2 + w2/w1) sin a sin b with a = w1 t1, b = w2 t2; imaginary w give cosh and sinh.
    """
    mesh, m = p.meshes[0], mp.mpf(p.mass[0][0])
    c = mp.mpf(p.damping[0][0]) if p.damping else mp.mpf(0)
    d = mp.mpf(mesh.contact_ratio) - math.floor(mesh.contact_ratio)
    k, e, period = mp.mpf(mesh.mean_stiffness), mp.mpf(mesh.epsilon), 2 * mp.pi / mp.mpf(omega)
    levels = k * (1 + 2 * e * (1 - d)), k * (1 - 2 * e * d)
    w1, w2 = (mp.sqrt(mp.mpc(level / m - (c / (2 * m)) ** 2)) for level in levels)
    a, b = w1 * d * period, w2 * (1 - d) * period
    trace = 2 * mp.cos(a) * mp.cos(b) - (w1 / w2 + w2 / w1) * mp.sin(a) * mp.sin(b)
    return mp.re(trace) * mp.exp(-c * period / (2 * m))


@pytest.mark.parametrize("damping", [0.0, 0.3])
@pytest.mark.parametrize(("epsilon", "contact_ratio"), [(0.3, 1.5), (0.4, 1.2), (0.35, 2.85), (1.9, 1.6)])
@pytest.mark.parametrize("omega", [0.07, 1.3, 2.9])
def test_one_coordinate_has_meissners_trace_and_liouvilles_determinant(
    epsilon: float, contact_ratio: float, damping: float, omega: float
) -> None:
    p = single(epsilon, contact_ratio, damping)
    found = solve(p, omega, DIGITS)
    with mp.workdps(found.digits):
        first, second = found.multipliers
        trace, determinant = hill_trace(p, omega), mp.exp(-found.period * mp.mpf(damping) / mp.mpf(p.mass[0][0]))
        assert abs(first + second - trace) <= CLOSE * abs(first)
        assert abs(first * second - determinant) <= CLOSE * determinant
        # The small multiplier on its own: the larger root of the quadratic divides the determinant.
        root = mp.sqrt(mp.mpc(trace**2 / 4 - determinant))
        small = determinant / max(trace / 2 + root, trace / 2 - root, key=abs)
        assert min(abs(second - value) for value in (small, mp.conj(small))) <= CLOSE * abs(second)


def test_multipliers_beyond_the_range_of_doubles() -> None:
    p = single(3.0, 1.4)
    found = solve(p, 0.004, DIGITS)
    with mp.workdps(found.digits):
        trace = hill_trace(p, 0.004)
        assert abs(found.multipliers[0]) > mp.mpf("1e308")
        assert abs(found.multipliers[0] / trace - 1) <= CLOSE
        assert abs(found.multipliers[0] * found.multipliers[1] - 1) <= CLOSE


def test_constant_stiffness_gives_the_natural_frequencies() -> None:
    # Two masses, exact by the quadratic formula.
    p = Plain([[2.0, 0.0], [0.0, 0.5]], [[3.0, -1.0], [-1.0, 1.0]], [PlainMesh([1.0, -1.0], 1.25, 0.0, 1.5)])
    found = solve(p, 1.1, DIGITS)
    with mp.workdps(found.digits):
        k11, k12, k22 = mp.mpf("4.25"), mp.mpf("-2.25"), mp.mpf("2.25")
        half, product = (k11 / 2 + k22 / mp.mpf("0.5")) / 2, (k11 * k22 - k12**2)
        squares = [half + mp.sqrt(half**2 - product), half - mp.sqrt(half**2 - product)]
        for square in squares:
            expected = mp.expj(mp.sqrt(square) * found.period)
            assert min(abs(value - expected) for value in found.multipliers) <= CLOSE
    # Lin & Parker's train with Table 1: the characteristic polynomial of |K - s M| written out, s = w^2.
    flat = {"mean_stiffness": 1.0, "epsilon": 0.0, "contact_ratio": 1.5}
    found = solve(train(meshes=[flat | {"name": "first"}, flat | {"name": "second"}]), 6.0, DIGITS)
    roots = np.roots([1.0, -(1.5 + 2 / 0.3 + 1 / 4), (1.5 * 2 - 1) / 0.3 + 1.5 / 4 + (2 - 1) / 1.2, -(1.5 - 1) / 1.2])
    rates = 1j * np.sqrt(roots.real)
    # np.roots in double precision is good to some 1e-14 here.
    assert_exponents_match(found.all_exponents(), np.array([*rates, *-rates]), float(found.period), rtol=1e-13)


@pytest.mark.parametrize("tooth_ratio", [Fraction(1), Fraction(1, 2), Fraction(2, 3)])
def test_undamped_multipliers_come_in_reciprocal_pairs(tooth_ratio: Fraction) -> None:
    found = solve(train(tooth_ratio), 1.37, DIGITS)
    with mp.workdps(found.digits):
        for value in found.multipliers:
            assert min(abs(value * other - 1) for other in found.multipliers) <= CLOSE
            assert min(abs(mp.conj(value) - other) for other in found.multipliers) <= CLOSE * abs(value)


@pytest.mark.parametrize("damping", [{"damping_ratio": 0.03}, {"damping": {"rayleigh": [0.02, 0.01]}}])
def test_damped_multipliers_multiply_to_liouvilles_determinant(damping: dict[str, object]) -> None:
    p = train(Fraction(2, 3), **damping)
    found = solve(p, 0.31, DIGITS)
    with mp.workdps(found.digits):
        trace = mp.fsum(mp.mpf(p.damping[i][i]) / mp.mpf(p.mass[i][i]) for i in range(3))
        determinant = mp.exp(-found.period * trace)
        assert abs(mp.fprod(found.multipliers) / determinant - 1) <= CLOSE


def test_more_digits_change_nothing_that_was_promised() -> None:
    p = train(Fraction(2, 3), damping_ratio=0.02)
    few, many = solve(p, 0.11, DIGITS), solve(p, 0.11, 2 * DIGITS)
    with mp.workdps(many.digits):
        for value in few.multipliers:
            assert min(abs(value - other) / abs(other) for other in many.multipliers) <= CLOSE


@pytest.mark.parametrize("shift", [Fraction(1, 8), Fraction(5, 16)])
def test_the_origin_of_time_does_not_matter(shift: Fraction) -> None:
    """Every wave later by the same time: its lag grows by r_i times the shift; binary fractions keep the lags exact."""
    p = train(Fraction(1, 2), damping_ratio=0.01)
    p = replace(p, meshes=[replace(mesh, lag=0.25 * i) for i, mesh in enumerate(p.meshes)])
    later = [replace(mesh, lag=float(Fraction(mesh.lag) + shift * mesh.frequency_ratio)) for mesh in p.meshes]
    here, there = solve(p, 1.9, DIGITS), solve(replace(p, meshes=later), 1.9, DIGITS)
    assert_exponents_match(here.all_exponents(), there.all_exponents(), float(here.period), rtol=1e-15, atol=1e-15)


def test_segments_of_unequal_mesh_frequencies() -> None:
    meshes = [
        PlainMesh([1.0], 1.0, 0.25, 2.5),
        PlainMesh([1.0], 2.0, 0.5, 1.25, lag=-0.5, frequency_ratio=Fraction(1, 2)),
        PlainMesh([1.0], 1.0, 0.25, 3.0, frequency_ratio=Fraction(3)),
    ]
    found = segments(Plain([[1.0]], [[0.0]], meshes))
    assert sum(duration for duration, _ in found) == 2
    # From t = 0 the first mesh is stiff (1 + 0.5/2), the second (phase 1/2) soft (2 - 2/4); the third has an integer
    # contact ratio and stays at its mean.
    assert found[0][1] == (Fraction(5, 4), Fraction(3, 2), Fraction(1))
    starts = np.cumsum([0.0] + [float(duration) for duration, _ in found[:-1]])
    # The second mesh is stiff from half of its own period (t = 1) for a quarter of it (half a unit of time).
    stiff = [start for start, (_, levels) in zip(starts, found, strict=True) if levels[1] > 2]
    assert stiff[0] == 1.0
    assert sum(duration for duration, levels in found if levels[1] > 2) == Fraction(1, 2)


def test_rigid_modes_are_eliminated_exactly() -> None:
    p = train(input_shaft_stiffness=0.0)
    column = [row[0] for row in rigid_modes(p)]
    assert [value / column[0] for value in column] == [1, -1, 1]
    found = solve(p, 1.7, DIGITS)
    assert found.rigid == 2
    assert len(found.exponents) == 4
    # The relative motion of the train is a system of two mesh deflections: d = G^T q, d'' = -G^T M^-1 G K d.
    inverse = np.diag(1 / np.diag(np.array(p.mass)))
    directions = np.array([mesh.direction for mesh in p.meshes]).T
    relative = np.linalg.inv(directions.T @ inverse @ directions)
    two = [replace(mesh, direction=np.eye(2)[i].tolist()) for i, mesh in enumerate(p.meshes)]
    same = solve(Plain(relative.tolist(), np.zeros((2, 2)).tolist(), two), 1.7, DIGITS)
    elastic = found.all_exponents()[: len(found.exponents)]
    # The reduced mass matrix is rounded to double precision.
    assert_exponents_match(elastic, same.all_exponents(), float(found.period), rtol=1e-13)


def test_a_rigid_velocity_that_decays_is_kept() -> None:
    """C = a M: the rigid mode has the exponents 0 and -a."""
    p = train(input_shaft_stiffness=0.0, damping={"rayleigh": [0.125, 0.0]})
    found = solve(p, 1.7, DIGITS)
    assert found.rigid == 1
    assert len(found.exponents) == 5
    assert min(abs(complex(value) + 0.125) for value in found.exponents) < 1e-15


TWINS = [[1.0, 0.0], [0.0, 1.0]]


def test_verdict_of_double_multipliers() -> None:
    # Semisimple by symmetry: two identical oscillators side by side, both strongly excited but stable.
    twin = [PlainMesh(row, 1.0, 0.3, 1.5) for row in TWINS]
    assert verdict(Plain(TWINS, np.zeros((2, 2)).tolist(), twin), 3.0)
    # Semisimple at -1: constant stiffness, half of a natural period a cycle.
    assert verdict(single(0.0, 1.5, mean=1.0, mass=1.0), 2.0)
    # Defective at -1: half a natural period at stiffness 1, then free flight; M = -[[1, pi], [0, 1]].
    assert not verdict(single(1.0, 1.5, mean=0.5, mass=1.0), 1.0)
    # The same two flights twice over, and one of them beside a stable oscillator.
    flights = [PlainMesh(row, 0.5, 1.0, 1.5) for row in TWINS]
    assert not verdict(Plain(TWINS, np.zeros((2, 2)).tolist(), flights), 1.0)
    assert not verdict(Plain(TWINS, [[0.0, 0.0], [0.0, 3.0]], flights[:1]), 1.0)
    # Simple multipliers on either side of the defective point: stiff for a little less or more than half of a period.
    beside = single(1.0, 1.5, mean=0.5, mass=1.0)
    assert verdict(beside, 1.001) is not verdict(beside, 0.999)


def test_verdict_of_damped_and_rigid_systems() -> None:
    assert verdict(train(damping_ratio=0.1), 2.0)
    assert not verdict(train(), 2.0)
    assert verdict(train(input_shaft_stiffness=0.0), 1.0)
    # One damped and one undamped oscillator: bounded, though not decaying.
    side = Plain(TWINS, [[1.0, 0.0], [0.0, 0.0]], [PlainMesh([0.0, 1.0], 1.0, 0.25, 1.5)], [[0.0, 0.0], [0.0, 0.5]])
    assert verdict(side, 3.0)


def test_exponents_match_modulo_the_mesh_frequency_only() -> None:
    period = 2.0
    reference = np.array([0.1 + 1.5j, 0.1 - 1.5j, -0.2 + 1j * np.pi / 2])
    shifted = reference[[2, 0, 1]] + 1j * np.pi * np.array([1, -2, 3])
    assert assert_exponents_match(shifted, reference, period) < 1e-14
    with pytest.raises(AssertionError, match="differ"):
        assert_exponents_match(shifted + np.array([0, 0, 3e-12]), reference, period)
    with pytest.raises(AssertionError, match="2 exponents against 3"):
        assert_exponents_match(reference[:2], reference, period)
    with pytest.raises(AssertionError, match="not finite"):
        assert_exponents_match(reference * np.nan, reference, period)


def test_a_row_of_a_batch_is_the_single_system() -> None:
    parameters = {
        "kind": "gear_pair",
        "equivalent_mass": 1.0,
        "damping_ratio": 0.02,
        "meshes": [{"name": "mesh", "mean_stiffness": 1.0, "epsilon": np.array([0.1, 0.3]), "contact_ratio": 1.5}],
    }
    alone = parameters | {"meshes": [parameters["meshes"][0] | {"epsilon": 0.3}]}
    assert plain(build(parameters), 1) == plain(build(alone))
    with pytest.raises(ValueError, match="row None"):
        plain(build(parameters))
