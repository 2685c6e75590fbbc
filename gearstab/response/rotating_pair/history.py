"""The time response of a gear pair in SI units: histories, states at the sections, events."""

from __future__ import annotations

from dataclasses import dataclass
from math import floor, inf, tau

import numpy as np

from gearstab.response.history import finite
from gearstab.response.rotating_pair.integrate import (
    STATUS,
    Crossing,
    ErrorGrowth,
    Goal,
    Run,
    TimedArc,
    growth,
    integrate,
)
from gearstab.response.rotating_pair.motion import Law, law_of
from gearstab.rotating_pair import PairNumbers, RotatingPair
from gearstab.system import Array

PATIENCE = 10.0
"""A run towards an angle is given up after so many times the time that it would take at the initial speed. Without
damping the gears may turn back and forth for ever; no run towards an angle that they reach in earnest is so slow."""

MISSED = 1e-3
"""Part of a step by which a run may end before its last sample. One that is held on an orbit ends on a sample but for
rounding errors, which have grown until then (by 1e-5 steps in 120 cycles at 600 rpm), and its spectrum, over a whole
number of cycles, would be another one with a sample less."""


@dataclass(frozen=True)
class Sections:
    """States just after each crossing of theta = 2 pi c, ``(crossings,)`` each, in the order of time.

    cycle: c. direction: 1, or -1 where the gears turn back. energy: of the state after.
    """

    cycle: Array
    direction: Array
    time: Array
    phi: Array
    phi_dot: Array
    theta_dot: Array
    energy: Array

    @property
    def theta(self) -> Array:
        """2 pi c."""
        return tau * self.cycle


@dataclass(frozen=True)
class Events:
    """All meetings with a change of the mesh stiffness, ``(events,)`` each.

    pairs_before, pairs_after: of teeth in contact, the same where the gears were reflected. energy_change: of the
    total energy, dk phi^2 where a formulation neglects what that takes. error_amplification, rounding_error: see
    :class:`~gearstab.response.rotating_pair.integrate.ErrorGrowth`.
    """

    time: Array
    direction: Array
    passed: Array
    pairs_before: Array
    pairs_after: Array
    theta: Array
    phi: Array
    phi_dot_before: Array
    phi_dot_after: Array
    theta_dot_before: Array
    theta_dot_after: Array
    energy_change: Array
    error_amplification: Array
    rounding_error: Array


@dataclass(frozen=True)
class PairResponse:
    """The response of a gear pair.

    time: ``(samples,)``, from 0 in equal steps. phi, phi_dot, theta, theta_dot: at these times; at a change of the
    stiffness just after it. energy: U = T + V - W, kinetic and strain energy less the work of the torques (J).
    stiffness: k (N m). mesh_force: k phi/lever, along the line on which the lever acts (N), or k phi, the torque on a
    gear over its number of teeth (N m), without a lever; elastic part.
    sections, events: see there. status: bits of STATUS. stalled: when the gears stalled, inf if they did not.
    end: when the run ended; the last sample is the last one not after it. advance: of theta until then, in mesh cycles.
    asked: the advance that was to be reached, None where it was something else.
    predictable: until when rounding errors leave the history what it is, inf if to its end.
    """

    time: Array
    phi: Array
    phi_dot: Array
    theta: Array
    theta_dot: Array
    energy: Array
    stiffness: Array
    mesh_force: Array
    sections: Sections
    events: Events
    status: int
    stalled: float
    end: float
    advance: float
    asked: float | None
    predictable: float

    @property
    def status_text(self) -> str:
        """The status in words."""
        return ", ".join(name for name, bit in STATUS.items() if self.status & bit) or "complete"


@dataclass(frozen=True)
class InitialState:
    """The initial state. phi None: the static deflection T0/k. speed: theta_dot."""

    speed: float
    phi: float | None = None
    phi_dot: float = 0.0
    theta: float = 0.0


def respond(
    pair: RotatingPair,
    start: InitialState,
    step: float,
    duration: float = inf,
    cycles: float | None = None,
    most_samples: float = 2e7,
    drive: float = 0.0,
) -> PairResponse:
    """The response of a single pair, exact between the changes of its mesh stiffness.

    start: the initial state. step: between samples (s). duration: how long (s); cycles: or until theta has advanced by
    so many mesh cycles, which is given up after PATIENCE times the time at the initial speed, or neither: until the
    gears stall. most_samples: after which a run is given up. drive: an unbalanced torque (N m) on theta, as if
    N1 (T0 + drive) drove the first gear and N2 (T0 - drive) loaded the second.

    The gears have stalled when their energy no longer suffices to leave the softer region; then a run that waits for
    anything but a time ends.

    Raises ValueError for a batch of pairs.
    """
    law = law_of(pair, drive / float(pair.numbers.k0))
    rate = float(pair.numbers.w0)
    turns = floor(start.theta / tau)
    local = min(max(start.theta - tau * turns, 0.0), tau)
    static = law.load / law.kappa[0 if local < law.edges[1] else 1]
    state = (static if start.phi is None else start.phi, start.phi_dot / rate, local, start.speed / rate)
    patience = most_samples * step * rate
    goal = Goal(duration * rate, patience)
    if cycles is not None:
        slow = PATIENCE * tau * cycles * rate / abs(start.speed) if start.speed else inf
        goal = Goal(duration * rate, min(patience, slow), floor(cycles), tau * (cycles - floor(cycles)))
    run = Run()
    found = list(integrate(law, state, goal, run))
    pieces = [item for item in found if isinstance(item, TimedArc)]
    events = [item for item in found if isinstance(item, Crossing)]
    errors, predictable = growth(law, pieces, events), inf
    if errors.first_lost is not None:
        run.status |= STATUS["unpredictable"]
        predictable = events[errors.first_lost].time / rate
    states, region = _samples(pieces, step * rate, run.time, turns)
    kept = slice(finite(states.T))
    phi, phi_dot, theta, theta_dot = states[:, kept]
    stiffness = np.array(law.kappa)[region[kept]] * float(pair.numbers.k0)
    lever = 1.0 if pair.numbers.lever is None else float(pair.numbers.lever)
    final = pieces[-1]
    turned = final.arc.start[2] + final.arc.turned(final.duration) - pieces[0].arc.start[2]
    with np.errstate(over="ignore", invalid="ignore"):
        energy = total_energy(pair.numbers, law, region[kept], states[:, kept])
    return PairResponse(
        time=np.arange(len(phi)) * step,
        phi=phi,
        phi_dot=phi_dot * rate,
        theta=theta,
        theta_dot=theta_dot * rate,
        energy=energy,
        stiffness=stiffness,
        mesh_force=stiffness * phi / lever,
        sections=_sections(pair.numbers, law, events, turns),
        events=_events(pair.numbers, law, events, turns, errors),
        status=run.status,
        stalled=run.stalled / rate,
        end=run.time / rate,
        advance=final.cycle + turned / tau,
        asked=cycles,
        predictable=predictable,
    )


def _samples(pieces: list[TimedArc], step: float, end: float, turns: int) -> tuple[Array, Array]:
    """States in units of 1/w0 at the samples ``(4, samples)``, and the region of each.

    Each piece has the samples in it; its end belongs to the next one.
    """
    states, regions = [], []
    count = floor(end / step + MISSED) + 1
    for number, piece in enumerate(pieces):
        # A sample on an event, but for rounding, is one just after it.
        first = int(np.ceil(piece.begin / step - 1e-9))
        last = int(np.ceil((piece.begin + piece.duration) / step - 1e-9))
        last = count if number == len(pieces) - 1 else min(last, count)
        times = np.maximum(np.arange(first, last) * step - piece.begin, 0.0)
        if times.size:
            phi, phi_dot, theta, speed = piece.arc.samples(times)
            states.append(np.stack([phi, phi_dot, theta + tau * (piece.cycle + turns), speed]))
            regions.append(np.full(times.size, piece.region))
    return np.concatenate(states, axis=1), np.concatenate(regions)


def total_energy(numbers: PairNumbers, law: Law, region: Array, states: Array) -> Array:
    """U = T + V - W (J), with T = [(phi' - m theta')^2/(1 - m^2) + theta'^2]/M2, V = k phi^2 and W = 2 T0 phi.

    states: ``(4, N)`` in units of 1/w0. An unbalanced torque does the further work 2 (drive) theta.
    """
    phi, rate, theta, speed = states
    kinetic = (rate - law.m * speed) ** 2 / (1 - law.m**2) + speed**2
    strain = np.array(law.kappa)[region] * phi**2
    return (kinetic + strain - 2 * law.load * phi - 2 * law.drive * theta) * float(numbers.k0)


def _sections(numbers: PairNumbers, law: Law, events: list[Crossing], turns: int) -> Sections:
    found = [event for event in events if event.new_cycle != event.cycle]
    rate = float(numbers.w0)
    # Theta = 2 pi c is crossed into cycle c forwards, out of it backwards.
    cycle = np.array([max(event.cycle, event.new_cycle) + turns for event in found], dtype=int)
    after = np.array([event.after for event in found]).reshape(-1, 4).T
    after[2] = tau * cycle
    region = np.array([1 - event.region for event in found], dtype=int)
    return Sections(
        cycle=cycle,
        direction=np.array([event.direction for event in found], dtype=int),
        time=np.array([event.time for event in found]) / rate,
        phi=after[0],
        phi_dot=after[1] * rate,
        theta_dot=after[3] * rate,
        energy=total_energy(numbers, law, region, after),
    )


def _events(numbers: PairNumbers, law: Law, events: list[Crossing], turns: int, errors: ErrorGrowth) -> Events:
    rate = float(numbers.w0)
    before = np.array([event.before for event in events]).reshape(-1, 4).T
    after = np.array([event.after for event in events]).reshape(-1, 4).T
    region = np.array([event.region for event in events], dtype=int)
    passed = np.array([event.passed for event in events], dtype=bool)
    beyond = np.where(passed, 1 - region, region)
    change = total_energy(numbers, law, beyond, after) - total_energy(numbers, law, region, before)
    return Events(
        time=np.array([event.time for event in events]) / rate,
        direction=np.array([event.direction for event in events], dtype=int),
        passed=passed,
        pairs_before=1 + region,
        pairs_after=1 + beyond,
        theta=before[2] + tau * (np.array([event.cycle for event in events], dtype=int) + turns),
        phi=before[0],
        phi_dot_before=before[1] * rate,
        phi_dot_after=after[1] * rate,
        theta_dot_before=before[3] * rate,
        theta_dot_after=after[3] * rate,
        energy_change=change,
        error_amplification=errors.amplification,
        rounding_error=errors.error,
    )
