"""From plain data to a section as far as it is right, and the types of its fields.

A value that is wrong or missing is WRONG in the section. It counts as given, and whatever else a rule asks of it ends
the rule (:class:`SkipRule`): that it is wrong is reported by itself, and nothing can be said of what depends on it.
"""

from __future__ import annotations

import ast
import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache
from itertools import pairwise
from textwrap import dedent
from types import NoneType, UnionType
from typing import Annotated, Any, NoReturn, TypeVar, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from gearstab.config.document import Path, closest, value_at
from gearstab.config.model.fields import Choice, Quantity, Ratio, ShortName

Mark = TypeVar("Mark")


@cache
def field_types(model: type[BaseModel]) -> Mapping[str, Any]:
    """Field name -> its annotation, with units and constraints, without "or None"."""
    hints = get_type_hints(model, include_extras=True)
    return {name: without_none(hints[name]) for name in model.model_fields}


def without_none(annotation: Any) -> Any:
    """``X`` of ``X | None``."""
    if get_origin(annotation) in (Union, UnionType):
        return next(a for a in get_args(annotation) if a is not NoneType)
    return annotation


def bare(annotation: Any) -> Any:
    """``X`` of ``Annotated[X, ...]``."""
    return get_args(annotation)[0] if get_origin(annotation) is Annotated else annotation


def is_model(annotation: Any) -> bool:
    """Whether a field holds a mapping with a model of its own."""
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def entry_type(annotation: Any, index: int) -> Any:
    """The annotation of an entry of a list or tuple; None where there is none."""
    kind, entries = get_origin(bare(annotation)), get_args(bare(annotation))
    if kind is list:
        return entries[0]
    if kind is tuple and index < len(entries):
        return entries[index]
    return None


def _marked(annotation: Any, kind: type[Mark]) -> Mark | None:
    """Return what marks a field, of a kind of marks; None for other fields."""
    marks = get_args(annotation)[1:] if get_origin(annotation) is Annotated else ()
    return next((mark for mark in marks if isinstance(mark, kind)), None)


def quantity(annotation: Any) -> Quantity | None:
    """Return the unit and kind of a number that is no exact ratio, None for other fields."""
    return _marked(annotation, Quantity)


def ratio(annotation: Any) -> Ratio | None:
    """Return the kind of a ratio or count, None for other fields."""
    return _marked(annotation, Ratio)


def number_kind(annotation: Any) -> Quantity | Ratio | None:
    """Return the kind of number that a field is, None for other fields."""
    return quantity(annotation) or ratio(annotation)


def short_name(annotation: Any) -> ShortName | None:
    """Return the short name that marks a field, None for other fields."""
    return _marked(annotation, ShortName)


def axis_choice(annotation: Any) -> Choice | None:
    """The words that an axis can give a field, None for other fields."""
    choice = _marked(annotation, Choice)
    return choice if choice is not None and choice.axis else None


def inner_type(annotation: Any, part: str | int) -> Any:
    """The annotation one key or index further down; None where the model has no such thing."""
    if is_model(annotation):
        return field_types(annotation).get(str(part))
    if get_origin(bare(annotation)) is dict:
        return get_args(bare(annotation))[1]
    return entry_type(annotation, part) if isinstance(part, int) else None


def type_at(model: type[BaseModel], path: Path) -> Any:
    """The annotation at a path below a model; None where the model has no such thing."""
    annotation: Any = model
    for part in path:
        annotation = inner_type(annotation, part) if annotation is not None else None
    return annotation


@cache
def descriptions(model: type[BaseModel]) -> dict[str, str]:
    """Return what the fields of a section mean: the docstrings that follow them, or descriptions given otherwise.

    Sources are parsed when they are asked for, which is for messages and the schema only.
    """
    found: dict[str, str] = {}
    for part in reversed(model.__mro__):
        try:
            own = issubclass(part, BaseModel) and part is not BaseModel
            source = inspect.getsource(part) if own else ""
        except OSError:  # made without a source, as sections of all methods are
            continue
        for definition in ast.parse(dedent(source)).body:
            for field, text in pairwise(getattr(definition, "body", ())):
                said = text.value if isinstance(text, ast.Expr) else None
                if isinstance(field, ast.AnnAssign) and isinstance(said, ast.Constant):
                    found[ast.unparse(field.target)] = " ".join(str(said.value).split())
    described = {name: field.description for name, field in model.model_fields.items() if field.description}
    return {name: text for name, text in (found | described).items() if name in model.model_fields}


def title_of(model: type[BaseModel], name: str) -> str:
    """Return the title of a field: its name, unless it has another one."""
    return model.model_fields[name].title or name.replace("_", " ")


def held(section: Any) -> dict[str, Any]:
    """Return what a section holds, by name, without fields that are not given; nothing of None."""
    return {} if section is None else {key: value for key, value in dict(section).items() if value is not None}


def constructed(annotation: Any, value: Any) -> Any:
    """Return nested plain data as what an annotation declares: sections, lists of them, values taken as they are."""
    if is_model(annotation) and isinstance(value, Mapping):
        known = field_types(annotation)
        return annotation.model_construct(**{key: constructed(known.get(key), item) for key, item in value.items()})
    if isinstance(value, list | tuple):
        return [constructed(entry_type(annotation, i), item) for i, item in enumerate(value)]
    return value


Model = TypeVar("Model", bound=BaseModel)
Item = TypeVar("Item")
Other = TypeVar("Other")


class SkipRule(AttributeError, LookupError):
    """Raised by whatever asks for a value that is wrong."""


class _Wrong:
    def _skip(self, *_: Any) -> NoReturn:
        raise SkipRule

    __getattr__ = __getitem__ = __call__ = __bool__ = __len__ = __iter__ = __contains__ = _skip
    __eq__ = __ne__ = __lt__ = __le__ = __gt__ = __ge__ = __hash__ = __float__ = __int__ = __str__ = _skip
    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = __neg__ = _skip


WRONG: Any = _Wrong()


def known(values: Iterable[Item]) -> Iterator[Item]:
    """Yield values up to the first one that depends on a wrong value."""
    try:
        yield from values
    except SkipRule:
        return


def told(ask: Callable[[], Item], otherwise: Other | None = None) -> Item | Other | None:
    """Return an answer, or ``otherwise`` where it depends on a wrong value."""
    return next(known(ask() for _ in range(1)), otherwise)


def is_known(section: Any, path: Path) -> bool:
    """Return whether nothing on the way to a path is wrong."""
    return all(value_at(section, path[:k]) is not WRONG for k in range(len(path) + 1))


def read(model: type[Model], data: Any) -> tuple[Model, list[ErrorDetails]]:
    """Return plain data as a section, with WRONG for what it cannot be, and the errors."""
    try:
        return model.model_validate(data), []
    except ValidationError as error:
        return as_far_as_right(model, data), error.errors(include_url=False)


def right_name(key: str, model: Any) -> str | None:
    """Return the key that an unknown one was meant to be, None where none is like it."""
    if not is_model(model) or key in getattr(model, "misplaced", ()):
        return None
    return closest(key, model.model_fields)


def as_far_as_right(annotation: Any, value: Any) -> Any:
    """Return what an annotation makes of a value, part by part, with WRONG for what it cannot be."""
    if is_model(annotation):
        return _section(annotation, value) if isinstance(value, dict) else WRONG
    if annotation is None or value is None:
        return WRONG
    try:
        return _adapter(annotation).validate_python(value)
    except ValidationError:
        if get_origin(bare(annotation)) in (list, tuple) and isinstance(value, list):
            return [as_far_as_right(entry_type(annotation, i), item) for i, item in enumerate(value)]
        return WRONG


def _section(model: type[Model], given: dict[str, Any]) -> Model:
    """Return a section with misspelt keys as what they were meant to be."""
    types = field_types(model)
    right = {key: key if key in types else right_name(key, model) for key in given}
    names = {key: key if name is None or (name != key and name in given) else name for key, name in right.items()}
    fields = {name: WRONG for name, field in model.model_fields.items() if field.is_required()}
    for key, name in names.items():
        if name in types:
            absent = given[key] is None and model.model_fields[name].get_default() is None
            fields[name] = None if absent else as_far_as_right(types[name], given[key])
    # Names of unknown keys stay among those that are set: they may stand for what seems to be missing.
    return model.model_construct(_fields_set={names[key] for key in given if given[key] is not None}, **fields)


_ADAPTERS: dict[int, tuple[Any, TypeAdapter[Any]]] = {}


def _adapter(annotation: Any) -> TypeAdapter[Any]:
    """Return the adapter of an annotation, many of which have no hash."""
    if id(annotation) not in _ADAPTERS:
        _ADAPTERS[id(annotation)] = (annotation, TypeAdapter(annotation))
    return _ADAPTERS[id(annotation)][1]
