"""How a small deviation of the state travels with a motion that has loss of contact.

Between two changes of contact the deviation obeys the linear equation of the motion itself, d' = A(t) d, and its matrix
over a piece is the Taylor series by which the piece was found. A change of contact adds a saltation matrix

    S = I + (f+ - f-) n^T/(n^T f-),

n the gradient of the deflection, f-+ the rates of the state before and after. The elastic mesh force is continuous,
which leaves S = I but for dampings that act in contact only: f+ - f- = D v, v the speed of the deflection. S carries
what D does to velocities over to positions, whatever the speed. A touch of speed 0 is no exception.

Source: Leine & Nijmeijer 2004, chapter 7 (saltation matrices).
"""

from __future__ import annotations

import numpy as np

from gearstab.response.backlash.contact import KINDS
from gearstab.response.backlash.dynamics import DEGREE, Dynamics
from gearstab.response.backlash.follow import Track
from gearstab.system import Array


def factors(model: Dynamics, track: Track, elastic: Array) -> Array:
    """``(F, m, m)``: the matrices that a deviation of the elastic state meets on its way, the first one first.

    elastic: which states are.
    """
    contacts, which = np.unique(track.contact, axis=0, return_inverse=True)
    row, column = np.ix_(elastic, elastic)
    constant, parts = (part[..., row, column][np.ravel(which)] for part in model.generators(contacts))
    generators = np.einsum("skj,sjab->skab", track.values, parts)
    generators[:, 0] += constant
    found = _flows(generators * track.length[:, None, None, None])
    ends = np.flatnonzero(track.mesh >= 0)
    jumps = _saltations(model, track[ends])[:, row, column]
    return np.insert(found, ends + 1, jumps, axis=0)


def _flows(generators: Array) -> Array:
    """``(S, m, m)``, y(1) of y' = sum_i u^i G_i y, y(0) = I, for ``(S, order, m, m)``."""
    size, order = generators.shape[-1], generators.shape[1]
    terms = [np.broadcast_to(np.eye(size), (len(generators), size, size))]
    for k in range(DEGREE):
        following = generators[:, 0] @ terms[k]
        for i in range(1, min(order, k + 1)):
            following = following + generators[:, i] @ terms[k - i]
        terms.append(following / (k + 1))
    return np.asarray(sum(reversed(terms)))


def _saltations(model: Dynamics, ends: Track) -> Array:
    """``(E, m, m)``, S of the changes of contact at the ends of pieces."""
    m, n = model.size, model.size // 2
    carried = model.carriers == ends.mesh[:, None]
    acting = np.tensordot(ends.values.sum(axis=1) * carried, model.parts[:, :m, n:m], axes=1)
    acting -= model.drags[ends.mesh, :m, n:m]
    found = np.tile(np.eye(m), (len(acting), 1, 1))
    sign = np.where(ends.kind == KINDS.index("separation"), -1.0, 1.0)
    found[:, :, :n] += sign[:, None, None] * acting / np.diagonal(model.fixed[:n, n:m])
    return found
