"""Profile relief: the material taken off the flanks, and a mesh under load whose pairs of teeth have gaps.

delta over the mesh cycle, the approach of the gears under a constant normal force F, is the static transmission error.
Small vibration about this state has the tangent stiffness k_T = dF/d delta, that of all contact there is, and not the
secant F/delta: N = F + k_T (q - delta). Gaps and forces count along the (transverse) line of action.

Limits: pairs deflect independently of each other, and touch on the path of contact of rigid teeth only.

Sources: Harris 1958 (Proc. I. Mech. E. 172, 87-112) for relief and load; Bahk & Parker 2013 (J. Mech. Des. 135, 121002)
for the tangent stiffness; the rest is derived here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.polynomial import chebyshev

from gearstab.gears.mesh_stiffness import DEGREES, RESOLVED, MeshStiffness, StiffnessModel, single_stiffness
from gearstab.gears.pair import Pair
from gearstab.waveforms import Profile
from gearstab.waveforms.base import wrapped
from gearstab.waveforms.tooth import Piecewise, Tooth

Array = np.ndarray

SCAN = 65
"""Points of a piece of the mesh cycle at which changes of contact are looked for: a contact that comes and goes within
one step is missed."""
SECTIONS, ROUNDS = 8, 16
"""Parts that a step of the scan is cut into, again and again, down to rounding: arrays cost less than rounds."""
APART = 1e-10
"""Part of a cycle: edges closer than this are one."""


@dataclass(frozen=True)
class FlankRelief:
    """Material taken off a flank, depth amount (1 - d/length)^power at the distance d < length from its end.

    amount: along the line of action, m. length: along the path of contact, m. power: 1 linear, 2 parabolic.
    """

    amount: float
    length: float
    power: int = 1

    def depth(self, distance: Array) -> Array:
        """Return the depth at distances from the end of contact, m."""
        part: Array = self.amount * np.clip(1 - distance / self.length, 0.0, None) ** self.power
        return part


@dataclass(frozen=True)
class Relief:
    """Relief of both gears of a pair.

    wheel_tip, pinion_root act where the wheel's tip touches the pinion's root, pinion_tip and wheel_root at the other
    end of the path of contact.
    """

    pinion_tip: FlankRelief | None = None
    pinion_root: FlankRelief | None = None
    wheel_tip: FlankRelief | None = None
    wheel_root: FlankRelief | None = None

    def at_ends(self, pair: Pair) -> list[tuple[FlankRelief, float, int]]:
        """Return each relief with s of its end of contact and the direction, in s, from there along the path."""
        first, last = pair.path
        found = [(self.wheel_tip, first, 1), (self.pinion_root, first, 1)]
        found += [(self.pinion_tip, last, -1), (self.wheel_root, last, -1)]
        return [(item, end, way) for item, end, way in found if item is not None]

    def gap(self, pair: Pair, s: Array) -> Array:
        """e, m, of a pair of teeth that touches at s."""
        depths = [item.depth(way * (s - end)) for item, end, way in self.at_ends(pair)]
        return np.sum(depths, axis=0) if depths else np.zeros(np.shape(s))


NO_RELIEF = Relief()


@dataclass(frozen=True)
class LoadedMesh(MeshStiffness):
    """The tangent stiffness of a mesh under load, with the static transmission error.

    Parameters
    ----------
    relief, force: what it was computed for; F in N.
    error: delta(x), m.
    """

    relief: Relief
    force: float
    error: Piecewise

    @cached_property
    def waveform(self) -> Tooth:
        return Tooth(self.curve)

    @property
    def mean_error(self) -> float:
        """Mean of delta, m."""
        return float(self.error.mean)

    @property
    def peak_to_peak(self) -> float:
        """Greatest less least delta, m."""
        low, high = self.error.extremes
        return float(high - low)

    @property
    def secant(self) -> float:
        """F over the mean of delta, N/m, which is no stiffness of small vibration."""
        return self.force / self.mean_error


@lru_cache(maxsize=1024)
def single_curve(pair: Pair, model: StiffnessModel) -> Array:
    """Chebyshev coefficients of the stiffness of a pair along its path of contact, -1 to 1."""
    first, last = pair.path
    for degree in DEGREES:
        points = chebyshev.chebpts1(degree + 1)
        values = single_stiffness(pair, first + 0.5 * (last - first) * (points + 1), model)
        found: Array = chebyshev.chebfit(points, values, degree)
        if np.max(np.abs(found[-2:])) < RESOLVED * np.max(np.abs(found)):
            break
    return found


def crossings(begin: Array, above: Callable[[Array, Array], Array]) -> Array:
    """Return the phases at which any of M conditions begins or ceases to hold.

    begin: ``(B,)``, where pieces of the cycle begin, the first at 0. above: takes phases and the pieces they lie in, of
    one shape ``(...)``, and returns ``(..., M)``. Those that begin and cease within a step of the scan are missed.
    """
    ends = np.append(begin[1:], 1.0)
    pieces = np.arange(len(begin))
    x = begin[:, None] + (ends - begin)[:, None] * np.linspace(0.0, 1.0, SCAN)
    holds = above(x, np.broadcast_to(pieces[:, None], x.shape))
    piece, step, of = np.nonzero(holds[:, 1:] != holds[:, :-1])
    low, high, first = x[piece, step], x[piece, step + 1], holds[piece, step, of]
    row, parts = np.arange(len(of)), np.arange(SECTIONS + 1) / SECTIONS
    for _ in range(ROUNDS if len(of) else 0):
        x = low[:, None] + (high - low)[:, None] * parts
        holds = above(x, np.broadcast_to(piece[:, None], x.shape))[row, :, of]
        changed = np.maximum(np.argmax(holds != first[:, None], axis=1), 1)
        low, high = x[row, changed - 1], x[row, changed]
    return np.asarray(0.5 * (low + high))


def distinct(phases: Sequence[float]) -> Array:
    """Phases in [0, 1) in order, those that are one but for rounding left out, 0 the first."""
    ordered = np.unique(wrapped(np.asarray([0.0, *phases])))
    ordered = ordered[ordered < 1 - APART]
    return np.asarray(ordered[np.diff(ordered, prepend=-1.0) > APART])


@dataclass(frozen=True)
class ReliefForce:
    """Force that relief takes off a mesh, k(x) delta(x) - F: N = k q - (k delta - F); a :class:`Profile`.

    stiffness: k at the phase x - start; error: delta; force: F ``(...)``.
    """

    stiffness: Profile
    start: Array
    error: Piecewise
    force: Array

    @property
    def piecewise_constant(self) -> bool:
        return self.stiffness.piecewise_constant and self.error.piecewise_constant

    @property
    def batch(self) -> tuple[int, ...]:
        return np.broadcast_shapes(self.stiffness.batch, np.shape(self.start), self.error.batch, np.shape(self.force))

    def value(self, x: Array) -> Array:
        return self.stiffness.value(np.asarray(x) - self.start) * self.error.value(x) - self.force

    def breakpoints(self) -> Array:
        found = [
            wrapped(self.stiffness.breakpoints() + np.asarray(self.start)[..., None]),
            self.error.breakpoints(),
        ]
        return np.concatenate([np.broadcast_to(part, (*self.batch, part.shape[-1])) for part in found], axis=-1)
