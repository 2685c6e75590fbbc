"""Bearings and shafts: the springs and dampers of a system whose forces somebody wants to know.

They are parts of K0 and C already, named here. Stability does not depend on them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

Array = np.ndarray


class MachineElement(Enum):
    """The machine element that a connection stands for; its value is what results call it."""

    BEARING = "bearing"
    SHAFT = "shaft"


@dataclass(frozen=True)
class Connection:
    """A spring and a damper side by side, between bodies or to the housing: F = k r q + c r q'.

    Modal and Rayleigh damping and damping matrices have no place and are no part of F.

    Parameters
    ----------
    name: what results call it.
    part: what it is.
    row: ``(..., n)``, r; the deflection is r q.
    stiffness, damping: ``(...)``, k and c.
    unit: SI unit of F: ``N``, or ``N m`` of a twist.
    """

    name: str
    part: MachineElement
    row: Array
    stiffness: Array
    damping: Array
    unit: str = "N"

    def mapped(self, vector: Callable[[Array], Array]) -> Connection:
        """Return the connection with its row mapped."""
        return replace(self, row=vector(self.row))

    def scaled(self, mass: Array, stiffness: Array) -> Connection:
        """Return the connection in units of a mass and a stiffness."""
        drag = np.sqrt(mass * stiffness)
        return replace(self, stiffness=self.stiffness / stiffness, damping=self.damping / drag)

    def force(self, displacement: Array, velocity: Array) -> Array:
        """F ``(...)`` of a single system, from q and q' ``(..., n)``."""
        return np.asarray(self.stiffness * (displacement @ self.row) + self.damping * (velocity @ self.row))


def by_part(connections: Sequence[Connection]) -> dict[str, list[Connection]]:
    """Return the connections by what they are, in their order."""
    found: dict[str, list[Connection]] = {}
    for item in connections:
        found.setdefault(item.part.value, []).append(item)
    return found
