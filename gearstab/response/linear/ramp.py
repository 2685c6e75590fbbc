"""The motion of a driven system while its speed changes: a run-up or a coast-down.

The equation is that of :mod:`gearstab.propagation.phase` with b = inlet [F_0(tau) + Omega F_1] z(tau)
(:mod:`gearstab.propagation.excitation`). The speed is given: the torque that accelerates the train is no part of
the motion, nor are rigid-body motions that nothing holds back. Teeth stay in contact.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import tau

import numpy as np

from gearstab.errors import NotPossible
from gearstab.propagation.excitation import excitation
from gearstab.propagation.first_order import bases
from gearstab.propagation.path import Path
from gearstab.propagation.phase import PhaseEquation
from gearstab.response.linear.equilibrium import static_equilibrium, static_mesh_force
from gearstab.response.linear.history import RESPONSE_FLAGS, separated
from gearstab.response.linear.steady import check_held
from gearstab.system import Array, GearSystem, of_wholes

MOST_STEPS = 20_000_000
"""Steps of integration of a path at most."""


@dataclass(frozen=True)
class RampResponse:
    """The history of a run-up or coast-down.

    time: ``(samples,)``, from 0 in equal steps. mesh_frequency: ``(samples,)``, Omega(t).
    displacement, velocity: ``(samples, n)``, without rigid-body motion.
    mesh_deflection, mesh_force: ``(samples, meshes)``, g_i^T q and k_i (g_i^T q - e_i).
    flags: bits of :data:`~gearstab.response.linear.history.RESPONSE_FLAGS`.
    """

    time: Array
    mesh_frequency: Array
    displacement: Array
    velocity: Array
    mesh_deflection: Array
    mesh_force: Array
    flags: int

    @property
    def overflowed(self) -> bool:
        """Whether the history ends because it outgrew double precision."""
        return bool(self.flags & RESPONSE_FLAGS["overflow"])

    @property
    def separated(self) -> bool:
        """Whether the force of a loaded mesh changes its sign, where teeth would part."""
        return bool(self.flags & RESPONSE_FLAGS["separation"])


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
    time = np.arange(int(np.floor(path.time[-1] / step * (1 + 1e-12))) + 1) * step
    q0, v0 = (static_equilibrium(system), np.zeros(system.size)) if start is None else start
    with np.errstate(over="ignore", invalid="ignore"):
        form = equation.form
        x = equation.follow(path, time, form.state(q0, v0, np.asarray(system.mass)))
        q, v = x @ form.outlet[0].T, x @ form.speed[0].T
        deflection = np.stack([q @ np.asarray(mesh.direction) for mesh in system.meshes], axis=-1)
        stiffness, errors = equation.momentary(path.phase_at(time) / equation.period)
        whole = len(system.whole_meshes)
        force = of_wholes(stiffness * (deflection - errors), system.wholes)
    finite = np.isfinite(force).all(axis=1) & np.isfinite(q).all(axis=1) & np.isfinite(v).all(axis=1)
    kept = len(time) if finite.all() else int(np.argmin(finite))
    flags = RESPONSE_FLAGS["overflow"] * (kept < len(time))
    flags |= RESPONSE_FLAGS["separation"] * bool(np.any(separated(force[:kept], static_mesh_force(system))))
    speed = path.speed_at(time)
    return RampResponse(time[:kept], speed[:kept], q[:kept], v[:kept], deflection[:kept, :whole], force[:kept], flags)
