"""The frequencies that ``gearstab info`` shows of a configuration, in a unit that was asked for."""

from __future__ import annotations

from typing import Any

OF_TONGUES = ("center_frequency", "half_width", "boundary_frequency", "boundary_error")
"""Keys of a tongue that are frequencies, or distances of them."""


def shown_in(facts: dict[str, Any], text: str) -> dict[str, Any]:
    """Return the facts with natural frequencies, tongues and the table of dangerous speeds in a unit.

    text: rpm, Hz, rad/s or another unit of a speed; SI. Raises ResultError for any other, and for orders.
    """
    from gearstab.config.model.units import UnitError, scale
    from gearstab.errors import ResultError
    from gearstab.results.display import ORDER, SI

    unit = "rad/s" if text == SI else text
    if unit == ORDER:
        where = (
            "the table of meshes shows theirs" if facts["meshes"][0]["order"] is not None else "and no teeth are given"
        )
        raise ResultError(f"--unit {text}: a natural frequency has an order at a single speed only; {where}")
    if not facts["unit"]:
        raise ResultError(f"--unit {text}: this model has no units")
    try:
        one = scale(unit, "rad/s")
    except UnitError:
        raise ResultError(f"--unit {text}: is no unit of a frequency; give rpm, Hz, rad/s or SI") from None
    dangerous = facts["dangerous"]
    # What is shown is over ``scale``, which an input speed's number of teeth is part of.
    again = one * dangerous["teeth"]
    ends = dangerous["range"] and [end * dangerous["scale"] / again for end in dangerous["range"]]
    return facts | {
        "unit": unit,
        "per_unit": one,
        "modes": [mode | {"natural_frequency": over(mode["natural_frequency"], one)} for mode in facts["modes"]],
        "tongues": [t | {key: over(t[key], one) for key in OF_TONGUES if key in t} for t in facts["tongues"]],
        "dangerous": dangerous | {"unit": unit, "scale": again, "range": ends},
    }


def over(value: Any, one: float) -> Any:
    """Return a number or a list of them over a unit; texts and None as they are."""
    if isinstance(value, list):
        return [over(item, one) for item in value]
    return value / one if isinstance(value, float) else value
