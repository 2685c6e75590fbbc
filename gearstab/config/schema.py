"""The JSON schema of a configuration, for completion and checks in editors."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from gearstab.config.model.fields import NUMBER
from gearstab.config.model.reading import descriptions, field_types, is_model, number_kind, title_of
from gearstab.config.sections import design
from gearstab.config.sections.expansion import Range
from gearstab.config.sections.methods import Methods
from gearstab.config.sections.sweep import Tie
from gearstab.systems import KINDS, short_names
from gearstab.systems.gear_pair import RotatingGearPair
from gearstab.systems.parts.respond import Respond
from gearstab.systems.parts.respond_pair import PairRespond

DIALECT = "https://json-schema.org/draft/2020-12/schema"


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
            "system": _system([references[(model, "validation")] for model in systems]),
            "sweep": _sweep(),
            "methods": {"$ref": "#/$defs/Methods"},
            "design": design.json_schema(),
            "respond": {"anyOf": [{"$ref": "#/$defs/Respond"}, {"$ref": "#/$defs/PairRespond"}]},
        },
        "dependentRequired": {"sweep": ["methods"], "methods": ["sweep"]},
        "$defs": found | {"Values": _values(), "Case": _case()},
    }


def _system(forms: list[Any]) -> dict[str, Any]:
    return {
        "description": "What vibrates; kind chooses the model.",
        "type": "object",
        "required": ["kind"],
        "properties": {"kind": {"enum": list(KINDS), "description": "Kind of system."}},
        "oneOf": forms,
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


def _values() -> dict[str, Any]:
    return {
        "description": "The values of a parameter along an axis: one, a list, or a range.",
        "anyOf": [NUMBER, {"type": "array", "minItems": 1, "items": NUMBER}, {"$ref": "#/$defs/Range"}],
    }


def _case() -> dict[str, Any]:
    return {
        "description": "One point of an axis that changes several parameters together.",
        "type": "object",
        "properties": {"label": {"type": ["string", "number"], "description": "What figures call this case; unique."}},
        "additionalProperties": NUMBER,
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
