"""The kinds of values that the models of a configuration are made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Annotated, Any, ClassVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    StrictBool,
    WithJsonSchema,
)

from gearstab.config.model.values import Count, Quantity, Ratio, name, whole


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
