"""Benton & Seireg's uncoupled Mathieu equations: a comparison method that ignores coupling and mesh phasing.

The modal equations are decoupled by dropping the off-diagonal terms of Phi^T K_v(t) Phi, the meshes get one common
variation (in phase, with the average of their contact ratios), and of its Fourier series the first harmonic is kept.
Each mode then obeys a Mathieu equation of its own,

    u'' + [w_p^2 + 2 h_p cos Omega t] u = 0,    h_p = |z| sum_i epsilon_i k_gi delta_ip^2,    |z| = (2/pi) |sin pi c|

or, with tau = Omega t/2, y'' + (a - 2 q cos 2 tau) y = 0 on the ray q = kappa a, where a = (2 w_p/Omega)^2 and
kappa = h_p/w_p^2. Its instability regions lie between the characteristic curves b_m(q) and a_m(q), taken exactly at
finite epsilon: m = 1 near Omega = 2 w_p (primary), m = 2 near w_p (secondary), m near 2 w_p/m. There are no combination
instabilities, and nothing depends on the phasing: Lin & Parker (section 4, Fig. 8b) show that this is wrong.

Source: Benton & Seireg 1980 (ASME J. Mech. Des. 102, 379-383) as described by Lin & Parker 2002, section 4. Theirs has
equal mesh frequencies; meshes that run at different frequencies are here taken apart, each frequency with its own
Mathieu equations. Damping is not part of the method and is ignored.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from gearstab.modal import mean_modes
from gearstab.perturbation.tongues import ParametricExcitation, Tongue, Tongues, tongue
from gearstab.system import Array, GearSystem
from gearstab.waveforms import Rectangular

EXTRA_TERMS = 12
"""Fourier terms beyond twice the wanted one. The coefficients of the term r fall by kappa a/r^2 from term to term, with
a near m^2, so that these reach double precision for kappa up to 1, twice of what keeps the stiffness positive."""


def uncoupled(system: GearSystem, harmonics: int) -> Tongues:
    """Instability regions of the uncoupled Mathieu equations, see the module's text; ``harmonics`` is the largest m.

    The boundaries are exact for the Mathieu equation and not symmetric about the root of the tongue:
    ``center_frequency`` is the root 2 w_p/m, ``half_width`` half of the distance between the boundaries, ``threshold``
    0 (no damping).

    Raises ValueError where a mesh has no contact ratio (a waveform that is not rectangular).
    """
    modes = mean_modes(system)
    wanted = np.flatnonzero(np.any(modes.squared_frequency.reshape(-1, system.size) != 0, axis=0))
    squared = np.where(modes.squared_frequency > 0, modes.squared_frequency, np.nan)
    index: list[Tongue] = []
    centers: list[Array] = []
    edges: list[Array] = []
    for members in _equal_frequencies(system):
        ratio = system.meshes[members[0]].frequency_ratio
        variation = _variation(system, members, modes.mesh_deflection)
        for m, p in product(range(1, harmonics + 1), wanted):
            force = ParametricExcitation(m * ratio, tuple((i, m) for i in members))
            root = np.sqrt(squared[..., p])
            index.append(tongue(system, force, int(p) + 1, int(p) + 1))
            centers.append(np.broadcast_to(2 * root / (m * float(ratio)), system.batch))
            kappa = np.broadcast_to(variation[..., p] / squared[..., p], system.batch)
            edges.append(2 * root / (float(ratio) * np.sqrt(characteristic_values(kappa, m))))
    boundary = np.array(edges)
    width = 0.5 * (boundary[:, 1] - boundary[:, 0])
    return Tongues(tuple(index), np.array(centers), width, boundary, 0 * width)


def _equal_frequencies(system: GearSystem) -> list[list[int]]:
    """Numbers of the meshes that run at the same frequency, together."""
    ratios = [mesh.frequency_ratio for mesh in system.meshes]
    return [[i for i, r in enumerate(ratios) if r == ratio] for ratio in dict.fromkeys(ratios)]


def _variation(system: GearSystem, members: list[int], deflection: Array) -> Array:
    """h_p ``(..., n)`` of all modes, from the meshes that run at one frequency."""
    meshes = [system.meshes[i] for i in members]
    contact_ratios = [m.waveform.contact_ratio for m in meshes if isinstance(m.waveform, Rectangular)]
    if len(contact_ratios) < len(meshes):
        raise ValueError("uncoupled Mathieu equations average the contact ratios: every mesh needs a rectangular wave")
    average = sum(np.asarray(c, dtype=float) for c in contact_ratios) / len(meshes)
    size = np.hypot(*Rectangular(average).fourier(1))
    total = np.zeros(())
    for i, mesh in zip(members, meshes, strict=True):
        total = total + (size * mesh.amplitude)[..., None] * deflection[..., i] ** 2
    return np.asarray(total)


def characteristic_values(kappa: Array, m: int) -> Array:
    """Characteristic values a_m, b_m of Mathieu's equation on the ray q = kappa a ``(2, ...)``, for m >= 1, kappa >= 0.

    On the ray, the recurrence of the Fourier coefficients (McLachlan 1947, chapter 3), D c + q T c = a c, becomes

        D^(-1/2) (I - kappa T) D^(-1/2) x = x/a,    D = diag(r^2),    r = 1, 3, 5, ... or 2, 4, 6, ...

    with ones beside the diagonal of T and T_11 = 1 (a_m, odd m), -1 (b_m, odd), 0 (b_m, even) or 2 kappa (a_m, even,
    with the constant term eliminated). Each curve meets the ray once: a - q da/dq > 0. NaN where kappa is NaN.
    """
    order = (m + 1) // 2
    r = np.arange(2 - m % 2, 2 * (2 * order + EXTRA_TERMS), 2, dtype=float)
    ray = np.where(np.isnan(kappa), 0.0, kappa)
    corners = (np.ones_like(ray), -np.ones_like(ray)) if m % 2 else (2 * ray, np.zeros_like(ray))
    found = []
    for corner in corners:
        matrix = np.eye(len(r)) - ray[..., None, None] * (np.eye(len(r), k=1) + np.eye(len(r), k=-1))
        matrix[..., 0, 0] -= ray * corner
        inverse = np.linalg.eigvalsh(matrix / (r[:, None] * r))[..., -order]
        found.append(np.where(np.isnan(kappa), np.nan, 1 / inverse))
    return np.stack(found)
