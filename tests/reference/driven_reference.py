"""Driven gear systems by numerical integration in physical coordinates, straight from the definition."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

from gearstab.system import GearSystem

Array = np.ndarray


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


def integrated(
    system: GearSystem, omega: float, start: Array, end: float, extra: Callable[..., Array] | None = None
) -> Array:
    """(q, q', integrals of ``extra``(t, q, v)) at the end, from (q, q') at 0, by DOP853 restarted at every break."""
    n, inverse = system.size, np.linalg.inv(system.mass)
    integrals = 0 if extra is None else len(extra(0.1, start[:n], start[n:]))
    state = np.concatenate([start, np.zeros(integrals)])
    edges = breaks(system, omega, end)
    for a, b in pairwise(edges):

        def rate(t: float, y: Array, a: float = a, b: float = b) -> Array:
            # Just inside the interval, where the functions are those of the interval.
            inner = min(max(t, a + 1e-9 * (b - a)), b - 1e-9 * (b - a))
            force, stiffness, damping = force_and_matrices(system, omega, inner)
            q, v = y[:n], y[n : 2 * n]
            more = [] if extra is None else extra(inner, q, v)
            return np.concatenate([v, inverse @ (force - stiffness @ q - damping @ v), more])

        state = solve_ivp(rate, (a, b), state, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    return state
