"""The segments of constant matrices of a gear system, as certificates are about them."""

from __future__ import annotations

import numpy as np

from gearstab.certificates.equations import Segments
from gearstab.mesh import speed_factors
from gearstab.modal import mean_modes
from gearstab.propagation.schedule import acting, schedule
from gearstab.system import Array, GearSystem

ROUNDING = 1e-15
"""Part of the period by which lengths of segments, differences of numbers up to 1, differ in rounding."""


def segments(system: GearSystem) -> list[Segments]:
    """Values of all rows of the flattened batch.

    Raises ValueError where something varies between jumps, and NotPossible where there is no common period.
    """
    if not system.piecewise_constant:
        raise ValueError("certificates are about systems that are constant between jumps")
    found, cycles = schedule(system), float(system.common_period()[0])
    values = found.values(found.edges[:, :-1] + 0.5 * found.lengths)
    modes, n = mean_modes(system), system.size
    rigid, shapes = system.flat(modes.rigid, 1) == 1, system.flat(modes.shapes, 2)
    base = [np.zeros((n, n)) if part is None else part for part in (system.mass, system.damping, system.stiffness)]
    mass, damping, stiffness = (system.flat(part, 2) for part in base)
    parts = [(False, system.flat(mesh.outer, 2)) for mesh in system.meshes]
    for term in system.terms:
        outer = system.flat(np.asarray(term.left)[..., :, None] * np.asarray(term.right)[..., None, :], 2)
        parts += [(on_velocity, outer) for on_velocity, _ in acting(term)]
    held, following = _speed_terms(system)
    result = []
    for row in range(system.rows):
        there = found.lengths[row] > 0
        distinct, states = np.unique(values[row, there], axis=0, return_inverse=True)
        c, k = np.array([damping[row]] * len(distinct)), np.array([stiffness[row]] * len(distinct))
        for j, (on_velocity, outer) in enumerate(parts):
            (c if on_velocity else k)[...] += distinct[:, j, None, None] * outer[row]
        for on_velocity, matrix in held:
            (c if on_velocity else k)[...] += matrix[row]
        turning = None if following is None else tuple(part[row] for part in following)
        felt = k if turning is None else np.concatenate([k, turning[1:]])
        still = rigid[row] & _unfelt(felt, shapes[row])
        fractions = _alike(found.lengths[row, there]).tolist()
        own = np.ravel(states).tolist()
        result.append(Segments(mass[row], c, k, own, fractions, cycles, shapes[row][:, still], turning))
    return result


def _alike(fractions: Array) -> Array:
    """Give lengths that differ by rounding the same value: exponentials of segments that are alike are found once."""
    order = np.argsort(fractions)
    ascending = fractions[order]
    first = np.concatenate([[True], np.diff(ascending) > ROUNDING])
    found = np.empty_like(fractions)
    found[order] = ascending[first][np.cumsum(first) - 1]
    return found


def _speed_terms(system: GearSystem) -> tuple[list[tuple[bool, Array]], tuple[Array, Array, Array] | None]:
    """Terms that act with speeds: if held, whether on q' and their matrices ``(rows, n, n)``; where they follow,
    those of Omega G q' + (Omega H + Omega^2 K) q, None where nothing does. Raises ValueError.
    """
    held, n = [], system.size
    following = {key: np.zeros((system.rows, n, n)) for key in ((True, 1), (False, 1), (False, 2))}
    terms = [term for rotation in system.rotations for term in rotation.terms()]
    for term in terms:
        matrix, softening = system.flat(term.matrix, 2), system.flat(term.softening)
        if term.held:
            factor = speed_factors(system.flat(term.speed), np.asarray(term.power), softening)
            held.append((term.on_velocity, factor[:, None, None] * matrix))
        elif softening.any():
            raise ValueError("certificates are about matrices that go with the speed or its square")
        else:
            following[term.on_velocity, term.power] += term.speed_ratio**term.power * matrix
    if all(term.held for term in terms):
        return held, None
    drag, first, square = following.values()
    return held, (drag, first, square)


def _unfelt(stiffness: Array, shapes: Array) -> Array:
    """Which modes no stiffness of any segment feels: terms may hold what no mesh does."""
    force = np.abs(stiffness @ shapes).max(axis=(0, 1))
    return np.asarray(force <= 1e-9 * (np.abs(stiffness) @ np.abs(shapes)).max(axis=(0, 1)))
