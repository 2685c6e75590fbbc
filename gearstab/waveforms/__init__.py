"""Shapes of the periodic mesh stiffness.

A waveform is one file with one frozen class that overrides what :class:`Waveform` asks for, the keys it takes in a
configuration, and one line in ``WAVEFORMS``; :mod:`.section` puts the keys of all of them together.
"""

from gearstab.waveforms.base import Constant, Product, Profile, Scaled, Waveform
from gearstab.waveforms.fourier import Fourier
from gearstab.waveforms.rectangular import Helical, Rectangular, Trapezoidal
from gearstab.waveforms.sampled import Sampled, TorqueTable
from gearstab.waveforms.tooth import Tooth
from gearstab.waveforms.tooth_pair import ToothPair

WAVEFORMS: dict[str, type[Waveform]] = {
    "rectangular": Rectangular,
    "trapezoidal": Trapezoidal,
    "fourier": Fourier,
    "sampled": Sampled,
    "table": TorqueTable,
    "pair": ToothPair,
    "tooth": Tooth,
}

__all__ = [
    "WAVEFORMS", "Constant", "Fourier", "Helical", "Product", "Profile", "Rectangular", "Sampled", "Scaled", "Tooth",
    "ToothPair", "TorqueTable", "Trapezoidal", "Waveform",
]  # fmt: skip
