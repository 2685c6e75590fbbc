"""Lin & Parker (2002), section 3.3: stiffness variations that differ between the meshes."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from lin_parker_2002.common import BOTH, PRIMARY, RANGE, Modes
from statements import (
    EVERY,
    OVERLAP_RULE,
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
    predicted,
    sort_of,
    well,
    width,
)  # fmt: skip

FIG7A = "lin_parker_2002/fig7a"
FIRST, SECOND = "meshes.first.epsilon", "meshes.second.epsilon"


def chords(runs: Runs) -> Iterator[Statement]:
    tree = runs.sweep(FIG7A, sweep={"mesh_frequency": RANGE, FIRST: [0.0, 0.1, 0.2, 0.3, 0.4, 0.5]}, methods=BOTH)
    from_floquet, from_first, common = [], [], []
    for label in PRIMARY:
        ends = predicted(tree, label)
        left, right = (ends.sel({FIRST: value}, drop=True) for value in (0.0, 0.3))
        chord = left + (right - left) / 0.3 * ends[FIRST]
        from_floquet.append(float(abs(chord - edges(tree, label)).max()))
        from_first.append(float(abs(chord - ends).max()))
        common.append(float(overlap(tree, label).min()))
    yield Statement(
        "3.3, Fig. 7(a)",
        "straight lines through (33) at eps1 = 0 and (34) at eps1 = eps2 = 0.3 agree well with the numerical "
        "boundaries of the primary regions",
        f"least overlap for eps1 = 0 to 0.5 at {', '.join(PRIMARY)}: {numbers(common, 2)}; largest distance from the "
        f"Floquet edges: {numbers(from_floquet, 2)}",
        well(common),
        OVERLAP_RULE,
        "The lines are the first-order edges themselves, which for c1 = c2 and h = 0 are straight: "
        f"{at_most(max(from_first))}.",
    )


def widening(runs: Runs) -> Iterator[Statement]:
    tree = runs.sweep(FIG7A, sweep={"mesh_frequency": RANGE, FIRST: [0.05], SECOND: [0.0, 0.3]}, methods=BOTH)
    found = [width(edges(tree, label)).squeeze(FIRST).values for label in PRIMARY]
    yield Statement(
        "3.3, Fig. 7(a)",
        "for small eps1 the second excitation widens the primary regions",
        f"Floquet widths at eps1 = 0.05 for eps2 = 0, 0.3: {by_label(tree, PRIMARY)}",
        all(after > before for before, after in found),
        EVERY,
    )


def vanishing(runs: Runs) -> Iterator[Statement]:
    base = runs.sweep(FIG7A, sweep={"mesh_frequency": RANGE, FIRST: [0.0, 0.1, 0.2, 0.3, 0.4, 0.5]}, methods=BOTH)
    m = Modes(base)
    ratio = abs(m.d(2, 2) * m.d(2, 3) / (m.d(1, 2) * m.d(1, 3)))
    fine = np.linspace(0.34, 0.346, 61).round(4).tolist()
    tree = runs.sweep(FIG7A, sweep={"mesh_frequency": [3.4, 4.0], FIRST: fine}, methods=BOTH)
    exact, first = (width(f(tree, "w2+w3")) for f in (edges, predicted))
    at, at_first = (float(w[FIRST][int(w.values.argmin())]) for w in (exact, first))
    there = runs.sweep(FIG7A, sweep={"mesh_frequency": [3.4, 4.0], FIRST: [0.23]}, methods=BOTH)
    yield Statement(
        "3.3, Fig. 7(a)",
        "the combination region at w2+w3 disappears near eps1 = 0.23 (eps2 = 0.3)",
        f"eps1 delta_12 delta_13 = eps2 delta_22 delta_23 at eps1 = {number(0.3 * ratio, 4)}; smallest width on a grid "
        f"of 0.0001: first order {number(at_first, 4)}, Floquet {number(at, 4)}; Floquet width at eps1 = 0.23: "
        f"{measured(there, 'w2+w3')}",
        abs(at - 0.23) < 0.02,
        "within 0.02",
        "The region does disappear, but where the two meshes cancel in (23) with the parameters of Table 1. The same "
        f"formula gives {number(0.2 * ratio, 4)} for eps2 = 0.2, which may be what was drawn.",
    )


def line_of_vanishing(runs: Runs) -> Iterator[Statement]:
    second = [0.1, 0.2, 0.4]
    found = []
    for value in second:
        guess = np.linspace(1.10, 1.18, 17) * value
        tree = runs.sweep(
            FIG7A,
            sweep={"mesh_frequency": [3.4, 4.0], FIRST: guess.round(5).tolist()},
            methods=BOTH,
            meshes__1__epsilon=value,
        )
        exact = width(edges(tree, "w2+w3"))
        found.append(float(exact[FIRST][int(exact.values.argmin())]) / value)
    yield Statement(
        "3.3, Fig. 7(b)",
        "the combination region vanishes along a line of the (eps1, eps2) plane",
        f"eps1/eps2 at the smallest Floquet width for eps2 = {numbers(second)}: {numbers(found)}",
        max(found) < 1.05 * min(found),
        "within 5 % of each other",
    )


def decoupled(runs: Runs) -> Iterator[Statement]:
    changes = {"meshes__0__epsilon": 0.3}
    sweep = {"mesh_frequency": [3.5, 7.0], SECOND: [0.0, 0.1, 0.3]}
    tree = runs.sweep(
        "lin_parker_2002/fig6a", sweep=sweep, methods=BOTH, **{f"system__{k}": v for k, v in changes.items()}
    )
    labels = ["w2+w3", "2w3"]
    first = [half_width(tree, label) for label in labels]
    exact = [edges(tree, label) for label in labels]
    moved = [float(abs(e / e.isel({SECOND: 0}) - 1).max()) for e in exact]
    same = max(float(abs(f / f.isel({SECOND: 0}) - 1).max()) for f in first)
    yield Statement(
        "3.3",
        "when R is neither an integer nor the reciprocal of one, the first mesh's regions are only affected by eps1",
        f"R = 3/5, eps1 = 0.3, eps2 = 0 to 0.3: first order {at_most(same)}; Floquet edges at {', '.join(labels)} move "
        f"by up to {numbers(moved, 2)} of their frequency",
        sort_of(same < 1e-9 and max(moved) < 1e-3, same < 1e-9),
        "edges move by less than 0.001; in part: to first order only",
        "To first order only: products of both stiffness variations move the edges.",
    )


STATEMENTS: list[Callable[[Runs], Iterator[Statement]]] = [chords, widening, vanishing, line_of_vanishing, decoupled]
