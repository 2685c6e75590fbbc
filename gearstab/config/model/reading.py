"""From plain data to a section, as far as it is right: rules then look at values of the right type only.

A value that is wrong or missing is WRONG in the section. It counts as given, and whatever else a rule asks of it ends
the rule (:class:`SkipRule`): that it is wrong is reported by itself, and nothing can be said of what depends on it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, NoReturn, TypeVar, get_origin

from pydantic import BaseModel, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from gearstab.config.document.problems import Path, closest
from gearstab.config.document.yaml import value_at
from gearstab.config.model.introspection import bare, entry_type, field_types, is_model

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
