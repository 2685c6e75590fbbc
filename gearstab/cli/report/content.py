"""From what was found out to the blocks of a page, in plain words."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import isnan
from typing import Any

from gearstab.cli.report import facts, sections
from gearstab.cli.report.facts import State
from gearstab.cli.report.page import Block, BulletList, Heading, Page, Table, Text
from gearstab.config import Config, ConfigError
from gearstab.design import check
from gearstab.design.problem import DesignProblem, Span
from gearstab.design.regions import single
from gearstab.design.solution import Solution, solved
from gearstab.errors import NotPossible
from gearstab.info import MeanSystem, ShownSpeeds, label_text, time_unit, unit_asked
from gearstab.results.display import in_brackets
from gearstab.support import WHIRLING, unsupported, whirls
from gearstab.system import Feature

EXACT = (
    "Edges of open regions are exact for this model, to 1e-7 of the mesh frequency; regions narrower than 1e-5 of it "
    "are left out. What closes a region is proposed by first-order theory and listed where exact search confirms it, "
    "unless it is called not verified. Regions that damping closes are those of first order."
)
WHIRLING_EXACT = (
    "Edges of open regions are exact for this model, to 1e-7 of the mesh frequency; regions narrower than 1e-5 of it "
    "are left out. Modes are numbered by their frequency at the speed of a region, and damping ratios are those there. "
    "What closes a region is not proposed: the rules for it go by modes that do not whirl. Regions that damping closes "
    "are those of first order."
)
FIRST_ORDER = (
    "Regions, their edges and what closes them are those of first-order theory. A region counts as open where growth "
    "rates of Floquet theory, {strategy}, are positive in it or beside it."
)
LIMITS = (
    "The model is a linear system of rigid bodies and springs whose mesh stiffness varies periodically with time at "
    "constant speed. Instability means that its vibration grows without bound; a real gear then loses contact, "
    "hammers and settles to a large nonlinear vibration, which this report does not predict.",
    "Instability is parametric: it needs neither a transmission error nor an imbalance. Forced resonance, wear, "
    "lubrication, and changes of speed are not judged here.",
    "The required damping is one modal damping ratio for all modes. That of real gears is known to a factor of two or "
    "so.",
    "Mesh stiffness and its variation are as uncertain as their source: computed from teeth, the variation, and with "
    "it the width of every region, may be wrong by a factor of about two.",
)


STEPS = ("instability regions", "pictures", "contact of the teeth", "uncertainty")
"""Steps that :func:`page` announces; a search of designs says more before the first."""


def page(config: Config, say: Callable[[str], None], unit: str = "") -> Page:
    """Compute all that the report says, what is cheap first, and put it in order.

    unit: in which speeds are written, "" for that in which they were typed. Raises ConfigError, NotPossible.
    """
    solution = _solution(config, say)
    say(STEPS[0])
    states = _states(config, solution)
    shown = _shown(config, states[0], unit)
    blocks: list[Block] = [Text(text, strong=True) for text in (*_mean(states[0]), _verdict(states[0], shown))]
    if solution is not None:
        blocks.append(Text(f"With the proposed design: {_verdict(states[-1], shown)}", strong=True))
    blocks += _range(states[0], shown)
    for state in states:
        blocks += _regions(state, shown)
    say(STEPS[1])
    blocks += sections.pictures(solution, states, shown)
    if solution is not None:
        blocks += sections.design(solution)
    say(STEPS[2])
    blocks += sections.teeth(states, shown)
    say(STEPS[3])
    blocks += sections.uncertainty(config, states[0], shown)
    blocks += sections.modes(states[0], shown)
    blocks += [Heading("Assumptions and limits"), BulletList([_sureness(states[0]), *LIMITS])]
    blocks += sections.provenance(config)
    return Page(config.title, blocks)


def _solution(config: Config, say: Callable[[str], None]) -> Solution | None:
    if config.design is None:
        return None

    check(config)
    return solved(DesignProblem(config, config.design), say)


def _states(config: Config, solution: Solution | None) -> list[State]:
    """The given design and, where one was searched, the proposed one."""
    if solution is None:
        system = config.system.build()
        if refused := unsupported(system, {Feature.PERIODIC_TERMS} | WHIRLING):
            raise NotPossible(f"a report {refused[0]}", refused[1])
        spans = _spans(config)
        return [facts.state_of("given", system, spans, config, facts.curve_speeds(spans))]
    designs = {"given": solution.problem.given[0], "proposed": solution.optimum}
    found = {word: single(solution.problem, design) for word, design in designs.items()}
    speeds = facts.curve_speeds([span for _, spans, _ in found.values() for span in spans])
    return [
        facts.state_of(word, system, spans, replace(config, system=p), speeds)
        for word, (system, spans, p) in found.items()
    ]


def _spans(config: Config) -> tuple[Any, ...]:
    """The operating range of a configuration without a design: that of its sweep. Raises ConfigError."""
    for axis in config.axes:
        for item in axis.assignments:
            if item.path == ("mesh_frequency",) and axis.name in ("mesh_frequency", "input_speed"):
                low, high = (end * item.factor for end in axis.span)
                if low < high:
                    return (Span(low, high, 1.0, item.factor),)
    hint = "add sweep.mesh_frequency: {start: .., stop: .., num: ..}, or a section design with its range"
    raise ConfigError([config.problem(("sweep",), "needs_other", "a report needs an operating range", hint)])


def _shown(config: Config, state: State, unit: str) -> ShownSpeeds:
    """How speeds are written: of the input in rpm where the range is one of it, in the unit typed or asked for.

    Raises ResultError for a unit that is none of a speed.
    """
    factor, dimensionless = state.spans[0].factor, "time" in state.system.dimensionless
    swept = (axis.typed_units for axis in config.axes if axis.mesh_frequency is not None)
    typed = next(swept, "") if config.design is None else config.design.ranges[0].shown_units
    default = "" if dimensionless else "rad/s"
    wanted, one = unit_asked(unit or typed, dimensionless) if unit or typed else (default, 1.0)
    return ShownSpeeds("input speed" if factor != 1 else "mesh frequency", wanted, factor * one, factor)


def _mean(state: State) -> list[str]:
    """A verdict on a mean system that grows by itself, none on others."""
    mean = MeanSystem.of(state.system)
    return [] if not mean.unstable else [
        f"The mean system is unstable by itself: it grows by {mean.fastest[0]:.4g} e-folds per {_time(state)} without "
        "any variation of the mesh stiffness."
    ]  # fmt: skip


def _time(state: State) -> str:
    return time_unit("time" in state.system.dimensionless)


def _verdict(state: State, shown: ShownSpeeds) -> str:
    searched = (f" {state.uncovered}." if state.uncovered else "") if state.complete else (
        " The search for all regions would take too long: those that first order expects and the growth rate at "
        f"{len(state.speeds)} speeds were looked at."
    )  # fmt: skip
    if not state.open and state.growth_rate > 0:
        return f"Unstable: vibration grows by up to {state.growth_rate:.3g} e-folds per {_time(state)}.{searched}"
    if not state.open:
        near = "" if state.outside is None else (
            f" The nearest region, {label_text(state.outside[1])}, is "
            f"{shown.with_unit(state.outside[0])} away from it."
        )  # fmt: skip
        return f"Stable in the whole operating range.{near}{searched}"
    count = len(state.open)
    widest = max(state.open, key=lambda item: item[1] - item[0])
    words = f"{count} region{'s' * (count != 1)} of instability reach{'es' * (count == 1)} into the operating range"
    required = [item.required for item in state.reaching if item.open]
    enough = f"; a damping ratio of {max(required):.3g} of all modes would suppress it"
    return (
        f"Unstable: {words}, the widest {label_text(widest[2])} from {shown.with_unit(*widest[:2])}. Vibration grows "
        f"by up to {state.growth_rate:.3g} e-folds per {_time(state)}"
        f"{enough if required and not isnan(sum(required)) and not state.narrow else ''}.{searched}"
    )


def _range(state: State, shown: ShownSpeeds) -> Iterator[Block]:
    yield Heading("Operating range")
    unit = in_brackets(state.system, "rad/s")
    rows = [[f"{span.low:.6g} to {span.high:.6g}", f"{span.weight:g}"] for span in state.spans]
    header = [f"mesh frequency{unit}", "weight"]
    if shown.scale != 1:
        header.append(f"{shown.name}{shown.brackets}")
        rows = [[*row, shown.text(span.low, span.high)] for row, span in zip(rows, state.spans, strict=True)]
    yield Table(header, rows)


def _regions(state: State, shown: ShownSpeeds) -> Iterator[Block]:
    yield Heading(f"Regions in the operating range, {state.word} design")
    if not state.reaching:
        yield Text("No instability region reaches into the operating range, and none is next to open there.")
        return
    rows = [
        [
            label_text(item.label), item.kind, ", ".join(dict.fromkeys(map(str, item.modes))),
            shown.text(item.lower, item.upper) if item.open else f"around {shown.text(item.middle)}",
            "-" if isnan(item.required) else f"{item.required:.3g}",
            "none" if item.available == 0 else "-" if isnan(item.available) else f"{item.available:.3g}",
            item.verdict, item.remedies,
        ]
        for item in state.reaching
    ]  # fmt: skip
    sure = "" if state.verified else " (first order, not verified)"
    yield Table(
        ["region", "kind", "modes", f"{shown.name}{shown.brackets}", "required damping ratio", "available", "verdict",
         f"closed by{sure}"],
        rows,
    )  # fmt: skip
    if state.narrow:
        yield Text(f"and {state.narrow} narrower region{'s' * (state.narrow != 1)}.")
    if state.refuted:
        yield Text(f"Remedies of first order that exact search refutes are left out: {state.refuted}.")


def _sureness(state: State) -> str:
    """How sure the regions are."""
    if state.verified:
        return WHIRLING_EXACT if whirls(state.system) else EXACT
    return FIRST_ORDER.format(strategy=state.strategy.reason.replace("_", " "))
