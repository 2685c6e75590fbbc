"""The section ``respond`` of a gear pair that is given by its gears."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

from pydantic import Field

from gearstab.config.model.axes import SpeedAxis
from gearstab.config.model.conflicts import Conflict, exactly_one
from gearstab.config.model.fields import AngularFrequency, Choice, Flag, NonNegative, Section, Time, Whole, optional
from gearstab.config.model.reading import known
from gearstab.config.model.units import Quantity

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
