"""Parker (2009): the operators of the appendix and the identities, as printed and as they must be.

The gear of Table 1 is built here from the printed operators, apart from the program, by Galerkin's method: v is a sum
of cos m theta and sin m theta for m = 2 to 20. Each error in print is then put in alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
from scipy.linalg import eig

from parker_2009.common import DIGITS, PRINTED, Gear, gear, restricted, table_1
from parker_2009.degenerate import coupling
from parker_2009.figures import half_width, in_phase_first_order, oriented
from statements import EVERY, SAME_TO_ROUNDING, Runs, Statement, at_most, number, numbers, sort_of

Array = np.ndarray

PLANETS, ALPHA, HIGHEST = 4, np.deg2rad(24.6), 20
MASSES = {"c": 5.43 / 6.35, "s": 0.4 / 6.35, "p": 4 / 6.35}
INERTIAS = {"c": 6 / 6.35, "s": 2.5 / 6.35, "p": 2 / 6.35}
SUPPORT, CARRIER_TURNS, BENDING = 5e3, 1e3, 0.5
"""Over k_rp = 1e8 N/m; k_cu as inferred from the frequencies."""
ORDERS = np.arange(2, HIGHEST + 1)
RING = 2 * len(ORDERS)
ROUNDS = "all nine round to those of Table 1"


def ring_functions(angle: float, derivative: int) -> Array:
    """A derivative of cos m theta and sin m theta at an angle, ``(RING,)``."""
    turned = ORDERS * angle + 0.5 * np.pi * derivative
    return np.concatenate([np.cos(turned), np.sin(turned)]) * np.tile(ORDERS**derivative, 2)


def columns(body: int) -> slice:
    """The coordinates of ring, carrier, sun and planets in the rigid part, behind those of v."""
    return slice(RING + 3 * body, RING + 3 * body + 3)


def deflections(n: int) -> tuple[Array, Array, Array]:
    """(26) and (27) of planet n (from 0) as rows; the last one without v."""
    psi = 2 * np.pi * n / PLANETS
    s, c = np.sin(ALPHA), np.cos(ALPHA)
    sun, rigid = np.zeros(RING + 9 + 3 * PLANETS), np.zeros(RING + 9 + 3 * PLANETS)
    sun[columns(2)] = -np.sin(psi - ALPHA), np.cos(psi - ALPHA), 1
    sun[columns(3 + n)] = -s, -c, 1
    rigid[columns(0)] = -np.sin(psi + ALPHA), np.cos(psi + ALPHA), 1
    rigid[columns(3 + n)] = s, -c, -1
    whole = rigid.copy()
    whole[:RING] = c * ring_functions(psi, 0) + s * ring_functions(psi, 1)
    return sun, whole, rigid


def second_operator(n: int) -> Array:
    """L2 at planet n as printed, read as a product of operators: d/dtheta acts on all that follows, delta and v."""
    s, c = np.sin(ALPHA), np.cos(ALPHA)
    f, f1, f2 = (ring_functions(2 * np.pi * n / PLANETS, k) for k in range(3))
    first = s**2 * np.outer(f2, f) - c**2 * np.outer(f, f)
    turned, turned1 = c * f - s * f1, c * f1 - s * f2
    return -first + s * (np.outer(turned1, f) + np.outer(turned, f1))


def carrier(n: int) -> Array:
    """K_c1, K_c2 and K_c3 over k_pn, of carrier and planet, ``(6, 6)``."""
    s, c = np.sin(2 * np.pi * n / PLANETS), np.cos(2 * np.pi * n / PLANETS)
    own = np.array([[1, 0, -s], [0, 1, c], [-s, c, 1]])
    other = np.array([[-c, s, 0], [-s, -c, 0], [0, -1, 0]])
    return np.block([[own, other], [other.T, np.diag([1, 1, 0])]])


@cache
def modes(second: bool = False, fourth: bool = False, radius: float = 1.0) -> tuple[Array, Array]:
    """Natural frequencies in order, and modes; second, fourth: with L2, L4 as printed; radius: r_j/R in M_j."""
    size = RING + 9 + 3 * PLANETS
    mass, stiffness = np.zeros(size), np.zeros((size, size))
    mass[:RING] = np.tile((1 + ORDERS**2) / 2, 2)
    stiffness[range(RING), range(RING)] = np.tile(np.pi * BENDING * ORDERS**2 * (ORDERS**2 - 1) ** 2, 2)
    mass[columns(0)] = 1, 1, 1 / np.cos(ALPHA) ** 2
    for body, name in enumerate(["c", "s", *"p" * PLANETS], start=1):
        mass[columns(body)] = MASSES[name], MASSES[name], INERTIAS[name] / radius**2
    for body, turning in ((1, CARRIER_TURNS), (2, SUPPORT)):
        stiffness[columns(body), columns(body)] += np.diag([SUPPORT, SUPPORT, turning])
    for n in range(PLANETS):
        sun, whole, rigid = deflections(n)
        stiffness += np.outer(sun, sun) + np.outer(whole, whole)
        if second:
            stiffness[:RING, :RING] += second_operator(n) - np.outer(whole[:RING], whole[:RING])
        if fourth:
            # b_r before the sum: that of the first planet.
            stiffness[columns(0), :RING] += np.outer((deflections(0)[2] - rigid)[columns(0)], whole[:RING])
        at = np.r_[columns(1), columns(3 + n)]
        stiffness[np.ix_(at, at)] += SUPPORT * carrier(n)
    squares, shapes = eig(stiffness, np.diag(mass))
    order = np.argsort(np.abs(squares))
    return np.sqrt(squares[order]), shapes[:, order]


def right(frequencies: Array) -> int:
    """How many of the first nine round to those of Table 1."""
    near = zip(frequencies[:9], DIGITS, PRINTED, strict=True)
    return sum(abs(w.imag) < 1e-6 and round(float(w.real), d) == p for w, d, p in near)


def operators(runs: Runs) -> Iterator[Statement]:
    plain = modes()[0]
    table = gear(table_1(runs)).frequency[:9]
    cases = [
        ("Appendix, L2", "derivatives stand before delta(theta - psi_n)", modes(second=True)[0],
         "Right where the derivatives act on v alone: <v, L2 v> is the sum of (v cos alpha_r + v' sin alpha_r)^2."),
        ("Appendix, L4", "b_r stands before the sum over the planets", modes(fourth=True)[0],
         "b_r has psi_rn: it depends on n and belongs into the sum. Here b_r of the first planet."),
        ("Appendix, M_j", "I_j/r_j^2, where (3) has I_j over m_r r_j^2 already", modes(radius=0.5)[0],
         "Here with r_j = R/2; the paper prints no r_j."),
    ]  # fmt: skip
    for place, claim, found, why in cases:
        count = right(found)
        yield Statement(
            place, claim,
            f"of the nine frequencies {count} round to those of Table 1: {numbers(np.abs(found[:9]), 4)}; put "
            f"right {right(plain)}, "
            f"{at_most(np.abs(plain[:9] / table - 1).max(), '1e-8')} as the program's",
            count == 9, ROUNDS, why,
        )  # fmt: skip
    levels = [1 + 2 * 0.1 * 0.4, 1 - 2 * 0.1 * 0.6]
    counts = [right(plain * np.sqrt(1 / level)) for level in levels]
    yield Statement(
        "(2)", "T = sqrt(m_r/k_rn)",
        f"k_rn of (5) is {numbers(levels)} k_rp in turn for eps = 0.1: of the nine frequencies in units of 1/T "
        f"{counts[0]}, {counts[1]} round to those of Table 1; with k_rp {right(plain)}",
        min(counts) == 9, ROUNDS, "Stiffnesses are made dimensionless by k_rp, and so must be T.",
    )  # fmt: skip


def rotational_deflection(runs: Runs) -> Iterator[Statement]:
    """(33) against (27), for the rotational modes."""
    shapes = modes()[1]
    c, s = np.cos(ALPHA), np.sin(ALPHA)
    whole = deflections(0)[1]
    off = {"printed": 0.0, "right": 0.0}
    for p in (2, 6):
        shape = np.real(shapes[:, p])
        exact = whole[:RING] @ shape[:RING]
        m = np.arange(1, HIGHEST // PLANETS + 1)
        amplitude = shape[m * PLANETS - 2] / (2 * c)  # V_m of (30): 2 V_m cos alpha_r stands before cos mN theta
        for name, order in (("printed", m), ("right", m * PLANETS)):
            off[name] = max(off[name], abs(2 * amplitude @ (c**2 + order**2 * s**2) / exact - 1))
    yield Statement(
        "(33)", "part of v: sum over l of 2 U_m (cos^2 alpha_r + m^2 sin^2 alpha_r)",
        f"omega_{3} and omega_{7}, with V_m of (30) for U_m and l = m, against (27): {at_most(off['printed'])}; with "
        f"(mN)^2 for m^2: {at_most(off['right'], '1e-8')}",
        off["printed"] < 1e-8, "equal to 1e-8", "U_m is V_m, l is m, and its harmonic is the mN-th.",
    )  # fmt: skip


def detuning(runs: Runs) -> Iterator[Statement]:
    """(19) on both sides of 2w4."""
    found, epsilon = gear(table_1(runs)), 0.01
    half = half_width(in_phase_first_order(runs, found), "2w4") * epsilon
    sides = [-2, -0.5, 0.5, 2]
    sweep = {"mesh_frequency": [float(2 * found.frequency[3] + x * half) for x in sides], "epsilon": [epsilon]}
    tree = restricted(runs, found, [4, 9], [0.0] * PLANETS, sweep, {"floquet": {}})
    rates = tree["floquet/growth_rate"].to_numpy().ravel()
    bounded = [bool(rate == 0) for rate in rates]
    yield Statement(
        "(19)", "bounded only when sigma >= sqrt(Lambda/(w_p w_q))",
        f"growth rate by Floquet theory at 2w4 for sigma = {numbers(sides)} times that root: {numbers(rates)}; bounded "
        f"by (19): {', '.join('yes' if x >= 1 else 'no' for x in sides)}",
        bounded == [x >= 1 for x in sides], EVERY, "It must be the modulus of sigma, as (21) has it.",
    )  # fmt: skip


def signs(runs: Runs) -> Iterator[Statement]:
    found, n = gear(table_1(runs)), np.arange(1, PLANETS + 1)
    rows = np.array([d[p] / d[p, 0] for p in (3, 8) for d in (found.sun, found.ring)])
    off = [np.abs(rows - (-1.0) ** power).max() for power in (n, n - 1)]
    yield Statement(
        "(39)", "distinct planet modes: delta_n = (-1)^n delta_1",
        f"omega_4 and omega_9, delta_n/delta_1 = {numbers(rows[0])}: {at_most(off[0])}; with (-1)^(n-1): "
        f"{at_most(off[1], '1e-8')}",
        bool(off[0] < 1e-8), "equal to 1e-8", "(39) gives delta_1 = -delta_1. (38) has products, and stays right.",
    )  # fmt: skip


def sums(runs: Runs) -> Iterator[Statement]:
    """(36) and (37)."""
    found, angles = gear(table_1(runs)), 2 * np.pi * np.arange(PLANETS) / PLANETS
    kinds = {p: found.nature[p] for p in range(9)}
    scale, off, vanishing = np.abs(found.sun[:9]).max() ** 2, 0.0, 0.0
    basis = {t: np.array([np.cos(t * angles), np.sin(t * angles)]) for t in range(PLANETS // 2 + 1)}
    for p, q in product(kinds, repeat=2):
        a, b = kinds[p], kinds[q]
        if a is None or b is None:
            continue
        total = found.sun[p] @ found.sun[q]
        parts = [found.sun[k] @ np.linalg.pinv(basis[t]) for k, t in ((p, a), (q, b))]
        off = max(off, abs(total - parts[0] @ (basis[a] @ basis[b].T) @ parts[1]) / scale)
        vanishing = max(vanishing, abs(total) / scale if a != b else 0.0)
    yield Statement(
        "(36)", "the sum of products of mesh deflections, with (29)",
        f"sun meshes, all pairs of the nine modes: {at_most(off, '1e-8')}; for T_p != T_q beside the largest: "
        f"{number(vanishing if vanishing > 1e-8 else 0)}",
        max(off, vanishing) < 1e-8, "equal to 1e-8", "Printed without the sign of the product, in two lines.",
    )  # fmt: skip
    off, equivalent = 0.0, True
    for planets in range(3, 9):
        angle = 2 * np.pi * np.arange(planets) / planets
        for a, b in product(range(planets // 2 + 1), repeat=2):
            holds = (a - b) % planets != 0 and (a + b) % planets != 0
            equivalent &= holds == (a != b)
            rows = [f(a * angle) @ g(b * angle) for f, g in product((np.sin, np.cos), repeat=2)]
            off = max(off, np.abs(rows).max()) if holds else off
    yield Statement(
        "(37)", "the sums of sines and cosines vanish for T_p +- T_q != lN, which is T_p != T_q",
        f"N = 3 to 8: {at_most(off)}; the two conditions are {'' if equivalent else 'not '}the same",
        off < 1e-9 and equivalent, SAME_TO_ROUNDING, 'The text calls it "(62)"; the last equation is (50).',
    )  # fmt: skip


def pairs(runs: Runs) -> Iterator[Statement]:
    """(40) and (41), for the translational pairs, also each with itself."""
    found = gear(table_1(runs))
    alike = found
    for p in (1, 5):
        sun, ring = (rows.copy() for rows in (alike.sun, alike.ring))
        sun[p - 1 : p + 1], ring[p - 1 : p + 1] = oriented(found, p)
        alike = replace(alike, sun=sun, ring=ring)
    turned = replace(alike, sun=alike.sun.copy(), ring=alike.ring.copy())
    turned.sun[5], turned.ring[5] = -turned.sun[5], -turned.ring[5]
    identities: tuple[tuple[str, Callable[[Gear, int, int], complex]], ...] = (
        ("(40)", lambda g, p, q: g.sun[p - 1] @ g.sun[q - 1] + 1j * (g.ring[p - 1] @ g.ring[q - 1])),
        ("(41)", lambda g, p, q: coupling(g, p, q, [0.0] * PLANETS, 1)),
    )
    claims = {"(40)": "sums over pairs of degenerate modes", "(41)": "D_pr = D_qm, D_pm = -D_qr, and so E"}
    for place, product_of in identities:
        off = []
        for g in (alike, turned):
            both = [(product_of(g, p, r), product_of(g, p + 1, r + 1), product_of(g, p, r + 1), product_of(g, p + 1, r))
                    for p, r in ((1, 1), (5, 5), (1, 5))]  # fmt: skip
            largest = max(abs(x) for row in both for x in row)
            off.append(max(max(abs(a - b), abs(c + d)) for a, b, c, d in both) / largest)
        yield Statement(
            place, claims[place],
            f"translational modes, pairs oriented alike: {at_most(off[0], '1e-8')}; with one mode reversed: "
            f"{at_most(off[1], '1e-8')}",
            sort_of(max(off) < 1e-8, off[0] < 1e-8), "equal to 1e-8, however modes are signed; in part: in one way",
            "The second mode of each pair must be a quarter of a wave behind the first, which the paper does not say.",
        )  # fmt: skip


STATEMENTS: list[Callable[[Runs], Iterator[Statement]]] = [
    operators, detuning, rotational_deflection, signs, sums, pairs,
]  # fmt: skip
