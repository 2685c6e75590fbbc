"""What every periodic function of the package offers; the contracts stand here once."""

from __future__ import annotations

from typing import Protocol

import numpy as np

Array = np.ndarray


class Profile(Protocol):
    """A function of period 1 whose parameters may be arrays (a batch)."""

    @property
    def piecewise_constant(self) -> bool:
        """Whether it is constant between its breakpoints, whatever its parameters."""
        ...

    @property
    def batch(self) -> tuple[int, ...]:
        """The shape of the parameters."""
        ...

    def value(self, x: Array) -> Array:
        """The function at the phase x (in periods), which broadcasts against the batch; continuous from the right."""
        ...

    def breakpoints(self) -> Array:
        """``(..., B)``: the phases in [0, 1), jumps and kinks, between which the function is analytic."""
        ...


class Waveform(Profile, Protocol):
    """The shape w of a mesh stiffness, k_v = 2 k_a w: period 1 and zero mean.

    Its peak-to-peak is 1, so that 2 k_a is that of the stiffness, but for a Fourier series, which keeps the
    coefficients that were given.
    """

    def extremes(self) -> tuple[Array, Array]:
        """The least and the greatest value of w, ``(...)`` each."""
        ...

    def fourier(self, order: int) -> tuple[Array, Array]:
        """(a_s, b_s) of w(x) = sum_s a_s sin 2 pi s x + b_s cos 2 pi s x."""
        ...
