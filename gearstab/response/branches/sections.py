"""The section map of motions with backlash: the elastic state from one common period to a later one."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache

import numpy as np

from gearstab.floquet.kernel import c_kernel as kernel
from gearstab.propagation.first_order import bases
from gearstab.response.backlash.contact import play
from gearstab.response.backlash.dynamics import Dynamics, dynamics
from gearstab.response.backlash.follow import Chatter, Timetable, Track, follow, timetable
from gearstab.response.backlash.measure import LimitCycle, Meter, elastic
from gearstab.response.branches.variation import factors
from gearstab.response.linear.driven import driven
from gearstab.response.linear.periodic import balanced
from gearstab.system import Array, GearSystem

ROUNDING = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Lap:
    """A motion from the elastic state ``start (m,)`` over some common periods to ``end``."""

    model: Dynamics
    periods: int
    start: Array
    end: Array
    track: Track
    tolerance: float

    @cached_property
    def factors(self) -> Array:
        """``(F, m, m)``, whose product is the derivative."""
        return factors(self.model, self.track)

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
        kept = elastic(self.model)
        return np.concatenate([self.track.powers[begins, 0, : self.model.size][:, kept], self.end[None]])

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
        own = ROUNDING if self.model.motion.drive.exact else self.tolerance
        rounding = own * len(self.factors) * max(1.0, float(np.linalg.norm(self.derivative)))
        difference = float(np.linalg.norm(following.derivative - self.derivative))
        return float(condition * (rounding + difference))


class SectionMap:
    """Laps of a single system at any mesh frequency; the part of a load that accelerates the train is left out.

    tolerance: of the motion where functions vary smoothly, relative, in a piece of it.
    """

    def __init__(self, system: GearSystem, tolerance: float = 1e-12) -> None:
        self.system, self.tolerance = system, tolerance
        self.teeth = play(system)
        self._motion = driven(balanced(system, next(bases(system))), 1.0)
        self.model = lru_cache(maxsize=4)(self._model)

    def _model(self, omega: float) -> tuple[Dynamics, Timetable, Array]:
        """The equations of motion at a mesh frequency, what varies in them, and which states are elastic."""
        motion = replace(self._motion, omega=omega)
        found = dynamics(self.system, motion, self.teeth)
        return found, timetable(found, self.tolerance), elastic(found)

    def lap(self, start: Array, omega: float, periods: int = 1) -> Lap:
        """Follow the motion from the elastic state at the beginning of a common period.

        Raises ArithmeticError where it outgrows double precision, or impacts come too many or too close.
        """
        model, table, kept = self.model(float(omega))
        x = np.zeros(model.size)
        x[kept] = start
        tracks: list[Track] = []
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                for track in follow(model, x, self.tolerance, table):
                    tracks.append(track)
                    if track.period[-1] >= periods:
                        break
        except Chatter as error:
            raise ArithmeticError("impacts come too many or too close") from error
        last = tracks[-1]
        until = int(np.argmax(last.period >= periods))
        end = last.powers[until, 0, : model.size][kept]
        return Lap(model, periods, start, end, joined([*tracks[:-1], last[:until]]), self.tolerance)

    def elastic(self, displacement: Array, velocity: Array, omega: float) -> Array:
        """The elastic state of q and dq/dt ``(n,)``."""
        model, _, kept = self.model(float(omega))
        return np.asarray(model.motion.state(displacement, velocity)[kept])


def joined(tracks: list[Track]) -> Track:
    """One track of several."""
    if len(tracks) == 1:
        return tracks[0]
    parts = {part.name: [getattr(track, part.name) for track in tracks] for part in fields(Track)}
    return Track(**{name: np.concatenate(values) for name, values in parts.items()})
