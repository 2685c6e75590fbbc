"""The section map of motions with backlash: the elastic state from one common period to a later one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from gearstab.floquet.kernel import c_kernel as kernel
from gearstab.propagation.first_order import bases
from gearstab.response.backlash.dynamics import TOLERANCE, Dynamics, dynamics, play, resting
from gearstab.response.backlash.follow import Chatter, ContactCourse, Contacts, Track, follow
from gearstab.response.backlash.history import LimitCycle, Meter, elastic, factors
from gearstab.response.steady import Driven, balanced, driven
from gearstab.system import Array, GearSystem

ROUNDING = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Lap:
    """A motion from the elastic state ``start (m,)`` over some common periods to ``end``.

    elastic: which states of the model are;  basis: ``(m, m)``, such ones of it from those of the map.
    """

    model: Dynamics
    periods: int
    start: Array
    end: Array
    track: Track
    elastic: Array
    basis: Array

    @cached_property
    def factors(self) -> Array:
        """``(F, m, m)``, whose product is the derivative."""
        own = factors(self.model, self.track, self.elastic)
        return np.concatenate([self.basis[None], own, np.linalg.inv(self.basis)[None]])

    @cached_property
    def derivative(self) -> Array:
        """``(m, m)``, of the end with respect to the start."""
        found = np.eye(len(self.start))
        for factor in self.factors:
            found = factor @ found
        return found

    @cached_property
    def multipliers(self) -> Array:
        """``(m,)`` complex, of descending magnitude, the smallest as exact as the largest."""
        logs = kernel.graded([factor[None] for factor in self.factors])[0]
        found = np.exp(logs)
        # exp(i pi) is real but for rounding.
        found.imag[np.abs(found.imag) <= 4 * ROUNDING * np.abs(found)] = 0.0
        return np.asarray(found[np.argsort(-np.abs(found), kind="stable")])

    def sections(self) -> Array:
        """``(periods + 1, m)``, the elastic states at the beginnings of the common periods and at the end."""
        begins = np.flatnonzero(np.diff(self.track.period, prepend=-1))
        own = self.track.powers[begins, 0, : self.model.size][:, self.elastic]
        return np.concatenate([np.linalg.solve(self.basis, own.T).T, self.end[None]])

    @property
    def grazing(self) -> bool:
        """Whether a flank is hardly touched, or hardly missed."""
        return bool(self.track.grazing.any())

    @cached_property
    def cycle(self) -> LimitCycle:
        """Extremes and means of the motion."""
        until = self.periods * self.model.motion.period
        meter = Meter(self.model, 0.0, until)
        meter.add(self.track)
        found = meter.summary(self.periods)
        assert found is not None
        return found

    def multiplier_error(self, following: Lap) -> float:
        """Estimate the error of the multipliers, the largest of all, by the lap that begins where this one ends.

        The difference of both derivatives, for a motion that is not quite periodic, and rounding errors of the product,
        each times the condition of the eigenvalue.
        """
        _, vectors = np.linalg.eig(self.derivative)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            condition = np.linalg.cond(vectors)
        own = ROUNDING if self.model.motion.drive.exact else TOLERANCE
        rounding = own * len(self.factors) * max(1.0, float(np.linalg.norm(self.derivative)))
        difference = float(np.linalg.norm(following.derivative - self.derivative))
        return float(condition * (rounding + difference))


@dataclass(frozen=True)
class Prepared:
    """A system at a value of the parameter.

    system: without the part of its load that accelerates the train;  course: of its motions.
    elastic: which states are.  basis: ``(m, m)``, elastic states of it from those of the whole map.
    """

    system: GearSystem
    course: ContactCourse
    elastic: Array
    basis: Array

    @property
    def model(self) -> Dynamics:
        """The equations of motion."""
        return self.course.dynamics

    def rest(self) -> Array:
        """The elastic state ``(m,)`` of the static equilibrium on the flanks, of the whole map."""
        q = resting(self.system, self.model.teeth)
        return self.state(q, np.zeros_like(q))

    def state(self, displacement: Array, velocity: Array) -> Array:
        """The elastic state of q and dq/dt ``(n,)``, of the whole map."""
        own = self.model.motion.state(displacement, velocity)[self.elastic]
        return np.asarray(np.linalg.solve(self.basis, own))

    def physical(self) -> tuple[Array, Array]:
        """q and dq/dt ``(m, n)`` of every elastic state of its own."""
        return self.model.motion.physical(np.eye(self.model.size)[self.elastic])


class SectionMap:
    """Laps of a single system at any mesh frequency, or at one while another parameter varies.

    States are elastic ones of the system itself, also where the modes change with the parameter. The part of a load
    that accelerates the train is left out.

    along: the system by the parameter, where that is not the mesh frequency, which then is ``omega``.
    """

    def __init__(
        self,
        system: GearSystem,
        along: Callable[[float], GearSystem] | None = None,
        omega: float = 1.0,
    ) -> None:
        self.along, self.omega = along, omega
        self.own, self.motion = self._driven(system)
        self.teeth = play(system)
        self.at = lru_cache(maxsize=4)(self._at)
        self._first: Prepared | None = None
        self._contacts: Contacts

    def _driven(self, system: GearSystem) -> tuple[GearSystem, Driven]:
        held = balanced(system, next(bases(system)))
        return held, driven(held, self.omega)

    def _at(self, parameter: float) -> Prepared:
        """The system at a value of the parameter."""
        if self.along is None:
            return self._at_speed(parameter)
        system, motion = self._driven(self.along(parameter))
        course = ContactCourse.of(dynamics(system, motion, play(system)))
        kept = elastic(course.dynamics)
        basis = np.column_stack([motion.state(*pair)[kept] for pair in zip(*self._reference.physical(), strict=True)])
        return Prepared(system, course, kept, basis)

    def _at_speed(self, omega: float) -> Prepared:
        """The system itself at a mesh frequency: of the first one that was asked for, if modes do not depend on it."""
        first = self._first
        if first is None or self.motion.whole.form.by_speed is not None:
            course = ContactCourse.of(dynamics(self.own, replace(self.motion, omega=omega), self.teeth))
            kept = elastic(course.dynamics)
            found = self._first = Prepared(self.own, course, kept, np.eye(int(np.count_nonzero(kept))))
        else:
            found = replace(first, course=first.course.at(omega, self._contacts))
        self._contacts = found.course.contacts
        return found

    @cached_property
    def _reference(self) -> Prepared:
        """The system itself, whose states are those of the map."""
        return SectionMap(self.own).at(self.omega)

    def lap(self, start: Array, parameter: float, periods: int = 1) -> Lap:
        """Follow the motion from the elastic state at the beginning of a common period.

        Raises ArithmeticError where it outgrows double precision, or impacts come too many or too close.
        """
        own = self.at(float(parameter))
        model, kept, basis = own.model, own.elastic, own.basis
        x = np.zeros(model.size)
        x[kept] = basis @ start
        tracks: list[Track] = []
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                for track in follow(own.course, x):
                    tracks.append(track)
                    if track.period[-1] >= periods:
                        break
        except Chatter as error:
            raise ArithmeticError("impacts come too many or too close") from error
        last = tracks[-1]
        until = int(np.argmax(last.period >= periods))
        end = np.linalg.solve(basis, last.powers[until, 0, : model.size][kept])
        return Lap(model, periods, start, end, Track.joined([*tracks[:-1], last[:until]]), kept, basis)
