"""Exact propagation through segments of constant stiffness, in the modes of the mean system and scaled time.

The state is x = (y, y'), with q = Phi y, Phi^T M Phi = I and ' = d/(rate dt), so that all entries of a generator are of
order one and rigid-body modes are coordinates of their own. Several histories, the columns of x ``(2n, P)``, are
propagated together.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gearstab.modal import Modes, mean_modes, symmetric_eigen
from gearstab.system import Array, GearSystem

Advance = Callable[[int, float, int, Array], Array]
"""``advance(state, first, count, x (2n, P)) -> (count, 2n, P)``: x after having been in a state for the times first,
first + step, first + 2 step, ... with the step that the propagator was made for (units of time)."""


@dataclass(frozen=True)
class Coordinates:
    """q = Phi y; ``shapes`` is Phi ``(n, n)``, ``inverse`` its inverse Phi^T M, ``rate`` the unit of 1/time."""

    shapes: Array
    inverse: Array
    rate: float

    def state(self, displacement: Array, velocity: Array) -> Array:
        """x ``(2n,)`` from q and dq/dt."""
        return np.concatenate([self.inverse @ displacement, self.inverse @ velocity / self.rate])

    def physical(self, x: Array) -> tuple[Array, Array]:
        """q and dq/dt, ``(..., n)`` each, from x ``(..., 2n)``."""
        n = len(self.shapes)
        return x[..., :n] @ self.shapes.T, x[..., n:] @ self.shapes.T * self.rate


def propagator(system: GearSystem, levels: Array, step: float) -> tuple[Coordinates, Advance]:
    """The propagator through states with the mesh stiffnesses ``levels (D, meshes)`` for samples ``step`` apart.

    Undamped: the exact modal solution of each state. Damped: matrix exponentials of the first-order form, which need no
    eigenvectors and so have no trouble with critical damping.
    """
    modes = mean_modes(system)
    shapes = modes.shapes
    stiffness = shapes.T @ system.stiffness_matrix(list(np.moveaxis(levels, -1, 0))) @ shapes
    rigid = _rigid(modes)
    # Left in, a rounding error of 1e-17 in the stiffness of a rigid mode bends its uniform motion in the long run.
    stiffness[:, rigid], stiffness[:, :, rigid] = 0.0, 0.0
    rate = float(np.sqrt(np.max(np.abs(np.linalg.eigvalsh(stiffness))))) or 1.0
    coordinates = Coordinates(shapes, shapes.T @ np.asarray(system.mass, dtype=float), rate)
    scaled = stiffness / rate**2
    if system.damping is None:
        return coordinates, _modal(scaled, ~rigid, rate, step)
    return coordinates, _exponential(scaled, shapes.T @ system.damping @ shapes / rate, rate, step)


def _rigid(modes: Modes) -> Array:
    """Modes of zero frequency that deflect no mesh (with negative stiffness a zero may be accidental)."""
    size = np.abs(modes.mesh_deflection)
    return modes.rigid & np.all(size <= 1e-7 * np.max(size), axis=-1)


def _modal(stiffness: Array, elastic: Array, rate: float, step: float) -> Advance:
    """y = y_0 cos w t + y'_0 sin(w t)/w in the modes of each state; w is imaginary where the stiffness is negative."""
    frequencies = np.zeros(stiffness.shape[:2], dtype=complex)
    modes = np.broadcast_to(np.eye(stiffness.shape[-1]), stiffness.shape).copy()
    inner = np.ix_(np.arange(len(stiffness)), elastic, elastic)
    values, modes[inner] = symmetric_eigen(stiffness[inner])
    frequencies[:, elastic] = np.sqrt(values.astype(complex))

    def advance(state: int, first: float, count: int, x: Array) -> Array:
        w, v, n = frequencies[state][:, None], modes[state], stiffness.shape[-1]
        time = (first + step * np.arange(count)) * rate
        phase = w * time
        cosine, slope = np.cos(phase).real, -(w * np.sin(phase)).real
        # sinc covers w = 0, where the motion is uniform.
        sine = time * np.sinc(phase / np.pi).real
        position, velocity = v.T @ x[:n], v.T @ x[n:]
        moved = np.empty((count, *x.shape))
        moved[:, :n] = v @ (_each(cosine) * position + _each(sine) * velocity)
        moved[:, n:] = v @ (_each(slope) * position + _each(cosine) * velocity)
        return moved

    return advance


def _each(terms: Array) -> Array:
    """``(count, n, 1)`` from ``(n, count)``."""
    return terms.T[:, :, None]


def _exponential(stiffness: Array, damping: Array, rate: float, step: float) -> Advance:
    """x(t) = exp(A t) x(0), A = [[0, I], [-K, -C]]: one exponential to the first time, one a state for the steps."""
    from scipy.linalg import expm

    zero, one = np.zeros(damping.shape), np.eye(len(damping))
    generators = [np.block([[zero, one], [-k, -damping]]) * rate for k in stiffness]
    steps: dict[int, Array] = {}

    def advance(state: int, first: float, count: int, x: Array) -> Array:
        moved = np.empty((count, *x.shape))
        for j in range(count):
            if j == 0:
                moved[0] = expm(generators[state] * first) @ x
                continue
            if state not in steps:
                steps[state] = expm(generators[state] * step)
            moved[j] = steps[state] @ moved[j - 1]
        return moved

    return advance
