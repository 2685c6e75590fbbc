"""``--set PATH=VALUE``, and the same from Python: changes to a configuration for one run."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from gearstab.config.document.problems import Code, ConfigError, Path, Problem, nearest, shown
from gearstab.config.document.tree import Document, Where, document_of, mapping
from gearstab.config.document.yaml import parse_value

if TYPE_CHECKING:
    from gearstab.config.model.fields import ShortName
    from gearstab.systems.parts.mesh import ToothMesh

TOP_LEVEL = ("title", "system", "sweep", "methods", "respond", "design")
"""The sections of a document."""


def apply(document: Document, override: str) -> None:
    """Put the value of an override where its path points to; what is wrong with it is reported to the document.

    The path begins at the top of the document or, if its first key is none of the top level, at ``system``; short
    names mean every mesh that has one. Mappings that do not exist yet are made.
    """
    name, equals, text = override.partition("=")
    name = name.strip()
    option = f"--set {name or override}"
    try:
        if not equals or not name:
            raise _wrong(option, "override", "is no PATH=VALUE", "write for example --set system.damping_ratio=0.02")
        value = parse_value(text, option)
    except ConfigError as error:
        document.problems += error.problems
        return
    assign(document, name, value, option)


def assign(document: Document, name: str, value: Any, option: str) -> None:
    """Put plain data where the path ``name`` points to, as :func:`apply` does; ``option``: what messages call it."""
    try:
        for path in _places(document, name, option):
            _put(document, path, value, option)
    except ConfigError as error:
        document.problems += error.problems


def assign_all(document: Document, values: Mapping[str, Any]) -> tuple[str, ...]:
    """Assign values of Python, arrays among them, by path; returns them as ``PATH=VALUE`` texts."""
    texts = []
    for name, value in values.items():
        option = f"override {name}"
        try:
            given = document_of({name: value}, option).data[name]
        except ConfigError as error:
            document.problems += error.problems
            continue
        assign(document, name, given, option)
        texts.append(f"{name}={json.dumps(given)}")
    return tuple(texts)


def _wrong(option: str, code: Code, message: str, hint: str, value: Any = None) -> ConfigError:
    return ConfigError([Problem(option, None, "", shown(value), code, message, hint)])


def _places(document: Document, name: str, option: str) -> list[Path]:
    keys = name.split(".")
    if not isinstance(document.data, dict):
        raise _wrong(option, "syntax", "the configuration is no mapping", "write keys and values")
    if keys[0] in TOP_LEVEL:
        return [_path(document, keys, option)]
    if name == "mesh_frequency":
        raise _wrong(
            option, "override", "is no part of the system", "set sweep.mesh_frequency or respond.mesh_frequency"
        )
    from gearstab.config.model.reading import read
    from gearstab.systems import KINDS, short_names

    system, short = mapping(document.get(("system",))), short_names().get(name)
    kind = system.get("kind")
    if short is not None and isinstance(kind, str) and kind in KINDS:
        section = read(KINDS[kind].variant(system), system)[0]
        if places := list(section.mesh_places()):
            return _of_meshes(places, name, short, option)
    return [_path(document, ["system", *keys], option)]


def _of_meshes(places: list[tuple[Path, ToothMesh]], name: str, short: ShortName, option: str) -> list[Path]:
    from gearstab.systems.parts.mesh import may_have

    found: list[Path] = [("system", *place, name) for place, mesh in places if may_have(name, short, place[-1], mesh)]
    if not found:
        remedy = f"the meshes give {short.rival}: set that" if short.rival else "see `gearstab schema`"
        raise _wrong(option, "unknown_target", f"no mesh has {name}", remedy)
    return found


def _path(document: Document, keys: list[str], option: str) -> Path:
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
            new = len(keys) if path[:1] == ("sweep",) and _names_parameters(path) else 1
            count = lengths[0] if lengths else new
            part, keys = ".".join(keys[:count]), keys[count:]
            inner = known.get(part)
        else:
            where = ".".join(map(str, path))
            raise _wrong(option, "wrong_type", f"{where} is a single value", f"set {where} itself", container)
        path, container = (*path, part), inner
    return path


def _names_parameters(path: Path) -> bool:
    return len(path) == 1 or (len(path) == 3 and isinstance(path[2], int))


def _index(entries: list[Any], key: str, option: str) -> int:
    if key.isdecimal() and int(key) < len(entries):
        return int(key)
    named = [(i, str(entry["name"])) for i, entry in enumerate(entries) if "name" in mapping(entry)]
    names = [name for _, name in named]
    if key in names:
        return named[names.index(key)][0]
    remedy = nearest(key, names) if names and not key.isdecimal() else f"use an index from 0 to {len(entries) - 1}"
    raise _wrong(option, "unknown_name", f"there is no entry '{key}'", remedy)


def _put(document: Document, path: Path, value: Any, option: str) -> None:
    place = Where(option)
    for length in range(1, len(path)):
        if document.get(path[:length]) is None:
            document.put(path[:length], {}, place)
    document.put(path, value, place)
