"""Assembly of a gear system from elements: bodies, springs, dampers and meshes stamp themselves into its matrices.

An element acts along a row: a linear combination of coordinates, written as entries by the name of the coordinate. So a
kind of system lists its coordinates and elements, and every number may have a batch shape.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np

from gearstab.config.model import given
from gearstab.mesh import Connection, MachineElement, Mesh
from gearstab.system import Array, GearSystem
from gearstab.systems.forcing import with_damping, with_forcing
from gearstab.systems.mesh import build_mesh

Row = Mapping[str, Any]
"""Entries by coordinate; numbers or arrays of batch shape."""


def total(*rows: Row) -> dict[str, Any]:
    """Return the sum of rows."""
    found: dict[str, Any] = {}
    for row in rows:
        for name, value in row.items():
            found[name] = found[name] + value if name in found else value
    return found


def _batch(values: Iterable[Any]) -> tuple[int, ...]:
    """Return the batch shape of values, most of which are plain numbers."""
    return np.broadcast_shapes(*(value.shape for value in values if isinstance(value, np.ndarray)))


@dataclass(frozen=True)
class Coordinates:
    """The coordinates of a system by name, each with its unit, m or rad."""

    units: Mapping[str, str]

    @cached_property
    def index(self) -> dict[str, int]:
        """Number of each coordinate."""
        return {name: k for k, name in enumerate(self.units)}

    def vector(self, row: Row) -> Array:
        """Return a row as an array ``(..., n)``."""
        result = np.zeros((*_batch(row.values()), len(self.units)))
        for name, value in row.items():
            result[..., self.index[name]] += value
        return result

    def stamped(self, rows: Sequence[tuple[Row, Any]]) -> Array:
        """Return sum a r^T r ``(..., n, n)`` over pairs of a row r and a number a."""
        batch = _batch(value for row, a in rows for value in (a, *row.values()))
        total = np.zeros((*batch, len(self.units), len(self.units)))
        for row, a in rows:
            for first, one in row.items():
                for second, other in row.items():
                    total[..., self.index[first], self.index[second]] += np.asarray(a) * one * other
        return total

    def skew(self, pairs: Sequence[tuple[Row, Row, Any]]) -> Array:
        """Return sum a (y^T x - x^T y) ``(..., n, n)`` over rows x and y and a number a."""
        parts = (np.asarray(a)[..., None, None] * self.vector(y)[..., :, None] * self.vector(x)[..., None, :]
                 for x, y, a in pairs)  # fmt: skip
        found: Array = sum(parts, np.zeros((len(self.units), len(self.units))))
        return found - np.swapaxes(found, -1, -2)


@dataclass(frozen=True)
class Element:
    """A mass, a spring and a damper that act along one row r: m (r q')^2/2, k (r q)^2/2 and c (r q')^2/2.

    name: of the bearing or shaft that spring and damper are, "" for what nobody asks the force of. part: which of both.
    """

    row: Row
    mass: Any = 0.0
    stiffness: Any = 0.0
    damping: Any = 0.0
    name: str = ""
    part: MachineElement = MachineElement.BEARING


@dataclass(frozen=True)
class MeshElement:
    """A tooth mesh between two bodies.

    p: its parameters, complete. row: its deflection. frequency_ratio, lag: as in :class:`gearstab.mesh.Mesh`.
    """

    p: Any
    row: Row
    frequency_ratio: Fraction | float = Fraction(1)
    lag: Any = 0.0

    @cached_property
    def wave(self) -> Mesh:
        """The mesh without its direction."""
        return build_mesh(self.p, np.zeros(0), self.frequency_ratio, self.lag)


@dataclass(frozen=True)
class Assembly:
    """A system as the list of its elements."""

    coordinates: Coordinates
    elements: Sequence[Element]
    meshes: Sequence[MeshElement]

    def matrix(self, what: str) -> Array:
        """Return the ``mass``, ``stiffness`` or ``damping`` of all elements ``(..., n, n)``."""
        parts = [(element.row, getattr(element, what)) for element in self.elements]
        return self.coordinates.stamped([(row, value) for row, value in parts if given(value)])

    def _connections(self) -> Iterator[Connection]:
        """Yield the named springs that there are: with a row, and stiff in some row of the batch."""
        for item in self.elements:
            if not item.name or not item.row or not given(item.stiffness):
                continue
            turns = all(self.coordinates.units[name] == "rad" for name in item.row)
            k, c = (np.asarray(value, dtype=float) for value in (item.stiffness, item.damping))
            yield Connection(item.name, item.part, self.coordinates.vector(item.row), k, c, "N m" if turns else "N")

    def system(self, p: Any, load: Row | None = None, **more: Any) -> GearSystem:
        """Return the system with the damping and forces of the section ``p``. load: constant forces; more: fields."""
        place = self.coordinates
        meshes = tuple(replace(item.wave, direction=place.vector(item.row)) for item in self.meshes)
        update = {"meshes": [item.p for item in self.meshes], "load": None if load is None else place.vector(load)}
        p = p.model_copy(update=update)
        bare = GearSystem(
            self.matrix("mass"), self.matrix("stiffness"), meshes, coordinates=tuple(place.units),
            units=tuple(place.units.values()), connections=tuple(self._connections()), **more,
        )  # fmt: skip
        system, held = with_damping(bare, p), self.matrix("damping")
        if np.any(held):
            system = replace(system, damping=held + system.damping_matrix)
        return with_forcing(system, p)
