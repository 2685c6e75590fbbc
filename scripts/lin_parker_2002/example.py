"""Lin & Parker (2002), section 4 (the benchmark of two earlier papers) and section 5 (single mesh, damping)."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import xarray as xr

from lin_parker_2002.common import BOTH, COMBINATION, FIRST_ORDER, PRIMARY, RANGE, distance
from statements import (
    AS_PRINTED,
    EVERY,
    OVERLAP_RULE,
    Runs,
    Statement,
    edges,
    half_width,
    measured,
    number,
    numbers,
    overlap,
    predicted,
    sort_of,
    tongue,
    well,
    width,
)

FIG8 = {0.0: "lin_parker_2002/fig8a", 0.4: "lin_parker_2002/fig8b"}
FIG9 = {0.0: "lin_parker_2002/fig9a", 0.4: "lin_parker_2002/fig9b"}
POINT_A = {"mesh_frequency": 4.2, "amplitude": 0.3}
VERDICT = {True: "stable", False: "unstable"}


def fig8(runs: Runs, h: float) -> xr.DataTree:
    methods = {**BOTH, "uncoupled": {"harmonics": 2}, "floquet": {}}
    return runs.sweep(FIG8[h], sweep={"mesh_frequency": [0.35, 4.2, 7.0], "amplitude": [0.1, 0.3]}, methods=methods)


def inside(values: xr.DataArray) -> bool:
    """Whether point A lies between two edges."""
    low, high = (float(v) for v in values.sel(amplitude=0.3))
    return low < POINT_A["mesh_frequency"] < high


def growth(tree: xr.DataTree) -> float:
    return float(tree["floquet"]["growth_rate"].sel(POINT_A))


def point_a(runs: Runs) -> Iterator[Statement]:
    rates = {h: growth(fig8(runs, h)) for h in FIG8}
    first = {h: not any(inside(predicted(fig8(runs, h), s)) for s in [*PRIMARY, *COMBINATION]) for h in FIG8}
    mean = {
        h: float(
            runs.sweep(
                "lin_parker_2002/fig3",
                sweep={"mesh_frequency": [4.2], "epsilon": [0.3], "phasing": [h]},
                methods={"floquet": {}},
                meshes__0__contact_ratio=1.47,
                meshes__1__contact_ratio=1.57,
            )["floquet"]["growth_rate"].squeeze()
        )
        for h in FIG8
    }
    yield Statement(
        "4, Fig. 8",
        "point A (Omega = 4.2, k_a = 0.3) is unstable for h = 0 and stable for h = 0.4, by perturbation and "
        "numerically",
        f"growth rate by Floquet theory {numbers(list(rates.values()))} for h = 0, 0.4; first order: "
        f"{', '.join(VERDICT[v] for v in first.values())}",
        rates[0.0] > 0 and rates[0.4] == 0 and not first[0.0] and first[0.4],
        EVERY,
        "With the maximum stiffness kept, as the paper says for this example. With the mean stiffness kept the "
        f"growth rates are {numbers(list(mean.values()))}.",
    )


def agreement(runs: Runs) -> Iterator[Statement]:
    labels = [*PRIMARY, *COMBINATION]
    epsilon = [0.3 / (1 - 0.6 * (1 - d)) for d in (0.47, 0.57)]
    for h, part in zip(FIG8, "ab", strict=True):
        tree = fig8(runs, h)
        common = {label: overlap(tree, label).squeeze() for label in labels}
        largest = distance(tree, labels).max("label")
        yield Statement(
            f"4, Fig. 8({part})",
            f"excellent agreement of analytical and numerical boundaries, h = {h:g}",
            "overlap at k_a = 0.1, 0.3: "
            + "; ".join(f"{label}: {numbers(values, 2)}" for label, values in common.items())
            + f"; largest error of an edge: {numbers(largest, 2)}",
            well(common.values()),
            OVERLAP_RULE,
            f"k_a = 0.3 is eps = {numbers(epsilon, 2)} here, since the mean stiffnesses have fallen.",
        )


def uncoupled(runs: Runs) -> Iterator[Statement]:
    found, shown = {}, []
    for h in FIG8:
        tree = fig8(runs, h)
        mathieu = [width(tongue(tree, "uncoupled", "boundary_frequency", s)).sel(amplitude=0.3) for s in PRIMARY]
        exact = [width(edges(tree, s)).sel(amplitude=0.3) for s in PRIMARY]
        found[h] = np.array([mathieu, exact], dtype=float)
        floquet = ", ".join(measured(tree, s, amplitude=0.3) for s in PRIMARY)
        shown.append(f"h = {h:g}: {numbers(mathieu)} against {floquet}")
    assumed = inside(tongue(fig8(runs, 0.4), "uncoupled", "boundary_frequency", "2w3"))
    good, bad = (np.abs(f[0] / f[1] - 1).max() for f in found.values())
    yield Statement(
        "4, Fig. 8",
        "mode uncoupling (Benton & Seireg 1980) does not give satisfactory results when the phasing is not zero",
        f"widths at {', '.join(PRIMARY)}, k_a = 0.3, uncoupled against Floquet theory: {'; '.join(shown)}",
        bool(good < 0.25 and bad > 1),
        "widths within 25 % for h = 0, some off by more than 100 % for h = 0.4",
        "Its widths do not depend on h at all: close for h = 0, far off for h = 0.4. It knows no combination regions.",
    )
    yield Statement(
        "4",
        "stability of point A for h = 0.4 conflicts with Benton & Seireg's results",
        f"uncoupled: {VERDICT[not assumed]}; Floquet theory: {VERDICT[growth(fig8(runs, 0.4)) == 0]}",
        assumed and growth(fig8(runs, 0.4)) == 0,
        "the two differ",
    )


def free_response(runs: Runs) -> Iterator[Statement]:
    ratio, rate = {}, {}
    for h, config in FIG9.items():
        x = abs(runs.respond(config, respond__cycles=60)["response"]["displacement"]).max("dof")
        period = 2 * np.pi / POINT_A["mesh_frequency"]
        # The largest deflection in the first and last ten periods, and half of the record apart.
        cycle = (x["time"] / period).astype(int)
        peaks = x.groupby(cycle.rename("cycle")).max().values[:60]
        blocks = [peaks[k : k + 10].max() for k in (0, 25, 50)]
        ratio[h] = blocks[2] / blocks[0]
        rate[h] = np.log(blocks[2] / blocks[1]) / (25 * period)
    yield Statement(
        "4, Fig. 9",
        "free response at point A from x1 = x2 = x3 = 0.1: it grows for h = 0 and stays bounded for h = 0.4",
        f"largest deflection in mesh periods 51-60 over that in 1-10: {numbers(list(ratio.values()), 2)} for h = 0, "
        "0.4; growth rate over the "
        f"second half for h = 0 {number(rate[0.0])}, by Floquet theory {number(growth(fig8(runs, 0.0)))}",
        ratio[0.0] > 100 and ratio[0.4] < 1.5,
        "more than 100 times, and less than 1.5 times",
    )


def single_mesh(runs: Runs) -> Iterator[Statement]:
    c = np.linspace(1, 2, 41).round(3).tolist()
    tree = runs.sweep(
        "gear_pair",
        sweep={"mesh_frequency": [0.4, 2.6], "contact_ratio": c},
        methods=FIRST_ORDER,
        damping_ratio=0,
        meshes__0__epsilon=0.1,
    )
    found = {}
    for label in ("2w1", "w1"):
        w = half_width(tree, label)
        found[label] = [
            [float(v) for v in w["contact_ratio"][np.flatnonzero(keep)]]
            for keep in (w < 1e-9, w > w.max() * (1 - 1e-9))
        ]
    yield Statement(
        "5",
        "a single mesh: primary regions vanish for c = 1, 2, secondary ones for c = 1, 1.5, 2; they are largest for "
        "1.5 and for 1.25, 1.75",
        f"zero: c = {numbers(found['2w1'][0])} (2w1), {numbers(found['w1'][0])} (w1); largest: "
        f"{numbers(found['2w1'][1])} (2w1), {numbers(found['w1'][1])} (w1)",
        found["2w1"] == [[1, 2], [1.5]] and found["w1"] == [[1, 1.5, 2], [1.25, 1.75]],
        AS_PRINTED,
    )
    at = [float(half_width(tree, s).sel(contact_ratio=1.4) / half_width(tree, s).max()) for s in ("2w1", "w1")]
    yield Statement(
        "5",
        "near c = 1.4 both the primary and the secondary region are significant",
        f"half-widths at c = 1.4 as parts of their largest: {numbers(at)}",
        min(at) > 0.5,
        "both more than half",
    )
    least = [float(half_width(tree, "2w1").sel(contact_ratio=c) / half_width(tree, "2w1").max()) for c in (1.25, 1.75)]
    yield Statement(
        "5",
        "for c = 1.25, 1.75 the secondary region is largest, but the primary one is small",
        f"primary half-widths there as parts of the largest: {numbers(least)}",
        sort_of(max(least) < 0.5, max(least) < 0.9 * at[0]),
        "less than half; in part: clearly less than at 1.4",
        "sin(pi c): it is smaller than at 1.4, but not small.",
    )


def damping(runs: Runs) -> Iterator[Statement]:
    tree = runs.sweep(
        "lin_parker_2002/fig3",
        sweep={"mesh_frequency": RANGE, "epsilon": [0.02, 0.05, 0.1, 0.2, 0.3], "damping_ratio": [0.0, 0.01]},
        methods=BOTH,
    )
    shown, fine = [], True
    for label in PRIMARY:
        w = width(edges(tree, label))
        free, damped = (w.sel(damping_ratio=z) for z in (0.0, 0.01))
        opens = [
            float(w["epsilon"][np.flatnonzero(v > 0)[0]]) if bool((v > 0).any()) else np.inf for v in (free, damped)
        ]
        fine &= bool((damped <= free).all()) and opens[1] >= opens[0]
        with_it, without = (measured(tree, label, damping_ratio=z) for z in (0.01, 0.0))
        shown.append(f"{label}: {with_it} instead of {without}")
    yield Statement(
        "5",
        "damping improves stability: regions shrink and begin at larger eps",
        "Floquet widths with a damping ratio of 0.01 at eps = 0.02, 0.05, 0.1, 0.2, 0.3: " + "; ".join(shown),
        fine,
        EVERY,
    )


STATEMENTS: list[Callable[[Runs], Iterator[Statement]]] = [
    point_a,
    agreement,
    uncoupled,
    free_response,
    single_mesh,
    damping,
]
