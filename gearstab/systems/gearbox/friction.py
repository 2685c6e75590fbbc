"""Sliding friction of the meshes as periodic terms, which are not symmetric.

Friction adds sigma mu h (k_p g^T q + c_p g^T q') to the left side for every pair of teeth in contact, h = u + s v; see
:mod:`gearstab.gears.friction`. With the load shares k_p/k as functions of the mesh phase it is the mesh stiffness and
damping, whatever their wave, times these functions along u and v: the rigid-body motion, g^T q = 0, feels none of it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from gearstab.system import Array, GearSystem, Mesh, PeriodicTerm
from gearstab.systems.gearbox import matrices
from gearstab.systems.gearbox.teeth import Rubbing
from gearstab.waveforms import Product, Profile, Scaled


def terms(
    layout: matrices.Layout, gears: tuple[int, int], mesh: Mesh, rubbing: Rubbing, push: tuple[Array, Array],
    sense: int, damping: Array, swapped: bool,
) -> tuple[PeriodicTerm, PeriodicTerm]:  # fmt: skip
    """The two terms, along u and along v, of one mesh.

    Parameters
    ----------
    gears: numbers of driver and driven gear. sense: 1 where the driver turns counter-clockwise.
    push: n, the direction of the driver's force on the driven gear. damping: of the mesh, N s/m.
    swapped: whether the pinion that friction counts from is the driven gear.
    """
    pinion, wheel = gears[::-1] if swapped else gears
    # Counted from the driven gear n and its positive sense change sign together.
    turn = -sense if swapped else sense
    n = tuple(-np.asarray(part) for part in push) if swapped else push
    t = (-turn * np.asarray(n[1]), turn * np.asarray(n[0]))
    arms: dict[int, Any] = {wheel: -rubbing.length}
    for rotor, sign in ((pinion, 1.0), (wheel, -1.0)):
        place = layout.lateral.get(rotor)
        if place is not None:
            arms |= {place: sign * t[0], place + 1: sign * t[1]}
    u = matrices.unit(layout, arms)
    v = matrices.unit(layout, {pinion: 1.0, wheel: float(rubbing.wheel_sign)})
    level = Scaled(mesh.waveform, mesh.mean_stiffness, 2 * mesh.amplitude)
    return (
        _term(f"friction of {mesh.name}", u, mesh, Product(level, rubbing.share), rubbing.share, damping),
        _term(
            f"friction torque of {mesh.name}", v, mesh, Product(level, rubbing.share_arm), rubbing.share_arm, damping
        ),
    )


def _term(name: str, left: Array, mesh: Mesh, stiffness: Profile, share: Profile, damping: Array) -> PeriodicTerm:
    drag = Scaled(share, 0.0, damping) if np.any(damping) else None
    return PeriodicTerm(name, left, mesh.direction, stiffness, drag, mesh.frequency_ratio, mesh.lag)


def static_forces(system: GearSystem) -> Array:
    """``(..., meshes)``: the mesh forces k_g g^T q under the constant load, without the rigid-body motion."""
    from gearstab.modal import mean_modes

    modes = mean_modes(system)
    load = np.zeros(system.size) if system.load is None else np.asarray(system.load)
    modal = np.einsum("...np,...n->...p", modes.shapes, load)
    squared = np.where(modes.rigid, np.inf, modes.squared_frequency)
    deflection = np.einsum("...pi,...p->...i", modes.mesh_deflection, modal / squared)
    stiffness = np.stack(np.broadcast_arrays(*[mesh.mean_stiffness for mesh in system.meshes]), axis=-1)
    return np.asarray(stiffness * deflection)
