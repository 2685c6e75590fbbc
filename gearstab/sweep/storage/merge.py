"""From finished blocks to the result file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gearstab.config import Axis, Config
from gearstab.config.sections.targets import INPUT_SPEED
from gearstab.methods import Key
from gearstab.results.chunks import decode, encode
from gearstab.results.display import ASIDE, FACTOR, FREQUENCY, OPERATING_RANGE, SPEEDS, typed
from gearstab.results.guard import SWEEP
from gearstab.results.output import Look
from gearstab.results.provenance import modes_group, root_attributes
from gearstab.results.tree import Chunked, Encoded, Field, Group, Offset, ResultTree, octets
from gearstab.results.units import in_units_of
from gearstab.results.variables import OCCURRENCE, TEXT, TONGUE, Variable, coordinate
from gearstab.results.write import write_result
from gearstab.sweep import teeth
from gearstab.sweep.compute import inner_shape, moved
from gearstab.sweep.plan import Layout
from gearstab.sweep.storage.earlier import origin
from gearstab.sweep.storage.parts import FinishedBlock
from gearstab.sweep.storage.store import Finished
from gearstab.system import Array


def result_tree(finished: Finished, said: Mapping[str, str]) -> ResultTree:
    """The whole result of a plan of which all is finished; ``said``: what its root says besides."""
    plan = finished.plan
    axes = {axis.name: _fields(axis, plan.config) for axis in plan.config.axes}
    # Motions along branches have a mesh frequency each, and groups inherit no axis of that name.
    varies = any(v.name == FREQUENCY for layout in plan.layouts for v in layout.method.variables())
    named = {FREQUENCY} & {*axes} if varies else set()
    own = {name: fields if name in named else fields[1:] for name, fields in axes.items()}
    inherited = [
        _aside(field) if field.variable.name in named else field for fields in axes.values() for field in fields
    ]
    root = Group(tuple(inherited), root_attributes(SWEEP, plan.config) | dict(said))
    groups = {"modes": modes_group(plan.base)}
    for layout in plan.layouts:
        beside = [field for name in axes if name in layout.dims for field in own[name]]
        groups[layout.method.name] = _method_group(finished, layout, beside)
    if plan.teeth is not None:
        groups[teeth.NAME] = teeth.group(plan.teeth)
    return ResultTree(root, groups)


def axis_fields(axis: Axis) -> list[Field]:
    """The coordinate of an axis and, for an axis of cases, one more for each parameter that its cases set."""
    text = isinstance(axis.values, list)
    own = coordinate(axis.name, axis.name, TEXT if text else "f8", axis.units, axis.long_name)
    attributes = typed(axis.typed_units, axis.units)
    if axis.name == INPUT_SPEED and axis.mesh_frequency:
        attributes |= {FACTOR: axis.mesh_frequency.factor}
    own = replace(own, attributes=attributes)
    fields = [Field(own, axis.values)]
    if text:
        for item in axis.assignments:
            if item.name == axis.name:
                continue
            values = [str(value) for value in item.values] if item.structural else item.values
            kind = TEXT if item.structural else "f8"
            fields.append(Field(coordinate(item.name, axis.name, kind, item.units, item.title), values))
    return fields


def _fields(axis: Axis, config: Config) -> list[Field]:
    """The coordinates of an axis, with the ranges of operation."""
    return [with_range(field, config) for field in axis_fields(axis)]


def _aside(field: Field) -> Field:
    """The coordinate of an axis as one along another dimension."""
    return replace(field, variable=replace(field.variable, dims=(ASIDE,)))


def with_range(field: Field, config: Config) -> Field:
    """Return an axis of speeds with the operating ranges that the section ``design`` gives, any other as it is."""
    name = field.variable.name
    if config.design is None or name not in SPEEDS:
        return field
    cycles = float(config.system.cycles_of_input() or 1.0)
    ends = []
    for item in config.design.ranges:
        factor = 1.0 if item.of == name else cycles if item.of == INPUT_SPEED else 1 / cycles
        ends += [item.low * factor, item.high * factor]
    attributes = {**field.variable.attributes, OPERATING_RANGE: ends}
    return replace(field, variable=replace(field.variable, attributes=attributes))


def _method_group(finished: Finished, layout: Layout, beside: list[Field]) -> Group:
    plan, parts = finished.plan, {block.key: finished.blocks[block.key] for block in layout.blocks()}
    tongues = layout.method.unite(part.tongues for part in parts.values())
    values = {**tongue_coordinates(tongues), **layout.method.constants()}
    fields = []
    for variable in in_units_of(plan.base, layout.method.variables()):
        resolved = variable.over(layout.dims, layout.dims)
        if variable.coordinate:
            if variable.name in values:
                fields.append(Field(resolved, values[variable.name]))
        elif not variable.listed:
            fields.append(Field(resolved, _over_points(layout, variable, parts)))
        else:
            places, count = _places(variable, parts, tongues)
            fields.append(Field(resolved, _listed(layout, variable, parts, places, count)))
    return Group((*fields, *beside), layout.method.attributes())


def tongue_coordinates(index: Sequence[Key]) -> dict[str, list[Any]]:
    """Return the coordinates of the dimension ``tongue``."""
    found = {variable.name: [getattr(tongue, variable.name) for tongue, _ in index] for variable in TONGUE}
    return found | {OCCURRENCE.name: [occurrence for _, occurrence in index]}


def _over_points(layout: Layout, variable: Variable, parts: Mapping[str, FinishedBlock]) -> Chunked:
    """A variable of one chunk a block."""
    rest = layout.inner(variable)

    def pieces() -> Iterator[tuple[Offset, Encoded]]:
        for block in layout.blocks():
            yield block.start + (0,) * len(rest), parts[block.key].encoded(variable.name)[0]

    return Chunked(layout.shape + rest, layout.chunk + rest, pieces)


def _places(
    variable: Variable, parts: Mapping[str, FinishedBlock], tongues: tuple[Key, ...]
) -> tuple[dict[str, Array], int]:
    """Where the chunks of each block stand along the variable's first dimension, and how long that is."""
    if variable.of_parts:
        found = {key: np.arange(len(part.pieces(variable.name))) for key, part in parts.items()}
        return found, max((len(index) for index in found.values()), default=0)
    place = {tongue: k for k, tongue in enumerate(tongues)}
    return {key: np.array([place[t] for t in part.tongues], dtype=int) for key, part in parts.items()}, len(tongues)


def _listed(
    layout: Layout, variable: Variable, parts: Mapping[str, FinishedBlock], places: Mapping[str, Array], count: int
) -> Chunked:
    """A variable of one chunk a tongue, or stretch, and block."""
    sides, rest = (2,) if "side" in variable.dims else (), inner_shape(layout, variable)
    shape = (1, *sides, *layout.chunk, *rest)

    def pieces() -> Iterator[tuple[Offset, Encoded]]:
        for block in layout.blocks():
            index = places[block.key]
            for k, data in zip(index, parts[block.key].encoded(variable.name), strict=True):
                if variable.index_of == "tongue":
                    data = encode(
                        moved(decode(octets(data), shape, variable.dtype), index).astype(variable.dtype), shape
                    )
                yield (int(k), *(0 for _ in sides), *block.start, *(0 for _ in rest)), data

    return Chunked((count, *sides, *layout.shape, *rest), shape, pieces)


def write(finished: Finished, out: Path, look: Look) -> None:
    """Write the result to ``out``.

    look: raises where ``out`` must not be replaced any more. Raises OSError, whatever else is in the way.
    """
    said = origin(finished.plan.config, out)
    if finished.plan.taken is not None:
        said["extended_from"] = str(finished.plan.taken.path)
    write_result(out, result_tree(finished, said), look)
