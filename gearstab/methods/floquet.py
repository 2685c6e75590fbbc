"""Exact stability at every point of the grid: ``methods.floquet``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from pydantic import BeforeValidator, Field

from gearstab.config.model.fields import Choice, Flag, Quantity, Section, Whole
from gearstab.config.model.units import wrong
from gearstab.errors import NotPossible
from gearstab.methods.base import Method, ModesOption, OptionError, Outcome, Restricted, Tolerance, check_certificate
from gearstab.results.variables import (
    BY_MESH,
    CERTIFIED,
    ERROR_ESTIMATE,
    EXPONENTS,
    FLOQUET,
    INTERVAL,
    ORBITS,
    Variable,
    flagged,
)
from gearstab.system import ANY_LINEAR, Array, Feature, GearSystem

if TYPE_CHECKING:
    from gearstab.floquet import FloquetStability
    from gearstab.floquet.frequencies import Strategy
    from gearstab.rotating_pair import RotatingPair

VECTORS = 0.5
"""Cost of a segment over the square of the number of coordinates, in units of a sweep's costs: carrying the vectors of
a Lyapunov exponent takes four times as long as the compiled kernel's product at 12 coordinates."""
MOST = 512.0
"""Cost of a Lyapunov exponent beyond which blocks of the grid do not get smaller: calls pay for hundreds of points."""

CERTIFICATE = 3e4
"""Cost of a proof, in that of the point in the compiled kernel."""

ORBIT = 800.0
"""Cost of an orbit, in points of a linear system of three coordinates."""


def _deflection_type(value: Any) -> Any:
    """T or a name; raises a pydantic error."""
    if isinstance(value, bool) or not isinstance(value, int | str) or (isinstance(value, int) and value < 0):
        raise wrong("unknown_choice", "must be a type of mesh deflection", "write T = 0, 1, 2, ... or a type's name")
    return value


class LyapunovOptions(Section):
    """The largest Lyapunov exponent, for mesh frequencies without a common period."""

    cycles: Annotated[float, Field(ge=20, le=1e7), Quantity()] = 500
    """Length of the window in periods of the slowest mesh (1)."""
    confidence: Annotated[float, Field(gt=0.5, lt=1), Quantity()] = 0.95
    """Confidence level of the interval of the growth rate (1)."""
    seed: Annotated[int, Field(ge=0, le=2**32), Whole] = 0
    """Seed of the random part of the start vectors."""


class FloquetOptions(ModesOption):
    """Exact stability at every point of the grid."""

    certificate: Flag = Field(default=False, title="certificates")
    """Prove the stability of every point in ball arithmetic, where that is possible, and mark it."""
    exponents: Flag = False
    """Store all characteristic exponents, not only the growth rate."""
    tolerance: Tolerance = 1e-9
    """Error of the multipliers, for waves that are not piecewise constant (1)."""
    block: Annotated[int | str, BeforeValidator(_deflection_type)] | None = None
    """Restrict the system to one type of mesh deflection, of a system with cyclic symmetry: T = 0, 1, 2, ... or its
    name; default all."""
    frequencies: Annotated[str, Choice("way", ("auto", "common_period", "per_mesh", "lyapunov"))] = Field(
        default="auto", title="many mesh frequencies"
    )
    """common_period: exact; per_mesh: one frequency at a time, the others at their mean; lyapunov: largest Lyapunov
    exponent with a confidence interval; auto: exact while affordable."""
    affordable_segments: Annotated[int, Field(ge=1, le=10_000_000), Whole] = 20_000
    """A common period of more segments is not the automatic choice."""
    lyapunov: LyapunovOptions = LyapunovOptions()
    """How Lyapunov exponents are estimated."""


class Floquet(Restricted):
    """Floquet multipliers of a system, or of some of its modes, by the strategy for its mesh frequencies."""

    name = "floquet"
    reused = True
    Options = FloquetOptions
    supports = ANY_LINEAR | {Feature.UNSYMMETRIC_DAMPING, Feature.ROTATION}
    flag_notes: ClassVar[Mapping[str, str]] = {
        "not_converged": "the error estimate exceeds the tolerance at {points}; see error_estimate",
        "undecided": "the stability is undecided at {points}: the confidence interval contains zero",
    }

    @classmethod
    def on(cls, options: Any, system: GearSystem) -> Method:
        return (Orbits if system.formulations else cls)(options, system)

    @classmethod
    def whole(cls, options: FloquetOptions | None, system: GearSystem) -> Floquet:
        """Return the analysis of all modes of a system, with the growth rate alone, by the options of a sweep."""
        plain = {"modes": None, "block": None, "exponents": False, "certificate": False}
        return cls((options or FloquetOptions()).model_copy(update=plain), system)

    @cached_property
    def basis(self) -> Array | None:
        """Return the subspace to which the options restrict the system, None where they do not. Raises NotPossible."""
        if self.options.block is None:
            return super().basis
        from gearstab.floquet.truncation import type_basis

        return type_basis(self.system, self.options.block)

    @property
    def kept(self) -> str:
        """Return the modes that are kept, in words, where some are left out."""
        return super().kept if self.options.block is None else f"type {self.options.block}"

    @cached_property
    def strategy(self) -> Strategy:
        """Return the strategy for several mesh frequencies. Raises NotPossible."""
        from gearstab.floquet.frequencies import chosen

        options = self.options
        return chosen(self.part, options.frequencies, options.affordable_segments, options.lyapunov.cycles)

    @property
    def parallel(self) -> bool:
        return not self.options.certificate and self.strategy.name != "lyapunov"

    def variables(self) -> tuple[Variable, ...]:
        from gearstab.floquet import STATUS_FLAGS
        from gearstab.floquet.dispatch import exact

        more: tuple[Variable, ...] = EXPONENTS if self.options.exponents else ()
        # An interval says more of a Lyapunov exponent, and the error of the steps is part of it.
        estimate = () if exact(self.part) or self.strategy.name == "lyapunov" else (ERROR_ESTIMATE,)
        by_strategy = {"per_mesh": BY_MESH, "lyapunov": INTERVAL}.get(self.strategy.name, ())
        certified = (CERTIFIED,) if self.options.certificate else ()
        return (*flagged(FLOQUET, STATUS_FLAGS), *estimate, *more, *by_strategy, *certified)

    def constants(self) -> Mapping[str, Any]:
        numbers = {"exponent": np.arange(1, 2 * self.part.size + 1)} if self.options.exponents else {}
        meshes = {"mesh": [mesh.name for mesh in self.part.meshes]} if self.strategy.name == "per_mesh" else {}
        return numbers | meshes

    def run(self, mesh_frequency: Array) -> Outcome:
        from gearstab.floquet.frequencies import groups

        found = self.solved(mesh_frequency)
        # What is declared depends on the base system. Systems of other ratios, for which auto may choose another
        # strategy, have NaN for an estimate and for each mesh, and an interval of zero where they are exact.
        shape = found.growth_rate.shape
        none = np.broadcast_to(np.nan, shape)
        interval, by_mesh = found.interval, found.by_mesh
        of = [group.ratio for group in groups(self.part)]
        index = [of.index(mesh.frequency_ratio) for mesh in self.part.meshes]
        values = {
            "growth_rate": found.growth_rate, "stable": found.stable, "status": found.status,
            "error_estimate": none if found.error_estimate is None else found.error_estimate,
            "growth_rate_interval": np.broadcast_to(0.0, shape) if interval is None else interval,
            "growth_rate_mesh": np.broadcast_to(np.nan, (*shape, len(index))) if by_mesh is None
            else by_mesh[..., index],
        }  # fmt: skip
        if found.exponents is not None:
            values |= {"exponent_real": found.exponents.real, "exponent_imag": found.exponents.imag}
        if self.options.certificate:
            from gearstab.certificates.covering import verdicts

            proved = verdicts(self.system, self.system.operating_points(mesh_frequency))
            values["certified"] = (proved == found.stable).astype(np.int8)
        return Outcome(values)

    def solved(self, mesh_frequency: Array) -> FloquetStability:
        """Compute the stability of the part of the system by its strategy."""
        from gearstab.floquet import frequencies, solve

        def by_period(system: GearSystem, omega: Array) -> FloquetStability:
            return solve(system, omega, exponents=self.options.exponents, tolerance=self.options.tolerance)

        if self.strategy.name == "per_mesh":
            return frequencies.solve(self.part, mesh_frequency, by_period)
        if self.strategy.name == "lyapunov":
            from gearstab.floquet.frequencies import lyapunov  # takes as long to load as a small sweep to run

            asked = self.options.lyapunov
            return lyapunov.solve(self.part, mesh_frequency, asked.cycles, asked.confidence, asked.seed)
        return by_period(self.part, mesh_frequency)

    def cost(self) -> float:
        from gearstab.floquet.frequencies import apart

        if self.strategy.name == "per_mesh":
            return sum(self._exact_cost(system) for system, _ in apart(self.part))
        if self.strategy.name == "lyapunov":
            return min(max(1.0, VECTORS * self._segments() * self.part.size**2), MOST)
        return self._exact_cost(self.part) * (CERTIFICATE if self.options.certificate else 1.0)

    def _exact_cost(self, system: GearSystem) -> float:
        """Analyse a system with a common period."""
        from gearstab.floquet.dispatch import reduction

        return reduction(system).cost * (5 if self.options.exponents or system.damped else 1)

    def _segments(self) -> float:
        """In the window of a Lyapunov exponent."""
        from gearstab.floquet import frequencies
        from gearstab.floquet.frequencies import lyapunov
        from gearstab.floquet.smooth.steps import CF6_5

        cycles = lyapunov.length(self.part, self.options.lyapunov.cycles)
        if self.part.piecewise_constant:
            return frequencies.segments_a_cycle(self.part) * cycles
        return 2 * lyapunov.FEWEST_STEPS * CF6_5.exponentials * cycles * max(map(float, self.part.frequency_ratios))

    def report(self) -> Mapping[str, Any]:
        """Return what of the system was solved, and what that saved."""
        from gearstab.floquet.dispatch import reduction

        found = reduction(self.part)
        attributes: dict[str, Any] = {"reduction": found.text()}
        if self.strategy.several:
            attributes["frequencies_chosen"] = self.strategy.reason
        if np.isfinite(found.saving) and found.saving > 1:
            attributes["reduction_saving"] = found.saving
        return attributes | self.restriction()

    def check_options(self) -> None:
        options = self.options
        if options.modes is not None and options.block is not None:
            raise OptionError(("modes",), "cannot be combined with block: both restrict the modes", "give one of them")
        self.check_modes()
        if options.certificate:
            check_certificate(
                self, next((name for name in ("modes", "block") if getattr(options, name) is not None), "")
            )
        try:
            _ = self.basis
        except NotPossible as error:
            raise OptionError(("block",), error.message, error.remedy) from None
        try:
            taken = self.strategy.name
        except NotPossible as error:
            raise OptionError(("frequencies",), error.message, error.remedy) from None
        if options.exponents and taken != "common_period":
            message = f"are not defined without a common period ({taken} was chosen)"
            remedy = "remove it, or choose frequencies: common_period" if self.system.commensurate else "remove it"
            raise OptionError(("exponents",), message, remedy)

    def note(self) -> str | None:
        """Explain an automatic choice of a strategy that is not the exact one."""
        if self.options.frequencies != "auto" or self.strategy.name == "common_period":
            return None
        return f"methods.floquet.frequencies: {self.strategy.reason}"

    def outlook(self) -> str | None:
        """Return the strategy, with the distinct states of a common period or the length of the window."""
        from gearstab.floquet.dispatch import exact, reduction

        if not self.strategy.several:
            return None
        if self.strategy.name == "common_period" and exact(self.part):
            states = max((part.states for part in reduction(self.part).parts), default=1)
            return f"{self.strategy.reason}, {states} distinct states"
        if self.strategy.name == "lyapunov":
            what = "segments" if self.part.piecewise_constant else "exponentials of Magnus steps or more"
            window = f"a window of {self.options.lyapunov.cycles:,g} cycles of the slowest mesh"
            return f"{self.strategy.reason}; {window}, {self._segments():,.0f} {what}"
        return self.strategy.reason


class Orbits(Floquet):
    """Analyse the stability of periodic orbits of a pair in its nonlinear formulations.

    A pair in any formulation has the same variables, so that a sweep can put the formulations side by side.
    """

    system: RotatingPair
    supports = ANY_LINEAR | {Feature.FOLLOWS_ROTATION}

    def variables(self) -> tuple[Variable, ...]:
        from gearstab.floquet import STATUS_FLAGS
        from gearstab.response.rotating_pair.stability import FLAGS

        return (*flagged(super().variables(), {**STATUS_FLAGS, **FLAGS}), *ORBITS)

    def run(self, mesh_frequency: Array) -> Outcome:
        if not self.system.is_classical:
            return self._orbits(mesh_frequency)
        found = super().run(mesh_frequency)
        nothing = np.broadcast_to(np.nan, found.values["growth_rate"].shape)
        return replace(found, values={**found.values, **{v.name: nothing for v in ORBITS}})

    def _orbits(self, mesh_frequency: Array) -> Outcome:
        from gearstab.response.rotating_pair.stability import stability

        found = stability(self.system, mesh_frequency)
        unit = np.ravel(np.broadcast_to(self.system.numbers.k0, self.system.batch))[:, None]
        values = {
            "growth_rate": found.growth_rate, "stable": found.stable, "status": found.status,
            "speed_exponent": found.speed_exponent, "holding_torque": found.drive * unit,
        }  # fmt: skip
        if self.options.exponents:
            values |= {"exponent_real": found.exponents.real, "exponent_imag": found.exponents.imag}
        if self.options.certificate:
            values["certified"] = np.zeros(found.stable.shape, dtype=np.int8)
        return Outcome(values)

    def cost(self) -> float:
        return super().cost() if self.system.is_classical else ORBIT

    def report(self) -> Mapping[str, Any]:
        if self.system.is_classical:
            return super().report()
        return {"orbits": "periodic orbits of the mean mesh frequency, held by an unbalanced torque where damping asks"}

    def check_options(self) -> None:
        for name in ("modes", "block"):
            if not self.system.is_classical and getattr(self.options, name) is not None:
                raise OptionError((name,), "a periodic orbit has no modes to choose from", "remove it")
        super().check_options()
