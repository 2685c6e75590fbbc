"""Time response of a linear gear system: free from an initial state, driven, or while its speed changes.

A run-up or a coast-down follows the equation of :mod:`gearstab.propagation.phase` with b = inlet [F_0(tau) + Omega F_1]
z(tau) (:mod:`gearstab.propagation.equation`). The speed is given: the torque that accelerates the train is no part of
the motion, nor are rigid-body motions that nothing holds back. Teeth stay in contact.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import tau
from typing import ClassVar

import numpy as np

from gearstab.errors import NotPossible
from gearstab.floquet import solve
from gearstab.modal import mean_modes, static_equilibrium, static_mesh_force
from gearstab.propagation.equation import excitation
from gearstab.propagation.first_order import bases
from gearstab.propagation.path import Path
from gearstab.propagation.phase import PhaseEquation
from gearstab.response.steady import STATUS_FLAGS, Driven, balanced, check_held, driven, starts, unbalanced
from gearstab.system import Array, GearSystem, of_wholes

RESPONSE_FLAGS = STATUS_FLAGS | {"overflow": 128}
"""Bits of a response's ``flags``: those of a steady state (:mod:`~gearstab.response.steady`), of a history as
far as they apply (``unstable``: the free vibration grows), and ``overflow`` where a history ends because it outgrew
double precision."""


@dataclass(frozen=True)
class Response:
    """The history of a vibration.

    time: ``(samples,)``, from 0 in equal steps.
    displacement, velocity: ``(samples, n)``, q and dq/dt.
    mesh_deflection: ``(samples, meshes)``, g_i^T q.
    mesh_force: ``(samples, meshes)``, the elastic force k_i(t) (g_i^T q - e_i) (without the damping of a mesh).
    energy: ``(samples,)``, q'^T M q'/2 + q^T K0 q/2 + sum_i k_i(t) (g_i^T q - e_i)^2/2; jumps with the stiffness.
    mesh_frequency: Omega.
    common_period: of all that varies and drives.
    growth_rate: the largest real part of the characteristic exponents, 1/time: the rate at which a general
        history grows in the long run.
    flags: bits of RESPONSE_FLAGS.
    drift: ``(n,)``, the mean velocity of the rigid-body motion that a steady state is seen from, else None.
    """

    time: Array
    displacement: Array
    velocity: Array
    mesh_deflection: Array
    mesh_force: Array
    energy: Array
    mesh_frequency: float
    common_period: float
    growth_rate: float
    flags: int
    drift: Array | None = None

    bits: ClassVar[Mapping[str, int]] = RESPONSE_FLAGS
    ends: ClassVar[tuple[str, ...]] = ("failed", "overflow")
    """Flags of a history that there is none of, or that ends early."""

    @property
    def status(self) -> str:
        """``complete``, or which of ``ends`` it is: ``overflow``, ``failed`` where there is no history at all."""
        return next((name for name in self.ends if self.flags & self.bits[name]), "complete")

    @property
    def findings(self) -> list[str]:
        """Names of the flags."""
        return [name for name, bit in self.bits.items() if self.flags & bit]

    @property
    def largest_multiplier(self) -> float:
        """The largest |lambda|, growth over one common period (inf beyond the range of doubles)."""
        with np.errstate(over="ignore"):
            return float(np.exp(self.growth_rate * self.common_period))


def free_response(
    system: GearSystem,
    mesh_frequency: float,
    displacement: Array,
    velocity: Array,
    duration: float,
    samples_per_cycle: int = 200,
) -> Response:
    """Free vibration M q'' + C(t) q' + K(t) q = 0 from q(0), q'(0), whatever drives the system otherwise.

    Exact between the jumps of the mesh stiffness, whatever the spacing of the samples. Smooth waves are followed in
    steps of the sixth-order Magnus expansion, to a relative error of 1e-9 a period.

    Parameters
    ----------
    system: a single system (no batch).
    mesh_frequency: Omega, positive; a wave is at phase -lag at t = 0.
    displacement, velocity: ``(n,)``.
    duration: the last sample is the last one not after it.
    samples_per_cycle: equal steps in a period of the first mesh.

    Raises
    ------
    ValueError: batched system, wrong shapes, or frequency, duration or samples that are not positive.

    Source: piecewise exact solution as in Lin & Parker 2002, section 4 and Fig. 9 (there by numerical integration).
    """
    return driven_response(system.undriven(), mesh_frequency, displacement, velocity, duration, samples_per_cycle)


def driven_response(
    system: GearSystem,
    mesh_frequency: float,
    displacement: Array,
    velocity: Array,
    duration: float,
    samples_per_cycle: int = 200,
) -> Response:
    """The vibration of a driven system, M q'' + C(t) q' + K(t) q = f(t), from q(0), q'(0).

    f(t) is the load, the periodic forces and k_i e_i + c_i e_i' of the transmission errors along g_i. Exact where all
    but the Fourier series of forces and errors is constant between its jumps; other functions as in
    :func:`free_response`. Parameters and errors as there; ValueError also where there is no common period.
    """
    start = checked(system, mesh_frequency, displacement, velocity, duration, samples_per_cycle)
    motion = driven(system, mesh_frequency)
    grid = motion.drive.counts[0] * samples_per_cycle
    samples = samples_until(duration, motion.period / grid)
    with np.errstate(over="ignore", invalid="ignore"):
        q, v = motion.physical(motion.history(motion.state(*start), samples, grid))
    q[0], v[0] = start
    found = assembled(system, motion, (q, v), grid)
    pushed = bool(unbalanced(motion.drive, next(bases(system)))[0])
    return replace(found, flags=found.flags | RESPONSE_FLAGS["unbalanced"] * pushed)


def steady_state(system: GearSystem, mesh_frequency: float, samples_per_cycle: int = 200) -> Response:
    """The periodic response to what drives a system, over a common period, both ends included.

    The initial state is that of :mod:`gearstab.response.steady`; everything after follows from it exactly, so
    that the difference of the first and the last sample tells the error. Rigid-body modes that nothing holds back are
    balanced: the part of the load that would accelerate the train is left out (``unbalanced``), and displacements are
    relative to a uniform motion (``drift``).

    Parameters
    ----------
    system: a single system (no batch) with something that drives it.
    mesh_frequency: Omega, positive.
    samples_per_cycle: equal steps in a period of the first mesh.

    Raises
    ------
    ValueError: batched system, or numbers that are not positive.
    NotPossible: nothing drives it, or no common period.
    """
    if system.batch != ():
        raise ValueError(f"a steady state needs a single system, not a batch of shape {system.batch}")
    if not system.forced:
        raise NotPossible("nothing drives the system: give a load, forces or transmission errors")
    if not (mesh_frequency > 0 and np.isfinite(mesh_frequency) and samples_per_cycle > 0):
        raise ValueError("mesh frequency and samples per cycle must be positive")
    (_, _, begin) = next(starts(system, np.array([[float(mesh_frequency)]])))
    basis = begin.points.basis
    motion = driven(balanced(system, basis), mesh_frequency)
    grid = motion.drive.counts[0] * samples_per_cycle
    samples = grid + 1
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


def samples_until(duration: float, step: float) -> int:
    """Count the samples from 0 that are not after the end; one on it, but for rounding, is not."""
    return int(np.floor(duration / step * (1 + 1e-12))) + 1


def assembled(
    system: GearSystem, motion: Driven, state: tuple[Array, Array], grid: int, flanks: tuple[Array, Array] | None = None
) -> Response:
    """Return the response of a system with the states (q, q') ``(samples, n)``, ``grid`` of them in a common period.

    flanks: ``(samples, meshes)``, with backlash: whether the teeth touch, and where the flanks are.
    """
    q, v = state
    omega = motion.omega
    stiffness, errors = (np.resize(part, (len(q), len(system.meshes))) for part in motion.momentary(grid))
    if flanks is not None:
        stiffness, errors = stiffness * flanks[0], errors + flanks[1]
    with np.errstate(over="ignore", invalid="ignore"):
        deflection = np.stack([q @ np.asarray(mesh.direction) for mesh in system.meshes], axis=-1)
        force = stiffness * (deflection - errors)
        energy = np.einsum("si,si->s", v @ system.mass, v) + np.einsum("si,si->s", q @ system.stiffness, q)
        energy = 0.5 * (energy + np.einsum("si,si->s", force, deflection - errors))
        force, deflection = of_wholes(force, system.wholes), deflection[:, : len(system.whole_meshes)]
    kept = finite(q, v, energy)
    growth = float(np.ravel(solve(system.undriven(), np.array([omega])).growth_rate)[0])
    flags = RESPONSE_FLAGS["overflow"] * (kept < len(q)) | RESPONSE_FLAGS["unstable"] * (growth > 0)
    flags |= RESPONSE_FLAGS["separation"] * bool(np.any(separated(force[:kept], static_mesh_force(system))))
    return Response(
        time=np.arange(kept) * (motion.period / grid),
        displacement=q[:kept],
        velocity=v[:kept],
        mesh_deflection=deflection[:kept],
        mesh_force=force[:kept],
        energy=energy[:kept],
        mesh_frequency=omega,
        common_period=motion.period,
        growth_rate=growth,
        flags=flags,
    )


def finite(*parts: Array) -> int:
    """Count the samples before the first one that is not finite in parts ``(samples, ...)``."""
    sound = np.all([np.isfinite(part).all(axis=tuple(range(1, part.ndim))) for part in parts], axis=0)
    return len(sound) if sound.all() else int(np.argmin(sound))


def separated(force: Array, static: Array) -> Array:
    """``(..., meshes)``: where the teeth of a loaded mesh would part: its force and the static one differ in sign."""
    return np.asarray(force * np.sign(static) < 0)


def checked(
    system: GearSystem, mesh_frequency: float, displacement: Array, velocity: Array, duration: float, samples: int
) -> tuple[Array, Array]:
    """The initial state as arrays; ValueError for what cannot be computed."""
    if system.batch != ():
        raise ValueError(f"a time response needs a single system, not a batch of shape {system.batch}")
    for name, value in (("mesh frequency", mesh_frequency), ("duration", duration), ("samples per cycle", samples)):
        if not (value > 0 and np.isfinite(value)):
            raise ValueError(f"{name} {value}: must be positive")
    state = np.array(displacement, dtype=float), np.array(velocity, dtype=float)
    for name, part in zip(("displacement", "velocity"), state, strict=True):
        if part.shape != (system.size,) or not np.all(np.isfinite(part)):
            raise ValueError(f"initial {name}: {system.size} finite numbers are needed")
    return state


MOST_STEPS = 20_000_000
"""Steps of integration of a path at most."""


@dataclass(frozen=True)
class RampResponse:
    """The history of a run-up or coast-down.

    time: ``(samples,)``, from 0 in equal steps. mesh_frequency: ``(samples,)``, Omega(t).
    displacement, velocity: ``(samples, n)``, without rigid-body motion.
    mesh_deflection, mesh_force: ``(samples, meshes)``, g_i^T q and k_i (g_i^T q - e_i).
    flags: bits of :data:`~gearstab.response.history.RESPONSE_FLAGS`.
    """

    time: Array
    mesh_frequency: Array
    displacement: Array
    velocity: Array
    mesh_deflection: Array
    mesh_force: Array
    flags: int


def equation_of(system: GearSystem) -> PhaseEquation:
    """Return the equation of a single driven system. Raises NotPossible as :func:`.steady.check_held` does."""
    check_held(system)
    return PhaseEquation(next(bases(system)), excitation(system))


def ramp_response(
    system: GearSystem, path: Path, samples_per_cycle: int = 200, start: tuple[Array, Array] | None = None
) -> RampResponse:
    """Compute the response to load, forces and transmission errors while the mesh frequency follows a path.

    Parameters
    ----------
    system: a single system without backlash that has a common period.
    path: the mesh frequency over time.
    samples_per_cycle: equal steps in the shortest period of the first mesh.
    start: q and dq/dt ``(n,)`` at t = 0; static equilibrium at rest without.

    Raises
    ------
    ValueError: a batch of systems.
    NotPossible: no common period, or a path of more than 20 million steps.
    """
    if system.batch != ():
        raise ValueError(f"a time response needs a single system, not a batch of shape {system.batch}")
    equation = equation_of(system)
    ratio = float(system.meshes[0].frequency_ratio)
    step = tau / (path.range[1] * ratio * samples_per_cycle)
    steps = path.time[-1] * (1 / step + 1 / equation.longest_step(path))
    if steps > MOST_STEPS:
        remedy = "raise the rate, or narrow the range of speeds"
        raise NotPossible(f"the ramp takes {steps:.2g} steps of integration, more than {MOST_STEPS:.2g}", remedy)
    time = np.arange(samples_until(path.time[-1], step)) * step
    q0, v0 = (static_equilibrium(system), np.zeros(system.size)) if start is None else start
    with np.errstate(over="ignore", invalid="ignore"):
        form = equation.form
        x = equation.follow(path, time, form.state(q0, v0, np.asarray(system.mass)))
        q, v = x @ form.outlet[0].T, x @ form.speed[0].T
        deflection = np.stack([q @ np.asarray(mesh.direction) for mesh in system.meshes], axis=-1)
        stiffness, errors = equation.momentary(path.phase_at(time) / equation.period)
        whole = len(system.whole_meshes)
        force = of_wholes(stiffness * (deflection - errors), system.wholes)
    kept = finite(q, v, force)
    flags = RESPONSE_FLAGS["overflow"] * (kept < len(time))
    flags |= RESPONSE_FLAGS["separation"] * bool(np.any(separated(force[:kept], static_mesh_force(system))))
    speed = path.speed_at(time)
    return RampResponse(time[:kept], speed[:kept], q[:kept], v[:kept], deflection[:kept, :whole], force[:kept], flags)
