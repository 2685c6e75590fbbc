"""Patterns whose monodromy matrices come from another pattern, of many more segments."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from gearstab.floquet.segments.pattern import Pattern
from gearstab.system import Array

LARGEST = 1e6
"""Entries of M above this leave less than ten digits to multipliers on the unit circle."""


@dataclass(frozen=True)
class Resolved(Pattern):
    """A pattern of few segments and, of the same rows, one of many that gives the monodromy matrices."""

    fine: Pattern | None = None

    def subset(self, index: Array) -> Self:
        """Some of the rows, by position, of both."""
        part = super().subset(index)
        vars(part)["fine"] = None if self.fine is None else self.fine.subset(index)
        return part

    def without_damping(self) -> Pattern:
        """The same rows and coordinates without any damping, of both."""
        free = super().without_damping()
        vars(free)["fine"] = None if self.fine is None else self.fine.without_damping()
        return free


def exact(pattern: Pattern) -> Pattern:
    """The pattern that gives the monodromy matrices."""
    return pattern.fine if isinstance(pattern, Resolved) and pattern.fine is not None else pattern


def first_modes(pattern: Pattern, row: Array) -> Array:
    """``(P, n, n)``: from the modes in which the monodromy matrices stand to those of the pattern's first segment."""
    own, other = (p.modes[row, p.states[0]] for p in (pattern, exact(pattern)))
    return np.asarray(np.swapaxes(own, -1, -2) @ other)
