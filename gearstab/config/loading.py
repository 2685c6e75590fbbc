"""From a YAML file to a :class:`Config`, or to every mistake in it at once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import prod
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np

from gearstab.config import overrides as override
from gearstab.config.configuration import Config
from gearstab.config.document.data import NAME, document_of
from gearstab.config.document.problems import ConfigError, Path, dotted, nearest
from gearstab.config.document.yaml import Document, read, value_at
from gearstab.config.model.axes import MESH_FREQUENCY, Array, Axis, parameters_at
from gearstab.config.overrides import TOP_LEVEL

if TYPE_CHECKING:
    from gearstab.config.model.conflicts import Conflict
    from gearstab.config.sections.design import Design
    from gearstab.config.sections.methods import Methods
    from gearstab.config.sections.sweep import Context
    from gearstab.config.sections.targets import Target
    from gearstab.config.sections.uncertain import Uncertainties
    from gearstab.systems.base import System
    from gearstab.systems.parts.respond import Respond
    from gearstab.systems.parts.respond_pair import PairRespond

WITHIN = {
    "sweep": ", such as sweep: {mesh_frequency: {start: 1, stop: 5, num: 200}}",
    "methods": ", such as methods: {floquet: {}}",
    "design": " with its range, variables and minimise",
    "respond": ": mesh_frequency, cycles and an initial state, or speed and cycles of a pair given by its gears",
}
"""What sections that are missing hold."""


def load(
    path: str | FilePath | Mapping[str, Any],
    overrides: Sequence[str] | Mapping[str, Any] = (),
    needs: Sequence[str] = (),
    source: FilePath = FilePath(NAME),
) -> Config:
    """Read and check a configuration.

    path: of a file, or what it would hold: then files named in it are relative to the folder of ``source``.
    overrides: ``PATH=VALUE`` texts, see :func:`gearstab.config.overrides.apply`, or values by path.
    needs: sections that the caller cannot do without, such as ``("sweep", "methods")``.

    Raises ConfigError with every problem found.
    """
    if isinstance(path, Mapping):
        document = document_of(path, str(source))
    else:
        source = FilePath(path)
        document = read(source)
    if not isinstance(document.data, dict):
        message = "is empty" if document.data is None else "must be a mapping"
        document.report((), message, "write the sections system, sweep and methods", value=document.data)
        raise ConfigError(document.problems)
    if isinstance(overrides, Mapping):
        overrides = override.assign_all(document, overrides)
    else:
        for text in overrides:
            override.apply(document, text)
    _check_top_level(document, needs)
    model = _find_model(document)
    system = _read_system(document, model, source) if model else None
    methods = _read_methods(document)
    respond = _read_respond(document, model, system)
    uncertainties = None
    if methods is not None and system is not None:
        methods, uncertainties = _read_uncertainties(methods, system)
    if methods is not None and methods.boundaries is not None and system is not None:
        _check_range(document, system.axes)
    if methods is not None and methods.passage is not None and system is not None:
        methods = _read_passage(document, source, methods, system.axes)
    if methods is not None and model is not None and system is not None:
        for name, message, hint in model.unfit(system.parameters, system.axes, methods.chosen):
            document.report(("methods", *name), message, hint, at_key=True)
    if document.problems or system is None or methods is None:
        raise ConfigError(document.problems)
    config = replace(_config(document, source, system, methods, respond), overrides=tuple(overrides))
    from gearstab.config.checks import feasibility

    doubts = feasibility.check(document, config)
    if document.problems:
        raise ConfigError(document.problems)
    if uncertainties is not None:
        from gearstab.config.sections import uncertain

        doubts += uncertain.doubts(document, uncertainties, config.parameters, config.axes)
    return replace(config, doubts=tuple(doubts), uncertainties=uncertainties)


def parameters_with(config: Config, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parameters of a configuration with other numbers, arrays among them, in place of some.

    values: by name, as those of axes; arrays broadcast against each other, and their shape is the batch of the system.

    Raises ConfigError where a value is wrong, and ValueError for arrays whose shapes do not go together.
    """
    arrays = dict(zip(values, np.broadcast_arrays(*values.values()), strict=True))
    shape = next(iter(arrays.values())).shape
    if len(arrays) == 1:
        ((name, array),) = arrays.items()
        different, index = np.unique(array, return_inverse=True)
        sweep: dict[str, Any] = {name: different}
    else:
        index = np.arange(prod(shape))
        columns = [array.ravel().tolist() for array in arrays.values()]
        rows = enumerate(zip(*columns, strict=True))
        sweep = {"case": [{"label": str(k), **dict(zip(arrays, row, strict=True))} for k, row in rows]}
    document = document_of({"system": config.document.data["system"], "sweep": sweep}, "values")
    model = _find_model(document)
    system = _read_system(document, model, config.source) if model else None
    if document.problems or system is None:
        raise ConfigError(document.problems)
    found = replace(config, parameters=system.parameters, axes=system.axes, respond=None, document=document)
    from gearstab.config.checks import feasibility

    feasibility.check(document, found)
    if document.problems:
        raise ConfigError(document.problems)
    return parameters_at(found, {axis.name: np.reshape(index, shape) for axis in system.axes})


@dataclass
class _System:
    """``system``, ``sweep`` and ``design``. plain: ``system`` as plain data; specs: ``sweep``, resolved.

    context, uncertain: what the names of uncertain parameters refer to, and stand for.
    """

    plain: dict[str, Any]
    parameters: dict[str, Any]
    contents: dict[str, Array]
    axes: tuple[Axis, ...]
    specs: dict[str, Any]
    context: Context
    uncertain: dict[str, list[Target]]
    design: Design | None


def _check_top_level(document: Document, needs: Sequence[str]) -> None:
    data = document.data
    for key in data:
        if key not in TOP_LEVEL:
            document.report((key,), "unknown key", nearest(key, TOP_LEVEL), at_key=True)
    title = data.get("title")
    if title is not None and not isinstance(title, str):
        document.report(("title",), "must be a text", "put it in quotes", value=title)
    needed = ["system", *needs, *(["methods"] if "sweep" in data else []), *(["sweep"] if data.get("methods") else [])]
    _report_missing(document, needed)


def _report_missing(document: Document, needed: Iterable[str]) -> None:
    for name in dict.fromkeys(needed):
        if name not in document.data:
            document.report((name,), "is missing", f"add the section {name}{WITHIN.get(name, '')}")


def require(config: Config, *needed: str) -> None:
    """Raise ConfigError for sections that a configuration does not have."""
    document = replace(config.document, problems=[])
    _report_missing(document, needed)
    if document.problems:
        raise ConfigError(document.problems)


def _find_model(document: Document) -> type[System] | None:
    """The model of ``system.kind``; None after reporting that there is none."""
    from gearstab.systems import KINDS

    if "system" not in document.data:
        return None
    system = document.data["system"]
    available = f"available: {', '.join(KINDS)}"
    if not isinstance(system, dict):
        document.report(("system",), "must be a mapping", f"add kind; {available}", value=system)
        return None
    kind, path = system.get("kind"), ("system", "kind")
    if isinstance(kind, str) and kind in KINDS:
        return KINDS[kind].variant(system)
    if kind is None:
        document.report(path, "is missing", f"add kind; {available}")
    else:
        document.report(path, "is no kind of system", f"{nearest(str(kind), KINDS)} ({available})", value=kind)
    return None


def _read_system(document: Document, model: type[System], source: FilePath) -> _System | None:
    """The sections ``system`` and ``sweep``; None after reporting problems."""
    from gearstab.config.checks.samples import check_variation
    from gearstab.config.model.conflicts import as_meant
    from gearstab.config.model.introspection import as_parameters
    from gearstab.config.model.validation import validate
    from gearstab.config.sections import sweep
    from gearstab.config.sections.dimensions import check_units

    raw = document.data["system"]
    _name_meshes(document, model)
    contents = model.read_files(document, source)
    model.complete(document, raw, model.size(as_meant(raw | contents, model)))
    from_file: dict[str, Any] = {k: v for k, v in contents.items() if k != "damping"}
    if "damping" in contents:
        from_file["damping"] = {"matrix": contents["damping"]}
    meant = as_meant(raw | from_file, model)
    samples = _read_samples(document, meant, source)
    context = sweep.Context(document, model, meant)
    layouts = sweep.layouts(context) if "sweep" in document.data else []
    variables: list[sweep.UnresolvedAxis] = []
    if "design" in document.data:
        from gearstab.config.sections import design

        variables = design.layouts(context)
    known = set(sweep.base_values(document, [*layouts, *variables]))
    targets: dict[str, list[Target]] = {}
    if value_at(document.data, ("methods", "tolerance")) is not None:
        from gearstab.config.sections import uncertain

        targets = uncertain.resolve(context, value_at(document.data, uncertain.SECTION))
        known |= set(uncertain.base_values(context, targets))
    section = as_meant(raw | from_file, model)
    _report(document, ("system",), model.conflicts(section), section)
    known |= check_units(document, model, meant, "system", model, known)
    system = validate(document, model, ("system",), known)
    built = [(layout.name, sweep.build(context, layout)) for layout in layouts]
    wanted = design.read(context, variables) if "design" in document.data else None
    if system is None:
        return None
    axes = tuple(item[0] for _, item in built if item)
    undamped = {"damping_ratio": 0.0} if (raw | from_file).get("damping") is None else {}
    plain = {"kind": raw["kind"]} | undamped | system.model_dump(mode="json", exclude_none=True)
    parameters = undamped | as_parameters(system) | from_file
    for where, values in samples.items():
        value_at(parameters, where).update(phase=values[0], stiffness=values[1])
    check_variation(document, section, samples, axes)
    contents |= {dotted(where): values for where, values in samples.items()}
    specs = {name: item[1] for name, item in built if item}
    return _System(plain, parameters, contents, axes, specs, context, targets, wanted)


def _name_meshes(document: Document, model: type[System]) -> None:
    meshes = document.data["system"].get("meshes")
    for i, mesh in enumerate(meshes if isinstance(meshes, list) else []):
        if isinstance(mesh, dict) and mesh.get("name") is None:
            name = model.mesh_names[i] if i < len(model.mesh_names) else f"mesh{i + 1}"
            document.put(("system", "meshes", i, "name"), name, document.where(("system", "meshes", i)))


def _read_samples(document: Document, section: dict[str, Any], source: FilePath) -> dict[Path, Array]:
    """What the files of waveforms hold, by the place of the waveform below ``system``; problems are reported."""
    from gearstab.config.checks.samples import waveforms
    from gearstab.waveforms.section import wave_of

    found: dict[Path, Array] = {}
    for path, waveform in waveforms(section, ()):
        name, wave = waveform.get("file"), wave_of(waveform)
        if not isinstance(name, str) or wave is None:
            continue
        from gearstab.config.checks.sample_file import read_samples
        from gearstab.config.document.files import DataFileError

        interpolation = waveform.get("interpolation") or "linear"
        try:
            found[path] = read_samples(source.parent / name, wave, str(interpolation))
        except DataFileError as error:
            document.report(("system", *path, "file"), str(error), error.hint, value=name)
    return found


def _read_methods(document: Document) -> Methods | None:
    from gearstab.config.model.validation import validate
    from gearstab.config.sections.methods import Methods
    from gearstab.config.sections.sweep import sets_mesh_frequency

    data = document.data
    if "methods" not in data:
        return Methods()
    section = data["methods"]
    for name in section if isinstance(section, dict) else ():
        if section[name] is None and name in Methods.model_fields:
            document.put(("methods", name), {}, document.where(("methods", name)))  # `floquet:` asks for it
    if section is None or section == {}:
        document.report(("methods",), "names no method", f"add one of {', '.join(Methods.model_fields)}")
        return None
    sweep = data.get("sweep")
    if isinstance(section, dict) and isinstance(sweep, dict):
        remedy = "add mesh_frequency: {start: .., stop: .., num: ..} to sweep"
        for name in ("floquet", "response", "tolerance"):
            uncertain = value_at(section, ("tolerance", "parameters")) if name == "tolerance" else None
            own = uncertain if isinstance(uncertain, dict) else {}
            if name in section and not (sets_mesh_frequency(sweep) or sets_mesh_frequency(own)):
                document.report(("methods", name), "needs a mesh_frequency axis", remedy, at_key=True)
        # Boundaries are sought between the ends of an axis; frequencies that come with cases have none.
        for name in ("boundaries", "passage"):
            if name in section and not {"mesh_frequency", "input_speed"} & sweep.keys():
                document.report(("methods", name), "needs a mesh_frequency axis", remedy, at_key=True)
    return validate(document, Methods, ("methods",))


def _read_uncertainties(methods: Methods, system: _System) -> tuple[Methods, Uncertainties | None]:
    """The methods with distributions in SI units, and the uncertain parameters; None without the method tolerance."""
    if methods.tolerance is None:
        return methods, None
    from gearstab.config.sections import uncertain

    found = uncertain.uncertainties(system.context, methods.tolerance, system.uncertain, system.axes)
    if found is None:
        return methods, None
    own = methods.tolerance.model_copy(update={"parameters": found[1]})
    return methods.model_copy(update={"tolerance": own}), found[0]


def _read_passage(document: Document, source: FilePath, methods: Methods, axes: Sequence[Axis]) -> Methods:
    """The methods with the path that a file holds, in mesh frequencies of an axis that may be the input speed."""
    from gearstab.config.checks.sample_file import read_path
    from gearstab.config.document.files import DataFileError
    from gearstab.config.model.validation import validate
    from gearstab.config.sections.methods import Methods

    own, place = methods.passage, ("methods", "passage")
    if own.rate is not None:
        _check_range(document, axes, "which is passed")
    if own.table is not None:
        try:
            knots = [list(knot) for knot in read_path(source.parent / own.table)]
        except DataFileError as error:
            document.report((*place, "table"), str(error), error.hint, value=own.table)
            return methods
        where = document.where((*place, "table"))
        del document.get(place)["table"]
        document.put((*place, "path"), knots, where)
        found = validate(document, Methods, ("methods",))
        if found is None:
            return methods
        own = found.passage
    speed = next((axis for axis in axes if axis.name in ("mesh_frequency", "input_speed")), None)
    factor = 1.0 if speed is None else next((a.factor for a in speed.assignments if a.path == MESH_FREQUENCY), 1.0)
    return methods.model_copy(update={"passage": own.over(factor)})


def _check_range(document: Document, axes: Sequence[Axis], what: str = "over which boundaries are sought") -> None:
    """Boundaries are sought over a range of the mesh frequency, so that one frequency alone holds none."""
    for axis in axes:
        numbers = axis.name in ("mesh_frequency", "input_speed") and not isinstance(axis.values, list)
        if numbers and axis.span[0] == axis.span[1]:
            path = ("sweep", axis.name)
            hint = "give two frequencies or more, or start and stop"
            document.report(path, f"is no range, {what}", hint)


def _read_respond(
    document: Document, model: type[System] | None, system: _System | None
) -> Respond | PairRespond | None:
    if "respond" not in document.data:
        return None
    from gearstab.config.model.conflicts import as_meant
    from gearstab.config.model.validation import validate
    from gearstab.config.sections.dimensions import check_units
    from gearstab.systems.parts.respond import Respond

    raw, section = document.data.get("system"), document.data["respond"]
    wanted: type[Respond | PairRespond] = Respond if model is None else model.respond_model()
    known = as_meant(raw, model) or {}
    if system:
        known |= system.contents
    size = model.size(known) if model else None
    if model is not None and wanted is Respond and isinstance(section, dict):
        _replace_input_speed(document, section, model.cycles_of_input(known))
    meant = as_meant(section, wanted)
    if meant is not None:
        _report(document, ("respond",), wanted.conflicts(meant, known, size), meant)
    wrong = check_units(document, model, known, "respond", wanted) if model else set()
    respond: Respond | PairRespond | None = validate(document, wanted, ("respond",), wrong)
    return None if respond is None or size is None else respond.of_size(size)


def _replace_input_speed(document: Document, section: dict[str, Any], cycles: float | None) -> None:
    """Write the mesh frequency in place of an input speed. cycles: of the first mesh in a turn of the input."""
    from pydantic_core import PydanticCustomError

    from gearstab.config.model.fields import Quantity
    from gearstab.config.sections.targets import INPUT_SPEED, UNKNOWN_TEETH

    value, path = section.get(INPUT_SPEED), ("respond", INPUT_SPEED)
    if value is None or section.get("mesh_frequency") is not None:
        return
    if cycles is None:
        document.report(path, "the numbers of teeth are not known", UNKNOWN_TEETH, at_key=True)
        return
    try:
        speed = Quantity("rad/s").number(value)
    except PydanticCustomError:
        return  # which is reported where the section is validated
    document.put(("respond", "mesh_frequency"), speed * cycles, document.where(path))
    del section[INPUT_SPEED]


def _report(document: Document, path: Path, conflicts: Iterable[Conflict], section: Any) -> None:
    """Report what contradicts itself in a section as meant, but for what is unknown there."""
    from gearstab.config.model.conflicts import is_known

    for inner, message, hint in conflicts:
        if is_known(section, inner):
            document.report((*path, *inner), message, hint)


def _config(
    document: Document, source: FilePath, system: _System, methods: Methods, respond: Respond | PairRespond | None
) -> Config:
    title = document.data.get("title") or ("" if document.first is None else source.stem)
    tree: dict[str, Any] = {"title": title, "system": system.plain}
    if system.specs:
        tree["sweep"] = system.specs
    if methods.chosen:
        tree["methods"] = methods.model_dump(mode="json", exclude_none=True)
    if respond is not None:
        tree["respond"] = respond.model_dump(mode="json", exclude_none=True)
    if system.design is not None:
        tree["design"] = system.design.tree
    return Config(
        title=title,
        kind=system.parameters["kind"],
        parameters=system.parameters,
        axes=system.axes,
        methods=methods,
        respond=respond,
        source=source,
        tree=tree,
        contents=system.contents,
        document=document,
        design=system.design,
    )
