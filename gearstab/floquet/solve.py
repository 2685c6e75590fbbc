"""Exact Floquet analysis of a (batched) gear system with piecewise constant mesh stiffness."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gearstab.floquet import damped, decision, graded, kernel, numpy_kernel
from gearstab.floquet.blocks import Block, split, whole
from gearstab.floquet.invariants import DOUBTFUL, STABLE
from gearstab.floquet.segments import Pattern, prepare
from gearstab.system import Array, GearSystem

STATUS_FLAGS = {"eigenvalues": 1, "krein": 2, "rescaled": 4, "negative_stiffness": 8, "failed": 16}
"""Bits of ``status``: decided by the eigenvalues of the monodromy matrix; by the Krein signature; the matrix outgrew
double precision and was scaled; a state of the system has a negative stiffness; no finite result."""

DAMPED_ON_CIRCLE = 1e-10
"""A damped system whose growth a period is below this is stable: the rounding error of a long product, and far less
than the decay of any damping ratio above 1e-10."""
ENTRIES_AT_ONCE = 2**22
"""Of the monodromy matrices of points in doubt: 32 MB."""
GRADED_NORM = 30.0
"""Monodromy matrices larger than this have small multipliers that an eigenvalue solver would blur."""
GRADED_SPREAD = np.log(100.0)
"""The same for damped ones, by the spread of ln |lambda|."""


@dataclass(frozen=True)
class Floquet:
    """growth_rate ``(rows, P)``: the largest real part of the characteristic exponents, 1/time, without rigid-body
    modes; exactly 0 where a conservative system is stable.
    stable ``(rows, P)`` int8: 1, 0, or -1 where nothing could be computed.
    status ``(rows, P)`` int16: bits of STATUS_FLAGS.
    exponents ``(rows, P, 2n)`` complex or None: all characteristic exponents ln(lambda)/T over the common period T,
    rigid-body modes included, imaginary parts in (-pi/T, pi/T], by descending real part.
    kernel: which kernel ran.
    """

    growth_rate: Array
    stable: Array
    status: Array
    exponents: Array | None
    kernel: str


def solve(system: GearSystem, mesh_frequency: Array, exponents: bool = False, reduction: bool = True) -> Floquet:
    """Stability of every row of a system at every mesh frequency of the first mesh.

    The monodromy matrix over the common period of all meshes is the exact product of the segments' propagators.
    Points are decided as :mod:`~gearstab.floquet.invariants` and :mod:`~gearstab.floquet.decision` say. Parts of
    the system that the meshes do not couple are solved one by one (:mod:`~gearstab.floquet.blocks`).

    Parameters
    ----------
    system: any batch shape; the result has one row for each entry of the flattened batch.
    mesh_frequency: Omega, ``(P,)`` for all rows or ``(rows, P)``, rad per unit time, positive.
    exponents: whether to compute all characteristic exponents too (slower).
    reduction: False to treat every system as a whole (slower, for comparison).
    """
    rows = int(np.prod(system.batch, dtype=int))
    omega = np.atleast_1d(np.asarray(mesh_frequency, dtype=float))
    omega = np.broadcast_to(omega, (rows, omega.shape[-1]))
    growth = np.full(omega.shape, -np.inf)
    stable = np.ones(omega.shape, dtype=np.int8)
    status = np.zeros(omega.shape, dtype=np.int16)
    table = _Exponents(omega.shape, 2 * system.size) if exponents else None
    for pattern in prepare(system):
        for block in split(pattern) if reduction else [whole(pattern)]:
            index = block.pattern.rows
            part = _Part(block.pattern, omega[index] / block.pattern.elastic.rate[:, None])
            found = _solved(part, block, exponents)
            growth[index] = np.maximum(growth[index], found[0])
            stable[index] = np.minimum(stable[index], found[1])
            status[index] |= found[2]
            if table is not None and found[3] is not None:
                table.add(block, found[3])
    failed = ~np.isfinite(growth)
    stable[failed] = -1
    status[failed] |= STATUS_FLAGS["failed"]
    growth[failed] = np.nan
    return Floquet(growth, stable, status, None if table is None else table.ordered(), kernel.name())


class _Exponents:
    """The exponents of all rows, gathered block by block."""

    def __init__(self, shape: tuple[int, ...], count: int) -> None:
        self.values = np.full((*shape, count), np.nan, dtype=complex)
        self.filled = np.zeros(shape[0], dtype=int)

    def add(self, block: Block, elastic: Array) -> None:
        """Those of a block ``(r, P, k)``, once for each copy, and the exactly known ones of its rigid-body modes."""
        rows, known = block.pattern.rows, block.pattern.elastic.rigid_exponents
        known = np.broadcast_to(known[:, None, :], (*elastic.shape[:2], known.shape[-1]))
        every = np.concatenate([np.tile(elastic, block.copies), known.astype(complex)], axis=-1)
        place = self.filled[rows, None] + np.arange(every.shape[-1])
        self.values[rows[:, None], :, place] = np.swapaxes(every, 1, 2)
        self.filled[rows] += every.shape[-1]

    def ordered(self) -> Array:
        """By descending real and imaginary part."""
        order = np.lexsort((-self.values.imag, -self.values.real), axis=-1)
        return np.take_along_axis(self.values, order, axis=-1)


@dataclass(frozen=True)
class _Part:
    """A pattern and its mesh frequencies ``(r, P)`` in the pattern's units."""

    pattern: Pattern
    omega: Array

    @property
    def period(self) -> Array:
        """Common period, ``(r, P)``, units of 1/rate."""
        return 2 * np.pi * self.pattern.cycles / self.omega

    def status(self) -> Array:
        """Status bits that hold for whole rows."""
        negative = np.any(self.pattern.stiffness_below_zero, axis=(1, 2))
        bit = np.where(negative, STATUS_FLAGS["negative_stiffness"], 0).astype(np.int16)
        return np.repeat(bit[:, None], self.omega.shape[1], axis=1)


_Solution = tuple[Array, Array, Array, Array | None]
"""growth rate, stable, status and the elastic exponents, all in the system's own units of time."""


def _solved(part: _Part, block: Block, exponents: bool) -> _Solution:
    """A block, without its copies. A constant one without stiffness along a mode is left to the general rules."""
    damping = part.pattern.elastic.damping
    decided = damping is not None or bool(np.all(part.pattern.squared_frequency > 0))
    if block.constant and part.pattern.size and decided:
        return _constant(part, exponents)
    return _conservative(part, exponents) if damping is None else _damped(part, damping, exponents)


def _constant(part: _Part, exponents: bool) -> _Solution:
    """A block whose stiffness does not vary: its exponents are those of a constant system, at every mesh frequency."""
    pattern = part.pattern
    rate = pattern.elastic.rate[:, None]
    if pattern.elastic.damping is None:
        frequency = np.sqrt(pattern.squared_frequency[:, 0])
        values = 1j * np.concatenate([frequency, -frequency], axis=1) - pattern.elastic.shift[:, None]
    else:
        values = damped.generators(pattern, pattern.elastic.damping).eigen[0][:, 0]
    growth = np.repeat(values.real.max(axis=1, initial=-np.inf)[:, None], part.omega.shape[1], axis=1)
    stable = (growth * part.period <= DAMPED_ON_CIRCLE).astype(np.int8)
    table = None
    if exponents:
        turns = values.imag[:, None, :] * part.period[..., None] / (2 * np.pi)
        turns -= np.ceil(turns - 0.5)
        imaginary = 2 * np.pi * turns / part.period[..., None]
        table = (values.real[:, None, :] + 1j * imaginary) * rate[..., None]
    return growth * rate, stable, part.status(), table


def _conservative(part: _Part, exponents: bool) -> _Solution:
    pattern, omega = part.pattern, part.omega
    verdict, growth = kernel.current().scan(pattern, omega)
    status = part.status()
    for rows, points in _pieces(verdict == DOUBTFUL, pattern.size):
        found = _settle(pattern, rows, omega[rows, points])
        verdict[rows, points], growth[rows, points] = found[0], found[1]
        status[rows, points] |= found[2]
    shift, rate = pattern.elastic.shift[:, None], pattern.elastic.rate[:, None]
    value = growth / part.period
    # Without damping the verdict decides; with uniform damping a growth below the decay is stable.
    stable = np.where(shift == 0, verdict == STABLE, value <= shift).astype(np.int8)
    table = None
    if exponents:
        logs = _conservative_logs(pattern, omega)
        logs = np.where((verdict == STABLE)[..., None], 1j * logs.imag, logs)
        table = (logs / part.period[..., None] - shift[..., None]) * rate[..., None]
    return (value - shift) * rate, stable, status, table


def _pieces(chosen: Array, size: int) -> Iterator[tuple[Array, Array]]:
    """(row, point) of all chosen points, in pieces whose monodromy matrices fit in memory."""
    rows, points = np.nonzero(chosen)
    step = max(1, ENTRIES_AT_ONCE // (2 * size) ** 2)
    for i in range(0, len(rows), step):
        yield rows[i : i + step], points[i : i + step]


def _settle(pattern: Pattern, rows: Array, omega: Array) -> tuple[Array, Array, Array]:
    """(verdict, growth, status bits) of points in doubt ``(P,)``, from their monodromy matrices."""
    matrix, scale = kernel.current().monodromy(pattern, rows, omega)
    status = np.full(len(omega), STATUS_FLAGS["eigenvalues"], dtype=np.int16)
    finite = np.isfinite(matrix).all(axis=(1, 2))
    matrix = np.where(finite[:, None, None], matrix, 0.0)
    stable, growth, krein = decision.conservative(matrix)
    large = scale > 0
    with np.errstate(divide="ignore"):
        growth[large] = np.log(np.abs(np.linalg.eigvals(matrix[large])).max(axis=-1)) + scale[large]
    status[krein & ~large] |= STATUS_FLAGS["krein"]
    status[large] |= STATUS_FLAGS["rescaled"]
    growth[~finite] = np.nan
    return (stable & ~large).astype(np.int8), growth, status


def _conservative_logs(pattern: Pattern, omega: Array) -> Array:
    """ln lambda ``(r, P, 2n)``; the product is formed only where that costs no digits."""
    logs = kernel.current().log_multipliers(pattern, omega, GRADED_NORM)
    for row, wide in _chains(np.isnan(logs).any(axis=2), pattern):
        logs[row, wide] = graded.log_multipliers(numpy_kernel.factors(pattern, row, omega[row, wide]))
    return logs


def _chains(chosen: Array, pattern: Pattern) -> Iterator[tuple[int, Array]]:
    """(row, points) of all chosen points ``(r, P)``, in pieces of which all factors of the product fit in memory."""
    step = max(1, ENTRIES_AT_ONCE // (len(pattern.states) * (2 * pattern.size) ** 2))
    for row in np.flatnonzero(chosen.any(axis=1)):
        points = np.flatnonzero(chosen[row])
        for i in range(0, len(points), step):
            yield int(row), points[i : i + step]


def _damped(part: _Part, damping: Array, exponents: bool) -> _Solution:
    pattern, omega = part.pattern, part.omega
    generator = damped.generators(pattern, damping)
    growth, scale = kernel.current().scan_damped(pattern, generator, omega)
    status = part.status()
    status[np.abs(scale) > np.log(numpy_kernel.LARGE)] |= STATUS_FLAGS["rescaled"]
    stable = (growth <= DAMPED_ON_CIRCLE).astype(np.int8)
    rate, table = pattern.elastic.rate[:, None], None
    if exponents:
        logs = np.stack([_damped_logs(pattern, generator, r, omega[r]) for r in range(len(omega))])
        table = logs / part.period[..., None] * rate[..., None]
    return growth / part.period * rate, stable, status, table


def _damped_logs(pattern: Pattern, generator: damped.Generators, row: int, omega: Array) -> Array:
    """ln lambda ``(P, m)`` of one row; the product is formed only where that costs no digits."""
    matrix, scale = damped.monodromy(generator, pattern, row, omega)
    finite = np.isfinite(matrix).all(axis=(1, 2))
    values = np.linalg.eigvals(np.where(finite[:, None, None], matrix, 0.0)).astype(complex)
    with np.errstate(divide="ignore"):
        logs = np.log(values) + scale[:, None]
    wide = logs.real.max(axis=-1) - logs.real.min(axis=-1) > GRADED_SPREAD
    for _, points in _chains(wide[None], pattern):
        chain, growing = damped.factors(generator, pattern, row, omega[points], spread=1.0)
        logs[points] = graded.log_multipliers(chain) + growing[:, None]
    return logs
