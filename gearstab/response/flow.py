"""Motion through any interval of time with mesh stiffnesses that someone else decides, contact lost among them.

Where :mod:`~gearstab.response.linear.intervals` follows the mesh stiffnesses as functions of time, here they are
given: the motion is exact as long as they stay, whatever ends the interval (a jump of the stiffness, teeth that part
or meet).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.floquet.general.exponential import expm
from gearstab.response.linear.driven import Driven
from gearstab.system import Array

AT_ONCE = 2**18
"""Entries of the matrices that are treated at once."""


@dataclass(frozen=True)
class Flow:
    """x' = A x + B z, z' = R z with constant A, B, R, per unit of time; see
    :class:`~gearstab.response.linear.driven.Driven`.

    motion: what it is a flow of, with z(tau) and the common period.
    generator: ``(m + L, m + L)``, [[A, B], [0, R]];  size: m;  scale: what z is multiplied by in it.
    """

    motion: Driven
    generator: Array
    size: int
    scale: float

    def states(self, x: Array, time: float, later: Array) -> Array:
        """The states ``(X, m)`` at times ``time + later (X,)`` of the motion that is in x ``(m,)`` at ``time``.

        later: from 0 on, not longer than the stiffnesses stay.
        """
        whole = np.concatenate([x, self.scale * self.motion.drive.z(np.array(time / self.motion.period))])
        later = np.atleast_1d(np.asarray(later, dtype=float))
        found = np.empty((len(later), self.size))
        count = max(1, AT_ONCE // self.generator.size)
        for i in range(0, len(later), count):
            part = slice(i, i + count)
            found[part] = (expm(self.generator * later[part, None, None]) @ whole)[:, : self.size]
        return found

    def rate(self, x: Array, time: Array) -> Array:
        """dx/dt ``(..., m)`` in states x ``(..., m)`` at times ``(...)``."""
        z = self.scale * self.motion.drive.z(np.asarray(time) / self.motion.period)
        return np.asarray(np.concatenate([x, z], axis=-1) @ self.generator[: self.size].T)


def flow(motion: Driven, stiffness: Array, tau: float, force: Array | None = None, closed: Array | None = None) -> Flow:
    """The flow while the meshes have the given stiffnesses.

    Parameters
    ----------
    motion: the system and its mesh frequency (:func:`gearstab.response.linear.driven.driven`).
    stiffness: ``(meshes,)``, k_i; a mesh whose teeth are apart has 0, and then neither its transmission error acts.
    tau: a time within the interval, in parts of the common period, for what else depends on time (terms, other forces).
    force: ``(n,)``, a further constant generalised force, such as k_i b_i g_i of a backlash b_i.
    closed: ``(meshes,)`` bool, whose damping acts; default all.

    Raises
    ------
    ValueError: something varies smoothly, so that no interval is exact.
    """
    drive, basis, points = motion.drive, motion.basis, motion.points
    if not drive.exact:
        raise ValueError("the motion is exact only where all but the mesh frequency's harmonics is piecewise constant")
    values = np.array(drive.varying(np.array([[tau]]))[0])
    values[0, : len(drive.counts)] = stiffness
    generators, constant, rates = points.inputs(values[None])
    omega = float(points.omega[0])
    a, b = generators[0, 0], constant[0, 0] + omega * rates[0]
    apart = np.zeros(len(drive.counts), dtype=bool) if closed is None else ~np.asarray(closed, dtype=bool)
    rate = float(basis.rate[0])
    for i in np.flatnonzero(apart & (drive.dampings[0] != 0)):
        push = basis.inlet[0] @ drive.directions[0, i] * drive.dampings[0, i]
        a = a + np.outer(push, drive.directions[0, i] @ basis.speed[0])
        b = b - omega * np.outer(push, drive.slopes[0, i])
    if force is not None:
        b = b.copy()
        b[:, 0] += basis.inlet[0] @ force
    scale = float(np.abs(b).max(initial=0.0)) or 1.0
    m, width = basis.size, drive.width
    generator = np.zeros((m + width, m + width))
    generator[:m, :m], generator[:m, m:] = a * rate, b * rate / scale
    turn = 2 * np.pi * drive.harmonics / motion.period
    cosine = m + 1 + 2 * np.arange(len(turn))
    generator[cosine, cosine + 1], generator[cosine + 1, cosine] = -turn, turn
    return Flow(motion, generator, m, scale)
