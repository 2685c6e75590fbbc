"""Shapes of the periodic mesh stiffness.

A waveform is one small file with one frozen class that follows :class:`Waveform`, and one line in ``WAVEFORMS``.
"""

from gearstab.waveforms.base import Profile, Waveform
from gearstab.waveforms.profile import Constant, Scaled
from gearstab.waveforms.rectangular import Rectangular

WAVEFORMS: dict[str, type[Waveform]] = {"rectangular": Rectangular}

__all__ = ["WAVEFORMS", "Constant", "Profile", "Rectangular", "Scaled", "Waveform"]
