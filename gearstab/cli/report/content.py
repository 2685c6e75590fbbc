"""From what was found out to the blocks of a page, in plain words."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import pi
from typing import TYPE_CHECKING, Any

from gearstab.cli.report import facts
from gearstab.cli.report.facts import State
from gearstab.cli.report.page import Block, BulletList, Heading, Page, Picture, Table, Text
from gearstab.errors import NotPossible, UserError
from gearstab.results.units import in_brackets

if TYPE_CHECKING:
    from gearstab.config import Config
    from gearstab.design.solution import Solution

LIMITS = (
    "The model is a linear system of rigid bodies and springs whose mesh stiffness varies periodically with time at "
    "constant speed. Instability means that its vibration grows without bound; a real gear then loses contact, "
    "hammers and settles to a large nonlinear vibration, which this report does not predict.",
    "Instability is parametric: it needs neither a transmission error nor an imbalance. Forced resonance, wear, "
    "lubrication, and changes of speed are not judged here.",
    "Edges of regions are exact for this model, to 1e-9 of the mesh frequency; regions narrower than 1e-6 of it are "
    "left out. What closes a region, and which rules explain it, comes from first-order theory: its error is of the "
    "order of the square of the relative stiffness variation.",
    "The required damping is one modal damping ratio for all modes. That of real gears is known to a factor of two or "
    "so.",
    "Mesh stiffness and its variation are as uncertain as their source: computed from teeth, the variation, and with "
    "it the width of every region, may be wrong by a factor of about two.",
)


def page(config: Config, say: Callable[[str], None]) -> Page:
    """Compute all that the report says, and put it in order. Raises ConfigError, NotPossible."""
    solution = _solution(config, say)
    say("instability regions")
    states = _states(config, solution)
    blocks: list[Block] = [Text(_verdict(states[0]), strong=True)]
    if solution is not None:
        blocks.append(Text(f"With the proposed design: {_verdict(states[-1])}", strong=True))
    blocks += _range(states[0])
    for state in states:
        blocks += _regions(state)
    blocks += _pictures(solution, states)
    if solution is not None:
        blocks += _design(solution)
    say("contact and uncertainty")
    blocks += _contact(states)
    blocks += _uncertainty(config, states[0])
    blocks += _modes(states[0])
    blocks += [Heading("Assumptions and limits"), BulletList(LIMITS)]
    blocks += _provenance(config)
    return Page(config.title, blocks)


def _solution(config: Config, say: Callable[[str], None]) -> Solution | None:
    if config.design is None:
        return None
    from gearstab.design import check
    from gearstab.design.problem import DesignProblem
    from gearstab.design.solution import solved

    check(config)
    return solved(DesignProblem(config, config.design), say)


def _states(config: Config, solution: Solution | None) -> list[State]:
    """The given design and, where one was searched, the proposed one."""
    from dataclasses import replace

    from gearstab.design.reasons.tongues import single
    from gearstab.rotating_pair import RotatingPair
    from gearstab.systems import build

    if solution is None:
        system = build(config.parameters)
        if isinstance(system, RotatingPair) or system.terms or not system.commensurate:
            raise NotPossible("a report needs exact ratios of mesh frequencies and nothing periodic but mesh stiffness")
        return [facts.state_of("given", system, _spans(config), config)]
    found = []
    for word, design in (("given", solution.problem.given[0]), ("proposed", solution.optimum)):
        system, spans, p = single(solution.problem, design)
        found.append(facts.state_of(word, system, spans, replace(config, parameters=p)))
    return found


def _spans(config: Config) -> tuple[Any, ...]:
    """The operating range of a configuration without a design: that of its sweep. Raises ConfigError."""
    from gearstab.config import ConfigError
    from gearstab.design.problem import Span

    for axis in config.axes:
        for item in axis.assignments:
            if item.path == ("mesh_frequency",) and axis.name in ("mesh_frequency", "input_speed"):
                low, high = (end * item.factor for end in axis.span)
                if low < high:
                    return (Span(low, high, 1.0, item.factor),)
    hint = "add sweep.mesh_frequency: {start: .., stop: .., num: ..}, or a section design with its range"
    raise ConfigError([config.problem(("sweep",), "needs_other", "a report needs an operating range", hint)])


def _verdict(state: State) -> str:
    if not state.open:
        near = "" if state.outside is None else (
            f" The nearest region, {state.outside[1]}, is {state.outside[0]:.4g}"
            f"{in_brackets(state.system, 'rad/s')} away from it."
        )  # fmt: skip
        return f"Stable in the whole operating range.{near}"
    count = len(state.open)
    widest = max(state.open, key=lambda item: item[1] - item[0])
    words = f"{count} region{'s' * (count != 1)} of instability reach{'es' * (count == 1)} into the operating range"
    time = "unit of time" if "time" in state.system.dimensionless else "second"
    required = max((item.required for item in state.reaching), default=0.0)
    return (
        f"Unstable: {words}, the widest {widest[2]} from {widest[0]:.5g} to {widest[1]:.5g}"
        f"{in_brackets(state.system, 'rad/s')}. Vibration grows by up to {state.growth_rate:.3g} e-folds per {time}; a "
        f"damping ratio of {required:.3g} of all modes would suppress it."
    )


def _range(state: State) -> Iterator[Block]:
    yield Heading("Operating range")
    unit = in_brackets(state.system, "rad/s")
    rows = []
    for span in state.spans:
        cells = [f"{span.low:.6g} to {span.high:.6g}", f"{span.weight:g}"]
        if span.factor != 1:
            cells.append(f"{span.low / span.factor * 30 / pi:.5g} to {span.high / span.factor * 30 / pi:.5g}")
        rows.append(cells)
    header = [f"mesh frequency{unit}", "weight", "input speed (rpm)"][: len(rows[0])]
    yield Table(header, rows)


def _regions(state: State) -> Iterator[Block]:
    yield Heading(f"Regions in the operating range, {state.word} design")
    if not state.reaching:
        yield Text("No instability region reaches into the operating range, even without damping.")
        return
    rows = [
        [
            item.tongue.label, item.tongue.kind,
            ", ".join(dict.fromkeys(map(str, (item.tongue.mode_p, item.tongue.mode_q)))),
            f"{item.lower:.5g} to {item.upper:.5g}", f"{item.required:.3g}",
            "none" if item.available == 0 else f"{item.available:.3g}", "open" if item.open else "closed by damping",
            item.remedies,
        ]
        for item in state.reaching
    ]  # fmt: skip
    unit = in_brackets(state.system, "rad/s")
    yield Table(
        ["region", "kind", "modes", f"mesh frequency without damping{unit}", "required damping ratio", "available",
         "verdict", "closed by (first order)"],
        rows,
    )  # fmt: skip
    if state.narrow:
        yield Text(f"and {state.narrow} narrower region{'s' * (state.narrow != 1)}.")


def _pictures(solution: Solution | None, states: Sequence[State]) -> Iterator[Block]:
    from gearstab.plots import draw

    yield Heading("Pictures")
    figure, _ = draw(facts.growth_curve(states), "design", title=False)
    caption = "Growth rate over the mesh frequency, and regions of instability. Shaded: the operating range."
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
    from io import BytesIO

    import xarray as xr

    from gearstab.design.result import group
    from gearstab.results import Group, ResultTree
    from gearstab.results.provenance import modes_group
    from gearstab.results.write import image

    groups = {"modes": modes_group(solution.initial_system), "design": group(solution)}
    return xr.open_datatree(BytesIO(bytes(image(ResultTree(Group((), {}), groups)))), engine="h5netcdf")


def _design(solution: Solution) -> Iterator[Block]:
    from gearstab.design import values
    from gearstab.design.answer import answer
    from gearstab.results.units import unit_of

    yield Heading("Proposed design")
    # The reasons follow, all of them.
    yield BulletList(answer(solution, reasons=0))
    problem = solution.problem
    rows = []
    for k, variable in enumerate(problem.variables):
        unit = unit_of(solution.initial_system, variable.axis.units)
        old, new = (values.text(problem, variable, place) for place in (float("nan"), solution.optimum[k]))
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


def _contact(states: Sequence[State]) -> Iterator[Block]:
    yield Heading("Contact of the teeth")
    for state in states:
        found = facts.separation(state)
        if found is None:
            words = "Nothing drives the system in the configuration, so that loss of contact is not judged"
            yield Text(f"{words}: give a load and transmission errors.")
            return
        stretches, factor = found
        unit = in_brackets(state.system, "rad/s")
        lost = ", ".join(f"{a:.5g} to {b:.5g}" for a, b in stretches)
        words = f"a mesh force changes its sign at {lost}{unit}, where teeth part" if lost else "teeth stay in contact"
        word = state.word.capitalize()
        yield Text(f"{word} design, linear steady state: {words}. Largest dynamic load factor {factor:.4g}.")


def _uncertainty(config: Config, state: State) -> Iterator[Block]:
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
        f"one speed of the operating range (95 % interval {low:.3g} to {high:.3g}), reached at {where:.5g}"
        f"{in_brackets(state.system, 'rad/s')}."
    )


def _modes(state: State) -> Iterator[Block]:
    from gearstab.modal import mean_modes, modal_damping_ratios
    from gearstab.symmetry import oriented, type_names

    modes = oriented(state.system, mean_modes(state.system))
    ratios, kinds = modal_damping_ratios(state.system, modes), type_names(state.system, modes)
    yield Heading("Natural frequencies of the given design")
    rows = [
        [str(k + 1), f"{w:.6g}", kinds[k], "-" if ratios[k] != ratios[k] else f"{ratios[k]:.4g}"]
        for k, w in enumerate(modes.natural_frequency)
    ]
    yield Table(["mode", f"natural frequency{in_brackets(state.system, 'rad/s')}", "type", "damping ratio"], rows)


def _provenance(config: Config) -> Iterator[Block]:
    from gearstab.floquet.kernel import choice as kernel
    from gearstab.results.provenance import root_attributes

    known = root_attributes("report", config, kernel.name())
    names = ("gearstab_version", "kernel", "numpy_version", "python_version", "created", "config_digest")
    yield Heading("Versions and configuration")
    yield Table(["", ""], [[name.replace("_", " "), str(known[name])] for name in names])
    changed = f", with --set {' '.join(config.overrides)}" if config.overrides else ""
    yield Text(f"Configuration {config.source.name}{changed}.")
