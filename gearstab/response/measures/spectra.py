"""Spectra of histories, of mesh forces and deflections above all, and their largest peaks."""

from __future__ import annotations

from dataclasses import dataclass
from math import tau
from typing import TYPE_CHECKING

import numpy as np

from gearstab.system import Array

if TYPE_CHECKING:
    from gearstab.response.linear.history import Response
    from gearstab.response.linear.periodic import Harmonics

SHORTEST = 8
"""Samples that a spectrum needs."""
SAME_DIGITS = 8
"""Peaks that differ by less, relative, are taken for equal."""
MOST_PEAKS = 20
LARGEST = 1e140
"""Histories beyond this have no finite power spectral density."""


@dataclass(frozen=True)
class Spectrum:
    """One-sided power spectral density: the variance of the history is its integral over the frequency.

    frequency: ``(F,)`` rad/s. density: ``(F,)``, squared units of the history per rad/s.
    peaks: indices of the largest local maxima, the largest first.
    """

    frequency: Array
    density: Array
    peaks: Array


def spectrum(history: Array, step: float, window: str = "hann", most_peaks: int = MOST_PEAKS) -> Spectrum:
    """The periodogram of a history in equal steps, without its mean (scipy.signal.periodogram).

    window: hann, for histories that do not repeat themselves exactly; boxcar for whole periods.
    Raises ValueError for fewer than ``SHORTEST`` samples.
    """
    from scipy.signal import find_peaks, periodogram

    if len(history) < SHORTEST:
        raise ValueError(f"a spectrum needs {SHORTEST} samples or more")
    hertz, density = periodogram(history, fs=1 / step, window=window, detrend="constant")
    found, _ = find_peaks(density)
    order = np.argsort(-density[found], kind="stable")[:most_peaks]
    return Spectrum(tau * hertz, density / tau, found[order])


@dataclass(frozen=True)
class Spectra:
    """Values of all meshes over the frequency: power spectral densities, or amplitudes of harmonics.

    frequency: ``(F,)`` rad/s. force, deflection: ``(F, meshes)``.
    peak_index, peak_mesh: ``(peaks,)``, where the largest local maxima of ``force`` are, the largest first.
    """

    frequency: Array
    force: Array
    deflection: Array
    peak_index: Array
    peak_mesh: Array


def densities(found: Response) -> Spectra | None:
    """One-sided power spectral densities of a history without its mean, per rad/s (periodogram with a Hann window).

    None for fewer than ``SHORTEST`` samples and for histories that grow beyond what can be squared.
    """
    if len(found.time) < SHORTEST or not np.abs(found.mesh_force).max() < LARGEST:
        return None
    step = float(found.time[1] - found.time[0])
    columns = [[spectrum(part, step) for part in values.T] for values in (found.mesh_force, found.mesh_deflection)]
    force, deflection = (np.stack([each.density for each in part], axis=-1) for part in columns)
    places = [(index, mesh) for mesh, each in enumerate(columns[0]) for index in each.peaks]
    return _ordered(columns[0][0].frequency, force, deflection, places)


def amplitudes(found: Harmonics) -> Spectra:
    """Amplitudes of the harmonics of a steady state; the mean stands at frequency 0."""
    force, deflection = np.abs(found.mesh_force), np.abs(found.mesh_deflection)
    places = [
        (index, mesh) for mesh in range(force.shape[1]) for index in range(1, len(force)) if force[index, mesh] > 0
    ]
    return _ordered(found.frequency, force, deflection, places)


def _ordered(frequency: Array, force: Array, deflection: Array, places: list[tuple[int, int]]) -> Spectra:
    index, mesh = np.array(places, dtype=int).reshape(-1, 2).T
    # Meshes that are alike have peaks that only rounding tells apart: the first is named first.
    height = np.round(np.log(np.maximum(force[index, mesh], np.finfo(float).tiny)), SAME_DIGITS)
    largest = np.argsort(-height, kind="stable")[:MOST_PEAKS]
    return Spectra(frequency, force, deflection, index[largest], mesh[largest])
