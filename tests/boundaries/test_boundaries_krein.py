"""The counts that no tongue can hide from, against constructions that know nothing of them."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from krein_search import counts, morse
from tongues import train

from gearstab.floquet.boundaries.counting.krein import spectrum
from gearstab.floquet.boundaries.counting.pairs import KreinSpectrum
from gearstab.floquet.kernel import c_kernel
from gearstab.floquet.segments.pattern import Pattern, prepare
from gearstab.systems import build


def two_masses(epsilon: object) -> Pattern:
    """Two coordinates, two meshes with four jumps a period; negative stiffness for epsilon = 2."""
    meshes = [
        {
            "name": "a",
            "direction": [1.0, 0.4],
            "mean_stiffness": 1.0,
            "epsilon": epsilon,
            "contact_ratio": 1.37,
            "lag": 0.1,
        },
        {
            "name": "b",
            "direction": [-0.3, 1.0],
            "mean_stiffness": 0.7,
            "epsilon": epsilon,
            "contact_ratio": 1.6,
            "lag": 0.4,
        },
    ]
    for mesh in meshes:
        mesh["frequency_ratio"] = Fraction(1)
    system = build({"kind": "matrices", "mass": np.eye(2), "stiffness": np.diag([0.2, 0.4]), "meshes": meshes})
    (pattern,) = prepare(system)
    return pattern


def galerkin_index(pattern: Pattern, cycle: float, theta: float, order: int = 160) -> tuple[int, float]:
    """Negative eigenvalues of int |u'|^2 - u^H K u over functions with u(T) = exp(i theta) u(0), in a Fourier basis;
    and how far the eigenvalue nearest to zero is from it."""
    period = 2 * np.pi * pattern.cycles * cycle
    k = np.arange(-order, order + 1)
    edges = np.concatenate([[0.0], np.cumsum(pattern.fractions[0])])
    coefficients = np.zeros((2 * len(k) - 1, 2, 2), dtype=complex)
    lags = np.arange(-2 * order, 2 * order + 1)
    for s, state in enumerate(pattern.states):
        with np.errstate(divide="ignore", invalid="ignore"):
            wave = (np.exp(-2j * np.pi * lags * edges[s]) - np.exp(-2j * np.pi * lags * edges[s + 1])) / (
                2j * np.pi * lags
            )
        wave[2 * order] = edges[s + 1] - edges[s]
        coefficients += wave[:, None, None] * pattern.stiffness[0, state]
    form = -coefficients[k[:, None] - k[None, :] + 2 * order].transpose(0, 2, 1, 3).reshape(2 * len(k), 2 * len(k))
    form += np.diag(np.repeat(((theta + 2 * np.pi * k) / period) ** 2, 2))
    values = np.linalg.eigvalsh(form)
    return int((values < 0).sum()), float(np.abs(values).min())


@pytest.mark.parametrize("epsilon", [0.3, 2.0])
def test_morse_index_is_that_of_a_fourier_galerkin_form(epsilon: float) -> None:
    pattern = two_masses(epsilon)
    cycles = np.array([0.13, 0.6, 1.7, 3.1])
    _, periodic, antiperiodic, _ = morse(pattern, np.zeros(4, dtype=int), cycles)
    for k, cycle in enumerate(cycles):
        for theta, ours in ((np.pi, antiperiodic[k]), (0.0, periodic[k])):
            count, margin = galerkin_index(pattern, cycle, theta)
            # The truncated form converges like 1/order: a sign is settled only for eigenvalues clearly off zero.
            assert margin > 1e-3
            assert ours == count


def test_count_of_constant_stiffness_is_known() -> None:
    """Without variation Theta_i = w_i T: C = sum floor((w_i + w_j) T/2 pi), whatever the winding."""
    (pattern,) = prepare(train(epsilon=(0.0, 0.0)))
    cycle = np.random.default_rng(2).uniform(0.05, 60.0, 300)
    found = counts(pattern, np.zeros(300, dtype=int), cycle)
    w = np.sqrt(pattern.squared_frequency[0, 0])
    count = np.floor((w[:, None] + w)[None] * cycle[:, None, None]).sum(axis=(1, 2))
    assert found.stable.all()
    assert found.known.all()
    assert np.array_equal(found.begun, count)
    assert np.array_equal(found.ended, count)


def test_count_is_continuous_in_epsilon_at_stable_points() -> None:
    """On a path of stable points from epsilon = 0 to 0.9, at a fixed mesh frequency, C never changes; the phases
    themselves wind many times around the circle, so that a wrong guess of a turn would show."""
    epsilon = np.linspace(0.0, 0.9, 181)
    system = train(epsilon=(epsilon, epsilon))
    patterns = prepare(system)
    for omega in (0.31, 0.523, 0.71, 1.12, 1.6, 2.3, 3.17, 6.9):
        count, stable = np.zeros(181), np.zeros(181, dtype=bool)
        for pattern in patterns:
            found = counts(pattern, np.arange(len(pattern.rows)), pattern.elastic.rate / omega)
            count[pattern.rows], stable[pattern.rows] = found.begun, found.stable
            assert found.known.all()
        run = np.flatnonzero(~stable)[0] if not stable.all() else 181
        assert run > 5
        assert (count[:run] == count[0]).all()


def test_unstable_points_hold_as_many_open_collisions_as_multipliers_outside() -> None:
    (pattern,) = prepare(train(epsilon=(0.5, 0.5)))
    cycle = np.linspace(0.2, 3.0, 500)
    found = counts(pattern, np.zeros(500, dtype=int), cycle)
    values = np.linalg.eigvals(morse(pattern, np.zeros(500, dtype=int), cycle)[0])
    outside = (np.abs(values) > 1 + 1e-6).sum(axis=1)
    assert np.array_equal(found.begun - found.ended, outside)
    assert np.array_equal(found.stable, outside == 0)


def test_growth_follows_from_the_phases_at_two_stable_points() -> None:
    """w (S'_1 + S'_2)/2 - (S_2 - S_1) = 1/pi int w^3 L(x)/(2 (x - T_1)^2 (x - T_2)^2) dx, from negative x on."""
    (pattern,) = prepare(train(epsilon=(0.3, 0.3)))

    def multipliers(cycle: np.ndarray) -> KreinSpectrum:
        matrix, scale = c_kernel.monodromy(pattern, np.zeros(len(cycle), dtype=int), 1 / cycle)
        assert not scale.any()
        return spectrum(matrix)

    def phases(cycle: np.ndarray) -> np.ndarray:
        found = multipliers(cycle)
        assert not found.off.any()
        return np.asarray(np.where(found.sign > 0, np.angle(found.values), 0.0).sum(axis=1))

    def turn(angle: np.ndarray) -> np.ndarray:
        return np.asarray((angle + np.pi) % (2 * np.pi) - np.pi)

    step = 1e-4
    x = np.arange(0.5 * step, 12.0, step)
    found = multipliers(x)
    growth = np.where(found.off, np.maximum(np.log(np.abs(found.values)), 0.0), 0.0).sum(axis=1)
    for begin, width in ((0.545, 0.095), (1.125, 0.098), (1.581, 0.058), (1.707, 0.047)):
        ends = np.array([begin, begin + width])
        speed = turn(phases(ends + 1e-5) - phases(ends - 1e-5)) / 2e-5
        defect = turn(width * speed.mean() - np.diff(phases(ends)))[0]
        kernel = sum(0.5 * width**3 / ((side * x - ends[0]) * (side * x - ends[1])) ** 2 for side in (1, -1))
        open_only = growth > 0
        # Where a region begins right beside a point the sum is wrong by half a step over its distance.
        expected = step / np.pi * (growth[open_only] * np.asarray(kernel)[open_only]).sum()
        assert defect > 0.01
        assert defect == pytest.approx(expected, rel=0.01)
