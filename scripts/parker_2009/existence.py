"""Parker (2009): which instabilities exist."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
import xarray as xr

from parker_2009.common import NONE, SEQUENTIAL, Gear, gear, pair_label, restricted, table_1
from statements import Runs, Statement, number, slope

FIRST_ORDER = {"perturbation": {"order": 1, "harmonics": 4}}
NINE = list(range(1, 10))
BEST, WORST = 0.4, 0.9
"""gamma_sr where c_r + 2 gamma_sr - c_s = 1 and 2, with sin(pi c_s) sin(pi c_r) > 0: the cosine of (38) is -1 and 1."""
NEAR = 0.004
"""Farther from w5-w1 the region at 2w5/3 begins."""
HEADS = [1, 3, 4, 5, 7, 8, 9]
"""One of each natural frequency: the tongues of a degenerate pair go under its first modes."""


def widths(
    runs: Runs, found: Gear, phases: list[float], ratios: Mapping[str, float] | None = None
) -> dict[tuple[int, int, int], float]:
    """First-order half-width per epsilon of each (p, q, L) of the nine modes."""
    sweep = {"mesh_frequency": [1.0, 2.0], "epsilon": [0.1]}
    tree = restricted(runs, found, NINE, phases, sweep, FIRST_ORDER, ratios)
    return {
        (p, q, s): float(slope(tree, pair_label(p, q, s)))
        for s in (1, 2, 3, 4)
        for i, p in enumerate(HEADS)
        for q in HEADS[i:]
    }


def allowed(found: Gear, p: int, q: int, harmonic: int, teeth: int) -> bool:
    """Whether L z_s + (+-T_p +- T_q) is a multiple of N for some choice of the signs."""
    a, b = found.nature[p - 1], found.nature[q - 1]
    if a is None or b is None:
        return False
    return any((harmonic * teeth + x * a + y * b) % found.planets == 0 for x in (1, -1) for y in (1, -1))


def mismatches(found: Gear, computed: Mapping[tuple[int, int, int], float], teeth: int) -> list[str]:
    """The tongues that contradict the rule."""
    return [
        pair_label(*tongue) for tongue, width in computed.items() if (width > NONE) != allowed(found, *tongue, teeth)
    ]


def verdict(wrong: Sequence[str], count: int) -> str:
    """How many tongues were looked at, and which of them contradict."""
    return f"{count} tongues of the nine modes, L = 1 to 4; contradicting: {', '.join(wrong) or 'none'}"


def rules(runs: Runs) -> Iterator[Statement]:
    found = gear(table_1(runs))
    in_phase = widths(runs, found, [0.0] * 4)
    wrong = mismatches(found, in_phase, 0)
    yield Statement(
        "In-phase meshes",
        "combination instabilities exist for T_p = T_q and vanish for T_p != T_q, whatever L",
        verdict(wrong, len(in_phase)),
        not wrong,
        "none contradicts",
    )
    mixed = [(p, q) for p in (1, 5) for q in (3, 4, 7, 9)]
    largest = max(in_phase[min(p, q), max(p, q), s] for p, q in mixed for s in (1, 2, 3, 4))
    yield Statement(
        "In-phase meshes, case 2",
        "all distinct-degenerate instabilities vanish",
        f"largest half-width/eps of the translational modes with omega_3, omega_4, omega_7, omega_9: {number(largest)}",
        largest < NONE,
        "0 to rounding",
    )
    for teeth, phases in ((1, SEQUENTIAL), (2, [0.0, 0.5, 0.0, 0.5]), (3, [0.0, 0.75, 0.5, 0.25])):
        computed = widths(runs, found, phases)
        wrong = mismatches(found, computed, teeth)
        yield Statement(
            "Conclusion 2",
            f"instabilities exist only where L z_s + (+-T_p +- T_q) is a multiple of N: z_s mod 4 = {teeth}",
            verdict(wrong, len(computed)),
            not wrong,
            "none contradicts",
            "" if teeth == 1 else f"gamma_sn = {', '.join(f'{g:g}' for g in phases)}.",
        )
    ring = max(width for (p, q, _), width in in_phase.items() if 8 in (p, q))
    yield Statement(
        "Modal properties",
        "instabilities of purely ring modes always vanish",
        f"largest half-width/eps of a tongue with omega_8: {number(ring)}",
        ring < NONE,
        "0 to rounding",
    )


def integer_contact_ratios(runs: Runs) -> Iterator[Statement]:
    found = gear(table_1(runs))
    sizes = {}
    for name, ratio in (("L = 1, 2, 3, 4 for c = 2", 2.0), ("L = 2, 4 for c = 1.5", 1.5)):
        computed = widths(runs, found, [0.0] * 4, {"sun": ratio, "ring": ratio})
        sizes[name] = max(w for (_, _, s), w in computed.items() if float(s * ratio).is_integer())
    yield Statement(
        "Below (39)",
        "when L c_s and L c_r are integers all instabilities of the L-th harmonic vanish",
        "largest half-width/eps: " + "; ".join(f"{name}: {number(size)}" for name, size in sizes.items()),
        max(sizes.values()) < NONE,
        "0 to rounding",
    )


def no_difference_type(runs: Runs) -> Iterator[Statement]:
    found = gear(table_1(runs))
    pairs = {"w7-w3": ([3, 7], 3, 7), "w9-w4": ([4, 9], 4, 9), "w5-w1": ([1, 2, 5, 6], 1, 5)}
    grown = {}
    for name, (modes, p, q) in pairs.items():
        centre = float(found.frequency[q - 1] - found.frequency[p - 1])
        sweep = {"mesh_frequency": {"start": centre - NEAR, "stop": centre + NEAR, "num": 21}, "epsilon": [0.01]}
        tree = restricted(runs, found, modes, [0.0] * 4, sweep, {"floquet": {}})
        grown[name] = float(tree["floquet"]["growth_rate"].max())
    yield Statement(
        "Below (16)",
        "difference-type instabilities are not possible",
        f"largest growth rate by Floquet theory at eps = 0.01 within {NEAR} of "
        + ", ".join(f"{name}: {number(rate)}" for name, rate in grown.items()),
        max(grown.values()) == 0,
        "no growth",
    )


def minima(runs: Runs) -> Iterator[Statement]:
    """(38) and (47): the best phase between sun and ring meshes."""
    tree = runs.sweep("parker_2009/gamma_sr", sweep={
        "phases.sun_ring": np.linspace(0, 0.95, 20).round(2).tolist(),
        "mesh_frequency": [1.0, 2.0], "epsilon": [0.1],
    })  # fmt: skip
    found = gear(tree)
    sense = [float((found.sun[p - 1] * found.ring[p - 1]).sum()) for p in NINE]

    def best(label: str) -> tuple[float, float]:
        width: xr.DataArray = slope(tree, label)
        return float(width["phases.sun_ring"][int(width.values.argmin())]), float(width.min() / width.max())

    single = {p: best(f"2w{p}") for p in (1, 3, 4, 5, 7, 9)}
    both = {f"w{p}+w{q}": (best(f"w{p}+w{q}"), sense[p - 1] * sense[q - 1] > 0) for p, q in ((3, 7), (4, 9))}
    combined = {label: part for label, ((_, part), _) in both.items()} | {"w1+w5": best("w1+w5")[1]}
    yield Statement(
        "(38), (47)",
        "a minimum is reached by adjusting gamma_sr so that the third term is negative",
        "gamma_sr with the smallest region (step 0.05) at 2w1, 2w3, 2w4, 2w5, 2w7, 2w9: "
        + ", ".join(f"{gamma:g}" for gamma, _ in single.values())
        + "; smallest over largest width: " + ", ".join(number(part, 2) for _, part in single.values()),
        all(abs(gamma - BEST) < 1e-9 for gamma, _ in single.values()),
        f"all are {BEST}, where the cosine is -1",
        "There c_r + 2 gamma_sr - c_s = 1: the same for every mode, since deflections enter (38) and (47) squared.",
    )  # fmt: skip
    yield Statement(
        "Conclusion 3",
        "for any possible single-mode or combination instability a minimum can be reached by adjusting the contact "
        "ratios and gamma_sr",
        "smallest over largest width, gamma_sr alone: single modes as above; "
        + ", ".join(f"{label}: {number(part, 2)}" for label, part in combined.items())
        + "; with integer contact ratios 0 (below (39))",
        all(part < 1 for part in [*combined.values(), *(part for _, part in single.values())]),
        "all ratios are below 1",
        "Each by itself: where 2w1 is smallest, w3+w7 is largest.",
    )  # fmt: skip
    yield Statement(
        "Below (39)",
        "for two distinct modes the sign of delta_s1p delta_r1p delta_s1q delta_r1q says which gamma_sr that is",
        "; ".join(
            f"{label}: sign {'+' if same else '-'}, smallest at gamma_sr = {gamma:g} ({number(part, 2)} of the largest)"
            for label, ((gamma, part), same) in both.items()
        ),
        all(abs(gamma - (BEST if same else WORST)) < 1e-9 for (gamma, _), same in both.values()),
        f"{BEST} for +, {WORST} for -",
    )


STATEMENTS: list[Callable[[Runs], Iterator[Statement]]] = [rules, integer_contact_ratios, no_difference_type, minima]
