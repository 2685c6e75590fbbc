"""One mesh frequency at a time: Floquet analysis with all other meshes at their mean stiffness.

Meshes of the same frequency vary together; whatever varies with another frequency keeps its mean. The growth rate is
the largest of all frequencies, and the system counts as stable where it is so for each. Exact where a single frequency
varies. Neglected is what two frequencies do together: tongues of one move by O(epsilon^2) with the other, and where
tongues of two meet, their growths add up in first order.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from gearstab.floquet.stability import STATUS_FLAGS, FloquetStability
from gearstab.mesh import Mesh, PeriodicTerm
from gearstab.system import Array, GearSystem


@dataclass(frozen=True)
class FrequencyGroup:
    """Group of meshes with one frequency: names of its meshes, joined by ``+``, and Omega_i/Omega."""

    name: str
    ratio: Fraction | float


def solve(
    system: GearSystem, mesh_frequency: Array, solver: Callable[[GearSystem, Array], FloquetStability]
) -> FloquetStability:
    """Stability of every row of a system at every mesh frequency of the first mesh.

    Parameters
    ----------
    system: any batch shape.
    mesh_frequency: Omega, ``(P,)`` for all rows or ``(rows, P)``.
    solver: what solves a system of one mesh frequency, for instance :func:`gearstab.floquet.solve`.
    """
    omega = np.asarray(mesh_frequency, dtype=float)
    found = [solver(one, ratio * omega) for one, ratio in apart(system)]
    by_mesh = np.stack([one.growth_rate for one in found], axis=-1)
    moves = np.stack([varies(system, group) for group in groups(system)], axis=-1)
    # What does not vary in a row tells only how a constant system decays; where nothing varies that is the answer.
    moves |= ~moves.any(axis=-1, keepdims=True)
    growth = np.where(moves[:, None], by_mesh, -np.inf).max(axis=-1)
    stable = np.min([np.where(moves[:, [k]], one.stable, 1) for k, one in enumerate(found)], axis=0)
    status = np.bitwise_or.reduce([one.status for one in found]) | np.int16(STATUS_FLAGS["per_mesh"])
    errors = [one.error_estimate for one in found if one.error_estimate is not None]
    error = np.max(errors, axis=0) if errors else None
    return FloquetStability(growth, stable.astype(np.int8), status, by_mesh=by_mesh, error_estimate=error)


def groups(system: GearSystem) -> tuple[FrequencyGroup, ...]:
    """One per mesh frequency, in the order of the meshes, then of the terms."""
    parts: list[Mesh | PeriodicTerm] = [*system.meshes, *system.terms]
    names: dict[Fraction | float, list[str]] = {}
    for part in parts:
        names.setdefault(part.frequency_ratio, []).append(part.name)
    meshes = {mesh.name for mesh in system.meshes}
    # A term is named only where no mesh has its frequency.
    return tuple(
        FrequencyGroup("+".join([n for n in own if n in meshes] or own), ratio) for ratio, own in names.items()
    )


def varies(system: GearSystem, group: FrequencyGroup) -> Array:
    """``(rows,)``: whether anything varies with the frequency of a group."""
    found = np.full(system.batch, any(term.frequency_ratio == group.ratio for term in system.terms))
    for mesh in system.meshes:
        if mesh.frequency_ratio == group.ratio:
            low, high = mesh.waveform.extremes()
            found = found | (np.asarray(mesh.epsilon) * (high - low) != 0)
    return np.broadcast_to(found, system.batch).reshape(-1)


def apart(system: GearSystem) -> Iterator[tuple[GearSystem, float]]:
    """The system with each of its groups varying alone, and Omega_i/Omega of that group."""
    whole = system.over(system.batch)
    for group in groups(system):
        yield alone(whole, group), float(group.ratio)


def alone(system: GearSystem, group: FrequencyGroup) -> GearSystem:
    """The system in which only one group varies. Its frequency is Omega, so that the system always has a period."""
    system, one = system.averaged(group.ratio), Fraction(1)
    meshes = tuple(replace(mesh, frequency_ratio=one) for mesh in system.meshes)
    return replace(system, meshes=meshes, terms=tuple(replace(term, frequency_ratio=one) for term in system.terms))
