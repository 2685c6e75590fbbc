"""Values of variables as the user has them: of the given design, and as numbers and texts."""

from __future__ import annotations

import numpy as np

from gearstab.config.document.tree import value_at
from gearstab.config.sections.design import DesignVariable
from gearstab.design.problem import DesignProblem
from gearstab.system import Array


def given_places(problem: DesignProblem) -> Array:
    """``(variables,)``, the given design as values of its continuous variables and numbers of its choices.

    NaN for a choice that is none of those of its variable.
    """
    return np.array([_place(problem, variable) for variable in problem.variables])


def _place(problem: DesignProblem, variable: DesignVariable) -> float:
    values = [value_at(problem.config.system, item.path) for item in variable.axis.assignments]
    if variable.continuous:
        value = values[0]
        return np.nan if value is None else float(value) / variable.axis.assignments[0].factor
    for k in range(variable.axis.size):
        if all(item.values[k] == value for item, value in zip(variable.axis.assignments, values, strict=True)):
            return float(k)
    return np.nan


def number(problem: DesignProblem, variable: DesignVariable, place: float) -> float:
    """The number that a value of a variable is: itself, or of choices that set several the number, from 1, of the row.

    NaN for words. A place of NaN stands for the given design.
    """
    if np.isnan(place):
        return _given_number(problem, variable)
    if variable.continuous:
        return float(place)
    if variable.form == "choices":
        return float(place) + 1
    try:
        return float(variable.axis.assignments[0].values[int(place)])
    except (TypeError, ValueError):
        return np.nan


def _given_number(problem: DesignProblem, variable: DesignVariable) -> float:
    place = _place(problem, variable)
    if variable.form == "choices" or variable.continuous or not np.isnan(place):
        return np.nan if np.isnan(place) else number(problem, variable, place)
    try:
        return float(value_at(problem.config.system, variable.axis.assignments[0].path))
    except (TypeError, ValueError):
        return np.nan


def text(problem: DesignProblem, variable: DesignVariable, place: float) -> str:
    """The value for a reader: six digits, or the label of a choice."""
    if variable.form == "choices":
        place = _place(problem, variable) if np.isnan(place) else place
        return "as given" if np.isnan(place) else str(variable.axis.values[int(place)])
    if not variable.continuous and not np.isnan(place):
        return str(variable.axis.assignments[0].values[int(place)])
    value = number(problem, variable, place)
    if np.isnan(value):
        return str(value_at(problem.config.system, variable.axis.assignments[0].path))
    return f"{value:.6g}"


def settings(problem: DesignProblem, design: Array) -> list[str]:
    """``PATH=VALUE`` texts for ``--set`` that turn the given design into another one."""
    found = []
    for variable, place in zip(problem.variables, design, strict=True):
        if np.isnan(place):
            continue
        for item in variable.axis.assignments:
            value = place * item.factor if variable.continuous else item.values[int(place)]
            found.append(f"{item.name}={value!s}" if variable.form != "bounds" else f"{item.name}={float(value)!r}")
    return found
