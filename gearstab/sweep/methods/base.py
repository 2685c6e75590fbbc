"""What a method of a sweep is: what it needs, declares and computes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from gearstab.perturbation import Tongue
from gearstab.results.variables import SIDE, Variable
from gearstab.system import Array, GearSystem

POINTS, RANGE = "points", "range"
"""What of the mesh frequency a method needs: every point of the grid or the ends of its axis; None for neither."""


Key = tuple[Tongue, int]
"""What tells the regions along the dimension ``tongue`` apart: where a region is rooted and, as there can be several of
one root, which one of them it is."""


@dataclass(frozen=True)
class Outcome:
    """What a method gives for a batch of systems, one a row.

    values: by variable, with GRID as ``(rows, P)`` and ROWS as ``(rows,)`` (one row may stand for all).
    tongues: what the dimension ``tongue`` consists of, for methods that have it.
    """

    values: Mapping[str, Array]
    tongues: tuple[Key, ...] = ()


def _never(options: Any, system: GearSystem) -> bool:
    return False


def nothing(options: Any, system: GearSystem) -> Mapping[str, Any]:
    """What most methods have to say beyond the ordinary."""
    return {}


def _any(options: Any, system: GearSystem) -> None:
    return None


def _silent(options: Any, system: GearSystem) -> str | None:
    return None


Run = Callable[[GearSystem, Array, Any], Outcome]


def _at_once(options: Any, system: GearSystem) -> Run | None:
    return None


FEWEST = 4
"""Points of a block, however costly."""


class Effort(Protocol):
    """What one system takes."""

    def seconds(self, rows: float, batches: float = 1.0) -> float:
        """Of so many like it, in so many batches."""
        ...


def _few(options: Any) -> int:
    return FEWEST


def _in_order(indices: Iterable[Sequence[Key]]) -> tuple[Key, ...]:
    """Each once, in order of first appearance."""
    return tuple(dict.fromkeys(key for index in indices for key in index))


@dataclass(frozen=True)
class Method:
    """One method.

    name: its key in ``methods`` of a configuration, and its group in the result.
    frequency: what it needs of the mesh frequency; its results stand over all axes if that is POINTS, else over all but
        the mesh frequency. A method with RANGE gets it as an array of the two ends.
    variables: what it computes, coordinates included, for its options and a system.
    constants: values of those coordinates that are the same everywhere.
    run: (system, mesh frequency, options) -> Outcome.
    cost: about how many points of an undamped system of three coordinates and four segments a point of its own takes.
    unite: the list of all regions, from those of the blocks.
    parallel: whether threads of one process can run it side by side: where it spends its time outside of Python.
    report: attributes that say what it makes of the base system.
    check: raises OptionError where the options do not fit the base system.
    together: the least number of points of its own in a block, however costly, because they share work.
    note: what the user should know before it runs, None for nothing.
    singly: what to run instead on one system at a time with all its mesh frequencies, where it goes from one of these
        to the next, else None.
    outlook: what there is to say of its cost besides the estimated time, None for nothing.
    effort: what one system takes, for methods to which a point is a whole range of mesh frequencies, so that not even
        a single one can be tried; called with the ends of the range.
    relief: what to do where it takes very long.
    """

    name: str
    frequency: str | None
    variables: Callable[[Any, GearSystem], tuple[Variable, ...]]
    run: Run
    cost: Callable[[Any, GearSystem], float]
    constants: Callable[[Any, GearSystem], Mapping[str, Any]]
    unite: Callable[[Iterable[Sequence[Key]]], tuple[Key, ...]] = _in_order
    parallel: Callable[[Any, GearSystem], bool] = _never
    report: Callable[[Any, GearSystem], Mapping[str, Any]] = nothing
    check: Callable[[Any, GearSystem], None] = _any
    together: Callable[[Any], int] = _few
    note: Callable[[Any, GearSystem], str | None] = _silent
    singly: Callable[[Any, GearSystem], Run | None] = _at_once
    outlook: Callable[[Any, GearSystem], str | None] = _silent
    effort: Callable[[Any, GearSystem, Array], Effort] | None = None
    relief: str = ""

    @property
    def over_tongues(self) -> bool:
        """Whether its results stand over instability regions, a list that differs from system to system."""
        return self.frequency != POINTS

    def attributes(self, options: Any, system: GearSystem) -> dict[str, Any]:
        """What the group in the result says of the options and of the base system."""
        plain = options.model_dump(exclude_none=True)
        return flat(plain) | dict(self.report(options, system))


def flat(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options as attributes: without truth values, those of a section after its name."""
    found: dict[str, Any] = {}
    for name, value in options.items():
        if isinstance(value, Mapping):
            found |= {f"{name}_{inner}": one for inner, one in flat(value).items()}
        else:
            found[name] = int(value) if isinstance(value, bool) else value
    return found


def sides(options: Any, system: GearSystem) -> dict[str, Any]:
    """Both edges of a region."""
    return {SIDE.name: ["lower", "upper"]}
