"""Mass, stiffness and damping matrices of a train of rotors, and the direction vector of each mesh.

The coordinates are the rotations of all rotors, each positive in the sense in which the rotor turns, then the
displacements (x, y) of the rotors that have a lateral support. With the positive rotations every term of the rigid-body
motion is positive, whatever the number of meshes between two rotors.

Source: Kuria & Kihiu 2008, section III (Lagrange's equations of 13 rotations and 20 displacements).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.system import Array


@dataclass(frozen=True)
class RotorCoordinates:
    """Where the coordinates of each rotor are: its rotation at its own number, its displacement x at ``lateral``.

    lateral: number of the coordinate x (y follows) by rotor, for supported rotors.
    """

    names: tuple[str, ...]
    supported: tuple[int, ...]

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return len(self.names) + 2 * len(self.supported)

    @property
    def lateral(self) -> dict[int, int]:
        return {rotor: len(self.names) + 2 * k for k, rotor in enumerate(self.supported)}

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names: ``gear1``, ... for rotations, ``gear1.x``, ``gear1.y`` for displacements."""
        sides = [f"{self.names[r]}.{axis}" for r in self.supported for axis in "xy"]
        return (*self.names, *sides)

    @property
    def units(self) -> tuple[str, ...]:
        """Rotations in rad, displacements in m."""
        return ("rad",) * len(self.names) + ("m",) * (2 * len(self.supported))


def unit(layout: RotorCoordinates, entries: dict[int, Array | float]) -> Array:
    """``(..., n)``, a vector with the given entries and zeros."""
    shape = np.broadcast_shapes(*(np.shape(value) for value in entries.values()))
    result = np.zeros((*shape, layout.size))
    for place, value in entries.items():
        result[..., place] += value
    return result


def spring(direction: Array, stiffness: Array | float) -> Array:
    """k d d^T, ``(..., n, n)``."""
    return np.asarray(stiffness)[..., None, None] * direction[..., :, None] * direction[..., None, :]


def shaft_direction(layout: RotorCoordinates, first: int, second: int) -> Array:
    """The twist of a shaft; both of its ends turn the same way."""
    return unit(layout, {first: 1.0, second: -1.0})


def line_of_action(
    position: Array | float, pressure_angle: Array | float, sense: int, internal: int | None = None
) -> tuple[Array, Array]:
    """n, the direction in which the driver pushes the driven gear.

        external gears     psi + sense (90 deg - phi_w)
        internal driven    psi + 180 deg + sense (90 deg - phi_w)
        internal driver    psi + sense (90 deg + phi_w)

    The flank of the external gear is pushed towards its own centre; where one gear is internal, both centres lie on the
    same side of the pitch point. Turning the whole train as one body leaves the teeth alone: r_b1 w_1 - r_b2 w_2 +
    n . (u_1 - u_2) = 0.

    position: psi, from the centre of the driver to that of the driven gear, rad.
    sense: 1 where the driver turns counter-clockwise, -1 where clockwise.
    internal: 0 where the driver is internal, 1 where the driven gear is.
    """
    right, phi = 0.5 * np.pi, np.asarray(pressure_angle)
    turn = np.pi if internal == 1 else 0.0
    angle = np.asarray(position) + turn + sense * (right + phi if internal == 0 else right - phi)
    return np.cos(angle), np.sin(angle)


def mesh_direction(
    layout: RotorCoordinates, gears: tuple[int, int], base_radii: tuple[Array | float, Array | float],
    push: tuple[Array, Array],
) -> Array:  # fmt: skip
    """g with g^T q = R_b1 theta_1 - R_b2 theta_2 + n . (u_1 - u_2): how much the teeth are pressed together.

    push: n, the direction of the driver's force on the driven gear.
    """
    entries: dict[int, Array | float] = {gears[0]: base_radii[0], gears[1]: -np.asarray(base_radii[1])}
    for gear, sign in zip(gears, (1, -1), strict=True):
        place = layout.lateral.get(gear)
        if place is not None:
            entries |= {place: sign * push[0], place + 1: sign * push[1]}
    return unit(layout, entries)


def mesh_damping(ratio: Array, stiffness: Array, radii: tuple[Array, Array], inertias: tuple[Array, Array]) -> Array:
    """c = 2 zeta sqrt(k m_e), m_e = J_1 J_2/(R_b1^2 J_2 + R_b2^2 J_1) (Kuria & Kihiu 2008)."""
    (r1, r2), (j1, j2) = radii, inertias
    return np.asarray(2 * ratio * np.sqrt(stiffness * j1 * j2 / (r1**2 * j2 + r2**2 * j1)))


def shaft_damping(ratio: Array, stiffness: Array, inertias: tuple[Array, Array]) -> Array:
    """c = 2 zeta sqrt(k J_e), J_e = J_1 J_2/(J_1 + J_2) (Kuria & Kihiu 2008)."""
    j1, j2 = inertias
    return np.asarray(2 * ratio * np.sqrt(stiffness * j1 * j2 / (j1 + j2)))
