"""The designs of a problem: from the values of its variables to systems, many of equal structure in one batch."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gearstab.config import Axis, Config
from gearstab.config.sections.design import Design, DesignVariable, SpeedRange
from gearstab.config.sections.targets import INPUT_SPEED
from gearstab.errors import NotPossible
from gearstab.support import whirls
from gearstab.system import Array, GearSystem
from gearstab.systems.base import System

GIVEN = np.nan
"""Stands for a variable's value: the one that the configuration gives."""


@dataclass(frozen=True)
class Span:
    """An operating range in the mesh frequency, rad per unit time. factor: mesh frequency over the speed as given."""

    low: float
    high: float
    weight: float
    factor: float


@dataclass(frozen=True)
class Batch:
    """Designs of equal structure. members: their places; system: of batch shape (members,); p: its section."""

    members: Array
    system: GearSystem
    p: System
    spans: tuple[Span, ...]


@dataclass(frozen=True)
class DesignProblem:
    """A configuration with a section ``design``.

    A design is a row of ``(rows, variables)``: the value of a continuous variable, the number (from 0) of the choice of
    any other, or GIVEN.
    """

    config: Config
    design: Design

    @property
    def variables(self) -> tuple[DesignVariable, ...]:
        """Number that may change."""
        return self.design.variables

    @cached_property
    def continuous(self) -> Array:
        """``(variables,)`` bool."""
        return np.array([variable.continuous for variable in self.variables])

    @cached_property
    def bounds(self) -> Array:
        """``(2, variables)``; numbers of the first and last choice of variables that are not continuous."""
        ends = [v.bounds if v.continuous else (0.0, v.axis.size - 1.0) for v in self.variables]
        return np.array(ends, dtype=float).T.reshape(2, -1)

    @cached_property
    def dear(self) -> bool:
        """Whether judging a design takes steady states or regions of motions that whirl: a hundred times as long as
        anything else.
        """
        wanted = {name for weights in self.design.objectives for name in weights}
        return self.whirling or "load_factor" in wanted | {limit.name for limit in self.design.limits}

    @cached_property
    def whirling(self) -> bool:
        """Whether motions of the given design are no real modes, so that first order takes as long as exact search."""
        return whirls(self.config.system.build())

    @cached_property
    def given(self) -> Array:
        """``(1, variables)``, the design as the configuration has it."""
        return np.full((1, len(self.variables)), GIVEN)

    def batches(self, designs: Array) -> Iterator[Batch]:
        """Build designs, those of equal structure together; those that cannot be built are left out."""
        for members in self._alike(designs):
            yield from self._built(designs, members)

    def _alike(self, designs: Array) -> Iterator[Array]:
        """Places of designs of equal structure."""
        keys = np.isnan(designs).astype(float)
        for k, variable in enumerate(self.variables):
            if any(item.structural for item in variable.axis.assignments):
                keys[:, k] = np.where(np.isnan(designs[:, k]), -1.0, designs[:, k])
        _, group = np.unique(keys, axis=0, return_inverse=True)
        for number in range(int(np.max(group, initial=-1)) + 1):
            yield np.flatnonzero(np.ravel(group) == number)

    def _built(self, designs: Array, members: Array) -> Iterator[Batch]:
        try:
            p = self.systems(designs[members])
            if not p.assembled():
                return
            system = p.build().over((len(members),))
        except (NotPossible, ArithmeticError, np.linalg.LinAlgError):
            # One that cannot be built must not take the others with it.
            half = len(members) // 2
            if half:
                yield from self._built(designs, members[:half])
                yield from self._built(designs, members[half:])
            return
        yield Batch(members, system, p, self.spans(p))

    def systems(self, designs: Array) -> System:
        """Return the section ``system`` of designs of one structure, arrays ``(rows,)`` where a variable sets them."""
        axes: list[Axis] = []
        rows = np.arange(len(designs))
        selection: dict[str, Array] = {}
        for k, variable in enumerate(self.variables):
            if np.isnan(designs[0, k]):
                continue
            axis = variable.axis
            if variable.continuous:
                items = tuple(replace(item, values=designs[:, k] * item.factor) for item in axis.assignments)
                axis = replace(axis, assignments=items)
            axes.append(axis)
            selection[axis.name] = rows if variable.continuous else designs[:, k].astype(int)
        system = replace(self.config, axes=tuple(axes)).at(selection)
        return system.dependent({item.path for axis in axes for item in axis.assignments})

    def spans(self, p: System) -> tuple[Span, ...]:
        """The operating ranges in the mesh frequency; of an input speed they go with the teeth."""
        return tuple(self._span(item, p) for item in self.design.ranges)

    @staticmethod
    def _span(item: SpeedRange, p: System) -> Span:
        factor = 1.0
        if item.of == INPUT_SPEED:
            factor = float(p.cycles_of_input() or 1.0)
        return Span(item.low * factor, item.high * factor, item.weight, factor)
