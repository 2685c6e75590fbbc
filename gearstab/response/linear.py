"""Free response of a linear gear system, exact between the jumps of its mesh stiffness."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab import floquet
from gearstab.floquet.segments import prepare
from gearstab.response.propagation import Advance, propagator
from gearstab.system import Array, GearSystem

ON_A_JUMP = 1e-9
"""A sample closer to a jump than this part of the sampling step is taken as lying on it, with the stiffness just after;
position and velocity do not jump, so that only the force and the energy depend on it."""


@dataclass(frozen=True)
class Response:
    """The history of a free vibration.

    time: ``(samples,)``, from 0 in equal steps.
    displacement, velocity: ``(samples, n)``, q and dq/dt.
    mesh_deflection: ``(samples, meshes)``, g_i^T q.
    mesh_force: ``(samples, meshes)``, the elastic force k_i(t) g_i^T q (without the damping of a mesh).
    energy: ``(samples,)``, q'^T M q'/2 + q^T K(t) q/2; jumps with the stiffness.
    mesh_frequency: Omega.
    common_period: of all meshes.
    growth_rate: the largest real part of the characteristic exponents, 1/time: the rate at which a general
        history grows in the long run.
    status: ``complete``, or ``overflow`` where the history ends because it outgrew double precision.
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
    status: str

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
    """Free vibration M q'' + C q' + [K0 + sum k_i(t) g_i g_i^T] q = 0 from q(0), q'(0).

    Within a segment of constant stiffness the solution is written down (modes, or a matrix exponential with damping),
    and every segment starts exactly at a jump, so that the spacing of the samples does not affect the accuracy.

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
    start = _checked(system, mesh_frequency, displacement, velocity, duration, samples_per_cycle)
    cycles, counts = system.common_period()
    period = float(cycles) * 2 * np.pi / mesh_frequency
    grid = counts[0] * samples_per_cycle
    step = period / grid
    samples = int(np.floor(duration / step * (1 + 1e-12))) + 1
    edges, levels = _segments(system)
    coordinates, advance = propagator(system, levels, step)
    # Growth without bound is an answer, not an error: the history is cut where it stops being finite.
    with np.errstate(over="ignore", invalid="ignore"):
        x = _history(edges * grid, advance, step, coordinates.state(*start), samples)
        q, v = coordinates.physical(x)
        q[0], v[0] = start
        stiffness = levels[_segment_of(edges * grid, samples)]
        deflection = np.stack([q @ np.asarray(mesh.direction) for mesh in system.meshes], axis=-1)
        force = stiffness * deflection
        energy = 0.5 * (np.sum((v @ system.mass) * v, axis=1) + np.sum((q @ system.stiffness) * q, axis=1))
        energy += 0.5 * np.sum(force * deflection, axis=1)
    finite = np.isfinite(q).all(axis=1) & np.isfinite(v).all(axis=1) & np.isfinite(energy)
    kept = samples if finite.all() else int(np.argmin(finite))
    growth = floquet.solve(system, np.array([mesh_frequency])).growth_rate
    return Response(
        time=np.arange(kept) * step,
        displacement=q[:kept],
        velocity=v[:kept],
        mesh_deflection=deflection[:kept],
        mesh_force=force[:kept],
        energy=energy[:kept],
        mesh_frequency=float(mesh_frequency),
        common_period=period,
        growth_rate=float(np.ravel(growth)[0]),
        status="complete" if kept == samples else "overflow",
    )


def _checked(
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


def _segments(system: GearSystem) -> tuple[Array, Array]:
    """Edges ``(S + 1,)`` from 0 to 1 in parts of the common period; the mesh stiffnesses between ``(S, meshes)``."""
    pattern = prepare(system)[0]
    begins = pattern.start[0] + np.concatenate([[0.0], np.cumsum(pattern.fractions[0])[:-1]])
    wrapped = begins - np.floor(begins)
    order = np.argsort(wrapped)
    levels = pattern.levels[0][pattern.states[order]]
    inner = wrapped[order]
    if inner[0] > 0:
        # The period begins within the segment that its end is in, too.
        inner, levels = np.concatenate([[0.0], inner]), np.concatenate([levels[-1:], levels])
    return np.append(inner, 1.0), levels


def _first_sample(edges: Array) -> Array:
    """The first sample at or after each edge; both in sampling steps."""
    return np.ceil(edges - ON_A_JUMP).astype(int)


def _segment_of(edges: Array, samples: int) -> Array:
    """Which segment of the common period each of the samples is in."""
    counts = np.diff(_first_sample(edges))
    return np.resize(np.repeat(np.arange(len(counts)), counts), samples)


def _history(edges: Array, advance: Advance, step: float, start: Array, samples: int) -> Array:
    """x at all samples, ``(samples, 2n)``. ``edges``: the segments of a common period in sampling steps.

    The states at the beginning of all common periods come first; then every segment is treated for all periods at once.
    """
    grid = int(np.rint(edges[-1]))
    periods = -(-samples // grid)
    durations = np.diff(edges) * step
    columns = np.empty((len(start), periods))
    columns[:, 0] = start
    if periods > 1:
        monodromy = np.eye(len(start))
        for s, duration in enumerate(durations):
            monodromy = advance(s, duration, 1, monodromy)[0]
        for k in range(1, periods):
            columns[:, k] = monodromy @ columns[:, k - 1]
    first = _first_sample(edges)
    table = np.full((grid, len(start), periods), np.nan)
    for s, duration in enumerate(durations):
        if first[s] >= samples:
            break
        offset = max(first[s] - edges[s], 0.0) * step
        count = min(first[s + 1], samples) - first[s]
        table[first[s] : first[s] + count] = advance(s, offset, count, columns)
        columns = advance(s, duration, 1, columns)[0]
    return np.moveaxis(table, -1, 0).reshape(grid * periods, -1)[:samples]
