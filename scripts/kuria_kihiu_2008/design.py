"""Effects of module, pressure angle and contact ratio: Figs. 9 to 17."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from gearstab.gears.stress import mesh_root_stress
from kuria_kihiu_2008.common import (
    FINER,
    LONG_TEETH,
    NO_SHIFT,
    STAGES,
    Design,
    of_stages,
    pairs,
    root_stress,
    static_forces,
)
from statements import Runs, Statement, numbers, sort_of

HARMONIC = "transmission_error_first_harmonic"


def changed(after: Design, before: Design, measure: str = HARMONIC) -> np.ndarray:
    """Changes of stages I to IV, in per cent."""
    return np.asarray(100 * (of_stages(after, measure) / of_stages(before, measure) - 1))


def stresses(after: Design, before: Design) -> np.ndarray:
    """``(4, 2)``, change of the largest root stress of pinion and wheel, in per cent."""
    return np.asarray(100 * (root_stress(after) / root_stress(before) - 1))


def span(values: np.ndarray) -> str:
    """From the least to the greatest, in per cent."""
    return f"{values.min():+.0f} to {values.max():+.0f} %"


def module(runs: Runs) -> Iterator[Statement]:
    """Figs. 9 and 10."""
    found = [changed(FINER[m], Design()) for m in FINER]
    yield Statement(
        "Fig. 9", "modules of 3, 2.5 and 2 mm: almost the same vibration, slightly less for mesh I with 2 mm",
        f"first harmonic of the transmission error, I to IV: {numbers(found[0], 2)} % with 2.5 mm, "
        f"{numbers(found[1], 2)} % with 2 mm",
        sort_of(
            bool(np.all(np.abs(found) < 15) and found[1][0] < 0 and abs(found[1][1]) < abs(found[1][0])),
            bool(np.all(np.abs(found) < 25) and found[1][0] < 0),
        ),
        "within 15 %, mesh I falls and II less; in part: within 25 %, mesh I falls",
        "Mesh II falls more than mesh I.",
    )  # fmt: skip
    raised = [stresses(FINER[m], Design()) for m in FINER]
    yield Statement(
        "Fig. 10, conclusion 1", "a smaller module raises the root stress",
        f"{span(raised[0])} with 2.5 mm, {span(raised[1])} with 2 mm", bool(np.all(np.array(raised) > 0)),
        "all rise",
    )  # fmt: skip
    yield Statement(
        "abstract", "a higher module resulted in higher bending stress", f"2 mm: {span(raised[1])}",
        bool(np.all(raised[1] < 0)), "all fall with 2 mm", "Fig. 10 and conclusion 1 of the paper say the opposite.",
    )  # fmt: skip
    yield Statement(
        "conclusion 1", "(the higher stress of a smaller module) and therefore increases gear life",
        f"the stress changes by {span(raised[0])} with 2.5 mm, {span(raised[1])} with 2 mm",
        bool(np.all(np.array(raised) < 0)), "the stress falls", "More stress does not make gears live longer.",
    )  # fmt: skip


def pressure_angle(runs: Runs) -> Iterator[Statement]:
    """Figs. 11 and 12: 25 degrees without profile shift."""
    steep = Design(pressure_angle=25.0, shifts=NO_SHIFT)
    found = changed(steep, Design())
    yield Statement(
        "Fig. 11", "25 instead of 20 degrees: little change of the vibration",
        f"first harmonic of the transmission error, I to IV: {numbers(found, 2)} %", bool(np.all(np.abs(found) < 10)),
        "all within 10 %",
    )  # fmt: skip
    shifted, unshifted = (stresses(steep, other)[[0, 1, 3], 0] for other in (Design(), Design(shifts=NO_SHIFT)))
    yield Statement(
        "Fig. 12, conclusion 2", "the pinion of 14 teeth has lower root stress with 25 than with 20 degrees",
        f"{span(unshifted)} against 20 degrees without profile shift, {span(shifted)} against 20 degrees with x = 0.19",
        sort_of(bool(np.all(shifted < 0)), bool(np.all(unshifted < 0))),
        "lower than those with the shifts chosen here; in part: than those without",
        "The paper does not print its profile shifts; one that avoids interference strengthens the pinion, too.",
    )  # fmt: skip


SAID, SEVERAL = 75.0, 5.0
"""Per cent that the vibration falls "by up to", and what may be meant by it."""


def remarks(design: Design) -> str:
    """Remarks on the teeth for a designer, by stage."""
    found = {
        f"{stage}: {notice.part} {notice.name.replace('_', ' ')} {notice.number:.3f}"
        for stage, pair in zip(STAGES, pairs(design), strict=True)
        for notice in pair.notices
    }
    return ", ".join(sorted(found)) or "none"


def contact_ratio(runs: Runs) -> Iterator[Statement]:
    """Figs. 13 and 14: longer teeth and a working centre distance."""
    for figure, m in (("Fig. 13", 2.0e-3), ("Fig. 14", 2.5e-3)):
        before, after = FINER[m], LONG_TEETH[m]
        ratios = [numbers([pair.contact_ratio for pair in pairs(design)], 4) for design in (before, after)]
        found = changed(after, before)
        lower = bool(np.all(found < 0))
        yield Statement(
            figure, f"module {1e3 * m:g} mm: a contact ratio near 2 reduces the vibration by up to 75 %",
            f"contact ratios {ratios[0]} become {ratios[1]}; first harmonic of the transmission error, I to IV: "
            f"{numbers(found)} %; notices: {remarks(after)}",
            sort_of(lower and bool(np.all(np.abs(found.min() + SAID) < SEVERAL)), lower),
            f"the largest fall within {SEVERAL:g} points of {SAID:g} %; in part: all fall",
            "It falls by more than the paper found; peak to peak, which it may have measured, by "
            f"{numbers(changed(after, before, 'transmission_error_peak_to_peak'))} %.",
        )  # fmt: skip


def jumps(design: Design) -> np.ndarray:
    """``(4, 3)``, per cent of the largest stress, of stages I to IV: the largest change of the root stress of a tooth
    in contact as another pair enters, as one leaves, and from before the one to after the other.
    """
    found = []
    for pair, force in zip(pairs(design), static_forces(design), strict=True):
        # A pair enters at phase 0; the oldest leaves at the fraction of the contact ratio. Columns count pairs from the
        # newest: as a pair enters, that of column k gets column k + 1.
        leaves, little = pair.contact_ratio % 1, 1e-7
        row = np.zeros(3)
        for flank in range(2):
            largest = mesh_root_stress(pair, np.linspace(0, 1, 400), force)[flank].max()
            before, entered, last, left = mesh_root_stress(
                pair, np.array([1 - little, little, leaves - little, leaves + little]), force
            )[flank]
            changes = (entered[1:] - before[:-1], left[:-1] - last[:-1], left[1:-1] - before[:-2])
            row = np.maximum(row, [100 * np.abs(change).max(initial=0.0) / largest for change in changes])
        found.append(row)
    return np.array(found)


def stress_at_two(runs: Runs) -> Iterator[Statement]:
    """Figs. 15 to 17."""
    for figure, m in (("Fig. 15", 2.0e-3), ("Fig. 16", 2.5e-3)):
        before, after = FINER[m], LONG_TEETH[m]
        dropped = stresses(after, before)
        both = (1 + dropped[:, 0] / 100) * of_stages(after, "load_factor_fewest_pairs")
        both = 100 * (both / of_stages(before, "load_factor_fewest_pairs") - 1)
        yield Statement(
            figure, f"a contact ratio of 2 reduces the peak root stress by about 45 % (module {1e3 * m:g} mm)",
            f"static {span(dropped)}; of the pinions times the load factor, I to IV: {numbers(both, 2)} %",
            sort_of(bool(np.all(np.abs(both + 45) < 5)), bool(np.all(dropped < 0))),
            "with the load factor within 5 points of 45 %; in part: all fall",
            "Two pairs share the load, but longer teeth bend more.",
        )  # fmt: skip
    short, long = (np.array([jumps(designs[m]) for m in LONG_TEETH]) for designs in (FINER, LONG_TEETH))
    yield Statement(
        "Figs. 15, 16", "a contact ratio of 2 leaves no discontinuity of the stress",
        f"jumps as a pair enters or leaves, over the largest stress: {span(short.max(axis=-1))} before, "
        f"{span(long.max(axis=-1))} with the ratio of Figs. 13 and 14, of which {span(long[..., 2])} are left when "
        "both have happened",
        sort_of(bool(np.all(long < 2)), bool(np.all(long[..., 2] < 5))),
        "jumps below 2 %; in part: below 5 % are left",
        "A ratio a little above 2 has three pairs for a moment as one enters before another leaves. What is left is "
        "the difference between the shares of a tooth at its tip and at its root.",
    )  # fmt: skip
    coarse, fine = LONG_TEETH[2.5e-3], LONG_TEETH[2.0e-3]
    lower = stresses(coarse, fine)
    yield Statement(
        "Fig. 17", "with a contact ratio of 2, root stresses are lower with a module of 2.5 mm than with 2 mm",
        f"{span(lower)}; pinions, I to IV: {numbers(lower[:, 0], 2)} %, wheels: {numbers(lower[:, 1], 2)} %; notices "
        f"with 2.5 mm: {remarks(coarse)}, with 2 mm: {remarks(fine)}",
        sort_of(bool(np.all(lower < 0)) and remarks(coarse) == remarks(fine) == "none", bool(np.all(lower < 0))),
        "all lower, with teeth that give no notice; in part: all lower",
        "The paper wants top lands of at least 0.3 modules, with which no teeth of 2.5 mm were found that reach 2.",
    )  # fmt: skip


STATEMENTS: tuple[Callable[[Runs], Iterator[Statement]], ...] = (module, pressure_angle, contact_ratio, stress_at_two)
