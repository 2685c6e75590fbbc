"""The periodic steady state of one system at one mesh frequency, and its harmonics."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gearstab.errors import NotPossible
from gearstab.modal import mean_modes
from gearstab.propagation.first_order import FirstOrder
from gearstab.response.driven import driven
from gearstab.response.history import RESPONSE_FLAGS, Response, assembled
from gearstab.response.panels import WEIGHTS, fastest, pieces
from gearstab.response.steady import starts
from gearstab.system import Array, GearSystem

AT_ONCE = 2**11
"""Places at which functions are transformed at once."""
MOST_PANELS = 2**14
"""Most panels of a common period."""


@dataclass(frozen=True)
class Harmonics:
    """Fourier coefficients of a steady state: its quantities are Re sum_h c_h exp(i nu_h t).

    frequency: ``(H,)``, nu_h = h 2 pi/T from 0 on.
    mesh_force, mesh_deflection: ``(H, meshes)``, complex c_h; |c_h| is the amplitude of a harmonic, c_0 the mean.
    """

    frequency: Array
    mesh_force: Array
    mesh_deflection: Array


def steady_state(
    system: GearSystem, mesh_frequency: float, samples_per_cycle: int = 200, tolerance: float = 1e-9, periods: int = 1
) -> Response:
    """The periodic response to what drives a system, over ``periods`` common periods, both ends included.

    The initial state is that of :mod:`gearstab.response.steady`; everything after follows from it exactly, so
    that the difference of the first and the last sample tells the error. Rigid-body modes that nothing holds back are
    balanced: the part of the load that would accelerate the train is left out (``unbalanced``), and displacements are
    relative to a uniform motion (``drift``).

    Parameters
    ----------
    system: a single system (no batch) with something that drives it.
    mesh_frequency: Omega, positive.
    samples_per_cycle: equal steps in a period of the first mesh.
    tolerance: of the map over a period where functions vary smoothly, relative.

    Raises
    ------
    ValueError: batched system, or numbers that are not positive.
    NotPossible: nothing drives it, or no common period.
    """
    if system.batch != ():
        raise ValueError(f"a steady state needs a single system, not a batch of shape {system.batch}")
    if not system.forced:
        raise NotPossible("nothing drives the system: give a load, forces or transmission errors")
    if not (mesh_frequency > 0 and np.isfinite(mesh_frequency) and samples_per_cycle > 0 and periods > 0):
        raise ValueError("mesh frequency, samples per cycle and periods must be positive")
    (_, _, begin) = next(starts(system, np.array([[float(mesh_frequency)]]), tolerance))
    basis = begin.points.basis
    motion = driven(balanced(system, basis), mesh_frequency, tolerance)
    grid = motion.drive.counts[0] * samples_per_cycle
    samples = periods * grid + 1
    if begin.status[0] & RESPONSE_FLAGS["failed"]:
        samples = 0
    start = motion.state(basis.outlet[0] @ begin.x[0], basis.speed[0] @ begin.x[0])
    with np.errstate(over="ignore", invalid="ignore"):
        q, v = motion.physical(motion.history(start, samples, grid))
    step, drift = motion.period / grid, np.zeros(system.size)
    modes = mean_modes(system)
    rigid = modes.shapes[:, modes.rigid]
    if samples and rigid.shape[1]:
        inverse = rigid.T @ np.asarray(system.mass)
        drift = rigid @ (inverse @ (q[-1] - q[0])) / (step * (samples - 1))
        q = q - np.arange(samples)[:, None] * step * drift
        q, v = q - q[:-1].mean(axis=0) @ inverse.T @ rigid.T, v - drift
    found = assembled(system, motion, (q, v), grid)
    return replace(found, flags=found.flags | int(begin.status[0]), drift=drift)


def balanced(system: GearSystem, basis: FirstOrder) -> GearSystem:
    """The system without the part of its load that would accelerate rigid-body modes that nothing holds back.

    M r (r^T f0) for every such mode r of unit modal mass: what is left acts on elastic modes alone, as it did.
    """
    if system.load is None:
        return system
    rigid = basis.undamped_rigid[0]
    return replace(system, load=system.load - np.asarray(system.mass) @ rigid @ (rigid.T @ system.load))


def _transformed(tau: Array, values: Array, order: int) -> Array:
    """sum_x exp(-2 pi i h tau_x) values_x for h = 0...order: ``(2, order + 1, meshes)`` from values ``(2, X, meshes)``.

    With h = w a + b the exponential is a product of two, of which there are far fewer.
    """
    count = order + 1
    width = int(np.ceil(np.sqrt(count)))
    found = np.zeros((2, values.shape[2], width, width), dtype=complex)
    for i in range(0, len(tau), AT_ONCE):
        part = slice(i, i + AT_ONCE)
        fine = np.exp(-2j * np.pi * tau[part, None] * np.arange(width))
        coarse = np.exp(-2j * np.pi * tau[part, None] * (width * np.arange(width)))
        for k, mesh in np.ndindex(*found.shape[:2]):
            found[k, mesh] += coarse.T @ (fine * values[k, part, mesh, None])
    return np.swapaxes(found.reshape(*found.shape[:2], -1)[..., :count], 1, 2)


def harmonics(system: GearSystem, mesh_frequency: float, order: int, tolerance: float = 1e-9) -> Harmonics:
    """The Fourier coefficients of the steady state up to the given harmonic of the common period.

    Integrals over the intervals between jumps, by Gauss-Lobatto panels so short that the highest harmonic and the
    highest natural frequency turn by less than a radian in one: to about ten digits, whatever the jumps of the force.
    """
    (_, _, begin) = next(starts(system, np.array([[float(mesh_frequency)]]), tolerance))
    multiples = np.arange(order + 1)
    table = np.zeros((2, order + 1, len(system.whole_meshes)), dtype=complex)
    if begin.status[0] & RESPONSE_FLAGS["failed"]:
        table[:] = np.nan
    else:
        panels = min(2 * np.pi * max(order, fastest(begin.points)), MOST_PANELS)
        for piece in pieces(begin.points, begin.x, panels):
            weight = np.broadcast_to(WEIGHTS[:, None, None] * piece.length, piece.tau.shape).reshape(-1, 1)
            seen = [weight * values.reshape(len(weight), -1) for values in (piece.force, piece.deflection)]
            table += _transformed(piece.tau.ravel(), np.stack(seen), order)
    table[:, 1:] *= 2
    frequency = multiples * mesh_frequency / begin.points.excitation.cycles
    return Harmonics(frequency, table[0], table[1])
