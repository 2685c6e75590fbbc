"""Gears of cyclic symmetry made by hand: a sun, N planets on springs, a ring that may be elastic; planar."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from gearstab.system import GearSystem, Mesh
from gearstab.waveforms import Rectangular

ALPHA = np.deg2rad(24.0)


def cyclic(planets, phases=None, epsilon=0.3, harmonics=1, damping=0.0):
    """N planets with meshes on the sun and the ring; ``phases`` of the suns', the ring's lag half a period behind.

    damping: C over K of the mean system. Coordinates: (x, y, u) of sun, ring and planets, then the ring's waves.
    """
    lag = np.zeros(planets) if phases is None else np.asarray(phases)
    sun, ring = 0, 3
    wave = 6 + 3 * planets
    waves = range(2, harmonics + 1)
    inertia = [0.4, 0.4, 0.2, 1.0, 1.0, 0.8] + [0.6, 0.6, 0.35] * planets
    inertia += [(1 + m * m) / 2 for m in waves for _ in "cs"]
    spring = [0.1, 0.1, 0.0, 0.5, 0.5, 0.3] + [1.5, 1.5, 0.0] * planets
    spring += [0.5 * np.pi * (m * (m * m - 1)) ** 2 for m in waves for _ in "cs"]
    meshes = []
    for i in range(planets):
        psi, own = 2 * np.pi * i / planets, 6 + 3 * i
        for name, body, sign, stiffness, contact in (("s", sun, 1, 1.0, 1.4), ("r", ring, -1, 1.2, 1.6)):
            direction = np.zeros(len(inertia))
            tilt = np.pi / 2 - sign * ALPHA
            direction[body : body + 3] = np.cos(psi + tilt), np.sin(psi + tilt), 1.0
            direction[own : own + 3] = -np.cos(tilt), -np.sin(tilt), sign
            for m in waves if name == "r" else ():
                c, s = np.cos(m * psi), np.sin(m * psi)
                place = wave + 2 * (m - 2)
                direction[place] = c * np.cos(ALPHA) + m * s * np.sin(ALPHA)
                direction[place + 1] = s * np.cos(ALPHA) - m * c * np.sin(ALPHA)
            start = lag[i] + (0.5 if name == "r" else 0.0)
            meshes.append(Mesh(f"{name}{i}", direction, stiffness, epsilon, Rectangular(contact), Fraction(1), start))
    system = GearSystem(np.diag(inertia), np.diag(spring), tuple(meshes))
    if not damping:
        return system
    return GearSystem(system.mass, system.stiffness, system.meshes, damping * system.mean_stiffness_matrix())
