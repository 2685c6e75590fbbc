"""The section ``respond``."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, cast

from pydantic import Field, PrivateAttr, model_validator

from gearstab.config.model.axes import SpeedAxis
from gearstab.config.model.conflicts import (
    Conflict,
    at_most_one,
    below,
    exactly_one,
    is_known,
    items,
    plain_number,
    wrong_length,
)
from gearstab.config.model.fields import (
    AngularFrequency,
    Flag,
    NonNegative,
    Quantity,
    Section,
    Time,
    Whole,
    wrong,
)


class Initial(Section):
    """The state at time zero."""

    displacement: list[Annotated[float, Quantity("m", ("rad",), entry=True)]] = Field(
        default=[],
        title="initial displacement",
        description="One number per coordinate (m, or rad of a rotation); zeros without.",
    )
    velocity: list[Annotated[float, Quantity("m/s", ("rad/s",), entry=True)]] = Field(
        default=[],
        title="initial velocity",
        description="One number per coordinate (m/s, or rad/s of a rotation); zeros without.",
    )


class Ramp(Section):
    """A run-up or coast-down, from the speed of the section on."""

    to: AngularFrequency = Field(
        title="last speed", description="Mesh frequency, or input speed where that is given, at the end (rad/s)."
    )
    rate: Annotated[float, Field(gt=0), Quantity("rad/s^2")] = Field(
        title="rate", description='How fast it changes, upwards or downwards (rad/s^2, "300 rpm/s").'
    )


class Respond(Section):
    """The response of a linear system, for ``gearstab respond``: from an initial state, periodic, or of a run-up."""

    mesh_frequency: AngularFrequency = Field(
        default=cast(float, None),  # of a sound section it is given, or takes the place of input_speed
        title="mesh frequency",
        description="Of the first mesh (rad/s); or give input_speed.",
    )
    input_speed: AngularFrequency | None = Field(
        default=None,
        title="input speed",
        description='Of the input of a system whose teeth are known (rad/s, "1500 rpm"); or give mesh_frequency.',
    )
    initial: Initial | None = Field(
        default=None,
        title="initial state",
        description="Displacement and velocity; a driven system begins in static equilibrium without.",
    )
    steady_state: Flag = Field(
        default=False,
        title="steady state",
        description="The periodic response of a driven system, over one period common to all that varies and drives.",
    )
    ramp: Ramp | None = Field(
        default=None,
        title="ramp",
        description="Instead of a constant speed: a run-up or coast-down to another one, at a rate.",
    )
    duration: Time | None = Field(default=None, title="duration", description="How long (s); or give cycles.")
    cycles: Annotated[float, Field(gt=0), Quantity()] | None = Field(
        default=None, title="cycles", description="How long, in periods of the first mesh (1); or give duration."
    )
    stored_cycles: Annotated[float, Field(gt=0), Quantity()] | None = Field(
        default=None,
        title="stored cycles",
        description="Of a steady state: how much of the histories is stored, in periods of the first mesh (1); the "
        "whole common period without.",
    )
    samples_per_cycle: Annotated[int, Field(ge=2, le=1_000_000), Whole] = Field(
        default=200, title="samples per cycle", description="Stored samples in a period of the first mesh."
    )
    discard: NonNegative | None = Field(
        default=None,
        title="cycles left out",
        description="With backlash: how long, in periods of the first mesh, the motion settles before it is summed up.",
    )

    _axis: SpeedAxis = PrivateAttr(default=SpeedAxis())
    frequency_key: ClassVar[str] = "mesh_frequency"
    """The key that says how fast the system runs."""

    @model_validator(mode="after")
    def _moves(self) -> Respond:
        if self.ramp is not None and self.ramp.to == self.mesh_frequency:
            raise wrong("inconsistent", "has a ramp to the speed at which it begins", "give ramp.to another speed")
        return self

    @property
    def axis(self) -> SpeedAxis:
        """In what the configuration gives the speed."""
        return self._axis

    def of_size(self, size: int, axis: SpeedAxis) -> Respond:
        """Return the section with zeros for what the initial state of so many coordinates does not give.

        axis: in what the configuration gives the speed.
        """
        self._axis = axis
        if self.initial is None:
            return self
        state = {name: getattr(self.initial, name) or [0.0] * size for name in Initial.model_fields}
        return self.model_copy(update={"initial": Initial(**state)})

    @classmethod
    def conflicts(cls, raw: dict[str, Any], system: dict[str, Any], size: int | None) -> Iterator[Conflict]:
        """One length of time and an initial state of the system's size, or neither for the steady state.

        system: its section as meant; size: number of its coordinates, None where it cannot be told.
        """
        if raw.get("mesh_frequency") is None and raw.get("input_speed") is None:
            hint = "add mesh_frequency (rad/s), or input_speed where the teeth are known"
            yield ("mesh_frequency",), "missing", "is missing", hint
        yield from at_most_one(raw, ("mesh_frequency", "input_speed"))
        driven, parting = drives(system), may_part(system)
        if raw.get("discard") is not None and not parting and is_known(system):
            yield ("discard",), "not_applicable", "no mesh has backlash", "remove it, or give a mesh backlash"
        discard, cycles = plain_number(raw.get("discard")), plain_number(raw.get("cycles"))
        if discard is not None and cycles is not None and discard >= cycles > 0:
            yield (
                ("discard",),
                "inconsistent",
                f"leaves nothing of {cycles:g} cycles",
                "give more cycles, or discard less",
            )
        if raw.get("ramp") is not None:
            yield from _of_ramp(raw, driven, parting)
            return
        if raw.get("steady_state") is True and parting:
            remedy = "give cycles, long enough for the motion to settle, and discard"
            yield ("steady_state",), "not_applicable", "teeth with backlash may have several", remedy
            return
        if raw.get("steady_state") is True:
            yield from _of_steady_state(raw, driven)
            return
        if raw.get("stored_cycles") is not None:
            yield (
                ("stored_cycles",),
                "not_applicable",
                "belongs to a steady state",
                "give cycles instead, or steady_state: true",
            )
        yield from exactly_one(raw, ("duration", "cycles"))
        initial = raw.get("initial")
        if initial is None and not driven:
            yield (), "missing", "initial is missing", "add initial: {displacement: [..]}, or a load to the system"
        if initial is None:
            return
        for name in ("displacement", "velocity"):
            yield from below("initial", wrong_length(initial, name, size))
        states = [initial.get(name) for name in ("displacement", "velocity")]
        if not driven and all(is_known(state) and all(x == 0 for x in state or ()) for state in states):
            yield (
                ("initial",),
                "only_zeros",
                "the system stays at rest",
                "give a displacement or a velocity that is not zero",
            )


def _of_ramp(raw: dict[str, Any], driven: bool, parting: bool) -> Iterator[Conflict]:
    if parting:
        message = "teeth with backlash are followed at a constant speed only"
        yield ("ramp",), "not_applicable", message, "remove the ramp or the backlash"
    for key in ("duration", "cycles", "stored_cycles"):
        if raw.get(key) is not None:
            remedy = "remove it: the ramp ends at its last speed"
            yield (key,), "not_applicable", "is not allowed together with ramp", remedy
    if raw.get("steady_state") is True:
        yield ("steady_state",), "not_applicable", "is not allowed together with ramp", "remove one of them"
    if raw.get("initial") is None and not driven:
        yield (), "missing", "initial is missing", "add initial: {displacement: [..]}, or a load to the system"


def _of_steady_state(raw: dict[str, Any], driven: bool) -> Iterator[Conflict]:
    if not driven:
        remedy = "give a load (a gearbox: torques of input or outputs), a mesh's transmission_error or forces"
        yield ("steady_state",), "needs_other", "nothing drives the system", remedy
        return
    for key in ("duration", "cycles", "initial"):
        if raw.get(key) is not None:
            yield (
                (key,),
                "not_applicable",
                "is not allowed together with steady_state",
                "remove it, or set steady_state: false",
            )


def may_part(system: dict[str, Any]) -> bool:
    """Whether the section ``system``, as meant, has a mesh with backlash."""
    given = [mesh.get("backlash") for _, mesh in items(system.get("meshes"))]
    return any(value not in (None, 0, 0.0) and is_known(value) for value in given)


def drives(system: dict[str, Any]) -> bool:
    """Whether the section ``system``, as meant, has something that drives it."""
    meshes = [mesh for _, mesh in items(system.get("meshes"))]
    ends = [system.get("input") or {}, *(system.get("outputs") or ())]
    if any(end.get("torque") is not None for end in ends):
        return True
    errors = any(mesh.get("transmission_error") is not None or mesh.get("revolution_errors") for mesh in meshes)
    return errors or bool(system.get("load")) or bool(system.get("forces"))
