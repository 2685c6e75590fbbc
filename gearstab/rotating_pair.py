"""Two gears whose mesh stiffness depends on their rotation: a gear system with the numbers that its equations need.

    phi = (N1 theta1 - N2 theta2)/2,    theta = (N1 theta1 + N2 theta2)/2

phi is the deflection of the teeth, theta the rotation; one mesh cycle is 2 pi of theta (Oh, Grosh & Barber 2005).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import tau

import numpy as np

from gearstab.system import Array, Feature, GearSystem

CLASSICAL, RIGID_KINEMATIC, ENERGY_CONSERVING = "classical", "rigid_kinematic", "energy_conserving"

FORMULATIONS = (CLASSICAL, RIGID_KINEMATIC, ENERGY_CONSERVING)
"""k(Omega t), equation (6); k(theta) without the terms in dk/dtheta, (4) and (5); with them, (2) and (3)."""


@dataclass(frozen=True)
class PairNumbers:
    """Parameters of the equations of motion; every number may be an array of batch shape.

    teeth: N1, N2. inertias: I1, I2 (kg m^2).
    stiffness: k with one and with two pairs of teeth in contact (N m); the strain energy is k phi^2.
    single: the angle of theta, from the beginning of a mesh cycle, with one pair in contact; 0 < single < 2 pi.
    torque: T0 (N m); N1 T0 drives the first gear, N2 T0 loads the second one.
    zeta: damping ratio, of w0.
    lever: r1/N1 = r2/N2 (m), half of the module, where lengths are known.

    Source: Oh, Grosh & Barber 2005, (1)-(3) and (14).
    """

    teeth: tuple[int, int]
    inertias: tuple[Array, Array]
    stiffness: tuple[Array, Array]
    single: Array
    torque: Array
    zeta: Array
    lever: Array | None = None

    @property
    def batch(self) -> tuple[int, ...]:
        """The common shape of all numbers."""
        parts = (*self.inertias, *self.stiffness, self.single, self.torque, self.zeta, self.lever)
        return np.broadcast_shapes(*(np.shape(part) for part in parts if part is not None))

    @property
    def m1(self) -> Array:
        """M1 = (N1^2/I1 - N2^2/I2)/2."""
        return 0.5 * (self.teeth[0] ** 2 / self.inertias[0] - self.teeth[1] ** 2 / self.inertias[1])

    @property
    def m2(self) -> Array:
        """M2 = (N1^2/I1 + N2^2/I2)/2."""
        return 0.5 * (self.teeth[0] ** 2 / self.inertias[0] + self.teeth[1] ** 2 / self.inertias[1])

    @property
    def m(self) -> Array:
        """m = M1/M2, between -1 and 1."""
        return self.m1 / self.m2

    @property
    def k0(self) -> Array:
        """k0 = (k1 + k2)/2, which is not the average over a mesh cycle."""
        return 0.5 * (self.stiffness[0] + self.stiffness[1])

    @property
    def w0(self) -> Array:
        """w0 = sqrt(M2 k0), rad/s."""
        return np.sqrt(self.m2 * self.k0)

    @property
    def damped_frequency(self) -> Array:
        """w_d = w0 sqrt(1 - zeta^2), (16); NaN where the damping is more than critical."""
        with np.errstate(invalid="ignore"):
            return self.w0 * np.sqrt(1 - np.square(self.zeta))

    @property
    def load(self) -> Array:
        """phi_s = T0/k0."""
        return self.torque / self.k0

    @property
    def kappa(self) -> tuple[Array, Array]:
        """k/k0 with one and with two pairs in contact."""
        return self.stiffness[0] / self.k0, self.stiffness[1] / self.k0

    @property
    def single_part(self) -> Array:
        """The part of a mesh cycle with one pair in contact."""
        return np.asarray(self.single) / tau


@dataclass(frozen=True, kw_only=True)
class RotatingPair(GearSystem):
    """A gear pair in one of three formulations.

    As a :class:`~gearstab.system.GearSystem` it is the classical one, Hill's equation in phi with k(Omega t); methods
    that know the other formulations take ``numbers`` instead.
    """

    formulation: str
    numbers: PairNumbers

    @property
    def formulations(self) -> tuple[str, ...]:
        """The formulations between which a pair may change."""
        return CLASSICAL, RIGID_KINEMATIC, ENERGY_CONSERVING

    @cached_property
    def features(self) -> frozenset[Feature]:
        """The features that a theory of this pair must support."""
        return super().features if self.is_classical else super().features | {Feature.FOLLOWS_ROTATION}

    @property
    def is_classical(self) -> bool:
        """Whether the equations are linear, with the mesh stiffness a function of time."""
        return self.formulation == CLASSICAL
