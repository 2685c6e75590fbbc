"""How the bodies of a planetary set enter the deflections of its meshes and planet bearings, in carrier coordinates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import tau
from typing import Any

import numpy as np

from gearstab.rotation import Rotation
from gearstab.system import Array
from gearstab.systems.assembly import Coordinates, Row, total


@dataclass(frozen=True)
class SetRows:
    """Bodies ``sun``, ``ring``, ``carrier`` and ``planet1`` to ``planetN``, whose motions are rows over coordinates.

    planets: N; angles: psi_n, any of which may have a batch shape.
    """

    planets: int
    angles: tuple[Array, ...]

    @property
    def numbers(self) -> range:
        """n = 1..N."""
        return range(1, self.planets + 1)

    def angle(self, n: int) -> Array:
        """Return psi_n."""
        return self.angles[n - 1]

    def rotation(self, body: str) -> Row:
        """Return u = r theta, counter-clockwise: r the base radius, of the carrier the centre distance."""
        raise NotImplementedError

    def shift(self, body: str, x: Any, y: Any) -> Row:
        """Return x times the first and y times the second translation of a body; a planet's are radial, tangential."""
        raise NotImplementedError

    def deflection(self, name: str, n: int, angle: Array) -> dict[str, Any]:
        """Return the deflection of the mesh of ``sun`` or ``ring`` with planet n. Source: Parker 2009, (26), (27).

        angle: the pressure angle, negative where the other flanks carry.
        """
        psi, sign = self.angle(n), 1.0 if name == "sun" else -1.0
        turned = {key: sign * value for key, value in self.rotation(f"planet{n}").items()}
        return total(
            self.rotation(name), turned,
            self.shift(name, -np.sin(psi - sign * angle), np.cos(psi - sign * angle)),
            self.shift(f"planet{n}", -sign * np.sin(angle), -np.cos(angle)),
        )  # fmt: skip

    def bearing(self, n: int) -> tuple[Row, Row]:
        """Return the radial and the tangential deflection of the bearing of planet n."""
        cosine, sine = np.cos(self.angle(n)), np.sin(self.angle(n))
        radial = total(self.shift("carrier", cosine, sine), self.shift(f"planet{n}", -1.0, 0.0))
        turning = self.rotation("carrier")
        return radial, total(self.shift("carrier", -sine, cosine), turning, self.shift(f"planet{n}", 0.0, -1.0))

    def of_frame(
        self,
        place: Coordinates,
        bodies: Mapping[str, tuple[Any, Any]],
        bearing: Any,
        ratio: Fraction | None,
        speed: Array | float = 0.0,
        waves: Sequence[tuple[Row, Row, Array, int]] = (),
        pins: bool = True,
    ) -> Rotation:
        """Return what the carrier's speed W adds in coordinates that turn with it, r Omega or held.

            G = 2 j m (y^T x - x^T y),   K = -j^2 m (x^T x + y^T y),   H = c (y^T x - x^T y)

        of a body of mass m with the damping c to the housing, j = 1, or of the deflection of a ring at rest by j waves,
        which passes the frame; and on the carrier's rotation the tension of the pins, W^2 m/(1 - W^2 m/k_p) of each
        planet, as a bearing carries the centrifugal force of the planet, which turns with the pin: without it the free
        rotation would have a stiffness. Other damping acts between bodies and the frame, so that it turns with it.

        place: coordinates. bodies: mass and damping of each body that moves. bearing: k_p, None of rigid ones.
        waves: rows x and y, mass and j of each deflection of the ring. pins: whether they carry. Source: Lin & Parker
        1999 (J. Vib. Acoust. 121, 316), without the tension; that is derived from the nonlinear carrier.
        """
        moving = [(self.shift(body, 1.0, 0.0), self.shift(body, 0.0, 1.0), *own, 1) for body, own in bodies.items()]
        moving += [(x, y, m, 0.0, j) for x, y, m, j in waves]
        mass = np.asarray(bodies["planet1"][0], dtype=float)
        drag = place.skew([(x, y, c) for x, y, _, c, _ in moving])
        return Rotation(
            speed_ratio=ratio,
            speed=speed,
            gyroscopic=place.skew([(x, y, 2 * j * np.asarray(m)) for x, y, m, _, j in moving]),
            circulatory=drag if np.any(drag) else None,
            centripetal=place.stamped([(row, -(j**2) * np.asarray(m)) for x, y, m, _, j in moving for row in (x, y)]),
            preload=place.stamped([(self.rotation("carrier"), self.planets * mass)]) if pins else None,
            softening=0.0 if bearing is None or not pins else mass / bearing,
        )  # fmt: skip


def turn_matrix(
    index: Mapping[str, int], order: int, waves: Sequence[tuple[str, str, int]], planets: Sequence[Sequence[str]]
) -> Array:
    """Return ``(n, n)``, the displacements turned by 2 pi/N: planet n takes what planet n - 1 had.

    index: number of each coordinate; those that are not named stay. order: N. waves: pairs of coordinates that turn by
    m times the angle, with m. planets: the coordinates that go round, of each kind.
    """
    turn = np.eye(len(index))
    for first, second, m in waves:
        at = [index[first], index[second]]
        cosine, sine = np.cos(m * tau / order), np.sin(m * tau / order)
        turn[np.ix_(at, at)] = [[cosine, -sine], [sine, cosine]]
    for cycle in planets:
        at = [index[name] for name in cycle]
        turn[np.ix_(at, at)] = np.roll(np.eye(order), 1, axis=0)
    return turn
