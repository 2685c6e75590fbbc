"""A basis in which a set of symmetric matrices is block diagonal in as many blocks as possible, for many rows at once.

Every block of a family of symmetric matrices {N_f} is an invariant subspace of all of them, hence of every member:
where the eigenvalues of one member differ its eigenvectors are the only choice, and the blocks are the connected
components of the graph of couplings. Where they are equal (or so close that rounding blurs the eigenvectors) the basis
is free:

1. inside a *cluster* of close eigenvalues generic combinations of the restricted family, and of its squares, are
   diagonalised, which separates all parts but identical copies of one block: the eigenspaces of a generic member of a
   matrix *-algebra (Murota, Kanno, Kojima & Kojima 2010, Japan J. Indust. Appl. Math. 27, 125-160);
2. what stays equal is m copies of one block. The couplings between two such m-fold eigenspaces are multiples of an
   orthogonal m x m matrix; turning one space by it aligns the copies, along a spanning tree of strongest couplings.

Blocks that are the real form of a complex Hermitian family (the translational modes of a planetary gear whose carrier
moves) have equal eigenvalues in pairs but no real basis that separates them; they stay whole.

Nothing is taken for granted: whatever the basis, blocks are joined wherever a coupling exceeds ``DISCARDED``.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np

from gearstab.floquet.grouping import equal_rows
from gearstab.system import Array

DISCARDED = 1e-12
"""Couplings below this part of the size of what they couple count as none. The eigenvectors of the mean system are
orthogonal to it within eps/CLOSE times some n, and it moves no frequency by more than this part: a region of
instability that it might open is narrower than the rounding errors of the mesh frequency's product with the period."""
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
    return np.diff(values, axis=1) <= part * size


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


def adapted(values: Array, family: Array) -> tuple[Array, Array]:
    """Orthonormal basis ``(r, n, n)`` and the coupling ``(r, n, n)`` of its vectors, max_f |(Q^T N_f Q)_pq|.

    Parameters
    ----------
    values: ``(r, n)``, ascending eigenvalues of the member that is diagonal in the given coordinates.
    family: ``(r, F, n, n)``, the other members, of natural size 1.
    """
    basis = np.broadcast_to(np.eye(values.shape[1]), family[:, 0].shape).copy()
    tied = np.zeros((len(values), values.shape[1] - 1), dtype=bool)
    offset = _offset(values)
    for rows, key in equal_rows(close(values, CLOSE).astype(np.int8)):
        if not key.any():
            continue
        members = np.concatenate([family[rows], family[rows] @ family[rows], offset[rows][:, None]], axis=1)
        for part in runs(key):
            if part.stop - part.start > 1:
                turn, ties = _resolved(members[:, :, part, part], 0)
                basis[rows, part, part] = turn
                tied[rows, part.start : part.stop - 1] = ties
    coupling = _coupling(family, offset, basis)
    for rows, key in equal_rows(tied.astype(np.int8)):
        if key.any():
            aligned = _aligned(family[rows], basis[rows], runs(key))
            basis[rows], coupling[rows] = aligned, _coupling(family[rows], offset[rows], aligned)
    return basis, coupling


def runs(joined: Array) -> list[slice]:
    """The runs of positions that ``joined`` (n - 1,) connects with their successors."""
    edges = [0, *(np.flatnonzero(~np.asarray(joined, dtype=bool)) + 1).tolist(), len(joined) + 1]
    return [slice(a, b) for a, b in pairwise(edges)]


def _offset(values: Array) -> Array:
    """The diagonal member as ``(r, n, n)``, each cluster of eigenvalues relative to its first and of size 1."""
    result = np.zeros((*values.shape, values.shape[1]))
    start = np.take_along_axis(values, cluster_start(values), axis=1)
    each = np.arange(values.shape[1])
    result[:, each, each] = (values - start) / np.maximum(np.abs(values), np.finfo(float).tiny)
    return result


def _coupling(family: Array, offset: Array, basis: Array) -> Array:
    back = np.swapaxes(basis, -1, -2)
    largest = np.abs(back @ offset @ basis)
    for f in range(family.shape[1]):
        largest = np.maximum(largest, np.abs(back @ family[:, f] @ basis))
    return largest


@cache
def _weights(count: int, depth: int) -> Array:
    """Fixed numbers in general position."""
    return np.random.default_rng(1000 + depth).standard_normal(count)


def _resolved(members: Array, depth: int) -> tuple[Array, Array]:
    """An adapted basis ``(r, m, m)`` of a cluster, and which neighbours ``(r, m - 1)`` belong to copies of one block.

    members: ``(r, F, m, m)``, the family restricted to the cluster.
    """
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
    tied = np.zeros(gap.shape, dtype=bool)
    for rows, key in equal_rows((gap < CLOSE * norm).astype(np.int8)):
        for part in runs(key):
            if part.stop - part.start > 1:
                own = basis[rows][:, :, part]
                inner = np.swapaxes(own, -1, -2)[:, None] @ members[rows] @ own[:, None]
                turn, ties = _resolved(inner, depth + 1)
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
