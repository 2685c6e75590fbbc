"""The designs of a problem: from the values of its variables to systems, many of equal structure in one batch."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gearstab.config import Axis, Config
from gearstab.config.document import value_at
from gearstab.config.sections import INPUT_SPEED
from gearstab.config.sections.design import Design, DesignVariable
from gearstab.errors import NotPossible
from gearstab.system import Array, GearSystem, whirls
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
        found = []
        for item in self.design.ranges:
            factor = float(p.cycles_of_input() or 1.0) if item.of == INPUT_SPEED else 1.0
            found.append(Span(item.low * factor, item.high * factor, item.weight, factor))
        return tuple(found)

    @cached_property
    def given_places(self) -> Array:
        """``(variables,)``, the given design as values of its continuous variables and numbers of its choices.

        NaN for a choice that is none of those of its variable.
        """
        return np.array([self._place(variable) for variable in self.variables])

    def _place(self, variable: DesignVariable) -> float:
        values = [value_at(self.config.system, item.path) for item in variable.axis.assignments]
        if variable.continuous:
            value = values[0]
            return np.nan if value is None else float(value) / variable.axis.assignments[0].factor
        for k in range(variable.axis.size):
            if all(item.values[k] == value for item, value in zip(variable.axis.assignments, values, strict=True)):
                return float(k)
        return np.nan

    def number(self, variable: DesignVariable, place: float) -> float:
        """Return the number that a value of a variable is: itself, or of choices that set several the number, from 1,
        of the row.

        NaN for words. A place of NaN stands for the given design.
        """
        place = self._place(variable) if np.isnan(place) else place
        if np.isnan(place) and (variable.continuous or variable.form == "choices"):
            return np.nan
        if variable.continuous:
            return float(place)
        if variable.form == "choices":
            return float(place) + 1
        item = variable.axis.assignments[0]
        try:
            return float(value_at(self.config.system, item.path) if np.isnan(place) else item.values[int(place)])
        except (TypeError, ValueError):
            return np.nan

    def text(self, variable: DesignVariable, place: float) -> str:
        """Return the value for a reader: six digits, or the label of a choice."""
        if variable.form == "choices":
            place = self._place(variable) if np.isnan(place) else place
            return "as given" if np.isnan(place) else str(variable.axis.values[int(place)])
        if not variable.continuous and not np.isnan(place):
            return str(variable.axis.assignments[0].values[int(place)])
        value = self.number(variable, place)
        if np.isnan(value):
            return str(value_at(self.config.system, variable.axis.assignments[0].path))
        return f"{value:.6g}"

    def settings(self, design: Array) -> list[str]:
        """Return ``PATH=VALUE`` texts for ``--set`` that turn the given design into another one."""
        found = []
        for variable, place in zip(self.variables, design, strict=True):
            for item in () if np.isnan(place) else variable.axis.assignments:
                value = place * item.factor if variable.continuous else item.values[int(place)]
                found.append(f"{item.name}={value!s}" if variable.form != "bounds" else f"{item.name}={float(value)!r}")
        return found
