"""Tooth numbers of planetary gears that can be assembled: which regions their planets' phases suppress."""

from __future__ import annotations

from typing import Any

import numpy as np

from gearstab.design.judging import regions
from gearstab.design.problem import DesignProblem
from gearstab.design.reasons.tongues import single, whole
from gearstab.floquet.boundaries import boundaries
from gearstab.perturbation import first_order
from gearstab.symmetry import can_couple, deflection_types, natural_modes, phase_step
from gearstab.system import Array

MOST = 400
"""Choices that are gone through, the best ones."""


def phasing(problem: DesignProblem, designs: Array) -> dict[str, Any]:
    """Return of each choice z_s mod N, the regions within reach that its phases forbid, and those found in the ranges.

    What the existence rule forbids to first order is compared with the regions that root finding leaves: a forbidden
    region that is found all the same, by second order, is not listed as suppressed. Nothing for other systems.

    Source: Parker 2009, conclusion 2.
    """
    varied = {item.path for v in problem.variables for item in v.axis.assignments}
    if problem.config.kind != "planetary" or not any(path[0] in ("teeth", "planets", "phases") for path in varied):
        return {}
    steps, suppressed, driven = np.full(len(designs), -1), [""] * len(designs), [""] * len(designs)
    for k, design in enumerate(designs[:MOST]):
        system, spans, _ = single(problem, design)
        step = phase_step(system)
        low, high = whole(spans)
        found = boundaries(system, low, high, regions.TOLERANCE, regions.FLOOR)
        open_ = {t.label for members in found.members for t in members}
        inside = [
            members
            for members, lower, upper in zip(found.members, found.lower, found.upper, strict=True)
            if any(lower < span.high and upper > span.low for span in spans)
        ]
        driven[k] = ", ".join(dict.fromkeys(t.label for members in inside for t in members))
        if step is not None:
            steps[k] = step
            suppressed[k] = ", ".join(label for label in forbidden(system, step, low, high) if label not in open_)
    return {"phase_step": steps, "suppressed": suppressed, "driven": driven}


def forbidden(system: Any, step: int, low: float, high: float) -> list[str]:
    """Labels of the regions rooted between two mesh frequencies that the existence rule forbids, by frequency."""
    modes, order = natural_modes(system), system.symmetries[0].order
    types = deflection_types(system, modes)
    known = first_order(system, regions.harmonics(system, low))
    found = []
    for tongue, center in zip(known.index, np.ravel(known.center_frequency), strict=True):
        pair = int(types[tongue.mode_p - 1]), int(types[tongue.mode_q - 1])
        if not low <= center <= high or min(pair) < 0:
            continue
        if not can_couple(order, step, tongue.harmonic, *pair):
            found.append((float(center), tongue.label))
    return [label for _, label in sorted(found)]
