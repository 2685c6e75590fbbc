"""From what was found out to the blocks of a page, in plain words."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from math import isnan, pi
from typing import Any

from gearstab.cli.report import Block, BulletList, Heading, Page, Picture, Table, Text, facts
from gearstab.cli.report.facts import State
from gearstab.config import Config, ConfigError
from gearstab.design import check
from gearstab.design.problem import DesignProblem, Span
from gearstab.design.regions import single
from gearstab.design.result import group
from gearstab.design.solution import Solution, answer, solved
from gearstab.errors import NotPossible, UserError
from gearstab.info import MeanSystem, ShownSpeeds, label_text, speeds, time_unit, unit_asked
from gearstab.modal import modal_damping_ratios
from gearstab.plots import draw
from gearstab.results import Group, ResultTree
from gearstab.results.display import in_brackets, unit_of
from gearstab.results.provenance import mode_frequencies, modes_group, root_attributes
from gearstab.results.read import from_bytes
from gearstab.results.write import image
from gearstab.symmetry import natural_modes, type_names
from gearstab.system import WHIRLING, Feature, unsupported, whirls

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
    solution = None
    if config.design is not None:
        check(config)
        solution = solved(DesignProblem(config, config.design), say)
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
    blocks += _pictures(solution, states, shown)
    if solution is not None:
        blocks += _design(solution)
    say(STEPS[2])
    blocks += _teeth(states, shown)
    say(STEPS[3])
    blocks += _uncertainty(config, states[0], shown)
    blocks += _modes(states[0], shown)
    if states[0].verified:
        sure = WHIRLING_EXACT if whirls(states[0].system) else EXACT
    else:
        sure = FIRST_ORDER.format(strategy=states[0].strategy.reason.replace("_", " "))
    blocks += [Heading("Assumptions and limits"), BulletList([sure, *LIMITS])]
    blocks += _provenance(config)
    return Page(config.title, blocks)


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


SUMMED = " of one mesh frequency at a time, the largest deviations of all added up"


MOST_MODES = 24
"""Modes that are listed; gearstab info has all."""


def _pictures(solution: Solution | None, states: Sequence[State], shown: ShownSpeeds) -> Iterator[Block]:
    """Yield the growth rates of all designs and, after a search, what its result shows."""
    yield Heading("Pictures")
    figure, _ = draw(facts.growth_curve(states, shown), "design", title=False)
    caption = f"Growth rate over the {shown.name}, and regions of instability. Shaded: the operating range."
    yield Picture(figure, caption)
    if solution is None:
        return
    tree = _tree(solution)
    for kind, caption in (
        ("pareto", "Designs of which none is better than another in everything."),
        ("tornado", "What a step of each variable by itself does to the objective."),
        ("contour", "The objective over pairs of variables, with the optimum and its margins."),
    ):
        try:
            figure, _ = draw(tree, kind, title=False)
        except UserError:
            continue  # the result does not hold what this figure shows
        yield Picture(figure, caption)


def _tree(solution: Solution) -> Any:
    """The result of the search as a tree in memory."""
    groups = {"modes": modes_group(solution.initial_system), "design": group(solution)}
    return from_bytes(image(ResultTree(Group((), {}), groups)))


def _design(solution: Solution) -> Iterator[Block]:
    """Yield the answer of the search, its variables and the reasons."""

    yield Heading("Proposed design")
    # The reasons follow, all of them.
    yield BulletList(answer(solution, reasons=0))
    problem = solution.problem
    rows = []
    for k, variable in enumerate(problem.variables):
        unit = unit_of(solution.initial_system, variable.axis.units)
        old, new = (problem.text(variable, place) for place in (float("nan"), solution.optimum[k]))
        down, up = (f"{value:.4g}" if value == value else "-" for value in solution.margins[:, k])
        rows.append([variable.name, "" if unit == "1" else unit, old, new, down, up])
    yield Table(["variable", "unit", "given", "proposed", "margin down", "margin up"], rows)
    yield Text(
        "Margins: how far a variable may move by itself until the objective has degraded by 10 % (to "
        f"{solution.most:.4g}); they end at the bounds of the search at the latest."
    )
    if solution.explanation:
        yield Text("Why, by first-order theory:")
        yield BulletList(solution.explanation)


def _teeth(states: Sequence[State], shown: ShownSpeeds) -> Iterator[Block]:
    """Yield whether teeth would part, of each design."""
    yield Heading("Contact of the teeth")
    for state in states:
        try:
            found = facts.separation(state)
        except NotPossible as error:
            yield Text(f"Loss of contact is not judged: {error}.")
            return
        if found is None:
            words = "Nothing drives the system in the configuration, so that loss of contact is not judged"
            yield Text(f"{words}: give a load and transmission errors.")
            return
        places = ", ".join(shown.text(speed) for speed in found.worst)
        words = "teeth stay in contact" if not found.count else (
            f"a mesh force changes its sign, so that teeth part, at {found.count} of {found.looked} speeds"
            + (f"; the worst are {places} {shown.unit}".rstrip() if found.worst else "")
        )  # fmt: skip
        word, how = state.word.capitalize(), SUMMED if found.bound else ""
        factor = f"Largest dynamic load factor {found.load_factor:.4g}"
        yield Text(f"{word} design, linear steady state{how}: {words}. {factor}.")


def _uncertainty(config: Config, state: State, shown: ShownSpeeds) -> Iterator[Block]:
    """Yield the probability of instability with the tolerances given."""
    yield Heading("Uncertainty")
    try:
        found = facts.probability(config, state)
    except UserError as error:
        yield Text(f"The probability of instability was not computed: {error}")
        return
    if found is None:
        yield Text("The configuration gives no tolerances (methods.tolerance): all numbers are taken as exact.")
        return
    middle, low, high, where = found
    yield Text(
        f"With the tolerances given, the probability of instability of the given design is at most {middle:.3g} at any "
        f"one speed of the operating range (95 % interval {low:.3g} to {high:.3g}), reached at "
        f"{shown.with_unit(where)}."
    )


def _whirling(state: State, shown: ShownSpeeds) -> Iterator[Block]:
    """The motions of the mean system at both ends of the operating range, whose speeds of rotation they go with."""
    ends = min(span.low for span in state.spans), max(span.high for span in state.spans)
    own = speeds.rotation_facts(state.system, list(ends))
    if own is None:
        return
    yield Heading("Natural frequencies of the given design")
    yield Text(f"Damped ones of the mean system at both ends of the range, {shown.with_unit(*ends)}; whirl: the sense.")
    header, rows = speeds.rotation_rows(own, [shown.with_unit(end) for end in ends], in_brackets(state.system, "rad/s"))
    yield Table(header, rows[:MOST_MODES])
    if len(rows) > MOST_MODES:
        yield Text(f"and {len(rows) - MOST_MODES} more.")


def _modes(state: State, shown: ShownSpeeds) -> Iterator[Block]:
    """Yield the natural frequencies of the given design."""
    if any(rotation.speed_ratio is not None for rotation in state.system.rotations):
        yield from _whirling(state, shown)
        return
    modes = natural_modes(state.system)
    ratios, kinds = modal_damping_ratios(state.system, modes), type_names(state.system, modes)
    yield Heading("Natural frequencies of the given design")
    frequencies = mode_frequencies(state.system, modes)
    if "symmetric_frequency" in frequencies:
        yield Text(
            "They are damped ones, of the whole mean system; types and damping ratios are those of the modes of its "
            "symmetric part that its motions resemble."
        )
    natural = frequencies["natural_frequency"]
    hertz = [] if "time" in state.system.dimensionless else ["Hz"]
    rows = [
        [str(k + 1), f"{w:.6g}", *(f"{w / (2 * pi):.5g}" for _ in hertz), kinds[k],
         "-" if ratios[k] != ratios[k] else f"{ratios[k]:.4g}"]
        for k, w in enumerate(natural[:MOST_MODES])
    ]  # fmt: skip
    unit = in_brackets(state.system, "rad/s")
    yield Table(["mode", f"natural frequency{unit}", *hertz, "type", "damping ratio"], rows)
    if len(natural) > MOST_MODES:
        yield Text(f"and {len(natural) - MOST_MODES} more, up to {natural[-1]:.6g}.")


def _provenance(config: Config) -> Iterator[Block]:
    """Yield versions and the configuration."""
    known = root_attributes("report", config)
    names = ("gearstab_version", "kernel", "numpy_version", "python_version", "created", "config_digest")
    yield Heading("Versions and configuration")
    yield Table(["", ""], [[name.replace("_", " "), str(known[name])] for name in names])
    changed = f", with --set {' '.join(config.overrides)}" if config.overrides else ""
    yield Text(f"Configuration {config.source.name}{changed}.")
