"""Gear systems whose teeth part, by numerical integration in physical coordinates, straight from the definition."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from driven_reference import breaks, series
from scipy.integrate import solve_ivp

from gearstab.system import GearSystem

Array = np.ndarray


def integrated(
    system: GearSystem, limits: Array, omega: float, start: Array, times: Array
) -> tuple[Array, list[tuple[float, int, int]]]:
    """(q, q') at ascending times ``(X, 2n)``, and the changes (time, mesh, contact afterwards), by DOP853.

    limits: ``(meshes, 2)``, the ends of the play. Restarted at every jump, kink and change of contact.
    """
    n = system.size
    inverse = np.linalg.inv(system.mass)
    g = np.stack([mesh.direction for mesh in system.meshes])
    own = np.zeros((n, n)) if system.damping is None else np.array(system.damping, dtype=float)
    for mesh in system.meshes:
        own -= mesh.damping * np.outer(mesh.direction, mesh.direction)
    has = limits[:, 1] > limits[:, 0]

    def errors(t: float) -> Array:
        found = np.zeros((len(system.meshes), 2))
        for i, mesh in enumerate(system.meshes):
            if mesh.transmission_error is not None:
                rate = float(mesh.frequency_ratio) * omega / (2 * np.pi)
                found[i] = np.multiply(series(mesh.transmission_error, rate * t - mesh.lag), [1, rate])
        return found

    def force(t: float, q: Array, v: Array, contact: Array) -> Array:
        turns = omega * t / (2 * np.pi)
        total = (0 if system.load is None else system.load) - system.stiffness @ q - own @ v
        for item in system.forces:
            total = total + item.profile.value(float(item.frequency_ratio) * turns - item.lag) * item.direction
        e = errors(t)
        for i, mesh in enumerate(system.meshes):
            if not contact[i]:
                continue
            phase = np.asarray(float(mesh.frequency_ratio) * turns - mesh.lag)
            k = mesh.mean_stiffness * (1 + 2 * mesh.epsilon * mesh.waveform.value(phase))
            drag = mesh.damping
            for term in system.terms:
                drag = drag + (term.damping.value(phase) if term.mesh == mesh.name else 0)
            offset = limits[i, 1] if contact[i] > 0 else limits[i, 0]
            total = total - (k * (g[i] @ q - e[i, 0] - offset) + drag * (g[i] @ v - e[i, 1])) * g[i]
        return total

    x = g @ start[:n] - errors(0.0)[:, 0]
    contact = np.where(~has | (x > limits[:, 1]), 1, np.where(x < limits[:, 0], -1, 0))
    state, found, changes = start, [], []
    for a, b in pairwise(breaks(system, omega, times[-1])):
        while a < b:

            def rate(t: float, y: Array, a: float = a, b: float = b, contact: Array = contact) -> Array:
                inner = min(max(t, a + 1e-9 * (b - a)), b - 1e-9 * (b - a))
                return np.concatenate([y[n:], inverse @ force(inner, y[:n], y[n:], contact)])

            watched, events = [], []
            for i in np.flatnonzero(has):
                ways = {1: [(1, -1, 0)], -1: [(0, 1, 0)], 0: [(1, 1, 1), (0, -1, -1)]}[int(contact[i])]
                for end, direction, after in ways:

                    def event(t: float, y: Array, i: int = i, end: int = end) -> float:
                        return float(g[i] @ y[:n] - errors(t)[i, 0] - limits[i, end])

                    event.terminal, event.direction = True, direction  # type: ignore[attr-defined]
                    events.append(event)
                    watched.append((i, after))
            inside = times[(times >= a) & (times < b)]
            done = solve_ivp(
                rate, (a, b), state, "DOP853", rtol=1e-12, atol=1e-13, events=events, dense_output=True, max_step=0.1
            )  # fmt: skip
            a, state = done.t[-1], done.y[:, -1]
            found += [(t, done.sol(t)) for t in inside if t < a]
            if done.status == 1:
                i, after = watched[next(k for k, hit in enumerate(done.t_events) if len(hit))]
                contact = contact.copy()
                contact[i] = after
                changes.append((a, int(i), after))
    found.append((times[-1], state))
    return np.array([y for _, y in found]), changes
