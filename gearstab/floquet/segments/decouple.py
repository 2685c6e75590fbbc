"""A basis in which a set of symmetric matrices is block diagonal in as many blocks as possible, for many rows at once.

Every block of a family of symmetric matrices {N_f} is an invariant subspace of all of them, hence of every member:
where the eigenvalues of one member differ its eigenvectors are the only choice, and the blocks are the connected
components of the graph of couplings. Where they are equal (or so close that rounding blurs the eigenvectors) the basis
is free:

1. inside a *cluster* of close eigenvalues generic combinations of the restricted family, and of its squares, are
   diagonalised, which separates all parts but identical copies of one block: the eigenspaces of a generic member of a
   matrix *-algebra (Murota, Kanno, Kojima & Kojima 2010, Japan J. Indust. Appl. Math. 27, 125-160);
2. what stays equal is m copies of one block. The couplings between two such m-fold eigenspaces are multiples of an
   orthogonal m x m matrix; turning one space by it aligns the copies, along a spanning tree of strongest couplings;
3. a generic combination may lie so that its eigenvectors are known to a few digits less than the family allows. One
   Gauss-Newton step makes the couplings between the blocks found so far least, for all members together.

A symmetry that the family has separates beforehand what it forbids to couple: nothing between vectors that it turns by
different angles is looked at, as it could be rounding only.

Blocks that are the real form of a complex Hermitian family (the translational modes of a planetary gear whose carrier
moves) have equal eigenvalues in pairs but no real basis that separates them; they stay whole.

Nothing is taken for granted: whatever the basis, blocks are joined wherever a coupling exceeds :func:`tolerance`, which
follows from the backward error of the eigenvectors that the family is given in.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np

from gearstab.grouping import equal_rows
from gearstab.system import Array

DISCARDED = 1e-12
"""Couplings below this part of the size of what they couple count as none, whatever the backward error. It moves no
frequency by more than this part: a region of instability that it might open is narrower than the rounding errors of the
mesh frequency's product with the period. Rounding alone leaves some 1e-14."""
MARGIN = 16.0
"""Couplings count as none up to this many times what the backward error of the coordinates explains."""
WORST = 1e-10
"""No coupling above this part counts as none, however large the backward error."""
TENTATIVE = 1e-8
"""Couplings below this part may be errors of the basis: they are made least before they are judged."""
UNKNOWN = 1e-14
"""Size of a squared singular value: turns that the family determines less well are left as they are."""
PURE = 1e-6
"""Cosines of angles of turn that differ by less are equal; of 30 planets the nearest are 0.02 apart."""
SURE = 1e-6
"""Couplings above this part are real whatever the rounding errors of the basis; so are larger gaps between
eigenvalues."""
CLOSE = 0.02
"""Eigenvalues closer than this part belong to one cluster, whose basis is found anew."""
EQUAL = 1e-7
"""Eigenvalues of a generic combination that are equal within this part belong to copies of one block: a member of the
family of less than FAINT is not scaled up further, and its rounding error of 1e-13 stays below this."""
FAINT = 1e-5
DEPTH = 3
"""Generic combinations that are tried on a cluster; two eigenvalues of one of them lie close by accident in a few per
cent of all cases."""


def close(values: Array, part: float) -> Array:
    """``(r, n - 1)``: which neighbours among ascending eigenvalues ``(r, n)`` differ by less than a part of them."""
    size = np.maximum(np.abs(values[:, 1:]), np.abs(values[:, :-1]))
    return values[:, 1:] - values[:, :-1] <= part * size


def cluster_start(values: Array) -> Array:
    """``(r, n)``: the position of the first eigenvalue of each one's cluster."""
    if values.shape[1] == 0:
        return np.zeros(values.shape, dtype=int)
    apart = np.concatenate([np.ones((len(values), 1), dtype=bool), ~close(values, CLOSE)], axis=1)
    return np.maximum.accumulate(np.where(apart, np.arange(values.shape[1]), 0), axis=1)


def components(linked: Array) -> Array:
    """Connected components of the graphs ``(r, n, n)`` bool; ``(r, n)``, the least member of each vertex's own."""
    n = linked.shape[-1]
    reach = (linked | np.eye(n, dtype=bool)).astype(np.float32)
    steps = 1
    while steps < n - 1:
        reach = np.minimum(reach @ reach, 1.0)
        steps *= 2
    return (reach > 0).argmax(axis=-1)


def tolerance(values: Array, family: Array, backward: Array) -> Array:
    """``(r,)``, what couplings of a family count as none: the error of its coordinates explains them.

    The given coordinates are the eigenvectors of the mean member up to e_pq = backward w_p w_q/|w_p^2 - w_q^2| for p, q
    of different clusters (inside of one the basis is found anew), so that a member N differs from what it should be by
    N e - e N.

    backward: ``(r,)``, the largest entry besides the diagonal of the mean member, relative to w_p w_q.
    """
    size = np.abs(values)
    gap = np.abs(values[:, :, None] - values[:, None, :])
    start = cluster_start(values)
    apart = start[:, :, None] != start[:, None, :]
    error = np.where(apart, np.sqrt(size[:, :, None] * size[:, None, :]) / np.where(apart, gap, 1.0), 0.0)
    largest = np.abs(family).max(axis=1) @ error
    noise = backward * (1.0 + 2.0 * largest.max(axis=(1, 2), initial=0.0))
    return np.clip(MARGIN * noise, DISCARDED, WORST)


def adapted(values: Array, family: Array, none: Array, turns: Array | None = None) -> tuple[Array, Array]:
    """Orthonormal basis ``(r, n, n)`` and the coupling ``(r, n, n)`` of its vectors, max_f |(Q^T N_f Q)_pq|.

    Parameters
    ----------
    values: ``(r, n)``, ascending eigenvalues of the member that is diagonal in the given coordinates.
    family: ``(r, F, n, n)``, the other members, of natural size 1.
    none: ``(r,)``, what counts as no coupling, :func:`tolerance`.
    turns: ``(r, s, n, n)``, the symmetric parts of turns of the system (:class:`~gearstab.system.Cyclic`), whose
        eigenvalues are cosines of angles. Vectors of different angles have the coupling 0 in rows where all members
        have the symmetry; in others it says nothing.
    """
    basis = np.broadcast_to(np.eye(values.shape[1]), family[:, 0].shape).copy()
    tied = np.zeros((len(values), values.shape[1] - 1), dtype=bool)
    offset = _offset(values)
    # In general position: the sum of the turns tells their angles apart.
    angle = None
    if turns is not None:
        each = [_symmetry(values, family, none, turns[:, k]) for k in range(turns.shape[1])]
        angle = np.einsum("k,krpq->rpq", np.sqrt(np.arange(1, len(each) + 1)), each)
    for rows, key in equal_rows(close(values, CLOSE).astype(np.int8)):
        if not key.any():
            continue
        members = np.concatenate([family[rows], family[rows] @ family[rows], offset[rows][:, None]], axis=1)
        for part in runs(key):
            if part.stop - part.start > 1:
                turned = None if angle is None else angle[rows][:, part, part]
                own, ties = _resolved(members[:, :, part, part], 0, turned)
                basis[rows, part, part] = own
                tied[rows, part.start : part.stop - 1] = ties
    coupling = _coupling(family, offset, basis)
    for rows, key in equal_rows(tied.astype(np.int8)):
        if key.any():
            aligned = _aligned(family[rows], basis[rows], runs(key))
            basis[rows], coupling[rows] = aligned, _coupling(family[rows], offset[rows], aligned)
    _refine(values, family, offset, none, basis, coupling)
    if angle is not None:
        cosine = np.einsum("rip,rip->rp", basis, angle @ basis)
        coupling[np.abs(cosine[:, :, None] - cosine[:, None, :]) > PURE] = 0.0
    return basis, coupling


def runs(joined: Array) -> list[slice]:
    """The runs of positions that ``joined`` (n - 1,) connects with their successors."""
    edges = [0, *(np.flatnonzero(~np.asarray(joined, dtype=bool)) + 1).tolist(), len(joined) + 1]
    return [slice(a, b) for a, b in pairwise(edges)]


def _offset(values: Array) -> Array:
    """The diagonal member as ``(r, n, n)``, each cluster of eigenvalues relative to its first and of size 1."""
    result = np.zeros((*values.shape, values.shape[1]))
    start = values[np.arange(len(values))[:, None], cluster_start(values)]
    each = np.arange(values.shape[1])
    result[:, each, each] = (values - start) / np.maximum(np.abs(values), np.finfo(float).tiny)
    return result


def _coupling(family: Array, offset: Array, basis: Array) -> Array:
    back = np.swapaxes(basis, -1, -2)
    largest = np.abs(back @ offset @ basis)
    for f in range(family.shape[1]):
        largest = np.maximum(largest, np.abs(back @ family[:, f] @ basis))
    return largest


def _symmetry(values: Array, family: Array, none: Array, turn: Array) -> Array:
    """``(r, n, n)``, the turn inside each cluster, beside which it is rounding; 0 in rows without the symmetry."""
    start = cluster_start(values)
    inside = start[:, :, None] == start[:, None, :]
    angle = np.where(inside, turn, 0.0)
    broken = np.abs(turn - angle).max(axis=(1, 2))
    for f in range(family.shape[1]):
        product = angle @ family[:, f]
        broken = np.maximum(broken, np.abs(product - np.swapaxes(product, -1, -2)).max(axis=(1, 2)))
    angle[broken > none] = 0.0
    return angle


def _refine(values: Array, family: Array, offset: Array, none: Array, basis: Array, coupling: Array) -> None:
    """Turn the bases of clusters so that couplings between different blocks become least, in place."""
    label = components(coupling > TENTATIVE)
    between = label[:, :, None] != label[:, None, :]
    error = np.where(between, coupling, 0.0).max(axis=(1, 2))
    start = cluster_start(values)
    # Rows that are near to being taken for coupled; others are decoupled well enough.
    (members,) = np.nonzero(error > 0.1 * none)
    for index, key in equal_rows(np.concatenate([label, start], axis=1)[members]):
        rows, count = members[index], values.shape[1]
        own = np.concatenate([family[rows], offset[rows][:, None]], axis=1)
        own = np.swapaxes(basis[rows], -1, -2)[:, None] @ own @ basis[rows][:, None]
        step = _least_couplings(own, key[:count], key[count:])
        half = 0.5 * (step - np.swapaxes(step, -1, -2))
        unit = np.eye(count)
        turned = basis[rows] @ np.linalg.solve(unit - half, unit + half)
        found = _coupling(family[rows], offset[rows], turned)
        better = np.where(between[rows], found, 0.0).max(axis=(1, 2)) < error[rows]
        basis[rows[better]], coupling[rows[better]] = turned[better], found[better]


def _least_couplings(members: Array, label: Array, start: Array) -> Array:
    """The upper part X of a skew matrix ``(r, n, n)`` for which the couplings N + N X - X N of blocks are least.

    members: ``(r, F, n, n)``, N. label: ``(n,)``, the block of each vector. start: ``(n,)``, its cluster; X turns
    vectors of one cluster only. For blocks A and B the squares of N_AB + N_AA X - X N_BB are least where

        sum_f [(N_AA^2) X - 2 N_AA X N_BB + X (N_BB^2)] = -sum_f [N_AA N_AB - N_AB N_BB].
    """
    step = np.zeros(members[:, 0].shape)
    names = np.unique(label)
    blocks = [np.flatnonzero(label == name) for name in names]
    for k, first in enumerate(blocks):
        for second in blocks[k + 1 :]:
            a, b = np.nonzero(start[first][:, None] == start[second][None, :])
            if len(a) == 0:
                continue
            left = members[:, :, first[:, None], first]
            right = members[:, :, second[:, None], second]
            across = members[:, :, first[:, None], second]
            square = (left @ left).sum(axis=1)[:, a[:, None], a] * (b[:, None] == b)
            square += (right @ right).sum(axis=1)[:, b[:, None], b] * (a[:, None] == a)
            square -= 2 * np.einsum("rfpq,rfpq->rpq", left[:, :, a[:, None], a], right[:, :, b[:, None], b])
            known = (across @ right - left @ across).sum(axis=1)[:, a, b]
            inverse = np.linalg.pinv(square, rcond=UNKNOWN, hermitian=True)
            step[:, first[a], second[b]] = (inverse @ known[..., None])[..., 0]
    return step


@cache
def _weights(count: int, depth: int) -> Array:
    """Fixed numbers in general position."""
    return np.random.default_rng(1000 + depth).standard_normal(count)


def _resolved(members: Array, depth: int, angle: Array | None = None) -> tuple[Array, Array]:
    """An adapted basis ``(r, m, m)`` of a cluster, and which neighbours ``(r, m - 1)`` belong to copies of one block.

    members: ``(r, F, m, m)``, the family restricted to the cluster. angle: ``(r, m, m)``, a turn restricted to it,
    whose eigenspaces come first.
    """
    if angle is not None:
        cosine, basis = np.linalg.eigh(angle)
        return _within(members, basis, np.diff(cosine, axis=1) < PURE, depth)
    m = members.shape[-1]
    mean = np.einsum("rfii->rf", members)[..., None, None] / m
    deviation = members - mean * np.eye(m)
    size = np.maximum(np.abs(deviation).max(axis=(2, 3)), FAINT)
    total = np.einsum("f,rf,rfij->rij", _weights(members.shape[1], depth), 1 / size, deviation)
    values, basis = np.linalg.eigh(total)
    gap = np.diff(values, axis=1)
    # Of size 1 unless the whole cluster is faint.
    norm = np.maximum(np.abs(values).max(axis=1, keepdims=True), 1.0)
    if depth == DEPTH - 1:
        return basis, gap < EQUAL * norm
    return _within(members, basis, gap < CLOSE * norm, depth + 1)


def _within(members: Array, basis: Array, joined: Array, depth: int) -> tuple[Array, Array]:
    """The same for each part of a basis ``(r, m, m)`` whose neighbours are ``joined`` ``(r, m - 1)``."""
    tied = np.zeros(joined.shape, dtype=bool)
    for rows, key in equal_rows(joined.astype(np.int8)):
        for part in runs(key):
            if part.stop - part.start > 1:
                own = basis[rows][:, :, part]
                inner = np.swapaxes(own, -1, -2)[:, None] @ members[rows] @ own[:, None]
                turn, ties = _resolved(inner, depth)
                basis[rows, :, part] = own @ turn
                tied[rows, part.start : part.stop - 1] = ties
    return basis, tied


def _aligned(family: Array, basis: Array, nodes: list[slice]) -> Array:
    """The basis with the copies of each block in the same order and orientation in all eigenspaces of one size."""
    basis = basis.copy()
    coupling = np.einsum("f,rfij->rij", _weights(family.shape[1], DEPTH), family)
    coupling = np.swapaxes(basis, -1, -2) @ coupling @ basis
    several = [k for k, node in enumerate(nodes) if node.stop - node.start > 1]
    strength = np.zeros((len(basis), len(several), len(several)))
    for a, j in enumerate(several):
        for b, k in enumerate(several):
            same = nodes[j].stop - nodes[j].start == nodes[k].stop - nodes[k].start
            if a != b and same:
                strength[:, a, b] = np.abs(coupling[:, nodes[j], nodes[k]]).max(axis=(1, 2))
    table = (strength > DISCARDED).reshape(len(basis), -1)
    for rows, _ in equal_rows(table.astype(np.int8)):
        for a, b in _spanning_forest(strength[rows].min(axis=0)):
            first, second = basis[rows][:, :, nodes[several[a]]], basis[rows][:, :, nodes[several[b]]]
            between = np.swapaxes(first, -1, -2) @ np.einsum(
                "f,rfij->rij", _weights(family.shape[1], DEPTH), family[rows]
            )
            left, _, right = np.linalg.svd(between @ second)
            basis[rows, :, nodes[several[b]]] = second @ np.swapaxes(left @ right, -1, -2)
    return basis


def _spanning_forest(strength: Array) -> list[tuple[int, int]]:
    """Edges (known, new) of the maximum spanning forest of a weighted graph, in the order in which it grows (Prim)."""
    left, edges = set(range(len(strength))), []
    while left:
        tree = {left.pop()}
        while left:
            a, b = max(((a, b) for a in tree for b in left), key=lambda edge: strength[edge])
            if strength[a, b] <= DISCARDED:
                break
            edges.append((a, b))
            tree.add(b)
            left.discard(b)
    return edges
