"""Static equilibrium of a loaded mesh of spur teeth with relief, and of any mesh.

A pair of teeth j has the gap e_j along the line of action and carries k_j (delta - e_j) once the approach delta of the
gears closes it. Under the normal force F

    F = sum_j k_j max(delta - e_j, 0),

which is exact with gaps sorted: of the n smallest, delta = (F + sum k_j e_j)/sum k_j, n the first with
delta <= e_(n+1).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial import chebyshev

from gearstab.errors import NotPossible
from gearstab.gears.loaded_helical import NARROW, LoadedHelical, loaded_helical
from gearstab.gears.mesh_stiffness import StiffnessModel, resolved
from gearstab.gears.pair import Pair
from gearstab.gears.relief import LoadedMesh, Relief, crossings, distinct, single_curve
from gearstab.waveforms.base import stiff_fraction, wrapped

Array = np.ndarray


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
