"""The section ``respond``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pydantic_core import PydanticCustomError

from gearstab.config.document.problems import Path
from gearstab.config.document.tree import Document
from gearstab.config.model import conflicts
from gearstab.config.model.axes import SpeedAxis
from gearstab.config.model.conflicts import report_errors
from gearstab.config.model.reading import WRONG, read, told
from gearstab.config.model.units import Quantity, typed_unit
from gearstab.config.sections.dimensions import check_units
from gearstab.config.sections.targets import INPUT_SPEED, UNKNOWN_TEETH

if TYPE_CHECKING:
    from gearstab.systems.base import System
    from gearstab.systems.parts.respond import Respond
    from gearstab.systems.parts.respond_pair import PairRespond

RAMP = ("respond", "ramp")
OF_RAMP = (("to", "rad/s"), ("rate", "rad/s^2"))
"""Where a ramp is, and which of its keys are speeds and accelerations of the input where the section gives that."""


def read_respond(document: Document, model: type[System] | None, system: System | None) -> Respond | PairRespond | None:
    """Read the response that a document asks for; None without the section and after reporting problems.

    system: its section, in which values may be wrong.
    """
    if "respond" not in document.data:
        return None
    from gearstab.systems.parts.respond import Respond

    wanted: type[Respond | PairRespond] = Respond if model is None else model.respond_model()
    size, axis = None if system is None else told(system.size), SpeedAxis()
    if system is not None and wanted is Respond and isinstance(document.data["respond"], dict):
        axis = _replace_input_speed(document, document.data["respond"], told(system.cycles_of_input, 1.0))
    respond, errors = read(wanted, document.data["respond"])
    if respond is not WRONG:
        conflicts.report(document, ("respond",), respond.conflicts(system, size), respond)
    units = set() if system is None else check_units(document, system, "respond", wanted)
    report_errors(document, errors, wanted, ("respond",), units)
    return None if errors or size is None else respond.of_size(size, axis)


def _replace_input_speed(document: Document, section: dict[str, Any], cycles: float | None) -> SpeedAxis:
    """Write mesh frequencies in place of input speeds. cycles: of the first mesh in a turn of the input.

    Returns in what the section gives its speed.
    """
    value, path = section.get(INPUT_SPEED), ("respond", INPUT_SPEED)
    if value is None or section.get("mesh_frequency") is not None:
        return SpeedAxis(typed_units=typed_unit([section.get("mesh_frequency")]))
    if cycles is None:
        document.report(path, "needs_other", "the numbers of teeth are not known", UNKNOWN_TEETH, at_key=True)
        return SpeedAxis()
    ramp = section.get("ramp")
    own: list[tuple[Path, Path, str]] = [(path, ("respond", "mesh_frequency"), "rad/s")]
    if isinstance(ramp, dict):
        own += [((*RAMP, key), (*RAMP, key), unit) for key, unit in OF_RAMP if key in ramp]
    try:
        numbers = [Quantity(unit).number(document.get(given)) for given, _, unit in own]
    except PydanticCustomError:
        return SpeedAxis()  # which is reported where the section is validated
    if min(numbers) <= 0:
        return SpeedAxis()  # as that
    for (given, meant, _), number in zip(own, numbers, strict=True):
        document.put(meant, number * cycles, document.where(given))
    del section[INPUT_SPEED]
    return SpeedAxis(INPUT_SPEED, cycles, typed_unit([value]))
