"""Whether a part file says what this sweep could have written: what shows without computing its block again.

A checksum tells damage, not that somebody made the file. So that a result has its shape, its flags their meaning and
no later step fails, everything is looked at but the values of floating-point numbers.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite

import numpy as np

from gearstab.methods import Key
from gearstab.perturbation import Tongue
from gearstab.perturbation.tongues import SELF_EXCITED, kind_of, label_of
from gearstab.results.hdf5 import holds
from gearstab.results.variables import GRID, Variable
from gearstab.results.variables.flags import Flags
from gearstab.sweep.compute import flag_counts
from gearstab.sweep.layout import GridBlock, Layout, VariableLayout
from gearstab.sweep.plan import Plan
from gearstab.sweep.storage.parts import FinishedBlock
from gearstab.system import Array

MOST = np.iinfo(np.int32).max
"""The largest number that a coordinate of regions holds."""
OF_FORMULAS = "w0123456789+-*/.() "
"""Letters of labels."""


def fits(plan: Plan, block: GridBlock, part: FinishedBlock) -> bool:
    """Whether a finished block from elsewhere has the variables, sizes, regions and flags that this one may have."""
    try:
        return _fits(plan, block, part)
    except OSError:
        return False  # its file went meanwhile, or was cut


def _fits(plan: Plan, block: GridBlock, part: FinishedBlock) -> bool:
    layout = plan.layout(block.method)
    table = layout.results
    if part.points != block.points or set(part.variables) != {own.variable.name for own in table}:
        return False
    if not _regions(plan, layout, part.tongues):
        return False
    return all(_sound(own, block, part) for own in table) and _counted(layout, block, part)


def _regions(plan: Plan, layout: Layout, tongues: tuple[Key, ...]) -> bool:
    """Whether a list of regions may be one of this method and system."""
    if tongues and not layout.method.over_tongues:
        return False
    names = set("+".join(mesh.name for mesh in plan.base.meshes).split("+"))
    return len(set(tongues)) == len(tongues) and all(_region(key, plan.base.size, names) for key in tongues)


def _region(key: Key, modes: int, names: set[str]) -> bool:
    tongue, occurrence = key
    numbers = 1 <= tongue.mode_p <= tongue.mode_q <= modes and 0 <= tongue.harmonic <= MOST and 0 <= occurrence <= MOST
    return numbers and isfinite(tongue.frequency_ratio) and set(tongue.mesh.split("+")) <= names and _named(tongue)


def _named(tongue: Tongue) -> bool:
    """Whether kind and label are those of the modes and the harmonic; without a harmonic as far as that shows."""
    p, q, harmonic = tongue.mode_p, tongue.mode_q, tongue.harmonic
    if tongue.kind == SELF_EXCITED:
        return (p, harmonic, tongue.label) == (q, 0, f"mode {p} self-excited")
    if harmonic:
        own = label_of(p, q, harmonic, tongue.difference)
        label = tongue.label in (own, f"{own} ({tongue.mesh})")
    else:
        label = f"w{p}" in tongue.label and f"w{q}" in tongue.label and set(tongue.label) <= set(OF_FORMULAS)
    return label and not (tongue.difference and p == q) and tongue.kind == kind_of(p, q, harmonic, tongue.difference)


def _sound(own: VariableLayout, block: GridBlock, part: FinishedBlock) -> bool:
    """Whether a variable has the pieces, of the size, and with the values that it can have."""
    variable = own.variable
    pieces = part.pieces(variable.name)
    many = len(part.tongues) if "tongue" in variable.dims else max(1, len(pieces)) if variable.of_parts else 1
    if len(pieces) != many:
        return False
    if not all(holds(data, own.piece_bytes) for data in pieces):
        return False
    if variable.of_parts and "side" in variable.dims:
        return _ascend(own.decoded(data, block) for data in pieces)
    if variable.dtype[0] in "fc":
        return True
    return all(_allowed(variable, own.decoded(data, block), len(part.tongues)) for data in pieces)


def _ascend(stretches: Iterator[Array]) -> bool:
    """Whether stretches, lower and upper ends ``(2, ...)``, follow one another in every row, and the last is of some.

    Else the dimension could be of any length, of the same few bytes again and again.
    """
    last = np.array(-np.inf)
    for number, (lower, upper) in enumerate(stretches):
        there = np.isfinite(lower)
        if (number and not there.any()) or np.any((lower < last) | (upper < lower)):
            return False
        last = np.where(there, upper, last)
    return True


def _allowed(variable: Variable, values: Array, tongues: int) -> bool:
    """Whether integers are among those that a variable can have: flags, positions in a list, and else numbers of."""
    said = variable.attributes
    if variable.index_of == "tongue":
        return bool(((values >= -1) & (values < tongues)).all())
    if flags := Flags.of(said):
        return not int(np.bitwise_or.reduce(values, axis=None)) & ~flags.every
    if "flag_values" in said:
        return bool(np.isin(values, said["flag_values"]).all())
    return bool(((values >= 0) | (values == variable.fill)).all())


def _counted(layout: Layout, block: GridBlock, part: FinishedBlock) -> bool:
    """Whether a part counts the unstable points, those that failed and the flags that it holds."""
    over_points = {
        variable.name: layout.of(variable).decoded(part.pieces(variable.name)[0], block)
        for variable in layout.method.results
        if variable.dims == (GRID,) or (variable.name == "status" and GRID in variable.dims)
        if variable.name in ("stable", "status")
    }
    stable = over_points.get("stable", np.zeros(0))
    counts = int(np.count_nonzero(stable == 0)), int(np.count_nonzero(stable < 0))
    return counts == (part.unstable, part.failed) and flag_counts(layout, over_points) == dict(part.flags)
