"""Teeth with play, which of their flanks carry, and the motion between two events as a polynomial of time.

With a given contact of every mesh the motion is linear, y' = G(t) y for y = (x, S z): the state in the modes of the
mean system, and the harmonics of what drives it (:mod:`gearstab.propagation.equation`), scaled by S. Where all is
constant a piece of it is the Taylor series of exp(G t), to 2^-52; where functions vary smoothly, Picard iteration on
Chebyshev nodes, in pieces so short that the last Chebyshev coefficients are below a tolerance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import factorial

import numpy as np

from gearstab import ckernel
from gearstab.errors import NotPossible
from gearstab.modal import mean_modes, static_equilibrium
from gearstab.propagation.segment import augmented
from gearstab.response.steady import Driven
from gearstab.system import Array, GearSystem

UPPER, APART, LOWER = 1, 0, -1
"""States of a mesh's contact: x = g_i^T q - e_i above, within or below its play."""

KINDS = ("separation", "drive_side_contact", "coast_side_contact")
"""Events of a mesh."""

MOST_STATES = 200
"""Combinations of contacts that a static equilibrium is sought in."""
BALANCED = 1e-9
"""Part of the largest load: a smaller one is none, and a smaller imbalance of an equilibrium is rounding."""
ROUNDING = 1e-13
"""Part of the terms of a deflection: a smaller one is some rounding errors of theirs, 2e-16 each."""
FREE = 1e-12
"""Part of the largest stiffness, of modes in units of their own: motions of a smaller one are free but for rounding."""


@dataclass(frozen=True)
class Play:
    """The play of every mesh of a single system.

    low, high: ``(meshes,)``; the mesh force is k_i (x - high) above, 0 within and k_i (x - low) below. Both are 0 of a
        mesh without backlash.
    has: ``(meshes,)`` bool, whether a mesh has backlash at all.
    drive: ``(meshes,)``, UPPER or LOWER: the side that carries the static load; UPPER without load.
    """

    low: Array
    high: Array
    has: Array
    drive: Array

    @property
    def width(self) -> Array:
        """2 b."""
        return self.high - self.low

    def contact(self, x: Array) -> Array:
        """UPPER, APART or LOWER for deflections ``(..., meshes)``; UPPER where there is no backlash."""
        state = np.where(x > self.high, UPPER, np.where(x < self.low, LOWER, APART))
        return np.where(self.has, state, UPPER)

    def touching(self, x: Array, contact: Array, near: Array) -> Array:
        """Whether deflections ``(meshes,)`` are as near as that to a flank that bounds their contact."""
        upper, lower = np.abs(x - self.high) <= near, np.abs(x - self.low) <= near
        return np.where(contact == APART, upper | lower, np.where(contact == UPPER, upper, lower))

    def offset(self, contact: Array) -> Array:
        """The deflection ``(..., meshes)`` at which the force of a mesh in contact is zero."""
        return np.where(contact == LOWER, self.low, self.high)

    def kind(self, mesh: int, contact: int) -> int:
        """Return the kind of a change of a mesh into ``contact``, as a position in KINDS."""
        return 0 if contact == APART else 1 if contact == self.drive[mesh] else 2


def play(system: GearSystem) -> Play:
    """The play of a single system. Raises NotPossible where the drive side of a mesh is needed and not known."""
    width = np.array([float(np.asarray(mesh.backlash)) for mesh in system.meshes])
    side = _sides(system)
    low, high = -0.5 * width, 0.5 * width
    for i, mesh in enumerate(system.meshes):
        if width[i] > 0 and mesh.backlash_zero == "drive_side":
            if side[i] == 0:
                raise NotPossible(
                    f"mesh {mesh.name} carries no load, so that it has no drive side: use backlash_zero: middle"
                )
            low[i], high[i] = (-width[i], 0.0) if side[i] > 0 else (0.0, width[i])
    return Play(low, high, width > 0, np.where(side < 0, LOWER, UPPER))


def directions(system: GearSystem) -> Array:
    """g ``(meshes, n)``, which makes deflections of coordinates."""
    return np.stack([np.asarray(mesh.direction, dtype=float) for mesh in system.meshes])


def _sides(system: GearSystem) -> Array:
    """The flank ``(meshes,)`` that the static load presses on; APART where it does not, but for rounding."""
    q = static_equilibrium(system)
    g = directions(system)
    x = g @ q
    load = np.array([float(mesh.mean_stiffness) for mesh in system.meshes]) * x
    loaded = np.abs(load) > BALANCED * np.max(np.abs(load), initial=0.0)
    return np.where(loaded & (np.abs(x) > ROUNDING * (np.abs(g) @ np.abs(q))), np.sign(x), APART).astype(int)


def resting(system: GearSystem, teeth: Play) -> Array:
    """q ``(n,)`` of the static equilibrium under the constant load, at the mean stiffness, on the flanks.

    K0 q + sum_i k_gi g_i (g_i^T q - offset_i) = f0 with the sum over the meshes in contact, sought from that of teeth
    without play on. Rigid-body motion is left out, as in
    :func:`~gearstab.modal.static_equilibrium`.

    Raises NotPossible where there is none, or none is found.
    """
    modes = mean_modes(system)
    shapes = modes.shapes[:, ~modes.rigid]
    k = np.array([float(mesh.mean_stiffness) for mesh in system.meshes])
    load = np.zeros(system.size) if system.load is None else np.asarray(system.load, dtype=float)
    contact = np.where(teeth.has, _sides(system), UPPER)
    # Modes in units of their own stiffness: beside a stiff one a soft one would drown in rounding errors.
    scale = 1 / np.sqrt(modes.natural_scale[~modes.rigid])
    gauge, pull = directions(system) @ shapes * scale, shapes.T @ load * scale
    constant = shapes.T @ system.stiffness @ shapes * scale * scale[:, None]
    for _ in range(MOST_STATES):
        closed = contact != APART
        matrix = constant + (gauge[closed].T * k[closed]) @ gauge[closed]
        force = pull + gauge[closed].T @ (k * teeth.offset(contact))[closed]
        amplitudes, free = _solved(matrix, force)
        # Teeth that are apart may leave motions free; of all equilibria this is the smallest.
        free *= scale[:, None]
        found = scale * amplitudes - free @ np.linalg.lstsq(free, scale * amplitudes)[0]
        # Teeth that just touch carry nothing: which side of the flank they are on is for rounding to say.
        x, terms = gauge @ (found / scale), np.abs(gauge) @ np.abs(found / scale)
        following = np.where(teeth.touching(x, contact, ROUNDING * terms), contact, teeth.contact(x))
        if np.array_equal(following, contact):
            size = max(np.abs(force).max(initial=0.0), np.abs(pull).max(initial=0.0))
            if np.abs(matrix @ amplitudes - force).max(initial=0.0) <= BALANCED * size:
                return np.asarray(shapes @ found)
            break
        contact = following
    raise NotPossible("no static equilibrium on the flanks of the teeth was found: give respond.initial")


def _solved(matrix: Array, force: Array) -> tuple[Array, Array]:
    """The smallest solution ``(m,)`` of least squares for a symmetric matrix, and the motions that are free ``(m, f)``.

    In the units of :func:`resting` stiffnesses are about 1, so that what is far below is a rounding error.
    """
    values, vectors = np.linalg.eigh(matrix)
    free = np.abs(values) <= FREE * np.abs(values).max(initial=0.0)
    bound = vectors[:, ~free]
    return bound @ (bound.T @ force / values[~free]), vectors[:, free]


REACH, DEGREE = 2.0, 24
"""|G| of a piece, and the degree of its Taylor series: 2^25/25! = 2e-18."""
NODES = 16
"""Chebyshev nodes of a cell where functions vary."""
TOLERANCE = 1e-12
"""Error of the motion where functions vary smoothly, relative, in a piece of it."""
MOST_HALVINGS = 40


@dataclass(frozen=True)
class Dynamics:
    """A single system at one mesh frequency whose teeth may part.

    motion: what would be followed if they did not; teeth: their play.
    fixed: ``(D, D)``, the part of G that is always there;  parts: ``(J, D, D)``, by the varying functions.
    pushes: ``(meshes, m)``, what stands in the column of z_0 for k_i offset_i.
    drags: ``(meshes, D, D)``, what is to be added while mesh i is apart.
    by_speed: ``(1 + meshes, D, D)``, what fixed and drags grow by with the mesh frequency, where modes do not.
    carriers: ``(J,)``, the mesh without whose contact a varying function does not act, or -1.
    gauge: ``(meshes, D)``: g_i^T q - e_i = gauge y;  deflection: ``(meshes, D)``, of g_i^T q; scale: S.
    """

    motion: Driven
    teeth: Play
    fixed: Array
    parts: Array
    pushes: Array
    drags: Array
    by_speed: Array
    carriers: Array
    gauge: Array
    deflection: Array
    scale: float

    @property
    def size(self) -> int:
        """m."""
        return self.motion.basis.size

    def whole(self, x: Array, tau: float) -> Array:
        """y from x at the time tau of the common period."""
        return np.concatenate([x, self.scale * self.motion.drive.z(np.array(tau))])

    def values(self, tau: Array) -> Array:
        """``(X, J)``, the varying functions at the times ``(X,)`` within the common period."""
        return np.asarray(self.motion.drive.varying(tau[None])[0])

    def at(self, omega: float) -> Dynamics:
        """Return the same at another mesh frequency, on which the modes may not depend."""
        fixed, drags = self.by_speed[0], self.by_speed[1:]
        more = omega - self.motion.omega
        motion = replace(self.motion, omega=omega)
        return replace(self, motion=motion, fixed=self.fixed + more * fixed, drags=self.drags + more * drags)

    def generators(self, contact: Array) -> tuple[Array, Array]:
        """Return the parts of G with contacts ``(..., meshes)``: constant, and ``(..., J, D, D)`` by functions."""
        closed = contact != APART
        acts = np.where(self.carriers >= 0, closed[..., self.carriers], True)
        parts = self.parts * acts[..., None, None]
        pushes = (closed * self.teeth.offset(contact))[..., None] * self.pushes
        parts[..., : closed.shape[-1], : self.size, self.size] += pushes
        return self.fixed + np.tensordot(~closed, self.drags, axes=1), parts

    def generator(self, values: Array, contact: Array) -> Array:
        """G ``(X, D, D)``."""
        constant, parts = self.generators(contact)
        return np.asarray(constant + np.tensordot(values, parts, axes=1))


def too_rough() -> NotPossible:
    """Message where no piece is short enough."""
    return NotPossible(f"mesh stiffness too rough for the tolerance {TOLERANCE:g} of motion with backlash")


def dynamics(system: GearSystem, motion: Driven, teeth: Play) -> Dynamics:
    """Prepare a single system. Raises NotPossible for a term that acts with a mesh and has a stiffness."""
    drive, basis, points = motion.drive, motion.basis, motion.points
    m, width, count = basis.size, drive.width, len(system.meshes)
    rate, omega = float(basis.rate[0]), float(points.omega[0])
    # Just before the edges, where a function that jumps there still has the value of the interval.
    usual = np.abs(drive.varying(drive.schedule.edges[:1] * (1 - 1e-12))[0]).max(axis=0)
    # Probes of that size: what belongs to a stiffness of 1 would drown in what is always there, were it 1e8.
    probes = np.concatenate([np.zeros((1, len(usual))), np.diag(np.where(usual > 0, usual, 1.0))])
    generators, constant, rates = points.equation.inputs(probes[:, None])
    a, by_speed = generators[:, 0] * rate, rates[0] * rate
    b = constant[:, 0] * rate + omega * by_speed
    directions = drive.directions[0]
    pushes = (basis.inlet[0] @ directions.T).T * rate
    force = np.abs(b[0]).max() + np.abs(b[1:] - b[0]).max(axis=(1, 2), initial=0.0).sum()
    force += usual[:count] @ (np.abs(pushes).max(axis=1) * np.abs([teeth.low, teeth.high]).max(axis=0))
    scale = float(force) / rate or 1.0
    turn = 2 * np.pi * drive.harmonics / motion.period
    whole = augmented(a, b / scale, turn)
    growth = np.zeros((1 + count, *whole.shape[1:]))
    growth[0] = augmented(np.zeros((m, m)), by_speed / scale, turn / omega)
    drags = np.zeros((count, m + width, m + width))
    drags[:, :m, :m] = pushes[:, :, None] * (drive.dampings[0, :, None] * (directions @ basis.speed[0]))[:, None]
    growth[1:, :m, m:] = -pushes[:, :, None] * (drive.dampings[0, :, None] * drive.slopes[0] / scale)[:, None]
    drags += omega * growth[1:]
    deflection = np.concatenate([directions @ basis.outlet[0], np.zeros((count, width))], axis=1)
    gauge = deflection.copy()
    gauge[:, m:] = -drive.errors[0] / scale
    parts = (whole[1:] - whole[0]) / probes.sum(axis=1)[1:, None, None]
    return Dynamics(
        motion, teeth, whole[0], parts, pushes / scale, drags, growth, _carriers(system, len(usual)), gauge, deflection,
        scale,
    )  # fmt: skip


def _carriers(system: GearSystem, count: int) -> Array:
    names = [mesh.name for mesh in system.meshes]
    found = list(range(len(names)))
    for term in system.terms:
        if term.mesh and term.stiffness is not None:
            raise NotPossible(f"term {term.name} has a stiffness that acts with a mesh: not available with backlash")
        found += [names.index(term.mesh) if term.mesh else -1] * len(term.profiles)
    return np.array(found + [-1] * (count - len(found)))


def _chebyshev() -> tuple[Array, Array, Array]:
    """Nodes in (0, 1); Chebyshev coefficients from values; powers from coefficients."""
    from numpy.polynomial import chebyshev as c

    angle = (np.arange(NODES)[::-1] + 0.5) * np.pi / NODES
    waves = 2 / NODES * np.cos(np.arange(NODES)[:, None] * angle)
    waves[0] /= 2
    powers = np.zeros((NODES, NODES))
    for k in range(NODES):
        # T_k(2 u - 1), by the coefficients of (2 u - 1)^j.
        for j, amount in enumerate(c.cheb2poly(np.eye(NODES)[k])):
            for i in range(j + 1):
                powers[i, k] += amount * factorial(j) / factorial(i) / factorial(j - i) * 2.0**i * (-1.0) ** (j - i)
    return 0.5 + 0.5 * np.cos(angle), waves, powers


POINTS, WAVES, POWERS = map(np.ascontiguousarray, _chebyshev())
"""Nodes, and ``(NODES, NODES)``: Chebyshev coefficients from values, powers from Chebyshev coefficients."""


PARABOLAS = 129
"""Between the values at so many, extremes are those of parabolas."""


def sampled(powers: Array, first: Array, u: Array, kept: int) -> Array:
    """``(X, kept)``: values of the first ``kept`` polynomials of group s at the places u[first[s]:first[s + 1]].

    powers: ``(S, degree + 1, D)``, coefficients of powers of u;  first: ``(S + 1,)``, from 0 to X;  u: ``(X,)``.
    """
    found = np.empty((len(u), kept))
    count, terms, size = powers.shape
    first = np.ascontiguousarray(first, dtype=np.int64)
    ckernel.library.sampled(count, terms - 1, size, kept, np.ascontiguousarray(powers), first, len(u), u, found)
    return found


def product(one: Array, other: Array) -> Array:
    """``(S, m + n + 1, C)``, coefficients of products of polynomials ``(S, m + 1, C)`` and ``(S, n + 1, C)``."""
    terms = other.shape[1]
    found = np.zeros((len(one), one.shape[1] + terms - 1, one.shape[2]))
    for i in range(one.shape[1]):
        found[:, i : i + terms] += one[:, i, None] * other
    return found


def extremes_of(powers: Array) -> tuple[Array, Array]:
    """Least and greatest value ``(S, C)`` on [0, 1] of the polynomials with the coefficients ``(S, degree + 1, C)``."""
    count, terms, size = powers.shape
    low, high = np.empty((2, count, size))
    ckernel.library.extremes(count, terms - 1, size, np.ascontiguousarray(powers), PARABOLAS, low, high)
    return low, high
