"""From finished blocks to the result file. Run as a module it writes a large one, in a process of its own."""

from __future__ import annotations

import errno
import os
import pickle
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gearstab import interrupts
from gearstab.config import Axis, Config
from gearstab.config.sections.targets import INPUT_SPEED, MESH_FREQUENCY, TargetError, resolve
from gearstab.floquet.kernel import choice as kernel
from gearstab.methods import Key
from gearstab.results.chunks import decode, encode
from gearstab.results.guard import SWEEP
from gearstab.results.output import Look, move
from gearstab.results.provenance import modes_group, root_attributes
from gearstab.results.tree import Chunked, Field, Group, Offset, ResultTree
from gearstab.results.units import in_units_of
from gearstab.results.variables import OCCURRENCE, TEXT, TONGUE, Variable, coordinate
from gearstab.results.write import write_on_disk, write_result
from gearstab.sweep import teeth
from gearstab.sweep.compute import moved
from gearstab.sweep.earlier import origin
from gearstab.sweep.parts import Finished
from gearstab.sweep.plan import Layout, Plan
from gearstab.systems import model_of

IN_MEMORY = 1 << 28
"""Results of fewer bytes are built in memory."""


def result_tree(plan: Plan, finished: Mapping[str, Finished], out: Path) -> ResultTree:
    """The whole result, which is to stand at ``out``; ``finished`` has all blocks by key."""
    axes = [field for axis in plan.config.axes for field in axis_fields(axis, plan.config)]
    ran = {name for part in finished.values() for name in part.kernels}
    root = Group(tuple(axes), root_attributes(SWEEP, plan.config, kernel.said(ran)) | origin(plan.config, out))
    groups = {"modes": modes_group(plan.base)}
    for layout in plan.layouts:
        names = set(layout.dims)
        beside = [
            field for axis in plan.config.axes if axis.name in names for field in axis_fields(axis, plan.config)[1:]
        ]
        groups[layout.method.name] = _method_group(plan, layout, finished, beside)
    if plan.teeth is not None:
        groups[teeth.NAME] = teeth.group(plan.teeth)
    return ResultTree(root, groups)


def axis_fields(axis: Axis, config: Config) -> list[Field]:
    """The coordinate of an axis and, for an axis of cases, one more for each parameter that its cases set."""
    text = isinstance(axis.values, list)
    own = coordinate(axis.name, axis.name, TEXT if text else "f8", axis.units, axis.long_name)
    factors = [item.factor for item in axis.assignments if item.path == MESH_FREQUENCY]
    if axis.name == INPUT_SPEED and factors:
        own = replace(own, attributes={"mesh_frequency_factor": factors[0]})
    fields = [Field(own, axis.values)]
    if text:
        for item in axis.assignments:
            name = dotted(item.path, config.parameters)
            if name == axis.name:
                continue
            values = [str(value) for value in item.values] if item.structural else item.values
            kind = TEXT if item.structural else "f8"
            fields.append(Field(coordinate(name, axis.name, kind, *units_and_name(name, config)), values))
    return fields


def units_and_name(name: str, config: Config) -> tuple[str, str]:
    """The unit of a parameter and what it is; a name that says nothing to the kind of system stands for itself."""
    try:
        (target,) = resolve(name, model_of(config.parameters), config.parameters)
    except TargetError:
        return "1", name
    return target.unit, target.title


def dotted(path: tuple[str | int, ...], parameters: object) -> str:
    """A path into the parameters as one writes it: meshes by name."""
    words = []
    for part in path:
        parameters = parameters[part] if isinstance(parameters, dict | list) and path != ("mesh_frequency",) else None  # type: ignore[index]
        named = isinstance(part, int) and isinstance(parameters, dict) and "name" in parameters
        words.append(str(parameters["name"]) if named and isinstance(parameters, dict) else str(part))
    return ".".join(words)


def _method_group(plan: Plan, layout: Layout, finished: Mapping[str, Finished], beside: list[Field]) -> Group:
    parts = {block.key: finished[block.key] for block in layout.blocks()}
    tongues = layout.method.unite(part.tongues for part in parts.values())
    values = {**tongue_coordinates(tongues), **layout.method.constants()}
    fields = []
    for variable in in_units_of(plan.base, layout.method.variables()):
        resolved = variable.over(plan.grid, plan.rows)
        if variable.coordinate:
            if variable.name in values:
                fields.append(Field(resolved, values[variable.name]))
        elif "tongue" not in variable.dims:
            fields.append(Field(resolved, _over_points(plan, layout, variable, parts)))
        else:
            fields.append(Field(resolved, _over_tongues(layout, variable, parts, tongues)))
    return Group((*fields, *beside), layout.method.attributes())


def tongue_coordinates(index: Sequence[Key]) -> dict[str, list[Any]]:
    """Return the coordinates of the dimension ``tongue``."""
    found = {variable.name: [getattr(tongue, variable.name) for tongue, _ in index] for variable in TONGUE}
    return found | {OCCURRENCE.name: [occurrence for _, occurrence in index]}


def _over_points(plan: Plan, layout: Layout, variable: Variable, parts: Mapping[str, Finished]) -> Chunked:
    """A variable of one chunk a block."""
    constants = layout.method.constants()
    rest = tuple(len(constants[dim]) for dim in variable.dims if dim in constants)

    def pieces() -> Iterator[tuple[Offset, bytes]]:
        for block in layout.blocks():
            yield block.start + (0,) * len(rest), parts[block.key].pieces(variable.name)[0]

    return Chunked(layout.shape + rest, layout.chunk + rest, pieces, sum(p.size(variable.name) for p in parts.values()))


def _over_tongues(
    layout: Layout, variable: Variable, parts: Mapping[str, Finished], tongues: tuple[Key, ...]
) -> Chunked:
    """A variable of one chunk a tongue and block."""
    sides = (2,) if "side" in variable.dims else ()
    shape = (1, *sides, *layout.chunk)
    place = {tongue: k for k, tongue in enumerate(tongues)}

    def pieces() -> Iterator[tuple[Offset, bytes]]:
        for block in layout.blocks():
            part = parts[block.key]
            index = np.array([place[tongue] for tongue in part.tongues], dtype=int)
            for k, data in zip(index, part.pieces(variable.name), strict=True):
                if variable.index_of == "tongue":
                    data = encode(moved(decode(data, shape, variable.dtype), index).astype(variable.dtype), shape)
                yield (int(k), *(0 for _ in sides), *block.start), data

    size = sum(part.size(variable.name) for part in parts.values())
    return Chunked((len(tongues), *sides, *layout.shape), shape, pieces, size)


def write(plan: Plan, finished: Mapping[str, Finished], out: Path, folder: Path, look: Look) -> None:
    """Write the result to ``out``; ``folder`` holds the part files.

    look: raises where ``out`` must not be replaced any more. Raises OSError, whatever else is in the way.
    """
    tree = result_tree(plan, finished, out)
    if tree.size < IN_MEMORY:
        write_result(out, tree, look)
        return
    temporary = folder / f"result-{os.getpid()}.tmp"
    interrupts.temporary.add(str(temporary))
    try:
        write_apart(plan, finished, out, temporary)
        move(temporary, out, look)
    finally:
        temporary.unlink(missing_ok=True)
        interrupts.temporary.discard(str(temporary))


def write_apart(plan: Plan, finished: Mapping[str, Finished], out: Path, path: Path) -> None:
    """Write a large result in a process of its own: on a full disk HDF5 may crash even if the error is caught."""
    command = [sys.executable, "-c", "from gearstab.sweep.merge import main; main()", str(path)]
    # Its own session: an interrupt from the terminal is handled here.
    child = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True)
    try:
        _, said = child.communicate(pickle.dumps((plan, dict(finished), out)))
    except BaseException:
        child.kill()
        child.wait()
        raise
    if child.returncode == 0:
        return
    last = said.decode(errors="replace").strip().rpartition("\n")[2]
    number, _, message = last.partition(" ") if child.returncode == 1 else ("", "", "")
    raise OSError(
        int(number) if number.isdigit() else errno.EIO,
        os.strerror(int(number)) if number.isdigit() else message or "the process that writes it ended unexpectedly",
        str(out),
    )


def main() -> None:
    """In a process of its own: write the plan and the parts that standard input names to the path in the arguments."""
    parent = os.getppid()
    plan, finished, out = pickle.load(sys.stdin.buffer)
    interrupts.end_with(parent)
    try:
        write_on_disk(Path(sys.argv[1]), result_tree(plan, finished, out))
    except OSError as error:
        sys.stderr.write(f"\n{error.errno or errno.EIO} {' '.join(str(error).split())}\n")
        sys.stderr.flush()
        # Not through the clean-up of the HDF5 library.
        os._exit(1)
