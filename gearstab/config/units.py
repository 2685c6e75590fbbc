"""Numbers with a unit: ``"25 mm"`` in metres. pint is imported at the first one and not before."""

from __future__ import annotations

import math
import re
from functools import cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pint

NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*\Z", re.DOTALL)
NEWTON_METRE = re.compile(r"\b([kM]?N)m\b")
"""pint reads "Nm" as number times metre."""

MEANING = {
    "kg": "a mass",
    "kg m": "a mass times a length",
    "kg m^2": "a moment of inertia",
    "N/m": "a stiffness",
    "N": "a stiffness between a rotation and a translation",
    "N m": "a torsional stiffness (per rad)",
    "N s/m": "a viscous damping",
    "N s": "a damping between a rotation and a translation",
    "N m s": "a torsional damping (per rad/s)",
    "rad/s": "an angular frequency",
    "1/s": "a rate",
    "s": "a time",
    "m": "a length",
    "rad": "an angle",
    "m/s": "a velocity",
}
"""The SI units of the fields and what they measure."""


class UnitError(ValueError):
    """A text is no quantity of the wanted kind; ``hint`` says what would be."""

    def __init__(self, message: str, hint: str) -> None:
        super().__init__(message)
        self.hint = hint


@cache
def _registry() -> pint.UnitRegistry[Any]:
    import pint

    return pint.UnitRegistry()


def to_si(text: str, units: tuple[str, ...]) -> float:
    """The number of a text such as ``"25 mm"`` in the first of ``units`` that fits.

    units: SI units a field accepts, none for a dimensionless one. A frequency in Hz counts cycles: for a field in rad/s
    it is multiplied by 2 pi, as rpm are by 2 pi/60. Raises UnitError.
    """
    found = NUMBER.match(text)
    if not found:
        with_unit = f', or one with a unit such as "0.5 {units[0]}"' if units else ""
        raise UnitError("must be a number", f"write a number such as 0.5{with_unit}")
    if not (found[2] or units):
        raise UnitError("must be a number, not a text", "write it without quotes")
    value, unit = float(found[1]), found[2]
    if not unit:
        raise UnitError(
            "is a text without a unit", f'write {found[1]} without quotes, or add a unit: "{found[1]} {units[0]}"'
        )
    if not units:
        raise UnitError("is dimensionless and takes no unit", f"write {found[1]}")
    quantity = _quantity(value, unit, units)
    for wanted in units:
        if quantity.is_compatible_with(wanted):
            return float(quantity.to(wanted).magnitude) * _turns(quantity, wanted)
    expected = " or ".join(f"{MEANING[u]} in {u}" for u in units)
    raise UnitError("has the wrong dimension", f"give {expected}, or another unit of it")


def _quantity(value: float, unit: str, units: tuple[str, ...]) -> Any:
    registry = _registry()
    try:
        return registry.Quantity(value, registry.parse_units(NEWTON_METRE.sub(r"\1 m", unit)))
    except Exception:  # pint lets errors of its tokeniser and its arithmetic through
        raise UnitError(f"has the unknown unit '{unit}'", f'use a unit such as "{units[0]}"') from None


def _turns(quantity: Any, wanted: str) -> float:
    """2 pi for each hertz in an angular frequency: pint takes Hz for 1/s, and rad for 1."""
    if wanted != "rad/s":
        return 1.0
    powers = [power for name, power in quantity.unit_items() if str(name).endswith("hertz")]
    return float((2 * math.pi) ** sum(powers))
