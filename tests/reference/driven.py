"""Driven gear systems, and their motion in physical coordinates by integration and exponentials."""

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np
import systems
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import minimize_scalar
from systems import unequal

from gearstab.mesh import PeriodicForce, PeriodicTerm
from gearstab.propagation.path import Path
from gearstab.system import GearSystem
from gearstab.systems import build
from gearstab.waveforms import Constant, Fourier, Rectangular, Scaled, Trapezoidal

Array = np.ndarray

ERROR = {"sin": [0.1, 0.02], "cos": [0.0, 0.03]}


def train(tooth_ratio: Any = 1, epsilon: float = 0.3, **changes: Any) -> GearSystem:
    """Lin & Parker's train under load, with a transmission error and damping of its first mesh."""
    first = {"damping": 0.05, "transmission_error": ERROR}
    return build(
        unequal(tooth_ratio, epsilon, **{"first": first, "damping_ratio": 0.1, "load": [0.2, 0, 0.5]} | changes)
    )


def pair(mesh: dict[str, Any] | None = None, **changes: Any) -> GearSystem:
    return build(systems.pair({"mean_stiffness": 4.0, "epsilon": 0.0} | (mesh or {}), **changes))


def with_waves(system: GearSystem, *waves: Any) -> GearSystem:
    meshes = [replace(mesh, waveform=wave) for mesh, wave in zip(system.meshes, waves, strict=True)]
    return replace(system, meshes=tuple(meshes))


def with_friction(system: GearSystem, profile: Any) -> GearSystem:
    """Forces across the line of action, and a damping that varies."""
    g, across = system.meshes[0].direction, np.array([0.3, -0.1, 0.2])
    terms = (
        PeriodicTerm("friction", across, g, stiffness=profile, lag=0.1),
        PeriodicTerm("damping", g, g, damping=Scaled(profile, 0.05, 0.02)),
    )
    return replace(system, terms=terms)


SMOOTH = Trapezoidal(1.47, 0.2), Fourier(np.array([0.4, 0.1]), np.array([0.2, 0.0]))

FORCE = PeriodicForce(
    "force", np.array([0.0, 1.0, 0.0]), Fourier(np.array([0.2]), np.array([0.1])), Fraction(1, 2), 0.3
)

PULSES = PeriodicForce("pulses", np.array([0.0, 0.0, 1.0]), Scaled(Rectangular(1.3), 0.1, 0.5), Fraction(2), 0.1)

RAMPS = PeriodicForce("ramps", np.array([1.0, 0.0, 0.0]), Trapezoidal(1.4, 0.3))

FULL = [[0.3, 0.02, 0], [0.02, 0.3, -0.03], [0, -0.03, 0.4]]

CASES: dict[str, tuple[GearSystem, float]] = {
    "piecewise constant": (train(), 2.6),
    "unequal frequencies": (train(Fraction(2, 3)), 1.31),
    "forces": (replace(train(), forces=(FORCE, PULSES)), 1.7),
    "force of ramps": (replace(train(), forces=(RAMPS,)), 1.7),
    "full damping": (train(damping_ratio=0.0, damping={"matrix": FULL}), 0.83),
    "smooth waves": (with_waves(train(), *SMOOTH), 1.9),
    "friction": (with_friction(train(), Rectangular(1.6)), 1.4),
    "smooth friction": (with_friction(with_waves(train(), *SMOOTH), Fourier(np.array([0.2]), np.array([0.1]))), 1.4),
    "constant friction": (with_friction(train(), Constant(0.1)), 2.1),
}  # fmt: skip


# ---- integration


def force_and_matrices(system: GearSystem, omega: float, t: float) -> tuple[Array, Array, Array]:
    """f(t), K(t), C(t), term by term."""
    turns = omega * t / (2 * np.pi)
    n = system.size
    force = np.zeros(n) if system.load is None else np.array(system.load, dtype=float)
    stiffness = np.array(system.stiffness, dtype=float)
    damping = np.zeros((n, n)) if system.damping is None else np.array(system.damping, dtype=float)
    for mesh in system.meshes:
        ratio = float(mesh.frequency_ratio)
        x = ratio * turns - mesh.lag
        k = mesh.mean_stiffness * (1 + 2 * mesh.epsilon * mesh.waveform.value(np.asarray(x)))
        stiffness += k * np.outer(mesh.direction, mesh.direction)
        if mesh.transmission_error is not None:
            error, rate = series(mesh.transmission_error, x)
            force += (k * error + mesh.damping * rate * ratio * omega / (2 * np.pi)) * mesh.direction
    for term in system.terms:
        x, outer = float(term.frequency_ratio) * turns - term.lag, np.outer(term.left, term.right)
        if term.stiffness is not None:
            stiffness += term.stiffness.value(np.asarray(x)) * outer
        if term.damping is not None:
            damping += term.damping.value(np.asarray(x)) * outer
    for item in system.forces:
        force += item.profile.value(np.asarray(float(item.frequency_ratio) * turns - item.lag)) * item.direction
    for turn in system.rotations:
        w = float(turn.speed) if turn.speed_ratio is None else float(turn.speed_ratio) * omega
        damping += w * (0 if turn.gyroscopic is None else turn.gyroscopic)
        stiffness += w * (0 if turn.circulatory is None else turn.circulatory)
        stiffness += w**2 * (0 if turn.centripetal is None else turn.centripetal)
    return force, stiffness, damping


def series(profile, x: float) -> tuple[float, float]:
    """A Fourier series at the phase x and its derivative with respect to x."""
    s = 2 * np.pi * np.arange(1, len(profile.sin) + 1)
    value = profile.sin @ np.sin(s * x) + profile.cos @ np.cos(s * x)
    return float(value), float((s * profile.sin) @ np.cos(s * x) - (s * profile.cos) @ np.sin(s * x))


def breaks(system: GearSystem, omega: float, end: float) -> Array:
    """0, the end and all jumps and kinks between them."""
    parts = [(mesh.waveform, mesh.frequency_ratio, mesh.lag) for mesh in system.meshes]
    parts += [(p, term.frequency_ratio, term.lag) for term in system.terms for p in term.profiles]
    parts += [(item.profile, item.frequency_ratio, item.lag) for item in system.forces]
    found = [0.0, end]
    for profile, ratio, lag in parts:
        turns = float(ratio) * omega / (2 * np.pi)
        cycles = np.arange(-2, int(end * turns) + 3)
        times = (np.ravel(profile.breakpoints())[:, None] + cycles + lag) / turns
        found += list(times[(times > 0) & (times < end)])
    found = np.sort(found)
    return found[np.append(np.diff(found) > 1e-12, True)]


def force_peaks(system: GearSystem, omega: float, start: Array, end: float) -> tuple[Array, Array]:
    """The least and greatest (mesh force, mesh deflection) ``(2, meshes)`` until the end, between breaks to rounding.

    From the continuous solution of DOP853: the best of 400 points in each interval and a bounded search around it.
    """
    n, inverse = system.size, np.linalg.inv(system.mass)
    low, high = np.full((2, len(system.meshes)), np.inf), np.full((2, len(system.meshes)), -np.inf)
    state = np.array(start)
    for a, b in pairwise(breaks(system, omega, end)):

        def inside(t: float, a: float = a, b: float = b) -> float:
            return float(min(max(t, a + 1e-12 * (b - a)), b - 1e-12 * (b - a)))

        def rate(t: float, y: Array, inside: Callable[[float], float] = inside) -> Array:
            force, stiffness, damping = force_and_matrices(system, omega, inside(t))
            return np.concatenate([y[n:], inverse @ (force - stiffness @ y[:n] - damping @ y[n:])])

        longest = 2 * np.pi / omega / 150
        found = solve_ivp(rate, (a, b), state, "DOP853", rtol=1e-12, atol=1e-13, dense_output=True, max_step=longest)
        state = found.y[:, -1]
        times = np.linspace(a, b, 401)
        for i in range(len(system.meshes)):
            for kind in range(2):

                def value(t: float, i: int = i, kind: int = kind, solution: Any = found.sol, at: Any = inside) -> float:
                    stretch = system.meshes[i].direction @ solution(t)[:n]
                    return float(stretch if kind else mesh_force(system, i, omega, at(t), stretch))

                values = np.array([value(t) for t in times])
                for sign, best in ((1, low), (-1, high)):
                    near = int(np.argmin(sign * values))
                    ends = times[max(near - 1, 0)], times[min(near + 1, 400)]
                    peak = minimize_scalar(lambda t: sign * value(t), bounds=ends, method="bounded")  # noqa: B023
                    best[kind, i] = sign * min(sign * best[kind, i], sign * values[near], float(peak.fun))
    return low, high


def mesh_force(system: GearSystem, i: int, omega: float, t: float, deflection: float) -> float:
    """k_i (deflection - e_i)."""
    mesh = system.meshes[i]
    x = float(mesh.frequency_ratio) * omega * t / (2 * np.pi) - mesh.lag
    error = 0.0 if mesh.transmission_error is None else series(mesh.transmission_error, x)[0]
    return float(
        mesh.mean_stiffness * (1 + 2 * mesh.epsilon * mesh.waveform.value(np.asarray(x))) * (deflection - error)
    )


def generators(system: GearSystem, steps: int = 1) -> list[tuple[float, Array]]:
    """Parts of the common period (in radians of the first mesh) and the matrix of (q, q') in the middle of each.

    steps: parts of a cycle of the first mesh, besides those between jumps and kinks.
    """
    cycles = float(system.common_period()[0])
    equal = 2 * np.pi * np.arange(np.ceil(cycles * steps)) / steps
    edges = np.unique(np.concatenate([breaks(system, 1.0, 2 * np.pi * cycles), equal]))
    n, inverse, found = system.size, np.linalg.inv(system.mass), []
    for begin, end in pairwise(edges[np.append(np.diff(edges) > 1e-12, True)]):
        _, stiffness, damping = force_and_matrices(system, 1.0, 0.5 * (begin + end))
        matrix = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ stiffness, -inverse @ damping]])
        found.append((float(end - begin), matrix))
    return found


def monodromy(system: GearSystem, omega: Array, steps: int = 1) -> Array:
    """The product of matrix exponentials over the common period ``(points, 2n, 2n)``; exact where all is constant
    between jumps and nothing turns.
    """
    total = np.eye(2 * system.size)
    for part, matrix in generators(system, steps):
        total = expm(matrix * (part / np.asarray(omega))[:, None, None]) @ total
    return total


def integrated(
    system: GearSystem, omega: float, start: Array, end: float, extra: Callable[..., Array] | None = None
) -> Array:
    """(q, q', integrals of ``extra``(t, q, v)) at the end, from (q, q') at 0, by DOP853 restarted at every break.

    start: one state, or several as columns, of which the motion without forces is followed.
    """
    n, inverse = system.size, np.linalg.inv(system.mass)
    integrals = 0 if extra is None else len(extra(0.1, start[:n], start[n:]))
    state = np.concatenate([start, np.zeros((integrals, *start.shape[1:]))])
    shape = state.shape
    for a, b in pairwise(breaks(system, omega, end)):

        def rate(t: float, y: Array, a: float = a, b: float = b) -> Array:
            # Just inside the interval, where the functions are those of the interval.
            inner = min(max(t, a + 1e-9 * (b - a)), b - 1e-9 * (b - a))
            force, stiffness, damping = force_and_matrices(system, omega, inner)
            y = y.reshape(shape)
            q, v = y[:n], y[n : 2 * n]
            more = y[2 * n :] if extra is None else extra(inner, q, v)
            push = force if len(shape) == 1 else 0
            return np.concatenate([v, inverse @ (push - stiffness @ q - damping @ v), more]).ravel()

        state = solve_ivp(rate, (a, b), state.ravel(), "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return state.reshape(shape)


def integrated_along(system: GearSystem, path: Path, times: Array, start: Array) -> Array:
    """(q, q') at times of a path, from (q, q') at 0, by DOP853 begun anew at every jump and knot.

    start: one state, or several as columns, of which the motion without forces is followed. Rotations have exact ratios
    and gyroscopic matrices.
    """
    n, inverse, shape = system.size, np.linalg.inv(system.mass), start.shape
    moments = path.time[:-1]
    for k, first in enumerate(path.mesh_frequency[:-1]):
        # Zeros of theta(t) - theta_jump on every straight piece.
        beyond = breaks(system, 1.0, path.phase[k + 1]) - path.phase[k]
        beyond = beyond[beyond > 0]
        since = 2 * beyond / (first + np.sqrt(np.maximum(first**2 + 2 * path.rate[k] * beyond, 0.0)))
        moments = np.append(moments, path.time[k] + since)
    moments = moments[moments <= times[-1]]
    # Begun anew at samples too: between its steps DOP853 is less accurate.
    moments = np.concatenate([times, moments[np.abs(times[:, None] - moments).min(axis=0) > 1e-11]])
    order = np.argsort(moments)
    moments, sample = moments[order], order < len(times)
    state, found = start, [start]
    for a, b in pairwise(moments):
        k = min(int(np.searchsorted(path.time, 0.5 * (a + b))), len(path.rate)) - 1

        def rate(t: float, y: Array, a: float = a, b: float = b, k: int = k) -> Array:
            t = min(max(t, a + 1e-9 * (b - a)), b - 1e-9 * (b - a))
            since = t - path.time[k]
            speed = path.mesh_frequency[k] + path.rate[k] * since
            theta = path.phase[k] + (path.mesh_frequency[k] + 0.5 * path.rate[k] * since) * since
            # At the phase theta and the speed of the moment.
            force, stiffness, damping = force_and_matrices(system, speed, theta / speed)
            for turn in system.rotations:
                # The Euler force of a turning frame.
                stiffness += 0.5 * float(turn.speed_ratio) * path.rate[k] * turn.gyroscopic
            y = y.reshape(shape)
            push = force if len(shape) == 1 else 0
            pull = stiffness @ y[:n] + damping @ y[n:]
            return np.concatenate([y[n:], inverse @ (push - pull)]).ravel()

        state = solve_ivp(rate, (a, b), state.ravel(), "DOP853", rtol=1e-12, atol=1e-13).y[:, -1].reshape(shape)
        found.append(state)
    return np.array(found)[sample]


def integrated_with_backlash(
    system: GearSystem, limits: Array, omega: float, start: Array, times: Array
) -> tuple[Array, list[tuple[float, int, int]]]:
    """(q, q') at ascending times ``(X, 2n)`` of teeth that part, and the changes (time, mesh, contact afterwards).

    limits: ``(meshes, 2)``, the ends of the play. DOP853, restarted at every jump, kink and change of contact.
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
