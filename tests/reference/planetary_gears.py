"""Planetary gears: Parker's of 2009 as parameters, and ones of cyclic symmetry put together by hand; all planar."""

from fractions import Fraction

import numpy as np
from scenes import scene_text

from gearstab.mesh import Mesh
from gearstab.system import GearSystem
from gearstab.systems import build
from gearstab.waveforms import Rectangular

ALPHA = np.deg2rad(24.0)
ANGLE = np.deg2rad(24.6)


def parameters(planets=4, harmonics=12, **changes):
    """Parker 2009, Table 1, in phase, with k_cu = 1e11 N/m."""
    ring = {"kind": "elastic", "harmonics": harmonics, "bending_stiffness": 5e7} if harmonics > 1 else {"kind": "rigid"}
    return {
        "kind": "planetary", "planets": planets, "ring": ring, "motion": "planar", "scaling": "dimensionless",
        "masses": {"ring": 6.35, "carrier": 5.43, "sun": 0.4, "planet": 4.0},
        "inertias": {"carrier": 6.0, "sun": 2.5, "planet": 2.0},
        "supports": {
            "carrier": 5e11, "sun": 5e11, "planet": 5e11, "carrier_rotation": 1e11, "sun_rotation": 5e11,
            "ring_radial": 0.0, "ring_tangential": 0.0,
        },
        "pressure_angles": {"sun": ANGLE, "ring": ANGLE},
        "meshes": {
            "sun": {"mean_stiffness": 1e8, "epsilon": 0.1, "contact_ratio": 1.4},
            "ring": {"mean_stiffness": 1e8, "epsilon": 0.1, "contact_ratio": 1.6},
        },
        "phases": {"sun": [0.0] * planets, "sun_ring": 0.5},
    } | changes  # fmt: skip


def configuration(*lines: str) -> str:
    """The section ``system`` of a planetary gear with Parker's masses, and further lines of it."""
    return "\n".join([SECTION, *(f"  {line}" for line in lines), ""])


SECTION = scene_text("planetary_gears_section")
SEQUENTIAL = {"sun": [0.0, 0.25, 0.5, 0.75], "sun_ring": 0.5}


def with_epsilon(p, epsilon):
    return p | {"meshes": {name: mesh | {"epsilon": epsilon} for name, mesh in p["meshes"].items()}}


SUPPORTS = {
    "carrier": 2e8, "sun": 2e8, "planet": 3e8, "carrier_rotation": 1e8, "sun_rotation": 2e8,
    "ring_radial": 1e8, "ring_tangential": 1e8,
}  # fmt: skip
"""Soft ones, so that few high modes add their narrow tongues."""


def planetary(**changes: object) -> GearSystem:
    """21 coordinates in blocks of 6, 12 and 3."""
    return build(with_epsilon(parameters(harmonics=1, supports=SUPPORTS, **changes), 0.2))


def cyclic(planets, phases=None, epsilon=0.3, harmonics=1, damping=0.0):
    """A sun, N planets on springs and a ring that may be elastic, with meshes on both.

    phases: of the suns' meshes; the ring's lag half a period behind.

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
