"""Sections and the values of their fields, as pydantic reads and describes them: quantities, ratios, counts, words."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Annotated, Any, ClassVar, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    StrictBool,
    WithJsonSchema,
)
from pydantic_core import core_schema

from gearstab.config.document import is_number, nearest
from gearstab.config.model.units import PER_CENT, UnitError, hint_of, may_be_number, to_si, wrong

LARGEST_NUMBER, SMALLEST_NUMBER = 1e30, 1e-30
"""Largest number, and least one that has a unit and is not zero. No gear is near them, whatever the system of units,
and products of ten numbers stay within double precision."""
LARGEST_DENOMINATOR = 1000
"""A decimal number is taken for an exact ratio up to this denominator: 0.6 is 3/5, but 0.6667 is hardly 6667/10000."""

LARGEST_RATIO = 10**4
"""Largest ratio of frequencies or tooth numbers; no train has one beyond it, nor beyond its inverse."""
LARGEST_TERM = 10**9
"""Largest term of an exact ratio; the common period of the meshes holds as many cycles."""


FEWEST_TEETH = 3


@dataclass(frozen=True)
class Quantity:
    """A finite number; where it is dimensional also a text with a unit, converted to SI, else one with per cent.

    unit: the SI unit, "1" for a dimensionless number. others: further units that it has in other coordinates.
    turns: whether it is a fraction of a turn, which may be given as an angle or as a text such as "1/3".
    entry: whether it is one of many, which may be no more than the rounding error of another program.
    advice: what to give instead of a quantity of the wrong dimension.
    """

    unit: str = "1"
    others: tuple[str, ...] = ()
    turns: bool = False
    entry: bool = False
    advice: str = ""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.no_info_before_validator_function(self.number, handler(source))

    def __get_pydantic_json_schema__(self, schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        start = r"^\s*[-+]?[0-9.]"
        pattern = start if self.units or self.turns else rf"{start}.*({'|'.join(PER_CENT)})\s*$"
        example = '90 deg" or "1/3' if self.turns else "5 %" if self.unit == "1" else f"2 {self.unit}"
        text = {"type": "string", "pattern": pattern, "description": f'a number and a unit, such as "{example}"'}
        return {"anyOf": [handler(schema), text]}

    @property
    def units(self) -> tuple[str, ...]:
        """All units it may have, none for a dimensionless number."""
        return () if self.unit == "1" else (self.unit, *self.others)

    def number(self, value: Any) -> float:
        """The value as a finite float in SI units; raises a pydantic error."""
        if not may_be_number(value):
            article = "is empty" if value is None else "must be a number"
            remedy = f"write a number in {self.unit}" if self.units else "write a number"
            raise wrong("empty" if value is None else "not_a_number", article, remedy)
        try:
            result = to_si(value, self.units, self.turns) if isinstance(value, str) else float(value)
        except UnitError as error:
            if not (self.advice and error.type == "wrong_dimension"):
                raise
            raise wrong("wrong_dimension", error.message(), f"{hint_of(error)}; {self.advice}") from None
        except OverflowError:
            result = math.inf
        if not math.isfinite(result):
            raise wrong("not_finite", "must be a finite number", "write a number")
        if abs(result) > LARGEST_NUMBER:
            raise wrong("out_of_range", "is larger than of any gear", f"stay below {LARGEST_NUMBER:g}")
        if 0 < abs(result) < SMALLEST_NUMBER and self.unit not in ("1", "rad") and not self.entry:
            raise wrong("out_of_range", "is smaller than of any gear", f"stay above {SMALLEST_NUMBER:g}")
        return result


def _no_comma(value: Any) -> None:
    """Raises a pydantic error for a text with a decimal comma."""
    if isinstance(value, str) and "," in value:
        to_si(value, ())


def _usual_ratio(ratio: Fraction | float) -> None:
    """Raises a pydantic error for a ratio that no train has."""
    if not 1 / LARGEST_RATIO <= ratio <= LARGEST_RATIO:
        limits = f"{1 / LARGEST_RATIO:g} and {LARGEST_RATIO:g}"
        raise wrong("out_of_range", f"must lie between {limits}", "write a ratio of frequencies or tooth numbers")


@dataclass(frozen=True)
class Ratio:
    """A positive ratio of tooth numbers or frequencies, kept exact: 1, 0.6 or "3/5".

    signed: whether it may be negative, for the other sense of a rotation, or 0, for none.
    exact: false for one that stands for an irrational number, a float.
    sibling: the flag before it in the section that says which of the two it is.
    """

    unit: ClassVar[str] = "1"
    counted: ClassVar[bool] = False
    """Whether it is a number of things, which follow each other one by one."""

    exact: bool = True
    sibling: str = ""
    signed: bool = False

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.with_info_plain_validator_function(
            self.number, serialization=core_schema.to_string_ser_schema()
        )

    def number(self, value: Any, info: core_schema.ValidationInfo) -> Fraction | float:
        """The ratio, of the kind that the section asks for; raises a pydantic error."""
        exact = (info.data or {}).get(self.sibling, True) if self.sibling else self.exact
        return self.fraction(value) if exact else self.decimal(value)

    @staticmethod
    def decimal(value: Any) -> float:
        """The ratio as a float; raises a pydantic error."""
        remedy = "write a decimal such as 1.4142135623730951"
        _no_comma(value)
        try:
            # The resolved configuration holds it as a text, as it does exact ratios.
            number = float(value) if may_be_number(value) else math.nan
        except (ValueError, OverflowError):
            number = math.nan
        if not math.isfinite(number):
            raise wrong("not_a_number", "must be a number", remedy)
        if number <= 0:
            raise wrong("out_of_range", "must be > 0", remedy)
        _usual_ratio(number)
        return number

    def __get_pydantic_json_schema__(self, schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        positive: dict[str, Any] = {} if self.signed else {"exclusiveMinimum": 0}
        start, digits = r"^\s*-?" if self.signed else r"^\s*", r"[0-9]+(\.[0-9]+)?(e[-+]?[0-9]+)?\s*(/\s*[0-9]+\s*)?$"
        return {"anyOf": [{"type": "number"} | positive, {"type": "string", "pattern": start + digits}]}

    def fraction(self, value: Any) -> Fraction:
        """The exact ratio; raises a pydantic error."""
        remedy = 'write an integer, a short decimal such as 0.6 or a fraction in quotes such as "3/5"'
        if isinstance(value, Fraction):
            return value
        _no_comma(value)
        if not may_be_number(value):
            raise wrong("not_a_number", "must be a ratio", remedy)
        if isinstance(value, str):
            found = re.fullmatch(r"\s*(-?\d{1,12}(?:\.\d{1,12})?)\s*(?:/\s*(\d{1,12})\s*)?", value)
            if not found or (found[2] and ("." in found[1] or int(found[2]) == 0)):
                raise wrong("not_a_number", "must be a ratio of two integers", remedy)
            ratio = Fraction(int(found[1]), int(found[2])) if found[2] else Fraction(found[1])
        elif isinstance(value, int) or math.isfinite(value):
            ratio = Fraction(value if isinstance(value, int) else repr(value))
        else:
            raise wrong("not_finite", "must be a finite ratio", remedy)
        if not self.signed and ratio <= 0:
            raise wrong("out_of_range", "must be > 0", remedy)
        otherwise = f", or {self.sibling}: false if it stands for an irrational number" if self.sibling else ""
        if ratio:
            _usual_ratio(abs(ratio))
        if max(abs(ratio.numerator), ratio.denominator) > LARGEST_TERM:
            raise wrong("out_of_range", "has too many digits", f"write a ratio of tooth numbers{otherwise}")
        if ratio.denominator > LARGEST_DENOMINATOR and "/" not in str(value):
            near = ratio.limit_denominator(100)
            remedy = f'write a fraction such as "{near}"{otherwise}'
            raise wrong("not_exact", "is no short decimal, and the ratio must be exact", remedy)
        return ratio


@dataclass(frozen=True)
class Count(Ratio):
    """A number of teeth: a whole number that an axis may set, and exact, because ratios follow from it.

    of: what is counted.
    """

    counted: ClassVar[bool] = True

    of: str = "teeth"

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(
            self.fraction, serialization=core_schema.plain_serializer_function_ser_schema(int)
        )

    def __get_pydantic_json_schema__(self, schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {"type": "integer", "minimum": FEWEST_TEETH}

    def fraction(self, value: Any) -> Fraction:
        """The whole number; raises a pydantic error."""
        if not is_number(value) or not FEWEST_TEETH <= value <= LARGEST_TERM or value % 1:
            raise wrong("not_whole", f"must be a whole number >= {FEWEST_TEETH}", f"write a number of {self.of}")
        return Fraction(int(value))


@dataclass(frozen=True)
class Choice:
    """One of the words that this version knows; ``planned`` are known ones of which it has nothing yet.

    axis: whether a sweep may set it: where all other keys mean the same under each of the words.
    """

    what: str
    available: tuple[str | int, ...]
    planned: tuple[str | int, ...] = ()
    axis: bool = False

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(self.choose)

    def __get_pydantic_json_schema__(self, schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        return {"enum": list(self.available)}

    def choose(self, value: Any) -> str | int:
        """The value itself if it is available; raises a pydantic error."""
        if type(value) in (str, int) and value in self.available:
            return value
        names = ", ".join(map(str, self.available))
        if type(value) in (str, int) and value in self.planned:
            raise wrong("unavailable", f"{self.what} '{value}' is not available in this version", f"available: {names}")
        hint = nearest(str(value), map(str, self.available)) if isinstance(value, str) else f"available: {names}"
        hint = hint if hint.endswith(names) else f"{hint} (available: {names})"
        raise wrong("unknown_choice", f"is no {self.what}", hint)


def whole(value: Any) -> Any:
    """Return a whole number: ``1e3`` is 1000; a truth value, a text or 2.5 is no count."""
    if isinstance(value, float) and value.is_integer():
        return int(value)
    if type(value) is not int:
        raise wrong("not_whole", "must be a whole number", "write a number without a decimal point")
    return value


def name(value: str) -> str:
    """Return a name that can stand in a path."""
    if not value.strip() or value.isdigit() or re.search(r"[./\\\x00-\x1f]", value):
        raise wrong("bad_name", "cannot be used in a path", "choose a name with a letter and without '.', '/' and '\\'")
    return value


class Section(BaseModel):
    """A mapping of a configuration: it has no unknown keys and does not change."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)

    misplaced: ClassVar[dict[str, str]] = {}
    """Unknown keys that stand elsewhere, and the remedy for each."""

    def __getitem__(self, name: str) -> Any:
        """Return a field by its name, as paths do; raises KeyError for what is none."""
        try:
            return getattr(self, name)
        except AttributeError:
            raise KeyError(name) from None

    def knowing(self, **found: Any) -> Self:
        """Return the same with what other sections and files say of it, as private attributes of these names."""
        other = self.model_copy()
        for name, value in found.items():
            setattr(other, f"_{name}", value)
        return other


@dataclass(frozen=True)
class ShortName:
    """Marks a number of a mesh whose name alone stands for it in ``sweep`` and ``--set``, of every mesh that has one.

    but_first: of every mesh but the first, against which it counts. rival: the key that a mesh may give in its place.
    hint: what to do where no mesh has it.
    """

    but_first: bool = False
    rival: str = ""
    hint: str = ""


class ByCoordinate:
    """Marks a vector over the coordinates, which may be written as a mapping ``{coordinate: value}`` instead."""

    def __get_pydantic_json_schema__(self, schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        plain = handler(schema)
        return {"anyOf": [plain, {"type": "object", "additionalProperties": plain["items"], "minProperties": 1}]}


def optional(title: str, **more: Any) -> Any:
    """Return a field that may be left out, with a title other than its name."""
    return Field(default=None, title=title, **more)


def also(form: dict[str, Any]) -> Callable[[dict[str, Any]], None]:
    """Return what lets the schema of a field admit a further form, which ``complete`` of a system writes out."""

    def extend(schema: dict[str, Any]) -> None:
        schema["anyOf"] = [*schema["anyOf"], form]

    return extend


Whole = BeforeValidator(whole)


def closed(properties: dict[str, Any], **more: Any) -> dict[str, Any]:
    """Return the schema of a mapping that has no other keys. more: keywords of the schema."""
    return {"type": "object", "additionalProperties": False, "properties": properties} | more


NUMBER = {"type": ["number", "string"]}
"""Schema of a number, or a text with its unit, or an exact ratio; which of them the parameter decides."""
PAIR = {"type": "array", "minItems": 2, "maxItems": 2, "items": NUMBER}
"""Schema of two numbers."""
AnyNumber = Annotated[Any, WithJsonSchema(NUMBER)]
Flag = StrictBool
NameText = Annotated[str, AfterValidator(name)]
"""The name of a mesh or coordinate, usable in dotted paths."""
Positive = Annotated[float, Field(gt=0), Quantity()]
NonNegative = Annotated[float, Field(ge=0), Quantity()]
Number = Annotated[float, Quantity()]
Vector = Annotated[list[Number], Field(min_length=1), ByCoordinate()]
"""Plain numbers, one per coordinate."""
Turns = Annotated[float, Quantity(turns=True)]
"""A fraction of a period: a phase, a lag, a phasing."""
AngularFrequency = Annotated[float, Field(gt=0), Quantity("rad/s")]
Time = Annotated[float, Field(gt=0), Quantity("s")]
Inertia = Annotated[float, Field(gt=0), Quantity("kg m^2")]
Length = Annotated[float, Field(gt=0), Quantity("m")]
NonNegativeLength = Annotated[float, Field(ge=0), Quantity("m")]
Stiffness = Annotated[float, Field(gt=0), Quantity("N/m")]
TorsionalStiffness = Annotated[float, Field(gt=0), Quantity("N m")]
Mass = Annotated[float, Field(gt=0), Quantity("kg")]
ContactRatio = Annotated[float, Field(ge=1, le=1000), Quantity()]
ExactRatio = Annotated[Fraction, Ratio()]
AnyRatio = Annotated[Fraction | float, Ratio(sibling="exact")]
"""Exact unless the flag ``exact`` before it says that it is not."""
ToothCount = Annotated[Fraction, Count()]
Teeth = Annotated[int, Field(ge=1, le=100_000), Whole]
"""A number of teeth that no axis sets."""
