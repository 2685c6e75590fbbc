"""How errors of a state grow along a history of a gear pair, and how long a history can be told.

Small differences d of the state y = (phi, phi', theta, theta') follow the flow's derivative between two changes of the
stiffness, and at each of them the saltation matrix

    S = DR + (F+ - DR F-) e_theta^T/theta'-,

of the map R of the state there and the vector fields F-, F+ before and after it (Leine & Nijmeijer 2004, ch. 7). Where
the gears are reflected it is the same with the field of one region on both sides. A slow meeting, theta'- near zero,
amplifies much: histories with reflections are chaotic.

The error of a computed state is carried along as a covariance matrix, P <- S (Phi P Phi^T + Q) S^T, with the rounding
errors Q of each piece. That is of first order: once errors are as large as the motion it says no more than that. What
is kept is a factor of P = L L^T (square-root form: Bierman 1977), since P itself loses its small variances to rounding
where directions differ by more than eight digits, and may turn negative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearstab.response.rotating_pair.integrate import Crossing, TimedArc
from gearstab.response.rotating_pair.jumps import Law
from gearstab.response.rotating_pair.motion import free_basis
from gearstab.system import Array

ROUNDING = 0.5 * float(np.finfo(float).eps)
LOST = 0.01
"""Error of phi, as a part of its largest magnitude so far, from which on a history is one of many."""
LARGEST = 1e100
"""Beyond this amplification there is nothing left to tell."""
WIDEST = 40
"""Columns that a factor of the covariance may grow to, four an event, before it is made square again."""
TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True)
class ErrorGrowth:
    """Errors just after each event ``(events,)``.

    amplification: the factor by which a small error of the initial state has grown, with time in units of 1/w0: the
        Frobenius norm of the derivative, at most LARGEST.
    error: what rounding errors have made of phi, as a part of its largest magnitude so far, at most 1.
    """

    amplification: Array
    error: Array

    @property
    def first_lost(self) -> int | None:
        """The event, from 0, from which on the history is one of many; None if it is certain to the end."""
        lost = self.error > LOST
        return int(np.argmax(lost)) if lost.any() else None


def growth(law: Law, pieces: Sequence[TimedArc], events: Sequence[Crossing]) -> ErrorGrowth:
    """Errors along the pieces of a run, each but the last of which ends with the event of the same number."""
    if not events:
        return ErrorGrowth(np.empty(0), np.empty(0))
    steps, noise, size = _steps(law, pieces, events)
    amplification, error = np.full(len(events), LARGEST), np.ones(len(events))
    total, root = np.eye(4), np.diag(ROUNDING * np.array([size[0], size[0], 1.0, 1.0]))
    for k, (step, own) in enumerate(zip(steps, noise, strict=True)):
        with np.errstate(invalid="ignore", over="ignore"):
            total, both = step @ total, np.hstack([step @ root, own])
            factor, deviation = np.sqrt(np.vdot(total, total)), np.sqrt(np.vdot(both[0], both[0]))
        if not (factor < LARGEST and np.all(np.isfinite(both)) and np.isfinite(deviation)):
            break
        root = both if both.shape[1] < WIDEST else np.linalg.qr(both.T)[1].T
        amplification[k], error[k] = factor, min(deviation / size[k], 1.0)
        if deviation > size[k]:
            # Of no more use, and large numbers overflow.
            root = root * (size[k] / deviation)
    return ErrorGrowth(amplification, np.maximum.accumulate(error))


def _steps(law: Law, pieces: Sequence[TimedArc], events: Sequence[Crossing]) -> tuple[Array, Array, Array]:
    """Derivatives from one event to the next ``(E, 4, 4)``, factors of the covariances of the rounding errors that
    each step adds ``(E, 4, 4)``, and the largest |phi| so far ``(E,)``.
    """
    start = np.array([piece.arc.start for piece in pieces[: len(events)]])
    time = np.array([piece.duration for piece in pieces[: len(events)]])
    region = np.array([event.region for event in events])
    passed = np.array([event.passed for event in events])
    before, after = np.array([event.before for event in events]), np.array([event.after for event in events])
    kappa, beyond = np.array(law.kappa)[region], np.array(law.kappa)[np.where(passed, 1 - region, region)]
    derivative = _derivative(law, before, after, passed, beyond - kappa)
    flow = _field(law, beyond, after) - np.einsum("eij,ej->ei", derivative, _field(law, kappa, before))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        derivative[:, :, 2] += flow / before[:, 3, None]
    rest = np.abs(law.load / kappa)
    size = np.maximum(np.abs(start[:, 0] - law.load / kappa) + rest, np.abs(start[:, 1]) / np.sqrt(kappa))
    turns = 1 + np.sqrt(kappa) * time
    angle = np.pi + (np.abs(start[:, 3]) + np.abs(law.follows * start[:, 1])) * time
    noise = ROUNDING * np.stack([size * turns, size * turns, angle, np.abs(before[:, 3]) + size * turns], axis=-1)
    own = derivative * noise[:, None, :]
    with np.errstate(invalid="ignore"):  # a meeting at rest: infinite derivatives
        steps = derivative @ _flow(law, kappa, time)
    return steps, own, np.maximum.accumulate(np.maximum(size, TINY))


def _flow(law: Law, kappa: Array, time: Array) -> Array:
    """The derivative of the state at the end of an arc by that at its beginning, ``(E, 4, 4)``."""
    s, c, u = free_basis(time, kappa, np.asarray(law.zeta))
    zero, one, m = np.zeros_like(time), np.ones_like(time), law.follows
    rows = [
        [one - kappa * u, s, zero, zero],
        [-kappa * s, c, zero, zero],
        [-m * kappa * u, m * (s - time), one, time],
        [-m * kappa * s, m * (c - 1), zero, one],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _field(law: Law, kappa: Array, state: Array) -> Array:
    """dy/dt ``(E, 4)``."""
    force = law.load - kappa * state[:, 0] - 2 * law.zeta * state[:, 1]
    return np.stack(
        [state[:, 1], force + law.follows * law.drive, state[:, 3], law.follows * force + law.drive], axis=-1
    )


def _derivative(law: Law, before: Array, after: Array, passed: Array, change: Array) -> Array:
    """DR of :meth:`~gearstab.response.rotating_pair.jumps.Law.cross`, ``(E, 4, 4)``."""
    found = np.broadcast_to(np.eye(4), (len(before), 4, 4)).copy()
    if not law.impulsive:
        return found
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        by_phi = np.where(passed, -change * before[:, 0] / after[:, 3], 0.0)
        by_speed = np.where(passed, before[:, 3] / after[:, 3], -1.0)
    found[:, 1, 0], found[:, 1, 3] = law.m * by_phi, law.m * (by_speed - 1)
    found[:, 3, 0], found[:, 3, 3] = by_phi, by_speed
    return found
