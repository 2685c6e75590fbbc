"""The work of one block: rows to systems, systems to results, results to encoded chunks."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gearstab.config import alike
from gearstab.methods import POINTS, RANGE, Key, Outcome, SampledMethod
from gearstab.results.variables import GRID, Flags
from gearstab.sweep.plan import GridBlock, Layout, Plan
from gearstab.sweep.storage.parts import FinishedBlock, places_of
from gearstab.system import Array
from gearstab.tolerance import correlated


def compute(plan: Plan, block: GridBlock, taken: Outcome | None = None) -> FinishedBlock:
    """Compute one block, without the points that are taken over from an earlier result.

    taken: these points, where they were read before (:func:`taken_over`), as on a machine without that result.
    """
    layout = plan.layout(block.method)
    rows, columns = selection(plan, layout, block)
    count = len(next(iter(rows.values()))) if rows else 1
    known = _known(plan, block)
    outcomes = []
    for wanted, part in still_wanted(known, plan.inner(layout), count, len(columns)):
        own = {name: index[wanted] for name, index in rows.items()}
        for members in grouped(plan, layout, own, len(wanted)):
            chosen = {name: index[members] for name, index in own.items()}
            outcome = run_rows(plan, layout, chosen, len(members), columns[part])
            outcomes.append(Piece(wanted[members], part, outcome))
    if plan.taken is not None and known is not None:
        found = taken_over(plan, block) if taken is None else taken
        assert found is not None
        row, part = known_rows(known, plan.inner(layout), len(columns))
        outcomes.append(Piece(np.flatnonzero(row), np.flatnonzero(part), found))
    values, tongues = joined(layout, outcomes, (count, len(columns)))
    return _encoded(plan, layout, block, values, tongues)


def _known(plan: Plan, block: GridBlock) -> tuple[Array, ...] | None:
    """Where the points of a block stand in the earlier result of a plan, if any."""
    return plan.taken.known(block.method, block.start, block.shape) if plan.taken else None


def taken_over(plan: Plan, block: GridBlock) -> Outcome | None:
    """Read the points of a block that an earlier result has; None where it has none. Raises SweepError."""
    layout, known = plan.layout(block.method), _known(plan, block)
    if plan.taken is None or known is None:
        return None
    there = tuple(place[place >= 0] for place in known)
    return plan.taken.outcome(block.method, layout.method.results, there, plan.inner(layout))


@dataclass(frozen=True)
class Piece:
    """Results of some rows of a block at some of its mesh frequencies, both by their positions in the block."""

    rows: Array
    columns: Array
    outcome: Outcome


def known_rows(known: Sequence[Array], inner: int | None, columns: int) -> tuple[Array, Array]:
    """Which rows of a block, and which of its mesh frequencies, are in an earlier result: masks."""
    over = [place >= 0 for k, place in enumerate(known) if k != inner]
    rows = np.ravel(np.logical_and.reduce(np.meshgrid(*over, indexing="ij"))) if over else np.ones(1, dtype=bool)
    return rows, np.ones(columns, dtype=bool) if inner is None else known[inner] >= 0


def still_wanted(
    known: Sequence[Array] | None, inner: int | None, rows: int, columns: int
) -> Iterator[tuple[Array, Array]]:
    """Positions of rows, and of mesh frequencies, that are to be computed together."""
    if known is None:
        yield np.arange(rows), np.arange(columns)
        return
    row, column = known_rows(known, inner, columns)
    if not row.all():
        yield np.flatnonzero(~row), np.arange(columns)
    if not column.all():
        yield np.flatnonzero(row), np.flatnonzero(~column)


def selection(plan: Plan, layout: Layout, block: GridBlock) -> tuple[dict[str, Array], Array]:
    """The block's rows and its part of the mesh frequency axis, as indices into the points of each axis."""
    columns = np.arange(1)
    ranges, names = [], []
    for name, start, size in zip(layout.dims, block.start, block.shape, strict=True):
        if plan.fast is not None and name == plan.fast.name:
            columns = np.arange(start, start + size)
        else:
            names.append(name)
            ranges.append(np.arange(start, start + size))
    indices = np.meshgrid(*ranges, indexing="ij")
    return {name: index.ravel() for name, index in zip(names, indices, strict=True)}, columns


def grouped(plan: Plan, layout: Layout, rows: dict[str, Array], count: int) -> Iterable[Array]:
    """Positions of rows that are computed as one batch: those of one structure, or each alone."""
    return np.arange(count)[:, None] if layout.method.singly else alike(plan.row_axes, rows, count)


def run_rows(plan: Plan, layout: Layout, rows: dict[str, Array], count: int, columns: Array) -> Outcome:
    """Run a method on rows of one structure."""
    if isinstance(layout.method, SampledMethod):
        return run_sampled(plan, layout.method, rows, count, columns)
    frequency = np.zeros(0)
    if layout.method.frequency == POINTS:
        frequency = plan.mesh_frequency(rows, columns)
    elif layout.method.frequency == RANGE:
        frequency = np.array(plan.mesh_frequency_range)
    if layout.method.singly:
        parameters = plan.config.at({name: index[0] for name, index in rows.items()})
        return layout.method.made_of(parameters).run(np.ravel(frequency))
    system = plan.config.at(varied(rows)).build()
    if frequency.ndim == 2 and system.batch != (count,):
        # Nothing but the mesh frequency differs from row to row.
        system = system.over((count,))
    return layout.method.of(system).run(frequency)


def run_sampled(plan: Plan, method: SampledMethod, rows: dict[str, Array], count: int, columns: Array) -> Outcome:
    """Run a method on the samples of uncertain parameters of rows of one structure, a few rows at a time."""
    uncertain = plan.config.uncertainties
    if uncertain is None:
        raise ValueError(f"{method.name} needs distributions of parameters")
    points = correlated(method.design.points, uncertain.correlation)
    outcomes = []
    for part in method.portions(count, len(columns)):
        size = part.stop - part.start
        every = np.tile(points, (size, 1))
        # The samples of a row are next to each other.
        chosen = {name: np.repeat(index[part], len(points)) for name, index in rows.items()}
        system = uncertain.sampled(plan.config.at(chosen), every).build()
        batch = method.of(system.over((len(every),)))
        if method.frequency == RANGE:
            return batch.run(np.array(plan.mesh_frequency_range))
        present: Array = np.ones((1, 1)) if uncertain.sets_mesh_frequency else plan.mesh_frequency(chosen, columns)
        if isinstance(batch, SampledMethod) and batch.integrates and uncertain.speed is not None:
            outcomes.append(batch.integrated(present, *uncertain.speed).values)
            continue
        frequency = uncertain.mesh_frequency(present, every)
        outcomes.append(batch.run(frequency).values)
    return Outcome({name: np.concatenate([values[name] for values in outcomes]) for name in outcomes[0]})


def varied(rows: Mapping[str, Array]) -> dict[str, Array]:
    """The same rows with one index for all where they do not differ: what depends on it only is then computed once."""
    return {name: index[0] if len(index) > 1 and (index == index[0]).all() else index for name, index in rows.items()}


def joined(layout: Layout, pieces: Sequence[Piece], shape: tuple[int, int]) -> tuple[dict[str, Array], tuple[Key, ...]]:
    """The results of all pieces as arrays over all rows: ``(rows, P, ...)`` over points, else ``(..., rows)``.

    shape: of a block, rows and P.
    """
    if not layout.method.over_tongues:
        first = pieces[0].outcome.values
        names = [variable.name for variable in layout.method.results]
        if len(pieces) == 1:
            # One row may stand for all.
            return {name: np.broadcast_to(first[name], (*shape, *first[name].shape[2:])) for name in names}, ()
        values = {name: np.empty((*shape, *first[name].shape[2:]), first[name].dtype) for name in names}
        for piece in pieces:
            for name in names:
                values[name][np.ix_(piece.rows, piece.columns)] = piece.outcome.values[name]
        return values, ()
    count, outcomes = shape[0], [(piece.rows, piece.outcome) for piece in pieces]
    tongues = layout.method.unite(outcome.tongues for _, outcome in outcomes)
    place = {tongue: k for k, tongue in enumerate(tongues)}
    values = {}
    for own in layout.results:
        variable = own.variable
        listed = len(tongues)
        if variable.of_parts:
            # At least one entry: xarray cannot store dimensions of length zero here.
            listed = max(1, *(len(outcome.values[variable.name]) for _, outcome in outcomes))
        shape_of_rows = own.rows_shape(count, listed)
        values[variable.name] = np.full(shape_of_rows, variable.fill, dtype=variable.dtype)
        for members, outcome in outcomes:
            part = outcome.values[variable.name]
            index = np.array([place[tongue] for tongue in outcome.tongues], dtype=int)
            index = np.arange(len(part)) if variable.of_parts else index
            if variable.index_of == "tongue":
                part = moved(part, index)
            where = [np.arange(length) for length in shape_of_rows]
            where[variable.lead] = members
            if variable.listed:
                where[0] = index
            # Without a batch there is one row for all.
            values[variable.name][np.ix_(*where)] = part if part.ndim == len(where) else part[..., None]
    return values, tongues


def moved(positions: Array, index: Array) -> Array:
    """Positions in a list of tongues as those in another one; ``index``: where each tongue is there; -1 stays."""
    return np.append(index, -1)[positions]


def _encoded(
    plan: Plan, layout: Layout, block: GridBlock, values: dict[str, Array], tongues: tuple[Key, ...]
) -> FinishedBlock:
    chunks = {}
    for own in layout.results:
        data = values[own.variable.name].astype(own.variable.dtype, copy=False)
        chunks[own.variable.name] = own.encoded(own.over_axes(block, data, plan.inner(layout)))
    stable = values["stable"] if layout.tells else np.zeros(0)
    unstable, failed = stable.size - int(np.count_nonzero(stable)), int(np.count_nonzero(stable < 0))
    places = places_of({name: [len(chunk) for chunk in pieces] for name, pieces in chunks.items()})
    held = b"".join(chunk for pieces in chunks.values() for chunk in pieces)
    flags = flag_counts(layout, values)
    return FinishedBlock(block.key, tongues, places, block.points, unstable, failed, flags, held=held)


def flag_counts(layout: Layout, values: dict[str, Array]) -> dict[str, int]:
    """How many points of a grid carry each flag of ``status``; nothing of flags that none carries."""
    for variable in layout.method.results:
        if variable.name == "status" and GRID in variable.dims:
            return Flags.of(variable.attributes).counted(values["status"])
    return {}
