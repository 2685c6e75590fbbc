"""Responses at a held speed: from the periodic orbit, with the torque that keeps the gears on it."""

from __future__ import annotations

import numpy as np

from gearstab.errors import NotPossible
from gearstab.response.rotating_pair import orbit
from gearstab.response.rotating_pair.history import Start
from gearstab.response.rotating_pair.stability import monotone, problem_of
from gearstab.rotating_pair import RotatingPair


def held(pair: RotatingPair, mesh_frequency: float) -> tuple[Start, float]:
    """The state of a single pair on its periodic orbit of mean mesh frequency, just after theta = 0, and the torque.

    The torque (N m) is unbalanced and acts on theta as the ``drive`` of
    :func:`~gearstab.response.rotating_pair.respond`; 0 without damping and in the rigid kinematic formulation.

    Raises NotPossible where no orbit with one crossing of each change of stiffness a cycle was found.
    """
    problem = problem_of(pair, np.array([[float(mesh_frequency)]]))
    x, found = orbit.solve(problem)
    if not (found & monotone(problem, x)).all():
        raise NotPossible("no periodic orbit of this mean speed was found")
    rate = float(pair.numbers.w0)
    phi, phi_dot, theta_dot, _, drive = (float(value) for value in x[0])
    return Start(theta_dot * rate, phi, phi_dot * rate), drive * float(pair.numbers.k0)
