"""Random trains and an independent raster of growth rates with damping, refined until nothing new appears."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
from tongues import inside, near_edge

from gearstab.floquet import solve
from gearstab.floquet.boundaries import Boundaries
from gearstab.modal import mean_modes
from gearstab.system import GearSystem
from gearstab.systems import build

GOLDEN = (np.sqrt(5) - 1) / 2
ROUNDS = 40
COLLISIONS = 60
"""Of multipliers of mean modes in the range of an undamped train, about; long periods have thousands."""


def random_train(seed: int, proportional: bool | None = None) -> tuple[GearSystem, float, float]:
    """A train of one to six coordinates and one to three meshes, with the range of mesh frequencies to look at.

    Ratios of the mesh frequencies have denominators to 7, damping ratios are 0.002 to 0.05. proportional: modal
    damping, or a random positive definite matrix; None for one or the other.
    """
    rng = np.random.default_rng([4711, seed])
    n, count = int(rng.integers(1, 7)), int(rng.integers(1, 4))
    epsilon = rng.uniform(0.05, 0.6)
    ratios = [Fraction(1)] + [Fraction(int(rng.integers(1, 8)), int(rng.integers(1, 8))) for _ in range(count - 1)]
    meshes = [
        {"name": f"m{k}", "direction": rng.normal(size=n), "mean_stiffness": rng.uniform(0.5, 2), "lag": rng.random(),
         "epsilon": epsilon * rng.uniform(0.3, 1), "contact_ratio": rng.uniform(1.1, 1.9), "frequency_ratio": ratio}
        for k, ratio in enumerate(ratios)
    ]  # fmt: skip
    spring = rng.normal(size=(n, n))
    parts = {"kind": "matrices", "mass": np.diag(rng.uniform(0.5, 2, n)), "meshes": meshes}
    parts["stiffness"] = spring @ spring.T / n + 0.3 * np.eye(n)
    zeta = float(np.exp(rng.uniform(np.log(0.002), np.log(0.05))))
    if rng.random() < 0.5 if proportional is None else proportional:
        parts["damping"] = {"modal": zeta * rng.uniform(0.5, 2, n)}
    else:
        root = rng.normal(size=(n, n))
        parts["damping"] = {"matrix": zeta * (root @ root.T + 0.5 * np.eye(n))}
    system = build(parts)
    w = mean_modes(system).natural_frequency
    return system, 0.35 * float(w.min()), 2.2 * float(w.max())


def conservative_train(seed: int) -> tuple[GearSystem, float, float]:
    """One of these trains without its damping, and a range with not too many collisions of multipliers."""
    system, start, stop = random_train(seed)
    system = replace(system, damping=None)
    w = mean_modes(system).natural_frequency
    stop *= float(np.random.default_rng([4712, seed]).uniform(0.2, 1))
    rate = float(system.common_period()[0]) * float(w.sum()) * (system.size + 1)
    return system, max(min(start, 0.7 * stop), 1 / (1 / stop + COLLISIONS / rate)), stop


def raster(system: GearSystem, start: float, stop: float, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Mesh frequencies and growth rates, uniform in ln Omega, with all local extrema that may change sign pursued by
    golden section.
    """
    omega = np.geomspace(start, stop, points)
    growth = solve(system, omega).growth_rate[0]
    sign = np.where(growth[1:-1] <= 0, 1.0, -1.0)
    f, left, right = sign * growth[1:-1], sign * growth[:-2], sign * growth[2:]
    k = np.flatnonzero((f >= left) & (f >= right)) + 1
    sign, a, b = sign[k - 1], omega[k - 1], omega[k + 1]
    found = [omega]
    for _ in range(ROUNDS):
        x, y = b - GOLDEN * (b - a), a + GOLDEN * (b - a)
        if len(x) == 0:
            break
        fx, fy = sign * solve(system, np.concatenate([x, y])).growth_rate[0].reshape(2, -1)
        found += [x, y]
        a, b = np.where(fx > fy, a, x), np.where(fx > fy, y, b)
        # An extremum that has changed its sign is one no more.
        left = (np.maximum(fx, fy) <= 0) & (b - a > 1e-9 * b)
        a, b, sign = a[left], b[left], sign[left]
    every = np.unique(np.concatenate(found))
    return every, solve(system, every).growth_rate[0]


def missed(system: GearSystem, found: Boundaries, start: float, stop: float, points: int) -> list[float]:
    """Mesh frequencies of a raster, refined until nothing new appears, that contradict the regions: none is right.

    What is narrower than the width floor may be left out.
    """
    runs = -1
    while True:
        omega, growth = raster(system, start, stop, points)
        unstable = growth > 0
        wrong = (inside(found, 0, omega) != unstable) & ~near_edge(found, 0, omega, 1e-9)
        changes = int((np.diff(unstable.astype(int)) != 0).sum())
        if changes == runs or wrong.any():
            break
        runs, points = changes, 2 * points
    return [float(x) for x in omega[wrong] if _wide(system, float(x), found.width_floor)]


def _wide(system: GearSystem, omega: float, floor: float) -> bool:
    """Whether what contradicts at a point is as wide as the floor."""
    around = solve(system, omega * np.array([1 - floor, 1.0, 1 + floor])).growth_rate[0] > 0
    return bool(around[0] == around[1] or around[2] == around[1])
