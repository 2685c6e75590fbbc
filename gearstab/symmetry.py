"""Modes of a system with cyclic symmetry: their types, and which of them a mesh stiffness variation can couple.

A mode of type T is taken into cos(2 pi T/N) of itself and a part of its partner by a turn of 2 pi/N, so that its mesh
deflections go round the N planets as c1 cos T psi_n + c2 sin T psi_n, psi_n = 2 pi (n - 1)/N (Parker 2009, (29)): T = 0
and T = N/2 come alone, every T between in pairs of equal frequency.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from gearstab.mesh import Mesh
from gearstab.modal import Modes, mean_modes, mesh_deflection, mode_types, significant_deflection
from gearstab.system import Array, Cyclic, GearSystem

EQUAL_FREQUENCY = 1e-8
"""Modes whose natural frequencies differ by less than this part may come out mixed."""
PURE = 1e-6
"""How far from cos(2 pi T/N) a mode of type T may be; of 30 planets the nearest are 0.02 apart."""
HARMONICS = range(1, 9)
"""Harmonics by which waves are compared."""
ALIKE = 1e-9
"""Mesh phases, in periods, that differ by less are equal; they are written with a few digits less than a double has."""


def natural_modes(system: GearSystem) -> Modes:
    """Return the vibration modes that results and messages show: those of the mean system, without damping.

    Of a single system of cyclic symmetry every group of equal frequencies is in a basis of pure types. Computations
    may use any basis, that of :func:`gearstab.modal.mean_modes`.

    Of a pair of type T the first mode deflects most at the first mesh that it deflects at all, in the positive sense,
    the second not at all there; a turn by 2 pi/N takes the first towards the second. So the mesh deflections at that
    gear are a cos T psi_n and a sin T psi_n.
    """
    modes = mean_modes(system)
    if not system.symmetries or system.batch:
        return modes
    # In general position, so that their sum tells all types of all symmetries apart; they commute.
    turned = system.mass @ sum(np.sqrt(k + 1) * item.turn for k, item in enumerate(system.symmetries))
    shapes = modes.shapes.copy()
    visible = np.sqrt(np.sum(modes.mesh_deflection**2, axis=0))
    for group in _groups(modes.squared_frequency):
        part = shapes[:, group]
        values, basis = np.linalg.eigh(_symmetric(part.T @ turned @ part))
        part = (part @ basis)[:, ::-1]
        for same in _runs(values[::-1]):
            if len(same) == 2:
                part[:, same] = _pair(system, part[:, same], turned, visible)
        shapes[:, group] = part
    deflection = np.stack([mesh_deflection(shapes, mesh.direction) for mesh in system.meshes], axis=-1)
    return replace(modes, shapes=shapes, mesh_deflection=deflection)


def _symmetric(matrix: Array) -> Array:
    return 0.5 * (matrix + matrix.T)


def _groups(squared_frequency: Array) -> Iterator[Array]:
    """Positions of modes of equal frequency, for groups of at least two."""
    frequency = np.sqrt(np.abs(squared_frequency))
    apart = np.diff(frequency) > EQUAL_FREQUENCY * frequency[1:]
    for group in np.split(np.arange(len(frequency)), np.flatnonzero(apart) + 1):
        if len(group) > 1:
            yield group


def _runs(values: Array) -> list[Array]:
    """Positions of equal values in a sorted list."""
    return np.split(np.arange(len(values)), np.flatnonzero(np.abs(np.diff(values)) > PURE) + 1)


def _pair(system: GearSystem, pair: Array, turned: Array, visible: Array) -> Array:
    """The pair in the basis that :func:`natural_modes` describes."""
    deflection = np.stack([mesh.direction @ pair for mesh in system.meshes])
    seen = np.flatnonzero(np.abs(deflection).max(axis=1) > PURE * visible)
    if len(seen):
        a, b = deflection[seen[0]] / np.hypot(*deflection[seen[0]])
        pair = pair @ np.array([[a, -b], [b, a]])
    return pair * [1.0, -1.0] if pair[:, 1] @ turned @ pair[:, 0] < 0 else pair


def turning_types(system: GearSystem, modes: Modes, symmetry: Cyclic) -> Array:
    """``(n,)``, the T of every mode of a single system under a symmetry, -1 for one that is of no type."""
    cosine = np.einsum("ip,ij,jp->p", modes.shapes, system.mass @ symmetry.turn, modes.shapes)
    order = symmetry.order
    nearest = np.rint(np.arccos(np.clip(cosine, -1.0, 1.0)) * order / (2 * np.pi)).astype(int)
    return np.where(np.abs(np.cos(2 * np.pi * nearest / order) - cosine) < PURE, nearest, -1)


def deflection_types(system: GearSystem, modes: Modes) -> Array:
    """``(n,)``, T of the mesh deflections of every mode; -1 without any mesh deflection, or without symmetry.

    Of several symmetries a mode is turned by one at most: under the others its T is 0.
    """
    deflects = np.any(significant_deflection(modes), axis=-1) & ~modes.rigid
    found = [turning_types(system, modes, symmetry) for symmetry in system.symmetries] or [np.full(system.size, -1)]
    return np.where(deflects & (np.min(found, axis=0) >= 0), np.max(found, axis=0), -1)


def type_names(system: GearSystem, modes: Modes) -> list[str]:
    """Name every mode: by its T where the system has symmetry, else as :func:`gearstab.modal.mode_types`.

    Modes that no turn of a part changes keep the latter name, if the system has other parts.
    """
    named = [str(kind) for kind in mode_types(modes)]
    types = deflection_types(system, modes)
    for symmetry in system.symmetries:
        for p, t in enumerate(turning_types(system, modes, symmetry)):
            if types[p] >= 0 and (t > 0 or not symmetry.name):
                named[p] = type_name(symmetry, t)
            elif named[p] == "no mesh deflection":
                named[p] = symmetry.still
    return named


def type_name(symmetry: Cyclic, t: int) -> str:
    """Return the name of the modes of type T."""
    name = symmetry.types[min(t, len(symmetry.types) - 1)]
    return f"{name}, {symmetry.name}" if symmetry.name else name


def the_symmetry(system: GearSystem) -> Cyclic | None:
    """Return the only symmetry of a system, to which the existence rule applies; None of none or several."""
    return system.symmetries[0] if len(system.symmetries) == 1 else None


def phase_step(system: GearSystem) -> int | None:
    """z, where every mesh wave lags that of the same gear one planet before by z/N of a period; None if there is none,
    and with meshes outside of the planetary set, whose waves no tooth number of the sun shifts.

    With phases from tooth numbers z = z_s (mod N); meshes in phase have z = 0. The meshes of a gear that go into one
    another by turns must be alike in all but their phase.
    """
    symmetry, steps = the_symmetry(system), set[int]()
    if symmetry is None:
        return None
    order = symmetry.order
    for mesh, place in zip(system.meshes, _following(system.meshes, symmetry.turn), strict=True):
        following = system.meshes[place]
        if following is mesh:
            return None
        step = float(np.asarray(following.lag) - np.asarray(mesh.lag)) * order
        if not _alike(mesh, following) or abs(step - round(step)) > ALIKE * order:
            return None
        steps.add(round(step) % order)
    return steps.pop() if len(steps) == 1 else None


def turns(system: GearSystem) -> Array:
    """``(meshes,)``: how many turns take the first mesh of the same gear into each; a phase step z delays it by z/N of
    a period each. Zeros without symmetry.
    """
    found = np.full(len(system.meshes), -1)
    symmetry = the_symmetry(system)
    following = [] if symmetry is None else _following(system.meshes, symmetry.turn)
    for first in range(len(following)):
        mesh, count = first, 0
        while found[mesh] < 0:
            found[mesh], mesh, count = count, following[mesh], count + 1
    return np.maximum(found, 0)


def _following(meshes: tuple[Mesh, ...], turn: Array) -> list[int]:
    """Numbers of the meshes that each becomes by a turn."""
    directions = np.stack([mesh.direction for mesh in meshes])
    return [int(np.argmin(np.abs(directions - place).max(axis=1))) for place in directions @ turn.T]


def _alike(mesh: Mesh, other: Mesh) -> bool:
    """Whether two meshes vary alike, at whatever time."""
    if mesh.frequency_ratio != other.frequency_ratio or type(mesh.waveform) is not type(other.waveform):
        return False
    numbers = [[*_shape(m), m.amplitude / m.mean_stiffness] for m in (mesh, other)]
    own, others = np.array(numbers, dtype=float)
    return bool(np.allclose(own, others, rtol=ALIKE, atol=ALIKE))


def _shape(mesh: Mesh) -> list[Array]:
    """Numbers that tell waves of one kind apart: harmonics and extremes."""
    harmonics = [part for order in HARMONICS for part in mesh.waveform.fourier(order)]
    return [*harmonics, *mesh.waveform.extremes()]


def can_couple(order: int, step: int, harmonic: int, t_p: int, t_q: int) -> bool:
    """The existence rule: whether a mesh harmonic L can couple modes of types T_p and T_q to first order.

        L z +- (T_p +- T_q) = j N for some integer j and some signs

    order: N; step: z, the tooth number of the sun or :func:`phase_step`; harmonic: L. What the rule forbids vanishes
    exactly; what it allows vanishes only by chance or for an integer L c. Source: Parker 2009, conclusion 2.
    """
    return any((harmonic * step + a * (t_p + b * t_q)) % order == 0 for a in (1, -1) for b in (1, -1))
