"""Numbers with a unit: ``"25 mm"`` in metres. pint is imported at the first one and not before."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from functools import cache
from typing import TYPE_CHECKING, Any

from pydantic_core import PydanticCustomError

from gearstab.config.document import Code, is_number

if TYPE_CHECKING:
    import pint

NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*\Z", re.DOTALL | re.ASCII)
FRACTION = re.compile(r"\s*([-+]?\d{1,12})\s*/\s*(\d{1,12})\s*\Z", re.ASCII)
"""A ratio of two whole numbers, such as "1/3"."""
COMMAS = re.compile(r"\s*([-+]?)(\d[\d.]*|),(\d[\d.,]*)(.*)", re.DOTALL)
"""A number with a comma: sign, the parts before and behind the comma, and the rest."""
NEWTON_METRE = re.compile(r"\b([kM]?N)m\b")
"""pint reads "Nm" as number times metre."""
PER_CENT = ("%", "percent", "per cent")
ANGLES = ("radian", "degree", "turn", "grade", "arcminute", "arcsecond")
"""Names of pint's, which have prefixes before them."""
TURNING = (*ANGLES, "hertz", "revolutions_per_minute", "revolutions_per_second")

KNOWN = {("rpm", "rad/s"): math.pi / 30, ("Hz", "rad/s"): 2 * math.pi}
"""The most usual units, for which pint is not imported."""

SPEEDS = ("rad/s", "rad/s^2")
"""Units of what counts angles in time."""

MEANING = {
    "kg": "a mass",
    "kg m": "a mass times a length",
    "kg m^2": "a moment of inertia",
    "N/m": "a stiffness",
    "N/m^2": "a stiffness per width",
    "N": "a force",
    "N m": "a torque or torsional stiffness (per rad)",
    "N s/m": "a viscous damping",
    "N s": "a damping between a rotation and a translation",
    "N m s": "a torsional damping (per rad/s)",
    "rad/s": "an angular frequency",
    "rad/s^2": "a rate of change of a speed",
    "1/s": "a rate",
    "s": "a time",
    "m": "a length",
    "rad": "an angle",
    "m/s": "a velocity",
    "Pa": "a pressure",
    "Pa s": "a viscosity",
    "kg/m^3": "a density",
}
"""The SI units of the fields and what they measure."""

UnitError = PydanticCustomError
"""Error of a text that is no quantity of the kind asked for, as :func:`wrong` makes it."""


def wrong(code: Code, message: str, hint: str) -> PydanticCustomError:
    """An error whose remedy travels in its context."""
    return PydanticCustomError(code, "{message}", {"message": message, "hint": hint})


def hint_of(error: PydanticCustomError) -> str:
    """Return the remedy of an error."""
    return str((error.context or {}).get("hint", ""))


def may_be_number(value: Any) -> bool:
    """Whether a value is a number, or a text that may hold one."""
    return is_number(value) or isinstance(value, str)


@cache
def _registry() -> pint.UnitRegistry[Any]:
    import pint

    return pint.UnitRegistry()


def to_si(text: str, units: tuple[str, ...], turns: bool = False) -> float:
    """The number of a text such as ``"25 mm"`` in the first of ``units`` that fits.

    units: SI units a field accepts, none for a dimensionless one, which takes per cent. turns: whether it is a fraction
    of a turn and takes angles and "1/3" too, the double nearest to it. A frequency in Hz counts cycles: for a field in
    rad/s it is multiplied by 2 pi, as rpm are by 2 pi/60; 1/s and 1/min say neither, and are refused. Raises UnitError.
    """
    if found := COMMAS.match(text):
        raise _comma(*found.groups())
    if turns and (found := FRACTION.match(text)) and int(found[2]):
        return int(found[1]) / int(found[2])
    found = NUMBER.match(text)
    if not found:
        with_unit = f', or one with a unit such as "0.5 {units[0]}"' if units else ""
        raise wrong("not_a_number", "must be a number", f"write a number such as 0.5{with_unit}")
    if not (found[2] or units):
        raise wrong("not_a_number", "must be a number, not a text", "write it without quotes")
    value, unit = float(found[1]), found[2]
    if not unit:
        hint = f'write {found[1]} without quotes, or add a unit: "{found[1]} {units[0]}"'
        raise wrong("no_unit", "is a text without a unit", hint)
    if not units:
        return _dimensionless(value, unit, turns)
    quantity = _quantity(value, unit, f'use a unit such as "{units[0]}"')
    for wanted in units:
        if quantity.is_compatible_with(wanted) and _says_angles(quantity, wanted):
            return float(quantity.to(wanted).magnitude) * _turns(quantity, wanted)
    if any(wanted in SPEEDS and quantity.is_compatible_with(wanted) for wanted in units):
        each = "/s" if "rad/s^2" in units else ""
        hint = f'use a unit such as "rad/s{each}", "rpm{each}" or "Hz{each}"'
        raise wrong("ambiguous_unit", "does not say whether it counts radians or turns", hint)
    expected = " or ".join(f"{MEANING[u]} in {u}" for u in units)
    raise wrong("wrong_dimension", "has the wrong dimension", f"give {expected}, or another unit of it")


def typed_unit(values: Iterable[Any]) -> str:
    """The unit that texts such as ``"600 rpm"`` have in common; "" where one is a plain number or has another unit."""
    found = {match[2] if isinstance(v, str) and (match := NUMBER.match(v)) else "" for v in values}
    return found.pop() if len(found) == 1 else ""


@cache
def scale(unit: str, si: str) -> float:
    """Return how many of an SI unit one of another unit is: 2 pi/60 for rpm and rad/s."""
    return 1.0 if unit == si else KNOWN.get((unit, si)) or to_si(f"1 {unit}", (si,))


def _comma(sign: str, whole: str, fraction: str, rest: str) -> UnitError:
    """Return the error of a number with commas, of which some may separate thousands."""
    if not fraction.isdecimal() or "." in whole:
        return wrong("decimal_comma", "has commas in a number", "use a decimal point, and no separators of thousands")
    decimal = f"use a decimal point: {sign}{whole or 0}.{fraction}{rest.rstrip()}"
    if len(fraction) == 3 and whole.strip("0"):
        return wrong(
            "decimal_comma", "has a decimal comma", f"{decimal}, or {sign}{whole}{fraction} if it separates thousands"
        )
    return wrong("decimal_comma", "has a decimal comma", decimal)


def _dimensionless(value: float, unit: str, turns: bool) -> float:
    """A number in per cent or, where it is a fraction of a turn, an angle."""
    if unit in PER_CENT:
        return value / 100
    allowed = 'a plain number, "1/3", per cent, or an angle' if turns else "a plain number, or per cent"
    hint = f"write {allowed}{', of which 360 deg are 1' if turns else ''}"
    quantity = _quantity(value, unit, hint)
    if turns and quantity.is_compatible_with("rad") and _says_angles(quantity, "rad"):
        return float(quantity.to("rad").magnitude) / (2 * math.pi)
    message = "is dimensionless" + (" but for an angle" if turns else "") + f" and takes no '{unit}'"
    raise wrong("wrong_dimension", message, hint)


def _quantity(value: float, unit: str, hint: str) -> Any:
    registry = _registry()
    try:
        return registry.Quantity(value, registry.parse_units(NEWTON_METRE.sub(r"\1 m", unit)))
    except Exception:  # pint lets errors of its tokeniser and its arithmetic through
        raise wrong("unknown_unit", f"has the unknown unit '{unit}'", hint) from None


def _says_angles(quantity: Any, wanted: str) -> bool:
    """Whether a quantity in rad or rad/s counts angles; pint takes per cent for one and 1/min for the other."""
    if wanted not in ("rad", *SPEEDS):
        return True
    names = ANGLES if wanted == "rad" else TURNING
    return any(str(name).endswith(names) for name, _ in quantity.unit_items())


def _turns(quantity: Any, wanted: str) -> float:
    """2 pi for each hertz in an angular frequency: pint takes Hz for 1/s, and rad for 1."""
    if wanted not in SPEEDS:
        return 1.0
    powers = [power for name, power in quantity.unit_items() if str(name).endswith("hertz")]
    return float((2 * math.pi) ** sum(powers))
