"""Lin & Parker (2002), section 3.2: four gears, two mesh frequencies."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import xarray as xr

from lin_parker_2002.common import (
    BOTH,
    COMBINATION,
    PRIMARY,
    Modes,
    axes,
    coarse,
    cospi,
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
    center,
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

FIG6A, FIG6B = "lin_parker_2002/fig6a", "lin_parker_2002/fig6b"


def first_mesh(runs: Runs) -> Iterator[Statement]:
    tree, m = coarse(runs, FIG6A), Modes(coarse(runs, FIG6A))
    c1, c2, _ = axes(tree)
    pairs = [(1, 1), (2, 2), (3, 3), (1, 2), (1, 3), (2, 3)]
    error = 0.0
    for (p, q), label in zip(pairs, [*PRIMARY, *COMBINATION], strict=True):
        for mesh, c, name, scale in ((1, c1, label, 1.0), (2, c2, f"{label} (second)", 0.6)):
            printed = abs(2 * m.d(mesh, p) * m.d(mesh, q) * sinpi(c)) / (np.pi * np.sqrt(m.w(p) * m.w(q))) * scale
            ours = slope(tree, name)
            error = max(error, float(abs(printed - ours).max() / ours.max()))
    yield Statement(
        "3.2, (28)",
        "closed form of the widths of each mesh's own tongues for R = 3/5 (s = 1), on the axis of Omega_1",
        at_most(error),
        error < 1e-9,
        SAME_TO_ROUNDING,
    )


def extremes_of_each_mesh(runs: Runs) -> Iterator[Statement]:
    tree = regular(runs, FIG6A)
    c1, c2, _ = axes(tree)
    said, agrees = [], True
    first, second = ([1.5], [1, 2]), ([1.25, 1.75], [1, 1.5, 2])
    for label, (most, least) in (("2w3", first), ("w2+w3", first), ("w3", second)):
        for name, c in ((label, c1), (f"{label} (second)", c2)):
            sizes = slope(tree, name).max([dim for dim in slope(tree, name).dims if dim != c.name])
            largest = c.values[sizes.values > sizes.values.max() * (1 - 1e-9)]
            none = c.values[sizes.values < 1e-9 * sizes.values.max()]
            said.append(f"{name}: {numbers(largest)} and {numbers(none)}")
            agrees &= largest.tolist() == most and none.tolist() == least
    yield Statement(
        "3.2, below (28)",
        "largest regions for c = 1.5 (s = 1) and 1.25, 1.75 (s = 2) of each mesh; none for 1, 2 and 1, 1.5, 2",
        f"contact ratios of the largest region and of none: {'; '.join(said)}",
        agrees,
        EVERY,
    )


def phasing_without_effect(runs: Runs) -> Iterator[Statement]:
    tree = runs.sweep(
        FIG6A, sweep={"mesh_frequency": [2.0, 7.0], "epsilon": [0.3], "phasing": [0.0, 0.25, 0.4]}, methods=BOTH
    )
    labels = ["2w2", "w1+w3", "w2+w3", "2w3", "2w3 (second)"]
    spread = [half_width(tree, s).max() / half_width(tree, s).min() - 1 for s in labels]
    exact = [edges(tree, s) for s in labels]
    moved = max(float((abs(e.max("phasing") / e.min("phasing") - 1)).max()) for e in exact)
    yield Statement(
        "3.2",
        "for R = 3/5 the regions do not depend on the mesh phasing",
        f"first order: {at_most(max(float(x) for x in spread))}; Floquet edges at eps = 0.3 move by up to "
        f"{number(moved, 2)} of their frequency",
        sort_of(moved < 1e-3 and max(float(x) for x in spread) < 1e-9, max(float(x) for x in spread) < 1e-9),
        "edges move by less than 0.001; in part: to first order only",
        f"For h = 0, 0.25, 0.4 and {', '.join(labels)}. The effect that Floquet theory shows is of higher order in "
        "eps.",
    )


def regions_of_fig6a(runs: Runs) -> Iterator[Statement]:
    tree, m = fig6(runs, FIG6A), Modes(fig6(runs, FIG6A))
    place = float(center(edges(tree, "2w3 (second)")).sel(epsilon=0.1))
    yield Statement(
        "3.2, Fig. 6(a)",
        "the second mesh's primary region lies at Omega_1 = R 2w3",
        f"R 2w3 = {number(1.2 * m.w(3), 4)}; middle of the region by Floquet theory at eps = 0.1: {number(place, 4)}",
        abs(place / (1.2 * m.w(3)) - 1) < 0.01,
        "within 1 %",
    )
    first = half_width(tree, "w3").max()
    others = [overlap(tree, label).sel(epsilon=0.3) for label in ("2w3", "w2+w3", "w1+w3")]
    at_w3 = overlap(tree, "w3").sel(epsilon=0.3)
    yield Statement(
        "3.2, Fig. 6(a)",
        "the boundaries near 2w3, w2+w3, w1+w3 and w3 are determined by (26)",
        f"overlap at 2w3, w2+w3, w1+w3, eps = 0.3: {numbers(others, 2)}; at w3 {number(at_w3, 2)}: first order gives "
        f"width {number(first)}, Floquet theory {measured(tree, 'w3', epsilon=0.3)}",
        well([*others, at_w3]),
        OVERLAP_RULE,
        "With c1 = 1.5, (26) gives no width at s = 2: what is unstable near w3 in the figure is an effect of second "
        "order.",
    )


def fig6(runs: Runs, config: str) -> xr.DataTree:
    return runs.sweep(config, sweep={"mesh_frequency": [2.0, 7.0], "epsilon": [0.1, 0.3]}, methods=BOTH)


def coupled_region(runs: Runs) -> Iterator[Statement]:
    alone, together = (width(edges(fig6(runs, c), "w3")).sel(epsilon=0.3) for c in (FIG6A, FIG6B))
    tree = runs.sweep(
        FIG6B, sweep={"mesh_frequency": [2.0, 4.0], "epsilon": [0.3], "phasing": [0.0, 0.25, 0.4]}, methods=BOTH
    )
    spread = float(half_width(tree, "w3").max() / half_width(tree, "w3").min() - 1)
    yield Statement(
        "3.2, Fig. 6(b)",
        "for R = 1/2 the region at Omega_1 = w3 couples with the second mesh's at 2w3 and is much larger than in Fig. "
        "6(a)",
        f"Floquet widths at w3, eps = 0.3: R = 1/2 {number(together)}, R = 3/5 {number(alone)}; first-order "
        f"half-widths at w3 for R = 1/2 and h = 0, 0.25, 0.4: {at_most(spread)}",
        sort_of(bool(together > 2 * alone) and spread > 1e-9, bool(together > 2 * alone)),
        "more than twice as wide and dependent on h; in part: only wider",
        "It is much larger, but not by coupling: for c1 = 1.5 the first mesh has no second harmonic, and to first "
        "order the region is the second mesh's primary one alone, whatever the phasing.",
    )


def formula_31(m: Modes, p: int, c1: xr.DataArray, c2: xr.DataArray, h: xr.DataArray) -> xr.DataArray:
    """Half-width/epsilon of (31), with the coefficients (4) of both meshes."""
    first, second = (m.d(i, p) ** 2 for i in (1, 2))
    a1, b1 = (-sinpi(2 * c1) / np.pi * f(2 * c1) for f in (sinpi, cospi))
    a2, b2 = (-2 * sinpi(c2) / np.pi * f(c2 - 2 * h) for f in (sinpi, cospi))
    return ((first * a1 + second * a2) ** 2 + (first * b1 + second * b2) ** 2) ** 0.5 / (2 * m.w(p))


def formula_32(m: Modes, p: int, c1: xr.DataArray, c2: xr.DataArray, h: xr.DataArray) -> xr.DataArray:
    """(32) as printed."""
    a, b = m.d(1, p) ** 2 * sinpi(2 * c1), m.d(2, p) ** 2 * sinpi(c2)
    return interference(a, b, 2 * c1 - c2 + 2 * h) * 2 / (np.pi * m.w(p))


def half_integer_ratio(runs: Runs) -> Iterator[Statement]:
    tree, m = coarse(runs, FIG6B), Modes(coarse(runs, FIG6B))
    c1, c2, h = axes(tree)
    error, ratio = 0.0, []
    for p in (1, 2, 3):
        ours = slope(tree, f"w{p}")
        error = max(error, float(abs(formula_31(m, p, c1, c2, h) - ours).max() / ours.max()))
        ratio += [float(f(formula_32(m, p, c1, c2, h) / ours)) for f in (np.min, np.max)]
    yield Statement(
        "3.2, (31)",
        "width of the first mesh's secondary region, which the second mesh's primary one overlaps (R = 1/2)",
        f"{at_most(error)} from the general form on {c1.size * c2.size * h.size} choices of c1, c2, h",
        error < 1e-9,
        SAME_TO_ROUNDING,
    )
    exact = runs.sweep(
        FIG6B,
        sweep={"mesh_frequency": [2.6, 2.8], "epsilon": [0.001], "phasing": [0.2]},
        methods=BOTH,
        meshes__0__contact_ratio=1.25,
        meshes__1__contact_ratio=1.5,
    )
    floquet = float(width(edges(exact, "w3")).squeeze()) / 0.002
    point = [xr.DataArray(v) for v in (1.25, 1.5, 0.2)]
    corrected = interference(m.d(1, 3) ** 2 * sinpi(2 * c1), 2 * m.d(2, 3) ** 2 * sinpi(c2), 2 * c1 - c2 + 2 * h)
    difference = abs(corrected / (2 * np.pi * m.w(3)) / slope(tree, "w3") - 1).max()
    yield Statement(
        "3.2, (32)",
        "closed form of the same width",
        f"printed form over (31): between {number(min(ratio))} and {number(max(ratio))}; at w3 with c1 = 1.25, c2 = "
        "1.5, h = 0.2: (32) "
        f"{number(formula_32(m, 3, *point), 4)}, (31) {number(formula_31(m, 3, *point), 4)}, Floquet theory at eps = "
        f"0.001 {number(floquet, 4)}",
        max(abs(r - 1) for r in ratio) < 1e-6,
        "ratio 1 to 1e-6",
        "(32) does not follow from (31). With weights 1, 4, 4 of its three terms and the factor 1/(2 pi w_p) it "
        f"would: {at_most(difference)}.",
    )


def minimum_for_half_ratio(runs: Runs) -> Iterator[Statement]:
    tree = regular(runs, FIG6B)
    c1, c2, h = axes(tree)
    widths = slope(tree, "w3")
    closed = (widths < 1e-9 * widths.max()).all("phasing")
    first = sorted({float(c1[i]) for i, _ in np.argwhere(closed.transpose(c1.name, c2.name).values)})
    second = sorted({float(c2[j]) for _, j in np.argwhere(closed.transpose(c1.name, c2.name).values)})
    yield Statement(
        "3.2, below (32)",
        "the region needs c1 = 1, 1.5, 2 and c2 = 1, 2 to vanish",
        f"no width, whatever the phasing: c1 = {numbers(first)} with c2 = {numbers(second)}",
        first == [1, 1.5, 2] and second == [1, 2],
        AS_PRINTED,
    )
    inside = {c1.name: [1.1, 1.3, 1.6, 1.9], c2.name: [1.2, 1.4, 1.7]}
    part, turn = widths.sel(inside), cospi(2 * c1 - c2 + 2 * h).sel(inside)
    side = sinpi(2 * c1).sel({c1.name: inside[c1.name]})
    signed = (turn * side / abs(side)).where(part <= part.min("phasing") * (1 + 1e-9))
    yield Statement(
        "3.2, below (32)",
        "else it is reduced by cos(2c1 - c2 + 2h)pi = +-1 with the sign of sin(2 c1 pi)",
        f"that cosine times that sign at the minima over h: {numbers([signed.min(), signed.max()])}",
        bool(signed.min() > 1 - 1e-9),
        SAME_TO_ROUNDING,
    )


def weak_overlap(runs: Runs) -> Iterator[Statement]:
    tree = regular(runs, FIG6B)
    strong, weak = (slope(tree, label).max() for label in ("w3", "w3/2"))
    yield Statement(
        "3.2",
        "the overlap of the second mesh's s = 2 with the first mesh's s = 4 is weaker and its regions are much smaller",
        f"largest half-width/eps over c1, c2, h for mode 3: {number(weak)} at w3/2 against {number(strong)} at w3",
        bool(weak < 0.5 * strong),
        "less than half",
    )


STATEMENTS: list[Callable[[Runs], Iterator[Statement]]] = [
    first_mesh,
    extremes_of_each_mesh,
    phasing_without_effect,
    regions_of_fig6a,
    coupled_region,
    half_integer_ratio,
    minimum_for_half_ratio,
    weak_overlap,
]
