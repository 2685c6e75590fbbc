"""Edges of single instability tongues from the Floquet problem, independent of the package's methods.

Near a tongue two Floquet multipliers lambda_1, lambda_2 meet on the unit circle. There

    f(Omega) = -(lambda_1 - lambda_2)^2/(lambda_1 lambda_2)

is a smooth function of Omega, positive where the two are apart on the circle and negative where they have left it, so
that the edges are its two zeros. A polynomial through a few points around the tongue gives them without any search.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from math import gcd, lcm

import numpy as np
from scipy.linalg import expm

from gearstab.system import GearSystem
from gearstab.systems import build


def train(
    contact_ratio: tuple[object, object] = (1.5, 1.5),
    phasing: object = 0.0,
    tooth_ratio: str | int = 1,
    epsilon: object = (1.0, 1.0),
    **changes: object,
) -> GearSystem:
    """Lin & Parker's two-stage train, Table 1."""
    pairs = list(zip(("first", "second"), epsilon, contact_ratio, strict=True))
    meshes = [{"name": n, "mean_stiffness": 1.0, "epsilon": e, "contact_ratio": c} for n, e, c in pairs]
    meshes[1]["phasing"] = phasing
    base = {"kind": "two_stage", "inertias": [1.0, 0.3, 4.0], "input_shaft_stiffness": 0.5, "meshes": meshes}
    return build({**base, "tooth_ratio": Fraction(tooth_ratio), **changes})


def scaled(system: GearSystem, factor: float) -> GearSystem:
    """All epsilons times ``factor``."""
    return replace(system, meshes=tuple(replace(m, epsilon=np.asarray(m.epsilon) * factor) for m in system.meshes))


def segments(system: GearSystem) -> tuple[float, list[tuple[float, np.ndarray]]]:
    """(period, [(duration, K)]) in units of 2 pi/Omega for a single system."""
    ratios = [Fraction(mesh.frequency_ratio) for mesh in system.meshes]
    period = Fraction(lcm(*(r.denominator for r in ratios)), gcd(*(r.numerator for r in ratios)))
    edges = {0.0, float(period)}
    for mesh in system.meshes:
        duty = float(mesh.waveform.contact_ratio) % 1.0
        for phase in (0.0, duty):
            for cycle in range(int(period * mesh.frequency_ratio)):
                edges.add((float(mesh.lag) + phase + cycle) / float(mesh.frequency_ratio) % float(period))
    ordered = sorted(edges)
    pieces = []
    for start, stop in pairwise(ordered):
        stiffness = np.array(system.stiffness, dtype=float)
        for mesh in system.meshes:
            duty = float(mesh.waveform.contact_ratio) % 1.0
            phase = (float(mesh.frequency_ratio) * 0.5 * (start + stop) - float(mesh.lag)) % 1.0
            wave = 1 - duty if phase < duty else -duty
            level = float(mesh.mean_stiffness) * (1 + 2 * float(mesh.epsilon) * wave)
            stiffness = stiffness + level * np.outer(mesh.direction, mesh.direction)
        pieces.append((stop - start, stiffness))
    return float(period), pieces


def monodromy(system: GearSystem, omega: np.ndarray) -> np.ndarray:
    """The product of matrix exponentials over the common period, ``(points, 2n, 2n)``."""
    n, inverse = system.size, np.linalg.inv(system.mass)
    damping = np.zeros((n, n)) if system.damping is None else system.damping
    total = np.eye(2 * n)
    for duration, stiffness in segments(system)[1]:
        generator = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ stiffness, -inverse @ damping]])
        total = expm(generator * (2 * np.pi * duration / omega)[:, None, None]) @ total
    return total


def collision(system: GearSystem, omega: np.ndarray, pair: tuple[float, float], nu: float) -> np.ndarray:
    """f(Omega) of the two multipliers that meet near nu Omega = w_p + w_q."""
    turns = 2 * np.pi * segments(system)[0]
    sign = (-1) ** round(nu * turns / (2 * np.pi))
    meeting = sign * np.exp(0.5j * (pair[0] - pair[1]) * turns / omega)
    values = np.linalg.eigvals(monodromy(system, omega))
    near = np.argsort(np.abs(values - meeting[:, None]), axis=-1)[:, :2]
    one, two = np.take_along_axis(values, near, axis=-1).T
    return -((one - two) ** 2 / (one * two)).real


def squared_half_width(system: GearSystem, pair: tuple[float, float], nu: float, start: float) -> tuple[float, float]:
    """(centre, h^2) of the tongue nu Omega = w_p + w_q in Omega; h^2 < 0 measures how far a tongue is from opening.

    start: a first guess of its half-width.
    """
    center, half = sum(pair) / nu, start
    nodes = np.cos(np.pi * (np.arange(9) + 0.5) / 9)
    for _ in range(4):
        reach = 2.5 * half
        values = collision(system, center + reach * nodes, pair, nu)
        fit = np.polynomial.Polynomial.fit(nodes, values, 6)
        bottoms = fit.deriv().roots()
        bottom = float(bottoms[np.argmin(np.abs(bottoms))].real)
        curvature = float(fit.deriv(2)(bottom))
        near = [float(r.real) for r in fit.roots() if abs(r.imag) < 1e-9]
        below, above = [r for r in near if r < bottom], [r for r in near if r > bottom]
        if fit(bottom) < 0 and below and above:
            edges = max(below), min(above)
            middle, squared = 0.5 * sum(edges), 0.25 * (edges[1] - edges[0]) ** 2
        else:
            middle, squared = bottom, -2 * float(fit(bottom)) / curvature
        center, squared = center + reach * middle, reach**2 * squared
        half = max(np.sqrt(abs(squared)), 0.2 * reach if squared <= 0 else 0.0)
    return center, squared
