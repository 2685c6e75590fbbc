"""The section ``respond``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gearstab.config.document.yaml import Document

if TYPE_CHECKING:
    from gearstab.config.reading.system import SystemSections
    from gearstab.systems.base import System
    from gearstab.systems.parts.respond import Respond
    from gearstab.systems.parts.respond_pair import PairRespond


def read_respond(
    document: Document, model: type[System] | None, system: SystemSections | None
) -> Respond | PairRespond | None:
    """The response that a document asks for; None without the section and after reporting problems."""
    if "respond" not in document.data:
        return None
    from gearstab.config.model.conflicts import as_meant, report
    from gearstab.config.model.validation import validate
    from gearstab.config.sections.dimensions import check_units
    from gearstab.systems.parts.respond import Respond

    raw, section = document.data.get("system"), document.data["respond"]
    wanted: type[Respond | PairRespond] = Respond if model is None else model.respond_model()
    known = as_meant(raw, model) or {}
    if system:
        known |= system.contents
    size = model.size(known) if model else None
    if model is not None and wanted is Respond and isinstance(section, dict):
        _replace_input_speed(document, section, model.cycles_of_input(known))
    meant = as_meant(section, wanted)
    if meant is not None:
        report(document, ("respond",), wanted.conflicts(meant, known, size), meant)
    wrong = check_units(document, model, known, "respond", wanted) if model else set()
    respond: Respond | PairRespond | None = validate(document, wanted, ("respond",), wrong)
    return None if respond is None or size is None else respond.of_size(size)


def _replace_input_speed(document: Document, section: dict[str, Any], cycles: float | None) -> None:
    """Write the mesh frequency in place of an input speed. cycles: of the first mesh in a turn of the input."""
    from pydantic_core import PydanticCustomError

    from gearstab.config.model.fields import Quantity
    from gearstab.config.sections.targets import INPUT_SPEED, UNKNOWN_TEETH

    value, path = section.get(INPUT_SPEED), ("respond", INPUT_SPEED)
    if value is None or section.get("mesh_frequency") is not None:
        return
    if cycles is None:
        document.report(path, "needs_other", "the numbers of teeth are not known", UNKNOWN_TEETH, at_key=True)
        return
    try:
        speed = Quantity("rad/s").number(value)
    except PydanticCustomError:
        return  # which is reported where the section is validated
    document.put(("respond", "mesh_frequency"), speed * cycles, document.where(path))
    del section[INPUT_SPEED]
