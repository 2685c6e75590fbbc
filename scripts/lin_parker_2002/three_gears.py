"""Lin & Parker (2002), section 3.1: three gears, equal stiffness variations.

As in the other sections, nothing is typed in from the paper but its formulas and the values it names: all that stands
in the column "here" of the table is computed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import xarray as xr

from lin_parker_2002.common import (
    BOTH,
    COMBINATION,
    PRIMARY,
    RANGE,
    Modes,
    axes,
    coarse,
    distance,
    interference,
    regular,
    sinpi,
)
from statements import (
    AS_PRINTED,
    EVERY,
    OVERLAP_RULE,
    SAME_TO_ROUNDING,
    Runs,
    Statement,
    at_most,
    by_label,
    edges,
    half_width,
    measured,
    number,
    numbers,
    overlap,
    slope,
    sort_of,
    well,
    width,
)


def fig3(runs: Runs) -> xr.DataTree:
    return runs.sweep("lin_parker_2002/fig3", sweep={"mesh_frequency": RANGE, "epsilon": [0.1, 0.3, 0.5]}, methods=BOTH)


def modes(runs: Runs) -> Iterator[Statement]:
    m = Modes(fig3(runs))
    x = m.shapes
    phase = [["in phase" if x[p, i] * x[p, i + 1] < 0 else "out of phase" for i in (0, 1)] for p in range(3)]
    yield Statement(
        "3.1, Fig. 4",
        "mode 1: both meshes in phase; mode 2: one in phase, the other out of phase; mode 3: both out of phase",
        "; ".join(f"mode {p + 1}: {', '.join(phase[p])}" for p in range(3)),
        phase[0] == ["in phase"] * 2 and len(set(phase[1])) == 2 and phase[2] == ["out of phase"] * 2,
        EVERY,
        "Natural frequencies " + numbers([m.w(p) for p in (1, 2, 3)], 4) + "; the paper prints none.",
    )
    size = np.array([[abs(m.d(i, p)) for p in (1, 2, 3)] for i in (1, 2)])
    yield Statement(
        "3.1",
        "mesh deflections delta_1, delta_2 of mode 1 are smaller than those of mode 3",
        f"delta_1: {numbers(size[0])}; delta_2: {numbers(size[1])} (modes 1, 2, 3)",
        bool(np.all(size[:, 0] < size[:, 2])),
        EVERY,
    )


def primary_order(runs: Runs) -> Iterator[Statement]:
    tree = fig3(runs)
    found = [float(slope(tree, label)) for label in PRIMARY]
    floquet = [float(width(edges(tree, label)).sel(epsilon=0.3)) for label in PRIMARY]
    m = Modes(tree)
    energy = [(m.d(1, p) ** 2 + m.d(2, p) ** 2) / 2 for p in (1, 2, 3)]
    yield Statement(
        "3.1, Fig. 3",
        "the region around 2w3 is much larger than those around 2w1 and 2w2 (Lambda_33 > Lambda_22 > Lambda_11)",
        f"half-widths/eps at {', '.join(PRIMARY)}: {numbers(found)}; Floquet widths at eps = 0.3: "
        f"{by_label(tree, PRIMARY, epsilon=0.3)}",
        all(w[2] > 2 * w[1] and w[1] > w[0] for w in (found, floquet)),
        "in this order, the third at least twice the second",
    )
    yield Statement(
        "3.1",
        "modes with more strain energy in the meshes have larger instability regions",
        f"mesh strain energy of the normalised modes 1, 2, 3: {numbers(energy)}, half-widths/eps as above",
        energy == sorted(energy) and found == sorted(found),
        "both in this order",
    )


def agreement(runs: Runs) -> Iterator[Statement]:
    tree = fig3(runs)
    labels = [*PRIMARY, *COMBINATION]
    error = distance(tree, labels)
    by_epsilon = error.max("label")
    common = {label: overlap(tree, label) for label in labels}
    yield Statement(
        "3.1, Fig. 3",
        "first-order boundaries agree well with the numerical ones, even when eps is not small",
        "overlap at eps = 0.1, 0.3, 0.5: "
        + "; ".join(f"{label}: {numbers(values, 2)}" for label, values in common.items())
        + f"; largest error of an edge: {numbers(by_epsilon, 2)}",
        well(common.values()),
        OVERLAP_RULE,
        "The regions at 2w2 and 2w3 agree. The narrow regions at w1+w3 and w2+w3 move by more than their width, by "
        "effects of second order, which can hardly be seen on an axis that reaches Omega = 6.",
    )


def secondary_of_fig3(runs: Runs) -> Iterator[Statement]:
    tree = fig3(runs)
    first, exact = half_width(tree, "w3"), width(edges(tree, "w3"))
    yield Statement(
        "3.1, (22)",
        "secondary regions vanish for c1, c2 = 1, 1.5, 2",
        f"c1 = c2 = 1.5: first-order half-width at w3 {number(first.max())}; Floquet width at eps = 0.1, 0.3, 0.5: "
        f"{measured(tree, 'w3')}",
        sort_of(
            bool(first.max() < 1e-9 and exact.max() < 1e-9),
            bool(first.max() < 1e-9 and exact.sel(epsilon=0.1) < 0.1 * exact.sel(epsilon=0.5)),
        ),
        "no width; in part: to first order only, the other growing as eps^2",
        "To first order only. The region that second-order terms leave at w3 is, at eps = 0.3, wider than the primary "
        f"one at 2w1 ({measured(tree, '2w1', epsilon=0.3)}).",
    )


def closed_forms(runs: Runs) -> Iterator[Statement]:
    tree, m = coarse(runs), Modes(coarse(runs))
    c1, c2, h = axes(tree)
    lean = c1 - c2 + 2 * h

    def largest(s: int, pairs: list[tuple[int, int]], labels: list[str]) -> float:
        worst = 0.0
        for (p, q), label in zip(pairs, labels, strict=True):
            a, b = (m.d(i, p) * m.d(i, q) * sinpi(s * c) for i, c in ((1, c1), (2, c2)))
            printed = interference(a, b, s * lean) * 2 / (np.pi * np.sqrt(m.w(p) * m.w(q)) * s**2)
            ours = slope(tree, label)
            worst = max(worst, float(abs(printed - ours).max() / ours.max()))
        return worst

    cases = [
        ("(21)", 1, [(p, p) for p in (1, 2, 3)], PRIMARY),
        ("(22)", 2, [(p, p) for p in (1, 2, 3)], ["w1", "w2", "w3"]),
        ("(23)", 1, [(1, 2), (1, 3), (2, 3)], COMBINATION),
    ]
    for equation, s, pairs, labels in cases:
        error = largest(s, pairs, labels)
        yield Statement(
            f"3.1, {equation}",
            f"closed form of the width at {', '.join(labels)}",
            f"{at_most(error)} from the general form on {c1.size * c2.size * h.size} choices of c1, c2, h",
            error < 1e-9,
            SAME_TO_ROUNDING,
        )


def integer_contact_ratios(runs: Runs) -> Iterator[Statement]:
    tree = runs.sweep(
        "lin_parker_2002/fig3",
        sweep={"mesh_frequency": RANGE, "contact_ratio": [1.0, 2.0], "epsilon": [0.3]},
        methods=BOTH,
    )
    regions = int(tree["boundaries"]["boundary_frequency"].notnull().any("side").sum())
    yield Statement(
        "3.1",
        "integer contact ratios leave no instability region",
        f"regions found by Floquet theory for c1 = c2 = 1 and 2, eps = 0.3: {regions}",
        regions == 0,
        "none",
    )


def primary_extremes(runs: Runs) -> Iterator[Statement]:
    tree = regular(runs)
    widths = slope(tree, "2w3")
    worst = widths.argmax(...)
    at = [float(axis[int(worst[str(axis.name)])]) for axis in axes(tree)]
    yield Statement(
        "3.1, Fig. 5",
        "c1 = c2 = 1.5, h = 0 is the most severe condition for primary instabilities",
        f"widest region at 2w3 among {widths.size} choices: c1, c2, h = {numbers(at)}",
        bool(np.allclose(at, [1.5, 1.5, 0.0])),
        AS_PRINTED,
    )
    c1, c2, h = axes(tree)
    inner = {"meshes.first.contact_ratio": slice(1.01, 1.99), "meshes.second.contact_ratio": slice(1.01, 1.99)}
    best = widths.sel(inner)
    lean = (c1 - c2 + 2 * h).sel(inner)
    # Only where some h of the grid meets the condition exactly: c1 - c2 is then a multiple of a tenth.
    exact = (abs(sinpi((lean - 1) / 2)) < 1e-9).any("phasing")
    smallest = (best <= best.min("phasing") * (1 + 1e-9)) & exact
    kept = sorted(set(np.round(lean.where(smallest).values[smallest.values], 6)))
    yield Statement(
        "3.1, (21)",
        "for given contact ratios the primary regions are smallest for c1 - c2 + 2h = +-1, 3",
        f"values of c1 - c2 + 2h at the minimum over h: {numbers(kept)}",
        set(kept) <= {-1.0, 1.0, 3.0},
        "only such values",
        "Of the three only 1 is within reach: -1 < c1 - c2 + 2h < 3 for 1 < c1, c2 < 2 and 0 <= h <= 1.",
    )


def fig5(runs: Runs) -> Iterator[Statement]:
    tree = runs.sweep("lin_parker_2002/fig5", sweep__epsilon=[0.1, 0.3], sweep__mesh_frequency=RANGE, methods=BOTH)
    labels = [*PRIMARY, *COMBINATION]
    found = {label: width(edges(tree, label)).transpose("case", "epsilon").values for label in labels}
    low, high = (by_label(tree, PRIMARY, epsilon=value) for value in (0.1, 0.3))
    less = {s: bool(np.all((found[s][1] < 0.5 * found[s][0]) & (found[s][2] < found[s][1]))) for s in PRIMARY}
    order = slope(tree, "2w1").values
    yield Statement(
        "3.1, Fig. 5",
        "h = 0.5 instead of 0 (c1 = c2 = 1.5) markedly reduces the primary regions; c1 = 1.1, c2 = 1.9, h = 0.9 "
        "reduces them further",
        f"Floquet widths for the three cases at eps = 0.1: {low}; at eps = 0.3: {high}",
        sort_of(all(less.values()), sum(less.values()) >= 2),
        "each less than half, then less again; in part: at two of three",
        f"At 2w1 only to first order (half-widths/eps {numbers(order)}): terms of second order outweigh what is left "
        "there.",
    )
    larger = [bool(np.all(found[label][1] > found[label][0])) for label in COMBINATION]
    m = Modes(tree)
    signs = ["+" if m.d(1, p) * m.d(2, p) * m.d(1, q) * m.d(2, q) > 0 else "-" for p, q in ((1, 2), (1, 3), (2, 3))]
    exceptions = ", ".join(label for label, yes in zip(COMBINATION, larger, strict=True) if not yes)
    shown = by_label(tree.isel(case=slice(0, 2)), COMBINATION, epsilon=0.1)
    yield Statement(
        "3.1, Fig. 5",
        "what reduces the primary regions (h = 0.5) makes the combination regions large, and vice versa",
        f"Floquet widths at eps = 0.1 for h = 0 and 0.5: {shown}",
        sort_of(all(larger), sum(larger) >= 2),
        "each larger; in part: two of three",
        f"Not for {exceptions}. The signs of delta_1p delta_2p delta_1q delta_2q in (23) are {', '.join(signs)}: "
        "where it is +, a combination region shrinks with the primary ones."
        if exceptions
        else "",
    )
    between = [bool(np.all((found[s][0] < found[s][2]) & (found[s][2] < found[s][1]))) for s in ("w1+w3", "w2+w3")]
    yield Statement(
        "3.1, Fig. 5",
        "c1 = 1.1, c2 = 1.9, h = 0.9 is a trade-off: several regions are smaller, none is a true minimum",
        f"Floquet widths at eps = 0.1 for the three cases: {by_label(tree, ['w1+w3', 'w2+w3'], epsilon=0.1)}",
        all(between),
        "between the other two",
        "The primary regions are nearly closed, and these lie between the extremes.",
    )


def secondary_extremes(runs: Runs) -> Iterator[Statement]:
    tree, m = regular(runs), Modes(regular(runs))
    c1, c2, h = axes(tree)
    widths = slope(tree, "w3")
    top = widths.where(widths > widths.max() * (1 - 1e-9))
    kept = np.argwhere(np.isfinite(top.transpose(*(str(a.name) for a in (c1, c2, h))).values))
    ratios = sorted({float(c1[i]) for i, _, _ in kept} | {float(c2[j]) for _, j, _ in kept})
    phasings = sorted({float(h[k]) for *_, k in kept})
    yield Statement(
        "3.1, (22)",
        "secondary regions are largest for c1, c2 = 1.25, 1.75 and h = 0",
        f"widest region at w3: contact ratios {numbers(ratios)}, h = {numbers(phasings)}",
        sort_of(ratios == [1.25, 1.75] and phasings == [0.0], ratios == [1.25, 1.75] and 0.0 in phasings),
        "there and nowhere else; in part: there, too",
        "cos 2(c1 - c2 + 2h) pi has the period 1/2 in h: h = 0.5, which reduces the primary regions, is as bad here "
        "as h = 0.",
    )
    inside = {"meshes.first.contact_ratio": [1.2, 1.3, 1.7], "meshes.second.contact_ratio": [1.1, 1.4, 1.8]}
    part, lean = widths.sel(inside), abs(c1 - c2 + 2 * h).sel(inside)
    smallest = part <= part.min("phasing") * (1 + 1e-9)
    same = ((c1 - 1.5) * (c2 - 1.5) > 0).sel(inside)
    both = sorted(set(np.round(lean.where(smallest & same).values, 6)[(smallest & same).values]))
    apart = sorted(set(np.round(lean.where(smallest & ~same).values, 6)[(smallest & ~same).values]))
    yield Statement(
        "3.1, (22)",
        "else |c1 - c2 + 2h| = 0.5, 1.5 (c1, c2 on one side of 1.5) or 0, 1, 2 (on both sides) reduces the secondary "
        "regions",
        f"minima over h: {numbers(both)} on one side; {numbers(apart)} on both",
        all(abs(v % 1 - 0.5) < 1e-6 for v in both) and all(abs(v % 1) < 1e-6 for v in apart),
        "only such values",
    )
    printed = (m.d(1, 3) ** 2 + m.d(2, 3) ** 2) ** 2
    ours = (2 * float(widths.max())) ** 2
    yield Statement(
        "3.1, below (22)",
        "the maximum of Lambda_pp^(2) is (k_g1 delta_1p^2 + k_g2 delta_2p^2)^2",
        f"p = 3: printed {number(printed)}, here {number(ours)}; their ratio over (pi w3)^2: "
        f"{number(printed / ours / (np.pi * m.w(3)) ** 2)}",
        abs(printed / ours - 1) < 1e-6,
        "equal to 1e-6",
        "The factor 1/(pi w_p)^2 of (22) is missing in the print.",
    )


def all_at_once(runs: Runs) -> Iterator[Statement]:
    """Where the regions of three kinds are smallest, for integer and for other contact ratios."""
    tree = regular(runs)
    kinds = {"primary": PRIMARY, "secondary": ["w1", "w2", "w3"], "combination": COMBINATION}

    def at(label: str, c: float) -> xr.DataArray:
        chosen = {"meshes.first.contact_ratio": c, "meshes.second.contact_ratio": c}
        found: xr.DataArray = slope(tree, label).sel(chosen)
        return found

    def phasings(label: str) -> list[float]:
        """Phasings at which the region is smallest with contact ratios of 1.4."""
        sizes = at(label, 1.4)
        return [float(h) for h in sizes["phasing"][np.flatnonzero(sizes <= sizes.min() * (1 + 1e-9))]]

    closed = max(float(at(label, c).max()) for labels in kinds.values() for label in labels for c in (1.0, 2.0))
    best = {label: phasings(label) for labels in kinds.values() for label in labels}
    yield Statement(
        "3.1",
        "the primary, secondary and combination regions cannot be minimised at the same time",
        f"largest first-order half-width/eps for c1 = c2 = 1, 2: {number(closed)}; for c1 = c2 = 1.4 the h at which "
        "each is smallest: " + "; ".join(f"{label}: {numbers(h)}" for label, h in best.items()),
        sort_of(closed > 1e-9 and not set.intersection(*map(set, best.values())),
                not set.intersection(*map(set, best.values()))),
        "no choice is best for all; in part: no phasing is",
        "By the phasing they cannot; integer contact ratios close them all.",
    )  # fmt: skip


STATEMENTS: list[Callable[[Runs], Iterator[Statement]]] = [
    modes,
    primary_order,
    agreement,
    closed_forms,
    integer_contact_ratios,
    primary_extremes,
    fig5,
    secondary_of_fig3,
    secondary_extremes,
    all_at_once,
]
