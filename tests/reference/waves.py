"""Waveforms of every kind, plain and odd."""

from types import SimpleNamespace

import numpy as np

from gearstab.waveforms import Fourier, Rectangular, Sampled, Tooth, ToothPair, TorqueTable, Trapezoidal
from gearstab.waveforms.splines import interpolate
from gearstab.waveforms.tooth import Piecewise, nodes, through
from gearstab.waveforms.tooth_pair import constant, parabolic

RATIOS = (1.0, 1.3, 1.5, 1.97, 2.0, 2.6, 3.02)

IRREGULAR = np.array([0.05, 0.11, 0.3, 0.31, 0.5, 0.72, 0.9])

LEVELS = np.array([3.0, 2.0, 5.0, 5.5, 4.0, 4.0, 1.0])

UNIFORM = np.arange(40) / 40

SMOOTH = 20 + 3 * np.sin(2 * np.pi * UNIFORM) + np.cos(4 * np.pi * UNIFORM)

TOOTH = interpolate(np.array([0.0, 0.2, 0.7, 1.0]), np.array([1.0, 2.0, 2.2, 0.8]), "linear", periodic=False)

CURVED = interpolate(np.linspace(0, 1, 6), np.array([1.0, 1.5, 2.2, 2.4, 1.9, 0.0]), "cubic", periodic=False)


def arch(x):
    """Stiffness of two pieces that jumps where the pieces meet, at 0.6, and has extremes between."""
    return 1e8 * np.where(x < 0.6, 3 + np.sin(5 * x), 2 + np.exp(x) * np.cos(3 * x))


def flat(x):
    return np.full_like(x, 7.0)


def pieces(function, *edges):
    return through(np.array(edges), function(nodes(np.array(edges), 20)))


def at_torque(torque, interpolation="linear"):
    """A table of two torques, 1 and 2."""
    samples = {"torques": np.array([1.0, 2.0]), "phase": IRREGULAR, "stiffness": np.array([LEVELS, LEVELS[::-1]])}
    return TorqueTable.build(SimpleNamespace(torque=torque, interpolation=interpolation, **samples))


CASES = {
    "rectangular": [Rectangular(c) for c in RATIOS],
    "trapezoidal": [Trapezoidal(c, r) for c in RATIOS for r in (0.0, 1e-3, 0.1, 0.45, 0.9, 1.0)],
    "fourier": [
        Fourier(np.array([0.0]), np.array([0.5])),
        Fourier(np.array([0.3, 0.0, -0.1]), np.array([0.1, 0.2, 0.0])),
        Fourier(np.array([0.0, 0.0]), np.array([0.0, 0.0])),
        # A flat maximum, w' with a triple root: cos x - cos(2 x)/4 has w'' = w''' = 0 at its maximum.
        Fourier(np.zeros(2), np.array([1.0, -0.25])),
    ],
    "sampled": [
        *(Sampled(IRREGULAR, LEVELS, kind) for kind in ("linear", "cubic")),
        *(Sampled(UNIFORM, SMOOTH, kind) for kind in ("linear", "cubic")),
        Sampled(np.array([0.2, 0.7]), np.array([1.0, 2.0])),
        Sampled(np.array([0.2, 0.7, 0.9]), np.array([1.0, 2.0, 0.0]), "cubic"),
        Sampled(UNIFORM, np.full(40, 3e8), "cubic"),
    ],
    "table": [*(at_torque(t) for t in (1.0, 1.7, 2.0)), at_torque(1.3, "cubic")],
    "pair": [ToothPair(c, shape) for c in RATIOS for shape in (constant(2.0), parabolic(), TOOTH, CURVED)],
    "tooth": [
        *(Tooth(pieces(flank, *cuts)) for flank in (arch, flat) for cuts in ((0.0, 0.6), (0.0, 0.0))),
        Tooth(Piecewise(np.array([0.0, 0.3]), np.array([[2e8], [1e8]]))),
    ],
}

ALL = [(name, wave) for name, waves in CASES.items() for wave in waves]

IDS = [f"{name}{i}" for name, waves in CASES.items() for i, _ in enumerate(waves)]
