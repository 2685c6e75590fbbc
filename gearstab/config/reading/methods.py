"""The section ``methods``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from gearstab.config.document.tree import Document, mapping, names_set
from gearstab.config.model.axes import SPEEDS, Axis

if TYPE_CHECKING:
    from gearstab.config.reading.system import SystemSections
    from gearstab.config.sections.methods import Methods
    from gearstab.config.sections.uncertain import Uncertainties
    from gearstab.methods import Method


def read_methods(document: Document) -> Methods | None:
    """The methods that a document asks for, none without the section; None after reporting problems."""
    from gearstab.config.model.conflicts import validate
    from gearstab.config.sections.methods import Methods
    from gearstab.methods import METHODS

    data = document.data
    if "methods" not in data:
        return Methods()
    section, sweep = data["methods"], data.get("sweep")
    for name, options in mapping(section).items():
        if options is None and name in Methods.model_fields:
            document.put(("methods", name), {}, document.where(("methods", name)))  # `floquet:` asks for it
    if section is None or section == {}:
        document.report(("methods",), "missing", "names no method", f"add one of {', '.join(Methods.model_fields)}")
        return None
    if isinstance(sweep, dict):
        remedy = "add mesh_frequency: {start: .., stop: .., num: ..} to sweep"
        for name, options in mapping(section).items():
            if name in METHODS and not _has_frequency(METHODS[name], options, sweep):
                document.report(("methods", name), "missing", "needs a mesh_frequency axis", remedy, at_key=True)
    return validate(document, Methods, ("methods",))


def _has_frequency(method: type[Method], options: Any, sweep: dict[str, Any]) -> bool:
    """Whether a method gets the mesh frequencies that it needs. options, sweep: their sections as written."""
    from gearstab.methods import RANGE

    own, speeds = method.sets(options), set(SPEEDS)
    if method.frequency == RANGE:
        # Its ends are those of an axis; frequencies that come with cases have none.
        return not speeds.isdisjoint(sweep)
    everywhere = set(own).union(*(names_set(*item) for item in sweep.items()))
    return method.frequency is None or not speeds.isdisjoint(everywhere)


def read_uncertainties(methods: Methods, system: SystemSections) -> tuple[Methods, Uncertainties | None]:
    """The methods with distributions in SI units, and the uncertain parameters; None without the method tolerance."""
    if methods.tolerance is None:
        return methods, None
    from gearstab.config.sections import uncertain

    found = uncertain.uncertainties(system.context, methods.tolerance, system.uncertain, system.axes)
    if found is None:
        return methods, None
    own = methods.tolerance.model_copy(update={"parameters": found[1]})
    return methods.model_copy(update={"tolerance": own}), found[0]


def complete_methods(document: Document, source: FilePath, methods: Methods, axes: Sequence[Axis]) -> Methods:
    """The methods with what files and axes add to their options; report a range of mesh frequencies that is none."""
    from gearstab.methods import METHODS

    for name in methods.chosen:
        options = getattr(methods, name)
        _check_range(document, axes, METHODS[name].over_range(options))
        own = METHODS[name].completed(options, document, source, axes)
        if own is not options:
            methods = methods.model_copy(update={name: own})
    return methods


def _check_range(document: Document, axes: Sequence[Axis], what: str) -> None:
    """One mesh frequency alone is no range, over which something happens; "": nothing does."""
    for axis in axes if what else ():
        numbers = axis.name in SPEEDS and not isinstance(axis.values, list)
        if numbers and axis.span[0] == axis.span[1]:
            path = ("sweep", axis.name)
            hint = "give two frequencies or more, or start and stop"
            document.report(path, "no_range", f"is no range, {what}", hint)
