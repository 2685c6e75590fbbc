"""From a YAML file to a :class:`Config`, or to every mistake in it at once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from math import prod
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np

from gearstab.config import overrides as override
from gearstab.config.configuration import Config
from gearstab.config.document.problems import Code, ConfigError, nearest
from gearstab.config.document.tree import NAME, Document, document_of
from gearstab.config.document.yaml import read
from gearstab.config.overrides import TOP_LEVEL

if TYPE_CHECKING:
    from gearstab.config.reading.system import SystemSections
    from gearstab.config.sections.methods import Methods
    from gearstab.systems.base import System
    from gearstab.systems.parts.respond import Respond
    from gearstab.systems.parts.respond_pair import PairRespond

WITHIN = {
    "sweep": ", such as sweep: {mesh_frequency: {start: 1, stop: 5, num: 200}}",
    "methods": ", such as methods: {floquet: {}}",
    "design": " with its range, variables and minimise",
    "respond": ": mesh_frequency, cycles and an initial state, or speed and cycles of a pair given by its gears",
}
"""Contents of sections that are missing."""


def load(
    path: str | FilePath | Mapping[str, Any] | Document,
    overrides: Sequence[str] | Mapping[str, Any] = (),
    needs: Sequence[str] = (),
    source: FilePath = FilePath(NAME),
) -> Config:
    """Read and check a configuration.

    path: of a file, or what it holds, parsed or as data: then files named in it are relative to the folder of
        ``source``.
    overrides: ``PATH=VALUE`` texts, see :func:`gearstab.config.overrides.apply`, or values by path.
    needs: sections that the caller cannot do without, such as ``("sweep", "methods")``.

    Raises ConfigError with every problem found.
    """
    if isinstance(path, Document):
        document = path
    elif isinstance(path, Mapping):
        document = document_of(path, str(source))
    else:
        source = FilePath(path)
        document = read(source)
    if not isinstance(document.data, dict):
        code: Code = "empty" if document.data is None else "wrong_type"
        message = "is empty" if code == "empty" else "must be a mapping"
        document.report((), code, message, "write the sections system, sweep and methods", value=document.data)
        raise ConfigError(document.problems)
    if isinstance(overrides, Mapping):
        overrides = override.assign_all(document, overrides)
    else:
        for text in overrides:
            override.apply(document, text)
    _check_top_level(document, needs)
    from gearstab.config.checks import feasibility
    from gearstab.config.reading.methods import complete_methods, read_methods, read_uncertainties
    from gearstab.config.reading.respond import read_respond
    from gearstab.config.reading.system import find_model, read_system

    document = document.copy()  # what was written in short is written out in it
    model = find_model(document)
    system = read_system(document, model, source) if model else None
    methods = read_methods(document)
    respond = read_respond(document, model, None if system is None else system.section)
    uncertainties = None
    if methods is not None and system is not None and system.sound:
        methods, uncertainties = read_uncertainties(methods, system)
        methods = complete_methods(document, source, methods, system.axes)
    if methods is not None and system is not None and system.sound:
        for name, code, message, hint in system.section.unfit(system.axes, methods.chosen):
            document.report(("methods", *name), code, message, hint, at_key=True)
    if document.problems or system is None or methods is None or not system.sound:
        raise ConfigError(document.problems)
    config = replace(_config(document, source, system, methods, respond), overrides=tuple(overrides))
    doubts = [*system.doubts, *feasibility.check(document, config)]
    if document.problems:
        raise ConfigError(document.problems)
    if uncertainties is not None:
        from gearstab.config.sections import uncertain

        doubts += uncertain.doubts(document, uncertainties, config.system, config.axes)
    return replace(config, doubts=tuple(doubts), uncertainties=uncertainties)


def system_with(config: Config, values: Mapping[str, Any]) -> System:
    """Return the section ``system`` of a configuration with other numbers, arrays among them, in place of some.

    values: by name, as those of axes; arrays broadcast against each other, and their shape is the batch of the system.

    Raises ConfigError where a value is wrong, and ValueError for arrays whose shapes do not go together.
    """
    from gearstab.config.checks import feasibility
    from gearstab.config.reading.system import find_model, read_system

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
    document = document_of({"system": config.tree["system"], "sweep": sweep}, "values")
    model = find_model(document)
    system = read_system(document, model, config.source) if model else None
    if document.problems or system is None or not system.sound:
        raise ConfigError(document.problems)
    found = replace(config, system=system.section, axes=system.axes, respond=None, document=document)
    feasibility.check(document, found)
    if document.problems:
        raise ConfigError(document.problems)
    return found.at({axis.name: np.reshape(index, shape) for axis in system.axes})


def _check_top_level(document: Document, needs: Sequence[str]) -> None:
    data = document.data
    for key in data:
        if key not in TOP_LEVEL:
            document.report((key,), "unknown_key", "unknown key", nearest(key, TOP_LEVEL), at_key=True)
    title = data.get("title")
    if title is not None and not isinstance(title, str):
        document.report(("title",), "wrong_type", "must be a text", "put it in quotes", value=title)
    needed = ["system", *needs, *(["methods"] if "sweep" in data else []), *(["sweep"] if data.get("methods") else [])]
    _report_missing(document, needed)


def _report_missing(document: Document, needed: Iterable[str]) -> None:
    for name in dict.fromkeys(needed):
        if name not in document.data:
            document.report((name,), "missing", "is missing", f"add the section {name}{WITHIN.get(name, '')}")


def require(config: Config, *needed: str) -> None:
    """Raise ConfigError for sections that a configuration does not have."""
    document = replace(config.document, problems=[])
    _report_missing(document, needed)
    if document.problems:
        raise ConfigError(document.problems)


def _config(
    document: Document,
    source: FilePath,
    system: SystemSections,
    methods: Methods,
    respond: Respond | PairRespond | None,
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
        kind=document.data["system"]["kind"],
        system=system.section,
        axes=system.axes,
        methods=methods,
        respond=respond,
        source=source,
        tree=tree,
        contents=system.contents,
        document=document,
        design=system.design,
    )
