"""The section ``respond``, of a linear system and of a gear pair that is given by its gears."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, cast

from pydantic import Field, PrivateAttr, model_validator

from gearstab.config.model import SpeedAxis
from gearstab.config.model.conflicts import Conflict, at_most_one, below, exactly_one, items, wrong_length
from gearstab.config.model.fields import (
    AngularFrequency,
    Choice,
    Flag,
    NonNegative,
    Quantity,
    Section,
    Time,
    Whole,
    optional,
)
from gearstab.config.model.reading import WRONG, known, told
from gearstab.config.model.units import wrong


class Initial(Section):
    """The state at time zero."""

    displacement: list[Annotated[float, Quantity("m", ("rad",), entry=True)]] = Field(
        default=[], title="initial displacement"
    )
    """One number per coordinate (m, or rad of a rotation); zeros without."""
    velocity: list[Annotated[float, Quantity("m/s", ("rad/s",), entry=True)]] = Field(
        default=[], title="initial velocity"
    )
    """One number per coordinate (m/s, or rad/s of a rotation); zeros without."""


class Ramp(Section):
    """A run-up or coast-down, from the speed of the section on."""

    to: AngularFrequency = Field(title="last speed")
    """Mesh frequency, or input speed where that is given, at the end (rad/s)."""
    rate: Annotated[float, Field(gt=0), Quantity("rad/s^2")]
    """How fast it changes, upwards or downwards (rad/s^2, "300 rpm/s")."""


class Respond(Section):
    """The response of a linear system, for ``gearstab respond``: from an initial state, periodic, or of a run-up."""

    mesh_frequency: AngularFrequency = cast(float, None)
    """Frequency of the first mesh (rad/s); or give input_speed."""
    input_speed: AngularFrequency | None = None
    """Speed of the input of a system whose teeth are known (rad/s, "1500 rpm"); or give mesh_frequency."""
    initial: Initial | None = optional("initial state")
    """Displacement and velocity; a driven system begins in static equilibrium without."""
    steady_state: Flag = False
    """The periodic response of a driven system, over one period common to all that varies and drives."""
    ramp: Ramp | None = None
    """Instead of a constant speed: a run-up or coast-down to another one, at a rate."""
    duration: Time | None = None
    """How long (s); or give cycles."""
    cycles: Annotated[float, Field(gt=0), Quantity()] | None = None
    """How long, in periods of the first mesh (1); or give duration."""
    stored_cycles: Annotated[float, Field(gt=0), Quantity()] | None = None
    """Stored part of the histories of a steady state, in periods of the first mesh (1); the whole common period
    without."""
    samples_per_cycle: Annotated[int, Field(ge=2, le=1_000_000), Whole] = 200
    """Stored samples in a period of the first mesh."""
    discard: NonNegative | None = optional("cycles left out")
    """With backlash: how long, in periods of the first mesh, the motion settles before it is summed up."""

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

    def conflicts(self, system: Any, size: int | None) -> Iterator[Conflict]:
        """One length of time and an initial state of the system's size, or neither for the steady state.

        system: its section, None without a kind; size: number of its coordinates, None where it is not known.
        """
        if self.mesh_frequency is None and self.input_speed is None:
            hint = "add mesh_frequency (rad/s), or input_speed where the teeth are known"
            yield ("mesh_frequency",), "missing", "is missing", hint
        yield from at_most_one(self, ("mesh_frequency", "input_speed"))
        driven, parting = drives(system), told(lambda: may_part(system))
        yield from known(self._at_another_speed(system))
        if self.discard is not None and parting is False and system is not None:
            yield ("discard",), "not_applicable", "no mesh has backlash", "remove it, or give a mesh backlash"
        yield from known(self._discarded())
        if self.ramp is not None:
            yield from self._of_ramp(driven, parting)
            return
        if self.steady_state is True and parting:
            remedy = "give cycles, long enough for the motion to settle, and discard"
            yield ("steady_state",), "not_applicable", "teeth with backlash may have several", remedy
            return
        if self.steady_state is True:
            yield from self._of_steady_state(driven)
            return
        if self.stored_cycles is not None:
            hint = "give cycles instead, or steady_state: true"
            yield ("stored_cycles",), "not_applicable", "belongs to a steady state", hint
        yield from exactly_one(self, ("duration", "cycles"))
        initial = self.initial
        if initial is None and not driven:
            yield (), "missing", "initial is missing", "add initial: {displacement: [..]}, or a load to the system"
        if initial is None:
            return
        for name in ("displacement", "velocity"):
            if name in initial.model_fields_set:
                yield from below("initial", wrong_length(initial, name, size))
        if not driven and all(x == 0 for state in (initial.displacement, initial.velocity) for x in state):
            hint = "give a displacement or a velocity that is not zero"
            yield ("initial",), "only_zeros", "the system stays at rest", hint

    def _at_another_speed(self, system: Any) -> Iterator[Conflict]:
        """A speed that changes, or is not that of the input, where a torque depends on it."""
        held = None if system is None else told(system.held_frequency)
        if held is None or self.mesh_frequency is None:
            return
        if self.ramp is not None:
            message = "changes the speed, on which a torque depends: its slope would change too"
            yield ("ramp",), "not_applicable", message, "remove it, or give a constant torque instead of torque_law"
        elif abs(self.mesh_frequency - held) > SAME_SPEED * held:
            message = "is not that of system.input, at which the torque is taken"
            yield ("mesh_frequency",), "inconsistent", message, "give both the same speed"

    def _discarded(self) -> Iterator[Conflict]:
        if self.discard is not None and self.cycles is not None and self.discard >= self.cycles:
            hint = "give more cycles, or discard less"
            yield ("discard",), "inconsistent", f"leaves nothing of {self.cycles:g} cycles", hint

    def _of_ramp(self, driven: bool, parting: bool | None) -> Iterator[Conflict]:
        if parting:
            message = "teeth with backlash are followed at a constant speed only"
            yield ("ramp",), "not_applicable", message, "remove the ramp or the backlash"
        for key in ("duration", "cycles", "stored_cycles"):
            if self[key] is not None:
                remedy = "remove it: the ramp ends at its last speed"
                yield (key,), "not_applicable", "is not allowed together with ramp", remedy
        if self.steady_state is True:
            yield ("steady_state",), "not_applicable", "is not allowed together with ramp", "remove one of them"
        if self.initial is None and not driven:
            yield (), "missing", "initial is missing", "add initial: {displacement: [..]}, or a load to the system"

    def _of_steady_state(self, driven: bool) -> Iterator[Conflict]:
        if not driven:
            remedy = "give a load (a gearbox: torques of input or outputs), a mesh's transmission_error or forces"
            yield ("steady_state",), "needs_other", "nothing drives the system", remedy
            return
        for key in ("duration", "cycles", "initial"):
            if self[key] is not None:
                hint = "remove it, or set steady_state: false"
                yield (key,), "not_applicable", "is not allowed together with steady_state", hint


SAME_SPEED = 1e-6
"""Relative difference of two speeds that are typed in different units, with a few digits less."""


def may_part(system: Any) -> bool:
    """Return whether the section ``system`` has a mesh with backlash."""
    given = [mesh.backlash for _, mesh in items(getattr(system, "meshes", None))]
    return any(value is not None and value != 0 for value in given)


def drives(system: Any) -> bool:
    """Return whether the section ``system`` has something that drives it; what is wrong may do so."""
    if system is None:
        return True
    ends = [getattr(system, "input", None), getattr(system, "outputs", None)]
    ends += ends.pop() or () if ends[1] is not WRONG else ()
    if any(
        end is WRONG or any(getattr(end, key, None) is not None for key in ("torque", "torque_law")) for end in ends
    ):
        return True
    meshes = [mesh for _, mesh in items(getattr(system, "meshes", None))]
    if any(mesh.transmission_error is not None for mesh in meshes):
        return True
    given = [getattr(system, key, None) for key in ("load", "forces")]
    given += [getattr(mesh, "revolution_errors", None) for mesh in meshes]
    return any(value is WRONG or bool(value) for value in given)


LENGTHS = ("cycles", "duration", "until")
"""Ways to say how long a response is."""


class PairInitial(Section):
    """The state at time zero; theta' comes from the speed."""

    misplaced: ClassVar[dict[str, str]] = {"theta_dot": "give respond.speed, of the driving gear"}

    phi: Annotated[float, Quantity("rad")] | None = optional("initial deflection")
    """phi = (N1 theta1 - N2 theta2)/2 (rad); the static deflection T0/k without."""
    phi_dot: Annotated[float, Quantity("rad/s")] = Field(default=0.0, title="initial rate of deflection")
    """d phi/dt (rad/s)."""
    theta: Annotated[float, Quantity("rad")] = Field(default=0.0, title="initial rotation")
    """theta = (N1 theta1 + N2 theta2)/2, 2 pi a mesh cycle (rad)."""


class PairSpectrum(Section):
    """How the power spectral density of phi is made."""

    discard: NonNegative = Field(default=0.0, title="discarded cycles")
    """Mesh cycles at the initial speed left out at the beginning."""
    window: Annotated[str, Choice("window", ("hann", "boxcar"))] = "hann"
    """hann, or boxcar for a response that repeats itself exactly."""
    peaks: Annotated[int, Field(ge=1, le=1000), Whole] = Field(default=20, title="number of peaks")
    """How many of the largest peaks are listed."""


class PairRespond(Section):
    """The response of a gear pair from an initial state, for ``gearstab respond``."""

    misplaced: ClassVar[dict[str, str]] = {
        "mesh_frequency": "give speed, of the driving gear: its mesh frequency is N1 times that"
    }

    speed: AngularFrequency = Field(title="initial speed")
    """Initial speed of the driving gear (rad/s, or "600 rpm"); theta' = N1 times that."""
    cycles: Annotated[float, Field(gt=0), Quantity()] | None = None
    """How long, in mesh cycles, 2 pi of theta each; or give duration."""
    duration: Time | None = None
    """How long (s); or give cycles."""
    until: Annotated[str, Choice("end", ("stalled",))] | None = None
    """stalled: until the gears are trapped with one pair in contact."""
    initial: PairInitial = Field(default=PairInitial(), title="initial state")
    """phi, phi_dot and theta; default static deflection."""
    hold_speed: Flag = Field(default=False, title="speed held")
    """Begin on the periodic orbit of the mean speed given, which an unbalanced torque then holds."""
    samples_per_cycle: Annotated[int, Field(ge=2, le=1_000_000), Whole] = 200
    """Stored samples in a mesh cycle at the initial speed."""
    spectrum: PairSpectrum = PairSpectrum()
    """discard, window and peaks of the power spectral density of phi."""

    frequency_key: ClassVar[str] = "speed"

    def of_size(self, size: int, axis: SpeedAxis) -> PairRespond:
        """Return the section as it is: nothing in it has one number for each coordinate, or another axis."""
        return self

    def conflicts(self, system: Any, size: int | None) -> Iterator[Conflict]:
        """One length of time; only what loses energy can stall, and only what may change its speed can be held."""
        yield from exactly_one(self, LENGTHS)
        if self.hold_speed:
            yield from known(self._held(system))
        if self.until is None:
            return
        if system.formulation != "energy_conserving":
            message = "only the energy_conserving formulation stalls"
            yield ("until",), "not_applicable", message, "give cycles or duration"
        elif not system.damping_ratio:
            hint = "give a damping_ratio, or cycles or duration"
            yield ("until",), "needs_other", "without damping the energy is constant", hint

    def _held(self, system: Any) -> Iterator[Conflict]:
        """Fields that contradict a held speed."""
        if system.formulation == "classical":
            yield ("hold_speed",), "not_applicable", "the classical formulation keeps its speed by itself", "remove it"
        # A configuration as resolved names the zeros that were not given.
        if any(value not in (None, 0) for _, value in self.initial):
            message = "hold_speed begins on the periodic orbit"
            yield ("initial",), "not_applicable", message, "remove initial or hold_speed"
        if self.until is not None:
            yield ("until",), "not_applicable", "with hold_speed the gears never stall", "give cycles or duration"
