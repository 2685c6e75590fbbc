"""A configuration given as data of Python instead of a file: mappings, lists, numbers, texts and arrays."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from numbers import Integral, Real
from pathlib import PurePath
from typing import Any

import numpy as np

from gearstab.config.document.problems import ConfigError, Path
from gearstab.config.document.yaml import DEEPEST, NO_CHARACTER, Document, Where, paths_below

NAME = "configuration"
"""Name in messages, in place of a file."""


def document_of(data: Mapping[str, Any], name: str = NAME) -> Document:
    """Return the document that a file with this data would hold. Raises ConfigError for what no file can hold."""
    document = Document(name, first=None)
    document.data = plain(document, data, ())
    if document.problems:
        raise ConfigError(document.problems)
    for path in paths_below(document.data, ()):
        document.values[path] = document.keys[path] = Where(name)
    return document


def plain(document: Document, value: Any, path: Path) -> Any:
    """Return a value as nested dicts, lists, numbers, texts, booleans and None.

    Arrays (NumPy's and SciPy's sparse ones) become lists, exact fractions and paths texts. What is none of these is
    reported to the document, and None stands for it.
    """
    if len(path) > DEEPEST:
        document.report((), "nesting", "is nested too deeply", "give flatter data")
        return None
    if isinstance(value, Mapping):
        return {str(key): plain(document, item, (*path, str(key))) for key, item in value.items()}
    if np.ma.is_masked(value):
        document.report(path, "wrong_type", "has masked entries, which have no value", "fill them or leave them out")
        return None
    if hasattr(value, "toarray"):
        value = value.toarray()
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [plain(document, item, (*path, k)) for k, item in enumerate(value)]
    return _scalar(document, value, path)


def _scalar(document: Document, value: Any, path: Path) -> Any:
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, Integral):
        return int(value)
    if isinstance(value, Fraction | PurePath):
        return str(value)
    if isinstance(value, Real):
        return float(value)
    if isinstance(value, str):
        if NO_CHARACTER.search(value):
            document.report(path, "character", "holds what is no character", "remove it", value=ascii(value))
        return NO_CHARACTER.sub("", value)
    hint = "give numbers, texts, lists, mappings or arrays"
    document.report(path, "wrong_type", f"is of the type {type(value).__name__}", hint, value=str(value))
    return None
