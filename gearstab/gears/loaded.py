"""Static equilibrium of a loaded mesh with relief, of spur or helical teeth.

A pair of teeth j has the gap e_j along the line of action and carries k_j (delta - e_j) once the approach delta of the
gears closes it. Under the normal force F

    F = sum_j k_j max(delta - e_j, 0),

which is exact with gaps sorted: of the n smallest, delta = (F + sum k_j e_j)/sum k_j, n the first with
delta <= e_(n+1).

A mesh of helical teeth is slices of the face width, infinitely many. A slice at y of the face width b is a spur mesh of
the transverse section, delayed by u = eps_beta y/b. All slices approach by the same delta. With the stiffness K(t) of
one pair over the whole width and its gap e(t), t the mesh periods since it entered, 0 < t < eps_alpha,

    F = 1/eps_beta sum_j int_0^eps_beta K(x - u + j) max(delta - e(x - u + j), 0) du.

As a relief grows towards its end of contact, linearly or faster, e is convex, and a slice carries for t1 < t < t2, the
stretch with e < delta. So the contact line of the pair j reaches over [x + j - eps_beta, x + j] within [t1, t2], and
with A = int K dt and B = int K e dt over all these lines

    delta = (eps_beta F + B)/A,    k_T = A/eps_beta.

The force is convex in delta: from above, this formula with the lines of the last delta in place of those sought, which
is Newton's method, descends to the root. A point t carries at the phase x if the force with delta = e(t) is below F.
This is derived here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Self

import numpy as np
from numpy.polynomial import chebyshev

from gearstab.errors import NotPossible
from gearstab.gears.mesh_stiffness import StiffnessModel, resolved
from gearstab.gears.pair import Pair
from gearstab.gears.relief import APART, LoadedMesh, Relief, crossings, distinct, single_curve
from gearstab.waveforms.base import stiff_fraction, wrapped
from gearstab.waveforms.tooth import Piecewise

Array = np.ndarray


NARROW = 1e-8
"""An overlap ratio up to this is none: it would cost more digits in differences of integrals than it changes."""
STEPS = 60
"""Most steps of Newton's method; some five are taken."""
CONVERGED = 1e-11
"""Relative step of delta in Newton's method after which one more would be below rounding, of 1e-22."""


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
class LoadedSpur(LoadedMesh):
    """A loaded mesh of spur teeth.

    carrying: ``(B,)``, pairs in contact on each piece.
    """

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
        k = chebyshev.chebval(2 * (s - first) / (last - first) - 1, single_curve(self.pair, self.model))
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
        begin = distinct(known)
        touching = self.pair.contacts(0.5 * (begin + np.append(begin[1:], 1.0)))[1]
        found = crossings(begin, lambda x, piece: self.opening(x, touching[piece]) > 0)
        return distinct([*begin, *found])


def loaded_spur(pair: Pair, model: StiffnessModel, relief: Relief, force: float) -> LoadedSpur:
    """Return the loaded mesh of spur teeth; see :func:`loaded_mesh`."""
    teeth = _Pairs(pair, model, relief, force)
    edges = teeth.edges()
    k, e, touching = teeth.at(0.5 * (edges + np.append(edges[1:], 1.0)))
    _, carrying = equilibrium(k, e, force)

    def values(x: Array) -> tuple[Array, Array]:
        k, e, _ = teeth.at(x, touching[:, None])
        k = np.where(carrying[:, None], k, 0.0)
        total = k.sum(axis=-1)
        return total, (force + np.sum(k * e, axis=-1)) / total

    tangent, error = resolved(edges, values)
    return LoadedSpur(pair, model, tangent, relief, force, error, np.sum(carrying, axis=-1))


@dataclass(frozen=True)
class LoadedHelical(LoadedMesh):
    """A loaded mesh of helical teeth.

    Its ``transverse`` stiffness is that of a spur mesh in which a pair carries over the ``reach`` (t1, t2), the mean of
    all slices, and begins with it: averaged over the overlap, the mesh itself if slices did not differ.

    tangent: k_T(x).
    """

    tangent: Piecewise
    reach: tuple[float, float]

    @cached_property
    def curve(self) -> Piecewise:
        return self.tangent

    @property
    def contact_ratio(self) -> float:
        """Mean number of pairs that carry in a slice, which grows with the load."""
        return self.reach[1] - self.reach[0]

    @property
    def start(self) -> float:
        """The phase at which a pair begins to carry, at the leading face."""
        return float(wrapped(np.round(self.reach[0], 12)))


@dataclass(frozen=True)
class _Side:
    """The gap that falls from an end of contact inwards, over the distance from there in mesh periods.

    knots: ``(P + 1,)``, between which e is quadratic, up to its least. e: ``(P + 1,)``, there, m. slope, bend:
    ``(P,)``, of e - e(knot) = slope t + bend t^2 on the piece after each.
    """

    knots: Array
    e: Array
    slope: Array
    bend: Array

    @classmethod
    def of(cls, gap: Callable[[Array], Array], knots: Array) -> Self:
        """Take a gap given as a function, exactly, as forms of relief are quadratic."""
        length = np.where(np.diff(knots) > 0, np.diff(knots), 1.0)
        first, middle, last = (gap(knots[:-1] + part * np.diff(knots)) for part in (0.0, 0.5, 1.0))
        slope = (4 * middle - 3 * first - last) / length
        bend = 2 * (first - 2 * middle + last) / length**2
        return cls(knots, gap(knots), slope, bend)

    @property
    def vertices(self) -> Array:
        """``(P,)``, where e is least on each piece."""
        inside = np.where(self.bend > 0, -0.5 * self.slope / np.where(self.bend > 0, self.bend, 1.0), 0.0)
        return self.knots[:-1] + np.clip(inside, 0.0, np.diff(self.knots))

    def begin(self, delta: Array) -> Array:
        """Return the distance from which on e < delta: 0 where all of it is, the last knot where nothing is."""
        piece = np.clip(np.searchsorted(-self.e, -np.asarray(delta), side="right") - 1, 0, len(self.slope) - 1)
        short = np.maximum(self.e[piece] - delta, 0.0)
        slope, bend = np.minimum(self.slope[piece], 0.0), self.bend[piece]
        below = np.sqrt(np.maximum(slope**2 - 4 * bend * short, 0.0)) - slope
        after = np.where(short > 0, 2 * short / np.where(below > 0, below, 1.0), 0.0)
        return np.minimum(self.knots[piece] + after, self.knots[-1])


@dataclass(frozen=True)
class _Lines:
    """The contact lines of a mesh over its cycle."""

    pair: Pair
    model: StiffnessModel
    relief: Relief
    force: float

    @cached_property
    def knots(self) -> Array:
        """``(P + 1,)``, t of both ends of contact and of the beginnings of relief between them."""
        c, pitch, (first, last) = self.pair.contact_ratio, self.pair.base_pitch, self.pair.path
        inner = [end + way * item.length for item, end, way in self.relief.at_ends(self.pair)]
        inner = [(last - s if self.pair.wheel_drives else s - first) / pitch for s in inner]
        return np.unique([0.0, c, *(t for t in inner if APART < t < c - APART)])

    @cached_property
    def offsets(self) -> Array:
        """``(N,)``, j of all pairs that may touch."""
        return np.arange(int(self.pair.total_contact_ratio) + 1)

    def stiffness(self, t: Array) -> Array:
        """K(t), N/m."""
        u = 2 * np.asarray(t) / self.pair.contact_ratio - 1
        return np.asarray(chebyshev.chebval(-u if self.pair.wheel_drives else u, single_curve(self.pair, self.model)))

    def gap(self, t: Array) -> Array:
        """e(t), m."""
        along, (first, last) = np.asarray(t) * self.pair.base_pitch, self.pair.path
        return self.relief.gap(self.pair, last - along if self.pair.wheel_drives else first + along)

    @cached_property
    def sides(self) -> tuple[_Side, _Side]:
        """The gaps from entry and from exit up to where they are least."""
        c, points = self.pair.contact_ratio, np.append(self.knots, _Side.of(self.gap, self.knots).vertices)
        bottom = float(points[np.argmin(self.gap(points))])
        left = np.append(self.knots[self.knots < bottom], bottom) if bottom > 0 else np.zeros(2)
        right = np.append(c - self.knots[self.knots > bottom][::-1], c - bottom) if bottom < c else np.zeros(2)
        return _Side.of(self.gap, left), _Side.of(lambda t: self.gap(c - t), right)

    def reach(self, delta: Array) -> tuple[Array, Array]:
        """Return (t1, t2), of the shape of delta each."""
        entry, exit_ = self.sides
        return entry.begin(delta), self.pair.contact_ratio - exit_.begin(delta)

    @cached_property
    def primitives(self) -> Array:
        """``(D, P, 2)``, Chebyshev coefficients of A(t) and B(t) on each piece between knots."""
        degree, length = len(single_curve(self.pair, self.model)) + 1, np.diff(self.knots)
        points = chebyshev.chebpts1(degree + 1)
        t = self.knots[:-1] + np.multiply.outer(points + 1, 0.5 * length)
        stiffness = self.stiffness(t)
        both = np.stack([stiffness, stiffness * self.gap(t)], axis=-1)
        found = chebyshev.chebfit(points, both.reshape(degree + 1, -1), degree).reshape(both.shape)
        found = chebyshev.chebint(found, lbnd=-1) * (0.5 * length)[:, None]
        found[0, 1:] += np.cumsum(np.sum(found, axis=0), axis=0)[:-1]
        return found

    def integrals(self, t: Array) -> Array:
        """(A, B) from 0 to t, ``(2, ...)``."""
        piece = np.clip(np.searchsorted(self.knots, t, side="right") - 1, 0, len(self.knots) - 2)
        u = 2 * (t - self.knots[piece]) / np.diff(self.knots)[piece] - 1
        return np.asarray(chebyshev.chebval(u, np.moveaxis(self.primitives[:, piece], -1, 1), tensor=False))

    def lines(self, x: Array, delta: Array) -> tuple[Array, Array]:
        """Return t at both ends of the lines in contact at the phases x with approaches delta, ``(..., N)`` each."""
        ends = np.asarray(x)[..., None] + self.offsets
        t1, t2 = (t[..., None] for t in self.reach(delta))
        return np.clip(ends - self.pair.overlap_ratio, t1, t2), np.clip(ends, t1, t2)

    def carried(self, x: Array, delta: Array) -> Array:
        """(A, B) over these lines, ``(2, ...)``."""
        low, high = self.lines(x, delta)
        return np.sum(self.integrals(high) - self.integrals(low), axis=-1)

    def solved(self, x: Array) -> tuple[Array, Array, Array, Array]:
        """Return k_T and delta at the phases x, and the integrals of dt and of t dt over the lines by eps_beta."""
        overlap = self.pair.overlap_ratio
        delta = np.full(np.shape(x), np.inf)
        for _ in range(STEPS):
            total, closing = self.carried(x, delta)
            last, delta = delta, (overlap * self.force + closing) / total
            if np.all(last - delta <= CONVERGED * delta):
                break
        low, high = self.lines(x, delta)
        sums = (np.sum(part, axis=-1) / overlap for part in (high - low, 0.5 * (high**2 - low**2)))
        return self.carried(x, delta)[0] / overlap, delta, *sums

    def carrying(self, x: Array) -> Array:
        """Whether the ends of all lines, and the knots of the path, carry at the phases x, ``(..., 2 N + P + 1)``."""
        c, overlap = self.pair.contact_ratio, self.pair.overlap_ratio
        ends = np.asarray(x)[..., None] + self.offsets
        knots = np.broadcast_to(self.knots, (*np.shape(x), len(self.knots)))
        t = np.concatenate([ends, ends - overlap, knots], axis=-1)
        delta = self.gap(np.clip(t, 0.0, c))
        total, closing = self.carried(np.asarray(x)[..., None], delta)
        return (t >= 0) & (t <= c) & (delta * total - closing < overlap * self.force)

    def edges(self) -> Array:
        """``(B,)``, phases where an end of a line passes a knot or an end of what carries, or that reaches a knot."""
        begin = distinct([*self.knots, *(self.knots + self.pair.overlap_ratio)])
        return distinct([*begin, *crossings(begin, lambda x, piece: self.carrying(x))])


def loaded_helical(pair: Pair, model: StiffnessModel, relief: Relief, force: float) -> LoadedHelical:
    """Return the loaded mesh of helical teeth; see :func:`loaded_mesh`."""
    lines = _Lines(pair, model, relief, force)
    tangent, error, pairs, moment = resolved(lines.edges(), lines.solved)
    count = float(pairs.mean)
    begin, end = float(moment.mean) / count + 0.5 * np.array([-count, count])

    def spur(x: Array) -> tuple[Array]:
        """Return the transverse stiffness at phases since a pair began to carry."""
        t = x[..., None] + np.arange(int(end - begin) + 1)
        k = lines.stiffness(np.clip(begin + t, begin, end))
        return (np.sum(np.where(t < end - begin, k, 0.0), axis=-1),)

    (transverse,) = resolved(np.array([0.0, stiff_fraction(end - begin)]), spur)
    return LoadedHelical(pair, model, transverse, relief, force, error, tangent, (float(begin), float(end)))


@lru_cache(maxsize=1024)
def loaded_mesh(pair: Pair, model: StiffnessModel, relief: Relief, force: float) -> LoadedSpur | LoadedHelical:
    """Tangent stiffness and static transmission error of a mesh with relief under a normal force, along the
    (transverse) line of action.

    force: F > 0, N. Raises NotPossible for a force that is not positive, a total contact ratio below 1, and a model in
    which pairs influence each other or the stiffness is stretched: the gaps need the stiffness of each pair.
    """
    if model.double_contact_factor != 1 or model.variation is not None:
        key = "double_contact_factor" if model.double_contact_factor != 1 else "variation"
        raise NotPossible("relief needs the stiffness of each pair of teeth by itself", f"remove {key} or relief")
    if pair.total_contact_ratio < 1:
        raise NotPossible(f"contact breaks off: contact ratio {pair.total_contact_ratio:.4f}")
    if not force > 0:
        raise NotPossible(f"relief needs a positive force on the teeth, not {force:.6g} N", "give a torque")
    loaded = loaded_helical if pair.overlap_ratio > NARROW else loaded_spur
    return loaded(pair, model, relief, force)
