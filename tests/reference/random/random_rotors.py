"""Random systems with gyroscopic, centripetal and circulatory matrices, one or two meshes, lags and ratios."""

from fractions import Fraction

import numpy as np

from gearstab.mesh import Mesh, Rotation
from gearstab.system import GearSystem
from gearstab.waveforms import Rectangular

Array = np.ndarray


def _definite(rng: np.random.Generator, n: int, low: float, high: float) -> Array:
    turn, _ = np.linalg.qr(rng.normal(size=(n, n)))
    return turn @ np.diag(rng.uniform(low, high, n)) @ turn.T


def random_rotor(seed: int, hamiltonian: bool) -> GearSystem:
    """Two to four coordinates; the speed follows the mesh or is held, and may be above critical ones.

    hamiltonian: without damping and circulatory matrices; else with both, and unsymmetric damping.
    """
    rng = np.random.default_rng(seed)
    n, count = int(rng.integers(2, 5)), int(rng.integers(1, 3))
    ratios = [Fraction(1), Fraction(int(rng.integers(1, 5)), int(rng.integers(1, 4)))]
    meshes = tuple(
        Mesh(
            f"mesh {i}",
            rng.normal(size=n),
            rng.uniform(0.3, 1.5),
            rng.uniform(0.05, 0.45),
            Rectangular(rng.uniform(1.1, 1.9)),
            ratios[i],
            rng.uniform(),
        )
        for i in range(count)
    )
    gyroscopic = rng.uniform(0.1, 1.0) * rng.normal(size=(n, n))
    sign = -1 if rng.random() < 0.6 else 1
    centripetal = sign * _definite(rng, n, 0.1, 0.8) if rng.random() < 0.7 else None
    circulatory = None if hamiltonian else rng.uniform(0, 0.03) * rng.normal(size=(n, n))
    ratio = None if rng.random() < 0.3 else Fraction(int(rng.choice([-1, 1]) * rng.integers(1, 7)), 15)
    speed = rng.uniform(0.1, 1.5) if ratio is None else 0.0
    rotation = Rotation(ratio, speed, gyroscopic - gyroscopic.T, circulatory, centripetal)
    mass, stiffness = _definite(rng, n, 0.5, 2.0), _definite(rng, n, 0.5, 4.0)
    damping = None
    if not hamiltonian:
        damping = _definite(rng, n, 0.005, 0.06) + rng.uniform(0, 0.01) * rng.normal(size=(n, n))
    return GearSystem(mass, stiffness, meshes, damping, rotations=(rotation,))
