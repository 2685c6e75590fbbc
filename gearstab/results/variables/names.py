"""Names that results have for variables and dimensions of their own."""

from __future__ import annotations

from gearstab.results import variables
from gearstab.results.variables import Variable, design, responses


def every_variable() -> tuple[Variable, ...]:
    """Return all variables of a result, those of the sections of a table once for each table."""
    found: list[Variable] = []
    for table in (*vars(variables).values(), *vars(design).values(), *vars(responses).values()):
        found += [item for item in (table if isinstance(table, tuple) else (table,)) if isinstance(item, Variable)]
    return tuple(found)


def taken_names() -> frozenset[str]:
    """Return the names of all variables and dimensions: an axis of one of them could not stand beside it."""
    return frozenset(name for variable in every_variable() for name in (variable.name, *variable.dims))
