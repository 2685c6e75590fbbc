"""Motion of the gears where the number of teeth in contact changes."""

from __future__ import annotations

from dataclasses import dataclass
from math import copysign, sqrt, tau

from gearstab.response.rotating_pair.motion import Arc, State
from gearstab.rotating_pair import CLASSICAL, ENERGY_CONSERVING, RotatingPair


@dataclass(frozen=True)
class Law:
    """The equations of one pair in units of 1/w0 and k0: see :class:`~gearstab.response.rotating_pair.motion.Arc`.

    kappa: k/k0 with one and with two pairs in contact. edges: where in a mesh cycle each of them begins, and 2 pi.
    follows: by how much theta follows phi, m but for the classical formulation. impulsive: whether a change of
    stiffness takes or gives kinetic energy.
    """

    m: float
    zeta: float
    load: float
    kappa: tuple[float, float]
    edges: tuple[float, float, float]
    follows: float
    impulsive: bool
    drive: float = 0.0

    def arc(self, region: int, start: State) -> Arc:
        """The motion from a state on, with one (region 0) or two pairs (1) in contact."""
        return Arc(start, self.kappa[region], self.zeta, self.load, self.follows, self.drive)

    def energy(self, region: int, state: State) -> float:
        """M2 U/w0^2 = (phi' - m theta')^2/(1 - m^2) + theta'^2 + kappa phi^2 - 2 phi_s phi."""
        phi, rate, _, speed = state
        kinetic = (rate - self.m * speed) ** 2 / (1 - self.m**2) + speed**2
        return kinetic + self.kappa[region] * phi**2 - 2 * self.load * phi

    @property
    def soft(self) -> int:
        """The region of the lower stiffness."""
        return 0 if self.kappa[0] <= self.kappa[1] else 1

    @property
    def pass_energy(self) -> float:
        """The least energy with which the gears can get from the softer into the stiffer region.

        At the boundary theta'^2 must exceed dkappa phi^2, so that the energy exceeds kappa phi^2 - 2 phi_s phi with the
        greater kappa, which is nowhere below -phi_s^2/kappa.
        """
        return -(self.load**2) / max(self.kappa)

    def cross(self, region: int, state: State, direction: int) -> tuple[float, float, bool]:
        """(phi', theta', whether it passes) after theta has met the boundary of a region in a direction.

        With dk = k_after - k_before at fixed theta and phi: theta'^2 falls by M2 dk phi^2, phi' changes by m times as
        much as theta', and the kinetic energy by exactly -dk phi^2 (Oh, Grosh & Barber 2005, (9) and (11)). Where
        theta'^2 is too small for that the gears are reflected: theta' -> -theta', phi' -> phi' - 2 m theta'.
        """
        phi, rate, _, speed = state
        if not self.impulsive:
            return rate, speed, True
        change = self.kappa[1 - region] - self.kappa[region]
        squared = speed**2 - change * phi**2
        if squared <= 0 and change * phi**2 > 0:
            return rate - 2 * self.m * speed, -speed, False
        after = copysign(sqrt(squared), direction)
        # The difference of two nearly equal speeds, without cancellation.
        step = -change * phi**2 / (after + speed) if after * speed > 0 else after - speed
        return rate + self.m * step, after, True


def law_of(pair: RotatingPair, drive: float = 0.0) -> Law:
    """The equations of a single pair (no batch). Raises ValueError for a batch."""
    numbers = pair.numbers
    if numbers.batch != ():
        raise ValueError(f"a time response needs a single system, not a batch of shape {numbers.batch}")
    m = float(numbers.m)
    return Law(
        m=m,
        zeta=float(numbers.zeta),
        load=float(numbers.load),
        kappa=(float(numbers.kappa[0]), float(numbers.kappa[1])),
        edges=(0.0, float(numbers.single), tau),
        follows=0.0 if pair.formulation == CLASSICAL else m,
        impulsive=pair.formulation == ENERGY_CONSERVING,
        drive=drive,
    )
