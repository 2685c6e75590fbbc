"""Tables whose entries are imported when they are first used."""

from __future__ import annotations

from collections.abc import Iterator, MutableMapping
from importlib import import_module
from typing import Generic, TypeVar

T = TypeVar("T")


class LazyTable(MutableMapping[str, T], Generic[T]):
    """A table of names and what they stand for, given as ``module:attribute`` and imported when it is asked for.

    The names are known without any import.
    """

    def __init__(self, places: dict[str, str]) -> None:
        self._places: dict[str, str | T] = dict(places)

    def __getitem__(self, name: str) -> T:
        found = self._places[name]
        if isinstance(found, str):
            module, _, attribute = found.partition(":")
            found = getattr(import_module(module), attribute)
            self._places[name] = found
        return found

    def __setitem__(self, name: str, value: T) -> None:
        self._places[name] = value

    def __delitem__(self, name: str) -> None:
        del self._places[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    def __len__(self) -> int:
        return len(self._places)

    def __contains__(self, name: object) -> bool:
        return name in self._places
