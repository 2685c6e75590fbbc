"""Facts of a design in a report: regions, damping required and at hand, probability, contact of the teeth."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import xarray as xr

from gearstab.config import Config, load
from gearstab.design import regions
from gearstab.design.problem import Span
from gearstab.floquet.boundaries import BUDGET, Boundaries, boundaries
from gearstab.floquet.boundaries.damped.proof import MODULI
from gearstab.floquet.boundaries.damped.search import COARSEST, PURSUIT
from gearstab.floquet.dispatch import in_modes, reduction
from gearstab.floquet.frequencies import AFFORDABLE, COMMON_PERIOD, Strategy, common_period
from gearstab.floquet.general.mean import whirl_motions
from gearstab.info import DangerousRegion, ShownSpeeds, label_text
from gearstab.info.configuration import HARMONICS
from gearstab.info.danger import CLOSED_BY, judged
from gearstab.methods.floquet import Floquet
from gearstab.modal import modal_damping_ratios
from gearstab.perturbation import Tongue
from gearstab.perturbation.tongues import SELF_EXCITED
from gearstab.response.speeds import force_bounds, speed_response
from gearstab.response.steady import STATUS_FLAGS
from gearstab.results import open_result
from gearstab.results.display import unit_of
from gearstab.sweep import plan, run
from gearstab.symmetry import natural_modes
from gearstab.system import Array, GearSystem, whirls

SPEEDS, BEYOND = 801, 101
"""Speeds of a range, and beyond either end of all ranges, at which growth rates are computed."""
STEADY_SPEEDS = 201
"""Speeds of a range at which steady states are computed."""
WORST = 3
"""Speeds at which teeth part that are named."""
MOST_WORK = 2.4e11
"""Multiplications of the search for all regions, by :func:`search_work`, from which on those near the tongues of first
order must do: about a minute."""
CONTACT = 8
"""Points that the search of an undamped system takes per meeting of its multipliers: 7 to 8."""
NAMED = 3
"""Tongues of one region that are named."""
NONE = float("nan")
OPEN, CLOSED, NOT_FOUND = "open", "closed by damping", "no growth found"
"""Verdicts on a region."""
INSIDE = 65
"""Speeds in and next to a region of first order at which growth is looked for."""


@dataclass(frozen=True)
class Reach:
    """A region of the operating range: open and exact, or closed by damping and of first order.

    lower, upper: exact edges; the first-order root twice of a closed one. required: the modal damping ratio that closes
    it, NaN where none was found; available: the least of its modes', NaN without damping. remedies: what else closes
    it, in words.
    """

    label: str
    kind: str
    modes: tuple[int, int]
    lower: float
    upper: float
    required: float
    available: float
    verdict: str
    remedies: str

    @property
    def middle(self) -> float:
        """Where it is, or would be."""
        return 0.5 * (self.lower + self.upper)

    @property
    def open(self) -> bool:
        """Whether it makes speeds unstable."""
        return self.verdict == OPEN


@dataclass(frozen=True)
class State:
    """A design: its system, operating ranges and configuration, and what was found of it.

    regions: all that were found in and near the ranges. complete: whether these are all there are. verified: whether
    the remedies are. refuted: remedies of first order that exact search refuted. uncovered: what is neither proved nor
    counted stable, "" where nothing is; and what has certificates, where these are asked for. speeds, growth_rates:
    ``(P,)``, mesh frequencies in and near the ranges, and the growth rates there.
    """

    word: str
    system: GearSystem
    spans: tuple[Span, ...]
    config: Config
    reaching: tuple[Reach, ...]
    narrow: int
    regions: tuple[tuple[float, float, str], ...]
    open: tuple[tuple[float, float, str], ...]
    speeds: Array
    growth_rates: Array
    outside: tuple[float, str] | None
    complete: bool
    verified: bool
    refuted: int
    uncovered: str

    @property
    def strategy(self) -> Strategy:
        """How growth rates are computed where there are several mesh frequencies."""
        return Floquet.whole(self.config.methods.floquet, self.system).strategy

    @property
    def growth_rate(self) -> float:
        """The largest growth rate in the operating ranges."""
        inside = [(self.speeds >= span.low) & (self.speeds <= span.high) for span in self.spans]
        return float(np.nanmax(self.growth_rates[np.any(inside, axis=0)]))


def curve_speeds(spans: Sequence[Span]) -> Array:
    """``(P,)``, mesh frequencies of operating ranges, SPEEDS of each, and beyond their ends, ascending."""
    low, high = min(span.low for span in spans), max(span.high for span in spans)
    away = 0.15 * (high - low)
    beyond = [np.linspace(max(low - away, 0.8 * low), low, BEYOND), np.linspace(high, high + away, BEYOND)]
    return np.unique(np.concatenate([*beyond, *(np.linspace(span.low, span.high, SPEEDS) for span in spans)]))


def state_of(word: str, system: GearSystem, spans: tuple[Span, ...], config: Config, speeds: Array) -> State:
    """Find out about a design, what is cheap first. Raises NotPossible for a system without a common period.

    speeds: mesh frequencies of the growth rates, see :func:`curve_speeds`.
    """
    growth = Floquet.whole(config.methods.floquet, system).solved(speeds).growth_rate[0]
    found = [judged(config, system, span.low, span.high, HARMONICS) for span in spans]
    sure = {one.verified for one in found} == {True}
    opened = [_reach(system, row, True) for one in found for row in one.open]
    rows = {item.label: item if sure else _looked_at(item, config, system) for item in opened}
    closed = {row.label: _reach(system, row, False) for one in found for row in one.closest}
    reaching = sorted(({**closed, **rows}).values(), key=lambda item: item.lower)
    near = regions.reach(min(span.low for span in spans), max(span.high for span in spans))
    uncovered, period = None, common_period(system)
    complete = period is not None and period.segments <= AFFORDABLE and search_work(system, *near) <= MOST_WORK
    if complete:
        own = boundaries(system, *near, regions.TOLERANCE, regions.FLOOR)
        uncovered = ". ".join(filter(None, (own.uncovered(), _certified(config, system, own))))
        edges = zip(own.lower.tolist(), own.upper.tolist(), own.members, strict=True)
        real = tuple((a, b, _label(a, b, members, rows.values())) for a, b, members in edges)
    else:
        real = tuple((item.lower, item.upper, item.label) for item in rows.values() if item.open)
    open_ = tuple(item for item in real if any(item[0] < span.high and item[1] > span.low for span in spans))
    away = [(min(max(a - s.high, s.low - b) for s in spans), label) for a, b, label in real]
    outside = min(((d, label) for d, label in away if d > 0), default=None)
    return State(
        word, system, spans, config, tuple(reaching), max(len(open_) - len(rows), 0), real, open_, speeds, growth,
        outside, complete, sure, sum(one.refuted for one in found), uncovered or "",
    )  # fmt: skip


def search_work(system: GearSystem, low: float, high: float) -> float:
    """Return about how many multiplications the search for all regions between two mesh frequencies takes.

    Without damping it looks at every meeting of multipliers: two modes meet every (w_p + w_q) T = 2 pi. With damping or
    terms it keeps to its budgets where its fewest points do.
    """
    parts = reduction(system).parts
    if system.damped or not in_modes(system):
        budgets = (2 + PURSUIT) * BUDGET
        return budgets + sum(MODULI * COARSEST * part.segments * (2.0 * part.size) ** 3 for part in parts)
    frequency = np.nan_to_num(natural_modes(system).natural_frequency)
    periods = float(system.common_period()[0]) * (1 / low - 1 / high)
    work = 0.0
    for part in parts:
        total = float(frequency[np.array(part.modes) - 1].sum()) / part.copies
        work += CONTACT * (part.size + 1) * total * periods * part.segments * part.size**3
    return work


def _certified(config: Config, system: GearSystem, found: Boundaries) -> str:
    """Share of the range with certificates, "" where they are not asked for."""
    if config.methods.boundaries is None or not config.methods.boundaries.certificate:
        return ""
    from gearstab.certificates.covering import certificates
    from gearstab.certificates.shares import around_edges, said, union_length

    (start, stop), edges = found.limits, found.edges_of(0)
    (pieces,) = certificates(system, start, stop, [edges])
    ends = np.array([(piece.low, piece.high) for piece in pieces]).reshape(-1, 2)
    covered, widest = union_length(ends, start, stop)
    return said(np.array([covered / (stop - start)]), np.array([widest]), around_edges(edges, ends, start, stop))


def _label(lower: float, upper: float, members: Sequence[Tongue], rows: Iterable[Reach]) -> str:
    """The tongues of a region by name, that of the row with about the same edges first, many of them by number."""
    names = [tongue.label for tongue in members]
    for row in rows:
        if min(upper, row.upper) - max(lower, row.lower) > 0.5 * (max(upper, row.upper) - min(lower, row.lower)):
            names.sort(key=row.label.__ne__)
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return " & ".join(names[:NAMED]) + more


def _reach(system: GearSystem, row: DangerousRegion, open_: bool) -> Reach:
    """A region with the damping ratios of its modes."""
    modes = row.mode_p, row.mode_q
    ratios = _damping_ratios(system, row.center_frequency)
    available = NONE if row.kind == SELF_EXCITED else float(min(ratios[mode - 1] for mode in modes))
    lower, upper = row.boundary_frequency if open_ and row.boundary_frequency else [row.center_frequency] * 2
    cells = {name: cell(row.closed_by) for name, cell in CLOSED_BY.items() if name != "damping ratio"}
    words = "; ".join(f"{name}: {text}" for name, text in cells.items() if text) if open_ else ""
    required = row.closed_by.damping_ratio or NONE
    return Reach(row.label, row.kind, modes, lower, upper, required, available, OPEN if open_ else CLOSED, words or "-")


def _damping_ratios(system: GearSystem, omega: float) -> Array:
    """``(n,)`` of the modes, of motions that are none of those at a mesh frequency, by their number there."""
    if not whirls(system):
        return modal_damping_ratios(system, natural_modes(system))
    found = whirl_motions(system, np.array([omega]))
    return np.asarray(found.damping_ratio[0, np.argsort(found.natural_frequency[0], kind="stable")])


def _looked_at(item: Reach, config: Config, system: GearSystem) -> Reach:
    """A region of first order, which counts as open where vibration grows in it or as far as it is wide beside it."""
    away = item.upper - item.lower
    omega = np.linspace(max(item.lower - away, 0.5 * item.lower), item.upper + away, INSIDE)
    growth = Floquet.whole(config.methods.floquet, system).solved(omega).growth_rate[0]
    return item if np.any(growth > 0) or np.isnan(growth).all() else replace(item, verdict=NOT_FOUND)


def growth_curve(states: Sequence[State], shown: ShownSpeeds) -> Any:
    """The growth rates and regions of designs of the same speeds, as the figure ``design`` wants them."""
    speed = states[0].speeds
    inside = [[r for r in state.regions if r[0] < speed[-1] and r[1] > speed[0]] for state in states]
    labels = [label for one in inside for _, _, label in one]
    edges = np.full((max(1, len(labels)), 2, len(states)), np.nan)
    place = 0
    for k, one in enumerate(inside):
        for lower, upper, _ in one:
            edges[place, :, k] = max(lower, speed[0]), min(upper, speed[-1])
            place += 1
    rates = np.stack([state.growth_rates for state in states], axis=1)
    ends = np.stack([[[s.low, s.high] for s in state.spans] for state in states], axis=-1)
    data = xr.Dataset(
        {
            "speed_growth_rate": (("speed", "state"), rates, {"units": unit_of(states[0].system, "1/s")}),
            "region_frequency": (("tongue", "side", "state"), edges / shown.scale),
            "range_frequency": (("operating_range", "side", "state"), ends / shown.scale),
        },
        {
            "speed": ("speed", speed / shown.scale, {"units": shown.unit or "1", "long_name": shown.name}),
            "state": [state.word for state in states],
            "label": ("tongue", [label_text(t.split(" & ")[0]) for t in labels] or [""]),
        },
    )  # fmt: skip
    return xr.DataTree.from_dict({"design": data})


def probability(config: Config, state: State) -> tuple[float, float, float, float] | None:
    """The largest probability of instability at a speed of the ranges, its interval (95 %) and that speed.

    None where the configuration gives no tolerances. Raises what a sweep raises.
    """
    options = config.tree.get("methods", {}).get("tolerance")
    if options is None:
        return None

    low, high = min(span.low for span in state.spans), max(span.high for span in state.spans)
    axis = {"mesh_frequency": {"start": low, "stop": high, "num": 201}}
    # The parameters that an axis gave keep their base values: the system is written out whole.
    settings = [f"sweep={json.dumps(axis)}", f"methods={json.dumps({'tolerance': options})}"]
    overrides = [*config.overrides, *settings]
    with TemporaryDirectory() as folder:
        out = Path(folder) / "tolerance.h5"
        run(plan(load(config.source, overrides)), out, jobs=1)
        with open_result(out) as tree:
            found = tree["tolerance"].to_dataset().load()
    k = int(np.argmax(found["probability"].values))
    values = [float(found[name].values[k]) for name in ("probability", "probability_lower", "probability_upper")]
    return values[0], values[1], values[2], float(found["mesh_frequency"].values[k])


@dataclass(frozen=True)
class ToothContact:
    """Loss of contact in the linear steady state.

    worst: up to WORST speeds at which teeth would part, the worst first. count, looked: at how many of how many speeds
    they do. load_factor: the largest. bound: whether all this comes from one frequency at a time, whose largest
    deviations add up.
    """

    worst: list[float]
    count: int
    looked: int
    load_factor: float
    bound: bool


def separation(state: State) -> ToothContact | None:
    """Judge whether teeth would part. None where nothing drives the system."""
    system = state.system
    if not system.forced:
        return None
    several = len(set(system.all_ratios)) > 1
    strategy = state.strategy
    long = strategy.period is None or strategy.period.segments > AFFORDABLE
    bound = several and (long or strategy.name != COMMON_PERIOD)
    parting: list[tuple[float, float]] = []
    count, looked, factor = 0, 0, 0.0
    for span in state.spans:
        omega = np.linspace(span.low, span.high, STEADY_SPEEDS)
        factors, parts = (_bounded if bound else _exactly)(system, omega)
        count, looked, factor = count + int(parts.sum()), looked + len(omega), max(factor, float(factors.max()))
        parting += [(float(factors[k]), float(omega[k])) for k in _peaks(factors) if parts[k]]
    worst = [speed for _, speed in sorted(parting, reverse=True)[:WORST]]
    return ToothContact(worst, count, looked, factor, bound)


def _exactly(system: GearSystem, omega: Array) -> tuple[Array, Array]:
    """The largest load factor at every speed, and whether a loaded mesh's force changes its sign."""
    found = speed_response(system, omega)
    factors = np.nan_to_num(np.nanmax(found.dynamic_load_factor[0].reshape(len(omega), -1), axis=1))
    return factors, (found.status[0] & STATUS_FLAGS["separation"]) != 0


def _bounded(system: GearSystem, omega: Array) -> tuple[Array, Array]:
    """The same by the bounds of one frequency at a time."""
    found = force_bounds(system, omega)
    loaded = found.static[0] > 0
    return np.nanmax(np.nan_to_num(found.load_factor[0]), axis=1), np.any(loaded & (found.least[0] < 0), axis=1)


def _peaks(values: Array) -> list[int]:
    """Places of local maxima, ends included."""
    padded = np.concatenate([[-np.inf], values, [-np.inf]])
    return np.flatnonzero((padded[1:-1] >= padded[:-2]) & (padded[1:-1] > padded[2:])).tolist()
