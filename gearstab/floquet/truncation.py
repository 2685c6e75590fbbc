"""Bases of some modes of a system, or of one type of mesh deflection, and what a restriction to them neglects."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gearstab.errors import NotPossible
from gearstab.floquet.frequencies import sample
from gearstab.modal import eigenmodes, mean_modes
from gearstab.propagation.schedule import acting
from gearstab.symmetry import the_symmetry, type_name
from gearstab.system import Array, GearSystem

EQUAL = 1e-9
"""Squared frequencies that differ by less than this part count as equal."""
ROUNDING = 1e-10
"""Relative couplings below this come from the rounding errors of the modes."""
PHASES = 64
"""Phases of a periodic term at which its size is looked at."""
SMALLEST = 1e-6
"""Part of the largest natural frequency: the least size that couplings are compared with."""


def modes_basis(system: GearSystem, modes: Sequence[int]) -> Array:
    """``(..., n, m)``, the shapes of modes, numbered from 1 by ascending natural frequency in each row.

    Raises NotPossible where there is no such mode.
    """
    if max(modes) > system.size:
        raise NotPossible(f"there is no mode {max(modes)}", f"name modes from 1 to {system.size}")
    return mean_modes(system).shapes[..., np.array(modes, dtype=int) - 1]


def type_basis(system: GearSystem, kind: int | str) -> Array:
    """``(n, m)``, orthonormal basis of all displacements of a mesh-deflection type of a system of cyclic symmetry.

    With the turn R by 2 pi/N the displacements of type T are the range of the projection

        P_T = (c/N) sum_(k = 0..N-1) cos(2 pi T k/N) R^k,   c = 1 for T = 0 and T = N/2, else 2.

    kind: T, or the name of a type, which may stand for several T. Raises NotPossible for a system without symmetry or
    a type that it does not have.
    """
    symmetry = the_symmetry(system)
    if symmetry is None:
        several = (
            "several symmetries" if system.symmetries else "no cyclic symmetry, and so no types of mesh deflection"
        )
        raise NotPossible(f"the system has {several}", "name modes instead")
    largest = symmetry.order // 2
    if isinstance(kind, str):
        names = [type_name(symmetry, t) for t in range(largest + 1)]
        chosen = [t for t, name in enumerate(names) if name == kind]
        if not chosen:
            raise NotPossible(f"there is no type {kind!r}", f"choose one of {', '.join(dict.fromkeys(names))}")
    elif not 0 <= kind <= largest:
        raise NotPossible(f"there is no type {kind}", f"with {symmetry.order} planets choose one from 0 to {largest}")
    else:
        chosen = [kind]
    projection = sum(_projection(symmetry.turn, symmetry.order, t) for t in chosen)
    rank = round(float(np.trace(projection)))
    return np.asarray(np.linalg.svd(projection)[0][:, :rank])


def _projection(turn: Array, order: int, kind: int) -> Array:
    total, power = np.zeros_like(turn), np.eye(len(turn))
    for k in range(order):
        total += np.cos(2 * np.pi * kind * k / order) * power
        power = power @ turn
    return total * (1 if 2 * kind % order == 0 else 2) / order


def neglected(system: GearSystem, basis: Array) -> float:
    """Measure what a restriction of a single system leaves out: the largest coupling between modes inside and outside
    of the subspace, relative to w_p w_q; 0 where it is rounding error and the restriction exact.

    Meshes that vary alike are taken together, so that couplings which cancel count as none.
    """
    outside = np.linalg.svd(basis.T @ system.mass)[2][basis.shape[1] :].T
    if outside.shape[1] == 0:
        return 0.0
    pattern = sample(system.only_meshes())
    mean = system.mean_stiffness_matrix()
    inner, outer = (_modes(system.mass, mean, part) for part in (basis, outside))
    coupling = [mean, *(system.stiffness_matrix(list(levels)) for levels in pattern.levels[0])]
    frequency = [np.sqrt(np.abs(values)) for values, _ in (inner, outer)]
    largest = max(float(f.max()) for f in frequency)
    coupling += [largest * system.damping_matrix, largest * system.damping_matrix.T]
    first, second = (np.maximum(f, SMALLEST * largest) for f in frequency)
    size = first[:, None] * second[None, :]
    phase = (np.arange(PHASES) + 0.5) / PHASES
    for term in system.terms:
        for on_velocity, profile in acting(term):
            most = (largest if on_velocity else 1.0) * float(np.abs(profile.value(phase)).max())
            coupling += [most * np.outer(term.left, term.right), most * np.outer(term.right, term.left)]
    found = max(float(np.max(np.abs(inner[1].T @ matrix @ outer[1]) / size)) for matrix in coupling)
    return found if found > ROUNDING else 0.0


def _modes(mass: Array, stiffness: Array, basis: Array) -> tuple[Array, Array]:
    values, shapes = eigenmodes(basis.T @ mass @ basis, basis.T @ stiffness @ basis)
    return values, basis @ shapes


def split_degenerate_group(system: GearSystem, modes: Sequence[int]) -> tuple[int, ...]:
    """A group of modes (from 1) of equal frequency of a single system of which only some are named; () without any.

    The shapes of such modes are not unique, nor would be what a part of them does.
    """
    squared = mean_modes(system).squared_frequency
    size = np.maximum(np.abs(squared[1:]), np.abs(squared[:-1]))
    edges = np.flatnonzero(np.diff(squared) > EQUAL * size) + 1
    for group in np.split(np.arange(1, system.size + 1), edges):
        if 0 < len(set(group.tolist()) & set(modes)) < len(group):
            return tuple(group.tolist())
    return ()
