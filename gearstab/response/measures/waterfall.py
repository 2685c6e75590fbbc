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
    """Compute the amplitudes of a run-up; None for fewer than ``SHORTEST`` samples and what outgrows its squares.

    A window is as long as the speed needs to change by what the window resolves, ``T = sqrt(2 pi/|dOmega/dt|)``: a
    longer one would smear the first harmonic of the mesh frequency, a shorter one tells frequencies apart less well.
    Spectra are those of :func:`scipy.signal.spectrogram`; harmonics s are followed with the phase theta(t) of the first
    mesh, which is known, and so are not smeared at any rate:

        a_s = 2 |sum_k w_k [F_k - mean] exp(-i s r theta_k)| / sum_k w_k.
    """
    from scipy.signal import spectrogram
    from scipy.signal.windows import hann

    time, speed = found.time, found.mesh_frequency
    if len(time) < SHORTEST or not np.abs(found.mesh_force).max() < LARGEST:
        return None
    step = float(time[1] - time[0])
    rate = float(speed[-1] - speed[0]) / float(time[-1])
    count = int(np.clip(np.sqrt(tau / abs(rate)) / step, SHORTEST, len(time)))
    hop = max(1, count // 4, -(-(len(time) - count) // MOST_MOMENTS))
    hertz, middle, power = spectrogram(
        found.mesh_force.T, 1 / step, "hann", count, count - hop, detrend="constant", scaling="spectrum"
    )  # fmt: skip
    ratios = np.array([float(mesh.frequency_ratio) for mesh in system.whole_meshes])
    shown = tau * hertz <= MOST_ORDERS * ratios.max() * speed.max()
    window = hann(count, sym=False)
    theta = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * step)])
    turns = theta[:, None, None] * ratios * np.arange(1, HARMONICS + 1)[:, None]
    harmonics = np.empty((len(middle), HARMONICS, len(ratios)))
    for k in range(len(middle)):
        own = slice(k * hop, k * hop + count)
        force = found.mesh_force[own] - found.mesh_force[own].mean(axis=0)
        weighted = window[:, None, None] * force[:, None] * np.exp(-1j * turns[own])
        harmonics[k] = 2 * np.abs(weighted.sum(axis=0)) / window.sum()
    spectrum = np.sqrt(2 * np.moveaxis(power, 0, -1)).swapaxes(0, 1)[:, shown]
    return Waterfall(middle, np.interp(middle, time, speed), count * step, tau * hertz[shown], spectrum, harmonics)
