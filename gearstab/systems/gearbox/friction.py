"""Sliding friction of the meshes as periodic terms, which are not symmetric.

Friction adds sigma mu h (k_p g^T q + c_p g^T q') to the left side for every pair of teeth in contact, h = u + s v; see
:mod:`gearstab.gears.friction`. With the load shares k_p/k as functions of the mesh phase it is the mesh stiffness and
damping, whatever their wave, times these functions along u and v: the rigid-body motion, g^T q = 0, feels none of it.
"""

from __future__ import annotations

import numpy as np

from gearstab.mesh import Mesh, PeriodicForce, PeriodicTerm
from gearstab.system import Array, GearSystem
from gearstab.systems.assembly import Row, total
from gearstab.systems.gearbox.teeth import Rubbing
from gearstab.systems.gearbox.train import Train
from gearstab.waveforms import Constant, Product, Profile, Scaled


def arms(
    train: Train, gears: tuple[int, int], rubbing: Rubbing, push: tuple[Array, Array], sense: int, swapped: bool
) -> tuple[Array, Array]:  # fmt: skip
    """u and v ``(..., n)`` of one mesh, h = u + s v.

    Parameters
    ----------
    gears: numbers of driver and driven gear. sense: 1 where the driver turns counter-clockwise.
    push: n, the direction of the driver's force on the driven gear.
    swapped: whether the pinion that friction counts from is the driven gear.
    """
    pinion, wheel = gears[::-1] if swapped else gears
    # Where the internal gear drives, the pinion presses the teeth together by turning back: its positive sense, that of
    # the wheel and n change sign.
    back = -1.0 if swapped else 1.0
    n = tuple(back * np.asarray(part) for part in push)
    t = (-back * sense * n[1], back * sense * n[0])
    lever: Row = {train.name(wheel): -back * rubbing.length}
    arm = total(lever, train.shift(pinion, t), train.shift(wheel, (-t[0], -t[1])))
    turn = {train.name(pinion): back, train.name(wheel): back * rubbing.wheel_sign}
    return train.coordinates.vector(arm), train.coordinates.vector(turn)


def terms(mesh: Mesh, rubbing: Rubbing, ends: tuple[Array, Array], damping: Array, follows: bool) -> list[PeriodicTerm]:
    """The two terms of one mesh, along u and along v.

    damping: of the mesh, N s/m; follows: whether it varies as the mesh stiffness does.
    """
    drag: Profile | None = None
    if np.any(damping):
        drag = Scaled(mesh.waveform, damping, 2 * mesh.epsilon * damping) if follows else Constant(damping)
    return [
        PeriodicTerm(
            name, left, mesh.direction, Product(level(mesh), share), None if drag is None else Product(drag, share),
            mesh.frequency_ratio, mesh.lag,
        )
        for name, left, share in _parts(mesh, rubbing, ends)
    ]  # fmt: skip


def forces(mesh: Mesh, rubbing: Rubbing, ends: tuple[Array, Array]) -> list[PeriodicForce]:
    """Return the forces that a transmission error e adds: the mesh force is k (g^T q - e), and so friction has sigma mu
    h k_p e less.

    Its damping part, c_p de/dt, is small of second order (friction times damping) and left out.
    """
    error = mesh.transmission_error
    if error is None:
        return []
    return [
        PeriodicForce(name, left, Product(Product(level(mesh), share), error), mesh.frequency_ratio, mesh.lag)
        for name, left, share in _parts(mesh, rubbing, ends)
    ]


def level(mesh: Mesh) -> Profile:
    """Return k(x)."""
    return Scaled(mesh.waveform, mesh.mean_stiffness, 2 * mesh.amplitude)


def _parts(mesh: Mesh, rubbing: Rubbing, ends: tuple[Array, Array]) -> tuple[tuple[str, Array, Profile], ...]:
    return (
        (f"friction of {mesh.name}", ends[0], rubbing.share),
        (f"friction torque of {mesh.name}", ends[1], rubbing.share_arm),
    )


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
