"""Layout of a method's results: its grid, the blocks of that, and where values of a variable lie in blocks and file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from math import ceil, prod

import numpy as np

from gearstab.methods import Method
from gearstab.results.hdf5 import decode, encode
from gearstab.results.tree import Offset
from gearstab.results.variables import GRID, Variable
from gearstab.system import Array


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
        return [encode(item, self.piece) for item in (values if self.variable.listed else [values])]

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
