"""First-order boundaries with periodic terms that need not be symmetric: friction, mesh damping that varies.

With the harmonics B exp(i nu t) + c.c. of the modal stiffness Phi^T K(t) Phi, and D of the damping, the amplitudes of
two modes near nu = w_p + w_q + sigma follow

    A_p' = (-mu_p - i sigma/2) A_p + G conj(A_q),    G = (B_pq - i w_q D_pq) i/(2 w_p),
    conj(A_q)' = H A_p + (-mu_q + i sigma/2) conj(A_q),    conj(H) = (B_qp - i w_p D_qp) i/(2 w_q).

Where B and D are symmetric G H is real and positive. In general an eigenvalue is imaginary at the two detunings

    sigma = [Im(GH) (mu_p - mu_q) +- (mu_p + mu_q) sqrt(Im(GH)^2 + 4 mu_p mu_q Re(GH) - 4 mu_p^2 mu_q^2)]/(2 mu_p mu_q),

which contains :func:`gearstab.perturbation.damped.single_pair`: terms that are not symmetric shift a tongue of
unequally damped modes to one side. The means of the terms, small as they are, add to the damping and shift w_p by
S_pp/(2 w_p). Derived as Lin & Parker 2002, (13)-(16).
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from gearstab.modal import mean_modes
from gearstab.system import Array, GearSystem
from gearstab.waveforms import Profile

NODES = 24
"""Gauss-Legendre nodes of a piece of a profile, for each harmonic that it is asked for."""


def first_order_edges(system: GearSystem, p: int, q: int, ratio: Fraction | int = 1) -> tuple[float, float]:
    """Return the lower and the upper mesh frequency of the tongue of two modes at ratio * Omega = w_p + w_q.

    system: a single one. p, q: modes of the mean system of mass, stiffness and meshes, from 1, of distinct frequencies.
    NaN where the tongue is closed, or where a mode is not damped: then first order has no boundary in general.
    """
    modes = mean_modes(system)
    shapes, frequency = modes.shapes, np.sqrt(np.maximum(modes.squared_frequency, 0.0))
    b, d, static, mean = _harmonics(system, shapes, Fraction(ratio))
    i, j = p - 1, q - 1
    one, two = frequency[i], frequency[j]
    center = one + two + static[i, i].real / (2 * one) + static[j, j].real / (2 * two)
    mu_p, mu_q = 0.5 * mean[i, i].real, 0.5 * mean[j, j].real
    forward = (b[i, j] - 1j * two * d[i, j]) * 1j / (2 * one)
    backward = np.conj((b[j, i] - 1j * one * d[j, i]) * 1j / (2 * two))
    product, both = complex(forward * backward), mu_p * mu_q
    square = product.imag**2 + 4 * both * product.real - 4 * both**2
    if not (mu_p > 0 and mu_q > 0 and square >= 0):
        return np.nan, np.nan
    sigma = product.imag * (mu_p - mu_q) + (mu_p + mu_q) * np.sqrt(square) * np.array([-1.0, 1.0])
    lower, upper = (center + sigma / (2 * both)) / float(ratio)
    return float(lower), float(upper)


def _harmonics(system: GearSystem, shapes: Array, ratio: Fraction) -> tuple[Array, Array, Array, Array]:
    """B and D at ratio * Omega, the mean stiffness of the terms, the mean damping, all ``(n, n)`` in modes."""
    b, d, static = (np.zeros(shapes.shape, dtype=complex) for _ in range(3))
    mean = np.zeros(shapes.shape) if system.damping is None else shapes.T @ system.damping @ shapes
    for mesh in system.meshes:
        g = shapes.T @ mesh.direction
        wave = 2 * mesh.amplitude * _coefficient(mesh.waveform, ratio / mesh.frequency_ratio, mesh.lag)
        b += wave * np.outer(g, g)
    for term in system.terms:
        both, own = np.outer(shapes.T @ term.left, shapes.T @ term.right), ratio / term.frequency_ratio
        if term.stiffness is not None:
            b += _coefficient(term.stiffness, own, term.lag) * both
            static += _coefficient(term.stiffness, Fraction(0), term.lag) * both
        if term.damping is not None:
            d += _coefficient(term.damping, own, term.lag) * both
            mean = mean + _coefficient(term.damping, Fraction(0), term.lag).real * both
    return b, d, static, mean


def _coefficient(profile: Profile, harmonic: Fraction | float, lag: Array | float) -> complex:
    """c of c exp(2 pi i s x), x counted from the beginning of the period; 0 where s is no whole number."""
    s = round(harmonic)
    if s != harmonic:
        return 0j
    edges = np.unique(np.concatenate([[0.0, 1.0], np.ravel(profile.breakpoints())]))
    x, w = np.polynomial.legendre.leggauss(NODES * (1 + s))
    at = edges[:-1, None] + np.diff(edges)[:, None] * 0.5 * (1 + x)
    parts = (0.5 * np.diff(edges)[:, None] * w) * profile.value(at) * np.exp(-2j * np.pi * s * at)
    return complex(parts.sum() * np.exp(-2j * np.pi * s * np.asarray(lag)))
