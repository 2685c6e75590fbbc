"""What a report says of a design: regions, damping required and at hand, loss of contact, probability."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from gearstab.config import Config
from gearstab.design.judging import regions
from gearstab.design.problem import Span
from gearstab.floquet import solve
from gearstab.floquet.boundaries import boundaries
from gearstab.floquet.required_damping import required_damping
from gearstab.info.danger import CLOSED_BY, planets_step, remedies_of
from gearstab.modal import mean_modes, modal_damping_ratios
from gearstab.perturbation import Tongue
from gearstab.perturbation.ranking import RankedRegion
from gearstab.perturbation.remedies import resonance
from gearstab.system import Array, GearSystem

INSIDE = 25
"""Speeds of a region at which the required damping is computed."""
SPEEDS = 801
"""Speeds at which growth rates and loads are computed."""
MOST = 12
"""Regions of a table."""


@dataclass(frozen=True)
class Reach:
    """A region of the undamped system that reaches into the operating range.

    required: the modal damping ratio that closes it; available: the least of its modes', NaN without damping.
    open: whether the system with its damping is unstable somewhere in it. remedies: what closes it, in words.
    """

    tongue: Tongue
    lower: float
    upper: float
    required: float
    available: float
    open: bool
    remedies: str


@dataclass(frozen=True)
class State:
    """A design: its system, operating ranges and configuration, and what was found of it."""

    word: str
    system: GearSystem
    spans: tuple[Span, ...]
    config: Config
    reaching: tuple[Reach, ...]
    narrow: int
    open: tuple[tuple[float, float, str], ...]
    growth_rate: float
    outside: tuple[float, str] | None


def state_of(word: str, system: GearSystem, spans: tuple[Span, ...], config: Config) -> State:
    """Find out about a design. Raises NotPossible for a system without a common period."""
    low, high = min(span.low for span in spans), max(span.high for span in spans)
    near = regions.reach(low, high)
    free = boundaries(replace(system, damping=None), *near, regions.TOLERANCE, regions.FLOOR)
    own = free if system.damping is None else boundaries(system, *near, regions.TOLERANCE, regions.FLOOR)
    inside = [k for k in range(len(free.row)) if _touches(free.lower[k], free.upper[k], spans)]
    inside.sort(key=lambda k: free.lower[k] - free.upper[k])
    real = [(float(a), float(b), _label(m)) for a, b, m in zip(own.lower, own.upper, own.members, strict=True)]
    open_ = tuple(item for item in real if _touches(item[0], item[1], spans))
    away = [(min(max(a - s.high, s.low - b) for s in spans), label) for a, b, label in real]
    outside = min(((d, label) for d, label in away if d > 0), default=None)
    shown = sorted(inside[:MOST], key=lambda k: free.lower[k])
    reaching = tuple(
        _reach(system, config, free.members[k], float(free.lower[k]), float(free.upper[k]), spans, open_) for k in shown
    )
    omega = np.concatenate([np.linspace(span.low, span.high, SPEEDS) for span in spans])
    growth = float(np.nanmax(solve(system, omega).growth_rate))
    return State(word, system, spans, config, reaching, len(inside) - len(shown), open_, growth, outside)


def _touches(lower: float, upper: float, spans: Sequence[Span]) -> bool:
    return any(lower < span.high and upper > span.low for span in spans)


def _label(members: Sequence[Tongue]) -> str:
    return " & ".join(tongue.label for tongue in members)


def _reach(
    system: GearSystem,
    config: Config,
    members: Sequence[Tongue],
    lower: float,
    upper: float,
    spans: Sequence[Span],
    open_: Sequence[tuple[float, float, str]],
) -> Reach:
    tongue = members[0]
    span = next(s for s in spans if lower < s.high and upper > s.low)
    low, high = max(lower, span.low), min(upper, span.high)
    part = np.linspace(0.02, 0.98, INSIDE)
    required = float(np.max(required_damping(system, low + (high - low) * part).value))
    ratios = modal_damping_ratios(system, mean_modes(system))
    available = float(min(ratios[tongue.mode_p - 1], ratios[tongue.mode_q - 1]))
    touched = any(a < high and b > low for a, b, _ in open_)
    words = "; ".join(_remedies(system, config, tongue, lower, upper))
    return Reach(tongue, lower, upper, required, available, touched, words or "-")


def _remedies(system: GearSystem, config: Config, tongue: Tongue, lower: float, upper: float) -> list[str]:
    """What closes a region to first order, a remedy each."""
    if tongue.harmonic < 1:
        return []
    region = RankedRegion(tongue, lower, upper, upper - lower, False, 0.0, resonance(system, tongue))
    found = remedies_of(config, system, region, planets_step(system))
    cells = {name: cell(found) for name, cell in CLOSED_BY.items() if name != "damping ratio"}
    return [f"{name}: {text}" for name, text in cells.items() if text]


def growth_curve(states: Sequence[State]) -> Any:
    """The growth rates and regions of designs, as the figure ``design`` wants them."""
    import xarray as xr

    spans = [span for state in states for span in state.spans]
    low, high = min(span.low for span in spans), max(span.high for span in spans)
    away = 0.15 * (high - low)
    speed = np.linspace(max(low - away, 0.8 * low), high + away, SPEEDS)
    found = [boundaries(state.system, speed[0], speed[-1], regions.TOLERANCE, regions.FLOOR) for state in states]
    labels = [members[0].label for one in found for members in one.members]
    edges = np.full((max(1, len(labels)), 2, len(states)), np.nan)
    place = 0
    for k, one in enumerate(found):
        edges[place : place + len(one.row), :, k] = np.stack([one.lower, one.upper], axis=1)
        place += len(one.row)
    rates = np.stack([solve(state.system, speed).growth_rate[0] for state in states], axis=1)
    ends = np.stack([[[s.low, s.high] for s in state.spans] for state in states], axis=-1)
    data = xr.Dataset(
        {
            "speed_growth_rate": (("speed", "state"), rates, {"units": _unit(states[0].system, "1/s")}),
            "region_frequency": (("tongue", "side", "state"), edges),
            "range_frequency": (("operating_range", "side", "state"), ends),
        },
        {
            "speed": ("speed", speed, {"units": _unit(states[0].system, "rad/s")}),
            "state": [state.word for state in states], "label": ("tongue", labels or [""]),
        },
    )  # fmt: skip
    return xr.DataTree.from_dict({"design": data})


def _unit(system: GearSystem, unit: str) -> str:
    from gearstab.results.units import unit_of

    return unit_of(system, unit)


def separation(state: State) -> tuple[list[tuple[float, float]], float] | None:
    """Stretches of the ranges where teeth would part in the linear steady state, and the largest load factor.

    None where nothing drives the system.
    """
    from gearstab.response.linear.speeds import speed_response
    from gearstab.response.linear.steady import STATUS_FLAGS

    if not state.system.forced:
        return None
    stretches: list[tuple[float, float]] = []
    factor = 0.0
    for span in state.spans:
        omega = np.linspace(span.low, span.high, 201)
        found = speed_response(state.system, omega)
        flagged = (found.status[0] & STATUS_FLAGS["separation"]) != 0
        stretches += [(float(omega[a]), float(omega[b])) for a, b in _runs(flagged)]
        factors = found.dynamic_load_factor[0]
        if np.isfinite(factors).any():
            factor = max(factor, float(np.nanmax(factors)))
    return stretches, factor


def _runs(flags: Array) -> list[tuple[int, int]]:
    """First and last place of every run of True."""
    padded = np.concatenate([[False], flags, [False]]).astype(int)
    begin, end = np.flatnonzero(np.diff(padded) == 1), np.flatnonzero(np.diff(padded) == -1) - 1
    return list(zip(begin.tolist(), end.tolist(), strict=True))


def probability(config: Config, state: State) -> tuple[float, float, float, float] | None:
    """The largest probability of instability at a speed of the ranges, its interval (95 %) and that speed.

    None where the configuration gives no tolerances. Raises what a sweep raises.
    """
    options = config.tree.get("methods", {}).get("tolerance")
    if options is None:
        return None
    from gearstab.config import load
    from gearstab.results import open_result
    from gearstab.sweep import plan, run

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
