"""Systems of the benchmarks."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from gearstab.config import load
from gearstab.mesh import Mesh
from gearstab.sweep import plan
from gearstab.system import Array, GearSystem
from gearstab.systems import build
from gearstab.waveforms import Rectangular

CONFIGS = Path(__file__).parents[2] / "configs"


def train(
    ratio: str, epsilon: Array, contact: tuple[float, float] = (1.5, 1.5), phasing: float = 0.0, **more: Any
) -> GearSystem:
    """Build Lin & Parker's two-stage train over epsilon; ratio: of the teeth, more: keys of the section, as damping."""
    meshes = [
        {"name": name, "mean_stiffness": 1.0, "epsilon": epsilon, "contact_ratio": c}
        for name, c in zip(("first", "second"), contact, strict=True)
    ]
    meshes[1]["phasing"] = phasing
    section = {"kind": "two_stage", "inertias": [1.0, 0.3, 4.0], "input_shaft_stiffness": 0.5, "meshes": meshes}
    return build({**section, "tooth_ratio": Fraction(ratio), **more})


def configured(name: str) -> tuple[GearSystem, float, float]:
    """Return the system of a configuration, without its axes, and its range of mesh frequencies."""
    planned = plan(load(CONFIGS / name))
    return planned.base, *planned.mesh_frequency_range


def gearbox() -> GearSystem:
    """Build a chain of 33 coordinates with five meshes: ten segments per period."""
    n, rng = 33, np.random.default_rng(33)
    steps = np.eye(n) - np.eye(n, k=-1)
    spring = steps.T @ np.diag(rng.uniform(0.5, 3.0, n)) @ steps
    places = np.linspace(1, n - 1, 5).astype(int)
    meshes = tuple(
        Mesh(f"m{i}", steps[p], np.array(2.0), np.array(0.3), Rectangular(1.2 + 0.17 * i), lag=0.13 * i)
        for i, p in enumerate(places)
    )  # fmt: skip
    return GearSystem(np.diag(rng.uniform(0.5, 2.0, n)), spring, meshes)


def chain(size: int, ratio: Fraction = Fraction(1), meshes: int = 2, damping: float = 0.0) -> GearSystem:
    """Build a chain of masses and springs that no symmetry divides, with meshes between masses or to the ground.

    damping: relative to the stiffness.
    """
    mass = 1 + 0.3 * np.sin(np.arange(size))
    springs = 1 + 0.2 * np.cos(np.arange(size + 1))
    stiffness = np.diag(springs[:-1] + springs[1:]) - np.diag(springs[1:-1], 1) - np.diag(springs[1:-1], -1)
    found = []
    for k in range(meshes):
        place = k * size // meshes
        direction = np.zeros(size)
        direction[place : place + 2] = 1.0
        wave = Rectangular(1.4 + 0.37 * k / meshes)
        own = ratio if k else Fraction(1)
        found.append(Mesh(f"mesh{k}", direction, np.array(0.8), np.array(0.1), wave, own, 0.1 * k))
    return GearSystem(np.diag(mass), stiffness, tuple(found), damping=damping * stiffness if damping else None)
