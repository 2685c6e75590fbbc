"""The response over speed: ``methods.response``; the periodic steady state, or with backlash what motions settle to.

Periodic motions with backlash that are followed over the speed, unstable ones too, are ``methods.branches``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, PrivateAttr

from gearstab.config.model import SPEEDS, Axis, replaced
from gearstab.config.model.fields import Choice, Flag, NonNegative, Quantity, Section, Whole
from gearstab.errors import NotPossible
from gearstab.mesh import Connection, by_part
from gearstab.methods.base import POINTS, RANGE, Method, OptionError, Outcome, Tolerance
from gearstab.results.variables import GRID, ROWS, Variable, flagged
from gearstab.results.variables.responses import (
    BACKLASH_SPEED_RESPONSE,
    BRANCHES,
    MESH_ORDER,
    ORDERS,
    SPEED_RESPONSE,
    connections,
    load_of,
)
from gearstab.system import Array, Feature, GearSystem

if TYPE_CHECKING:
    from pathlib import Path as FilePath

    from gearstab.config.document import Document
    from gearstab.response.backlash.sections import SectionMap
    from gearstab.systems.base import System


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


class BranchesOptions(Section):
    """Periodic motions with backlash as curves over the mesh frequency or another axis, through folds."""

    over: str | None = None
    """Axis of numbers of the sweep along which motions are followed; default the mesh frequency."""
    start: list[Literal["linear", "rest", "random"]] = Field(default=["linear", "rest"], min_length=1)
    """Where branches begin: the linear motion, what the static equilibrium or random states settle to."""
    at: list[float] | None = Field(default=None, min_length=1, max_length=1000)
    """Values of the axis at which motions are looked for; default five over the range."""
    states: Annotated[int, Field(ge=1, le=1000), Whole] = 1
    """Random initial states at each value, with start: [random]."""
    seed: Annotated[int, Field(ge=0), Whole] = 0
    """Seed of the random states."""
    cycles: Annotated[float, Field(gt=0, le=1e6), Quantity()] = 200.0
    """Periods of the first mesh that a motion is given to settle (1)."""
    period_doubling: Literal["mark", "follow"] = "mark"
    """Whether branches of twice the period that leave at period doublings are followed too."""
    branch_point: Literal["mark", "follow"] = "mark"
    """Whether those that leave at branch points are followed, too."""
    points: Annotated[int, Field(ge=10, le=100_000), Whole] = 1000
    """Motions of all branches of a system together, at most."""
    longest_step: Annotated[float, Field(gt=0, le=1), Quantity()] = 0.05
    """Between motions, relative to the range of the axis and the extent of a motion (1)."""
    largest: Annotated[float, Field(gt=1, le=1e6), Quantity()] = Field(default=10.0, title="largest motion")
    """Extent, relative to that of the first motion, at which a branch ends (1)."""
    _axis: Axis | None = PrivateAttr(default=None)

    @property
    def axis(self) -> Axis | None:
        """Return the axis along which motions are followed, None for the mesh frequency."""
        return self._axis


class BranchAnalysis(Method):
    """Periodic motions of a system whose teeth may part, one system at a time."""

    name = "branches"
    Options = BranchesOptions
    frequency = RANGE
    singly = True
    bounded = True
    supports = frozenset({Feature.PERIODIC_TERMS})
    relief = "narrow the range of mesh_frequency, or ask for fewer points"
    STARTS: ClassVar[int] = 5
    """Mesh frequencies at which motions are looked for, if not said otherwise."""

    @classmethod
    def on(cls, options: BranchesOptions, system: GearSystem) -> Method:
        return (cls if options.axis is None else AxisBranches)(options, system)

    @classmethod
    def completed(
        cls, options: BranchesOptions, document: Document, source: FilePath, axes: Sequence[Axis]
    ) -> BranchesOptions:
        """Return the options with the axis that they name."""
        if options.over is None:
            return options
        found = next((axis for axis in axes if axis.name == options.over), None)
        if found is not None and found.mesh_frequency is not None:
            return options
        if found is not None and not isinstance(found.values, list) and found.span[0] < found.span[1]:
            return options.knowing(axis=found)
        message = "is no axis of the sweep" if found is None else "is no axis of numbers that differ"
        document.report(("methods", cls.name, "over"), "needs_other", message, "name an axis of numbers of sweep",
                        value=options.over)  # fmt: skip
        return options

    def variables(self) -> tuple[Variable, ...]:
        from gearstab.response.backlash.motions import BRANCH_FLAGS

        return flagged(BRANCHES, BRANCH_FLAGS)

    @property
    def rows(self) -> int:
        """The least number of branches that results have room for."""
        return 1

    def attributes(self) -> dict[str, Any]:
        return super().attributes() | {"start": " ".join(self.options.start)}

    def constants(self) -> Mapping[str, Any]:
        return {
            "point": np.arange(1, self.options.points + 1),
            "multiplier": np.arange(1, 2 * self.system.size + 1),
            "branch": np.arange(self.rows),
            "mesh": [mesh.name for mesh in self.system.meshes],
        }

    def run(self, mesh_frequency: Array) -> Outcome:
        from gearstab.response.backlash.sections import SectionMap

        low, high = (float(end) for end in mesh_frequency)
        found = self.followed(SectionMap(self.system), low, high)
        # Of one row; branches come first.
        return Outcome({name: values[:, None] for name, values in found.items()})

    def followed(self, laps: SectionMap, low: float, high: float) -> dict[str, Array]:
        """Return the branches of a system within a range, by variable."""
        from gearstab.response.backlash.branches import BranchSearch, Starts, table
        from gearstab.response.backlash.continuation import BRANCHING, DOUBLING, StepLimits

        own = self.options
        values = np.linspace(low, high, self.STARTS) if own.at is None else np.clip(own.at, low, high)
        limits = StepLimits(low, high, own.points, longest=own.longest_step, largest=own.largest)
        starts = Starts(tuple(values.tolist()), tuple(own.start), own.states, own.cycles, own.seed)
        wanted = {DOUBLING: own.period_doubling, BRANCHING: own.branch_point}
        search = BranchSearch(laps, limits, frozenset(kind for kind, word in wanted.items() if word == "follow"))
        search.run(starts)
        return table(search, self.rows, own.points, 2 * self.system.size, len(self.system.meshes))

    @property
    def fewest(self) -> int:
        return 1

    def cost(self) -> float:
        """Measured: 14 ms a motion of a gear pair, 20 ms of three coordinates and two meshes."""
        return 4e5 * (1 + self.system.size / 4) * self.options.points * (1 if self.system.piecewise_constant else 5)

    def check_options(self) -> None:
        from gearstab.response.backlash import has_backlash

        if not has_backlash(self.system):
            remedy = "give a mesh backlash; motions without loss of contact are those of response"
            raise OptionError((), "no mesh has backlash", remedy)
        if not self.system.forced:
            raise OptionError((), "nothing drives the system", "give a load, forces or transmission errors")

    @classmethod
    def over_range(cls, options: BranchesOptions) -> str:
        return "over which motions are followed" if options.over in (None, *SPEEDS) else ""


class AxisBranches(BranchAnalysis):
    """The same along another axis, at every mesh frequency; the results do not stand over that axis."""

    frequency = POINTS
    section: System

    @property
    def rows(self) -> int:
        from gearstab.response.backlash.motions import MOST_BRANCHES

        return MOST_BRANCHES

    @property
    def left_out(self) -> str:
        return str(self.options.over)

    def variables(self) -> tuple[Variable, ...]:
        axis = self.options.axis
        own = Variable("branch_value", ("branch", ROWS, "point"), "f8", axis.units, axis.long_name)
        # Over all axes, in their order, and then over branches.
        return tuple(
            v if ROWS not in v.dims else replace(v, dims=(GRID, "branch", *v.dims[2:]))
            for v in (own if v.name == "mesh_frequency" else v for v in super().variables())
        )

    def made_of(self, section: System) -> Method:
        found = super().made_of(section)
        assert isinstance(found, AxisBranches)
        found.section = section
        return found

    def at(self, value: float) -> GearSystem:
        """Return the system at a value of the axis, between its points by straight lines."""
        axis, section = self.options.axis, self.section
        order = np.argsort(axis.values)
        for item in axis.assignments:
            number = np.interp(value, np.asarray(axis.values)[order], np.asarray(item.values)[order])
            section = replaced(section, item.path, float(number))
        return section.build()

    def run(self, mesh_frequency: Array) -> Outcome:
        from gearstab.response.backlash.sections import SectionMap

        low, high = self.options.axis.span
        found = []
        for omega in mesh_frequency.tolist():
            found.append(self.followed(SectionMap(self.at(low), along=self.at, omega=omega), low, high))
            found[-1]["branch_value"] = found[-1].pop("mesh_frequency")
        return Outcome({name: np.stack([one[name] for one in found])[None] for name in found[0]})
