"""The motion with the damping as printed, in (2) and not in (3), which the program does not offer.

Between jumps of the stiffness the equations are those of the paper with c phi' on the left of (2),

    phi'' + 2 zeta w0 phi' + M2 k phi = M2 T0,        theta'' + 2 zeta w0 (M1/M2) s phi' + M1 k phi = M1 T0,

with s = 0 as printed and s = 1 where damping is a force between the gears, as in the program. They are linear with
constant coefficients, hence integrated by SciPy's matrix exponential, apart from the program; at jumps (9) and (11)
hold.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, tau

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from oh_grosh_barber_2005.energies import K1, K2, SINGLE, TEETH, constants


@dataclass(frozen=True)
class Motion:
    """Times and phi in equal steps; sections: when theta passes 2 pi, 4 pi, ... (s)."""

    time: np.ndarray
    phi: np.ndarray
    sections: np.ndarray


def motion(rpm: float, torque: float, zeta: float, cycles: int, samples: int, s: float) -> Motion:
    """The motion from theta = 0 under the static deflection T0/k1; samples: of a mesh cycle at the first speed."""
    m1, m2, w0 = constants()
    speed = rpm * pi / 30 * TEETH[0]
    step = tau / speed / samples
    state, time, k, bound = np.array([torque / K1, 0.0, 0.0, speed]), 0.0, K1, SINGLE
    times, phis = [0.0], [state[0]]
    sections: list[float] = []
    while len(sections) < cycles:
        rates = _rates(k, torque, m1, m2, 2 * zeta * w0, s)
        grid, found, crossing = _up_to(bound, rates, np.append(state, 1.0), step * len(times) - time, step, 2 * samples)
        if crossing is None:
            break  # turned back, or at rest
        end, state = time + crossing, (expm(crossing * rates) @ np.append(state, 1.0))[:4]
        times += [time + t for t in grid]
        phis += found
        after = K2 if k == K1 else K1
        squared = state[3] ** 2 - m2 * (after - k) * state[0] ** 2
        if squared <= 0:
            break
        change = np.sqrt(squared) - state[3]
        state += [0.0, m1 / m2 * change, 0.0, change]
        if after == K1:
            sections.append(end)
        time, k, bound = end, after, bound + (SINGLE if after == K1 else tau - SINGLE)
    return Motion(np.array(times), np.array(phis), np.array(sections))


def _rates(k: float, torque: float, m1: float, m2: float, c: float, s: float) -> np.ndarray:
    """Return the matrix of d/dt (phi, phi', theta, theta', 1)."""
    rates = np.zeros((5, 5))
    rates[0, 1] = rates[2, 3] = 1
    rates[1, [0, 1, 4]] = -m2 * k, -c, m2 * torque
    rates[3, [0, 1, 4]] = -m1 * k, -s * c * m1 / m2, m1 * torque
    return rates


def _up_to(
    bound: float, rates: np.ndarray, state: np.ndarray, first: float, step: float, most: int
) -> tuple[list[float], list[float], float | None]:
    """Return times from the start and phi in equal steps until theta passes bound, and when; None: in no step."""
    times: list[float] = []
    phis: list[float] = []
    one, at, before = expm(step * rates), expm(first * rates) @ state, 0.0
    for sample in range(most):
        now = first + sample * step
        if at[2] >= bound:
            beyond = brentq(lambda t: (expm(t * rates) @ state)[2] - bound, before, now, xtol=1e-16, rtol=1e-14)
            return times, phis, beyond
        times.append(now)
        phis.append(at[0])
        at, before = one @ at, now
    return times, phis, None
