"""From pydantic's errors to problems that name place, value and remedy."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any, TypeVar, get_args, get_origin

from pydantic import BaseModel
from pydantic_core import ErrorDetails

from gearstab.config.document.codes import code_of
from gearstab.config.document.problems import Path, nearest
from gearstab.config.document.yaml import Document
from gearstab.config.model.fields import Section
from gearstab.config.model.introspection import bare, descriptions, field_types, is_model, number_kind, type_at
from gearstab.config.model.not_modelled import not_modelled
from gearstab.config.model.reading import read, right_name

Model = TypeVar("Model", bound=BaseModel)

SIGNS = {"greater_than": ">", "greater_than_equal": ">=", "less_than": "<", "less_than_equal": "<="}
SHAPES = {
    "list_type": ("must be a list", "write [ ... ]"),
    "tuple_type": ("must be a list", "write [ ... ]"),
    "model_type": ("must be a mapping", "write keys and values below it, or { ... }"),
    "dict_type": ("must be a mapping", "write keys and values below it, or { ... }"),
    "bool_type": ("must be true or false", "write true or false, without quotes"),
    "string_type": ("must be a text", "put it in quotes"),
}


def validate(document: Document, model: type[Model], path: Path, ignore: Collection[Path] = ()) -> Model | None:
    """The section at ``path`` as its model, or None after reporting what is wrong with it.

    ignore: paths in the document whose problems are known already.
    """
    section, errors = read(model, document.get(path))
    report_errors(document, errors, model, path, ignore)
    return None if errors else section


def report_errors(
    document: Document, details: Sequence[ErrorDetails], model: Any, path: Path, ignore: Collection[Path] = ()
) -> None:
    """Report every error but those that follow from another one.

    These stand beside an option that does not exist yet, or miss a key that is there but misspelt.
    """
    extra = [d["loc"] for d in details if d["type"] == "extra_forbidden"]
    misspelt = [(*loc[:-1], right_name(str(loc[-1]), type_at(model, loc[:-1]))) for loc in extra]
    unavailable = [d["loc"] for d in details if d["type"] == "unavailable"]
    for detail in details:
        loc = detail["loc"]
        follows = (_lacks(detail) and loc in misspelt) or any(
            loc != other and loc[: len(other) - 1] == other[:-1] for other in unavailable
        )
        if (*path, *loc) not in ignore and not follows:
            _report_one(document, detail, model, path)


def explain(detail: Any) -> tuple[str, str]:
    """Message and remedy of an error that concerns a value alone."""
    kind, context = detail["type"], detail.get("ctx", {})
    if kind in SIGNS:
        bound = f"{SIGNS[kind]} {next(iter(context.values())):g}"
        return f"must be {bound}", f"choose a value {bound}"
    if kind in SHAPES:
        return SHAPES[kind]
    if kind in ("too_short", "too_long"):
        wanted = context.get("min_length", context.get("max_length"))
        return (
            f"has {context['actual_length']} entries",
            f"give {'at least' if kind == 'too_short' else 'at most'} {wanted}",
        )
    return detail["msg"], context.get("hint", "")


def _report_one(document: Document, detail: Any, model: Any, path: Path) -> None:
    loc: Path = detail["loc"]
    here = (*path, *loc)
    parent = type_at(model, loc[:-1])
    if _lacks(detail) and isinstance(loc[-1], int):
        _wrong_count(document, here[:-1], parent)
    elif _lacks(detail):
        description = descriptions(parent).get(str(loc[-1]), "")
        document.report(here, "missing", "is missing", f"add {loc[-1]}: {description.rstrip('.')}")
    elif detail["type"] == "extra_forbidden":
        key = str(loc[-1])
        if here[0] == "system" and (absent := not_modelled(key, document.get(("system", "kind")))):
            if absent[0] not in [problem.message for problem in document.problems]:
                document.report(here, "unavailable", *absent, at_key=True)
            return
        # In braces a comma begins the next entry: {start: 0,35} has the keys start and 35.
        comma = key.isdecimal() and detail["input"] is None
        hint = "write a decimal point if this follows a decimal comma" if comma else _right_key(key, parent)
        document.report(here, "unknown_key", "unknown key", hint, at_key=True)
    elif detail["type"] == "too_long" and get_origin(bare(type_at(model, loc))) is tuple:
        _wrong_count(document, here, type_at(model, loc))
    else:
        message, hint = explain(detail)
        value = detail["input"]
        kind = number_kind(type_at(model, loc))
        if detail["type"] in SIGNS and kind is not None and kind.unit == "rad" and isinstance(value, int | float):
            hint = f'write "{value:g} deg" if degrees are meant, or {hint} rad'
        document.report(
            here,
            code_of(detail["type"]),
            message,
            hint,
            value=None if isinstance(value, list | dict) and not value else value,
        )


def _lacks(detail: Any) -> bool:
    """Whether a field is missing, and not what a validator says to be so, which travels in a context."""
    return detail["type"] == "missing" and not detail.get("ctx")


def _wrong_count(document: Document, path: Path, annotation: Any) -> None:
    count = len(get_args(bare(annotation)))
    given = len(document.get(path))
    if not any(p.path == ".".join(map(str, path)) and p.code == "wrong_count" for p in document.problems):
        document.report(path, "wrong_count", f"has {given} entr{'y' if given == 1 else 'ies'}", f"give exactly {count}")


def _right_key(key: str, model: type[BaseModel]) -> str:
    if issubclass(model, Section) and key in model.misplaced:
        return model.misplaced[key]
    sections = [name for name, kind in field_types(model).items() if is_model(kind) and key in kind.model_fields]
    if len(sections) == 1:
        return f"it belongs in {sections[0]}: {{{key}: ..}}"
    return nearest(key, model.model_fields)
