"""Random systems that between them take every branch of a kernel."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from gearstab.floquet.kernel import damped
from gearstab.floquet.segments.pattern import Pattern, prepare
from gearstab.system import GearSystem, Mesh
from gearstab.waveforms import Rectangular

KINDS = ("generic", "negative stiffness", "free state", "rigid", "no excitation", "one mesh", "ratios")
BATCH = 3


def system(n: int, kind: str, seed: int, damping: float = 0.0, epsilon: float = 0.4) -> GearSystem:
    """A system of n coordinates with a batch of BATCH rows of different excitation."""
    rng = np.random.default_rng([n, KINDS.index(kind), seed])
    size = n + (kind == "rigid")
    mass = np.diag(rng.uniform(0.4, 2.5, size))
    factor = rng.standard_normal((size, size))
    stiffness = factor @ factor.T + 0.2 * np.eye(size)
    directions = [rng.standard_normal(size) for _ in range(1 if kind == "one mesh" else 2)]
    if kind == "rigid":
        free = np.ones(size) / np.sqrt(size)
        keep = np.eye(size) - np.outer(free, free)
        stiffness = keep @ stiffness @ keep
        directions = [keep @ g for g in directions]
    if kind == "free state":
        # The softer level of the only spring along the first coordinate is exactly zero: c = 1.5, epsilon = 1.
        stiffness[0] = stiffness[:, 0] = 0.0
        directions = [np.eye(size)[0], *directions[1:]]
    factors = np.linspace(0.8, 1.0, BATCH)
    strength = {"negative stiffness": 3.5, "no excitation": 0.0}.get(kind, epsilon)
    meshes = []
    for i, g in enumerate(directions):
        first_free = kind == "free state" and i == 0
        ratio = Fraction(3, 2) if kind == "ratios" and i else Fraction(1)
        contact = 1.5 if first_free else rng.uniform(1.2, 2.8)
        level = np.ones(BATCH) if first_free else strength * factors
        meshes.append(Mesh(f"m{i}", g, np.array(1.3), level, Rectangular(contact), ratio, rng.uniform()))
    c = None
    if damping:
        b = rng.standard_normal((size, size))
        c = damping * (b @ b.T)
        if kind == "rigid":
            c = keep @ c @ keep
    return GearSystem(mass, stiffness, tuple(meshes), c)


def patterns(item: GearSystem, points: int, low: float = 0.15, high: float = 9.0) -> list[tuple[Pattern, np.ndarray]]:
    """Patterns and mesh frequencies ``(r, points)`` in their units."""
    omega = np.geomspace(low, high, points)
    return [(p, omega / p.elastic.rate[:, None]) for p in prepare(item)]


def damped_patterns(
    item: GearSystem, points: int, low: float = 0.15
) -> list[tuple[Pattern, damped.Generators, np.ndarray]]:
    """The same with the generators of general damping."""
    found = [(p, p.elastic.damping, omega) for p, omega in patterns(item, points, low)]
    return [(p, damped.generators(p, c), omega) for p, c, omega in found if c is not None]


def chain(n: int, meshes: int) -> GearSystem:
    """n masses on a line of springs, ``meshes`` of which are teeth of different contact ratios."""
    rng = np.random.default_rng(n)
    difference = np.eye(n) - np.eye(n, k=-1)
    spring = difference.T @ np.diag(rng.uniform(0.5, 3.0, n)) @ difference
    places = np.linspace(1, n - 1, meshes).astype(int)
    items = tuple(
        Mesh(f"m{i}", np.eye(n)[p] - np.eye(n)[p - 1], 2.0, 0.3, Rectangular(1.2 + 0.17 * i), Fraction(1), 0.13 * i)
        for i, p in enumerate(places)
    )
    return GearSystem(np.diag(rng.uniform(0.5, 2.0, n)), spring, items)
