"""Weak teeth: a crack or a pit makes a mesh softer whenever the pair of that tooth carries, once in a revolution.

    k(t) = sum_j k_pair(x - j) (1 - (1 - q) [j = 0 mod z])

The part that is missing is a mesh of its own along the same direction, with the frequency r/z of its gear, so that
stability over the common period is as exact as ever. All else of the mesh stays: damping, mesh force of healthy teeth.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from gearstab.config.document.problems import nearest
from gearstab.config.model.conflicts import Conflict, items, plain_number
from gearstab.config.model.fields import Choice, NameText, Quantity, Section, Whole
from gearstab.mesh import Mesh
from gearstab.system import Array
from gearstab.systems.parts.weak_tooth import OnePair, equal_shares, missing, over_the_width, own_pairs
from gearstab.waveforms import Tooth, ToothPair

KINDS_OF_FAULT = ("crack", "pit")


class Fault(Section):
    """A weak tooth of a gear in a mesh."""

    gear: NameText = Field(title="gear", description="Name of the gear that has it.")
    tooth: Annotated[int, Field(ge=1), Whole] = Field(
        default=1, title="number of the tooth", description="Tooth 1 enters at the start of the mesh's wave, 2 next."
    )
    kind: Annotated[str, Choice("fault", KINDS_OF_FAULT)] = Field(
        default="crack",
        title="kind of fault",
        description="crack or pit; a crack of a planet's tooth weakens its meshes with sun and ring, a pit one.",
    )
    factor: Annotated[float, Field(gt=0, lt=1), Quantity()] = Field(
        title="stiffness factor", description="q: stiffness of its pair over that of a healthy one (1)."
    )


def fault_conflicts(raw: dict[str, Any], gears: Sequence[Any], teeth: dict[str, Any]) -> Iterator[Conflict]:
    """Yield faults of gears that are not in a mesh, of teeth that there are not, and what faults exclude.

    gears: those of the mesh. teeth: their numbers of teeth, by name, where they are known.
    """
    faults = items(raw.get("faults"))
    for k, item in faults:
        gear, tooth = item.get("gear"), item.get("tooth", 1)
        if isinstance(gear, str) and gear not in gears:
            yield ("faults", k, "gear"), "unknown_name", f"'{gear}' is no gear of this mesh", nearest(gear, gears)
        count = teeth.get(gear) if isinstance(gear, str) else None
        if type(tooth) is int and type(count) is int and tooth > count:
            yield ("faults", k, "tooth"), "out_of_range", f"gear '{gear}' has {count} teeth", f"write 1 to {count}"
    if faults and not together([item for _, item in faults]):
        message = "leave the pair without stiffness where both weak teeth meet"
        yield ("faults",), "out_of_range", message, "give factors whose losses 1 - factor add up to less than 1"
    for key in ("friction", "backlash", "relief"):
        if faults and raw.get(key):
            yield (key,), "not_applicable", "is not available with faults of the teeth", "keep one of the two"


def together(faults: Sequence[dict[str, Any]]) -> bool:
    """Whether the teeth that may meet in one pair, one of each gear, leave a positive stiffness."""
    worst: dict[Any, float] = {}
    for item in faults:
        factor = plain_number(item.get("factor"))
        gear = item.get("gear")
        if factor is not None and isinstance(gear, str):
            worst[gear] = max(worst.get(gear, 0.0), 1 - factor)
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
