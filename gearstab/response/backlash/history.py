"""The response of a system whose teeth may part: its events, the settled motion, and deviations from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import ClassVar, NamedTuple

import numpy as np

from gearstab.propagation.first_order import UNDAMPED, bases
from gearstab.response.backlash.dynamics import (
    APART,
    DEGREE,
    KINDS,
    Dynamics,
    Play,
    directions,
    dynamics,
    extremes_of,
    play,
    product,
    resting,
    sampled,
)
from gearstab.response.backlash.follow import Chatter, ContactCourse, Event, Track, follow
from gearstab.response.history import RESPONSE_FLAGS, Response, assembled, checked, samples_until
from gearstab.response.steady import ON_A_JUMP, driven, unbalanced
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
    run.follow(motion.state(*start))
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

    def follow(self, x: Array) -> None:
        """Follow the motion from the state x until all samples are known, or to where it ends."""
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                for track in follow(ContactCourse.of(self.model), x):
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


_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
_NODES, _WEIGHTS = 0.5 + 0.5 * _NODES, 0.5 * _WEIGHTS
LONGEST_CYCLE = 32
"""Common periods after which a motion may repeat itself to be called periodic."""
SETTLED = 1e-6
"""Difference of its sections, relative to the extent of the motion, below which it repeats itself."""


@dataclass(frozen=True)
class LimitCycle:
    """Measures of the settled motion, over the whole common periods after the beginning that was left out.

    begin, end: times. Where no common period is complete, all that is after the beginning counts.
    peak_to_peak, rms, peak: ``(meshes,)``, of the mesh deflection g_i^T q, the latter two about its mean.
    force_peak: ``(meshes,)``, the largest magnitude of the elastic mesh force.
    contact_loss: ``(meshes,)``, the part of the time without contact.
    period: after how many common periods the motion repeats itself; 0 where it does not (yet).
    difference: of the sections by which that was decided, relative to the extent of the motion.
    """

    begin: float
    end: float
    peak_to_peak: Array
    rms: Array
    peak: Array
    force_peak: Array
    contact_loss: Array
    period: int
    difference: float


class PerPeriod(NamedTuple):
    """Measures of P common periods, or parts of them.

    period: ``(P,)``, their numbers;  low, high, force: ``(P, meshes)``, least and greatest deflection, largest force.
    integrals: ``(P, 3, meshes)``, of the deflection, its square and the lack of contact.
    """

    period: Array
    low: Array
    high: Array
    force: Array
    integrals: Array


class Meter:
    """Collects extremes and integrals of every common period, and the states at the beginnings.

    since: the time from which on. Whole common periods count; where there are none until ``until``, all there is does.
    """

    def __init__(self, dynamics: Dynamics, since: float, until: float) -> None:
        period = dynamics.motion.period
        self.dynamics, self.since = dynamics, since
        # A period that begins or ends at the limit but for rounding counts.
        self.first = int(np.ceil(since / period - 1e-9))
        self.whole = self.first < int(np.floor(until / period * (1 + 1e-12)))
        self.begin = self.end = self.first * period
        self.periods = 0
        self.sections: list[Array] = []
        self.parts: list[PerPeriod] = []
        # Whether the force goes by the deflection itself: there is no transmission error.
        self.same = np.array_equal(dynamics.gauge, dynamics.deflection)

    def add(self, track: Track) -> None:
        """More of the motion, in the order of time."""
        begins = np.flatnonzero(np.diff(track.period, prepend=self.periods - 1))
        self.sections.append(track.powers[begins, 0, : self.dynamics.size])
        self.periods += len(begins)
        time = track.period * self.dynamics.motion.period + track.begin
        left_out = track.period < self.first if self.whole else time < self.since
        counts = (track.length > 0) & ~left_out
        if not counts.any():
            return
        if not self.whole:
            first, last = np.flatnonzero(counts)[[0, -1]]
            self.begin, self.end = min(self.begin, float(time[first])), float(time[last] + track.length[last])
        self._add(track if counts.all() else track[counts])

    def _add(self, track: Track) -> None:
        x, apart = track.powers @ self.dynamics.deflection.T, track.contact == APART
        low, high = extremes_of(x)
        force = np.where(apart, 0.0, self._largest_force(track, low, high))
        nodes = np.tensordot(np.vander(_NODES, x.shape[1], increasing=True), x, axes=(1, 1))
        integrals = np.stack([np.tensordot(_WEIGHTS, nodes, 1), np.tensordot(_WEIGHTS, nodes**2, 1), apart], axis=1)
        first = np.flatnonzero(np.diff(track.period, prepend=-1))
        self.parts.append(PerPeriod(
            track.period[first], np.minimum.reduceat(low, first), np.maximum.reduceat(high, first),
            np.maximum.reduceat(force, first), np.add.reduceat(integrals * track.length[:, None, None], first),
        ))  # fmt: skip

    def _largest_force(self, track: Track, low: Array, high: Array) -> Array:
        """``(S, meshes)``, as if the teeth touched; low, high: of the deflections."""
        dynamics = self.dynamics
        count, offset = len(dynamics.gauge), dynamics.teeth.offset(track.contact)
        stiffness = track.values[:, :, :count]
        if stiffness.shape[1] > 1:
            beyond = track.powers @ dynamics.gauge.T
            beyond[:, 0] -= offset
            low, high = extremes_of(product(stiffness, beyond))
            return np.maximum(np.abs(low), np.abs(high))
        if not self.same:
            low, high = extremes_of(track.powers @ dynamics.gauge.T)
        return np.asarray(np.abs(stiffness[:, 0]) * np.maximum(np.abs(low - offset), np.abs(high - offset)))

    def summary(self, complete: int) -> LimitCycle | None:
        """Summarise the settled part, if that many common periods are complete; None if nothing is left."""
        first, last = (self.first, complete) if self.whole else (0, self.periods)
        begin, end = self.begin, last * self.dynamics.motion.period if self.whole else self.end
        if last <= first or end <= begin:
            return None
        found = PerPeriod(*(np.concatenate(part) for part in zip(*self.parts, strict=True)))
        counts = (first <= found.period) & (found.period < last)
        low, high, force, integrals = (part[counts] for part in found[1:])
        mean, square, apart = integrals.sum(axis=0) / (end - begin)
        sections = np.concatenate(self.sections)[first : last + 1 if self.whole else 1]
        period, difference = repetition(sections[:, elastic(self.dynamics)])
        return LimitCycle(
            begin=begin, end=end, peak_to_peak=high.max(axis=0) - low.min(axis=0),
            rms=np.sqrt(np.maximum(square - mean**2, 0.0)),
            peak=np.maximum(high.max(axis=0) - mean, mean - low.min(axis=0)),
            force_peak=force.max(axis=0), contact_loss=np.clip(apart, 0.0, 1.0), period=period,
            difference=difference,
        )  # fmt: skip


def elastic(dynamics: Dynamics) -> Array:
    """``(m,)`` bool: all but rigid-body modes, which turn the train as a whole; damped velocities of these count."""
    n = dynamics.size // 2
    # Modes along which no mesh is deflected, but for rounding, and that nothing stiffens.
    still = ~np.any(np.abs(dynamics.gauge[:, :n]) > 1e-9 * np.abs(dynamics.gauge[:, :n]).max(), axis=0)
    free = still & (np.abs(dynamics.fixed[n : 2 * n, :n]).max(axis=0, initial=0.0) == 0)
    drag = np.abs(dynamics.fixed[n : 2 * n, n : 2 * n]).max(axis=0, initial=0.0)
    held = drag > UNDAMPED * drag.max(initial=0.0)
    return np.concatenate([~free, ~free | held])


def repetition(sections: Array) -> tuple[int, float]:
    """(period, difference): the smallest number of sections after which the last ones repeat themselves."""
    count = len(sections)
    size = float(np.abs(sections - sections.mean(axis=0)).max(initial=0.0))
    size = max(size, float(np.abs(sections).max(initial=0.0)))
    least, best = 0, np.inf
    for p in range(1, min(LONGEST_CYCLE, (count - 1) // 2) + 1):
        ahead, behind = sections[count - p - 1 :], sections[count - 2 * p - 1 : count - p]
        difference = float(np.abs(ahead - behind).max(initial=0.0)) / size if size > 0 else 0.0
        if difference <= SETTLED:
            return p, difference
        best = min(best, difference)
    return least, best


def factors(model: Dynamics, track: Track, elastic: Array) -> Array:
    """``(F, m, m)``: the matrices that a deviation of the elastic state meets on its way, the first one first.

    elastic: which states are.

    Between two changes of contact the deviation obeys the linear equation of the motion itself, d' = A(t) d, and its
    matrix over a piece is the Taylor series by which the piece was found. A change of contact adds a saltation matrix

        S = I + (f+ - f-) n^T/(n^T f-),

    n the gradient of the deflection, f-+ the rates of the state before and after. The elastic mesh force is continuous,
    which leaves S = I but for dampings that act in contact only: f+ - f- = D v, v the speed of the deflection. S
    carries what D does to velocities over to positions, whatever the speed. A touch of speed 0 is no exception.

    Source: Leine & Nijmeijer 2004, chapter 7 (saltation matrices).
    """
    contacts, which = np.unique(track.contact, axis=0, return_inverse=True)
    row, column = np.ix_(elastic, elastic)
    constant, parts = (part[..., row, column][np.ravel(which)] for part in model.generators(contacts))
    generators = np.einsum("skj,sjab->skab", track.values, parts)
    generators[:, 0] += constant
    found = _flows(generators * track.length[:, None, None, None])
    ends = np.flatnonzero(track.mesh >= 0)
    jumps = _saltations(model, track[ends])[:, row, column]
    return np.insert(found, ends + 1, jumps, axis=0)


def _flows(generators: Array) -> Array:
    """``(S, m, m)``, y(1) of y' = sum_i u^i G_i y, y(0) = I, for ``(S, order, m, m)``."""
    size, order = generators.shape[-1], generators.shape[1]
    terms = [np.broadcast_to(np.eye(size), (len(generators), size, size))]
    for k in range(DEGREE):
        following = generators[:, 0] @ terms[k]
        for i in range(1, min(order, k + 1)):
            following = following + generators[:, i] @ terms[k - i]
        terms.append(following / (k + 1))
    return np.asarray(sum(reversed(terms)))


def _saltations(model: Dynamics, ends: Track) -> Array:
    """``(E, m, m)``, S of the changes of contact at the ends of pieces."""
    m, n = model.size, model.size // 2
    carried = model.carriers == ends.mesh[:, None]
    acting = np.tensordot(ends.values.sum(axis=1) * carried, model.parts[:, :m, n:m], axes=1)
    acting -= model.drags[ends.mesh, :m, n:m]
    found = np.tile(np.eye(m), (len(acting), 1, 1))
    sign = np.where(ends.kind == KINDS.index("separation"), -1.0, 1.0)
    found[:, :, :n] += sign[:, None, None] * acting / np.diagonal(model.fixed[:n, n:m])
    return found
