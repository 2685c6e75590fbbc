"""Steady states over the mesh frequency: peaks, root mean squares and load factors, many operating points at once.

Where the common period of several frequencies is long, or there is none, forces are bounded one frequency at a time:
what varies or drives with a frequency makes the force of a mesh deviate from the static one, and to first order in the
variations the deviations of all frequencies add up. Their largest values need not coincide.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from math import ceil

import numpy as np

from gearstab.errors import NotPossible
from gearstab.floquet.frequencies import FrequencyGroup, alone, groups
from gearstab.interrupts import heed
from gearstab.modal import mean_modes, static_mesh_force
from gearstab.response.loads import ConnectionForces, Contact, ForceMeter, contact
from gearstab.response.panels import COARSE, PanelSamples, mesh_gauges, readings, samples
from gearstab.response.steady import STATUS_FLAGS, SteadyStart, starts
from gearstab.system import Array, GearSystem
from gearstab.waveforms import Fourier

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
    status: ``(rows, P)``, bits of :data:`gearstab.response.steady.STATUS_FLAGS`.
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
        meshes = _MeshMeter(begin, pairs.chosen(row), static.shape[1])
        loads = None if held is None else ForceMeter(system, begin)
        with np.errstate(over="ignore", invalid="ignore"):
            _follow(begin, samples_per_cycle, meshes, loads)
            table[:, row, column], flags = meshes.found(static[row])
            if held is not None and loads is not None:
                held.put(row, column, loads.found(), flags & STATUS_FLAGS["failed"] != 0)
        status[row, column] = flags
    scale = np.where(static != 0, np.abs(static), np.nan)[:, None]
    peak, mean, spread, span, error, least, harmonic, fewest, tooth = table
    factors = (peak / scale, fewest / scale, tooth / scale)
    return SpeedResponse(peak, mean, spread, span, error, least, harmonic, *factors, status, held)


class _MeshMeter:
    """Measures of mesh forces and deflections, from one part of the common period after the other."""

    def __init__(self, begin: SteadyStart, pairs: Contact, meshes: int) -> None:
        shape = (len(begin.x), meshes)
        self.begin, self.pairs = begin, pairs
        self.cycles = np.array(begin.points.excitation.counts[:meshes])
        self.low, self.high = np.full((2, *shape), np.inf), np.full((2, *shape), -np.inf)
        # Deviations from a value of the motion itself: a small fluctuation of a large force keeps its digits.
        self.origin: Array | None = None
        self.first, self.second, self.rough = np.zeros((3, 2, *shape))
        self.fewest, self.more = np.full((2, *shape), -np.inf)
        self.doubt = np.zeros((2, *shape))
        self.harmonic = np.zeros(shape, dtype=complex)

    def add(self, piece: PanelSamples) -> None:
        """Take a part of the common period into account."""
        values = np.stack([piece.force, piece.deflection], axis=4)
        self.origin = values[0, 0, 0] if self.origin is None else self.origin
        least, greatest, off = (np.moveaxis(part, 2, 0) for part in piece.extremes())
        self.low, self.high = np.minimum(self.low, least.min(axis=1)), np.maximum(self.high, greatest.max(axis=1))
        self.doubt = np.maximum(self.doubt, off.max(axis=1))
        # Pairs enter and leave between intervals, so that the middle of one tells.
        few = self.pairs.fewest(piece.middle[..., None] * self.cycles)
        largest = np.maximum(np.abs(least[0]), np.abs(greatest[0]))
        self.fewest = np.maximum(self.fewest, np.where(few, largest, -np.inf).max(axis=0))
        self.more = np.maximum(self.more, np.where(few, -np.inf, largest).max(axis=0))
        self.harmonic += 2 * piece.mean(np.exp(-2j * np.pi * piece.tau[..., None] * self.cycles) * piece.deflection)
        values = values - self.origin
        self.first += np.moveaxis(piece.mean(values), 1, 0)
        self.second += np.moveaxis(piece.mean(values**2), 1, 0)
        self.rough += np.moveaxis(piece.mean(values**2, COARSE), 1, 0)

    def found(self, static: Array) -> tuple[Array, Array]:
        """Return the measures ``(9, K, meshes)``, the last two of the forces of the last two factors, and flags."""
        assert self.origin is not None
        low, high = self.low, self.high
        variance = np.maximum(self.second - self.first**2, 0.0)
        peak = np.maximum(np.abs(low[0]), np.abs(high[0]))
        mean = np.moveaxis(self.origin, 1, 0)[0] + self.first[0]
        status = self.begin.status.copy()
        parting = np.any(np.where(static > 0, low[0] < 0, (static < 0) & (high[0] > 0)), axis=1)
        blurred = np.abs(self.rough - self.second)[0] > UNRESOLVED * variance[0] + (STEADY * peak) ** 2
        least = DOUBTFUL * (high - low) + STEADY * np.maximum(np.abs(low), np.abs(high))
        blurred |= np.any(self.doubt > least, axis=0)
        status[parting] |= STATUS_FLAGS["separation"]
        status[np.any(blurred, axis=1)] |= STATUS_FLAGS["unresolved"]
        measures = np.stack([
            peak, mean, np.sqrt(variance[0]), high[1] - low[1], np.sqrt(variance[1]), low[0], np.abs(self.harmonic),
            *_by_pairs(self.fewest, self.more, self.pairs.pairs),
        ])  # fmt: skip
        failed = ~np.isfinite(measures[:7]).all(axis=(0, 2))
        status[failed] |= STATUS_FLAGS["failed"]
        measures[:, failed] = np.nan
        return measures, status


def _follow(begin: SteadyStart, samples_per_cycle: int, meshes: _MeshMeter, loads: ForceMeter | None) -> None:
    """Follow steady states through their common period, once for all meters."""
    panels = samples_per_cycle * begin.points.excitation.counts[0] / 4
    gauges = mesh_gauges(begin.points)
    own = gauges.shape[1]
    if loads is not None:
        gauges = np.concatenate([gauges, loads.gauges], axis=1)
    for piece in readings(begin.points, begin.x, gauges, panels):
        heed()
        meshes.add(samples(piece.of(0, own)))
        if loads is not None:
            loads.add(piece.of(own))


def _by_pairs(fewest: Array, more: Array, pairs: Array) -> tuple[Array, Array]:
    """The largest mesh force while the fewest pairs carry, and the largest load of a pair, ``(K, meshes)``.

    fewest, more: the largest mesh forces with the fewest pairs and with one more, -inf where that never is.
    """
    known = np.isfinite(pairs)
    tooth = np.maximum(fewest / pairs, more / (pairs + 1))
    return np.where(known, fewest, np.nan), np.where(known, tooth, np.nan)


SAMPLES = 4
"""Samples per period of the fastest mode, between which a polynomial of degree nine gives the extremes."""
MOST_SAMPLES = 8000
"""Largest number of samples per period of a mesh."""


@dataclass(frozen=True)
class ForceBounds:
    """Mesh forces in the sense of the static ones, ``(rows, P, meshes)``, by the sums of all deviations from these.

    static: ``(rows, meshes)``, at least 0.
    """

    static: Array
    least: Array
    greatest: Array

    @property
    def load_factor(self) -> Array:
        """The greatest force over the static one, NaN where that is 0."""
        static = np.where(self.static > 0, self.static, np.nan)[:, None]
        return np.maximum(self.greatest, -self.least) / static


def force_bounds(system: GearSystem, mesh_frequency: Array) -> ForceBounds:
    """Bound the mesh forces of every row of a system at mesh frequencies ``(P,)`` of the first mesh."""
    system = _oriented(system.over(system.batch))
    static = system.flat(static_mesh_force(system), 1)
    omega = np.asarray(mesh_frequency, dtype=float)
    least = np.tile(static[:, None], (1, len(omega), 1))
    greatest = least.copy()
    fastest = float(np.nanmax(mean_modes(system).natural_frequency))
    for one, ratio in _driven_apart(system):
        samples = int(np.clip(ceil(SAMPLES * fastest / (ratio * omega.min())), 100, MOST_SAMPLES))
        found = speed_response(one, ratio * omega, samples)
        least -= static[:, None] - found.mesh_force_min
        greatest += found.mesh_force_peak - static[:, None]
    return ForceBounds(static, least, greatest)


def _oriented(system: GearSystem) -> GearSystem:
    """The system with the direction of every mesh such that its static force is not negative."""
    forces, names = static_mesh_force(system), [mesh.name for mesh in system.whole_meshes]
    meshes = []
    for mesh in system.meshes:
        # A part turns with its mesh.
        sense = np.where(forces[..., names.index(mesh.part_of or mesh.name)] < 0, -1.0, 1.0)[..., None]
        error = mesh.transmission_error
        if error is not None:
            error = _times(error, sense)
        turns = tuple(replace(one, profile=_times(one.profile, sense)) for one in mesh.revolution_errors)
        direction = mesh.direction * sense
        meshes.append(replace(mesh, direction=direction, transmission_error=error, revolution_errors=turns))
    return replace(system, meshes=tuple(meshes))


def _times(wave: Fourier, sense: Array) -> Fourier:
    """Return a series with a sign."""
    return replace(wave, sin=wave.sin * sense, cos=wave.cos * sense)


def _driven_apart(system: GearSystem) -> Iterator[tuple[GearSystem, float]]:
    """The system with what varies and drives with each frequency alone, and that frequency over Omega."""
    ratios = {group.ratio: group for group in groups(system)}
    ratios |= {f.frequency_ratio: FrequencyGroup(f.name, f.frequency_ratio) for f in system.forces}
    ratios |= {
        one.frequency_ratio: FrequencyGroup(one.name, one.frequency_ratio)
        for mesh in system.meshes for one in mesh.revolution_errors if one.frequency_ratio not in ratios
    }  # fmt: skip
    for ratio, group in ratios.items():
        meshes = tuple(
            replace(
                mesh, transmission_error=mesh.transmission_error if mesh.frequency_ratio == ratio else None,
                revolution_errors=tuple(
                    replace(one, frequency_ratio=Fraction(1))
                    for one in mesh.revolution_errors if one.frequency_ratio == ratio
                ),
            )
            for mesh in system.meshes
        )  # fmt: skip
        forces = tuple(
            replace(force, frequency_ratio=Fraction(1)) for force in system.forces if force.frequency_ratio == ratio
        )
        yield alone(replace(system, meshes=meshes, forces=forces), group), float(ratio)
