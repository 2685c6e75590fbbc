"""Harmonics of steady states, spectra of histories, their largest peaks, and amplitudes of a run-up over the speed."""

from __future__ import annotations

from dataclasses import dataclass
from math import tau

import numpy as np

from gearstab.response.history import RampResponse, Response
from gearstab.response.panels import WEIGHTS, fastest, pieces
from gearstab.response.steady import STATUS_FLAGS, starts
from gearstab.system import Array, GearSystem

AT_ONCE = 2**11
"""Places at which functions are transformed at once."""
MOST_PANELS = 2**14
"""Most panels of a common period."""
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
class Harmonics:
    """Fourier coefficients of a steady state: its quantities are Re sum_h c_h exp(i nu_h t).

    frequency: ``(H,)``, nu_h = h 2 pi/T from 0 on.
    mesh_force, mesh_deflection: ``(H, meshes)``, complex c_h; |c_h| is the amplitude of a harmonic, c_0 the mean.
    """

    frequency: Array
    mesh_force: Array
    mesh_deflection: Array


def _transformed(tau: Array, values: Array, order: int) -> Array:
    """sum_x exp(-2 pi i h tau_x) values_x for h = 0...order: ``(2, order + 1, meshes)`` from values ``(2, X, meshes)``.

    With h = w a + b the exponential is a product of two, of which there are far fewer.
    """
    count = order + 1
    width = int(np.ceil(np.sqrt(count)))
    found = np.zeros((2, values.shape[2], width, width), dtype=complex)
    for i in range(0, len(tau), AT_ONCE):
        part = slice(i, i + AT_ONCE)
        fine = np.exp(-2j * np.pi * tau[part, None] * np.arange(width))
        coarse = np.exp(-2j * np.pi * tau[part, None] * (width * np.arange(width)))
        for k, mesh in np.ndindex(*found.shape[:2]):
            found[k, mesh] += coarse.T @ (fine * values[k, part, mesh, None])
    return np.swapaxes(found.reshape(*found.shape[:2], -1)[..., :count], 1, 2)


def harmonics(system: GearSystem, mesh_frequency: float, order: int) -> Harmonics:
    """The Fourier coefficients of the steady state up to the given harmonic of the common period.

    Integrals over the intervals between jumps, by Gauss-Lobatto panels so short that the highest harmonic and the
    highest natural frequency turn by less than a radian in one: to about ten digits, whatever the jumps of the force.
    """
    (_, _, begin) = next(starts(system, np.array([[float(mesh_frequency)]])))
    multiples = np.arange(order + 1)
    table = np.zeros((2, order + 1, len(system.whole_meshes)), dtype=complex)
    if begin.status[0] & STATUS_FLAGS["failed"]:
        table[:] = np.nan
    else:
        panels = min(2 * np.pi * max(order, fastest(begin.points)), MOST_PANELS)
        for piece in pieces(begin.points, begin.x, panels):
            weight = np.broadcast_to(WEIGHTS[:, None, None] * piece.length, piece.tau.shape).reshape(-1, 1)
            seen = [weight * values.reshape(len(weight), -1) for values in (piece.force, piece.deflection)]
            table += _transformed(piece.tau.ravel(), np.stack(seen), order)
    table[:, 1:] *= 2
    frequency = multiples * mesh_frequency / begin.points.excitation.cycles
    return Harmonics(frequency, table[0], table[1])


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


HARMONICS = 8
"""Harmonics of each mesh that are followed."""
MOST_MOMENTS = 400
"""Windows at most, which overlap by three quarters where that is fewer."""
MOST_ORDERS = 20
"""The frequencies end at this multiple of the highest mesh frequency."""
SHORTEST_WINDOW = 32
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
        """Return the windows of a run-up; None for fewer than ``SHORTEST_WINDOW`` samples, or if squares overflow.

        A window is as long as the speed needs to change by what the window resolves, ``T = sqrt(2 pi/|dOmega/dt|)``: a
        longer one would smear the first harmonic of the mesh frequency, a shorter one tells frequencies apart less
        well.
        """
        time, speed = found.time, found.mesh_frequency
        if len(time) < SHORTEST_WINDOW or not np.abs(found.mesh_force).max() < LARGEST:
            return None
        step = float(time[1] - time[0])
        rate = float(speed[-1] - speed[0]) / float(time[-1])
        count = int(np.clip(np.sqrt(tau / abs(rate)) / step, SHORTEST_WINDOW, len(time)))
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
