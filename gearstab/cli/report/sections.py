"""Sections of a report behind its regions: pictures, the proposed design, contact, uncertainty, modes, provenance."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import pi
from typing import Any

from gearstab.cli.report import facts
from gearstab.cli.report.facts import State
from gearstab.cli.report.page import Block, BulletList, Heading, Picture, Table, Text
from gearstab.config import Config
from gearstab.design.result import group
from gearstab.design.solution import Solution, answer
from gearstab.errors import NotPossible, UserError
from gearstab.info import ShownSpeeds, speeds
from gearstab.modal import modal_damping_ratios
from gearstab.plots import draw
from gearstab.results import Group, ResultTree
from gearstab.results.display import in_brackets, unit_of
from gearstab.results.provenance import mode_frequencies, modes_group, root_attributes
from gearstab.results.read import from_bytes
from gearstab.results.write import image
from gearstab.symmetry import natural_modes, type_names

SUMMED = " of one mesh frequency at a time, the largest deviations of all added up"


MOST_MODES = 24
"""Modes that are listed; gearstab info has all."""


def pictures(solution: Solution | None, states: Sequence[State], shown: ShownSpeeds) -> Iterator[Block]:
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


def design(solution: Solution) -> Iterator[Block]:
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


def teeth(states: Sequence[State], shown: ShownSpeeds) -> Iterator[Block]:
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


def uncertainty(config: Config, state: State, shown: ShownSpeeds) -> Iterator[Block]:
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


def modes(state: State, shown: ShownSpeeds) -> Iterator[Block]:
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


def provenance(config: Config) -> Iterator[Block]:
    """Yield versions and the configuration."""
    known = root_attributes("report", config)
    names = ("gearstab_version", "kernel", "numpy_version", "python_version", "created", "config_digest")
    yield Heading("Versions and configuration")
    yield Table(["", ""], [[name.replace("_", " "), str(known[name])] for name in names])
    changed = f", with --set {' '.join(config.overrides)}" if config.overrides else ""
    yield Text(f"Configuration {config.source.name}{changed}.")
