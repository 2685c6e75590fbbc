"""Mesh stiffness as a finite Fourier series."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import Field

from gearstab.config.model import vector
from gearstab.config.model.conflicts import Conflict
from gearstab.config.model.fields import Number, optional
from gearstab.waveforms.base import Array, Keys, Waveform, wrapped

MOST_HARMONICS = 200

NEGLIGIBLE = 1e-15
"""Harmonics below this part of the greatest one do not move the extremes by more than rounding does."""


class FourierKeys(Keys):
    """Coefficients of the series."""

    sin: Annotated[list[Number], Field(max_length=MOST_HARMONICS)] | None = optional("sine coefficients")
    """fourier: a_s of sin s x, s = 1, 2, ..., x = Omega_i t - 2 pi lag (1)."""
    cos: Annotated[list[Number], Field(max_length=MOST_HARMONICS)] | None = optional("cosine coefficients")
    """fourier: b_s of cos s x, s = 1, 2, ... (1)."""


@dataclass(frozen=True)
class Fourier(Waveform):
    """w = sum_s a_s sin 2 pi s x + b_s cos 2 pi s x, s = 1 .. S, with the coefficients as given.

    Its peak-to-peak is what these make it: k_v = 2 k_a w.

    Parameters
    ----------
    sin, cos: ``(..., S)``, a_s and b_s.
    """

    said: ClassVar[str] = "a series"
    keys: ClassVar[type[Keys]] = FourierKeys
    has_contact_ratio: ClassVar[bool] = False
    # The least value is a concave function of the coefficients.
    worst_at_ends: ClassVar[tuple[str, ...]] = ("sin", "cos")

    sin: Array
    cos: Array

    @classmethod
    def build(cls, spec: Any, contact_ratio: Any = None) -> Self:
        """Build the wave from ``sin`` and ``cos``, either of which may be shorter or missing."""
        sin, cos = list(spec.sin or []), list(spec.cos or [])
        order = max(len(sin), len(cos))
        return cls(*(vector([*part, *[0.0] * (order - len(part))]) for part in (sin, cos)))

    @classmethod
    def conflicts(cls, section: Any) -> Iterator[Conflict]:
        """Yield a conflict without any harmonic."""
        if not section.sin and not section.cos:
            yield (), "missing", "has no harmonics", "add sin: [..] or cos: [..], the coefficients of the harmonics"

    @property
    def batch(self) -> tuple[int, ...]:
        return np.broadcast_shapes(np.shape(self.sin)[:-1], np.shape(self.cos)[:-1])

    @property
    def _orders(self) -> Array:
        return np.arange(1, np.shape(self.sin)[-1] + 1)

    def value(self, x: Array) -> Array:
        angle = 2 * np.pi * self._orders * wrapped(x)[..., None]
        return np.sum(self.sin * np.sin(angle) + self.cos * np.cos(angle), axis=-1)

    def breakpoints(self) -> Array:
        return np.zeros((*self.batch, 0))

    def extremes(self) -> tuple[Array, Array]:
        """Find the extremes at the zeros of w', which is a polynomial of degree 2 S in z = exp(2 pi i x) but for a
        factor.

        All its roots are taken as phases: those off the unit circle are values of w like others, and multiple roots,
        which are known less well, belong to phases near which w hardly varies.
        """
        sin, cos = np.broadcast_arrays(np.asarray(self.sin, dtype=float), np.asarray(self.cos, dtype=float))
        # sum_s s (a_s cos - b_s sin) = 1/2 sum_s s [(a_s + i b_s) z^s + (a_s - i b_s) z^-s]
        derivative = (self._orders * (sin + 1j * cos)).reshape(-1, sin.shape[-1])
        low, high = np.zeros(len(derivative)), np.zeros(len(derivative))
        degree = _degrees(derivative)
        for order in np.unique(degree[degree > 0]):
            rows = np.flatnonzero(degree == order)
            phase = np.angle(_roots(derivative[rows, :order])) / (2 * np.pi)
            flat = Fourier(sin.reshape(low.size, 1, -1)[rows], cos.reshape(low.size, 1, -1)[rows])
            found = flat.value(phase)
            low[rows], high[rows] = found.min(axis=1), found.max(axis=1)
        return low.reshape(self.batch), high.reshape(self.batch)

    def fourier(self, order: int) -> tuple[Array, Array]:
        if order > np.shape(self.sin)[-1]:
            return np.zeros(self.batch), np.zeros(self.batch)
        sin, cos = (np.asarray(part, dtype=float)[..., order - 1] for part in (self.sin, self.cos))
        return np.broadcast_to(sin, self.batch), np.broadcast_to(cos, self.batch)


def _degrees(coefficients: Array) -> Array:
    """Return for each row ``(r, S)`` the highest order that counts, 0 where all vanish."""
    size = np.abs(coefficients)
    counts = size > NEGLIGIBLE * size.max(axis=1, keepdims=True, initial=0.0)
    return np.max(np.where(counts, np.arange(1, size.shape[1] + 1), 0), axis=1, initial=0)


def _roots(coefficients: Array) -> Array:
    """``(r, 2 S)``, roots of sum_s c_s z^(S + s) + conj(c_s) z^(S - s), from the companion matrix; c_S is not 0."""
    rows, order = coefficients.shape
    # A power of two changes no digit, and keeps the quotients of subnormal coefficients finite.
    shift = -np.frexp(np.abs(coefficients).max(axis=1, keepdims=True))[1]
    coefficients = np.ldexp(coefficients.real, shift) + 1j * np.ldexp(coefficients.imag, shift)
    middle = np.zeros((rows, 1))
    polynomial = np.concatenate([coefficients[:, ::-1], middle, coefficients.conj()], axis=1)
    companion = np.zeros((rows, 2 * order, 2 * order), dtype=complex)
    companion[:, 0] = -polynomial[:, 1:] / polynomial[:, :1]
    companion[:, np.arange(1, 2 * order), np.arange(2 * order - 1)] = 1.0
    return np.linalg.eigvals(companion)
