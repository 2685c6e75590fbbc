"""The section ``methods``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from pydantic import Field, create_model

from gearstab.config.configuration import Config
from gearstab.config.document.problems import ConfigError
from gearstab.config.document.tree import Document, mapping, names_set
from gearstab.config.model.axes import SPEEDS
from gearstab.config.model.conflicts import report_errors
from gearstab.config.model.fields import Section
from gearstab.config.model.reading import read
from gearstab.config.system import SystemSections
from gearstab.methods import METHODS, POINTS, RANGE, OptionError, chosen
from gearstab.system import GearSystem

if TYPE_CHECKING:
    from gearstab.config.sections.uncertain import Uncertainties


class _Chosen(Section):
    """Methods computed at every point of the grid; a method that is not named is not run."""

    @property
    def chosen(self) -> tuple[str, ...]:
        """Names of the methods to run."""
        return tuple(name for name in METHODS if getattr(self, name) is not None)


FIELDS: dict[str, Any] = {
    name: (method.Options | None, Field(default=None, title=name.replace("_", " "), description=method.Options.__doc__))
    for name, method in METHODS.items()
}
Methods: Any = create_model("Methods", __base__=_Chosen, __doc__=_Chosen.__doc__, **FIELDS)
"""A section with the options of each method, in the order of the table."""


def read_methods(
    document: Document, source: FilePath, system: SystemSections | None
) -> tuple[Methods, Uncertainties | None] | None:
    """Read the methods that a document asks for, with what files, axes and units add to their options.

    Returns them, none without the section, and the uncertain parameters; None after reporting what is wrong with them,
    and where something is wrong with the system. Methods that do not fit it, and a range of mesh frequencies that is
    none, are reported.
    """
    section, sweep = document.data.get("methods"), document.data.get("sweep")
    if "methods" in document.data and section in (None, {}):
        document.report(("methods",), "missing", "names no method", f"add one of {', '.join(Methods.model_fields)}")
        return None
    known = {name: options for name, options in mapping(section).items() if name in METHODS}
    for name in [name for name, options in known.items() if options is None]:
        document.put(("methods", name), {}, document.where(("methods", name)))  # `floquet:` asks for it
    for name in _without_frequency(known, sweep) if isinstance(sweep, dict) else ():
        remedy = "add mesh_frequency: {start: .., stop: .., num: ..} to sweep"
        document.report(("methods", name), "missing", "needs a mesh_frequency axis", remedy, at_key=True)
    methods, errors = read(Methods, document.data.get("methods", {}))
    report_errors(document, errors, Methods, ("methods",))
    if errors or system is None or not system.plain:
        return None
    uncertainties = None
    if methods.tolerance is not None:
        from gearstab.config.sections import uncertain

        tolerance: Any = methods.tolerance
        uncertainties, own = uncertain.uncertainties(system.context, tolerance, system.uncertain, system.axes)
        methods = methods.model_copy(update={"tolerance": tolerance.model_copy(update={"parameters": own})})
    options = {name: getattr(methods, name) for name in methods.chosen}
    ranges = [what for name in options if (what := METHODS[name].over_range(options[name]))]
    full = {name: METHODS[name].completed(own, document, source, system.axes) for name, own in options.items()}
    for axis in system.axes if ranges else ():
        if axis.name in SPEEDS and not isinstance(axis.values, list) and axis.span[0] == axis.span[1]:
            for what in ranges:
                hint = "give two frequencies or more, or start and stop"
                document.report(("sweep", axis.name), "no_range", f"is no range, {what}", hint)
    for path, code, message, hint in system.section.unfit(system.axes, methods.chosen):
        document.report(("methods", *path), code, message, hint, at_key=True)
    return methods.model_copy(update=full), uncertainties


def _without_frequency(sections: Mapping[str, Any], sweep: dict[str, Any]) -> Iterator[str]:
    """Yield the methods that need mesh frequencies and get none. sections, sweep: as written."""
    set_by = {name: set(METHODS[name].sets(options)) for name, options in sections.items()}
    axes = {target for item in sweep.items() for target in names_set(*item)}
    for name, own in set_by.items():
        # The ends of a range are those of an axis; frequencies that come with cases have none.
        names = set(sweep) if METHODS[name].frequency == RANGE else axes | own
        if METHODS[name].frequency is not None and names.isdisjoint(SPEEDS):
            yield name


def check_options(config: Config, base: GearSystem) -> None:
    """Raise ConfigError where the options of methods do not fit the base system, with one problem a method."""
    found = []
    for method in chosen(config.methods, base):
        try:
            method.check()
            # Of others the section itself has been asked; this one needs a speed for this system only.
            asked = METHODS[method.name].frequency == POINTS
            if method.frequency == POINTS and not asked and all(a.mesh_frequency is None for a in config.axes):
                message = "needs a mesh_frequency axis: speeds of rotation follow it"
                raise OptionError((), message, "add mesh_frequency: {start: .., stop: .., num: ..} to sweep")
        except OptionError as error:
            found.append(config.problem(("methods", method.name, *error.path), "option", str(error), error.remedy))
    if found:
        raise ConfigError(found)
