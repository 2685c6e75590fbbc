"""From the parameters of a mesh to its waveform: one line a kind in ``BUILDERS``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from gearstab.system import Array
from gearstab.systems.parts.arrays import series, vector
from gearstab.waveforms import Pair, Rectangular, Sampled, Trapezoidal, Waveform
from gearstab.waveforms import tooth_pair as shapes
from gearstab.waveforms.splines import Pieces, interpolate


def waveform(p: dict[str, Any]) -> Waveform:
    """The wave of a mesh with the parameters p: ``waveform`` and, where its kind has one, ``contact_ratio``."""
    spec = p.get("waveform") or {}
    return BUILDERS[spec.get("kind", "rectangular")](spec, p.get("contact_ratio"))


def above_mean(wave: Waveform) -> Array:
    """How far the stiffer level that ``max_stiffness`` keeps is above the mean, in units of 2 k_a.

    For a rectangular or trapezoidal wave it is the level of floor(c) + 1 pairs, also where ramps or an integer contact
    ratio let the wave not reach it; for others the maximum of the wave.
    """
    if isinstance(wave, Rectangular | Trapezoidal):
        return 1.0 - wave.stiff_fraction
    return wave.extremes()[1]


def own_variation(wave: Waveform) -> tuple[Array, Array]:
    """(mean, amplitude) of what a wave was made from, where it was, for a mesh that does not give them.

    Zeros for other waves.
    """
    if isinstance(wave, Sampled | Pair):
        return wave.mean_stiffness, wave.amplitude
    return np.zeros(wave.batch), np.zeros(wave.batch)


def _pair(spec: dict[str, Any], contact_ratio: Any) -> Waveform:
    return Pair(_array(contact_ratio), _shape(spec))


def _shape(spec: dict[str, Any]) -> Pieces:
    """The stiffness of one pair along its contact."""
    middle = _array(spec.get("pair_stiffness", 1.0))
    if spec.get("shape") == "constant":
        return shapes.constant(middle)
    if spec.get("shape") == "parabolic":
        return shapes.parabolic(_array(spec.get("ends", shapes.PARABOLA_ENDS)), middle)
    kind = spec.get("interpolation", "linear")
    return interpolate(vector(spec["phase"]), vector(spec["stiffness"]), kind, periodic=False)


def _array(value: Any) -> Array:
    return np.asarray(value, dtype=float)


BUILDERS: dict[str, Callable[[dict[str, Any], Any], Waveform]] = {
    "rectangular": lambda spec, contact_ratio: Rectangular(_array(contact_ratio)),
    "trapezoidal": lambda spec, contact_ratio: Trapezoidal(_array(contact_ratio), _array(spec["ramp"])),
    "fourier": lambda spec, _: series(spec),
    "sampled": lambda spec, _: Sampled(
        vector(spec["phase"]), vector(spec["stiffness"]), spec.get("interpolation", "linear")
    ),
    "pair": _pair,
}
