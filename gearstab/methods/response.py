"""The response over speed: ``methods.response``; the periodic steady state, or with backlash what motions settle to."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

from pydantic import Field

from gearstab.config.model.fields import Choice, Flag, NonNegative, Quantity, Section, Whole
from gearstab.errors import NotPossible
from gearstab.mesh import Connection, by_part
from gearstab.methods.base import Method, OptionError, Outcome, Tolerance
from gearstab.results.variables import Variable, flagged
from gearstab.results.variables.responses import (
    BACKLASH_SPEED_RESPONSE,
    MESH_ORDER,
    ORDERS,
    SPEED_RESPONSE,
    connections,
    load_of,
)
from gearstab.system import Array, Feature, GearSystem


class ResponseOptions(Section):
    """The periodic steady state of a driven system at every point of the grid."""

    samples_per_cycle: Annotated[int, Field(ge=8, le=100_000), Whole] = 100
    """Samples in a period of the first mesh, between which a polynomial gives the extremes."""
    tolerance: Tolerance = 1e-9
    """Error of the motion over a period, for waves that are not piecewise constant (1)."""
    continuation: Annotated[str, Choice("direction", ("up", "down"))] | None = None
    """With backlash: up or down in the mesh frequency, every motion beginning where the one before led."""
    cycles: Annotated[float, Field(gt=0, le=1e6), Quantity()] | None = None
    """With backlash: how long every motion is followed, in periods of the first mesh (1)."""
    discard: NonNegative | None = Field(default=None, title="cycles left out")
    """With backlash: how many of the cycles are left for the motion to settle; default half of them."""
    bearings: Flag = False
    """Whether forces of bearings and torques of shafts are computed as well."""


FLAG_NOTES = {
    "unresolved": "too few samples for the fastest vibration at {points}: raise samples_per_cycle",
    "unbalanced": "the load accelerates the train as a whole at {points}; a steady state leaves that part of it out",
    "ill_conditioned": "the steady state is sensitive at {points}: a Floquet multiplier is near 1, or the system grows "
    "strongly",
    "failed": "there is no steady state at {points}: a Floquet multiplier is 1",
}


class SteadyStateAnalysis(Method):
    """The periodic steady state of a system whose teeth stay in contact."""

    name = "response"
    reused = True
    Options = ResponseOptions
    supports = frozenset({Feature.PERIODIC_TERMS, Feature.UNSYMMETRIC_DAMPING, Feature.ROTATION})
    flag_notes: ClassVar[Mapping[str, str]] = {
        **FLAG_NOTES,
        "unstable": "the steady state is unstable at {points}: it is not what would be seen",
        "separation": "teeth would part at {points}: the linear answer does not hold there, loads are overstated; "
        "give the meshes a backlash",
    }

    @classmethod
    def on(cls, options: Any, system: GearSystem) -> Method:
        from gearstab.response.backlash import has_backlash

        return (BacklashAnalysis if has_backlash(system) else cls)(options, system)

    def variables(self) -> tuple[Variable, ...]:
        from gearstab.response.steady import STATUS_FLAGS

        loads = [variable for part, items in self._parts().items() for variable in connections(part, items[0].unit)]
        return (*flagged(SPEED_RESPONSE, STATUS_FLAGS), *([ORDERS] if loads else ()), *loads)

    def _parts(self) -> dict[str, list[Connection]]:
        """The connections by what they are, where they are wanted."""
        return by_part(self.system.connections if self.options.bearings else ())

    def constants(self) -> Mapping[str, Any]:
        own: dict[str, Any] = {part: [item.name for item in items] for part, items in self._parts().items()}
        if own:
            from gearstab.response.loads import orders

            own[MESH_ORDER] = orders(self.system)
        return {"mesh": [mesh.name for mesh in self.system.whole_meshes], **own}

    def run(self, mesh_frequency: Array) -> Outcome:
        from gearstab.response.speeds import speed_response

        options = self.options
        samples, tolerance = options.samples_per_cycle, options.tolerance
        found = dict(vars(speed_response(self.system, mesh_frequency, samples, tolerance, options.bearings)))
        held = found.pop("connections")
        loads: dict[str, Array] = {}
        for part in self._parts():
            at = [k for k, item in enumerate(self.system.connections) if item.part.value == part]
            loads |= {f"{load_of(part)[0]}_{name}": values[..., at] for name, values in vars(held).items()}
        return Outcome(found | loads)

    def cost(self) -> float:
        """Measured: 0.2 ms for 100 samples of three coordinates and two meshes; smooth waves ten times as much."""
        size = (2 * self.system.size + 5) / 11
        samples = self.options.samples_per_cycle * max(1, self.system.common_period()[1][0]) / 100
        return 1000 * size**2 * samples * (1 if self.system.piecewise_constant else 10)

    def check_options(self) -> None:
        if not self.system.forced:
            remedy = "remove it, or give a load (a gearbox: torques of input or outputs), forces or transmission errors"
            raise OptionError((), "nothing drives the system", remedy)
        from gearstab.response.steady import check_held

        try:
            check_held(self.system)
        except NotPossible as error:
            raise OptionError((), error.message, error.remedy or "") from None
        if self.options.bearings and not self.system.connections:
            message = "this system has no bearing and no shaft of its own"
            raise OptionError(("bearings",), message, "remove it, or give supports or shafts to a train")
        self.check_backlash()

    def check_backlash(self) -> None:
        """Raise OptionError for options of motions with backlash that do not fit."""
        for name in ("continuation", "cycles", "discard"):
            if getattr(self.options, name) is not None:
                raise OptionError((name,), "no mesh has backlash", "remove it, or give a mesh backlash")


class BacklashAnalysis(SteadyStateAnalysis):
    """Settled motions of a system whose teeth may part, from one mesh frequency to the next."""

    singly = True
    # A history follows teeth that part, and motions that repel are none that it settles to.
    flag_notes: ClassVar[Mapping[str, str]] = {
        **FLAG_NOTES,
        "chatter": "the history ends at {points} because impacts come too many or too close",
    }
    CYCLES = 200.0
    """How long motions are followed at every mesh frequency, if not said otherwise."""

    @property
    def cycles(self) -> float:
        """Number of periods for which motions are followed at every mesh frequency."""
        return self.options.cycles or self.CYCLES

    def variables(self) -> tuple[Variable, ...]:
        from gearstab.response.backlash import BACKLASH_FLAGS

        return flagged(BACKLASH_SPEED_RESPONSE, BACKLASH_FLAGS)

    def constants(self) -> Mapping[str, Any]:
        return {**super().constants(), "multiplier": range(1, 2 * self.system.size + 1)}

    def run(self, mesh_frequency: Array) -> Outcome:
        from gearstab.response.backlash.motions import speed_cycles

        down = self.options.continuation == "down"
        found = speed_cycles(self.system, mesh_frequency, down, self.cycles, self.options.discard)
        return Outcome({name: values[None] for name, values in found.items()})

    def cost(self) -> float:
        """Measured: 0.7 ms per cycle of a gear pair, and more the more modes are faster than the mesh frequency."""
        cycles = max(self.cycles, 2 * self.system.common_period()[1][0])
        return 4000 * self.system.size * cycles * (1 if self.system.piecewise_constant else 5)

    def check_backlash(self) -> None:
        if self.options.bearings:
            remedy = "remove it; gearstab respond gives their histories with backlash"
            raise OptionError(("bearings",), "is for teeth that stay in contact", remedy)
        if self.options.discard is not None and self.options.discard >= self.cycles:
            message = f"leaves nothing of {self.cycles:g} cycles"
            raise OptionError(("discard",), message, "discard less, or give more cycles")
