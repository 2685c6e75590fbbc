"""Lin & Parker (2002), (1) to (14): the equations of motion and the first order, as printed and as they must be.

All is computed from the matrices (2) apart from the program, with the coefficients (4) of three harmonics, for the
parameters of Table 1 and c1 = 1.3, c2 = 1.6, h = 0.2, where no coefficient vanishes. Differences
are relative to the largest value.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy.integrate import solve_ivp
from scipy.linalg import eigh

from lin_parker_2002.common import BOTH, PRIMARY, RANGE
from statements import SAME_TO_ROUNDING, Runs, Statement, at_most, edges, number, numbers, width

RATIOS, PHASING = (1.3, 1.6), 0.2
MASS = np.diag([1.0, 0.3, 4.0])
FIRST, SECOND = np.zeros((3, 3)), np.zeros((3, 3))
FIRST[:2, :2], SECOND[1:, 1:] = 1.0, 1.0
MEAN = FIRST + SECOND + np.diag([0.5, 0.0, 0.0])
SMALL = 1e-3
"""epsilon of the Floquet numbers: first order is right to about this much."""
HARMONICS = np.arange(1, 4)
CLOSE = 1.0
"""Per cent of difference from Floquet theory up to which a first-order number agrees: ten times epsilon."""


@dataclass(frozen=True)
class Coupling:
    """D, E, F, G of (7), each ``(harmonic, 3, 3)``, and the natural frequencies of (5)."""

    frequency: np.ndarray
    modes: np.ndarray
    d: np.ndarray
    e: np.ndarray
    f: np.ndarray
    g: np.ndarray

    def at(self, angle: float) -> np.ndarray:
        """The sum over s of D sin + E cos + F sin + G cos at an angle Omega t, ``(3, 3)``."""
        s, c = np.sin(HARMONICS * angle), np.cos(HARMONICS * angle)
        return np.tensordot(s, self.d + self.f, 1) + np.tensordot(c, self.e + self.g, 1)

    def primary(self) -> np.ndarray:
        """Half-widths per epsilon at 2w1, 2w2, 2w3 by (18)."""
        x, y = (np.diagonal(m[0]) for m in (self.d + self.f, self.e + self.g))
        return np.hypot(x, y) / self.frequency


def coefficients(c: float, p: float) -> tuple[np.ndarray, np.ndarray]:
    """a and b of (4)."""
    size = -2 / (HARMONICS * np.pi) * np.sin(HARMONICS * np.pi * c)
    angle = HARMONICS * np.pi * (c - 2 * p)
    return size * np.sin(angle), size * np.cos(angle)


def coupling(as_printed: bool = False) -> Coupling:
    """(5) and (7); as printed D and F carry the first mesh's block, E and G the second one's."""
    squares, modes = eigh(MEAN, MASS)
    first, second = (modes.T @ block @ modes for block in (FIRST, SECOND))
    (a1, b1), (a2, b2) = coefficients(RATIOS[0], 0.0), coefficients(RATIOS[1], PHASING)
    blocks = (first, second, first, second) if as_printed else (first, first, second, second)
    parts = [np.multiply.outer(c, block) for c, block in zip((a1, b1, a2, b2), blocks, strict=True)]
    return Coupling(np.sqrt(squares), modes, *parts)


def floquet(runs: Runs) -> xr.DataTree:
    """Exact regions for epsilon = SMALL."""
    return runs.sweep(
        "lin_parker_2002/fig3",
        sweep={"mesh_frequency": RANGE, "epsilon": [SMALL], "phasing": [PHASING]},
        methods=BOTH,
        meshes__0__contact_ratio=RATIOS[0],
        meshes__1__contact_ratio=RATIOS[1],
    )


def inertias(runs: Runs) -> Iterator[Statement]:
    """The equivalent masses of four gears, against the eigenvalues in the angles of the gears."""
    inertia, radii, stiffness, v = np.array([1.0, 0.3, 4.0]), np.array([1.0, 1.2, 0.7]), np.array([0.5, 1.0, 1.0]), 0.6
    arms = np.array([[1, 0, 0], [radii[0], radii[1], 0], [0, v * radii[1], radii[2]]])
    exact = eigh(arms.T @ np.diag(stiffness) @ arms, np.diag(inertia), eigvals_only=True)
    k = np.diag([stiffness[0] / radii[0] ** 2, 0, 0]) + stiffness[1] * FIRST + v**2 * stiffness[2] * SECOND
    found = {}
    for power in (1, 2):
        masses = inertia / radii**2 * [1, 1, v**power]
        found[power] = np.abs(np.sqrt(eigh(k, np.diag(masses), eigvals_only=True) / exact) - 1).max()
    yield Statement(
        "2", "equivalent mass m_3 = v I_3/r_3^2 of four gears, v = r_4/r_2",
        f"natural frequencies for v = {v}, against those in the angles of the gears: {at_most(found[1])}; with v^2: "
        f"{at_most(found[2])}",
        bool(found[1] < 1e-9), SAME_TO_ROUNDING,
        "x_3 = theta_3 r_3/v asks for v^2, as in k_2 = v^2 k_L2. With three gears v = 1.",
    )  # fmt: skip


def period(runs: Runs) -> Iterator[Statement]:
    omega, time = 4.2, np.linspace(0, 3, 50)
    a, b = coefficients(RATIOS[0], 0.0)

    def wave(t: np.ndarray) -> np.ndarray:
        angles = np.multiply.outer(t, HARMONICS) * omega
        return np.sin(angles) @ a + np.cos(angles) @ b

    off = [np.abs(wave(time + T) - wave(time)).max() / np.abs(wave(time)).max() for T in (omega / (2 * np.pi),
           2 * np.pi / omega)]  # fmt: skip
    yield Statement(
        "2, above (4)", "periods T_i = Omega_i/2 pi",
        f"(3) at Omega = {omega} after Omega/2 pi: {at_most(off[0])}; after 2 pi/Omega: {at_most(off[1])}",
        bool(off[0] < 1e-9), SAME_TO_ROUNDING, "The reciprocal is printed.",
    )  # fmt: skip


def modal_equations(runs: Runs) -> Iterator[Statement]:
    right, printed = coupling(), coupling(as_printed=True)
    rng = np.random.default_rng(1)
    u, angle, epsilon = rng.standard_normal(3), 1.7, 0.3
    variation = sum(
        2 * epsilon * (np.sin(HARMONICS * angle) @ a + np.cos(HARMONICS * angle) @ b) * block
        for (a, b), block in zip((coefficients(RATIOS[0], 0.0), coefficients(RATIOS[1], PHASING)), (FIRST, SECOND),
                                 strict=True)
    )  # fmt: skip
    exact = right.modes.T @ (MEAN + variation) @ right.modes @ u
    off = [np.abs(m.frequency**2 * u + 2 * epsilon * m.at(angle) @ u - exact).max() / np.abs(exact).max()
           for m in (right, printed)]  # fmt: skip
    yield Statement(
        "3, (5), (6)", "modes and equations in modal coordinates",
        f"(6) against Phi^T (1), with the blocks of (7) put right: {at_most(off[0])}",
        bool(off[0] < 1e-9), SAME_TO_ROUNDING,
    )  # fmt: skip
    exact_widths = [float(width(edges(floquet(runs), label)).squeeze()) / (2 * SMALL) for label in PRIMARY]
    mine, theirs = right.primary(), printed.primary()
    worst = [100 * np.abs(values / exact_widths - 1).max() for values in (theirs, mine)]
    yield Statement(
        "3, (7)", "D and F with the block of coordinates 1 and 2, E and G with that of 2 and 3",
        f"half-widths/eps at {', '.join(PRIMARY)} by (18): {numbers(theirs, 4)}; with D and E in the block of mesh 1, "
        f"F and G in that of mesh 2: {numbers(mine, 4)}; Floquet theory at eps = {SMALL}: {numbers(exact_widths, 4)}; "
        f"largest differences {numbers(worst, 2)} %; (6) as printed: {at_most(off[1])}",
        bool(worst[0] < CLOSE), f"half-widths within {CLOSE:g} % of Floquet theory",
        "D and E belong to mesh 1, F and G to mesh 2; (19) has it right.",
    )  # fmt: skip


def expansion_error(terms: Coupling, epsilon: float, first: bool) -> float:
    """Largest error over epsilon of u0 + epsilon u1 until t = 20; first: u1 by (10) with u_r0, else with u_r1."""
    omega, start = 4.5, np.array([1.0, -0.5, 0.3])

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        """Rates of u, u0 and u1 with their velocities."""
        x, v = y.reshape(2, 3, 3)
        m = terms.at(omega * t)
        force = np.array([-2 * epsilon * m @ x[0], np.zeros(3), -2 * m @ (x[1] if first else x[2])])
        return np.concatenate([v.ravel(), (force - terms.frequency**2 * x).ravel()])

    initial = np.concatenate([np.array([start, start, np.zeros(3)]).ravel(), np.zeros(9)])
    x = solve_ivp(rates, (0, 20), initial, method="DOP853", rtol=1e-11, atol=1e-12).y[:9].reshape(3, 3, -1)
    return float(np.abs(x[0] - x[1] - epsilon * x[2]).max() / epsilon)


def first_order(runs: Runs) -> Iterator[Statement]:
    terms = coupling()
    steps = (0.01, 0.001)
    printed, right = ([expansion_error(terms, e, first) for e in steps] for first in (False, True))
    tree = runs.sweep(
        "lin_parker_2002/fig3",
        sweep={"mesh_frequency": [float(2 * terms.frequency[2])], "epsilon": [SMALL], "phasing": [PHASING]},
        methods={"floquet": {}},
        meshes__0__contact_ratio=RATIOS[0],
        meshes__1__contact_ratio=RATIOS[1],
    )
    exact = float(tree["floquet"]["growth_rate"].squeeze()) / SMALL
    modulus = terms.primary()[2] * terms.frequency[2]
    rates = [modulus / 2, modulus / (2 * terms.frequency[2])]
    yield Statement(
        "3, (8) to (11)", "in (10) u_r1 stands behind the stiffness terms",
        f"error of u0 + eps u1 over eps at Omega = 4.5 for eps = {numbers(steps)}: {numbers(printed, 2)}; with u_r0: "
        f"{numbers(right, 2)}",
        bool(printed[1] < 0.2 * printed[0]), "the error falls with eps", "(12) has u_r0.",
    )  # fmt: skip
    yield Statement(
        "3, (10)", "its first term is -2 du_n0/dtau",
        f"growth rate/eps at 2w3: {number(rates[0], 4)}; with -2 d^2 u_n0/dt dtau {number(rates[1], 4)}; Floquet "
        f"theory at eps = {SMALL}: {number(exact, 4)}",
        bool(100 * abs(rates[0] / exact - 1) < CLOSE), f"within {CLOSE:g} % of Floquet theory",
        "(12) has the derivative, i w_n.",
    )  # fmt: skip


def expanded(runs: Runs) -> Iterator[Statement]:
    """(12) against the right side of (10), the terms of the stiffness."""
    terms, omega = coupling(), 3.1
    amplitude, w = np.array([0.4 - 0.3j, 0.2 + 0.7j, -0.5 + 0.1j]), terms.frequency
    time = np.linspace(0, 7, 40)

    def side(t: float, exchanged: bool, own: bool) -> np.ndarray:
        """As (12) prints it; exchanged: D, F for E, G; own: the frequency of A_r in the exponents, not w_n."""
        d, e = terms.d + terms.f, terms.e + terms.g
        if exchanged:
            d, e = e, d
        base = w[None, :] if own else w[:, None]
        total = np.zeros((3, 3), complex)
        for s, x, y in zip(HARMONICS, d, e, strict=True):
            up, down = (np.exp(1j * (base + sign * s * omega) * t) for sign in (1, -1))
            total += x * (up + down) - 1j * y * (up - down)
        return 2 * np.real(-total @ amplitude)

    exact = np.array([-2 * terms.at(omega * t) @ (2 * np.real(amplitude * np.exp(1j * w * t))) for t in time])
    off = [np.abs(np.array([side(t, *which) for t in time]) - exact).max() / np.abs(exact).max()
           for which in ((False, False), (True, False), (True, True))]  # fmt: skip
    yield Statement(
        "3, (12)", "D and F with sums of exponentials, E and G with -i times differences, exponents w_n +- s Omega",
        f"against (10): {at_most(off[0])}; with D, F and E, G exchanged: {at_most(off[1])}; with w_r for w_n, too: "
        f"{at_most(off[2])}",
        bool(off[0] < 1e-9), SAME_TO_ROUNDING,
        "A sine is a difference. So (13) and (14) have D + i E for E - i D: of the same modulus, hence with the same "
        "boundaries.",
    )  # fmt: skip


STATEMENTS: list[Callable[[Runs], Iterator[Statement]]] = [inertias, period, modal_equations, first_order, expanded]
