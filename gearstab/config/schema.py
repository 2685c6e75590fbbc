"""The JSON schema of a configuration, for completion and checks in editors."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from gearstab.config.document import mapping, nearest, sequence
from gearstab.config.model.fields import NUMBER
from gearstab.config.model.reading import descriptions, field_types, inner_type, is_model, number_kind, title_of
from gearstab.config.readers import Methods
from gearstab.config.sections import design
from gearstab.config.sections.expansion import Range, Tie
from gearstab.errors import NotPossible
from gearstab.systems import KINDS, short_names
from gearstab.systems.base import Start
from gearstab.systems.gear_pair import RotatingGearPair
from gearstab.systems.respond import PairRespond, Respond

DIALECT = "https://json-schema.org/draft/2020-12/schema"
VALUES = {
    "description": "The values of a parameter along an axis: one, a list, or a range.",
    "anyOf": [NUMBER, {"type": "array", "minItems": 1, "items": NUMBER}, {"$ref": "#/$defs/Range"}],
}
CASE = {
    "description": "One point of an axis that changes several parameters together.",
    "type": "object",
    "properties": {"label": {"type": ["string", "number"], "description": "What figures call this case; unique."}},
    "additionalProperties": NUMBER,
}


def schema() -> dict[str, Any]:
    """The schema, draft 2020-12.

    What only the whole document can tell is left to ``gearstab check``: which parameter names exist, and whether a
    parameter without a value gets one from an axis. So no parameter that an axis can set is required here.
    """
    systems: list[type[BaseModel]] = [*KINDS.values(), RotatingGearPair]
    models: list[type[BaseModel]] = [*systems, Methods, Respond, PairRespond, Range, Tie]
    references, definitions = models_json_schema([(m, "validation") for m in models], ref_template="#/$defs/{model}")
    found = definitions["$defs"]
    for model in _all_models(models):
        _loosen(found[model.__name__], model)
        for name, text in descriptions(model).items():
            found[model.__name__]["properties"][name] |= {"description": text, "title": title_of(model, name)}
    return {
        "$schema": DIALECT,
        "title": "gearstab configuration",
        "type": "object",
        "additionalProperties": False,
        "required": ["system"],
        "properties": {
            "title": {"type": "string", "description": "Heads figures and results."},
            "system": {
                "description": "What vibrates; kind chooses the model.",
                "type": "object",
                "required": ["kind"],
                "properties": {"kind": {"enum": list(KINDS), "description": "Kind of system."}},
                "oneOf": [references[(model, "validation")] for model in systems],
            },
            "sweep": _sweep(),
            "methods": {"$ref": "#/$defs/Methods"},
            "design": design.json_schema(),
            "respond": {"anyOf": [{"$ref": "#/$defs/Respond"}, {"$ref": "#/$defs/PairRespond"}]},
        },
        "dependentRequired": {"sweep": ["methods"], "methods": ["sweep"]},
        "$defs": found | {"Values": VALUES, "Case": CASE},
    }


def _sweep() -> dict[str, Any]:
    axis = {
        "anyOf": [
            {"$ref": "#/$defs/Values"},
            {"$ref": "#/$defs/Tie"},
            {"type": "array", "minItems": 1, "items": {"$ref": "#/$defs/Case"}},
        ]
    }
    said = {
        "mesh_frequency": "Frequency of the first mesh (rad/s).",
        "input_speed": "Of a gearbox, in place of mesh_frequency (rad/s, or with a unit such as rpm).",
    }
    said |= {
        name: "Of every mesh but the first." if short.but_first else "Of every mesh that has one."
        for name, short in short_names().items()
    }
    return {
        "description": "The axes of the grid: short names, dotted paths below system, or names of several parameters.",
        "type": "object",
        "minProperties": 1,
        "properties": {name: {"$ref": "#/$defs/Values", "description": text} for name, text in said.items()},
        "additionalProperties": axis,
    }


def _all_models(models: list[type[BaseModel]]) -> set[type[BaseModel]]:
    """The models and all models inside them."""
    found: set[type[BaseModel]] = set()
    waiting = list(models)
    while waiting:
        model = waiting.pop()
        if model not in found:
            found.add(model)
            waiting += [inner for annotation in field_types(model).values() for inner in _models_in(annotation)]
    return found


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if is_model(annotation):
        return [annotation]
    return [model for inner in getattr(annotation, "__args__", ()) for model in _models_in(inner)]


def _loosen(definition: dict[str, Any], model: type[BaseModel]) -> None:
    """Names have defaults, and axes can give a number that the system does not."""
    free = {name for name, annotation in field_types(model).items() if number_kind(annotation)} | {"name"}
    if issubclass(model, Respond | PairRespond):
        free = set()
    definition["required"] = [name for name in definition.get("required", []) if name not in free]
    if not definition["required"]:
        del definition["required"]


FIRST_METHODS: dict[str, Any] = {"floquet": {}, "boundaries": {}, "perturbation": {"harmonics": 2}}
"""Methods of a configuration to start from."""

COLUMN = 46
"""Column at which comments begin."""


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
        ("", ""), ("methods:", "what is computed over the grid"), *_mapping(FIRST_METHODS, Methods, 2, False),
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
