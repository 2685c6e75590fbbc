"""Scenes that break Floquet programs, tagged by what makes them hard. Data only, asserted on in test_hard_cases."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from gearstab.system import GearSystem, Mesh
from gearstab.waveforms import Rectangular


@dataclass(frozen=True)
class HardCase:
    """A system at a few mesh frequencies; ``tags`` say what is hard, ``flags`` which status bits must be reported."""

    name: str
    tags: frozenset[str]
    system: GearSystem
    omega: tuple[float, ...]
    flags: frozenset[str] = frozenset()


def train(epsilon=0.3, contact=(1.5, 1.5), lag=0.0, ratio="1", shaft=0.5, inertias=(1.0, 0.3, 4.0), damping=None):
    g = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 1.0]])
    meshes = (
        Mesh("first", g[0], 1.0, epsilon, Rectangular(contact[0])),
        Mesh("second", g[1], 1.0, epsilon, Rectangular(contact[1]), Fraction(ratio), lag),
    )
    return GearSystem(np.diag(inertias), np.diag([shaft, 0.0, 0.0]), meshes, damping)


def star(epsilon=0.2):
    """A hub and three identical satellites: one pair of degenerate modes."""
    g = np.array([[1.0, -1.0, 0, 0], [1.0, 0, -1.0, 0], [1.0, 0, 0, -1.0]])
    meshes = tuple(Mesh(str(i), g[i], 1.0, epsilon, Rectangular(1.5)) for i in range(3))
    return GearSystem(np.diag([1.7, 0.6, 0.6, 0.6]), np.diag([0.4, 0.2, 0.2, 0.2]), meshes)


def chain(n, meshes, damping=0.0, seed=33):
    """n masses on a line of springs, ``meshes`` of which are teeth of different contact ratios."""
    rng = np.random.default_rng(seed)
    mass = np.diag(rng.uniform(0.5, 2.0, n))
    difference = np.eye(n) - np.eye(n, k=-1)
    spring = difference.T @ np.diag(rng.uniform(0.5, 3.0, n)) @ difference
    places = np.linspace(1, n - 1, meshes).astype(int)
    items = tuple(
        Mesh(f"m{i}", np.eye(n)[p] - np.eye(n)[p - 1], 2.0, 0.3, Rectangular(1.2 + 0.17 * i), Fraction(1), 0.13 * i)
        for i, p in enumerate(places)
    )
    return GearSystem(mass, spring, items, damping * spring if damping else None)


def comb(teeth):
    """Six meshes at frequency ratios 1..6: hundreds of segments for a common period of ``teeth`` cycles."""
    items = tuple(
        Mesh(f"m{i}", np.eye(3)[i % 3], 1.0, 0.15, Rectangular(1.3 + 0.1 * i), Fraction(7 * i + 1, teeth), 0.07 * i)
        for i in range(6)
    )
    spring = 0.3 * np.array([[2.0, -1, 0], [-1, 2, -1], [0, -1, 2]])
    return GearSystem(np.eye(3), spring, items)


def case(name, tags, system, *omega, flags=()):
    return HardCase(name, frozenset(tags.split()), system, omega, frozenset(flags))


HARD_CASES = (
    case("very slow", "slow", train(), 0.01, 0.0037),
    case("very slow, damped", "slow damped", train(damping=np.diag([0.02, 0.01, 0.05])), 0.01),
    case("strong variation", "strong", train(0.9), 0.7, 2.1, 5.0),
    case("strong and slow", "strong slow", train(0.9), 0.01),
    case("almost integer contact ratio", "strong", train(0.4, (1.000001, 1.999999)), 1.3, 4.4),
    case("degenerate pair", "degenerate", star(), 0.9, 1.7, 2.6),
    case("no variation, on a collision", "degenerate", train(0.0), 2 * 1.0034685657919578, 2.7117237630996285),
    case("free-free", "rigid", train(shaft=0.0), 0.5, 2.6),
    case("free-free, damped", "rigid damped", train(shaft=0.0, damping=np.diag([0.02, 0.0, 0.01])), 0.5, 2.6),
    case("stiff shaft", "stiff", train(shaft=1e8), 0.9, 3.3),
    case("spread masses", "stiff", train(inertias=(1e-4, 1.0, 1e4)), 0.9, 3.3),
    case("long period", "long many", train(0.3, (1.4, 1.7), 0.2, "41/37"), 1.1, 3.2),
    case("many segments", "many", comb(5), 0.8, 2.3),
    case("negative stiffness", "strong negative", train(1.3), 0.6, 2.2, flags=["negative_stiffness"]),
    case("beyond 1e300", "strong negative slow", train(2.5), 0.003, flags=["negative_stiffness", "rescaled"]),
    case("33 coordinates", "large", chain(33, 5), 0.8, 2.2),
    case("33 coordinates, damped", "large damped", chain(33, 5, 0.003), 0.8, 2.2),
)
