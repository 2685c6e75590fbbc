"""The combinations of what is left over when two axes are drawn: one curve, panel or overlaid case each."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product
from math import ceil, prod

import numpy as np

from gearstab.errors import PlotError
from gearstab.plots.axes import FigureAxis

Index = dict[str, int]

FEW = 4
"""Panels that stand over one another in one column of a journal."""
TALL = 2.6
"""Height over width of a figure in one column."""
MOST_PANELS = 12
"""More panels than this are too small to read on a page."""


def combinations(free: tuple[FigureAxis, ...], most: int, what: str) -> list[Index]:
    """Every combination of indices on the axes left over. Raises PlotError if there are more than ``most``."""
    names = [axis.name for axis in free]
    chosen = [dict(zip(names, index, strict=True)) for index in product(*(range(axis.size) for axis in free))]
    if len(chosen) > most:
        left = "; ".join(f"{axis.name}: {axis.extent()}" for axis in free)
        many = f"{len(chosen)} {what} are too many (at most {most})"
        raise PlotError(f"{many}: choose with --select AXIS=VALUE; left over: {left}")
    return chosen


def some(
    free: tuple[FigureAxis, ...], most: int, what: str, partial: bool, largest: Callable[[Index], float] | None = None
) -> tuple[list[Index], str]:
    """The combinations and, where ``partial`` lets some of too many be left out, a sentence on those that are shown.

    largest: of what one combination shows: labels are told apart by it. Numbers are thinned out evenly.
    """
    count = int(np.prod([axis.size for axis in free], dtype=float))
    if not partial or count <= most:
        return combinations(free, most, what), ""
    if largest is not None and not any(axis.numeric for axis in free):
        every = combinations(free, count, what)
        sizes = np.nan_to_num([largest(index) for index in every], nan=-np.inf)
        kept = np.sort(np.argsort(-sizes, kind="stable")[:most])
        return [every[k] for k in kept], said(f"the {most} of {count} {what} with the largest values", free)
    ranges = thinned([axis.size for axis in free], most)
    names = [axis.name for axis in free]
    chosen = [dict(zip(names, index, strict=True)) for index in product(*ranges)]
    return chosen, said(f"{len(chosen)} of {count} {what}", free)


def said(shown: str, free: tuple[FigureAxis, ...]) -> str:
    """A sentence on what is shown and how to choose something else."""
    chosen = " ".join(f"--select {axis.name}=VALUE" for axis in free)
    return f"shows {shown}; choose with {chosen}"


def thinned(sizes: list[int], most: int) -> list[list[int]]:
    """Evenly spread indices on every axis, first and last included, ``most`` combinations of them at the most.

    The axis with the most left gives one up at a time.
    """
    left = list(sizes)
    while np.prod(left, dtype=float) > most:
        longest = left.index(max(left))
        left[longest] = min(left[longest] - 1, most)
    return [[round(i) for i in np.linspace(0, size - 1, kept)] for size, kept in zip(sizes, left, strict=True)]


def caption(free: tuple[FigureAxis, ...], chosen: Index) -> str:
    """Words that distinguish one combination from the others."""
    return ", ".join(axis.caption(chosen[axis.name]) for axis in free)


def arrangement(panels: Sequence[Index], wide: bool = True) -> tuple[int, int]:
    """(rows, columns) of the panels: values of the two axes left over if these are few, else about a square.

    In one column of a journal few stand over one another, and many in two columns.
    """
    if not wide:
        columns = 1 if len(panels) <= FEW else 2
        return ceil(len(panels) / columns), columns
    sizes = [len({panel[name] for panel in panels}) for name in panels[0]]
    count = len(panels)
    if len(sizes) == 2 and max(sizes) <= 4 and prod(sizes) == count:
        return sizes[0], sizes[1]
    columns = {1: 1, 2: 2, 3: 3, 4: 2}.get(count, 3 if count <= 9 else 4)
    return ceil(count / columns), columns
