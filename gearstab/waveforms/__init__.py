"""Shapes of the periodic mesh stiffness: period 1, zero mean, peak-to-peak 1.

A waveform is one small file with one frozen class that follows :class:`Waveform`, and one line in ``WAVEFORMS``.
"""

from gearstab.waveforms.base import Waveform
from gearstab.waveforms.rectangular import Rectangular

WAVEFORMS: dict[str, type[Waveform]] = {"rectangular": Rectangular}

__all__ = ["WAVEFORMS", "Rectangular", "Waveform"]
