"""Readers of the sections of a document: ``system``, ``sweep``, ``design``, ``respond`` and ``methods``.

With ``system`` the samples of a stiffness over a period are read from files, CSV or HDF5. What is wrong is reported to
the document.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import BaseModel, Field, create_model
from pydantic_core import ErrorDetails, PydanticCustomError

from gearstab.config.configuration import Config
from gearstab.config.document import ConfigError, Document, Path, Problem, dotted, names_set, nearest, texts, value_at
from gearstab.config.model import SPEEDS, Array, Axis, SpeedAxis, files, replaced
from gearstab.config.model.conflicts import Conflict, plain_number, report, report_errors, report_wrong
from gearstab.config.model.fields import Quantity, Section
from gearstab.config.model.files import DataFileError, arrays, columns_of, factor, numbers, present, usable
from gearstab.config.model.reading import WRONG, quantity, read, told, type_at
from gearstab.config.model.units import typed_unit
from gearstab.config.sections import INPUT_SPEED, UNKNOWN_TEETH, Target, quantity_at, sweep
from gearstab.config.sections.expansion import build
from gearstab.config.sections.sweep import Context
from gearstab.methods import METHODS, POINTS, RANGE, OptionError
from gearstab.methods import chosen as chosen_methods
from gearstab.system import GearSystem
from gearstab.systems import KINDS
from gearstab.systems.base import System
from gearstab.waveforms import Sampled, TorqueTable, Waveform
from gearstab.waveforms.sampled import MOST_SAMPLES, out_of_table
from gearstab.waveforms.section import waveforms

if TYPE_CHECKING:
    from gearstab.config.sections.design import Design
    from gearstab.config.sections.uncertain import Uncertainties
    from gearstab.systems.respond import PairRespond, Respond


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
    context = Context(document, section)
    layouts, variables = sweep.layouts(context), []
    unheeded = list(sweep.without_effect(document, layouts))
    if "design" in document.data:
        from gearstab.config.sections import design

        variables = design.layouts(context)
    base, targets = list(sweep.base_values(context, [*layouts, *variables])), {}
    methods = document.data.get("methods")
    if isinstance(methods, dict) and methods.get("tolerance") is not None:
        from gearstab.config.sections import uncertain

        targets = uncertain.resolve(context, methods["tolerance"])
        base += uncertain.base_values(context, targets)
    for path, value, place in reversed(base):  # the first one counts
        bare, section = (replaced(each, path, value) for each in (bare, section))
        document.values["system", *path] = place
    given = {("system", *path) for path, _, _ in base}
    _report(document, ("system",), model, (section, errors), section.conflicts(), section, given)
    context = Context(document, section)
    built = [found for layout in layouts if (found := build(document, section, layout))]
    axes, specs = tuple(axis for axis, _ in built), {axis.name: spec for axis, spec in built}
    wanted = design.read(context, variables) if "design" in document.data else None
    plain: dict[str, Any] = {}
    wrong = any(value is WRONG for _, value, _ in base)
    if not wrong and all(("system", *error["loc"]) in given for error in errors):
        if section.damping is None and section.damping_ratio is None:
            bare, section = (each.model_copy(update={"damping_ratio": 0.0}) for each in (bare, section))
        plain = {"kind": document.data["system"]["kind"]} | bare.model_dump(mode="json", exclude_none=True)
    section, columns, doubts = with_samples(document, section, source, axes if plain else None)
    return SystemSections(plain, section, contents | columns, axes, specs, context, targets, wanted, doubts + unheeded)


def _report(
    document: Document, path: Path, model: type[BaseModel], read: tuple[Any, Sequence[ErrorDetails]],
    rules: Iterable[Conflict], system: System | None, ignore: Collection[Path] = (),
) -> None:  # fmt: skip
    """Report what contradicts itself in a section, units that do not fit the system, and values that are wrong.

    path: of the section, whose model is ``model``. read: the section and its errors. ignore: paths in the document at
    which values are not those of the section.
    """
    section, errors = read
    units = set() if system is None else {*_wrong_units(document, system, str(path[0]), model, ignore)}
    report(document, path, rules, section)
    report_errors(document, errors, model, path, {*ignore, *units})


def _wrong_units(
    document: Document, system: System, top: str, section: type[BaseModel], ignore: Collection[Path]
) -> Iterator[Path]:
    """Report texts in a section whose unit does not fit the system; yield their places."""
    for path, text in texts(document.data.get(top)):
        declared = quantity(type_at(section, path))
        place = (top, *path)
        if declared is None or place in ignore:
            continue
        wanted = quantity_at(system, path if top == "system" else place, declared)
        if wanted == declared:
            continue
        try:
            wanted.number(text)
        except PydanticCustomError as error:
            report_wrong(document, place, error, text)
            yield place


RAMP = ("respond", "ramp")
OF_RAMP = (("to", "rad/s"), ("rate", "rad/s^2"))
"""Where a ramp is, and which of its keys are speeds and accelerations of the input where the section gives that."""


def read_respond(document: Document, system: System | None) -> Respond | PairRespond | None:
    """Read the response that a document asks for; None without the section and after reporting problems.

    system: its section, in which values may be wrong; None of an unknown kind.
    """
    if "respond" not in document.data:
        return None
    from gearstab.systems.respond import Respond

    section: Any = document.data["respond"]
    model: type[Respond | PairRespond] = Respond if system is None else system.respond_model()
    size, axis = None if system is None else told(system.size), SpeedAxis()
    if system is not None and model is Respond and isinstance(section, dict):
        axis = _replace_input_speed(document, section, told(system.cycles_of_input, 1.0))
    respond, errors = read(model, section)
    rules = () if respond is WRONG else respond.conflicts(system, size)
    _report(document, ("respond",), model, (respond, errors), rules, system)
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


class _Chosen(Section):
    """Methods computed at every point of the grid; a method that is not named is not run."""

    @property
    def chosen(self) -> tuple[str, ...]:
        """Names of the methods to run."""
        return tuple(name for name in METHODS if getattr(self, name) is not None)


FIELDS: dict[str, Any] = {
    name: (method.Options | None, Field(default=None, title=name.replace("_", " "), description=method.Options.__doc__))
    for name, method in METHODS.items()
}
Methods: Any = create_model("Methods", __base__=_Chosen, __doc__=_Chosen.__doc__, **FIELDS)
"""A section with the options of each method, in the order of the table."""


def read_methods(
    document: Document, source: FilePath, system: SystemSections | None
) -> tuple[Methods, Uncertainties | None] | None:
    """Read the methods that a document asks for, with what files, axes and units add to their options.

    Returns them, none without the section, and the uncertain parameters; None after reporting what is wrong with them,
    and where something is wrong with the system. Methods that do not fit it, and a range of mesh frequencies that is
    none, are reported.
    """
    section, sweep = document.data.get("methods"), document.data.get("sweep")
    if "methods" in document.data and section in (None, {}):
        document.report(("methods",), "missing", "names no method", f"add one of {', '.join(Methods.model_fields)}")
        return None
    named = section if isinstance(section, dict) else {}
    known = {name: options for name, options in named.items() if name in METHODS}
    for name in [name for name, options in known.items() if options is None]:
        document.put(("methods", name), {}, document.where(("methods", name)))  # `floquet:` asks for it
    for name in _without_frequency(known, sweep) if isinstance(sweep, dict) else ():
        remedy = "add mesh_frequency: {start: .., stop: .., num: ..} to sweep"
        document.report(("methods", name), "missing", "needs a mesh_frequency axis", remedy, at_key=True)
    methods, errors = read(Methods, document.data.get("methods", {}))
    report_errors(document, errors, Methods, ("methods",))
    if errors or system is None or not system.plain:
        return None
    uncertainties = None
    if methods.tolerance is not None:
        from gearstab.config.sections import uncertain

        tolerance: Any = methods.tolerance
        uncertainties, own = uncertain.uncertainties(system.context, tolerance, system.uncertain, system.axes)
        methods = methods.model_copy(update={"tolerance": tolerance.model_copy(update={"parameters": own})})
    chosen = methods.chosen
    options = {name: getattr(methods, name) for name in chosen}
    ranges = [what for name in options if (what := METHODS[name].over_range(options[name]))]
    full = {name: METHODS[name].completed(own, document, source, system.axes) for name, own in options.items()}
    for axis in system.axes if ranges else ():
        if axis.name in SPEEDS and not isinstance(axis.values, list) and axis.span[0] == axis.span[1]:
            for what in ranges:
                hint = "give two frequencies or more, or start and stop"
                document.report(("sweep", axis.name), "no_range", f"is no range, {what}", hint)
    for path, code, message, hint in system.section.unfit(system.axes, chosen):
        document.report(("methods", *path), code, message, hint, at_key=True)
    return methods.model_copy(update=full), uncertainties


def _without_frequency(sections: Mapping[str, Any], sweep: dict[str, Any]) -> Iterator[str]:
    """Yield the methods that need mesh frequencies and get none. sections, sweep: as written."""
    set_by = {name: set(METHODS[name].sets(options)) for name, options in sections.items()}
    axes = {target for item in sweep.items() for target in names_set(*item)}
    for name, own in set_by.items():
        # The ends of a range are those of an axis; frequencies that come with cases have none.
        names = set(sweep) if METHODS[name].frequency == RANGE else axes | own
        if METHODS[name].frequency is not None and names.isdisjoint(SPEEDS):
            yield name


def check_options(config: Config, base: GearSystem) -> None:
    """Raise ConfigError where the options of methods do not fit the base system, with one problem a method."""
    found = []
    for method in chosen_methods(config.methods, base):
        try:
            method.check()
            # Of others the section itself has been asked; this one needs a speed for this system only.
            asked = METHODS[method.name].frequency == POINTS
            if method.frequency == POINTS and not asked and all(a.mesh_frequency is None for a in config.axes):
                message = "needs a mesh_frequency axis: speeds of rotation follow it"
                raise OptionError((), message, "add mesh_frequency: {start: .., stop: .., num: ..} to sweep")
        except OptionError as error:
            found.append(config.problem(("methods", method.name, *error.path), "option", str(error), error.remedy))
    if found:
        raise ConfigError(found)


SUFFIXES = (".csv", ".txt", ".h5", ".hdf5")


def with_samples(
    document: Document, system: Any, source: FilePath, axes: Sequence[Axis] | None
) -> tuple[Any, dict[str, Array], list[Problem]]:
    """Return a section ``system`` with what the files of waveforms hold, their columns by place, and what is doubtful.

    source: path of the configuration. axes: of the grid, None where the section has mistakes. Reported is what is wrong
    with the files, variations of constant samples, which no factor makes vary, and torques beyond the table of a file.
    """
    contents: dict[str, Array] = {}
    doubts: list[Problem] = []
    for path, section, wave in waveforms(system):
        name, place = getattr(section, "file", None), ("system", *path, "file")
        if isinstance(name, str) and wave is not None:
            try:
                quantities = {key: quantity_at(system, (*path, key), kind) for key, kind in wave.columns.items()}
                interpolation = section.interpolation if isinstance(section.interpolation, str) else "linear"
                columns, doubt = read_samples(source.parent / name, wave, interpolation, quantities)
            except DataFileError as error:
                document.report(place, "file", str(error), error.hint, value=name)
                continue
            contents[dotted(path)] = columns
            section = section.model_copy(update=wave.from_file(columns))
            system = replaced(system, path, section)
            if doubt:
                doubts.append(document.problem(place, "unusual", doubt, "check the measurement", value=name))
        if axes is None:
            continue
        if wave is Sampled and _constant(section.stiffness):
            _check_variation(document, system, path, axes)
        elif wave is TorqueTable and hasattr(section, "torques"):  # no file, no torques: said elsewhere
            _check_torque(document, section, path, axes)
    return system, contents, doubts


def _check_torque(document: Document, section: Any, path: Path, axes: Sequence[Axis]) -> None:
    place: Path = (*path, "torque")
    items = [(axis, item) for axis in axes for item in axis.assignments if item.path == place]
    given: list[tuple[Path, Any]] = [(("sweep", axis.name), item.values) for axis, item in items]
    if not given and section.torque is not None:
        given = [(("system", *place), section.torque)]
    for where, values in given:
        if found := out_of_table(np.asarray(values, dtype=float), section.torques):
            document.report(where, "out_of_range", *found, at_key=where[0] == "sweep")


def _check_variation(document: Document, system: Any, path: Path, axes: Sequence[Axis]) -> None:
    swept = [(axis, item) for axis in axes for item in axis.assignments]
    if any(item.path[: len(path)] == path for _, item in swept):
        return
    for key in ("epsilon", "amplitude"):
        place: Path = (*path[:-1], key)
        axis = next((axis for axis, item in swept if item.path == place and np.any(np.asarray(item.values) > 0)), None)
        value = value_at(system, place)
        message = f"the samples of the stiffness are constant, and no {key} makes them vary"
        if axis is not None:
            hint = "remove the axis, or check the samples"
            document.report(("sweep", axis.name), "not_applicable", message, hint, at_key=True)
        elif value is not None and np.any(value > 0):
            where, hint = ("system", *place), "leave it out, or check the samples"
            document.report(where, "not_applicable", message, hint, value=document.get(where))


def _constant(values: Any) -> bool:
    known = values is not None and len(values) > 1 and all(plain_number(value) is not None for value in values)
    return known and bool(np.ptp(np.asarray(values, dtype=float)) == 0)


def read_samples(
    path: FilePath, wave: type[Waveform], interpolation: str, quantities: Mapping[str, Quantity]
) -> tuple[Array, str]:
    """``(columns, N)``: the columns that the wave takes, phase and stiffness, in some waves also torque, in SI; and
    what is doubtful about them, "" for nothing.

    A text file has one sample a line, numbers separated by a comma, a semicolon or blanks; empty lines and what follows
    a # do not count, and the first line may name the columns, with units in brackets. An HDF5 file has a dataset of one
    dimension for each, and maybe its unit in the attribute ``units``.

    wave, interpolation: which say what samples it takes. quantities: what each column may be.
    Raises DataFileError, with the line of a text.
    """
    usable(path, ".csv or .h5", SUFFIXES)
    lines = path.suffix.lower() in (".csv", ".txt")
    places, columns = columns_of(files.text(path), quantities) if lines else _datasets(path, quantities)
    table = np.array(columns, dtype=float)
    rows, phase, doubt = wave.measured(table)
    table, places = table[:, rows], [places[row] for row in rows]
    table[list(wave.columns).index("phase")] = phase
    found = wave.wrong_samples(table.tolist(), interpolation)
    if found is not None:
        index, _, message, hint = found
        raise DataFileError(message if index is None else f"{places[index]}: {message}", hint)
    return table, doubt


def _datasets(path: FilePath, quantities: Mapping[str, Quantity]) -> tuple[list[str], list[list[float]]]:
    names, units = tuple(quantities), dict[str, str]()
    found = arrays(path, names, MOST_SAMPLES, units)
    for name in names:
        if found.get(name) is None:
            hint = f"it needs the datasets {', '.join(names[:-1])} and {names[-1]}, and holds {present(found)}"
            raise DataFileError(f"holds no {name}", hint)
    columns = [numbers(name, found[name]) for name in names]
    if columns[0].ndim != 1 or len({column.shape for column in columns}) > 1:
        shapes = [f"{name} {column.shape}" for name, column in zip(names, columns, strict=True)]
        message = f"{shapes[0].replace(' ', ' has the shape ', 1)}, {', '.join(shapes[1:])}"
        raise DataFileError(message, "save one dimension of real numbers, as many of each")
    factors = [factor(units.get(name, ""), quantities[name], name) for name in names]
    scaled = [(column * each).tolist() for column, each in zip(columns, factors, strict=True)]
    return [f"sample {i}" for i in range(len(columns[0]))], scaled
