"""Quantities that judge designs, for many systems at once; see
:data:`gearstab.config.sections.design.QUANTITIES`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import ceil

import numpy as np

from gearstab.design import regions
from gearstab.design.problem import Batch, Span
from gearstab.modal import mean_modes
from gearstab.system import ANY_LINEAR, WHIRLING, Array, Feature, GearSystem, unsupported, whirls

UNIFORM = 48
"""Points over a range at which growth, required damping or response are computed, besides those in regions."""
STEADY = 24
"""The same of steady states, which take longest."""
INSIDE = 9
"""Points in a region."""
ZOOMS = 3
"""Refinements around the largest value, each of INSIDE points."""
LARGEST_DAMPING = 0.5
SAMPLES = 8
"""Samples of a steady state per period of the fastest mode."""
MOST_SAMPLES = (100, 8000)
"""Least and largest number of samples per period of the first mesh."""


def instability_width(batch: Batch) -> Array:
    """Sum, over the ranges, of weight times unstable length, in the speed that the range is given in."""
    total = np.zeros(batch.system.rows)
    for span in batch.spans:
        total += span.weight / span.factor * regions.exact(batch.system, span.low, span.high).width(span.low, span.high)
    return total


def tongue_distance(batch: Batch) -> Array:
    """The least distance from a region to a range, in the speed that it is given in; the reach where none is found."""
    found = []
    for span in batch.spans:
        low, high = regions.reach(span.low, span.high)
        away = regions.exact(batch.system, low, high).distance(span.low, span.high)
        found.append(np.minimum(away, min(span.low - low, high - span.high)) / span.factor)
    return np.asarray(np.min(found, axis=0))


def growth_rate(batch: Batch) -> Array:
    """The largest weight times growth rate over the ranges."""
    from gearstab.floquet import solve

    return _largest(batch, batch.system, lambda system, omega: solve(system, omega).growth_rate)


def required_damping(batch: Batch) -> Array:
    """The largest weight times required modal damping ratio over the ranges; infinite where 0.5 is not enough."""

    def value(system: GearSystem, omega: Array) -> Array:
        found = damping_over(system, omega)
        return np.where(np.isnan(found), np.inf, found)

    # Outside of the regions without damping none is required, unless the mean system grows by itself.
    uniform = 2 if unsupported(batch.system, {Feature.IRRATIONAL_RATIO}) is None else UNIFORM
    return _largest(batch, _conservative(batch.system), value, uniform=uniform)


def _conservative(system: GearSystem) -> GearSystem:
    """Return the system without damping and without anything else that does work, whose regions are found quickly."""
    rotations = tuple(replace(rotation, circulatory=None) for rotation in system.rotations)
    return replace(system, damping=None, terms=(), rotations=rotations)


def load_factor(batch: Batch) -> Array:
    """The largest weight times dynamic load factor of any mesh over the ranges."""
    lowest = min(span.low for span in batch.spans)

    def value(system: GearSystem, omega: Array) -> Array:
        return load_factor_over(system, omega, lowest)

    return _largest(batch, None, value, uniform=STEADY)


def load_factor_over(system: GearSystem, omega: Array, lowest: float | None = None) -> Array:
    """``(rows, P)``, the largest dynamic load factor of any mesh at mesh frequencies; samples are enough for the
    lowest one.
    """
    from gearstab.response.speeds import speed_response

    fastest = float(np.nanmax(mean_modes(system).natural_frequency))
    samples = int(np.clip(ceil(SAMPLES * fastest / (lowest or float(np.min(omega)))), *MOST_SAMPLES))
    return np.asarray(np.nanmax(speed_response(system, omega, samples).dynamic_load_factor, axis=-1))


def damping_over(system: GearSystem, omega: Array) -> Array:
    """``(rows, P)``, the modal damping ratio that stabilises a point, in place of the system's own; NaN above 0.5."""
    from gearstab.floquet.required_damping import required_damping as required

    own = system if whirls(system) else replace(system, damping=None)
    return required(own, omega, largest=LARGEST_DAMPING).value


def root_stress(batch: Batch) -> Array:
    """The largest stress at the root of any tooth under the static mesh forces, Pa; needs the teeth of a gearbox."""
    from gearstab.gears.stress import mesh_root_stress
    from gearstab.modal import static_mesh_force

    train, rows = batch.p.train(), batch.system.rows
    if train is None:
        return np.full(rows, np.nan)
    phase = np.linspace(0.0, 1.0, 65)
    force = np.abs(batch.system.flat(static_mesh_force(batch.system), 1))
    worst = np.zeros(rows)
    for k, mesh in enumerate(mesh.teeth for mesh in train.meshes):
        index = np.broadcast_to(np.arange(len(mesh.pairs)).reshape(mesh.batch), batch.system.batch).ravel()
        unit = [
            float(np.nanmax(np.stack(mesh_root_stress(pair, phase, np.ones(65), model))))
            for pair, model in zip(mesh.pairs, mesh.models, strict=True)
        ]
        worst = np.maximum(worst, force[:, k] * np.array(unit)[index])
    return worst


def transmission_error(batch: Batch) -> Array:
    """The sum of the peak-to-peak static transmission errors of all meshes with relief, m, one of each set's alike."""
    train, total = batch.p.train(), np.zeros(batch.system.batch)
    meshes = [] if train is None else [mesh.teeth for mesh in train.meshes if mesh.teeth.relieved]
    for teeth in {id(own): own for own in meshes}.values():
        total = total + np.reshape([mesh.peak_to_peak for mesh in teeth.loaded], teeth.batch)
    return np.ravel(total)


def _largest(
    batch: Batch, regional: GearSystem | None, value: Callable[[GearSystem, Array], Array], uniform: int = UNIFORM
) -> Array:
    """The largest value over all ranges: at points over each, in each region, and closer and closer around the best.

    regional: the system whose regions count; None for points over the ranges alone.
    """
    found = [span.weight * _peak(batch.system, regional, span, value, uniform) for span in batch.spans]
    return np.asarray(np.max(found, axis=0))


def _peak(
    system: GearSystem, regional: GearSystem | None, span: Span, value: Callable[[GearSystem, Array], Array],
    uniform: int,
) -> Array:  # fmt: skip
    omega = np.broadcast_to(np.linspace(span.low, span.high, uniform), (system.rows, uniform))
    if regional is not None and not unsupported(regional, REGIONS):
        omega = np.concatenate([omega, _within(regional, span)], axis=1)
    omega = np.sort(omega, axis=1)
    values = value(system, omega)
    for _ in range(ZOOMS):
        best = np.argmax(np.where(np.isnan(values), -np.inf, values), axis=1)[:, None]
        left = np.take_along_axis(omega, np.maximum(best - 1, 0), 1)
        right = np.take_along_axis(omega, np.minimum(best + 1, omega.shape[1] - 1), 1)
        closer = left + (right - left) * np.linspace(0.0, 1.0, INSIDE)
        found = np.concatenate([value(system, closer), np.take_along_axis(values, best, 1)], axis=1)
        omega = np.concatenate([closer, np.take_along_axis(omega, best, 1)], axis=1)
        order = np.argsort(omega, axis=1)
        omega, values = np.take_along_axis(omega, order, 1), np.take_along_axis(found, order, 1)
    return np.asarray(np.max(np.where(np.isnan(values), -np.inf, values), axis=1))


def _within(system: GearSystem, span: Span) -> Array:
    """``(rows, K)``, points in every region; where a row has fewer regions the lower end of the range."""
    found = regions.exact(system, span.low, span.high)
    part = np.linspace(0.05, 0.95, INSIDE)
    points = found.lower[..., None] + (found.upper - found.lower)[..., None] * part
    flat = points.reshape(len(points), -1)
    return np.where(np.isnan(flat), span.low, flat)


EXACT: dict[str, Callable[[Batch], Array]] = {
    function.__name__: function
    for function in (
        instability_width,
        growth_rate,
        required_damping,
        load_factor,
        tongue_distance,
        root_stress,
        transmission_error,
    )
}
"""By name, the value of each row; NaN where there is none."""

REGIONS = WHIRLING
"""The features of systems whose regions are found by root finding."""
SUPPORTS: dict[str, frozenset[Feature]] = dict.fromkeys(EXACT, REGIONS) | {
    "growth_rate": REGIONS | {Feature.PERIODIC_TERMS},
    "load_factor": REGIONS | {Feature.PERIODIC_TERMS},
    "required_damping": REGIONS | {Feature.PERIODIC_TERMS},
    "root_stress": ANY_LINEAR | WHIRLING,
    "transmission_error": ANY_LINEAR | WHIRLING,
}
"""By name, the features of systems for which a quantity can be computed."""


def first_order_width(batch: Batch) -> Array:
    """The instability width as first-order theory predicts it, less the distance where it is zero."""
    total, away = np.zeros(batch.system.rows), np.full(batch.system.rows, np.inf)
    for span in batch.spans:
        found = regions.predicted(batch.system, span.low, span.high)
        total += span.weight / span.factor * found.width(span.low, span.high)
        low, high = regions.reach(span.low, span.high)
        most = min(span.low - low, high - span.high)
        away = np.minimum(away, np.minimum(found.distance(span.low, span.high), most) / span.factor)
    return np.where(total > 0, total, -away)


SCREENED = ("instability_width", "growth_rate", "required_damping")
"""Quantities that go with the widths of the regions, so that first-order widths give the start of a search."""


def screened(weights: Sequence[str]) -> bool:
    """Whether first-order theory says something of an objective."""
    return any(name in SCREENED for name in weights)
