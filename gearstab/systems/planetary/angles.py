"""Angles of the planets: equal ones, given ones, or the nearest to equal ones at which all teeth fit."""

from __future__ import annotations

from collections.abc import Sequence
from math import floor, tau
from typing import Any

import numpy as np

from gearstab.config.document.tree import Document, mapping
from gearstab.system import Array

ASSEMBLE = "assemble"
"""Written in place of the angles: the nearest to equal ones that can be assembled."""
FIT = 1e-3
"""Parts of the least turn between two places of a planet by which a typed angle may be off one of them."""


def angles_of(planets: Any, given: Sequence[Any] | None) -> list[Array]:
    """Return psi_1..psi_N, any of which may have a batch shape: those given, or 2 pi (n - 1)/N of N planets."""
    if given is None:
        return [np.asarray(tau * n / int(planets)) for n in range(int(planets))]
    return [np.asarray(angle, dtype=float) for angle in given]


def nearest(sun: int, ring: int, planets: int) -> list[float]:
    """Return the angles nearest to equal ones at which the teeth of all planets fit between sun and ring.

    A planet fits at every multiple of 2 pi/(z_s + z_r) from the first one: turning sun and ring from one place of
    their teeth to the next, against each other, moves it by one such step. Halves are rounded up, which leaves planets
    of even number diametrically opposite.

    Source: Lin & Parker 2000 (J. Sound Vib. 233, 921-928), where the step is the least mesh angle.
    """
    places = sun + ring
    return [tau * floor(places * n / planets + 0.5) / places for n in range(planets)]


def misfit(sun: int, ring: int, angles: Sequence[Any]) -> int | None:
    """Return the number, from 1, of the first planet whose teeth do not fit; None where all do."""
    steps = [float(angle - angles[0]) * (sun + ring) / tau for angle in angles]
    return next((n for n, step in enumerate(steps, start=1) if abs(step - round(step)) > FIT), None)


def complete(document: Document, raw: dict[str, Any]) -> None:
    """Write out the ring's teeth and the angles that are to be assembled, in the section as written.

    z_r = z_s + 2 z_p, as the planets' centres are at one distance from the axis.
    """
    teeth: Any = raw.get("teeth")
    place = document.where(("system", "teeth"))
    if _counts(teeth, "sun", "planet"):
        document.fill(("system", "teeth", "ring"), teeth["sun"] + 2 * teeth["planet"], place)
    if raw.get("angles") != ASSEMBLE:
        return
    if not _counts(teeth, "sun", "ring") or not _counts(raw, "planets"):
        hint = "add teeth: {sun: .., planet: ..}, or give the angles"
        document.report(("system", "angles"), "needs_other", "needs the numbers of teeth", hint)
        del raw["angles"]
        return
    numbers = teeth["sun"], teeth["ring"], raw["planets"]
    if sum(numbers[:2]) % numbers[2]:
        document.put(("system", "angles"), nearest(*numbers), document.where(("system", "angles")))
    else:
        del raw["angles"]  # equal ones, which leave the gear its symmetry


def _counts(section: Any, *keys: str) -> bool:
    """Whether the keys of a section as written have positive whole numbers."""
    return all(type(number) is int and number > 0 for number in map(mapping(section).get, keys))
