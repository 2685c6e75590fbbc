"""From a YAML file to a :class:`Config`, or to every mistake in it at once."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from math import prod
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np

from gearstab.config.configuration import Config
from gearstab.config.document import (
    NAME,
    Code,
    ConfigError,
    Document,
    Path,
    Problem,
    Where,
    document_of,
    mapping,
    nearest,
    shown,
)
from gearstab.config.document.yaml import parse_value, read_yaml

if TYPE_CHECKING:
    from gearstab.config.model.fields import ShortName
    from gearstab.systems.base import System
    from gearstab.systems.mesh import ToothMesh

TOP_LEVEL = ("title", "system", "sweep", "methods", "respond", "design")
"""The sections of a document."""


def apply(document: Document, overrides: Sequence[str] | Mapping[str, Any]) -> tuple[str, ...]:
    """Put the values of overrides where their paths point to; what is wrong with them is reported to the document.

    A path begins at the top of the document or, if its first key is none of the top level, at ``system``; short names
    mean every mesh that has one. Mappings that do not exist yet are made.

    overrides: ``PATH=VALUE`` texts, or values of Python, arrays among them, by path. Returns them as texts.
    """
    texts = []
    for item in overrides.items() if isinstance(overrides, Mapping) else overrides:
        try:
            texts.append(_apply_one(document, item))
        except ConfigError as error:
            document.problems += error.problems
    return tuple(texts)


def _apply_one(document: Document, item: str | tuple[str, Any]) -> str:
    """Put the value of an override, a text or name and value, where its name points to; return it as a text."""
    if isinstance(item, str):
        text = item
        name, equals, written = (part.strip() for part in text.partition("="))
        option = f"--set {name or text}"
        if not equals or not name:
            raise _wrong(option, "override", "is no PATH=VALUE", "write for example --set system.damping_ratio=0.02")
        value = parse_value(written, option)
    else:
        name, option = item[0], f"override {item[0]}"
        value = document_of({name: item[1]}, option).data[name]
        text = f"{name}={json.dumps(value)}"
    for path in _places(document, name, option):
        for length in range(1, len(path)):
            if document.get(path[:length]) is None:
                document.put(path[:length], {}, Where(option))
        document.put(path, value, Where(option))
    return text


def _wrong(option: str, code: Code, message: str, hint: str, value: Any = None) -> ConfigError:
    return ConfigError([Problem(option, None, "", shown(value), code, message, hint)])


def _places(document: Document, name: str, option: str) -> list[Path]:
    keys = name.split(".")
    if not isinstance(document.data, dict):
        raise _wrong(option, "syntax", "the configuration is no mapping", "write keys and values")
    if keys[0] in TOP_LEVEL:
        return [_walk(document, keys, option)]
    if name == "mesh_frequency":
        hint = "set sweep.mesh_frequency or respond.mesh_frequency"
        raise _wrong(option, "override", "is no part of the system", hint)
    from gearstab.config.model.reading import read
    from gearstab.systems import KINDS, short_names

    system, short = mapping(document.get(("system",))), short_names().get(name)
    kind = system.get("kind")
    if short is not None and isinstance(kind, str) and kind in KINDS:
        section = read(KINDS[kind].variant(system), system)[0]
        if places := list(section.mesh_places()):
            return _of_meshes(places, name, short, option)
    return [_walk(document, ["system", *keys], option)]


def _of_meshes(places: list[tuple[Path, ToothMesh]], name: str, short: ShortName, option: str) -> list[Path]:
    from gearstab.systems.mesh import may_have

    found: list[Path] = [("system", *place, name) for place, mesh in places if may_have(name, short, place[-1], mesh)]
    if not found:
        remedy = f"the meshes give {short.rival}: set that" if short.rival else "see `gearstab schema`"
        raise _wrong(option, "unknown_target", f"no mesh has {name}", remedy)
    return found


def _walk(document: Document, keys: list[str], option: str) -> Path:
    """Keys and indices of a dotted path. Keys of ``sweep`` hold dots themselves: the longest one that exists counts."""
    path: Path = ()
    container: Any = document.data
    while keys:
        if isinstance(container, list):
            part: str | int = _index(container, keys.pop(0), option)
            inner = container[int(part)]
        elif isinstance(container, dict) or container is None:
            known = container or {}
            lengths = [n for n in range(len(keys), 0, -1) if ".".join(keys[:n]) in known]
            # A new key of a sweep or of a case is the name of a parameter, dots and all.
            names = len(path) == 1 or (len(path) == 3 and isinstance(path[2], int))
            new = len(keys) if path[:1] == ("sweep",) and names else 1
            count = lengths[0] if lengths else new
            part, keys = ".".join(keys[:count]), keys[count:]
            inner = known.get(part)
        else:
            where = ".".join(map(str, path))
            raise _wrong(option, "wrong_type", f"{where} is a single value", f"set {where} itself", container)
        path, container = (*path, part), inner
    return path


def _index(entries: list[Any], key: str, option: str) -> int:
    if key.isdecimal() and int(key) < len(entries):
        return int(key)
    named = [(i, str(entry["name"])) for i, entry in enumerate(entries) if "name" in mapping(entry)]
    names = [name for _, name in named]
    if key in names:
        return named[names.index(key)][0]
    remedy = nearest(key, names) if names and not key.isdecimal() else f"use an index from 0 to {len(entries) - 1}"
    raise _wrong(option, "unknown_name", f"there is no entry '{key}'", remedy)


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
    overrides: ``PATH=VALUE`` texts, see :func:`gearstab.config.loading.apply`, or values by path.
    needs: sections that the caller cannot do without, such as ``("sweep", "methods")``.

    Raises ConfigError with every problem found.
    """
    if isinstance(path, Document):
        document = path
    elif isinstance(path, Mapping):
        document = document_of(path, str(source))
    else:
        source = FilePath(path)
        document = read_yaml(source)
    if not isinstance(document.data, dict):
        code: Code = "empty" if document.data is None else "wrong_type"
        message = "is empty" if code == "empty" else "must be a mapping"
        document.report((), code, message, "write the sections system, sweep and methods", value=document.data)
        raise ConfigError(document.problems)
    texts = apply(document, overrides)
    _check_top_level(document, needs)
    from gearstab.config import plausibility
    from gearstab.config.readers import read_methods, read_respond, read_system

    system = read_system(document, source)
    respond = read_respond(document, None if system is None else system.section)
    chosen = read_methods(document, source, system)
    if system is None or chosen is None or document.problems:
        raise ConfigError(document.problems)
    sections = {
        "system": system.plain,
        "sweep": system.specs,
        "methods": chosen[0].model_dump(mode="json", exclude_none=True),
        "respond": respond.model_dump(mode="json", exclude_none=True) if respond else {},
        "design": system.design.tree if system.design else {},
    }
    title = document.data.get("title") or ("" if document.first is None else source.stem)
    config = Config(
        system=system.section,
        axes=system.axes,
        methods=chosen[0],
        respond=respond,
        source=source,
        tree={"title": title} | {name: section for name, section in sections.items() if section},
        contents=system.contents,
        document=document,
        overrides=texts,
        design=system.design,
        uncertainties=chosen[1],
    )
    return replace(config, doubts=(*system.doubts, *plausibility.check(document, config)))


def system_with(config: Config, values: Mapping[str, Any]) -> System:
    """Return the section ``system`` of a configuration with other numbers, arrays among them, in place of some.

    values: by name, as those of axes; arrays broadcast against each other, and their shape is the batch of the system.

    Raises ConfigError where a value is wrong, and ValueError for arrays whose shapes do not go together.
    """
    from gearstab.config import plausibility
    from gearstab.config.readers import read_system

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
    system = read_system(document, config.source)
    if system is None or document.problems:
        raise ConfigError(document.problems)
    found = replace(config, system=system.section, axes=system.axes, respond=None, document=document)
    plausibility.check(document, found)
    return found.at({axis.name: np.reshape(index, shape) for axis in system.axes})


def _check_top_level(document: Document, needs: Sequence[str]) -> None:
    """Report unknown and missing sections, and a title that is no text."""
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
    document.stop()
