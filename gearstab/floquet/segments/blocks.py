"""Exact block reduction: parts of a system that its mesh stiffnesses never couple are solved by themselves.

With the elastic modes of the mean system as coordinates the equations are

    u'' + C u' + [W^2 + sum_i k_vi(t) delta_i delta_i^T] u = 0,

and all that varies is the matrix of the mesh stiffness variation, which takes one value per state: meshes whose
stiffness varies alike, k_vi = c_i f(t), enter through the single matrix sum_i c_i delta_i delta_i^T. In a basis in
which W^2, C and the variation of every state are block diagonal (:mod:`~gearstab.floquet.segments.decouple`) each
block is a system of its own:

* modes without mesh deflection do not vary at all; their exponents are those of a constant system;
* identical meshes in phase, as in a planetary gear, give one block for each type of mesh deflection, the types with two
  modes of each frequency two identical ones, of which one is solved (Parker 2009; Lin & Parker 1999 for the types).

Growth is the largest of all blocks, stability that of all, the exponents are those of the blocks together.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from gearstab.floquet.segments.decouple import SURE, adapted, close, cluster_start, components, tolerance
from gearstab.floquet.segments.pattern import Pattern, merged
from gearstab.floquet.segments.reduction import Elastic
from gearstab.grouping import equal_rows
from gearstab.modal import natural_scale, rounded, symmetric_eigen
from gearstab.system import Array

SMALLEST = 1e-6
"""Part of the largest natural frequency: the least size that couplings are compared with, which keeps what is left out
below the rounding error of the largest squared frequency.
"""


@dataclass(frozen=True)
class Block:
    """A part of the elastic coordinates that nothing couples to the others.

    pattern: the block as a pattern of its own; its ``rows`` are some of the rows of the whole. Rigid-body modes go with
        one block of each row.
    copies: how many identical blocks this one stands for.
    basis: ``(r, n, m)``, its coordinates in the elastic modes of the mean system.
    """

    pattern: Pattern
    copies: int
    basis: Array

    @property
    def constant(self) -> bool:
        """Whether its stiffness does not vary: modes without mesh deflection."""
        return self.pattern.constant


def split(pattern: Pattern) -> list[Block]:
    """The blocks of a pattern; the pattern itself is the only one where nothing can be separated."""
    rows, n = len(pattern.rows), pattern.size
    if n < 2:
        return [whole(pattern)]
    values, scale, family, backward = _family(pattern)
    open_rows = close(values, SURE).any(axis=1) | components(np.abs(family).max(axis=1) > SURE).any(axis=1)
    if not open_rows.any():
        return [whole(pattern)]
    basis = np.broadcast_to(np.eye(n), (rows, n, n)).copy()
    label = np.zeros((rows, n), dtype=int)
    members = np.flatnonzero(open_rows)
    none, turns = tolerance(values, family, backward), pattern.elastic.turns
    own = (values[members], family[members], none[members], None if turns is None else turns[members])
    basis[members], coupling = adapted(*own)
    coupled = coupling > none[members, None, None]
    label[members] = components(coupled | _through_rigid(pattern, members, basis[members], none[members]))
    back = np.swapaxes(basis, -1, -2)
    turned = back[:, None] @ family @ basis[:, None]
    label = _still_together(label, turned[:, : pattern.stiffness.shape[1]], none)
    mean = (back * values[:, None, :]) @ basis / (scale[:, :, None] * scale[:, None, :])
    turned = np.concatenate([turned, mean[:, None]], axis=1)
    found: list[Block] = []
    for index, key in equal_rows(label):
        if not key.any():
            found.append(whole(_rows(pattern, index)))
        else:
            found += _blocks(_rows(pattern, index), basis[index], turned[index], scale[index], none[index], key)
    return found


def whole(pattern: Pattern) -> Block:
    """A pattern as a single block."""
    n = pattern.size
    return Block(pattern, 1, np.broadcast_to(np.eye(n), (len(pattern.rows), n, n)))


def _rows(pattern: Pattern, index: Array) -> Pattern:
    """Some rows of a pattern, by position."""
    if len(index) == len(pattern.rows):
        return pattern
    own = {name: getattr(pattern, name)[index] for name in ("rows", "fractions", "start", "levels", "stiffness")}
    return replace(pattern, elastic=pattern.elastic.subset(index), **own)


def _family(pattern: Pattern) -> tuple[Array, Array, Array, Array]:
    """Squared mean frequencies and natural frequencies to compare with ``(r, n)``; all that couples modes ``(r, F, n,
    n)``: the variation of each state and the damping; and the backward error ``(r,)`` of the modes, the largest entry
    of the mean stiffness beside its diagonal.

    The entry pq of a stiffness is relative to w_p w_q, damping to its largest entry.
    """
    elastic = pattern.elastic
    mean = np.matmul(pattern.fractions[:, None], pattern.levels[:, pattern.states])[:, 0]
    g = elastic.directions
    outer = (g[..., :, None] * g[..., None, :]).reshape(*g.shape[:2], -1)
    variation = (pattern.levels - mean[:, None]) @ outer
    n = pattern.size
    total = elastic.static + (mean[:, None] @ outer).reshape(-1, n, n)
    values, magnitude = np.einsum("rii->ri", total), np.abs(np.einsum("rii->ri", elastic.static))
    magnitude = magnitude + np.max(np.abs(pattern.levels) @ g**2, axis=1)
    values = rounded(values, magnitude)
    scale = _scale(values, magnitude)
    size = scale[:, :, None] * scale[:, None, :]
    backward = (np.abs(total) / size * ~np.eye(n, dtype=bool)).max(axis=(1, 2))
    variation = variation.reshape(*variation.shape[:2], n, n) / size[:, None]
    if elastic.conservative:
        return values, scale, variation, backward
    damping = elastic.damping_matrix
    largest = np.abs(damping).max(axis=(1, 2))
    drag = [damping]
    if elastic.held:
        to_rigid = elastic.rigid_damping[..., :n]
        largest = np.maximum(largest, np.abs(elastic.rigid_damping).max(axis=(1, 2)))
        drag.append(np.swapaxes(to_rigid, -1, -2) @ to_rigid / largest[:, None, None])
    family = np.concatenate([variation, np.stack(drag, axis=1) / largest[:, None, None, None]], axis=1)
    return values, scale, family, backward


def _scale(values: Array, magnitude: Array) -> Array:
    """``(r, n)``, natural frequencies; the same for close ones, whose basis is turned, and not zero."""
    start = cluster_start(values)
    first = (start == np.arange(start.shape[1])).ravel()
    largest = np.maximum.reduceat(magnitude.ravel(), np.flatnonzero(first))[np.cumsum(first) - 1].reshape(start.shape)
    scale = np.sqrt(natural_scale(values, largest)[np.arange(len(start))[:, None], start])
    return np.maximum(scale, SMALLEST * scale.max(axis=1, keepdims=True))


def _through_rigid(pattern: Pattern, rows: Array, basis: Array, none: Array) -> Array:
    """``(r, n, n)``: coordinates that damping couples to rigid-body modes by more than ``none`` (r,), and so to each
    other.
    """
    drag = pattern.elastic.rigid_damping[rows]
    coupled = np.abs(drag[..., : pattern.size] @ basis).max(axis=1, initial=0.0)
    attached = coupled > none[:, None] * np.abs(drag).max(axis=(1, 2), initial=0.0)[:, None]
    return attached[:, :, None] & attached[:, None, :]


def _still_together(label: Array, variation: Array, none: Array) -> Array:
    """Blocks that do not vary as one; label ``(r, n)``, variation of the states ``(r, D, n, n)``, what counts as none
    ``(r,)``.
    """
    moves = np.abs(variation).max(axis=(1, 2)) > none[:, None]
    each = np.arange(label.shape[1])
    same = label[:, :, None] == label[:, None, :]
    still = ~np.any(same & moves[:, None, :], axis=2)
    first = np.where(still, each, len(each)).min(axis=1, keepdims=True)
    return np.where(still, first, label)


def _blocks(pattern: Pattern, basis: Array, turned: Array, scale: Array, none: Array, label: Array) -> Iterator[Block]:
    """The blocks of rows that split alike. Copies have coordinates from the same clusters, hence equal scales."""
    states = pattern.stiffness.shape[1]
    parts = [np.flatnonzero(label == name) for name in np.unique(label)]
    values = [turned[:, :, part[:, None], part] for part in parts]
    size = [scale[:, part] / scale.max(axis=1, keepdims=True) for part in parts]
    owner = _hub(pattern, basis, parts)
    alone = owner if pattern.elastic.held else -1
    taken: set[int] = set()
    for k, part in enumerate(parts):
        if k in taken:
            continue
        copies = [
            j
            for j in range(k + 1, len(parts))
            if j not in taken
            and alone not in (j, k)
            and _equal(values[k], values[j], none)
            and _equal(size[k], size[j], none)
        ]
        taken.update(copies)
        own = _natural(basis[:, :, part], values[k][:, -1], scale[:, part], none)
        elastic = _projected(pattern.elastic, own, k == owner)
        for index, state in equal_rows(_distinct(values[k][:, :states], none)):
            yield Block(_merged_states(pattern, elastic, index, state), 1 + len(copies), own[index])


def _natural(basis: Array, mean: Array, scale: Array, none: Array) -> Array:
    """``(r, n, m)``: the coordinates of a block, turned into modes of its mean stiffness ``(r, m, m)``, which is given
    over scale times scale: those of nearly equal frequencies have been mixed to separate the blocks.
    """
    mixed = (np.abs(mean) * ~np.eye(mean.shape[1], dtype=bool)).max(axis=(1, 2)) > none
    if not mixed.any():
        return basis
    turned = basis.copy()
    own = mean[mixed] * scale[mixed, :, None] * scale[mixed, None, :]
    turned[mixed] = basis[mixed] @ symmetric_eigen(own)[1]
    return turned


def _hub(pattern: Pattern, basis: Array, parts: list[Array]) -> int:
    """The block that the rigid-body modes go with: the one that damping couples to them."""
    drag = pattern.elastic.rigid_damping
    coupled = np.abs(drag[..., : pattern.size] @ basis).max(axis=(0, 1), initial=0.0)
    return int(np.argmax([coupled[part].max() for part in parts]))


def _equal(first: Array, second: Array, none: Array) -> bool:
    """Whether two blocks ``(r, ...)`` are the same within rounding, ``none`` (r,)."""
    if first.shape != second.shape:
        return False
    return bool(np.all(np.abs(first - second).reshape(len(none), -1).max(axis=1) <= none))


def _distinct(variation: Array, none: Array) -> Array:
    """``(r, D)``: for each state of ``(r, D, m, m)`` the first one that is equal to it and to none before.

    A wave of samples has thousands of states: only those are compared whose weighted means of the entries are close.
    """
    entries = variation.reshape(*variation.shape[:2], -1)
    weight = np.cos(np.arange(entries.shape[2]))
    measure = entries @ (weight / np.abs(weight).sum())
    result = np.tile(np.arange(measure.shape[1]), (len(measure), 1))
    for d in range(measure.shape[1] - 1):
        own = result[:, d] == d
        if not own.any():
            continue
        # Twice, so that the rounding of the mean loses no equal state.
        close_by = np.abs(measure[:, d + 1 :] - measure[:, d, None]) <= 2 * none[:, None]
        row, later = np.nonzero(close_by & own[:, None] & (result[:, d + 1 :] > d))
        later += d + 1
        same = np.abs(entries[row, later] - entries[row, d]).max(axis=1) <= none[row]
        result[row[same], later[same]] = d
    return result


def _merged_states(pattern: Pattern, elastic: Elastic, index: Array, state: Array) -> Pattern:
    """Some rows of a pattern as a block of elastic coordinates; ``state``: which earlier state each one equals."""
    whole = _rows(pattern, index)
    lengths = whole.fractions
    begin = whole.start[:, None] + np.cumsum(lengths, axis=1) - lengths
    sequence, fractions, start = merged(state[whole.states], lengths, begin, whole.closed)
    kept, states = np.unique(sequence, return_inverse=True)
    own = elastic.subset(index)
    levels = whole.levels[:, kept]
    stiffness = own.stiffness_of(levels)
    return Pattern(whole.rows, whole.cycles, fractions, start, states, levels, own, stiffness, whole.closed)


def _projected(elastic: Elastic, basis: Array, with_rigid: bool) -> Elastic:
    """Elastic coordinates restricted to the columns of ``basis`` (r, n, m)."""
    back = np.swapaxes(basis, -1, -2)
    n = basis.shape[1]
    drag = elastic.rigid_damping if with_rigid else elastic.rigid_damping[:, :0, :n]
    return replace(
        elastic,
        static=back @ elastic.static @ basis,
        directions=elastic.directions @ basis,
        damping=None if elastic.conservative else back @ elastic.damping_matrix @ basis,
        rigid_exponents=elastic.rigid_exponents if with_rigid else elastic.rigid_exponents[:, :0],
        rigid_damping=np.concatenate([drag[..., :n] @ basis, drag[..., n:]], axis=-1),
        turns=None,
    )
