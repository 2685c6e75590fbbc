"""From finished blocks to the result file, and to what is said of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from gearstab.config import Axis, Config
from gearstab.config.sections import INPUT_SPEED
from gearstab.methods import Key
from gearstab.results.display import ASIDE, CYCLES, FACTOR, FREQUENCY, OPERATING_RANGE, SPEEDS, in_units_of, typed
from gearstab.results.hdf5 import decode, encode
from gearstab.results.output import Look
from gearstab.results.provenance import modes_group, root_attributes
from gearstab.results.read import SWEEP
from gearstab.results.tree import Chunked, Encoded, Field, Group, Offset, ResultTree, octets
from gearstab.results.variables import OCCURRENCE, TEXT, TONGUE, Variable, coordinate
from gearstab.results.write import write_result
from gearstab.sweep.compute import moved
from gearstab.sweep.plan import Layout, VariableLayout, tooth_group
from gearstab.sweep.storage.parts import FinishedBlock
from gearstab.sweep.storage.previous import origin
from gearstab.sweep.storage.store import Store
from gearstab.system import Array


@dataclass(frozen=True)
class RegionSearches:
    """Assumptions of searches for all regions of systems rest on.

    step: largest distance of samples in what is neither proved nor counted, relative; 0 where everything is. coarse:
    systems that were sampled there in equal steps only. proved, counted: shares of the stable mesh frequencies that are
    proved stable, and that are searched by counting only, means of all rows; None where no method tells, or nothing is
    stable.
    """

    systems: int
    step: float
    coarse: int
    proved: float | None = None
    counted: float | None = None


@dataclass(frozen=True)
class Summary:
    """Summary of a sweep.

    points: of the grid. blocks, reused: blocks of all methods, and how many of them an earlier run had finished.
    unstable, failed: points that are unstable (None without a method that tells), and that could not be computed.
    flags: by method, how many points carry each flag of ``status``. complete: whether the result was there already.
    searches: by method, what its searches for regions rest on.
    certified: share of the mesh frequencies that has certificates, None without any.
    """

    points: int
    blocks: int
    reused: int = 0
    unstable: int | None = None
    failed: int = 0
    flags: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    complete: bool = False
    searches: Mapping[str, RegionSearches] = field(default_factory=dict)
    certified: float | None = None


def result_tree(store: Store, attributes: Mapping[str, str]) -> ResultTree:
    """The whole result of a plan of which all is finished; ``attributes``: further ones of its root."""
    plan = store.plan
    axes = {axis.name: [with_range(field, plan.config) for field in axis_fields(axis)] for axis in plan.config.axes}
    # Motions along branches have a mesh frequency each, and groups inherit no axis of that name.
    varies = any(v.name == FREQUENCY for layout in plan.layouts for v in layout.method.variables())
    named = {FREQUENCY} & {*axes} if varies else set()
    own = {name: fields if name in named else fields[1:] for name, fields in axes.items()}
    inherited = [
        _aside(field) if field.variable.name in named else field for fields in axes.values() for field in fields
    ]
    root = Group(tuple(inherited), root_attributes(SWEEP, plan.config) | dict(attributes))
    groups = {"modes": modes_group(plan.base, plan.mesh_frequencies)}
    for layout in plan.layouts:
        beside = [field for name in axes if name in layout.dims for field in own[name]]
        groups[layout.method.name] = _method_group(store, layout, beside)
    if plan.teeth is not None:
        groups["teeth"] = tooth_group(plan.teeth)
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


def _aside(field: Field) -> Field:
    """The coordinate of an axis as one along another dimension."""
    return replace(field, variable=replace(field.variable, dims=(ASIDE,)))


def with_range(field: Field, config: Config) -> Field:
    """Return an axis of speeds with the cycles in a turn of the input, where they are the same everywhere, and the
    operating ranges that the section ``design`` gives; any other axis as it is.
    """
    name = field.variable.name
    if name not in SPEEDS:
        return field
    cycles, attributes = config.system.cycles_of_input(), dict(field.variable.attributes)
    if cycles is not None and not any("teeth" in item.path for axis in config.axes for item in axis.assignments):
        attributes[CYCLES] = float(cycles)
    if config.design is not None:
        ends = []
        for item in config.design.ranges:
            factor = 1.0 if item.of == name else cycles or 1.0 if item.of == INPUT_SPEED else 1 / (cycles or 1.0)
            ends += [item.low * float(factor), item.high * float(factor)]
        attributes[OPERATING_RANGE] = ends
    return replace(field, variable=replace(field.variable, attributes=attributes))


def _method_group(store: Store, layout: Layout, beside: list[Field]) -> Group:
    plan, parts = store.plan, {block.key: store.blocks[block.key] for block in layout.blocks()}
    tongues = layout.method.unite(part.tongues for part in parts.values())
    values = {**tongue_coordinates(tongues), **layout.method.constants()}
    fields = []
    for variable in in_units_of(plan.base, layout.method.variables()):
        resolved = variable.over(layout.dims, layout.dims)
        if variable.coordinate:
            if variable.name in values:
                fields.append(Field(resolved, values[variable.name]))
        else:
            places, count = _places(variable, parts, tongues)
            fields.append(Field(resolved, _chunked(layout, layout.of(variable), parts, places, count)))
    return Group((*fields, *beside), layout.method.attributes())


def tongue_coordinates(index: Sequence[Key]) -> dict[str, list[Any]]:
    """Return the coordinates of the dimension ``tongue``."""
    found = {variable.name: [getattr(tongue, variable.name) for tongue, _ in index] for variable in TONGUE}
    return found | {OCCURRENCE.name: [occurrence for _, occurrence in index]}


def _places(
    variable: Variable, parts: Mapping[str, FinishedBlock], tongues: tuple[Key, ...]
) -> tuple[dict[str, Array], int]:
    """Where the chunks of each block stand along the list of a variable, and how long that is."""
    if variable.of_parts or not variable.listed:
        found = {key: np.arange(len(part.pieces(variable.name))) for key, part in parts.items()}
        return found, max((len(index) for index in found.values()), default=0)
    place = {tongue: k for k, tongue in enumerate(tongues)}
    return {key: np.array([place[t] for t in part.tongues], dtype=int) for key, part in parts.items()}, len(tongues)


def _chunked(
    layout: Layout, own: VariableLayout, parts: Mapping[str, FinishedBlock], places: Mapping[str, Array], count: int
) -> Chunked:
    """Values of a variable: one chunk a block, or one an entry of the list, and block."""

    def pieces() -> Iterator[tuple[Offset, Encoded]]:
        for block in layout.blocks():
            index = places[block.key]
            for k, data in zip(index, parts[block.key].encoded(own.variable.name), strict=True):
                if own.variable.index_of == "tongue":
                    values = decode(octets(data), own.piece, own.variable.dtype)
                    data = encode(moved(values, index).astype(own.variable.dtype), own.piece)
                yield own.offset(block, int(k)), data

    return Chunked(own.shape_in_file(count), own.chunk_in_file, pieces)


def write(store: Store, out: Path, look: Look) -> None:
    """Write the result to ``out``.

    look: raises where ``out`` must not be replaced any more. Raises OSError, whatever else is in the way.
    """
    attributes = origin(store.plan.config, out)
    if store.plan.taken is not None:
        attributes["extended_from"] = str(store.plan.taken.path)
    write_result(out, result_tree(store, attributes), look)


def summary_of(store: Store, reused: int) -> Summary:
    """Sum up a sweep of which all is finished; reused: blocks that an earlier run had finished."""
    plan = store.plan
    tells = [block for layout in plan.layouts if layout.tells for block in store.of(layout)]
    return Summary(
        plan.points, plan.blocks, reused, sum(block.unstable for block in tells) if tells else None,
        sum(block.failed for block in tells), {layout.method.name: store.flags(layout) for layout in plan.layouts},
        False,
        {layout.method.name: _searches(store, layout) for layout in plan.layouts if layout.gives("sampled_step")},
        _certified(store),
    )  # fmt: skip


def _searches(store: Store, layout: Layout) -> RegionSearches:
    step, coarse = (store.rows(layout, name) for name in ("sampled_step", "coarse"))
    known = (store.rows(layout, name) for name in ("proved_share", "counted_share") if layout.gives(name))
    shares = (float(np.nanmean(own)) if np.isfinite(own).any() else None for own in known)
    return RegionSearches(layout.method.once()[1] * len(step), float(step.max()), int(coarse.sum()), *shares)


def _certified(store: Store) -> float | None:
    found = [store.rows(own, "certified_share") for own in store.plan.layouts if own.gives("certified_share")]
    return float(np.mean(found)) if found else None
