"""The response of a system whose teeth may part: histories, events and what the motion settles to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import ClassVar

import numpy as np

from gearstab.propagation.first_order import bases
from gearstab.response.backlash.contact import APART, Play, directions, play, resting
from gearstab.response.backlash.dynamics import Dynamics, dynamics, sampled
from gearstab.response.backlash.follow import Chatter, ContactCourse, Event, Track, follow
from gearstab.response.backlash.measure import LimitCycle, Meter
from gearstab.response.driven import ON_A_JUMP, driven
from gearstab.response.history import RESPONSE_FLAGS, Response, assembled, checked, samples_until
from gearstab.response.steady import unbalanced
from gearstab.system import Array, GearSystem

BACKLASH_FLAGS = RESPONSE_FLAGS | {"chatter": 256, "grazing": 512}
"""Bits of ``flags``: those of a response, ``separation`` where teeth do part; ``chatter`` where a history ends because
of too many events; ``grazing`` where a flank is hardly touched or missed, so that small changes may do much."""


@dataclass(frozen=True, kw_only=True)
class BacklashResponse(Response):
    """The history of a vibration with loss of contact.

    What :class:`~gearstab.response.history.Response` has, but for: mesh_force, 0 while the teeth are apart;
    energy, with k_i (x_i - offset_i)^2/2 of the teeth in contact; growth_rate and ``unstable`` of the teeth that stay
    in contact.

    mesh_velocity: ``(samples, meshes)``, g_i^T dq/dt.
    contact: ``(samples, meshes)``, 1 above, 0 within and -1 below the play.
    events: in the order of time.
    cycle: what the motion settles to, None where no common period is left to tell.
    teeth: the play.
    """

    mesh_velocity: Array
    contact: Array
    events: tuple[Event, ...]
    cycle: LimitCycle | None
    teeth: Play

    bits: ClassVar[Mapping[str, int]] = BACKLASH_FLAGS
    ends: ClassVar[tuple[str, ...]] = ("overflow", "chatter")


def has_backlash(system: GearSystem) -> bool:
    """Whether the teeth of any mesh may part."""
    return any(bool(np.any(np.asarray(mesh.backlash) > 0)) for mesh in system.meshes)


def backlash_response(
    system: GearSystem,
    mesh_frequency: float,
    duration: float,
    start: tuple[Array, Array] | None = None,
    samples_per_cycle: int = 200,
    discard: float | None = None,
    tolerance: float = 1e-12,
) -> BacklashResponse:
    """The vibration with loss of contact,

        M q'' + C q' + K0 q + sum_i g_i [k_i(t) f_i(x_i) + c_i x_i' (in contact)] = f(t),   x_i = g_i^T q - e_i(t),
        f_i(x) = x - high above, 0 within and x - low below the play [low, high] of mesh i.

    Between events all is linear and exact where it is piecewise constant; events are roots of polynomials, none of
    which is missed that passes a flank by more than 1e-12 of the backlash. Teeth are in contact by their position: a
    mesh damping may hold them back before they part. C is what the system has besides the dampings of the meshes.

    Parameters
    ----------
    system: a single system (no batch) of which a mesh has backlash.
    mesh_frequency: Omega, positive.
    duration: the last sample is the last one not after it.
    start: q and dq/dt ``(n,)``; default the static equilibrium under the load.
    samples_per_cycle: equal steps in a period of the first mesh; they do not affect the accuracy.
    discard: the time that is left out of the summary, rounded up to whole common periods where there are any after
        it; default half of the duration.
    tolerance: of the motion where functions vary smoothly, relative, in a piece of it.

    Raises
    ------
    ValueError: batched system, wrong numbers, no common period, no static equilibrium, or terms that cannot part.

    Source: Kahraman & Singh 1990 (gear pair with backlash); Acary & Brogliato 2008, chapter 8 (event driven).
    """
    teeth = play(system)
    if start is None:
        start = resting(system, teeth), np.zeros(system.size)
    start = checked(system, mesh_frequency, start[0], start[1], duration, samples_per_cycle)
    motion = driven(system, mesh_frequency)
    model = dynamics(system, motion, teeth)
    grid = motion.drive.counts[0] * samples_per_cycle
    meter = Meter(model, 0.5 * duration if discard is None else discard, duration)
    run = Recording(model, grid, samples_until(duration, motion.period / grid), meter)
    run.follow(motion.state(*start), tolerance)
    return _assembled(system, run, start)


class Recording:
    """A motion on its way: samples, events, meter."""

    def __init__(self, model: Dynamics, grid: int, samples: int, meter: Meter) -> None:
        self.model, self.grid, self.wanted, self.meter = model, grid, samples, meter
        self.x = np.full((samples, model.size), np.nan)
        self.contact = np.zeros((samples, len(model.teeth.has)), dtype=np.int8)
        self.events: list[Event] = []
        self.flags = 0
        self.known = 0

    def follow(self, x: Array, tolerance: float) -> None:
        """Follow the motion from the state x until all samples are known, or to where it ends."""
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                for track in follow(ContactCourse.of(self.model, tolerance), x, tolerance):
                    self._add(track)
                    if self.known >= self.wanted:
                        break
        except Chatter:
            self.flags |= BACKLASH_FLAGS["chatter"]
        except OverflowError:
            self.flags |= BACKLASH_FLAGS["overflow"]

    def _add(self, track: Track) -> None:
        """Add a track, up to the stretch with the last sample."""
        period = self.model.motion.period
        step, first = period / self.grid, track.period * self.grid
        until = first + np.ceil((track.begin + track.length) / step - ON_A_JUMP).astype(np.int64)
        known = np.maximum.accumulate(np.concatenate([[self.known], np.minimum(until, self.wanted)]))
        used = int(np.searchsorted(known[1:], self.wanted)) + 1
        track, first, known = track[:used], first[:used], known[: used + 1]
        inside, at = slice(known[0], known[-1]), np.repeat(np.arange(len(first)), np.diff(known))
        length = np.where(track.length > 0, track.length, 1.0)
        u = ((np.arange(known[0], known[-1]) - first[at]) * step - track.begin[at]) / length[at]
        self.x[inside] = sampled(track.powers, known - known[0], np.clip(u, 0.0, 1.0), self.model.size)
        self.contact[inside] = track.contact[at]
        self.known = int(known[-1])
        self.meter.add(track)
        ends = track[track.mesh >= 0]
        time = ends.period * period + ends.begin + ends.length
        self.events += map(Event, *(part.tolist() for part in (time, ends.mesh, ends.kind, ends.speed)))
        self.flags |= BACKLASH_FLAGS["grazing"] * bool(track.grazing.any())
        self.flags |= BACKLASH_FLAGS["separation"] * bool(np.any(track.contact == APART))


def _assembled(system: GearSystem, run: Recording, start: tuple[Array, Array]) -> BacklashResponse:
    motion, teeth, samples = run.model.motion, run.model.teeth, run.known
    q, v = motion.physical(run.x[:samples])
    q[0], v[0] = start
    contact = run.contact[:samples]
    linear = assembled(system, motion, (q, v), run.grid, (contact != APART, teeth.offset(contact)))
    pushed = bool(unbalanced(motion.drive, next(bases(system)))[0])
    flags = (linear.flags & ~RESPONSE_FLAGS["separation"]) | run.flags | RESPONSE_FLAGS["unbalanced"] * pushed
    kept = len(linear.time)
    shared = {name: getattr(linear, name) for name in (f.name for f in fields(Response)) if name != "flags"}
    # No stiffness times a negative deflection is a negative zero.
    shared["mesh_force"] = np.where(contact[:kept] == APART, 0.0, linear.mesh_force)
    return BacklashResponse(
        **shared,
        flags=flags,
        mesh_velocity=v[:kept] @ directions(system).T,
        contact=contact[:kept],
        events=tuple(event for event in run.events if event.time <= linear.time[-1]),
        cycle=run.meter.summary((kept - 1) // run.grid),
        teeth=teeth,
    )
