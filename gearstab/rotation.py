"""Matrices of a linear system that act with a speed of rotation: gyroscopic, circulatory and centripetal terms.

With the speed W of a rotor, or of the frame in which coordinates are written, the equation of motion gains

    W G q' + (W H + W^2 K) q.

W is an exact ratio times the mesh frequency Omega, or held. Sources: Lin & Parker 1999 (J. Vib. Acoust. 121, 316) for
G and K of a planetary gear in carrier coordinates; Genta 2005, Dynamics of Rotating Systems, for G of rotors that tilt
and H of rotating damping.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

Array = np.ndarray


@dataclass(frozen=True)
class SpeedTerm:
    """A matrix ``(..., n, n)`` that acts on q, or on q' where ``on_velocity``, times W^power/(1 - a W^2).

    speed_ratio: W/Omega; 0 where W is held.  speed: ``(...)``, W where it is held, else 0.
    softening: a ``(...)``, 1/speed^2; 0 unless a spring gives way under the centrifugal force that it carries.
    """

    on_velocity: bool
    matrix: Array
    power: int
    speed_ratio: float
    speed: Array | float
    softening: Array | float = 0.0

    @property
    def held(self) -> bool:
        """Whether the speed does not depend on the mesh frequency."""
        return self.speed_ratio == 0


@dataclass(frozen=True)
class Rotation:
    """One speed of rotation W and the matrices that act with it, each ``(..., n, n)`` or None.

    Parameters
    ----------
    speed_ratio: W/Omega, exact, negative for the other sense; None where the speed is held.
    speed: ``(...)``, W where it is held, rad per unit time.
    gyroscopic: G, skew. circulatory: H. centripetal: K, symmetric and added, so negative where inertia softens.
    preload: L in W^2/(1 - a W^2) L q: stiffness by the tension in springs that carry centrifugal forces.
    softening: a ``(...)``, mass over stiffness of such a spring.
    """

    speed_ratio: Fraction | None = None
    speed: Array | float = 0.0
    gyroscopic: Array | None = None
    circulatory: Array | None = None
    centripetal: Array | None = None
    preload: Array | None = None
    softening: Array | float = 0.0

    def terms(self) -> Iterator[SpeedTerm]:
        """Yield the matrices that there are."""
        ratio, held = float(self.speed_ratio or 0), self.speed if self.speed_ratio is None else 0.0
        table = ((True, self.gyroscopic, 1), (False, self.circulatory, 1), (False, self.centripetal, 2))
        for on_velocity, matrix, power in table:
            if matrix is not None:
                yield SpeedTerm(on_velocity, matrix, power, ratio, held)
        if self.preload is not None:
            yield SpeedTerm(False, self.preload, 2, ratio, held, self.softening)

    @property
    def batch(self) -> tuple[int, ...]:
        """The common leading shape of all arrays."""
        matrices = (np.shape(term.matrix)[:-2] for term in self.terms())
        return np.broadcast_shapes(np.shape(self.speed), np.shape(self.softening), *matrices)

    def mapped(self, matrix: Callable[[Array], Array]) -> Rotation:
        """Return the rotation with all its matrices mapped."""
        names = ("gyroscopic", "circulatory", "centripetal", "preload")
        given = {name: own for name in names if (own := getattr(self, name)) is not None}
        found: dict[str, Any] = {name: matrix(own) for name, own in given.items()}
        return replace(self, **found)

    def scaled(self, mass: Array, stiffness: Array) -> Rotation:
        """Return the rotation in units of a mass and a stiffness ``(...)``, so of sqrt(mass/stiffness) for time."""
        time = np.sqrt(mass / stiffness)
        by_mass = self.mapped(lambda own: own / mass[..., None, None])
        drag = None if self.circulatory is None else self.circulatory / np.sqrt(mass * stiffness)[..., None, None]
        return replace(by_mass, circulatory=drag, speed=self.speed * time, softening=self.softening / time**2)


def factors(speed: Array, power: Array, softening: Array) -> Array:
    """Return W^power/(1 - a W^2), what the matrix of a term is multiplied by, of any broadcast shapes."""
    return np.asarray(speed**power / (1 - softening * speed**2))


def factor_slopes(speed: Array, power: Array, softening: Array) -> Array:
    """Return the derivatives of :func:`factors` with respect to the speed."""
    rest = 1 - softening * speed**2
    return np.asarray((power * speed ** (power - 1) + (2 - power) * softening * speed ** (power + 1)) / rest**2)
