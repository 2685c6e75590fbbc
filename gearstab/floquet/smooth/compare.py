"""Two resolutions of one system: by how much their multipliers differ, and what rounding may have done to them.

The error of a set of multipliers is the largest of all, relative to the largest multiplier or 1,

    max_j |lambda_j - lambda_j*| / max(1, max_k |lambda_k|).

The logarithm of the largest multiplier, and so the growth per period, is wrong by no more than that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.ckernel import eigenvalues
from gearstab.floquet.kernel import c_kernel as kernel
from gearstab.floquet.kernel import damped
from gearstab.floquet.kernel.damped import Generators
from gearstab.floquet.kernel.decision import DOUBTFUL, growth_of
from gearstab.floquet.segments.pattern import Pattern
from gearstab.floquet.stability import pieces
from gearstab.system import Array

EPSILON = float(np.finfo(float).eps)
DRIFT = 5.0
"""Random rounding error of a product of S propagators: this times eps (sqrt(S) + phase)."""
BIAS = 0.2
"""Systematic rounding error of the same product: this times eps S. Modes of LAPACK are orthonormal but for an error
whose mean over many similar matrices is not zero, and the product of the S changes of modes adds it up: 0.08 eps per
step in a trace, 0.15 in a multiplier, over 480 to 7,680 steps. The compiled eigensolver removes it (symmetric.h)."""
WEIGHT = 1.5
"""The size of a multiplier on the unit circle, taken as (|rho| + |rho^2 - 4|^(1/2))/2, is between 1 and 1.42."""

NEAR = 4.0
"""Multipliers within this many times their error may have met: each moves by the error, and a trace near 2 twice."""
VISIBLE = 1e6
"""Differences larger than this times the rounding error are not of rounding."""


@dataclass(frozen=True)
class KernelAnswer:
    """Results of a kernel at points ``(r, P)``.

    growth: ln max |lambda| a period before any uniform decay. verdict: int8 as of the kernels, or None with damping.
    values: rho ``(r, P, n)`` of a conservative pattern, multipliers over exp(scale) ``(r, P, m)`` with damping. scale:
    ``(r, P)``, 0 if conservative. rounding ``(r, P)``: relative rounding error of the monodromy matrix.
    """

    growth: Array
    verdict: Array | None
    values: Array
    scale: Array
    rounding: Array


def rounding(pattern: Pattern, omega: Array, highest: Array | None = None) -> Array:
    """``(r, P)``, the relative rounding error of a monodromy matrix.

    highest: ``(r, D)``, the highest frequency of each state, where it is known.
    """
    if highest is None:
        squared = pattern.squared_frequency  # ascending
        highest = np.sqrt(np.maximum(np.abs(squared[..., 0]), np.abs(squared[..., -1])))
    turns = highest.take(pattern.states, axis=1) * np.abs(pattern.fractions)
    phase = 2 * np.pi * pattern.cycles * turns.sum(axis=1)[:, None] / omega
    count = len(pattern.states)
    return np.asarray(EPSILON * (DRIFT * (np.sqrt(count) + phase) + BIAS * count))


def scan(pattern: Pattern, omega: Array, interpolate: bool = False) -> KernelAnswer:
    """All points of a pattern; interpolate: whether over mesh frequency, where that pays."""
    if pattern.elastic.conservative:
        noise = rounding(pattern, omega)
        verdict, growth, rho, magnified = kernel.scan_traces(pattern, omega, interpolate)
        _complete(pattern, omega, verdict, growth, rho, magnified)
        return KernelAnswer(growth, verdict, rho, np.zeros(omega.shape), noise * magnified)
    generator: Generators = damped.generators(pattern)
    growth, scale, values = kernel.multipliers_damped(pattern, generator, omega)
    # The modes without damping, which are not needed otherwise, would take as long as all the rest.
    noise = rounding(pattern, omega, np.abs(generator.eigen[0]).max(axis=-1))
    return KernelAnswer(growth, None, values, scale, noise)


def _complete(pattern: Pattern, omega: Array, verdict: Array, growth: Array, rho: Array, magnified: Array) -> None:
    """Write the growth of points in doubt, left open by a kernel, in place, and rounding errors of the largest
    multiplier.

    Where there are no traces, beyond a growth of ln LARGE a period, it comes from the scaled matrix.
    """
    rows, points = np.nonzero(verdict == DOUBTFUL)
    traces = rho[rows, points]
    known = np.isfinite(traces).all(axis=-1)
    growth[rows[known], points[known]] = growth_of(traces[known].T)
    for row, point in pieces(rows[~known], points[~known], pattern.size):
        matrix, scale = kernel.monodromy(pattern, row, omega[row, point])
        with np.errstate(divide="ignore", invalid="ignore"):
            largest = np.abs(eigenvalues(matrix)).max(axis=-1)
            growth[row, point] = np.log(largest) + scale
            magnified[row, point] = np.abs(matrix).max(axis=(1, 2)) / largest


def difference(fine: KernelAnswer, coarse: KernelAnswer, decay: Array) -> tuple[Array, Array]:
    """Return how much the multipliers differ, and the rounding error of those of ``fine``, ``(r, P)`` each.

    decay ``(r, P)``: uniform decay a period that the multipliers do not contain.
    """
    if fine.verdict is None:
        return _difference_damped(fine, coarse)
    found, noise = _difference_conservative(fine, coarse)
    size = np.exp(np.minimum(fine.growth - decay, 0.0))
    lost = ~np.isfinite(found)
    # Growth beyond ln LARGE a period: only the logarithm of the largest multiplier is at hand.
    found[lost] = np.abs(fine.growth - coarse.growth)[lost]
    noise[lost] = fine.rounding[lost]
    return found * size, noise * size


def _difference_conservative(fine: KernelAnswer, coarse: KernelAnswer) -> tuple[Array, Array]:
    with np.errstate(invalid="ignore", over="ignore"):
        change, largest = kernel.trace_change(fine.values, coarse.values, WEIGHT)
    close = change < VISIBLE * fine.rounding
    noise = fine.rounding.copy()
    if close.any():
        # More where two multipliers nearly coincide; those that do not act on each other do not show it.
        least = fine.rounding[close] * largest[close]
        noise[close] = np.maximum(kernel.trace_condition(fine.values[close], least)[0], least) / largest[close]
    return change, noise


def colliding(rho: Array, error: Array) -> Array:
    """``(P,)``: whether two multipliers, of traces ``(P, n)``, may in truth have met, or not have met."""
    return np.asarray(kernel.trace_condition(rho, error)[1] <= NEAR * error)


def _difference_damped(fine: KernelAnswer, coarse: KernelAnswer) -> tuple[Array, Array]:
    with np.errstate(over="ignore", invalid="ignore"):
        other = coarse.values * np.exp(coarse.scale - fine.scale)[..., None]
        gap = np.abs(fine.values[..., :, None] - other[..., None, :]).min(axis=-1).max(axis=-1, initial=0.0)
        # A multiplier of one over the scale; exp(709) overflows.
        largest = np.maximum(np.abs(fine.values).max(axis=-1, initial=0.0), np.exp(np.minimum(-fine.scale, 700.0)))
        found = gap / largest
    found = np.where(np.isfinite(found), found, np.abs(fine.growth - coarse.growth))
    return found, np.minimum(fine.rounding, 1.0) + 0.0 * found
