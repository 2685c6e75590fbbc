"""A configuration as a whole."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np

from gearstab.config.document import Code, Path, Problem
from gearstab.config.document.yaml import write
from gearstab.config.model import Array, Grid

if TYPE_CHECKING:
    from gearstab.config.document import Document
    from gearstab.config.sections.design import Design
    from gearstab.config.sections.uncertain import Uncertainties
    from gearstab.systems.base import System  # noqa: F401 - named in quotes
    from gearstab.systems.respond import PairRespond, Respond


@dataclass(frozen=True)
class Config(Grid["System"]):
    """A configuration that was read and found right.

    methods, respond and design: their sections.
    tree: the whole document as run, as plain data; contents: what referenced files hold, by name.
    overrides: the ``PATH=VALUE`` texts that were applied.
    document: the document as written, which knows the place of everything.
    doubts: what is right and hardly meant, such as lengths without a unit; commands print it.
    uncertainties: what the method tolerance draws samples of.
    """

    methods: Any
    respond: Respond | PairRespond | None
    source: FilePath
    tree: dict[str, Any]
    contents: Mapping[str, Array]
    document: Document = field(repr=False, compare=False)
    overrides: tuple[str, ...] = ()
    design: Design | None = None
    doubts: tuple[Problem, ...] = field(default=(), compare=False)
    uncertainties: Uncertainties | None = None

    @property
    def title(self) -> str:
        """Heading of figures and results."""
        return str(self.tree["title"])

    @property
    def kind(self) -> str:
        """Kind of the system."""
        return str(self.tree["system"]["kind"])

    def problem(self, path: Path, code: Code, message: str, hint: str) -> Problem:
        """Report a mistake found after validation, at its line and with the value given there."""
        value = self.document.get(path)
        return self.document.problem(path, code, message, hint, value=None if isinstance(value, dict) else value)

    @cached_property
    def resolved(self) -> str:
        """The configuration as run, as YAML: overrides applied, defaults filled in, SI numbers."""
        return write(self.tree)

    @cached_property
    def digest(self) -> str:
        """SHA-256, in hexadecimal digits, over everything that numbers depend on; not over the title."""
        relevant = {key: value for key, value in self.tree.items() if key != "title"}
        relevant["system"] = without_files(self.tree["system"])
        # The order of the axes is that of the result's dimensions; the order of other keys is nothing.
        relevant["sweep"] = [[name, spec] for name, spec in self.tree.get("sweep", {}).items()]
        total = hashlib.sha256(json.dumps(relevant, sort_keys=True, allow_nan=False).encode())
        for name, values in sorted(self.contents.items()):
            data = np.ascontiguousarray(values, dtype="<f8")
            total.update(f"{name}{data.shape}".encode() + data.tobytes())
        return total.hexdigest()


def without_files(tree: Any) -> Any:
    """Plain data without the names of files, whose contents count."""
    if isinstance(tree, dict):
        return {key: without_files(value) for key, value in tree.items() if key not in ("file", "files")}
    return [without_files(item) for item in tree] if isinstance(tree, list) else tree
