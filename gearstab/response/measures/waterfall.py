"""Mesh forces of a run-up as the speed changes: their amplitudes over the frequency, and harmonic by harmonic."""

from __future__ import annotations

from dataclasses import dataclass
from math import tau

import numpy as np

from gearstab.response.linear.ramp import RampResponse
from gearstab.response.measures.spectra import LARGEST
from gearstab.system import Array, GearSystem

HARMONICS = 8
"""Harmonics of each mesh that are followed."""
MOST_MOMENTS = 400
"""Windows at most, which overlap by three quarters where that is fewer."""
MOST_ORDERS = 20
"""The frequencies end at this multiple of the highest mesh frequency."""
SHORTEST = 32
"""Samples of a window at least."""


@dataclass(frozen=True)
class Windows:
    """Windows of Hann along a run-up.

    count, hop: samples of a window, and from the beginning of one to that of the next. step: seconds between samples.
    theta: ``(samples,)``, phase of Omega.
    """

    count: int
    hop: int
    step: float
    theta: Array

    @classmethod
    def of(cls, found: RampResponse) -> Windows | None:
        """Return the windows of a run-up; None for fewer than ``SHORTEST`` samples and what outgrows its squares.

        A window is as long as the speed needs to change by what the window resolves, ``T = sqrt(2 pi/|dOmega/dt|)``: a
        longer one would smear the first harmonic of the mesh frequency, a shorter one tells frequencies apart less
        well.
        """
        time, speed = found.time, found.mesh_frequency
        if len(time) < SHORTEST or not np.abs(found.mesh_force).max() < LARGEST:
            return None
        step = float(time[1] - time[0])
        rate = float(speed[-1] - speed[0]) / float(time[-1])
        count = int(np.clip(np.sqrt(tau / abs(rate)) / step, SHORTEST, len(time)))
        hop = max(1, count // 4, -(-(len(time) - count) // MOST_MOMENTS))
        theta = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * step)])
        return cls(count, hop, step, theta)

    def harmonics(self, signal: Array, orders: Array) -> Array:
        """Amplitudes ``(W, orders, C)`` of signals ``(samples, C)`` at multiples ``(orders, C or 1)`` of Omega.

        Their phase theta is known, so that none is smeared at any rate:

            a_r = 2 |sum_k w_k [F_k - mean] exp(-i r theta_k)| / sum_k w_k.
        """
        from scipy.signal.windows import hann

        window = hann(self.count, sym=False)
        starts = range(0, len(signal) - self.count + 1, self.hop)
        amplitude = np.empty((len(starts), len(orders), signal.shape[1]))
        for k, start in enumerate(starts):
            own = slice(start, start + self.count)
            weighted = window[:, None] * (signal[own] - signal[own].mean(axis=0))
            turned = weighted[:, None] * np.exp(-1j * self.theta[own][:, None, None] * orders)
            amplitude[k] = 2 * np.abs(turned.sum(axis=0)) / window.sum()
        return amplitude


@dataclass(frozen=True)
class Waterfall:
    """Amplitudes in windows of Hann.

    moment, mesh_frequency: ``(W,)``, time and Omega in the middle of each window. width: seconds of a window.
    frequency: ``(F,)``, rad/s. spectrum: ``(W, F, meshes)``, amplitudes of the mesh forces without their mean.
    harmonics: ``(W, HARMONICS, meshes)``, amplitudes at the multiples of each mesh's own frequency of the moment.
    """

    moment: Array
    mesh_frequency: Array
    width: float
    frequency: Array
    spectrum: Array
    harmonics: Array


def waterfall(system: GearSystem, found: RampResponse) -> Waterfall | None:
    """Compute the amplitudes of the mesh forces of a run-up; None without :class:`Windows`.

    Spectra are those of :func:`scipy.signal.spectrogram`.
    """
    from scipy.signal import spectrogram

    windows = Windows.of(found)
    if windows is None:
        return None
    hertz, middle, power = spectrogram(
        found.mesh_force.T, 1 / windows.step, "hann", windows.count, windows.count - windows.hop, detrend="constant",
        scaling="spectrum",
    )  # fmt: skip
    ratios = np.array([float(mesh.frequency_ratio) for mesh in system.whole_meshes])
    shown = tau * hertz <= MOST_ORDERS * ratios.max() * found.mesh_frequency.max()
    harmonics = windows.harmonics(found.mesh_force, ratios * np.arange(1, HARMONICS + 1)[:, None])
    spectrum = np.sqrt(2 * np.moveaxis(power, 0, -1)).swapaxes(0, 1)[:, shown]
    speed = np.interp(middle, found.time, found.mesh_frequency)
    return Waterfall(middle, speed, windows.count * windows.step, tau * hertz[shown], spectrum, harmonics)
