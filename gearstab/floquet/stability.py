"""Stability of points: growth rate, verdict, status and exponents, and how those of a block are found."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from gearstab.floquet.kernel import c_kernel as kernel
from gearstab.floquet.kernel import damped, decision, factors
from gearstab.floquet.kernel.decision import STABLE
from gearstab.floquet.segments.blocks import Block
from gearstab.floquet.segments.pattern import Pattern
from gearstab.system import Array

STATUS_FLAGS = {
    "eigenvalues": 1, "krein": 2, "rescaled": 4, "negative_stiffness": 8, "failed": 16, "not_converged": 32,
    "per_mesh": 64, "lyapunov": 128, "undecided": 256, "near_boundary": 512,
}  # fmt: skip
"""Bits of ``status``: decided by the eigenvalues of the monodromy matrix; by the Krein signature; the matrix outgrew
double precision and was scaled; a state of the system has a negative stiffness; no finite result; the error estimate
exceeds the tolerance; one mesh frequency at a time, the others averaged; an estimated Lyapunov exponent; one whose
confidence interval contains zero; so near to a boundary that the error of the multipliers may decide the verdict."""
DAMPED_ON_CIRCLE = 1e-10
"""A damped system whose growth per period is below this is stable: the rounding error of a long product, and far less
than the decay of any damping ratio above 1e-10."""
GRADED_NORM = 30.0
"""Monodromy matrices larger than this have small multipliers that an eigenvalue solver would blur."""


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


@dataclass(frozen=True)
class OperatingPoints:
    """A pattern and its mesh frequencies, ``(P,)`` of all rows or ``(r, P)``, in the system's own units."""

    pattern: Pattern
    mesh_frequency: Array

    @cached_property
    def omega(self) -> Array:
        """Mesh frequencies in the pattern's units, ``(r, P)``."""
        return np.asarray(self.mesh_frequency / self.pattern.elastic.rate[:, None])

    @property
    def period(self) -> Array:
        """Common period, ``(r, P)``, units of 1/rate."""
        return 2 * np.pi * self.pattern.cycles / self.omega

    @property
    def shape(self) -> tuple[int, int]:
        """(r, P)."""
        return len(self.pattern.rows), self.mesh_frequency.shape[-1]

    def status(self) -> Array:
        """Status bits that hold for whole rows."""
        status = np.zeros(self.shape, dtype=np.int16)
        status[self.negative] = STATUS_FLAGS["negative_stiffness"]
        return status

    @property
    def negative(self) -> Array:
        """``(r,)`` bool, rows with a state of negative stiffness."""
        return np.asarray(np.any(self.pattern.stiffness_below_zero, axis=(1, 2)))


def solved(
    part: OperatingPoints, block: Block, exponents: bool, into: FloquetStability | None = None
) -> FloquetStability:
    """A block ``(r, P)``, without its copies, in the system's own units of time; its exponents are the elastic ones.

    A constant one without stiffness along a mode is left to the general rules.

    into: an empty result of all rows of the system. What is computed point by point is written to the block's rows of
    it, and it is returned, with the exponents of the block.
    """
    free = part.pattern.elastic.conservative
    decided = not free or bool(np.all(part.pattern.squared_frequency > 0))
    if block.constant and part.pattern.size and decided:
        return constant(part, exponents)
    return conservative(part, exponents, into) if free else with_damping(part, exponents)


def constant(part: OperatingPoints, exponents: bool) -> FloquetStability:
    """A block whose stiffness does not vary: its exponents are those of a constant system, at every mesh frequency."""
    pattern = part.pattern
    rate = pattern.elastic.rate[:, None]
    if pattern.elastic.conservative:
        frequency = np.sqrt(pattern.squared_frequency[:, 0])
        # The sum has no negative zeros, as 1j times a negative number and the negative of no shift have.
        values = (0.0 - pattern.elastic.shift[:, None]) + 1j * np.concatenate([frequency, -frequency], axis=1)
    else:
        values = damped.generators(pattern).eigen[0][:, 0]
    growth = np.repeat(values.real.max(axis=1, initial=-np.inf)[:, None], part.omega.shape[1], axis=1)
    growth, stable = decided(growth * part.period, part.period, DAMPED_ON_CIRCLE)
    table = None
    if exponents:
        turns = values.imag[:, None, :] * part.period[..., None] / (2 * np.pi)
        turns -= np.ceil(turns - 0.5)
        imaginary = 2 * np.pi * turns / part.period[..., None]
        table = (values.real[:, None, :] + 1j * imaginary) * rate[..., None]
    return FloquetStability(growth * rate, stable, part.status(), table)


def conservative(part: OperatingPoints, exponents: bool, into: FloquetStability | None = None) -> FloquetStability:
    """A block without damping but a uniform one; written to its rows of ``into``, where that is given."""
    pattern, elastic = part.pattern, part.pattern.elastic
    place = np.arange(len(pattern.rows)) if into is None else pattern.rows
    result = empty(*part.shape) if into is None else into
    rows, points = kernel.rates(pattern, part.mesh_frequency, place, result.stable, result.growth_rate)
    if (negative := part.negative).any():
        result.status[place[negative]] = STATUS_FLAGS["negative_stiffness"]
    for row, point in pieces(rows, points, pattern.size):
        rate, shift = elastic.rate[row], elastic.shift[row]
        omega = np.broadcast_to(part.mesh_frequency, part.shape)[row, point] / rate
        verdict, growth, bits = decide_doubtful(pattern, row, omega)
        period, target = 2 * np.pi * pattern.cycles / omega, (place[row], point)
        value = growth / period
        # Without damping the verdict decides; with uniform damping a growth below the decay is stable.
        result.stable[target] = np.where(shift == 0, verdict == STABLE, value <= shift)
        result.growth_rate[target] = (value - shift) * rate
        result.status[target] |= bits
        lost = ~np.isfinite(value)
        mark_failed(result, (place[row[lost]], point[lost]))
    if not exponents:
        return result
    # What grows by nothing before the decay is taken off is on the unit circle.
    inside = result.growth_rate[place] == ((0.0 - elastic.shift) * elastic.rate)[:, None]
    table = conservative_exponents(pattern, part.omega, inside) * elastic.rate[:, None, None]
    return replace(result, exponents=table)


def conservative_exponents(pattern: Pattern, omega: Array, stable: Array) -> Array:
    """All elastic exponents ``(r, P, 2n)``, in units of the pattern's rate."""
    logs = conservative_logs(pattern, omega)
    np.copyto(logs.real, 0.0, where=stable[..., None])
    period = 2 * np.pi * pattern.cycles / omega
    logs /= period[..., None]
    logs.real -= pattern.elastic.shift[:, None, None]
    return logs


def pieces(rows: Array, points: Array, size: int) -> Iterator[tuple[Array, Array]]:
    """(row, point) of chosen points ``(Q,)``, in pieces whose monodromy matrices fit in memory."""
    step = max(1, factors.ENTRIES_AT_ONCE // (2 * size) ** 2)
    for i in range(0, len(rows), step):
        yield rows[i : i + step], points[i : i + step]


def decide_doubtful(pattern: Pattern, rows: Array, omega: Array) -> tuple[Array, Array, Array]:
    """(verdict, growth, status bits) of points in doubt ``(P,)``, from their monodromy matrices."""
    matrix, scale = kernel.monodromy(pattern, rows, omega)
    status = np.full(len(omega), STATUS_FLAGS["eigenvalues"], dtype=np.int16)
    finite = np.isfinite(matrix).all(axis=(1, 2))
    matrix = np.where(finite[:, None, None], matrix, 0.0)
    stable, growth, krein = decision.conservative(matrix)
    large = scale > 0
    if large.any():
        with np.errstate(divide="ignore"):
            growth[large] = np.log(np.abs(np.linalg.eigvals(matrix[large])).max(axis=-1)) + scale[large]
    status[krein & ~large] |= STATUS_FLAGS["krein"]
    status[large] |= STATUS_FLAGS["rescaled"]
    growth[~finite] = np.nan
    return (stable & ~large).astype(np.int8), growth, status


def conservative_logs(pattern: Pattern, omega: Array) -> Array:
    """ln lambda ``(r, P, 2n)``; the product is formed only where that costs no digits."""
    logs = kernel.log_multipliers(pattern, omega, GRADED_NORM)
    for row, wide in factors.chains(np.isnan(logs).any(axis=2), len(pattern.states), 2 * pattern.size):
        logs[row, wide] = kernel.graded(factors.factors(pattern, row, omega[row, wide]))
    return logs


def with_damping(part: OperatingPoints, exponents: bool) -> FloquetStability:
    """A block with damping of its own."""
    pattern, omega = part.pattern, part.omega
    generator = damped.generators(pattern)
    growth, scale = kernel.scan_damped(pattern, generator, omega)
    status = part.status()
    status[np.abs(scale) > np.log(kernel.LARGE)] |= STATUS_FLAGS["rescaled"]
    growth, stable = decided(growth, part.period, DAMPED_ON_CIRCLE)
    rate = pattern.elastic.rate[:, None]
    table = damped_exponents(pattern, generator, omega) * rate[..., None] if exponents else None
    return FloquetStability(growth * rate, stable, status, table)


def damped_exponents(pattern: Pattern, generator: damped.Generators, omega: Array) -> Array:
    """All elastic exponents ``(r, P, m)`` of a damped pattern, in units of its rate."""
    logs = kernel.log_multipliers_damped(pattern, generator, omega)
    return np.asarray(logs / (2 * np.pi * pattern.cycles / omega)[..., None])
