"""All branches of periodic motions that starts lead to: isolated ones, and those that leave others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gearstab.response.backlash.continuation import CLOSED, DOUBLING, FOLD, Point
from gearstab.response.backlash.history import repetition
from gearstab.response.backlash.motions import BRANCH_FLAGS, BY_MESH, KINDS, Branch
from gearstab.response.backlash.switching import Branches, leaving
from gearstab.system import Array

BEYOND = 2e-3
"""Part of the range by which the speed goes past the end of stable motions, to see what follows."""
FAR = 3.0
"""Extent of random initial states, in units of the state."""


@dataclass(frozen=True)
class Starts:
    """Where motions are looked for, and how.

    values: of the parameter.
    kinds: what is tried at each. linear: Newton's method from the static equilibrium, which finds the linear steady
        state at once if no contact is lost on the way; rest, random: what the static equilibrium, or so many random
        ``states``, settle to.
    cycles: of the first mesh, that a motion is given to settle.  seed: of the random states.
    """

    values: tuple[float, ...]
    kinds: tuple[str, ...] = ("rest",)
    states: int = 1
    cycles: float = 200
    seed: int = 0


class BranchSearch(Branches):
    """The branches of one system over its mesh frequency, or the parameter of its section map."""

    def run(self, starts: Starts) -> list[Branch]:
        """Follow the branch of every start that is on none that is known, and what leaves it."""
        for value, x, periods in self._settled(starts):
            try:
                point = self.curve(periods).at(x, value)
            except ArithmeticError:
                continue
            self._lead(point, periods)
        for number, branch in enumerate(self.found):
            for k in range(len(branch.motions)):
                sign, beyond = self._ends(number, k)
                if sign:
                    value = branch.motions[k].parameter
                    self.jumps[number, k] = sign, self._landing(beyond, value, sign, starts.cycles)
        return self.found

    def _lead(self, point: Point, periods: int) -> tuple[int, int] | None:
        """Where a motion is, as in :meth:`place`, on a branch that is followed now if it is on none that is known."""
        place = self.place(point, periods)
        if place is None and self.room():
            self.add(self._both_ways(point, periods))
            place = self.place(point, periods)
        return place

    def _count(self, value: float, cycles: float) -> int:
        """Common periods in so many cycles of the first mesh."""
        return max(2, int(np.ceil(cycles / self.laps.at(value).model.motion.drive.counts[0])))

    def _settled(self, starts: Starts) -> Iterator[tuple[float, Array, int]]:
        """Mesh frequencies, states and common periods of motions that have come to repeat themselves."""
        random = np.random.default_rng(starts.seed)
        for value in starts.values:
            equilibrium = self.laps.at(value).rest()
            count = self._count(value, starts.cycles)
            for kind in (k for k in starts.kinds for _ in range(starts.states if k == "random" else 1)):
                x = equilibrium
                if kind == "random":
                    x = x + FAR * self.unit * random.uniform(-1, 1, len(x))
                try:
                    lap = self.laps.lap(x, value, 1 if kind == "linear" else count)
                except ArithmeticError:
                    continue
                if kind != "random" and not self.found:
                    self.unit = float(np.abs(lap.sections()[count // 2 * (kind != "linear") :]).max(initial=0.0)) or 1.0
                if kind == "linear":
                    yield value, x, 1
                    continue
                periods, _ = repetition(lap.sections())
                if periods:
                    yield value, lap.end, periods

    def _both_ways(self, start: Point, periods: int) -> Branch:
        down, first = self.one_way(start, np.append(np.zeros(len(start.x)), -1.0), periods, 1)
        if first == CLOSED:
            return Branch((self.motion(start), *down), periods, (first, first))
        up, last = self.one_way(start, np.append(np.zeros(len(start.x)), 1.0), periods, 1 + len(down))
        return Branch((*reversed(down), self.motion(start), *up), periods, (first, last))

    def add(self, branch: Branch) -> None:
        """Take a branch, and what leaves it if that is asked for."""
        self.found.append(branch)
        for further in leaving(self, len(self.found) - 1):
            self.add(further)

    def _ends(self, number: int, k: int) -> tuple[int, Array]:
        """Whether a stable motion ends at a motion of a branch: 1 if in rising speed, -1 if in falling, else 0.

        At a fold it does; at a period doubling if the doubled motion is unstable. And a state to go on from: of a
        doubled motion, as a small deviation would take its time to grow.
        """
        motions = self.found[number].motions
        here = motions[k]
        if here.kind not in (FOLD, DOUBLING) or not 0 < k < len(motions) - 1:
            return 0, here.x
        before, after = motions[k - 1], motions[k + 1]
        if before.stability.stable == after.stability.stable:
            return 0, here.x
        stable, x = before if before.stability.stable else after, here.x
        if here.kind == DOUBLING:
            doubled = [b.motions[min(2, len(b.motions) - 1)] for b in self.found if (b.parent, b.leaves) == (number, k)]
            if not doubled or doubled[0].stability.stable:
                return 0, x
            x = doubled[0].x
        return 1 if stable.parameter < here.parameter else -1, x

    def _landing(self, x: Array, parameter: float, sign: int, cycles: float) -> tuple[int, int] | None:
        """Where the motion goes from a state beyond the end of stable ones; its branch may be a new one."""
        value = parameter + sign * BEYOND * self.span
        if not self.limits.low <= value <= self.limits.high:
            return None
        try:
            lap = self.laps.lap(x * (1 + BEYOND), value, self._count(value, cycles))
            periods, _ = repetition(lap.sections())
            return self._lead(self.curve(periods).at(lap.end, value), periods) if periods else None
        except ArithmeticError:
            return None


def table(search: BranchSearch, count: int, points: int, multipliers: int, meshes: int) -> dict[str, Array]:
    """Arrange what was found of a system of so many meshes, by variable, in so many rows (B) at least.

    Each branch is filled up to ``points`` (N), and has columns for so many multipliers. mesh_frequency ``(B, N)``: or
    the value of the parameter that was followed. period, parent: ``(B,)``. amplitude_rms, amplitude_peak: ``(B, N)``,
    of the mesh where each is largest. Those of BY_MESH: ``(B, N, meshes)``. jump: ``(B, N)``, 1 where a stable motion
    ends in rising speed, -1 in falling; landing_branch, landing_point: where the motion is next to the one that
    follows, -1 for nowhere. status: ``(B, N)``, bits of BRANCH_FLAGS.
    """
    shape = max(count, len(search.found)), points
    found: dict[str, Array] = {name: np.full(shape, np.nan) for name in (
        "mesh_frequency", "amplitude_rms", "amplitude_peak", "multiplier_error", "residual")}  # fmt: skip
    found |= {name: np.full(shape, -1) for name in ("stable", "landing_branch", "landing_point")}
    found |= {name: np.zeros(shape, dtype=int) for name in ("event", "multiplicity", "loss", "jump", "status")}
    found |= {name: np.full((*shape, meshes), np.nan) for name in BY_MESH}
    found["multipliers"] = np.full((*shape, multipliers), np.nan, dtype=complex)
    found |= {"period": np.zeros(shape[0], dtype=int), "parent": np.full(shape[0], -1)}
    cycles = round(search.laps.at(search.limits.low).model.motion.drive.counts[0])
    for number, branch in enumerate(search.found):
        found["period"][number], found["parent"][number] = branch.periods * cycles, branch.parent
        _enter({name: values[number] for name, values in found.items()}, branch)
    for place, (sign, landing) in search.jumps.items():
        found["jump"][place] = sign
        if landing is not None:
            found["landing_branch"][place], found["landing_point"][place] = landing
    return found


def _enter(row: dict[str, Array], branch: Branch) -> None:
    """Write the motions of a branch into its row."""
    for k, motion in enumerate(branch.motions):
        own = motion.stability
        row["mesh_frequency"][k], row["event"][k], row["multiplicity"][k] = (
            motion.parameter, KINDS[motion.kind], motion.multiplicity,
        )  # fmt: skip
        row["stable"][k], row["loss"][k] = own.stable, own.loss
        row["multiplier_error"][k], row["residual"][k] = own.error, own.residual
        row["multipliers"][k, : len(own.multipliers)] = own.multipliers
        row["amplitude_rms"][k], row["amplitude_peak"][k] = motion.cycle.rms.max(), motion.cycle.peak.max()
        row["status"][k] = BRANCH_FLAGS["grazing"] * motion.grazing
        for name, measure in BY_MESH.items():
            row[name][k] = getattr(motion.cycle, measure)
    row["status"][0] |= BRANCH_FLAGS[branch.ends[0]]
    row["status"][len(branch.motions) - 1] |= BRANCH_FLAGS[branch.ends[1]]
