"""Quantities that judge a design: names, units and needs, without the computation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import Field

from gearstab.config.model.units import Quantity

NonNegative = Field(ge=0)


@dataclass(frozen=True)
class Criterion:
    """A quantity: its unit, long name, and the type of a number that limits it."""

    units: str
    long_name: str
    annotation: Any


def _named(units: str, long_name: str) -> Criterion:
    return Criterion(units, long_name, Annotated[float, NonNegative, Quantity(units)])


QUANTITIES = {
    "instability_width": _named("rad/s", "width of all instability regions within the operating range"),
    "growth_rate": _named("1/s", "largest growth rate within the operating range"),
    "required_damping": _named("1", "damping ratio of all modes from which on the operating range is stable"),
    "load_factor": _named("1", "largest dynamic load factor of the steady state within the operating range"),
    "tongue_distance": _named("rad/s", "distance from the operating range to the nearest instability region"),
    "root_stress": _named("Pa", "largest static stress at the root of a tooth (ISO 6336-3)"),
    "transmission_error": _named("m", "peak-to-peak static transmission errors of teeth with relief, summed up"),
}
"""By the name that a configuration uses."""

OBJECTIVES = tuple(name for name in QUANTITIES if name != "tongue_distance")
"""Quantities that can be minimised."""


def objective_name(weights: Mapping[str, float]) -> str:
    """Name a weighted sum: ``instability_width``, ``instability_width + 0.2 load_factor``."""
    return " + ".join(name if weight == 1 else f"{weight:g} {name}" for name, weight in weights.items())


def objective_unit(weights: Mapping[str, float]) -> str:
    """Return the unit of a weighted sum, 1 of several quantities."""
    return QUANTITIES[next(iter(weights))].units if len(weights) == 1 else "1"
