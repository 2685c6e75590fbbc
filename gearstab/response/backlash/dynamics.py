"""The motion between two events as a polynomial of time, of as high a degree as rounding errors are worth.

With a given contact of every mesh the motion is linear, y' = G(t) y for y = (x, S z): the state in the modes of the
mean system, and the harmonics of what drives it (:mod:`gearstab.propagation.excitation`), scaled by S. Where all is
constant a piece of it is the Taylor series of exp(G t), to 2^-52; where functions vary smoothly, Picard iteration on
Chebyshev nodes, in pieces so short that the last Chebyshev coefficients are below a tolerance.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import factorial

import numpy as np

from gearstab.errors import NotPossible
from gearstab.propagation.segment import augmented
from gearstab.response.backlash.contact import APART, Play
from gearstab.response.linear.driven import Driven
from gearstab.system import Array, GearSystem

REACH, DEGREE = 2.0, 24
"""|G| of a piece, and the degree of its Taylor series: 2^25/25! = 2e-18."""
NODES = 16
"""Chebyshev nodes of a piece where functions vary."""
SHORTER = 1.0
"""|G| of such a piece at most, for Picard iteration to converge."""
MOST_SWEEPS = 60
MOST_HALVINGS = 40
MOST_KEPT = 512
"""Taylor series that are kept for further use."""


@dataclass(frozen=True)
class PolynomialPiece:
    """y(t + u length) = sum_k u^k powers_k for u in [0, 1]; ``powers (degree + 1, D)``."""

    length: float
    powers: Array

    def until(self, u: float) -> PolynomialPiece:
        """Its beginning, up to u."""
        scale = u ** np.arange(len(self.powers))
        return PolynomialPiece(self.length * u, self.powers * scale[:, None])

    def at(self, u: Array) -> Array:
        """``(X, D)``."""
        return np.asarray(np.vander(u, len(self.powers), increasing=True) @ self.powers)

    @property
    def end(self) -> Array:
        """y at u = 1."""
        return np.asarray(self.powers.sum(axis=0))


@dataclass(frozen=True)
class Dynamics:
    """A single system at one mesh frequency whose teeth may part.

    motion: what would be followed if they did not; teeth: their play.
    fixed: ``(D, D)``, the part of G that is always there;  parts: ``(J, D, D)``, by the varying functions.
    pushes: ``(meshes, m)``, what stands in the column of z_0 for k_i offset_i.
    drags: ``(meshes, D, D)``, what is to be added while mesh i is apart.
    carriers: ``(J,)``, the mesh without whose contact a varying function does not act, or -1.
    gauge: ``(meshes, D)``: g_i^T q - e_i = gauge y;  deflection: ``(meshes, D)``, of g_i^T q; scale: S.
    """

    motion: Driven
    teeth: Play
    fixed: Array
    parts: Array
    pushes: Array
    drags: Array
    carriers: Array
    gauge: Array
    deflection: Array
    scale: float
    kept: dict[bytes, tuple[float, Array]] = field(default_factory=dict)

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

    def generators(self, contact: Array) -> tuple[Array, Array]:
        """What G consists of with a contact ``(meshes,)``: what is always there, and ``(J, D, D)`` by the functions."""
        closed = contact != APART
        acts = np.where(self.carriers >= 0, closed[self.carriers], True)
        parts = self.parts * acts[:, None, None]
        parts[: len(closed), : self.size, self.size] += (closed * self.teeth.offset(contact))[:, None] * self.pushes
        return self.fixed + self.drags[~closed].sum(axis=0), parts

    def generator(self, values: Array, contact: Array) -> Array:
        """G ``(X, D, D)``."""
        constant, parts = self.generators(contact)
        return np.asarray(constant + np.tensordot(values, parts, axes=1))

    def constant(self, values: Array, contact: Array, y: Array, longest: float) -> PolynomialPiece:
        """A piece while all functions keep their ``values (J,)``, not longer than ``longest``."""
        key = values.tobytes() + contact.tobytes()
        if key not in self.kept:
            if len(self.kept) >= MOST_KEPT:
                self.kept.clear()
            self.kept[key] = _series(self.generator(values[None], contact)[0])
        length, series = self.kept[key]
        piece = PolynomialPiece(length, series @ y)
        return piece if length <= longest else PolynomialPiece(longest, piece.until(longest / length).powers)

    def varying(self, begin: float, contact: Array, y: Array, longest: float, tolerance: float) -> PolynomialPiece:
        """A piece while functions vary smoothly, from the time ``begin`` within the common period.

        Raises NotPossible where no piece is short enough for the tolerance, relative to the state.
        """
        length, period = longest, self.motion.period
        for _ in range(MOST_HALVINGS):
            at = (begin + length * POINTS) / period
            generator = self.generator(self.values(at), contact) * length
            size = float(np.abs(generator).sum(axis=2).max())
            if size > SHORTER:
                # A little shorter than this size asks for; not by more than a thousand for a spike at one node.
                length *= max(0.9 * SHORTER / size, 1e-3)
                continue
            y_at = _picard(generator, y)
            waves = WAVES @ y_at
            if np.abs(waves[-2:]).max() <= tolerance * np.abs(waves).max():
                powers = POWERS @ waves
                powers[0] = y
                return PolynomialPiece(length, powers)
            length *= 0.5
        raise too_rough(tolerance)


def too_rough(tolerance: float) -> NotPossible:
    """What is said where no piece is short enough."""
    return NotPossible(f"mesh stiffness too rough for the tolerance {tolerance:g} of motion with backlash")


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
    a, b = generators[:, 0] * rate, (constant[:, 0] + omega * rates[0]) * rate
    directions = drive.directions[0]
    pushes = (basis.inlet[0] @ directions.T).T * rate
    force = np.abs(b[0]).max() + np.abs(b[1:] - b[0]).max(axis=(1, 2), initial=0.0).sum()
    force += usual[:count] @ (np.abs(pushes).max(axis=1) * np.abs([teeth.low, teeth.high]).max(axis=0))
    scale = float(force) / rate or 1.0
    turn = 2 * np.pi * drive.harmonics / motion.period
    whole = augmented(a, b / scale, turn)
    drags = np.zeros((count, m + width, m + width))
    drags[:, :m, :m] = pushes[:, :, None] * (drive.dampings[0, :, None] * (directions @ basis.speed[0]))[:, None]
    slopes = omega * drive.dampings[0, :, None] * drive.slopes[0] / scale
    drags[:, :m, m:] = -pushes[:, :, None] * slopes[:, None]
    deflection = np.concatenate([directions @ basis.outlet[0], np.zeros((count, width))], axis=1)
    gauge = deflection.copy()
    gauge[:, m:] = -drive.errors[0] / scale
    parts = (whole[1:] - whole[0]) / probes.sum(axis=1)[1:, None, None]
    return Dynamics(
        motion, teeth, whole[0], parts, pushes / scale, drags, _carriers(system, len(usual)), gauge, deflection, scale
    )


def _carriers(system: GearSystem, count: int) -> Array:
    names = [mesh.name for mesh in system.meshes]
    found = list(range(len(names)))
    for term in system.terms:
        if term.mesh and term.stiffness is not None:
            raise NotPossible(f"term {term.name} has a stiffness that acts with a mesh: not available with backlash")
        found += [names.index(term.mesh) if term.mesh else -1] * len(term.profiles)
    return np.array(found + [-1] * (count - len(found)))


def _series(generator: Array) -> tuple[float, Array]:
    """The length of a piece, and ``(DEGREE + 1, D, D)``, (G length)^k/k!."""
    size = min(np.abs(generator).sum(axis=0).max(), np.abs(generator).sum(axis=1).max())
    length = REACH / float(size) if size > 0 else np.inf
    if not np.isfinite(length):
        length = 1.0
    series = np.empty((DEGREE + 1, *generator.shape))
    series[0] = np.eye(len(generator))
    for k in range(1, DEGREE + 1):
        series[k] = series[k - 1] @ (generator * (length / k))
    return length, series


def _picard(generator: Array, y: Array) -> Array:
    """y at the nodes ``(NODES, D)``: the fixed point of y + int G y, G ``(NODES, D, D)`` already times the length."""
    found = np.broadcast_to(y, (NODES, len(y)))
    for _ in range(MOST_SWEEPS):
        following = y + INTEGRAL @ np.einsum("xij,xj->xi", generator, found)
        change = np.abs(following - found).max()
        found = following
        # No more than a rounding error of the largest entry.
        if change <= 2e-16 * np.abs(found).max():
            break
    return np.asarray(found)


def _chebyshev() -> tuple[Array, Array, Array, Array]:
    """Nodes in (0, 1); Chebyshev coefficients from values; integrals from 0 to the nodes; powers from coefficients."""
    from numpy.polynomial import chebyshev as c

    angle = (np.arange(NODES)[::-1] + 0.5) * np.pi / NODES
    waves = 2 / NODES * np.cos(np.arange(NODES)[:, None] * angle)
    waves[0] /= 2
    integral = np.zeros((NODES, NODES))
    for k in range(NODES):
        primitive = c.chebint(np.eye(NODES)[k], lbnd=-1) / 2
        integral[:, k] = c.chebval(np.cos(angle), primitive)
    powers = np.zeros((NODES, NODES))
    for k in range(NODES):
        # T_k(2 u - 1), by the coefficients of (2 u - 1)^j.
        for j, amount in enumerate(c.cheb2poly(np.eye(NODES)[k])):
            for i in range(j + 1):
                powers[i, k] += amount * factorial(j) / factorial(i) / factorial(j - i) * 2.0**i * (-1.0) ** (j - i)
    return 0.5 + 0.5 * np.cos(angle), waves, integral @ waves, powers


POINTS, WAVES, INTEGRAL, POWERS = map(np.ascontiguousarray, _chebyshev())
"""Nodes, and ``(NODES, NODES)``: Chebyshev coefficients from values, integrals, powers from Chebyshev coefficients."""
