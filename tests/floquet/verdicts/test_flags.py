"""No wrong flag: more than 100,000 points, generic and degenerate, whose doubtful ones are settled in high precision.

The judge is the product of matrix exponentials in physical coordinates and its eigenvalues. Where these leave the unit
circle by more than 1e-4 or by less than 1e-11 there is no doubt; in between the oracle decides with 100 digits.
"""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import oracle
import pytest
from driven import monodromy
from systems import star, train

from gearstab.floquet import solve
from gearstab.mesh import Mesh
from gearstab.modal import mean_modes
from gearstab.system import GearSystem
from gearstab.waveforms import Rectangular

CLEARLY_OFF, CLEARLY_ON = 1e-4, 1e-11


def twins(epsilon, contact, coupling=0.0):
    """Two identical pairs, apart or joined by a spring: two equal modes, or a symmetric and an antisymmetric one."""
    g = np.eye(2)
    spring = coupling * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return GearSystem(
        np.eye(2), spring, tuple(Mesh(str(i), g[i], 1.0, epsilon, Rectangular(contact)) for i in range(2))
    )


def judge(system, omega):
    """The true flags, and how many of them the oracle had to settle."""
    excess = np.abs(np.linalg.eigvals(monodromy(system, omega))).max(axis=1) - 1
    truth = excess < CLEARLY_ON
    doubtful = np.flatnonzero((excess >= CLEARLY_ON) & (excess <= CLEARLY_OFF))
    for k in doubtful:
        truth[k] = oracle.verdict(oracle.plain(system), float(omega[k]))
    return truth, len(doubtful)


def collisions(system, harmonics=4):
    """The mesh frequencies at which two multipliers of the system without variation meet: (w_p + w_q)/s."""
    w = mean_modes(system).natural_frequency
    sums = (w[:, None] + w[None, :])[np.triu_indices(len(w))]
    return np.sort((sums[:, None] / np.arange(1, harmonics + 1)).ravel())


def generic(rng, rows, points):
    for _ in range(rows):
        ratio = [Fraction(1), Fraction(1, 2), Fraction(2, 3)][rng.integers(3)]
        system = train(
            rng.uniform(0.05, 0.45),
            tuple(rng.uniform(1, 2, 2)),
            rng.uniform(),
            ratio,
            inertias=rng.uniform(0.3, 4, 3),
            shaft=rng.uniform(0.1, 2),
        )
        yield system, rng.uniform(0.3, 7, points)


def near_edges(rng, rows):
    """Points at distances of 1e-3 to 1e-9 from the edges of real tongues: where a rounding error could flip a flag."""
    for _ in range(rows):
        system = train(rng.uniform(0.1, 0.4), tuple(rng.uniform(1.1, 1.9, 2)), rng.uniform())
        grid = np.linspace(0.8, 6, 300)
        stable = np.abs(np.linalg.eigvals(monodromy(system, grid))).max(axis=1) - 1 < 1e-6
        k = rng.choice(np.flatnonzero(stable[:-1] != stable[1:]))
        low, high = grid[k], grid[k + 1]
        for _ in range(34):
            middle = 0.5 * (low + high)
            same = (np.abs(np.linalg.eigvals(monodromy(system, np.array([middle])))).max() - 1 < 1e-6) == stable[k]
            low, high = (middle, high) if same else (low, middle)
        offsets = np.array([1e-3, 1e-5, 1e-7, 1e-9])
        yield system, low * (1 + np.concatenate([offsets, -offsets]))


def degenerate(rng, points):
    """Identical twins, stars, no variation on collisions: where sign tests alone fail on every second point."""
    for epsilon in (0.0, 0.1, 0.3, 0.49):
        for contact in (1.5, 1.3):
            yield twins(epsilon, contact), np.concatenate([rng.uniform(0.3, 4, points), 2 / np.arange(1.0, 6)])
            yield twins(epsilon, contact, 1e-9), rng.uniform(0.3, 4, points)
            yield star(epsilon, contact, (0, 0, 0)), rng.uniform(0.4, 5, points)
            yield star(epsilon, contact, (0, 1 / 3, 2 / 3)), rng.uniform(0.4, 5, points)
    for _ in range(20):
        system = train(0.0, (1.5, 1.5), inertias=rng.uniform(0.3, 4, 3), shaft=rng.uniform(0.1, 2))
        yield system, collisions(system)
        yield (
            replace(system, meshes=tuple(replace(m, epsilon=1e-9) for m in system.meshes)),
            rng.uniform(0.5, 6, points),
        )


def count_wrong(cases):
    points = wrong = settled = 0
    failures = []
    for system, omega in cases:
        truth, doubtful = judge(system, omega)
        ours = solve(system, omega).stable[0] == 1
        points, settled = points + len(omega), settled + doubtful
        wrong += int(np.sum(ours != truth))
        failures += [(system, w) for w in omega[ours != truth]]
    return points, settled, wrong, failures


def test_a_sample_of_flags():
    rng = np.random.default_rng(1)
    cases = [*generic(rng, 6, 200), *near_edges(rng, 4), *degenerate(rng, 20)]
    points, settled, wrong, failures = count_wrong(cases)
    assert points > 2000
    assert settled > 3
    assert wrong == 0, failures[:3]


@pytest.mark.slow
def test_a_hundred_thousand_flags():
    rng = np.random.default_rng(2)
    cases = [*generic(rng, 160, 500), *near_edges(rng, 60), *degenerate(rng, 450)]
    points, settled, wrong, failures = count_wrong(cases)
    assert points >= 100_000
    assert settled > 50
    assert wrong == 0, failures[:3]
