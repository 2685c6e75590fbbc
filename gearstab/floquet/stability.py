"""Results that all strategies share: growth rate, verdict and status."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from gearstab.system import Array

STATUS_FLAGS = {
    "eigenvalues": 1, "krein": 2, "rescaled": 4, "negative_stiffness": 8, "failed": 16, "not_converged": 32,
    "per_mesh": 64, "lyapunov": 128, "undecided": 256, "near_boundary": 512,
}  # fmt: skip
"""Bits of ``status``: decided by the eigenvalues of the monodromy matrix; by the Krein signature; the matrix outgrew
double precision and was scaled; a state of the system has a negative stiffness; no finite result; the error estimate
exceeds the tolerance; one mesh frequency at a time, the others averaged; an estimated Lyapunov exponent; one whose
confidence interval contains zero; so near to a boundary that the error of the multipliers may decide the verdict."""


@dataclass(frozen=True)
class FloquetStability:
    """Stability of rows at mesh frequencies, ``(rows, P)``.

    growth_rate: the largest real part of the characteristic exponents, 1/time, without rigid-body modes that do not
        grow; positive where and only where a point is unstable, exactly 0 where a conservative system is stable.
    stable: int8: 1, 0, or -1 where nothing could be computed.
    status: int16, bits of STATUS_FLAGS.

    Each of the others is None where there is none:

    exponents: ``(rows, P, 2n)`` complex, all characteristic exponents ln(lambda)/T over the common period T, rigid-body
        modes included, imaginary parts in (-pi/T, pi/T], by descending real part. Of a block: its elastic ones.
    error_estimate: the largest error of all multipliers, relative to the largest of them or 1, as estimated; None where
        the propagation is exact and all error is rounding. Where the largest multiplier is not below 1, growth_rate T
        is wrong by no more than this.
    interval: half-width of the confidence interval of a growth rate that is a Lyapunov exponent, 1/time.
    by_mesh: ``(rows, P, groups)``, the growth rate with one mesh frequency alone, in the order of
        :func:`~gearstab.floquet.frequencies.groups`.
    """

    growth_rate: Array
    stable: Array
    status: Array
    exponents: Array | None = None
    error_estimate: Array | None = None
    interval: Array | None = None
    by_mesh: Array | None = None


def empty(rows: int, points: int) -> FloquetStability:
    """Return a result to be filled: no flag of ``status`` is set, nothing else has a value.

    In memory the rows of a mesh frequency are neighbours, as in a result file whose first axis is the mesh frequency.
    """
    growth, stable = np.empty((points, rows)), np.empty((points, rows), dtype=np.int8)
    return FloquetStability(growth.T, stable.T, np.zeros((points, rows), dtype=np.int16).T)


def decided(growth: Array, period: Array, threshold: Array | float) -> tuple[Array, Array]:
    """Return (growth rate, stable as int8) of growths per period of which rounding, or another error, leaves up to a
    threshold.

    A growth within the threshold is none: a stable point has no positive growth rate, an unstable one has.
    """
    stable = growth <= threshold
    return np.where(stable, np.minimum(growth, 0.0), growth) / period, stable.astype(np.int8)


def settled(exponents: Array, stable: Array) -> Array:
    """Return characteristic exponents ``(..., m)`` ordered by descending real and imaginary part; of a stable point
    none has a positive real part, which could be rounding only.
    """
    found = exponents.copy()
    np.minimum(found.real, 0.0, out=found.real, where=(stable == 1)[..., None])
    order = np.lexsort((-found.imag, -found.real), axis=-1)
    return np.take_along_axis(found, order, axis=-1)


def mark_failed(result: FloquetStability, points: Any) -> None:
    """Mark points of a result, given as an index, as those that nothing could be computed of."""
    result.growth_rate[points], result.stable[points] = np.nan, -1
    result.status[points] |= STATUS_FLAGS["failed"]
