"""What every waveform offers; the contract stands here once."""

from __future__ import annotations

from typing import Protocol

import numpy as np

Array = np.ndarray


class Waveform(Protocol):
    """A function w(x) of period 1, zero mean and peak-to-peak 1; its parameters may be arrays (a batch)."""

    @property
    def batch(self) -> tuple[int, ...]:
        """The shape of the parameters."""
        ...

    def value(self, x: Array) -> Array:
        """w at the phase x (in periods), which broadcasts against the batch."""
        ...

    def breakpoints(self) -> Array:
        """``(..., B)``: the phases in [0, 1] between which w is smooth (here: constant)."""
        ...

    def extremes(self) -> tuple[Array, Array]:
        """The least and the greatest value of w, ``(...)`` each."""
        ...

    def fourier(self, order: int) -> tuple[Array, Array]:
        """(a_s, b_s) of w(x) = sum_s a_s sin 2 pi s x + b_s cos 2 pi s x."""
        ...
