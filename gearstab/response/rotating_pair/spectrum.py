"""Power spectral density of a history and its largest peaks."""

from __future__ import annotations

from dataclasses import dataclass
from math import tau

import numpy as np

from gearstab.system import Array

SHORTEST = 8
"""Samples that a spectrum needs."""


@dataclass(frozen=True)
class Spectrum:
    """One-sided power spectral density: the variance of the history is its integral over the frequency.

    frequency: ``(F,)`` rad/s. density: ``(F,)``, squared units of the history per rad/s.
    peaks: indices of the largest local maxima, the largest first.
    """

    frequency: Array
    density: Array
    peaks: Array

    @property
    def resolution(self) -> float:
        """From frequency to frequency."""
        return float(self.frequency[1] - self.frequency[0])


def spectrum(history: Array, step: float, window: str = "hann", most_peaks: int = 20) -> Spectrum:
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
