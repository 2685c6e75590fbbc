"""The JSON schema of a configuration, for completion and checks in editors."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from gearstab.config.model.introspection import field_types, is_model, number_kind
from gearstab.config.sections.expansion import Range
from gearstab.config.sections.methods import Methods
from gearstab.config.sections.objectives import OBJECTIVES, QUANTITIES
from gearstab.config.sections.sweep import Tie
from gearstab.systems import KINDS, short_names
from gearstab.systems.gear_pair import RotatingGearPair
from gearstab.systems.parts.respond import Respond
from gearstab.systems.parts.respond_pair import PairRespond

DIALECT = "https://json-schema.org/draft/2020-12/schema"
NUMBER = {"type": ["number", "string"]}
"""A number, or a text with its unit, or an exact ratio; which of them the parameter decides."""


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
    found["Tie"]["properties"]["values"] = _tied_values(found["Tie"]["properties"]["values"])
    found["Matrices"]["properties"]["damping"] = _matrix_or(found["Matrices"]["properties"]["damping"])
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
            "design": _design(),
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


def _design() -> dict[str, Any]:
    ends = {"type": "array", "minItems": 2, "maxItems": 2, "items": NUMBER}
    span = {
        "type": "object",
        "additionalProperties": False,
        "properties": {
            "mesh_frequency": ends | {"description": "Lowest and highest frequency of the first mesh (rad/s)."},
            "input_speed": ends | {"description": "Of systems with an input, in place of mesh_frequency."},
            "weight": {"type": "number", "exclusiveMinimum": 0, "description": "Of this range; default 1."},
        },
    }
    weights = {
        "type": "object",
        "additionalProperties": False,
        "minProperties": 1,
        "properties": {
            name: {"type": "number", "exclusiveMinimum": 0, "description": QUANTITIES[name].long_name}
            for name in OBJECTIVES
        },
    }
    goal = {"anyOf": [{"enum": list(OBJECTIVES)}, weights]}
    limit = {
        "type": "object",
        "additionalProperties": False,
        "minProperties": 1,
        "properties": {"min": NUMBER, "max": NUMBER},
    }
    limits = {name: limit | {"description": item.long_name} for name, item in QUANTITIES.items()}
    return {
        "description": "What gearstab design may change, and what for.",
        "type": "object",
        "additionalProperties": False,
        "required": ["range", "variables", "minimise"],
        "properties": {
            "range": {"anyOf": [span, {"type": "array", "minItems": 1, "items": span}]},
            "variables": {"type": "object", "minProperties": 1, "additionalProperties": _variable(ends)},
            "minimise": {"anyOf": [goal, {"type": "array", "minItems": 1, "items": goal}]},
            "constraints": {"type": "object", "properties": limits, "additionalProperties": limit},
        },
    }


def _variable(bounds: dict[str, Any]) -> dict[str, Any]:
    """Bounds, or one of the forms of choices."""
    forms: dict[str, dict[str, Any]] = {
        "integers": {"type": "array", "minItems": 2, "maxItems": 2, "items": {"type": "number"}},
        "values": {"type": "array", "minItems": 1, "items": NUMBER},
        "catalogue": {"type": "string", "description": "A CSV file: columns are paths, rows are choices."},
        "choices": {"type": "array", "minItems": 1, "items": {"$ref": "#/$defs/Case"}},
    }
    options = [
        {"type": "object", "additionalProperties": False, "required": [key], "properties": {key: form}}
        for key, form in forms.items()
    ]
    return {"anyOf": [bounds, *options]}


def _values() -> dict[str, Any]:
    return {
        "description": "The values of a parameter along an axis: one, a list, or a range.",
        "anyOf": [NUMBER, {"type": "array", "minItems": 1, "items": NUMBER}, {"$ref": "#/$defs/Range"}],
    }


def _tied_values(form: dict[str, Any]) -> dict[str, Any]:
    """Values for all targets, or a list of such values, one for each target."""
    each = {"anyOf": [NUMBER, {"type": "array", "minItems": 1, "items": NUMBER}, {"$ref": "#/$defs/Range"}]}
    options = [NUMBER, {"type": "array", "minItems": 1, "items": each}, {"$ref": "#/$defs/Range"}]
    return {"description": form["description"], "anyOf": options}


def _case() -> dict[str, Any]:
    return {
        "description": "One point of an axis that changes several parameters together.",
        "type": "object",
        "properties": {"label": {"type": ["string", "number"], "description": "What figures call this case; unique."}},
        "additionalProperties": NUMBER,
    }


def _matrix_or(form: dict[str, Any]) -> dict[str, Any]:
    """The damping of a model given as matrices may be nested lists, as its mass and stiffness are."""
    rows = {"type": "array", "items": {"type": "array", "items": NUMBER}, "description": "C, one row per coordinate."}
    return {"description": form["description"], "anyOf": [*form["anyOf"], rows]}


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
