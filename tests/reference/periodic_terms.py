"""Trains with periodic terms besides the mesh stiffness, symmetric and not."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
import systems

from gearstab.system import PeriodicTerm
from gearstab.waveforms import Constant, Rectangular, Scaled

G1, G2 = np.array([1.0, 1.0, 0.0]), np.array([0.0, 1.0, 1.0])
MASS = np.diag([1.0, 0.3, 4.0])
SHAFT = np.diag([0.5, 0.0, 0.0])
DAMPING = 0.02 * np.eye(3) + 0.01 * np.outer(G1, G1)


@dataclass(frozen=True)
class Smooth:
    """mean + size sin(2 pi x) exp(cos(2 pi x)/3), all harmonics and no kink."""

    mean: float
    size: float
    piecewise_constant = False
    batch: tuple[int, ...] = ()

    def value(self, x):
        x = 2 * np.pi * np.asarray(x)
        return self.mean + self.size * np.sin(x) * np.exp(np.cos(x) / 3)

    def breakpoints(self):
        return np.zeros(0)


def train(damping=None, stiffness=SHAFT, terms=()):
    system = systems.train((0.3, 0.2), (1.5, 1.4), 0.2, "3/5", damping=damping)
    return replace(system, stiffness=stiffness, terms=tuple(terms))


def friction(stiffness, damping=None, left=(0.3, -0.1, 0.2), right=G1, **other):
    return PeriodicTerm("friction", np.array(left), np.asarray(right, dtype=float), stiffness, damping, **other)


CASES = {
    "piecewise constant friction": train(DAMPING, terms=[friction(Scaled(Rectangular(1.3), 0.05, 0.4))]),
    "friction of another mesh": train(
        DAMPING, terms=[friction(Scaled(Rectangular(1.6), 0.1, 0.3), frequency_ratio=Fraction(3, 5), lag=0.1)]
    ),
    "damping that follows the stiffness": train(
        None, terms=[friction(None, Scaled(Rectangular(1.5), 0.05, 0.03), left=G1)]
    ),
    "smooth friction": train(DAMPING, terms=[friction(Smooth(0.1, 0.2), Smooth(0.02, 0.01))]),
    "gyroscopic": train(
        DAMPING,
        terms=[
            friction(None, Constant(0.3), left=[1, 0, 0], right=[0, 0, 1]),
            friction(None, Constant(-0.3), left=[0, 0, 1], right=[1, 0, 0]),
        ],
    ),
}
