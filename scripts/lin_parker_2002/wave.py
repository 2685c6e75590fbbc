"""Lin & Parker (2002), section 2: the wave of the mesh stiffness and its Fourier terms."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from lin_parker_2002.common import COMBINATION, PRIMARY, RANGE
from statements import Runs, Statement, edges, number, numbers, sort_of, width

SEEN = [*PRIMARY, *COMBINATION, "w2", "w3"]
"""Primary and combination regions, and the wider secondary ones."""


def few_terms(runs: Runs) -> Iterator[Statement]:
    """2: the wave by its first Fourier terms."""
    ratios, sizes, left = (1.5, 1.4, 1.3), {}, {}
    for c in ratios:
        whole = {"meshes__0__contact_ratio": c, "meshes__1__contact_ratio": c}
        for terms in (None, 3, 4):
            changes = whole if terms is None else {"system__meshes": few(c, terms)}
            sweep = {"mesh_frequency": RANGE, "epsilon": [0.1, 0.3]}
            tree = runs.sweep("lin_parker_2002/fig3", sweep=sweep, methods={"boundaries": {}}, **changes)
            sizes[c, terms] = [width(edges(tree, label)) for label in SEEN]
            # The square of a wave of d and d - 1 has the mean d (1 - d).
            sines = np.sin(np.pi * c * np.arange(1, (terms or 0) + 1)) / np.arange(1, (terms or 0) + 1)
            left[c, terms] = 1 - 2 * np.sum(sines**2) / np.pi**2 / ((c - 1) * (2 - c))
    worst = {
        key: max(float(abs(a / b - 1).max()) for a, b in zip(found, sizes[key[0], None], strict=True))
        for key, found in sizes.items()
        if key[1]
    }
    yield Statement(
        "2",
        "the first three or four Fourier terms reasonably approximate the mesh stiffness variation",
        f"Floquet widths at {', '.join(SEEN)}, eps = 0.1, 0.3, differ from the whole wave's by at most "
        + "; ".join(f"c = {c}: {numbers([100 * worst[c, n] for n in (3, 4)], 2)} %" for c in ratios)
        + " with three, four terms",
        sort_of(max(worst.values()) < 0.05, all(worst[c, 4] < 0.05 for c in ratios)),
        "all within 5 %; in part: with four terms",
        f"With c = 1.5 every second term is zero: three and four terms are the same. Of the mean square of the wave "
        f"they leave {numbers([100 * left[c, n] for c in ratios for n in (3, 4)], 2)} %, near the jumps.",
    )


def few(c: float, terms: int) -> list[dict[str, object]]:
    """Both meshes with the first terms of the wave of contact ratio c."""
    s = np.arange(1, terms + 1)
    size = 2 / (s * np.pi) * np.sin(s * np.pi * c)
    series = {"sin": (size * np.sin(s * np.pi * c)).tolist(), "cos": (size * np.cos(s * np.pi * c)).tolist()}
    wave = {"waveform": {"kind": "fourier", **series}, "mean_stiffness": 1.0, "epsilon": 0.3}
    return [{"name": name, **wave} for name in ("first", "second")]


def sign_of_the_wave(runs: Runs) -> Iterator[Statement]:
    c, harmonics = 1.3, np.arange(1, 4001)[:, None]
    phase = (np.arange(1000) + 0.5) / 1000
    factor = -2 / (harmonics * np.pi) * np.sin(harmonics * np.pi * c)
    angle = 2 * np.pi * harmonics * phase
    wave = factor * (np.sin(harmonics * np.pi * c) * np.sin(angle) + np.cos(harmonics * np.pi * c) * np.cos(angle))
    stiff = float(np.mean(wave.sum(axis=0) > 0))
    yield Statement(
        "2, (4)",
        "coefficients of the wave of contact ratio c (two pairs in contact for the fraction c - 1 of the period)",
        f"(4) with c = {c} is above its mean for the fraction {number(stiff)} of the period",
        abs(stiff - (c - 1)) < 0.01,
        f"the fraction is {c - 1:.1f} to 0.01",
        "(4) is the negative of the wave. First-order widths do not see the sign; what is of second order does. "
        "This program uses the wave itself.",
    )


STATEMENTS: list[Callable[[Runs], Iterator[Statement]]] = [sign_of_the_wave, few_terms]
