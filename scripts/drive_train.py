"""Make configs/drive_train.npz: 33 rotors in a row, joined by shafts but for five pairs, between which gears mesh.

The numbers vary smoothly from rotor to rotor, so that no two modes are alike, and nothing is drawn at random.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

ROTORS = 33
MESHES = (5, 11, 17, 23, 28)
"""The rotors (from 0) before a mesh, as the directions in configs/drive_train.yaml have them."""


def model() -> tuple[np.ndarray, np.ndarray]:
    """Mass and stiffness without the meshes, dimensionless."""
    place = np.arange(ROTORS)
    mass = 1.0 + 0.4 * np.cos(1.7 * place) + 0.3 * np.sin(0.9 * place)
    stiffness = np.zeros((ROTORS, ROTORS))
    for k in range(ROTORS - 1):
        if k not in MESHES:
            shaft = 2.0 + np.sin(2.3 * k)
            stiffness[k : k + 2, k : k + 2] += shaft * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return np.diag(mass), stiffness


if __name__ == "__main__":
    target = Path(__file__).parent.parent / "configs" / "drive_train.npz"
    mass_matrix, stiffness_matrix = model()
    np.savez_compressed(target, mass=mass_matrix, stiffness=stiffness_matrix)
