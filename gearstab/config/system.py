"""The sections ``system``, ``sweep`` and ``design``, which depend on each other, and ``respond``.

What is wrong is reported to the document.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from pydantic_core import PydanticCustomError

from gearstab.config.document.problems import Path, Problem, dotted, nearest
from gearstab.config.document.tree import Document, value_at
from gearstab.config.model.axes import Array, Axis, SpeedAxis, replaced
from gearstab.config.model.reading import WRONG, read, told
from gearstab.config.model.units import Quantity, typed_unit
from gearstab.config.samples import check_samples, read_files
from gearstab.config.sections import sweep
from gearstab.config.sections.dimensions import report_all
from gearstab.config.sections.expansion import build
from gearstab.config.sections.sweep import Context
from gearstab.config.sections.targets import INPUT_SPEED, UNKNOWN_TEETH, Target
from gearstab.systems.base import System

if TYPE_CHECKING:
    from gearstab.config.sections.design import Design
    from gearstab.systems.parts.respond import PairRespond, Respond


@dataclass
class SystemSections:
    """``system``, ``sweep`` and ``design``. plain: ``system`` as plain data, {} where something is wrong with it.

    specs: ``sweep``, resolved. context: the section that names of uncertain parameters refer to. uncertain: their
    targets. doubts: overrides without effect.
    """

    plain: dict[str, Any]
    section: System
    contents: dict[str, Array]
    axes: tuple[Axis, ...]
    specs: dict[str, Any]
    context: Context
    uncertain: dict[str, list[Target]]
    design: Design | None
    doubts: list[Problem]


def _find_model(document: Document) -> type[System] | None:
    """Return the model of ``system.kind``; None after reporting that there is none."""
    from gearstab.systems import KINDS

    if "system" not in document.data:
        return None
    system = document.data["system"]
    kind = system.get("kind") if isinstance(system, dict) else None
    if isinstance(kind, str) and kind in KINDS:
        return KINDS[kind].variant(system)
    path, available = ("system", "kind"), f"available: {', '.join(KINDS)}"
    if not isinstance(system, dict):
        document.report(("system",), "wrong_type", "must be a mapping", f"add kind; {available}", value=system)
    elif kind is None:
        document.report(path, "missing", "is missing", f"add kind; {available}")
    else:
        hint = f"{nearest(str(kind), KINDS)} ({available})"
        document.report(path, "unknown_choice", "is no kind of system", hint, value=kind)
    return None


def read_system(document: Document, source: FilePath) -> SystemSections | None:
    """Read ``system``, ``sweep`` and ``design``; None where the kind of system is not known.

    document: short forms are written out in it.
    """
    model = _find_model(document)
    if model is None:
        return None
    contents = model.complete(document, source)
    bare, errors = read(model, document.data["system"])
    section = bare.with_files(contents) if contents else bare
    samples, doubts = read_files(document, section, source)
    context = Context(document, section)
    layouts, variables = sweep.layouts(context), []
    if "design" in document.data:
        from gearstab.config.sections import design

        variables = design.layouts(context)
    base, targets = list(sweep.base_values(context, [*layouts, *variables])), {}
    if (tolerance := document.get(("methods", "tolerance"))) is not None:
        from gearstab.config.sections import uncertain

        targets = uncertain.resolve(context, tolerance)
        base += uncertain.base_values(context, targets)
    for path, value, place in reversed(base):  # the first one counts
        bare, section = (replaced(each, path, value) for each in (bare, section))
        document.values["system", *path] = place
    given = {("system", *path) for path, _, _ in base}
    report_all(document, ("system",), model, (section, errors), section.conflicts(), section, given)
    context = Context(document, section)
    built = [found for layout in layouts if (found := build(document, section, layout))]
    axes, specs = tuple(axis for axis, _ in built), {axis.name: spec for axis, spec in built}
    wanted = design.read(context, variables) if "design" in document.data else None
    doubts += sweep.without_effect(document, layouts)
    plain: dict[str, Any] = {}
    wrong = any(value is WRONG for _, value, _ in base)
    if not wrong and all(("system", *error["loc"]) in given for error in errors):
        if section.damping is None and section.damping_ratio is None:
            bare, section = (each.model_copy(update={"damping_ratio": 0.0}) for each in (bare, section))
        plain = {"kind": document.data["system"]["kind"]} | bare.model_dump(mode="json", exclude_none=True)
        for where, held, columns in samples.values():
            section = replaced(section, where, value_at(section, where).model_copy(update=held))
            contents[dotted(where)] = columns
        check_samples(document, section, axes)
    return SystemSections(plain, section, contents, axes, specs, context, targets, wanted, doubts)


RAMP = ("respond", "ramp")
OF_RAMP = (("to", "rad/s"), ("rate", "rad/s^2"))
"""Where a ramp is, and which of its keys are speeds and accelerations of the input where the section gives that."""


def read_respond(document: Document, system: System | None) -> Respond | PairRespond | None:
    """Read the response that a document asks for; None without the section and after reporting problems.

    system: its section, in which values may be wrong; None of an unknown kind.
    """
    if "respond" not in document.data:
        return None
    from gearstab.systems.parts.respond import Respond

    section: Any = document.data["respond"]
    model: type[Respond | PairRespond] = Respond if system is None else system.respond_model()
    size, axis = None if system is None else told(system.size), SpeedAxis()
    if system is not None and model is Respond and isinstance(section, dict):
        axis = _replace_input_speed(document, section, told(system.cycles_of_input, 1.0))
    respond, errors = read(model, section)
    rules = () if respond is WRONG else respond.conflicts(system, size)
    report_all(document, ("respond",), model, (respond, errors), rules, system)
    return None if errors or size is None else respond.of_size(size, axis)


def _replace_input_speed(document: Document, section: dict[str, Any], cycles: float | None) -> SpeedAxis:
    """Write mesh frequencies in place of input speeds. cycles: of the first mesh in a turn of the input.

    Returns in what the section gives its speed.
    """
    value, path = section.get(INPUT_SPEED), ("respond", INPUT_SPEED)
    if value is None or section.get("mesh_frequency") is not None:
        return SpeedAxis(typed_units=typed_unit([section.get("mesh_frequency")]))
    if cycles is None:
        document.report(path, "needs_other", "the numbers of teeth are not known", UNKNOWN_TEETH, at_key=True)
        return SpeedAxis()
    ramp = section.get("ramp")
    own: list[tuple[Path, Path, str]] = [(path, ("respond", "mesh_frequency"), "rad/s")]
    if isinstance(ramp, dict):
        own += [((*RAMP, key), (*RAMP, key), unit) for key, unit in OF_RAMP if key in ramp]
    try:
        numbers = [Quantity(unit).number(document.get(given)) for given, _, unit in own]
    except PydanticCustomError:
        return SpeedAxis()  # which is reported where the section is validated
    if min(numbers) <= 0:
        return SpeedAxis()  # as that
    for (given, meant, _), number in zip(own, numbers, strict=True):
        document.put(meant, number * cycles, document.where(given))
    del section[INPUT_SPEED]
    return SpeedAxis(INPUT_SPEED, cycles, typed_unit([value]))
