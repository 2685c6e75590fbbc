"""A configuration to start from, for every kind of system: one that runs, with what its keys mean beside them.

The comments are the descriptions of the fields, so that they say what the program knows. The values are the kind's.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from gearstab.config.document.problems import nearest
from gearstab.config.document.tree import mapping, sequence
from gearstab.config.model.reading import descriptions, inner_type, is_model
from gearstab.config.sections.methods import Methods
from gearstab.errors import NotPossible
from gearstab.systems import KINDS
from gearstab.systems.base import Start

METHODS: dict[str, Any] = {"floquet": {}, "boundaries": {}, "perturbation": {"harmonics": 2}}
"""Methods of a configuration to start from."""

COLUMN, WIDTH = 46, 150
"""Column at which comments begin, and preferred length of lines."""


def starts() -> dict[str, Start]:
    """Return what there is to start from, by the kind of system."""
    return {name: kind.start for name, kind in KINDS.items() if kind.start is not None}


def commented(kind: str) -> str:
    """Return a commented configuration of a kind of system. Raises NotPossible for an unknown kind."""
    there = starts()
    if kind not in there:
        raise NotPossible(f"there is no kind of system '{kind}'", nearest(kind, there))
    start = there[kind]
    axes = [(f"  {name}: {flow(spec)}", remark) for name, (spec, remark) in start.sweep.items()]
    lines = [
        (f"title: {json.dumps(start.title)}", ""), ("", ""),
        ("system:", ""), *_mapping(start.system, KINDS[kind], 2, True), ("", ""),
        ("sweep:", "the grid: any number of the system can be an axis, by its path, meshes.0.contact_ratio"), *axes,
        ("", ""), ("methods:", "what is computed over the grid"), *_mapping(METHODS, Methods, 2, False),
    ]  # fmt: skip
    return "\n".join([*HEAD, "", *(_joined(text, comment) for text, comment in lines)])


HEAD = (
    "# To use it, with this text in train.yaml:",
    "#   gearstab check train.yaml            is it right?",
    "#   gearstab info train.yaml             natural frequencies, and the speeds to expect instability at",
    "#   gearstab sweep train.yaml            writes results/train.h5",
    "#   gearstab plot results/train.h5       draws results/train.png",
    "# Numbers are in SI units, or texts with a unit: \"25 mm\". docs/configuration.md lists every key.",
)  # fmt: skip


def _mapping(section: dict[str, Any], model: Any, indent: int, others: bool) -> Iterator[tuple[str, str]]:
    """The lines of a section and their comments, which are the descriptions of the model's fields.

    others: whether to name the keys that the section does not use.
    """
    for key, value in section.items():
        kind = inner_type(model, key)
        said = descriptions(model).get(key, "") if is_model(model) and key != "name" else ""
        said = said.rstrip(".")
        blank = " " * indent
        first = next(iter(sequence(value)), None)
        if mapping(value) and is_model(kind):
            yield f"{blank}{key}:", said
            yield from _mapping(value, kind, indent + 2, key == "meshes")
        elif mapping(first):
            yield f"{blank}{key}:", said
            yield from _entries(value, kind, indent + 2)
        elif sequence(first):
            yield f"{blank}{key}:", said
            yield from ((f"{blank}  - {flow(row)}", "") for row in value)
        else:
            yield f"{blank}{key}: {flow(value)}", said
    if others and is_model(model):
        more = [name for name in model.model_fields if name not in section]
        yield from [(f"{' ' * indent}# more keys: {', '.join(more)}", "")] if more else ()


def _entries(entries: list[dict[str, Any]], kind: Any, indent: int) -> Iterator[tuple[str, str]]:
    """The entries of a list: the first one key by key, if its keys have more to say, the others on a line each."""
    blank = " " * indent
    first, model = entries[0], inner_type(kind, 0)
    if len(first) < 3:
        yield from ((f"{blank}- {flow(entry)}", "") for entry in entries)
        return
    lines = list(_mapping(first, model, indent + 2, False))
    yield f"{blank}- {lines[0][0].lstrip()}", lines[0][1]
    yield from lines[1:]
    yield from ((f"{blank}- {flow(entry)}", "") for entry in entries[1:])


def flow(value: Any) -> str:
    """Return a value on one line of YAML."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {flow(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(flow, value)) + "]"
    if isinstance(value, float):
        return f"{value:.1e}" if value >= 1e6 else f"{value:g}" if value % 1 else f"{value:.1f}"
    if isinstance(value, str) and (" " in value or "/" in value):
        return json.dumps(value)
    return str(value)


def _joined(text: str, comment: str) -> str:
    """A line and its comment, which begins in a column where there is room."""
    if not comment:
        return text
    return f"{text.ljust(COLUMN) if len(text) < COLUMN else text + '  '}# {comment}"
