"""Profile relief: stiffness and static transmission error of a loaded mesh whose pairs of teeth have gaps.

A pair of teeth j has the gap e_j along the line of action and carries k_j (delta - e_j) once the approach delta of the
gears closes it. Under the normal force F

    F = sum_j k_j max(delta - e_j, 0),

which is exact with gaps sorted: of the n smallest, delta = (F + sum k_j e_j)/sum k_j, n the first with
delta <= e_(n+1). delta over the mesh cycle is the static transmission error. Small vibration about this state has the
tangent stiffness k_T = dF/d delta, the sum of k_j in contact, and not the secant F/delta: N = F + k_T (q - delta).

Limits: pairs deflect independently of each other, and touch on the path of contact of rigid teeth only.

Sources: Harris 1958 (Proc. I. Mech. E. 172, 87-112) for relief and load; Bahk & Parker 2013 (J. Mech. Des. 135, 121002)
for the tangent stiffness; the rest is derived here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.polynomial import chebyshev

from gearstab.errors import NotPossible
from gearstab.gears.mesh_stiffness import DEGREES, RESOLVED, MeshStiffness, StiffnessModel, single_stiffness
from gearstab.gears.pair import Pair
from gearstab.waveforms import Profile
from gearstab.waveforms.phase import stiff_fraction, wrapped
from gearstab.waveforms.tooth import Piecewise, Tooth, nodes, through

Array = np.ndarray

SCAN = 65
"""Points of a piece of the mesh cycle at which changes of contact are looked for: a contact that comes and goes within
one step is missed."""
HALVINGS = 52
"""Halvings of a step of the scan, down to rounding."""
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


def equilibrium(stiffness: Array, gap: Array, force: float) -> tuple[Array, Array]:
    """Return delta ``(...)`` and which pairs carry ``(..., N)`` under a normal force.

    stiffness: ``(..., N)``, k_j, 0 of pairs out of contact. gap: ``(..., N)``, e_j. force: F > 0, N.
    """
    lost = np.where(stiffness > 0, gap, np.inf)
    order = np.argsort(lost, axis=-1)
    e, k = (np.take_along_axis(part, order, axis=-1) for part in (lost, stiffness))
    total = np.cumsum(k, axis=-1)
    closing = np.cumsum(np.where(k > 0, k * np.where(k > 0, e, 0.0), 0.0), axis=-1)
    approach = (force + closing) / total
    following = np.concatenate([e[..., 1:], np.full((*e.shape[:-1], 1), np.inf)], axis=-1)
    first = np.argmax(approach <= following, axis=-1)[..., None]
    delta = np.take_along_axis(approach, first, axis=-1)
    return delta[..., 0], lost < delta


@dataclass(frozen=True)
class LoadedMesh(MeshStiffness):
    """The tangent stiffness of a mesh under load, with the static transmission error.

    Parameters
    ----------
    relief, force: what it was computed for; F in N.
    error: delta(x), m, on the pieces of the stiffness.
    carrying: ``(B,)``, pairs in contact on each piece.
    """

    relief: Relief
    force: float
    error: Piecewise
    carrying: Array

    @property
    def contact_ratio(self) -> float:
        """The mean number of pairs that carry, which grows with the load."""
        return float(np.sum(self.curve.lengths * self.carrying))

    @property
    def start(self) -> float:
        """The phase from which on more pairs than the fewest carry: the middle of that stretch less half of it."""
        more = self.carrying > int(self.contact_ratio)
        if not more.any():
            return 0.0
        edges = np.append(self.curve.edges, 1.0)
        turned = np.diff(np.exp(2j * np.pi * edges))[more].sum() / 2j
        start = np.angle(turned) / (2 * np.pi) - 0.5 * stiff_fraction(self.contact_ratio)
        return float(wrapped(np.round(start, 15)))

    @property
    def levels(self) -> tuple[float, float]:
        more = self.carrying > int(self.contact_ratio)
        lengths, means = self.curve.lengths, self.curve.means
        low, high = (
            float(np.sum((lengths * means)[part]) / lengths[part].sum()) if lengths[part].sum() > 0 else float("nan")
            for part in (~more, more)
        )
        return low, high

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
def _single_curve(pair: Pair, model: StiffnessModel) -> Array:
    """Chebyshev coefficients of the stiffness of a pair along its path of contact, -1 to 1."""
    first, last = pair.path
    for degree in DEGREES:
        points = chebyshev.chebpts1(degree + 1)
        values = single_stiffness(pair, first + 0.5 * (last - first) * (points + 1), model)
        found: Array = chebyshev.chebfit(points, values, degree)
        if np.max(np.abs(found[-2:])) < RESOLVED * np.max(np.abs(found)):
            break
    return found


@dataclass(frozen=True)
class _Pairs:
    """The pairs of teeth of a mesh: stiffness and gap at phases of its cycle."""

    pair: Pair
    model: StiffnessModel
    relief: Relief
    force: float

    def at(self, x: Array, touching: Array | None = None) -> tuple[Array, Array, Array]:
        """k_j, e_j, and which pairs may touch, ``(..., N)`` each. touching: known from elsewhere."""
        s, known = self.pair.contacts(x)
        touching = known if touching is None else touching
        first, last = self.pair.path
        s = np.clip(s, first, last)
        k = chebyshev.chebval(2 * (s - first) / (last - first) - 1, _single_curve(self.pair, self.model))
        return np.where(touching, k, 0.0), self.relief.gap(self.pair, s), touching

    def opening(self, x: Array, touching: Array) -> Array:
        """e_j - delta ``(..., N)``, of which a change of sign is a change of contact."""
        k, e, _ = self.at(x, touching)
        delta, _ = equilibrium(k, e, self.force)
        return np.where(touching, e - delta[..., None], 1.0)

    def edges(self) -> Array:
        """``(B,)``, phases where a pair enters or leaves, a relief begins, or the contact of a pair changes."""
        known = [0.0, float(stiff_fraction(self.pair.contact_ratio))]
        known += [self.pair.phase(end + way * item.length) for item, end, way in self.relief.at_ends(self.pair)]
        begin = _distinct(known)
        after = np.append(begin[1:], 1.0)
        x = begin[:, None] + (after - begin)[:, None] * np.linspace(0.0, 1.0, SCAN)
        touching = self.pair.contacts(0.5 * (begin + after))[1]
        open_ = self.opening(x, touching[:, None]) > 0
        piece, step, of = np.nonzero(open_[:, 1:] != open_[:, :-1])
        changes = self._changes(x[piece, step], x[piece, step + 1], of, touching[piece])
        return _distinct([*begin, *changes])

    def _changes(self, low: Array, high: Array, of: Array, touching: Array) -> Array:
        """Phases between low and high at which the pairs ``of`` begin or cease to carry."""
        index = np.arange(len(of))
        begin = self.opening(low, touching)[index, of] > 0
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            same = (self.opening(middle, touching)[index, of] > 0) == begin
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        return np.asarray(0.5 * (low + high))


def _distinct(phases: Sequence[float]) -> Array:
    """Phases in [0, 1) in order, those that are one but for rounding left out, 0 the first."""
    ordered = np.unique(wrapped(np.asarray([0.0, *phases])))
    ordered = ordered[ordered < 1 - APART]
    return np.asarray(ordered[np.diff(ordered, prepend=-1.0) > APART])


def loaded_mesh(pair: Pair, model: StiffnessModel, relief: Relief, force: float) -> LoadedMesh:
    """Tangent stiffness and static transmission error of a mesh with relief under a normal force, along the line of
    action.

    force: F > 0, N. Raises NotPossible for a force that is not positive, a contact ratio below 1, helical teeth, and a
    model in which pairs influence each other or the stiffness is stretched: the gaps need the stiffness of each pair.
    """
    if model.double_contact_factor != 1 or model.variation is not None:
        key = "double_contact_factor" if model.double_contact_factor != 1 else "variation"
        raise NotPossible("relief needs the stiffness of each pair of teeth by itself", f"remove {key} or relief")
    if pair.overlap_ratio:
        raise NotPossible("relief of helical teeth is not computed", "remove relief")
    if pair.contact_ratio < 1:
        raise NotPossible(f"contact breaks off: contact ratio {pair.contact_ratio:.4f}")
    if not force > 0:
        raise NotPossible(f"relief needs a positive force on the teeth, not {force:.6g} N", "give a torque")
    teeth = _Pairs(pair, model, relief, force)
    edges = teeth.edges()
    middles = 0.5 * (edges + np.append(edges[1:], 1.0))
    k, e, touching = teeth.at(middles)
    _, carrying = equilibrium(k, e, force)
    for degree in DEGREES:
        x = nodes(edges, degree)
        k, e, _ = teeth.at(x, touching[:, None])
        k = np.where(carrying[:, None], k, 0.0)
        total = k.sum(axis=-1)
        error = (force + np.sum(k * e, axis=-1)) / total
        curves = [through(edges, values) for values in (total, error)]
        sizes = [np.max(np.abs(curve.coefficients), axis=0) for curve in curves]
        if all(len(size) <= degree or np.max(size[-2:]) < RESOLVED * np.max(size) for size in sizes):
            break
    return LoadedMesh(pair, model, curves[0], relief, force, curves[1], np.sum(carrying, axis=-1))


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
