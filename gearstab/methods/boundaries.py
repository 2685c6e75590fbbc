"""Edges of all instability regions by root finding, ``methods.boundaries``, and the smallest damping that makes every
point of the grid stable, ``methods.required_damping``.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from gearstab.config.model.fields import Choice, Flag, Quantity, Section
from gearstab.errors import NotPossible
from gearstab.methods.base import (
    RANGE,
    Method,
    ModesOption,
    OptionError,
    Outcome,
    Restricted,
    Tolerance,
    TongueMethod,
    WidthFloor,
    check_certificate,
)
from gearstab.results.variables import CERTIFICATES, EXACT, OCCURRENCE, REQUIRED_DAMPING, TONGUE, Variable, flagged
from gearstab.system import ANY_LINEAR, WHIRLING, Array, Feature

if TYPE_CHECKING:
    from gearstab.floquet.boundaries import Boundaries
    from gearstab.floquet.frequencies import Strategy
    from gearstab.perturbation.tongues import Tongue

CERTIFICATE = 20.0
"""Cost of certificates, in that of the boundaries, at most with three coordinates."""


class BoundariesOptions(ModesOption):
    """Edges of all instability regions over the range of the mesh frequency, by root finding."""

    tolerance: Tolerance = 1e-10
    """Error of an edge, relative to the mesh frequency (1)."""
    width_floor: WidthFloor = 1e-6
    """Regions narrower than this, relative to the mesh frequency, may be left out (1)."""
    certificate: Flag = Field(default=False, title="certificates")
    """Store what proves stability and instability, piece by piece, for `gearstab verify`."""


class BoundaryAnalysis(TongueMethod, Restricted):
    """Exact boundaries, of a system or of some of its modes."""

    name = "boundaries"
    reused = True
    Options = BoundariesOptions
    supports = frozenset({Feature.PERIODIC_TERMS, Feature.UNSYMMETRIC_DAMPING, Feature.ROTATION})
    frequency = RANGE
    relief = (
        "narrow the range of mesh_frequency, take ratios of smaller numbers, or remove it: floquet on a fine grid "
        "shows the regions that damping leaves"
    )

    def variables(self) -> tuple[Variable, ...]:
        from gearstab.floquet.boundaries import BOUNDARY_FLAGS

        more = CERTIFICATES if self.options.certificate else ()
        return (*TONGUE, OCCURRENCE, *flagged(EXACT, BOUNDARY_FLAGS), *more)

    def constants(self) -> Mapping[str, Any]:
        if not self.options.certificate:
            return super().constants()
        from gearstab.certificates.covering import states
        from gearstab.certificates.proof import entries

        return {**super().constants(), "entry": entries(states(self.system))}

    def run(self, mesh_frequency: Array) -> Outcome:
        from gearstab.floquet.boundaries import boundaries

        start, stop = (float(end) for end in mesh_frequency)
        found = boundaries(self.part, start, stop, self.options.tolerance, self.options.width_floor)
        edges = found.arranged()
        values = {
            "boundary_frequency": edges.boundary_frequency, "tolerance": edges.tolerance, "status": edges.flags,
            "holder": edges.holder, "contacts": found.contacts, "evaluations": found.evaluations,
            "proved_share": found.stable_share(found.proved), "counted_share": found.stable_share(found.counted),
            "proved_frequency": found.stretches(found.proved),
            "sampled_step": found.sampled_step, "coarse": found.coarse,
        }  # fmt: skip
        if self.options.certificate:
            values |= self._certified(found, edges.boundary_frequency)
        if self.options.modes is None:
            return Outcome(values, edges.index)
        return Outcome(values, tuple((_named(tongue, self.options.modes), k) for tongue, k in edges.index))

    def _certified(self, found: Boundaries, arranged: Array) -> dict[str, Array]:
        """The variables of certificates."""
        from gearstab.certificates.covering import certificates, states
        from gearstab.certificates.proof import packed
        from gearstab.certificates.shares import around_edges, union_length

        m, (start, stop) = states(self.system), found.limits
        edges = [found.edges_of(row) for row in range(found.rows)]
        rows = [packed(pieces, m) for pieces in certificates(self.system, start, stop, edges)]
        most = max(len(ends) for ends, _ in rows)
        frequency = np.full((most, 2, found.rows), np.nan)
        numbers = np.full((most, found.rows, rows[0][1].shape[1]), np.nan)
        for row, (ends, own) in enumerate(rows):
            frequency[: len(ends), :, row], numbers[: len(ends), row] = ends, own
        covered = np.array([union_length(ends, start, stop) for ends, _ in rows])
        return {
            "certificate_frequency": frequency, "certificate": numbers,
            "certified_share": covered[:, 0] / (stop - start), "uncertified_width": covered[:, 1],
            "uncertified_at_boundary": np.stack(
                [around_edges(arranged[..., row], ends, start, stop) for row, (ends, _) in enumerate(rows)], axis=-1
            ),
        }  # fmt: skip

    def check_options(self) -> None:
        self.check_modes()
        if self.options.certificate:
            check_certificate(self, "" if self.options.modes is None else "modes")

    def report(self) -> Mapping[str, Any]:
        """Return what of the system was solved."""
        return self.restriction()

    @classmethod
    def over_range(cls, options: BoundariesOptions) -> str:
        return "over which boundaries are sought"

    def cost(self) -> float:
        from gearstab.floquet.report import search_cost

        search = search_cost(self.system, self.part.size)
        return CERTIFICATE * search if self.options.certificate else search


def _named(tongue: Tongue, modes: Sequence[int]) -> Tongue:
    """The tongue of a system restricted to these modes by the numbers that they have in the whole system."""
    formula, *mesh = tongue.label.split(" (", 1)
    own = re.sub(r"(w|mode )(\d+)", lambda found: f"{found[1]}{modes[int(found[2]) - 1]}", formula)
    p, q = (modes[number - 1] for number in (tongue.mode_p, tongue.mode_q))
    return replace(tongue, mode_p=p, mode_q=q, label=" (".join([own, *mesh]))


LADDER = 60.0
"""Cost of scanning the levels of damping, in undamped points."""
ROOTS = 400.0
"""Cost of the root finding, shared by all points: eigenproblems of their own for those that need damping."""


class RequiredDampingOptions(Section):
    """The smallest damping that makes every point of the grid stable."""

    of: Annotated[str, Choice("kind of damping", ("damping_ratio", "factor"))] = "damping_ratio"
    """damping_ratio: one modal damping ratio for all modes, in place of the damping given; factor: on the damping
    given. What acts with a speed of rotation stays as it is."""
    largest: Annotated[float, Field(gt=0, le=1e6), Quantity()] | None = Field(default=None, title="largest damping")
    """Where the search ends (1); default a damping ratio of 0.5, or a factor of 100."""
    tolerance: Tolerance = 1e-6
    """Relative error of the required damping (1)."""
    frequencies: Annotated[str, Choice("way", ("auto", "common_period", "per_mesh"))] = Field(
        default="auto", title="many mesh frequencies"
    )
    """common_period: exact; per_mesh: one frequency at a time, the others at their mean; auto: exact while affordable.
"""


class DampingAnalysis(Method):
    """The damping that suppresses instability."""

    name = "required_damping"
    reused = True
    Options = RequiredDampingOptions
    supports = ANY_LINEAR | WHIRLING
    flag_notes: ClassVar[Mapping[str, str]] = {"beyond": "no damping up to `largest` suffices at {points}"}

    @cached_property
    def strategy(self) -> Strategy:
        """Choose ``common_period`` or ``per_mesh``. Raises NotPossible where the one asked for does not exist."""
        from gearstab.floquet.frequencies import chosen

        taken = chosen(self.system, self.options.frequencies).name
        # Zeros of an estimate with an interval would have none.
        return chosen(self.system, "per_mesh" if taken == "lyapunov" else taken)

    def variables(self) -> tuple[Variable, ...]:
        from gearstab.floquet.required_damping import FLAGS

        return flagged(REQUIRED_DAMPING, FLAGS)

    def run(self, mesh_frequency: Array) -> Outcome:
        from gearstab.floquet.frequencies import apart
        from gearstab.floquet.required_damping import required_damping

        options, exact = self.options, self.strategy.name == "common_period"
        found = [
            required_damping(system, ratio * mesh_frequency, options.of, options.largest, options.tolerance)
            for system, ratio in ([(self.system, 1.0)] if exact else apart(self.system))
        ]
        status = np.bitwise_or.reduce([one.status for one in found])
        return Outcome({"required_damping": np.max([one.value for one in found], axis=0), "status": status})

    def cost(self) -> float:
        from gearstab.floquet.dispatch import reduction
        from gearstab.floquet.frequencies import apart

        exact = self.strategy.name == "common_period"
        systems = [self.system] if exact else [system for system, _ in apart(self.system)]
        return sum(LADDER * reduction(system).cost + ROOTS for system in systems)

    def report(self) -> Mapping[str, Any]:
        return {"frequencies_chosen": self.strategy.name} if self.strategy.several else {}

    def outlook(self) -> str | None:
        return self.strategy.reason if self.strategy.several else None

    def check_options(self) -> None:
        try:
            _ = self.strategy
        except NotPossible:
            self.require((), {Feature.IRRATIONAL_RATIO: "choose per_mesh or auto"}, ("frequencies",))
            raise
        from gearstab.floquet.required_damping import scalable

        if self.options.of == "factor" and not scalable(self.system):
            remedy = "give the system damping, or choose of: damping_ratio"
            raise OptionError(("of",), "there is no damping to multiply", remedy)
