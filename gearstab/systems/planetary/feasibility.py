"""Whether the planets of a gear can be assembled."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice, product
from typing import Any

import numpy as np

from gearstab.config.document.tree import Document
from gearstab.config.model.axes import Grid
from gearstab.config.model.conflicts import Conflict, plain_number
from gearstab.systems.planetary.angles import ASSEMBLE, misfit

MOST_PLANETS = 30
MOST_SHIFTED = 6
"""Teeth of the ring beyond or below z_s + 2 z_p. Each two of them put the centre distances of standard teeth a module
apart, which profile shifts must make up for; teeth become pointed or undercut where they add up to some 3 modules."""
OF_ASSEMBLY = ("teeth", "planets", "angles")
"""Keys that decide it."""
MOST_ASSEMBLIES = 100_000
"""Points of a grid of teeth that are looked at."""


def check_assembly(document: Document, grid: Grid[Any]) -> None:
    """Report the first point of the grid, over axes of OF_ASSEMBLY, at which the gear cannot be assembled."""
    axes = [axis for axis in grid.axes if any(item.path[0] in OF_ASSEMBLY for item in axis.assignments)]
    if grid.system.teeth is None:
        return
    for places in islice(product(*(range(axis.size) for axis in axes)), MOST_ASSEMBLIES):
        at = {axis.name: np.array(k) for axis, k in zip(axes, places, strict=True)}
        p = grid.at(at)
        sun, planet, ring = int(p.teeth.sun), int(p.teeth.planet), int(p.teeth.ring)
        wrong = next(assembly(sun, planet, ring, int(p.planets), p.angles), None)
        if wrong is not None and not axes:
            path, code, message, hint = wrong
            document.report(("system", *path), code, message, hint)
        elif wrong is not None:
            values = ", ".join(f"{axis.name} = {axis.values[k]}" for axis, k in zip(axes, places, strict=True))
            hint = "tie teeth.sun, teeth.planet and teeth.ring to one axis, or let gearstab design go through them"
            numbers = f"z_s, z_p, z_r = {sun}, {planet}, {ring} with {p.planets} planets"
            said = f"cannot be assembled at {values}: {numbers}"
            document.report(("sweep", axes[0].name), "impossible", said, hint)
            return


def assembly(sun: int, planet: int, ring: int, planets: Any, angles: Sequence[Any] | None = None) -> Iterator[Conflict]:
    """Yield what keeps teeth from fitting into each other, and planets at equal or given angles between them."""
    if shifted_too_far(sun, planet, ring):
        standard = sun + 2 * planet
        message = f"is more than {MOST_SHIFTED} teeth from z_s + 2 z_p = {standard}, too many for profile shifts"
        yield ("teeth", "ring"), "inconsistent", message, f"give {standard} teeth, or a number close to it"
    elif angles is not None:
        if number := misfit(sun, ring, angles):
            step = 360 / (sun + ring)
            message = f"the teeth of planet {number} do not fit: angles are multiples of 360 deg/(z_s + z_r)"
            near = step * round(np.degrees(float(angles[number - 1] - angles[0])) / step)
            hint = f'give "{near:.7g} deg" from the first one, or write angles: {ASSEMBLE}'
            yield ("angles",), "inconsistent", message, hint
    elif whole(planets, 3, MOST_PLANETS) and (sun + ring) % int(planets):
        possible = [str(k) for k in range(3, MOST_PLANETS + 1) if (sun + ring) % k == 0]
        remedy = f"write angles: {ASSEMBLE}, or change the teeth"
        remedy += f", or take one of planets: {', '.join(possible)}" if possible else ""
        message = f"{planets} equally spaced planets cannot be assembled: (z_s + z_r)/N = {sun + ring}/{planets}"
        yield ("teeth",), "inconsistent", f"{message} is no integer", remedy


def shifted_too_far(sun: int, planet: int, ring: int) -> bool:
    """Whether no profile shifts let the planets mesh with both."""
    return abs(ring - sun - 2 * planet) > MOST_SHIFTED


def clear_of_each_other(sun: int, planet: int, ring: int, angles: Sequence[Any]) -> bool:
    """Whether the tips of neighbouring planets stay apart, with an addendum of one module.

    (z_s + z_r)/2 sin(gap/2) > z_p + 2, the gap between neighbours being 2 pi/N where they are equally spaced; the
    centre distance is (z_s + z_r)/4 modules.
    """
    psi = np.sort(np.array([float(angle) for angle in angles]))
    gaps = np.diff([*psi, psi[0] + 2 * np.pi])
    return bool((sun + ring) / 2 * np.sin(min(gaps) / 2) > planet + 2)


def whole(value: Any, low: int, high: int) -> bool:
    """Return whether a value as written is a whole number within limits."""
    number = plain_number(value)
    return number is not None and low <= number <= high and number.is_integer()
