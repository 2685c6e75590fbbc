"""Parker (2009): formulas for degenerate modes, other numbers of planets, and what widths depend on."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import xarray as xr

from parker_2009.common import CONTACT_RATIOS, GAMMA_SR, SEQUENTIAL, Gear, gear, pair_label, restricted, table_1
from parker_2009.figures import half_width
from statements import SAME_TO_ROUNDING, Runs, Statement, at_most, numbers, sort_of

Array = np.ndarray

FIRST_ORDER = {"perturbation": {"order": 1, "harmonics": 2}}
SWEEP = {"mesh_frequency": [1.0, 2.0], "epsilon": [0.1]}
DISTINCT, PAIRS = (3, 4, 7, 9), (1, 5)


def coefficient(kind: str, lag: float, harmonic: int) -> complex:
    """b - i a of (7) and (8), per eps = mu: the L-th harmonic of a mesh's stiffness."""
    c = CONTACT_RATIOS[kind]
    return 2 / (harmonic * np.pi) * np.sin(harmonic * np.pi * c) * np.exp(-1j * harmonic * np.pi * (c + 2 * lag))


def coupling(found: Gear, p: int, q: int, phases: list[float], harmonic: int) -> complex:
    """D_pq + i E_pq of (24) and (25), but for a factor of modulus 1."""
    return sum(
        found.sun[p - 1, n] * found.sun[q - 1, n] * coefficient("sun", lag, harmonic)
        + found.ring[p - 1, n] * found.ring[q - 1, n] * coefficient("ring", lag + GAMMA_SR, harmonic)
        for n, lag in enumerate(phases)
    )


def distinct_degenerate(runs: Runs) -> Iterator[Statement]:
    found = gear(table_1(runs))
    tree = restricted(runs, found, list(range(1, 10)), SEQUENTIAL, SWEEP, FIRST_ORDER)
    worst, count = 0.0, 0
    for p in DISTINCT:
        for q in PAIRS:
            for s in (1, 2):
                ours = half_width(tree, pair_label(min(p, q), max(p, q), s))
                squares = sum(abs(coupling(found, p, k, SEQUENTIAL, s)) ** 2 for k in (q, q + 1))
                printed = np.sqrt(squares / (found.frequency[p - 1] * found.frequency[q - 1])) / s
                worst, count = max(worst, abs(printed - ours)), count + (ours > 1e-9)
    yield Statement(
        "(23)",
        "closed form of the widths of a distinct mode with a pair of degenerate ones",
        f"sequential phasing, L = 1, 2, {count} instabilities that exist: {at_most(worst)}",
        worst < 1e-9,
        SAME_TO_ROUNDING,
    )


def five_planets(runs: Runs) -> Iterator[Statement]:
    """(48) to (50), in the basis of each pair in which the second mode does not deflect the first sun mesh."""
    found, tree = of_planets(runs, 5)
    kinds = [p for p in range(1, len(found.frequency)) if found.kinds[p - 1].startswith("planet")]
    first = [p for p in kinds if abs(found.frequency[p - 1] / found.frequency[p] - 1) < 1e-9][:3]
    s, r = (np.sin(np.pi * CONTACT_RATIOS[kind]) for kind in ("sun", "ring"))
    angle = np.pi * (CONTACT_RATIOS["ring"] + 2 * GAMMA_SR - CONTACT_RATIOS["sun"])
    worst = {"(50)": 0.0, "(48)": 0.0}
    for i, p in enumerate(first):
        for q in first[i:]:
            (sp, rp), (sq, rq) = turned(found, p), turned(found, q)
            b5, b6 = sp[0, 0] * sq[0, 0], rp[0, 0] * rq[0, 0] + rp[1, 0] * rq[1, 0]
            b7 = rp[0, 0] * rq[1, 0] - rp[1, 0] * rq[0, 0]
            plain = b5**2 * s**2 + (b6**2 + b7**2) * r**2 + 2 * b5 * b6 * s * r * np.cos(angle)
            square = plain + abs(2 * b5 * b7 * s * r * np.sin(angle))
            printed = 5 / np.pi * np.sqrt(square / (found.frequency[p - 1] * found.frequency[q - 1]))
            place = "(50)" if p == q else "(48)"
            worst[place] = max(worst[place], abs(printed / half_width(tree, pair_label(p, q, 1)) - 1))
    for place, claim in (("(48), (49)", "two pairs of degenerate planet modes"), ("(50)", "a single pair of them")):
        yield Statement(
            place,
            f"closed form of the widths of {claim}",
            f"N = 5, omega_{', omega_'.join(map(str, first))}: {at_most(worst[place[:4]])}",
            worst[place[:4]] < 1e-8,
            "equal to 1e-8",
            "In the basis in which the second mode of a pair does not deflect the first sun mesh; no other will do.",
        )


def turned(found: Gear, p: int) -> tuple[Array, Array]:
    """Mesh deflections ``(2, N)`` of a pair, turned so that the second mode does not deflect the first sun mesh."""
    sun, ring = found.sun[p - 1 : p + 1], found.ring[p - 1 : p + 1]
    size = np.hypot(sun[0, 0], sun[1, 0])
    c, s = sun[0, 0] / size, sun[1, 0] / size
    turn = np.array([[c, s], [-s, c]])
    sun, ring = turn @ sun, turn @ ring
    # Pairs are oriented alike: the second mode a quarter of a wave behind the first.
    flip = np.array([[1.0], [np.sign(sun[1, 1])]])
    return sun * flip, ring * flip


def of_planets(runs: Runs, planets: int) -> tuple[Gear, xr.DataTree]:
    """The modes and first-order tongues of the gear with so many planets in phase, eight harmonics of the ring."""
    tree = runs.sweep(
        "parker_2009/table1",
        planets=planets,
        phases={"sun": [0.0] * planets, "sun_ring": GAMMA_SR},
        ring={"kind": "elastic", "harmonics": 8, "bending_stiffness": 5.0e7},
        sweep=SWEEP,
        methods=FIRST_ORDER,
    )
    return gear(tree), tree


def what_widths_depend_on(runs: Runs) -> Iterator[Statement]:
    """Below (39), for the two rotational modes with the lowest frequencies that are not zero."""
    sizes, times = {}, {}
    for planets in (3, 4, 5, 6):
        found, tree = of_planets(runs, planets)
        mode = [p for p, kind in enumerate(found.kinds, 1) if kind == "rotational"][1]
        sizes[planets] = half_width(tree, pair_label(mode, mode, 1))
        times[planets] = 4 * half_width(tree, pair_label(mode, mode, 2)) / sizes[planets]
    ratio = sizes[6] / sizes[3]
    yield Statement(
        "Below (39)",
        "the width for two distinct modes is proportional to the number of planets N and inversely to L^2",
        f"second rotational mode alone: half-width/eps for N = 3, 4, 5, 6: {numbers(list(sizes.values()))}; L^2 times "
        f"that of L = 2 over that of L = 1: {numbers(list(times.values()))}",
        sort_of(
            abs(ratio - 2) < 0.1 and max(abs(t - 1) for t in times.values()) < 0.1,
            list(sizes.values()) == sorted(sizes.values()) and all(0.5 < t < 2 for t in times.values()),
        ),
        "within 10 % of proportional; in part: rises with N, L^2 within a factor of 2",
        "As factors of (38); but the mesh deflections of normalised modes fall as N rises, and sin L pi c depends on "
        "L.",
    )


STATEMENTS: list[Callable[[Runs], Iterator[Statement]]] = [distinct_degenerate, five_planets, what_widths_depend_on]
