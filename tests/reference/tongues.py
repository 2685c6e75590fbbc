"""Instability regions: edges of single tongues from the Floquet problem, independent of the package's methods.

Near a tongue two Floquet multipliers lambda_1, lambda_2 meet on the unit circle. There

    f(Omega) = -(lambda_1 - lambda_2)^2/(lambda_1 lambda_2)

is a smooth function of Omega, positive where the two are apart on the circle and negative where they have left it, so
that the edges are its two zeros. A polynomial through a few points around the tongue gives them without any search.
Regions that the package finds are compared with its flags.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from driven import monodromy
from systems import two_stage

from gearstab.floquet import solve
from gearstab.floquet.boundaries import Boundaries
from gearstab.modal import mean_modes
from gearstab.system import GearSystem
from gearstab.systems import build


def train(
    contact_ratio: Any = (1.5, 1.5), phasing: Any = 0.0, tooth_ratio: Any = 1, epsilon: Any = 1.0, **changes: Any
) -> GearSystem:
    """Lin & Parker's two-stage train, Table 1, of unit variation."""
    return build(two_stage(tooth_ratio, epsilon, contact_ratio, phasing, **changes))


def scaled(system: GearSystem, factor: float) -> GearSystem:
    """All epsilons times ``factor``."""
    return replace(system, meshes=tuple(replace(m, epsilon=np.asarray(m.epsilon) * factor) for m in system.meshes))


def collision(system: GearSystem, omega: np.ndarray, pair: tuple[float, float], nu: float) -> np.ndarray:
    """f(Omega) of the two multipliers that meet near nu Omega = w_p + w_q."""
    turns = 2 * np.pi * float(system.common_period()[0])
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


def log_growth(system: GearSystem, omega: float) -> float:
    """ln of the largest multiplier over the common period."""
    return float(np.log(np.abs(np.linalg.eigvals(monodromy(system, np.array([omega]))[0])).max()))


def with_damping(system: GearSystem, damping: np.ndarray, factor: float) -> GearSystem:
    return replace(scaled(system, factor), damping=damping * factor)


def damping_matrix(system: GearSystem, kind: str, values: list) -> np.ndarray:
    if kind == "matrix":
        return np.array(values)
    if kind == "mesh":
        return sum(c * m.outer for c, m in zip(values, system.meshes, strict=True))
    modes = mean_modes(system)
    weighted = system.mass @ modes.shapes
    return (weighted * (2 * np.array(values) * modes.natural_frequency)) @ weighted.T


def first_outside(system: GearSystem, inner: float, outer: float) -> float:
    """Bisection on the multipliers leaving the unit circle by more than 1e-7."""
    limit_of = 1e-7
    for _ in range(45):
        middle = 0.5 * (inner + outer)
        if log_growth(system, middle) > limit_of:
            inner = middle
        else:
            outer = middle
    return 0.5 * (inner + outer)


# ---- regions against flags


def inside(found: Boundaries, row: int, omega: np.ndarray) -> np.ndarray:
    """Which mesh frequencies lie in a region of a row."""
    mine = found.row == row
    low, high = found.lower[mine], found.upper[mine]
    return ((omega[:, None] > low) & (omega[:, None] < high)).any(axis=1)


def near_edge(found: Boundaries, row: int, omega: np.ndarray, distance: float) -> np.ndarray:
    """Which mesh frequencies are within a relative distance of an edge."""
    mine = found.row == row
    edges = np.concatenate([found.lower[mine], found.upper[mine]])
    return (np.abs(omega[:, None] / edges - 1) < distance).any(axis=1)


def disagreements(found: Boundaries, system: GearSystem, start: float, stop: float, points: int) -> Mapping[int, list]:
    """Raster points, uniform in the period, whose flag is not that of the regions; none at all where empty."""
    omega = 1 / np.linspace(1 / stop, 1 / start, points + 2)[1:-1]
    stable = solve(system, omega).stable
    result = {}
    for row in range(found.rows):
        wrong = inside(found, row, omega) == (stable[row] == 1)
        wrong &= ~near_edge(found, row, omega, 1e-9)
        if wrong.any():
            result[row] = omega[wrong].tolist()
    return result
