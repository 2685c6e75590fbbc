"""Parts of a system: tooth meshes, further terms of K(t) and C(t), forces, connections, and rotations.

The equation of :class:`gearstab.system.GearSystem` says what each does. Connections, bearings and shafts whose forces
are wanted, are in K0 and C already and only named here; stability does not depend on them.

With the speed W of a rotor, or of the frame in which coordinates are written, the equation of motion gains

    W G q' + (W H + W^2 K) q

by matrices that act with it, gyroscopic, circulatory and centripetal ones. W is an exact ratio times the mesh frequency
Omega, or held. Sources: Lin & Parker 1999 (J. Vib. Acoust. 121, 316) for G and K of a planetary gear in carrier
coordinates; Genta 2005, Dynamics of Rotating Systems, for G of rotors that tilt and H of rotating damping.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from fractions import Fraction
from typing import Any

import numpy as np

from gearstab.waveforms import Constant, Fourier, Profile, Rectangular, Waveform
from gearstab.waveforms.base import harmonic

Array = np.ndarray


@dataclass(frozen=True)
class RevolutionError:
    """A transmission error that repeats with the revolution of a gear: an eccentricity, or errors of its pitch.

    name: of mesh and gear. profile: e over a revolution. frequency_ratio: of the gear over Omega, relative to what the
    mesh is fixed in. lag: as in :class:`Mesh`, in revolutions.
    """

    name: str
    profile: Fourier
    frequency_ratio: Fraction
    lag: Array | float = 0.0


@dataclass(frozen=True)
class Mesh:
    """One tooth mesh: a spring of periodic stiffness along a direction vector.

        k_i(t) = k_g [1 + 2 epsilon w(r Omega t/2 pi - lag)]

    Parameters
    ----------
    name: what messages and results call it.
    direction: ``(..., n)``, g_i; the mesh deflection is g_i^T q.
    mean_stiffness: ``(...)``, k_g.
    epsilon: ``(...)``, k_a/k_g, where 2 k_a is the peak-to-peak of the variation.
    waveform: the shape w of period 1, zero mean and peak-to-peak 1.
    frequency_ratio: r = Omega_i/Omega: exact, or a float, which stands for an irrational number.
    lag: ``(...)``, the start of the wave as a fraction of this mesh's own period.
    transmission_error: e_i(x), the unloaded static transmission error at the same phase x: the mesh is without force at
        g_i^T q = e_i, so that it acts as the forces k_i(t) e_i g_i and c_i e_i' g_i. Stability does not depend on it.
    revolution_errors: those that repeat with a revolution of a gear, which add to e_i.
    damping: ``(...)``, c_i, what this mesh adds to the damping of the system, c_i g_i g_i^T.
    backlash: 2 b, the play between the flanks, 0 where the teeth always touch. Only :mod:`gearstab.response.backlash`
        lets them part; everything else is about the linear system in contact.
    backlash_zero: where in the play g_i^T q = e_i is: in its ``middle``, or on the ``drive_side``, at the flank that
        carries the load.
    part_of: the name of the mesh whose stiffness it changes, "" for a mesh by itself. A weak tooth is such a part, with
        the period of its shaft and a negative stiffness; its force counts to that of the mesh.
    """

    name: str
    direction: Array
    mean_stiffness: Array
    epsilon: Array
    waveform: Waveform
    frequency_ratio: Fraction | float = Fraction(1)
    lag: Array | float = 0.0
    transmission_error: Fourier | None = None
    revolution_errors: tuple[RevolutionError, ...] = ()
    damping: Array | float = 0.0
    backlash: Array | float = 0.0
    backlash_zero: str = "middle"
    part_of: str = ""

    @property
    def amplitude(self) -> Array:
        """k_a = epsilon k_g, half of the peak-to-peak stiffness variation."""
        return np.asarray(self.epsilon) * self.mean_stiffness

    @property
    def lowest_stiffness(self) -> Array:
        """The softest level of k_i(t); infinite of a part, which has no sign of its own to keep."""
        if self.part_of:
            return np.full(np.broadcast_shapes(np.shape(self.mean_stiffness), self.waveform.batch), np.inf)
        return self.mean_stiffness + 2 * self.amplitude * self.waveform.extremes()[0]

    @property
    def outer(self) -> Array:
        """g g^T, ``(..., n, n)``."""
        g = np.asarray(self.direction)
        return g[..., :, None] * g[..., None, :]

    def averaged(self) -> Mesh:
        """Return the mesh with its mean stiffness throughout."""
        return replace(self, epsilon=np.zeros_like(self.epsilon), waveform=Rectangular(1.0), lag=0.0)


@dataclass(frozen=True)
class PeriodicTerm:
    """A periodic term of a mesh beside its symmetric stiffness: a(x) u v^T in K(t) and c(x) u v^T in C(t).

    x = r Omega t/2 pi - lag; friction and mesh damping that follows the mesh stiffness are such terms.

    Parameters
    ----------
    name: what messages and results call it.
    left, right: ``(..., n)``, u and v.
    stiffness, damping: the functions a and c of period 1, None where there is none; their means count.
    frequency_ratio, lag: as in :class:`Mesh`.
    mesh: the name of the mesh whose teeth must touch for it to act, "" where it always acts.
    """

    name: str
    left: Array
    right: Array
    stiffness: Profile | None = None
    damping: Profile | None = None
    frequency_ratio: Fraction | float = Fraction(1)
    lag: Array | float = 0.0
    mesh: str = ""

    @property
    def profiles(self) -> tuple[Profile, ...]:
        """The functions that there are."""
        return tuple(profile for profile in (self.stiffness, self.damping) if profile is not None)

    def averaged(self) -> PeriodicTerm:
        """Return the term with the means of its functions throughout."""
        stiffness, damping = (
            None if profile is None else Constant(harmonic(profile, 0).real)
            for profile in (self.stiffness, self.damping)
        )
        return replace(self, stiffness=stiffness, damping=damping)

    @property
    def batch(self) -> tuple[int, ...]:
        """The common leading shape of all arrays."""
        ends = (np.shape(self.left)[:-1], np.shape(self.right)[:-1], np.shape(self.lag))
        return np.broadcast_shapes(*ends, *(profile.batch for profile in self.profiles))


@dataclass(frozen=True)
class PeriodicForce:
    """A force p(x) u, x = r Omega t/2 pi - lag.

    Parameters
    ----------
    name: what messages and results call it.
    direction: ``(..., n)``, u.
    profile: the function p of period 1; its mean counts.
    frequency_ratio, lag: as in :class:`Mesh`.
    mesh: the name of the mesh along whose direction its teeth exert it, so that the mesh force is k_i (g_i^T q - e_i) -
        p; "" of a force from outside.
    """

    name: str
    direction: Array
    profile: Profile
    frequency_ratio: Fraction | float = Fraction(1)
    lag: Array | float = 0.0
    mesh: str = ""

    @property
    def batch(self) -> tuple[int, ...]:
        """The common leading shape of all arrays."""
        return np.broadcast_shapes(np.shape(self.direction)[:-1], np.shape(self.lag), self.profile.batch)


class MachineElement(Enum):
    """The machine element that a connection stands for; its value is what results call it."""

    BEARING = "bearing"
    SHAFT = "shaft"


@dataclass(frozen=True)
class Connection:
    """A spring and a damper side by side, between bodies or to the housing: F = k r q + c r q'.

    Modal and Rayleigh damping and damping matrices have no place and are no part of F.

    Parameters
    ----------
    name: what results call it.
    part: what it is.
    row: ``(..., n)``, r; the deflection is r q.
    stiffness, damping: ``(...)``, k and c.
    unit: SI unit of F: ``N``, or ``N m`` of a twist.
    """

    name: str
    part: MachineElement
    row: Array
    stiffness: Array
    damping: Array
    unit: str = "N"

    def mapped(self, vector: Callable[[Array], Array]) -> Connection:
        """Return the connection with its row mapped."""
        return replace(self, row=vector(self.row))

    def scaled(self, mass: Array, stiffness: Array) -> Connection:
        """Return the connection in units of a mass and a stiffness."""
        drag = np.sqrt(mass * stiffness)
        return replace(self, stiffness=self.stiffness / stiffness, damping=self.damping / drag)

    def force(self, displacement: Array, velocity: Array) -> Array:
        """F ``(...)`` of a single system, from q and q' ``(..., n)``."""
        return np.asarray(self.stiffness * (displacement @ self.row) + self.damping * (velocity @ self.row))


def by_part(connections: Sequence[Connection]) -> dict[str, list[Connection]]:
    """Return the connections by what they are, in their order."""
    found: dict[str, list[Connection]] = {}
    for item in connections:
        found.setdefault(item.part.value, []).append(item)
    return found


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


def speed_factors(speed: Array, power: Array, softening: Array) -> Array:
    """Return W^power/(1 - a W^2), what the matrix of a term is multiplied by, of any broadcast shapes."""
    return np.asarray(speed**power / (1 - softening * speed**2))


def speed_factor_slopes(speed: Array, power: Array, softening: Array) -> Array:
    """Return the derivatives of :func:`speed_factors` with respect to the speed."""
    rest = 1 - softening * speed**2
    return np.asarray((power * speed ** (power - 1) + (2 - power) * softening * speed ** (power + 1)) / rest**2)
