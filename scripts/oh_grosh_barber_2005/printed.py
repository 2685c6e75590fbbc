"""The motion with the damping as printed, in (2) and not in (3), which the program does not offer.

Between jumps of the stiffness the equations are those of the paper with c phi' on the left of (2),

    phi'' + 2 zeta w0 phi' + M2 k phi = M2 T0,        theta'' + 2 zeta w0 (M1/M2) s phi' + M1 k phi = M1 T0,

with s = 0 as printed and s = 1 where damping is a force between the gears, as in the program. They are integrated
numerically, apart from the program; at jumps (9) and (11) hold.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, tau

import numpy as np
from scipy.integrate import solve_ivp

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
        found = solve_ivp(
            _rates, (time, time + 2 * tau / speed), state, "DOP853", dense_output=True, rtol=1e-10, atol=1e-12,
            events=_at(bound), args=(k, torque, m1, m2, 2 * zeta * w0, s),
        )  # fmt: skip
        if not found.t_events[0].size:
            break  # turned back, or at rest
        end, state = float(found.t_events[0][0]), found.y_events[0][0].copy()
        grid = step * np.arange(len(times), int(end / step) + 1)
        times += list(grid)
        phis += list(found.sol(grid)[0]) if grid.size else []
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


def _rates(_: float, y: np.ndarray, k: float, torque: float, m1: float, m2: float, c: float, s: float) -> list[float]:
    force = torque - k * y[0]
    return [y[1], m2 * force - c * y[1], y[3], m1 * force - s * c * m1 / m2 * y[1]]


def _at(bound: float):  # type: ignore[no-untyped-def]
    def event(t: float, y: np.ndarray, *_: float) -> float:
        return float(y[2] - bound)

    event.terminal, event.direction = True, 1  # type: ignore[attr-defined]
    return event
