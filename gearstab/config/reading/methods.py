"""The section ``methods``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path as FilePath
from typing import TYPE_CHECKING

from gearstab.config.document.yaml import Document, value_at
from gearstab.config.model.axes import MESH_FREQUENCY, Axis

if TYPE_CHECKING:
    from gearstab.config.reading.system import SystemSections
    from gearstab.config.sections.methods import Methods
    from gearstab.config.sections.uncertain import Uncertainties


def read_methods(document: Document) -> Methods | None:
    """The methods that a document asks for, none without the section; None after reporting problems."""
    from gearstab.config.model.validation import validate
    from gearstab.config.sections.methods import Methods
    from gearstab.config.sections.sweep import sets_mesh_frequency

    data = document.data
    if "methods" not in data:
        return Methods()
    section = data["methods"]
    for name in section if isinstance(section, dict) else ():
        if section[name] is None and name in Methods.model_fields:
            document.put(("methods", name), {}, document.where(("methods", name)))  # `floquet:` asks for it
    if section is None or section == {}:
        document.report(("methods",), "missing", "names no method", f"add one of {', '.join(Methods.model_fields)}")
        return None
    sweep = data.get("sweep")
    if isinstance(section, dict) and isinstance(sweep, dict):
        remedy = "add mesh_frequency: {start: .., stop: .., num: ..} to sweep"
        for name in ("floquet", "response", "tolerance"):
            uncertain = value_at(section, ("tolerance", "parameters")) if name == "tolerance" else None
            own = uncertain if isinstance(uncertain, dict) else {}
            if name in section and not (sets_mesh_frequency(sweep) or sets_mesh_frequency(own)):
                document.report(("methods", name), "missing", "needs a mesh_frequency axis", remedy, at_key=True)
        # Boundaries are sought between the ends of an axis; frequencies that come with cases have none.
        for name in ("boundaries", "passage"):
            if name in section and not {"mesh_frequency", "input_speed"} & sweep.keys():
                document.report(("methods", name), "missing", "needs a mesh_frequency axis", remedy, at_key=True)
    return validate(document, Methods, ("methods",))


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


def read_passage(document: Document, source: FilePath, methods: Methods, axes: Sequence[Axis]) -> Methods:
    """The methods with the path that a file holds, in mesh frequencies of an axis that may be the input speed."""
    from gearstab.config.checks.sample_file import read_path
    from gearstab.config.document.files import DataFileError
    from gearstab.config.model.validation import validate
    from gearstab.config.sections.methods import Methods

    own, place = methods.passage, ("methods", "passage")
    if own.rate is not None:
        check_range(document, axes, "which is passed")
    if own.table is not None:
        try:
            knots = [list(knot) for knot in read_path(source.parent / own.table)]
        except DataFileError as error:
            document.report((*place, "table"), "file", str(error), error.hint, value=own.table)
            return methods
        where = document.where((*place, "table"))
        del document.get(place)["table"]
        document.put((*place, "path"), knots, where)
        found = validate(document, Methods, ("methods",))
        if found is None:
            return methods
        own = found.passage
    speed = next((axis for axis in axes if axis.name in ("mesh_frequency", "input_speed")), None)
    factor = 1.0 if speed is None else next((a.factor for a in speed.assignments if a.path == MESH_FREQUENCY), 1.0)
    return methods.model_copy(update={"passage": own.over(factor)})


def check_range(document: Document, axes: Sequence[Axis], what: str = "over which boundaries are sought") -> None:
    """Boundaries are sought over a range of the mesh frequency, so that one frequency alone holds none."""
    for axis in axes:
        numbers = axis.name in ("mesh_frequency", "input_speed") and not isinstance(axis.values, list)
        if numbers and axis.span[0] == axis.span[1]:
            path = ("sweep", axis.name)
            hint = "give two frequencies or more, or start and stop"
            document.report(path, "no_range", f"is no range, {what}", hint)
