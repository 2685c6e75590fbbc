"""Vectors over the coordinates of a model, written as mappings ``{coordinate: value}`` of what is not zero."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from gearstab.config.document.problems import Path, nearest
from gearstab.config.document.tree import Document, sequence, value_at

SECTIONS = {"meshes": ("direction",), "forces": ("direction",), "terms": ("left", "right")}
"""Lists of the section ``system`` and the vectors of their entries; ``load`` is one by itself."""


def write_out(document: Document, raw: dict[str, Any], size: int | None) -> None:
    """Replace every such mapping by the list of its entries, zero where it names none; report unknown coordinates.

    size: number of coordinates. If it is unknown, which is reported elsewhere, the entries stand for all.
    """
    named: Any = raw.get("coordinates")
    known = named if len(sequence(named)) == size else default_names(size or 0)
    for holder, key, path in list(_mappings(raw)):
        given = holder[key]
        names = known if size is not None else list(given)
        values: list[Any] = [0.0] * len(names)
        for name, value in given.items():
            if name in names:
                values[names.index(name)] = value
                document.move(("system", *path, name), ("system", *path, names.index(name)))
            else:
                message = "there is no such coordinate"
                hint = nearest(name, map(str, names))
                document.report(("system", *path, name), "unknown_name", message, hint, at_key=True)
        holder[key] = values


def default_names(size: int) -> list[str]:
    """Return the names of coordinates that are given none: q1, q2, ..."""
    return [f"q{i + 1}" for i in range(size)]


def _mappings(raw: dict[str, Any]) -> Iterator[tuple[dict[str, Any], str, Path]]:
    """Yield the section that holds each vector written so, its key there, and its path below ``system``."""
    if isinstance(raw.get("load"), dict):
        yield raw, "load", ("load",)
    for section, keys in SECTIONS.items():
        for i, item in enumerate(sequence(raw.get(section))):
            for key in keys:
                if isinstance(value_at(item, (key,)), dict):
                    yield item, key, (section, i, key)
