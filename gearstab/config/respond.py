"""The section ``respond``."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

from pydantic import Field

from gearstab.config.fields import AngularFrequency, Quantity, Section, Time, Whole
from gearstab.config.mesh import Conflict, exactly_one


class Initial(Section):
    """The state at time zero."""

    displacement: list[Annotated[float, Quantity("m", ("rad",))]] = Field(
        default=[],
        title="initial displacement",
        description="One number a coordinate (m, or rad of a rotation); zeros without.",
    )
    velocity: list[Annotated[float, Quantity("m/s", ("rad/s",))]] = Field(
        default=[],
        title="initial velocity",
        description="One number a coordinate (m/s, or rad/s of a rotation); zeros without.",
    )


class Respond(Section):
    """The free response from an initial state, for ``gearstab respond``."""

    mesh_frequency: AngularFrequency = Field(title="mesh frequency", description="Of the first mesh (rad/s).")
    initial: Initial = Field(
        title="initial state", description="Displacement and velocity; at least one number is not zero."
    )
    duration: Time | None = Field(default=None, title="duration", description="How long (s); or give cycles.")
    cycles: Annotated[float, Field(gt=0), Quantity()] | None = Field(
        default=None, title="cycles", description="How long, in periods of the first mesh (1); or give duration."
    )
    samples_per_cycle: Annotated[int, Field(ge=2, le=1_000_000), Whole()] = Field(
        default=200, title="samples per cycle", description="Stored samples in a period of the first mesh."
    )

    @classmethod
    def conflicts(cls, raw: dict[str, Any], size: int | None) -> Iterator[Conflict]:
        """One length of time, and an initial state of the system's size that is not rest."""
        yield from exactly_one(raw, ("duration", "cycles"))
        initial = raw.get("initial")
        if not isinstance(initial, dict):
            return
        states = {name: initial.get(name) for name in ("displacement", "velocity")}
        for name, values in states.items():
            if isinstance(values, list) and size is not None and len(values) != size:
                yield ("initial", name), f"has {len(values)} entries", f"give {size}, one a coordinate"
        if all(v is None or (isinstance(v, list) and all(x == 0 for x in v)) for v in states.values()):
            yield ("initial",), "the system stays at rest", "give a displacement or a velocity that is not zero"
