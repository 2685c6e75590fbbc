"""The methods that a sweep can run: one file each, one line in the table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from gearstab.results.variables import OCCURRENCE, TONGUE
from gearstab.sweep.methods import boundaries, floquet, perturbation, required_damping, response
from gearstab.sweep.methods.base import POINTS, RANGE, Key, Method, Outcome

METHODS: dict[str, Method] = {
    "perturbation": perturbation.METHOD,
    "uncoupled": perturbation.UNCOUPLED,
    "floquet": floquet.METHOD,
    "required_damping": required_damping.METHOD,
    "boundaries": boundaries.METHOD,
    "response": response.METHOD,
}
"""By name, in the order in which they run: the cheap ones first."""


def chosen(methods: Any) -> list[tuple[Method, Any]]:
    """The methods that a configuration asks for, with their options."""
    asked = [(method, getattr(methods, name, None)) for name, method in METHODS.items()]
    return [(method, options) for method, options in asked if options is not None]


def tongue_coordinates(index: Sequence[Key]) -> dict[str, list[Any]]:
    """The coordinates of the dimension ``tongue``."""
    found = {variable.name: [getattr(tongue, variable.name) for tongue, _ in index] for variable in TONGUE}
    return found | {OCCURRENCE.name: [occurrence for _, occurrence in index]}


__all__ = ["METHODS", "POINTS", "RANGE", "Key", "Method", "Outcome", "chosen", "tongue_coordinates"]
