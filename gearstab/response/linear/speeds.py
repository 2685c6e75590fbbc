"""Steady states over the mesh frequency: peaks, root mean squares and load factors, many operating points at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.errors import NotPossible
from gearstab.interrupts import heed
from gearstab.response.linear.equilibrium import static_mesh_force
from gearstab.response.linear.steady import STATUS_FLAGS, SteadyStart, starts
from gearstab.response.measures.connections import ConnectionForces, forces
from gearstab.response.measures.pairs_in_contact import Contact, contact
from gearstab.response.measures.panels import COARSE, pieces
from gearstab.system import Array, GearSystem

UNRESOLVED = 0.02
"""Relative difference of two integration rules for a mean square beyond which the samples are too few."""
DOUBTFUL = 2e-3
"""Part of the peak-to-peak value by which values without derivatives may miss a curve: with them it is some 1e-8."""
STEADY = 1e-12
"""Fluctuations below this part of a force are rounding."""


@dataclass(frozen=True)
class SpeedResponse:
    """Measures of the steady state at every point, ``(rows, P, meshes)`` but for ``status``.

    mesh_force_peak: the largest |k_i (g_i^T q - e_i)| over the common period.
    mesh_force_mean, mesh_force_rms: its mean, and the root mean square of its deviation from the mean.
    transmission_error_peak_to_peak, transmission_error_rms: of g_i^T q, the latter about its mean.
    mesh_force_min: the least k_i (g_i^T q - e_i).
    transmission_error_first_harmonic: amplitude of g_i^T q at the mesh's own frequency.
    dynamic_load_factor: mesh_force_peak over the static mesh force; NaN where that is 0.
    load_factor_fewest_pairs: as dynamic_load_factor, while the fewest pairs of teeth carry. The whole mesh force jumps
        up as a pair enters, with the stiffness, which no single tooth feels.
    tooth_load_factor: the largest load of one pair of teeth over the static mesh force, pairs in contact sharing the
        mesh force equally. Both NaN where the contact ratio is not known.
    status: ``(rows, P)``, bits of :data:`gearstab.response.linear.steady.STATUS_FLAGS`.
    connections: forces of bearings and shafts, each ``(rows, P, ...)``, None unless wanted.
    """

    mesh_force_peak: Array
    mesh_force_mean: Array
    mesh_force_rms: Array
    transmission_error_peak_to_peak: Array
    transmission_error_rms: Array
    mesh_force_min: Array
    transmission_error_first_harmonic: Array
    dynamic_load_factor: Array
    load_factor_fewest_pairs: Array
    tooth_load_factor: Array
    status: Array
    connections: ConnectionForces | None = None


def speed_response(
    system: GearSystem, mesh_frequency: Array, samples_per_cycle: int = 100, tolerance: float = 1e-9,
    connected: bool = False,
) -> SpeedResponse:  # fmt: skip
    """Steady states of every row of a system at every mesh frequency.

    Parameters
    ----------
    system: any batch shape; the result has one row for each entry of the flattened batch.
    mesh_frequency: Omega, ``(P,)`` for all rows or ``(rows, P)``, positive.
    samples_per_cycle: about so many samples in a period of the first mesh; extremes are those of polynomials of
        degree nine through every five of them and their derivatives, and right to 1e-7 where nothing is unresolved.
    tolerance: of the map over a period where functions vary smoothly, relative.
    connected: whether forces of bearings and shafts are wanted, too, of a system that has any.

    Raises
    ------
    NotPossible: nothing drives the system, or there is no common period.
    """
    if not system.forced:
        raise NotPossible("nothing drives the system: give a load, forces or transmission errors")
    omega = system.operating_points(mesh_frequency)
    static = system.flat(static_mesh_force(system), 1)
    pairs = contact(system)
    table = np.full((9, *omega.shape, len(system.whole_meshes)), np.nan)
    status = np.zeros(omega.shape, dtype=np.int16)
    held = ConnectionForces.empty(system, omega.shape) if connected else None
    for row, column, begin in starts(system, omega, tolerance, samples_per_cycle):
        part = Contact(pairs.begin[row], pairs.pairs[row], pairs.lag[row])
        found, flags = _measured(begin, static[row], part, samples_per_cycle)
        table[:, row, column] = found
        status[row, column] = flags
        if held is not None:
            panels = samples_per_cycle * begin.points.excitation.counts[0] / 4
            held.put(row, column, forces(system, begin, panels), flags & STATUS_FLAGS["failed"] != 0)
    scale = np.where(static != 0, np.abs(static), np.nan)[:, None]
    peak, mean, spread, span, error, least, harmonic, fewest, tooth = table
    factors = (peak / scale, fewest / scale, tooth / scale)
    return SpeedResponse(peak, mean, spread, span, error, least, harmonic, *factors, status, held)


def _measured(begin: SteadyStart, static: Array, pairs: Contact, samples_per_cycle: int) -> tuple[Array, Array]:
    """The measures ``(9, K, meshes)``, the last two the forces of the last two factors, and the flags ``(K,)``."""
    count, meshes = len(begin.x), static.shape[1]
    panels = samples_per_cycle * begin.points.excitation.counts[0] / 4
    low, high = np.full((2, count, meshes), np.inf), np.full((2, count, meshes), -np.inf)
    # Deviations from a value of the motion itself: a small fluctuation of a large force keeps its digits.
    origin: Array | None = None
    first, second, rough = np.zeros((3, 2, count, meshes))
    fewest, more = np.full((2, count, meshes), -np.inf)
    doubt = np.zeros((2, count, meshes))
    harmonic = np.zeros((count, meshes), dtype=complex)
    cycles = np.array(begin.points.excitation.counts[:meshes])
    with np.errstate(over="ignore", invalid="ignore"):
        for piece in pieces(begin.points, begin.x, panels):
            heed()
            values = np.stack([piece.force, piece.deflection], axis=4)
            if origin is None:
                origin = values[0, 0, 0]
            ends = piece.extremes()
            least, greatest, off = (np.moveaxis(part, 2, 0) for part in ends)
            low, high = np.minimum(low, least.min(axis=1)), np.maximum(high, greatest.max(axis=1))
            doubt = np.maximum(doubt, off.max(axis=1))
            # Pairs enter and leave between intervals, so that the middle of one tells.
            few = pairs.fewest(piece.middle[..., None] * cycles)
            largest = np.maximum(np.abs(least[0]), np.abs(greatest[0]))
            fewest = np.maximum(fewest, np.where(few, largest, -np.inf).max(axis=0))
            more = np.maximum(more, np.where(few, -np.inf, largest).max(axis=0))
            harmonic += 2 * piece.mean(np.exp(-2j * np.pi * piece.tau[..., None] * cycles) * piece.deflection)
            values = values - origin
            first += np.moveaxis(piece.mean(values), 1, 0)
            second += np.moveaxis(piece.mean(values**2), 1, 0)
            rough += np.moveaxis(piece.mean(values**2, COARSE), 1, 0)
        assert origin is not None
        variance = np.maximum(second - first**2, 0.0)
        peak = np.maximum(np.abs(low[0]), np.abs(high[0]))
    mean = np.moveaxis(origin, 1, 0)[0] + first[0]
    status = begin.status.copy()
    parting = np.any(np.where(static > 0, low[0] < 0, (static < 0) & (high[0] > 0)), axis=1)
    blurred = np.abs(rough - second)[0] > UNRESOLVED * variance[0] + (STEADY * peak) ** 2
    blurred |= np.any(doubt > DOUBTFUL * (high - low) + STEADY * np.maximum(np.abs(low), np.abs(high)), axis=0)
    status[parting] |= STATUS_FLAGS["separation"]
    status[np.any(blurred, axis=1)] |= STATUS_FLAGS["unresolved"]
    found = np.stack([
        peak, mean, np.sqrt(variance[0]), high[1] - low[1], np.sqrt(variance[1]), low[0], np.abs(harmonic),
        *_by_pairs(fewest, more, pairs.pairs),
    ])  # fmt: skip
    failed = ~np.isfinite(found[:7]).all(axis=(0, 2))
    status[failed] |= STATUS_FLAGS["failed"]
    found[:, failed] = np.nan
    return found, status


def _by_pairs(fewest: Array, more: Array, pairs: Array) -> tuple[Array, Array]:
    """The largest mesh force while the fewest pairs carry, and the largest load of a pair, ``(K, meshes)``.

    fewest, more: the largest mesh forces with the fewest pairs and with one more, -inf where that never is.
    """
    known = np.isfinite(pairs)
    tooth = np.maximum(fewest / pairs, more / (pairs + 1))
    return np.where(known, fewest, np.nan), np.where(known, tooth, np.nan)
