"""Weak teeth: a crack or a pit makes a mesh softer whenever the pair of that tooth carries, once in a revolution.

    k(t) = sum_j k_pair(x - j) (1 - (1 - q) [j = 0 mod z])

The part that is missing is a mesh of its own along the same direction, with the frequency r/z of its gear, so that
stability over the common period is as exact as ever. All else of the mesh stays: damping, mesh force of healthy teeth.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from gearstab.config.document import nearest
from gearstab.config.model.conflicts import Conflict, items, within_each
from gearstab.config.model.fields import Choice, NameText, Quantity, Section, Whole
from gearstab.config.model.reading import WRONG
from gearstab.mesh import Mesh
from gearstab.systems.forcing import GearError
from gearstab.waveforms import Tooth
from gearstab.waveforms.base import Array, Waveform, stiff_fraction, wrapped
from gearstab.waveforms.tooth import ROUNDING, Piecewise, angles_of, averaged, interpolated, stacked
from gearstab.waveforms.tooth_pair import ToothPair

DEGREES = (8, 16, 32, 64)
"""Degrees of the polynomials that approximate a smooth stiffness; tried in turn until the last coefficients vanish."""
RESOLVED = 1e-12

OnePair = Callable[[Array, Array], Array]
"""(phase x in mesh periods since a pair entered, its number of cycles floor(x)) -> stiffness of that pair, N/m."""


def equal_shares(wave: Waveform, contact_ratio: Array, mean: Array, amplitude: Array) -> OnePair:
    """Return the stiffness of one of n(x) equal pairs, k(x)/n(x), with k = mean + 2 amplitude w(x)."""
    c = np.asarray(contact_ratio, dtype=float)

    def of(x: Array, cycle: Array) -> Array:
        phase = wrapped(x)
        pairs = np.floor(c) + (phase < stiff_fraction(c))
        found: Array = (np.asarray(mean) + 2 * np.asarray(amplitude) * wave.value(phase)) / pairs
        return found

    return of


def own_pairs(wave: ToothPair, mean: Array, amplitude: Array) -> OnePair:
    """Return the stiffness of one pair of a wave that sums over pairs, k = a + b sum_j p: b p and its share of a."""
    size = 2 * wave.amplitude
    b = np.where(size > 0, 2 * np.asarray(amplitude) / np.where(size > 0, size, 1.0), 0.0)
    a = np.asarray(mean) - b * wave.mean_stiffness
    rest = equal_shares(wave, np.asarray(wave.contact_ratio), a, np.zeros(()))

    def of(x: Array, cycle: Array) -> Array:
        found: Array = b * wave.shape.value(x / np.asarray(wave.contact_ratio)) + rest(x, cycle)
        return found

    return of


def missing(wave: Waveform, contact_ratio: Array, teeth: int, loss: Array, one_pair: OnePair) -> Piecewise:
    """Return -loss k_pair(z u) over the revolution 0 <= u < 1, in which pair 0 of z enters at u = 0 and leaves at c/z.

    With it a mesh has k(x) = sum_j k_pair(x - j) (1 - loss [j = 0 mod z]). A wave that is piecewise constant loses a
    piecewise constant part.

    Parameters
    ----------
    wave: of the mesh, whose kinks and jumps the lost part shares. contact_ratio: ``(...)``, c < z. teeth: z.
    loss: ``(...)``, 1 - q of a pair whose stiffness is q times that of the others.
    """
    c = np.asarray(contact_ratio, dtype=float)
    edges = _edges(wave, c)
    ends = np.concatenate([edges[..., 1:], np.broadcast_to(c[..., None], (*edges.shape[:-1], 1))], axis=-1)
    for degree in (0,) if wave.piecewise_constant else DEGREES:
        coefficients = _polynomials(edges, ends, degree, one_pair)
        size = np.abs(coefficients)
        if degree == 0 or size[..., -2:].max() < RESOLVED * size.max():
            break
    lost = -np.asarray(loss)[..., None, None] * coefficients
    kept = np.flatnonzero(np.abs(lost).reshape(-1, lost.shape[-1]).max(axis=0) > ROUNDING * np.abs(lost).max())
    lost = lost[..., : kept[-1] + 1 if len(kept) else 1]
    if lost.shape[-1] == 1:
        lost, edges = _joined(lost, edges)
    rest = np.zeros((*lost.shape[:-2], 1, lost.shape[-1]))
    places = np.concatenate([edges, np.broadcast_to(c[..., None], (*edges.shape[:-1], 1))], axis=-1) / teeth
    places = np.broadcast_to(places, (*lost.shape[:-2], places.shape[-1]))
    return Piecewise(places, np.concatenate([lost, rest], axis=-2))


def over_the_width(course: Piecewise, overlap: Array) -> Piecewise:
    """Return the mean of a course over the overlap ratio of helical teeth ``(...)``, in revolutions; 0 of spur ones."""
    if not np.any(overlap):
        return course
    batch = np.broadcast_shapes(course.batch, np.shape(overlap))
    edges, tables = np.asarray(course.edges), np.asarray(course.coefficients)
    each = zip(
        np.broadcast_to(edges, (*batch, *edges.shape[-1:])).reshape(-1, *edges.shape[-1:]),
        np.broadcast_to(tables, (*batch, *tables.shape[-2:])).reshape(-1, *tables.shape[-2:]),
        np.broadcast_to(overlap, batch).ravel(),
        strict=True,
    )
    return stacked([averaged(Piecewise(at, table), float(width)) for at, table, width in each], batch)


def _joined(levels: Array, edges: Array) -> tuple[Array, Array]:
    """Leave out pieces whose level is that of the piece before, in every entry of the batch."""
    steps = np.abs(np.diff(levels[..., 0], axis=-1)).reshape(-1, levels.shape[-2] - 1).max(axis=0)
    kept = np.concatenate([[True], steps > ROUNDING * np.abs(levels).max()])
    return levels[..., kept, :], edges[..., kept]


def _edges(wave: Waveform, c: Array) -> Array:
    """``(..., B)`` ascending in [0, c]: where pairs enter and leave, and the kinks of the wave, in every cycle."""
    d = stiff_fraction(c)[..., None]
    breaks = np.asarray(wave.breakpoints())
    batch = np.broadcast_shapes(d.shape[:-1], breaks.shape[:-1])
    own = [np.broadcast_to(part, (*batch, part.shape[-1])) for part in (np.zeros_like(d), d, breaks)]
    inner = np.concatenate(own, axis=-1)
    cycles = np.arange(int(np.max(np.floor(c), initial=0.0)) + 1)
    found = (inner[..., None, :] + cycles[:, None]).reshape(*batch, -1)
    if not batch:
        found = np.unique(found)
    return np.sort(np.minimum(found, c[..., None]), axis=-1)


def _polynomials(edges: Array, ends: Array, degree: int, one_pair: OnePair) -> Array:
    """``(..., B, degree + 1)``, Chebyshev coefficients of the stiffness of the pair on each piece."""
    middle, half = (edges + ends) / 2, (ends - edges) / 2
    x = middle[..., None] + half[..., None] * np.cos(angles_of(degree))
    at = np.moveaxis(x, (-2, -1), (0, 1))
    cycle = np.moveaxis(np.broadcast_to(np.floor(middle)[..., None], x.shape), (-2, -1), (0, 1))
    return interpolated(np.moveaxis(one_pair(at, cycle), (0, 1), (-2, -1)))


KINDS_OF_FAULT = ("crack", "pit")


class Fault(Section):
    """A weak tooth of a gear in a mesh."""

    gear: NameText
    """Name of the gear that has it."""
    tooth: Annotated[int, Field(ge=1), Whole] = Field(default=1, title="number of the tooth")
    """Tooth 1 enters at the start of the mesh's wave, 2 next."""
    kind: Annotated[str, Choice("fault", KINDS_OF_FAULT)] = Field(default="crack", title="kind of fault")
    """crack or pit; a crack of a planet's tooth weakens its meshes with sun and ring, a pit one."""
    factor: Annotated[float, Field(gt=0, lt=1), Quantity()] = Field(title="stiffness factor")
    """q: stiffness of its pair over that of a healthy one (1)."""

    def conflicts(self, gears: Sequence[str], teeth: Mapping[str, Fraction | None]) -> Iterator[Conflict]:
        """A gear of the mesh, and a tooth that it has. gears, teeth: as in :func:`fault_conflicts`."""
        yield from absent_gear(self, gears)
        count = teeth.get(self.gear)
        if count is not None and self.tooth > count:
            yield ("tooth",), "out_of_range", f"gear '{self.gear}' has {count} teeth", f"write 1 to {count}"


def fault_conflicts(section: Any, gears: Sequence[str], teeth: Mapping[str, Fraction | None]) -> Iterator[Conflict]:
    """Yield faults of gears that are not in a mesh, of teeth that there are not, and what faults exclude.

    gears: those of the mesh. teeth: their numbers of teeth, by name, None where there are none.
    """
    faults = items(section.faults)
    yield from within_each(section, "faults", lambda fault: fault.conflicts(gears, teeth))
    if not together([fault for _, fault in faults]):
        message = "leave the pair without stiffness where both weak teeth meet"
        yield ("faults",), "out_of_range", message, "give factors whose losses 1 - factor add up to less than 1"
    if faults:
        yield from excluded(section, ("friction", "backlash", "relief"), "faults of the teeth")


def absent_gear(item: Fault | GearError, gears: Sequence[str]) -> Iterator[Conflict]:
    """Yield a conflict where ``gear`` of a section names none of the gears of a mesh."""
    names = [name for _, name in items(gears)]
    if item.gear is not WRONG and item.gear not in names:
        yield ("gear",), "unknown_name", f"'{item.gear}' is no gear of this mesh", nearest(item.gear, names)


def excluded(section: Any, keys: Sequence[str], other: str) -> Iterator[Conflict]:
    """Yield a conflict for each key that is given and does not go with another part of the section."""
    for key in keys:
        value = getattr(section, key, None)
        if value is not WRONG and value:
            yield (key,), "not_applicable", f"is not available with {other}", "keep one of the two"


def together(faults: Sequence[Fault]) -> bool:
    """Return whether the teeth that may meet in one pair, one of each gear, leave a positive stiffness."""
    worst: dict[str, float] = {}
    for fault in faults:
        if fault.gear is not WRONG and fault.factor is not WRONG:
            worst[fault.gear] = max(worst.get(fault.gear, 0.0), 1 - fault.factor)
    return len(worst) < 2 or sum(worst.values()) < 1


def weak_tooth(
    mesh: Mesh,
    name: str,
    teeth: int,
    factor: Any,
    contact_ratio: Array,
    cycles: Any,
    one_pair: OnePair | None = None,
    overlap: Array | float = 0.0,
) -> Mesh:
    """Return the stiffness that a mesh lacks while its weak pair carries, as a mesh that is part of it.

    teeth: z of the gear that has the fault. factor: q. cycles: how many cycles after the start of the wave of the mesh
    the weak pair enters first. one_pair: the stiffness of one pair of teeth of the transverse section where it is
    known, else pairs share that of the mesh equally; with it overlap: the overlap ratio of helical teeth.
    """
    wave, own = mesh.waveform, (mesh.mean_stiffness, mesh.amplitude)
    if one_pair is None:
        one_pair = own_pairs(wave, *own) if isinstance(wave, ToothPair) else equal_shares(wave, contact_ratio, *own)
    course = missing(wave, contact_ratio, teeth, 1 - np.asarray(factor, dtype=float), one_pair)
    lost = Tooth(over_the_width(course, np.asarray(overlap) / teeth))
    ratio, lag = mesh.frequency_ratio / Fraction(teeth), (mesh.lag + cycles) / teeth
    epsilon = lost.amplitude / lost.mean_stiffness
    return Mesh(name, mesh.direction, lost.mean_stiffness, epsilon, lost, ratio, lag, part_of=mesh.name)
