"""From a configuration to blocks: which part of the grid is computed together, in the order of the result's chunks.

Every method has blocks of its own, hyper-rectangles over the axes of its results. A block is a chunk of the result
file, so that finishing a sweep copies bytes. The division depends on the configuration alone, not on the machine, so
that a sweep can be resumed anywhere.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from math import ceil, prod

import numpy as np

from gearstab import ckernel
from gearstab.config import Axis, Config, alike
from gearstab.config.model import MESH_FREQUENCY
from gearstab.config.readers import check_options
from gearstab.methods import POINTS, Method, chosen
from gearstab.results.hdf5 import decode, encode
from gearstab.results.tree import Group, Offset, fields_of
from gearstab.results.variables import GRID, Variable, flagged
from gearstab.results.variables.responses import TEETH
from gearstab.sweep.storage.previous import Previous
from gearstab.system import Array, GearSystem
from gearstab.version import __version__

USUAL, MOST, PIECES = 1 << 20, 1 << 21, 48
"""Size of a block in points of a small system, and the largest, of a grid that has more than so many of these. Each
block costs some ten milliseconds of its own, whatever its size: as much as the work of 2^17 points; 2^21 are done in a
fraction of a second."""
MOST_BYTES = 1 << 26
"""Size of a block's largest variable."""
FEW = 8
"""Blocks that a grid of few rows is divided into all the same."""
LONGEST = 10**9
"""Cost of a block, half a minute or less, up to which a row of mesh frequencies stays whole."""


@dataclass(frozen=True)
class GridBlock:
    """One piece of work: a hyper-rectangle of a method's grid. start, shape: over the axes of the method's results."""

    method: str
    number: int
    start: tuple[int, ...]
    shape: tuple[int, ...]

    @property
    def key(self) -> str:
        """Its name in files and messages."""
        return f"{self.method}-{self.number:06d}"

    @property
    def points(self) -> int:
        """Number of points of its method's grid."""
        return prod(self.shape)


@dataclass(frozen=True)
class VariableLayout:
    """Arrangement of a variable over a grid ``shape`` in chunks of the shape ``chunk``, one a block.

    Dimensions are, in this order: the list, of a variable that is listed over tongues or parts of the range, each entry
    with a chunk of its own; the sides, if it has them; the axes of the grid; and the ``inner`` ones, which are the same
    everywhere, such as meshes.
    """

    variable: Variable
    shape: tuple[int, ...]
    chunk: tuple[int, ...]
    inner: tuple[int, ...]

    @property
    def sides(self) -> tuple[int, ...]:
        """Length of the dimension ``side`` before the axes, if it has that."""
        return (2,) if "side" in self.variable.dims[: self.variable.lead] else ()

    @property
    def piece(self) -> tuple[int, ...]:
        """Shape of a chunk, without the list."""
        return (*self.sides, *self.chunk, *self.inner)

    @property
    def chunk_in_file(self) -> tuple[int, ...]:
        """Shape of a chunk in the result file."""
        return (1, *self.piece) if self.variable.listed else self.piece

    @property
    def piece_bytes(self) -> int:
        """Bytes of a chunk, not encoded."""
        return np.dtype(self.variable.dtype).itemsize * prod(self.piece)

    @property
    def point_bytes(self) -> int:
        """Bytes of a point of the grid, or of each entry of the list there."""
        return np.dtype(self.variable.dtype).itemsize * prod(self.sides) * prod(self.inner)

    def shape_in_file(self, count: int = 0) -> tuple[int, ...]:
        """Shape of the variable in the result file; count: of the entries of the list."""
        listed = (count,) if self.variable.listed else ()
        return (*listed, *self.sides, *self.shape, *self.inner)

    def offset(self, block: GridBlock, entry: int = 0) -> Offset:
        """Place in the result file where the chunk of a block begins; entry: of the list."""
        listed = (entry,) if self.variable.listed else ()
        return (*listed, *(0 for _ in self.sides), *block.start, *(0 for _ in self.inner))

    def rows_shape(self, rows: int, count: int) -> tuple[int, ...]:
        """Shape of values before they are arranged over axes; rows: how many; count: of the entries of the list."""
        listed = (count,) if self.variable.listed else ()
        return (*listed, *self.sides, rows, *self.inner)

    def over_axes(self, block: GridBlock, values: Array, fast: int | None) -> Array:
        """Return the values of a block over its axes, from those of its rows: ``(rows, P, ...)`` of a variable over the
        grid, else :meth:`rows_shape`.

        fast: the axis of the mesh frequency alone, which stands last among rows and P.
        """
        if GRID not in self.variable.dims or fast is None:
            return values.reshape((*values.shape[: self.variable.lead], *block.shape, *self.inner))
        rows = block.shape[:fast] + block.shape[fast + 1 :]
        return np.moveaxis(values.reshape((*rows, block.shape[fast], *self.inner)), len(rows), fast)

    def encoded(self, values: Array) -> list[bytes]:
        """Return the chunks of a block with these values over its axes: one, or one an entry of the list."""
        piece = self.piece
        return [encode(item, piece) for item in (values if self.variable.listed else [values])]

    def decoded(self, data: bytes, block: GridBlock) -> Array:
        """Return the values of a chunk of a block, without what it is filled up with."""
        inside = (*(slice(None) for _ in self.sides), *(slice(0, size) for size in block.shape))
        return decode(data, self.piece, self.variable.dtype)[inside]


@dataclass(frozen=True)
class Layout:
    """A method's grid (names and sizes of its axes) and its division: the shape of all blocks but those at the ends.

    cost: of a point, as the method gives it.
    """

    method: Method
    dims: tuple[str, ...]
    shape: tuple[int, ...]
    chunk: tuple[int, ...]
    cost: float

    @property
    def points(self) -> int:
        """Number of points."""
        return prod(self.shape)

    @property
    def count(self) -> int:
        """Number of blocks."""
        return prod(ceil(n / c) for n, c in zip(self.shape, self.chunk, strict=True))

    def gives(self, variable: str) -> bool:
        """Whether the method computes a variable of this name."""
        return any(known.name == variable for known in self.method.results)

    @property
    def tells(self) -> bool:
        """Whether the method says of every point if it is stable."""
        return any(known.name == "stable" and known.dims == (GRID,) for known in self.method.results)

    def of(self, variable: Variable) -> VariableLayout:
        """Return the arrangement of one of the method's results."""
        constants = self.method.constants()
        inner = tuple(len(constants[dim]) for dim in variable.dims[variable.lead + 1 :])
        return VariableLayout(variable, self.shape, self.chunk, inner)

    @property
    def results(self) -> Sequence[VariableLayout]:
        """All of them."""
        return [self.of(variable) for variable in self.method.results]

    def blocks(self) -> Iterator[GridBlock]:
        """All blocks, in the order of their numbers."""
        starts = product(*(range(0, n, c) for n, c in zip(self.shape, self.chunk, strict=True)))
        for number, start in enumerate(starts):
            shape = tuple(min(c, n - s) for n, c, s in zip(self.shape, self.chunk, start, strict=True))
            yield GridBlock(self.method.name, number, start, shape)


@dataclass(frozen=True)
class Plan:
    """Plan of a sweep.

    base: the system at the base values. fast: the axis that is the mesh frequency and nothing else, None without one.
    taken: what is taken over from an earlier result instead.
    """

    config: Config
    base: GearSystem
    fast: Axis | None
    layouts: tuple[Layout, ...]
    taken: Previous | None = None

    @property
    def grid(self) -> tuple[str, ...]:
        """Names of all axes."""
        return tuple(axis.name for axis in self.config.axes)

    @property
    def row_axes(self) -> tuple[Axis, ...]:
        """All axes but the mesh frequency."""
        return tuple(axis for axis in self.config.axes if axis is not self.fast)

    @property
    def rows(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(axis.name for axis in self.row_axes)

    @property
    def points(self) -> int:
        """Number of points of the grid."""
        return prod(axis.size for axis in self.config.axes)

    @property
    def blocks(self) -> int:
        """Number of blocks of all methods."""
        return sum(layout.count for layout in self.layouts)

    @property
    def systems(self) -> int:
        """Number of different systems."""
        return prod(axis.size for axis in self.row_axes)

    def layout(self, method: str) -> Layout:
        """The grid of a method."""
        return next(layout for layout in self.layouts if layout.method.name == method)

    def inner(self, layout: Layout) -> int | None:
        """Return the axis of a method's grid that is the mesh frequency and nothing else, if any."""
        return None if self.fast is None or self.fast.name not in layout.dims else layout.dims.index(self.fast.name)

    @cached_property
    def digest(self) -> str:
        """Digest in which finished parts must agree: numbers, division, program version, earlier result."""
        division = [[layout.method.name, layout.chunk] for layout in self.layouts]
        earlier = [] if self.taken is None else [str(self.taken.path), self.taken.identity]
        text = json.dumps([self.config.digest, division, __version__, *earlier])
        return hashlib.sha256(text.encode()).hexdigest()

    @cached_property
    def teeth(self) -> ToothNotices | None:
        """Return what is wrong with the teeth of a gearbox, over its grid; None for other systems."""
        return over_grid(self.config, self.row_axes, self.base)

    @property
    def mesh_frequency_range(self) -> tuple[float, float]:
        """Lowest and highest mesh frequency of the axis, however few points it has."""
        if self.fast is None:
            raise ValueError("no axis sets the mesh frequency alone")
        low, high = self.fast.span
        return low * self.fast.assignments[0].factor, high * self.fast.assignments[0].factor

    @property
    def mesh_frequencies(self) -> Array | None:
        """Mesh frequencies of the axis that sets them, None where no axis does."""
        sources = [m.values for axis in self.config.axes if (m := axis.mesh_frequency)]
        return np.asarray(sources[-1], dtype=float) if sources else None

    def mesh_frequency(self, rows: dict[str, Array], columns: Array) -> Array:
        """The mesh frequency of rows (indices by axis name): ``(P,)`` of its own axis, else ``(rows, 1)``."""
        if self.fast is not None:
            return np.asarray(self.fast.assignments[0].values, dtype=float)[columns]
        found = [(axis, m.values) for axis in self.row_axes if (m := axis.mesh_frequency)]
        if not found:
            raise ValueError("no axis sets the mesh frequency")
        axis, values = found[-1]
        return np.asarray(values, dtype=float)[rows[axis.name]][:, None]


def plan(config: Config) -> Plan:
    """Divide the grid of a configuration that has a ``sweep`` and ``methods``.

    Raises ConfigError where the options of a method do not fit the system, SettingError where
    the environment asks for a kernel that is not there.
    """
    if not config.axes or not config.methods.chosen:
        raise ValueError("a sweep needs axes and methods")
    base = config.system.build()
    check_options(config, base)
    fast = next((axis for axis in config.axes if [a.path for a in axis.assignments] == [MESH_FREQUENCY]), None)
    layouts = tuple(_layout(config, fast, method) for method in chosen(config.methods, base))
    ckernel.check()
    return Plan(config, base, fast, layouts)


def _layout(config: Config, fast: Axis | None, method: Method) -> Layout:
    axes = [axis for axis in config.axes if axis is not fast or method.frequency == POINTS]
    axes = [axis for axis in axes if axis.name != method.left_out]
    shape = tuple(axis.size for axis in axes)
    cost = method.cost()
    wanted = min(max(USUAL, prod(shape) / PIECES), MOST) / cost
    inner = next((k for k, axis in enumerate(axes) if axis is fast), None)
    if inner is not None:
        wanted = max(wanted, shared_points(shape[inner], prod(shape) // shape[inner], cost))
    if method.frequency == POINTS:
        widest = 8 * max(len(values) for values in ([0], *method.constants().values()))
        wanted = min(wanted, MOST_BYTES / widest)
    if inner is not None and method.singly:
        wanted = least = shape[inner]
    else:
        least = method.fewest
    chunk = chunk_shape(shape, inner, max(least, int(wanted)))
    return Layout(method, tuple(axis.name for axis in axes), shape, chunk, cost)


def shared_points(length: int, rows: int, cost: float) -> int:
    """Return how many points of a row of mesh frequencies are computed together: all, if that leaves enough blocks.

    Each block builds and prepares the systems of its rows, which can take far longer than a point: 140 ms against 8 for
    a gearbox of four meshes in thousands of segments. cost: of a point.
    """
    pieces = max(ceil(FEW / rows), ceil(length * cost / LONGEST), ceil(length / MOST))
    return ceil(length / pieces)


def chunk_shape(shape: tuple[int, ...], inner: int | None, wanted: int) -> tuple[int, ...]:
    """The shape of blocks of about ``wanted`` points: whole in ``inner`` (if given) as far as that goes, then last."""
    chunk = [1] * len(shape)
    left = wanted
    order = [k for k in reversed(range(len(shape))) if k != inner]
    for k in order if inner is None else [inner, *order]:
        chunk[k] = _even(shape[k], max(1, left))
        left //= chunk[k]
        if chunk[k] < shape[k]:
            break
    return tuple(chunk)


def _even(size: int, most: int) -> int:
    """The length of the fewest nearly equal pieces of ``size`` that are at most ``most`` long."""
    return ceil(size / ceil(size / most)) if size else 1


@dataclass(frozen=True)
class ToothNotices:
    """Flags of :data:`gearstab.systems.gearbox.feasibility.NOTICE_FLAGS`.

    axes: those of the grid on which the geometry depends; flags: ``(*axes, mesh)``; meshes: their names.
    """

    axes: tuple[Axis, ...]
    flags: Array
    meshes: tuple[str, ...]


def over_grid(config: Config, row_axes: tuple[Axis, ...], base: GearSystem) -> ToothNotices | None:
    """Look at the teeth of every geometry of the grid; None for systems that are not given by their teeth."""
    if config.system.train() is None:
        return None
    from gearstab.systems.gearbox.feasibility import GEOMETRY, notice_flags

    axes = tuple(axis for axis in row_axes if any(item.path[-1] in GEOMETRY for item in axis.assignments))
    meshes = tuple(mesh.name for mesh in base.whole_meshes)
    shape = tuple(axis.size for axis in axes)
    index = np.indices(shape).reshape(len(shape), prod(shape))
    rows = dict(zip((axis.name for axis in axes), index, strict=True))
    flags = np.zeros((prod(shape), len(meshes)), dtype=np.int16)
    for members in alike(axes, rows, len(flags)):
        chosen = {name: places[members] for name, places in rows.items()}
        flags[members] = notice_flags(config.at(chosen))
    return ToothNotices(axes, flags.reshape(*shape, len(meshes)), meshes)


def tooth_group(found: ToothNotices) -> Group:
    """Return the group ``/teeth`` of the result."""
    from gearstab.systems.gearbox.feasibility import NOTICE_FLAGS

    names = tuple(axis.name for axis in found.axes)
    coordinate, notices = flagged(TEETH, NOTICE_FLAGS)
    table = (coordinate, replace(notices, dims=(*names, "mesh")))
    return Group(fields_of(table, {"mesh": found.meshes, "notices": found.flags}))
