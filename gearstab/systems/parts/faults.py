"""Weak teeth: a crack or a pit makes a mesh softer whenever the pair of that tooth carries, once in a revolution.

    k(t) = sum_j k_pair(x - j) (1 - (1 - q) [j = 0 mod z])

The part that is missing is a mesh of its own along the same direction, with the frequency r/z of its gear, so that
stability over the common period is as exact as ever. All else of the mesh stays: damping, mesh force of healthy teeth.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from gearstab.config.document.problems import nearest
from gearstab.config.model.conflicts import Conflict, items, within_each
from gearstab.config.model.fields import Choice, NameText, Section, Whole
from gearstab.config.model.reading import WRONG
from gearstab.config.model.units import Quantity
from gearstab.mesh import Mesh
from gearstab.system import Array
from gearstab.systems.parts.forcing import GearError
from gearstab.systems.parts.weak_tooth import OnePair, equal_shares, missing, over_the_width, own_pairs
from gearstab.waveforms import Tooth, ToothPair

KINDS_OF_FAULT = ("crack", "pit")


class Fault(Section):
    """A weak tooth of a gear in a mesh."""

    gear: NameText
    """Name of the gear that has it."""
    tooth: Annotated[int, Field(ge=1), Whole] = Field(default=1, title="number of the tooth")
    """Tooth 1 enters at the start of the mesh's wave, 2 next."""
    kind: Annotated[str, Choice("fault", KINDS_OF_FAULT)] = Field(default="crack", title="kind of fault")
    """crack or pit; a crack of a planet's tooth weakens its meshes with sun and ring, a pit one."""
    factor: Annotated[float, Field(gt=0, lt=1), Quantity()] = Field(title="stiffness factor")
    """q: stiffness of its pair over that of a healthy one (1)."""

    def conflicts(self, gears: Sequence[str], teeth: Mapping[str, Fraction | None]) -> Iterator[Conflict]:
        """A gear of the mesh, and a tooth that it has. gears, teeth: as in :func:`fault_conflicts`."""
        yield from absent_gear(self, gears)
        count = teeth.get(self.gear)
        if count is not None and self.tooth > count:
            yield ("tooth",), "out_of_range", f"gear '{self.gear}' has {count} teeth", f"write 1 to {count}"


def fault_conflicts(section: Any, gears: Sequence[str], teeth: Mapping[str, Fraction | None]) -> Iterator[Conflict]:
    """Yield faults of gears that are not in a mesh, of teeth that there are not, and what faults exclude.

    gears: those of the mesh. teeth: their numbers of teeth, by name, None where there are none.
    """
    faults = items(section.faults)
    yield from within_each(section, "faults", lambda fault: fault.conflicts(gears, teeth))
    if not together([fault for _, fault in faults]):
        message = "leave the pair without stiffness where both weak teeth meet"
        yield ("faults",), "out_of_range", message, "give factors whose losses 1 - factor add up to less than 1"
    if faults:
        yield from excluded(section, ("friction", "backlash", "relief"), "faults of the teeth")


def absent_gear(item: Fault | GearError, gears: Sequence[str]) -> Iterator[Conflict]:
    """Yield a conflict where ``gear`` of a section names none of the gears of a mesh."""
    names = [name for _, name in items(gears)]
    if item.gear is not WRONG and item.gear not in names:
        yield ("gear",), "unknown_name", f"'{item.gear}' is no gear of this mesh", nearest(item.gear, names)


def excluded(section: Any, keys: Sequence[str], other: str) -> Iterator[Conflict]:
    """Yield a conflict for each key that is given and does not go with another part of the section."""
    for key in keys:
        value = getattr(section, key, None)
        if value is not WRONG and value:
            yield (key,), "not_applicable", f"is not available with {other}", "keep one of the two"


def together(faults: Sequence[Fault]) -> bool:
    """Return whether the teeth that may meet in one pair, one of each gear, leave a positive stiffness."""
    worst: dict[str, float] = {}
    for fault in faults:
        if fault.gear is not WRONG and fault.factor is not WRONG:
            worst[fault.gear] = max(worst.get(fault.gear, 0.0), 1 - fault.factor)
    return len(worst) < 2 or sum(worst.values()) < 1


def weak_tooth(
    mesh: Mesh,
    name: str,
    teeth: int,
    factor: Any,
    contact_ratio: Array,
    cycles: Any,
    one_pair: OnePair | None = None,
    overlap: Array | float = 0.0,
) -> Mesh:
    """Return the stiffness that a mesh lacks while its weak pair carries, as a mesh that is part of it.

    teeth: z of the gear that has the fault. factor: q. cycles: how many cycles after the start of the wave of the mesh
    the weak pair enters first. one_pair: the stiffness of one pair of teeth of the transverse section where it is
    known, else pairs share that of the mesh equally; with it overlap: the overlap ratio of helical teeth.
    """
    wave, own = mesh.waveform, (mesh.mean_stiffness, mesh.amplitude)
    if one_pair is None:
        one_pair = own_pairs(wave, *own) if isinstance(wave, ToothPair) else equal_shares(wave, contact_ratio, *own)
    course = missing(wave, contact_ratio, teeth, 1 - np.asarray(factor, dtype=float), one_pair)
    lost = Tooth(over_the_width(course, np.asarray(overlap) / teeth))
    ratio, lag = mesh.frequency_ratio / Fraction(teeth), (mesh.lag + cycles) / teeth
    epsilon = lost.amplitude / lost.mean_stiffness
    return Mesh(name, mesh.direction, lost.mean_stiffness, epsilon, lost, ratio, lag, part_of=mesh.name)
