"""Meshes of many frequencies: the common period and its cost, one mesh frequency at a time, and the choice ``auto``.

One mesh frequency at a time is Floquet analysis with all other meshes at their mean stiffness. Meshes of the same
frequency vary together; whatever varies with another frequency keeps its mean. The growth rate is the largest of all
frequencies, and the system counts as stable where it is so for each. Exact where a single frequency varies. Neglected
is what two frequencies do together: tongues of one move by O(epsilon^2) with the other, and where tongues of two meet,
their growths add up in first order.

Lyapunov exponents, which need neither, are in :mod:`~gearstab.floquet.frequencies.lyapunov`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np

from gearstab.errors import NotPossible
from gearstab.floquet.segments.pattern import Pattern, prepare, window
from gearstab.floquet.stability import STATUS_FLAGS, FloquetStability
from gearstab.mesh import Mesh, PeriodicTerm
from gearstab.system import ONLY_MESHES, Array, GearSystem, unsupported
from gearstab.waveforms import Profile

COMMON_PERIOD, PER_MESH, LYAPUNOV = "common_period", "per_mesh", "lyapunov"
STRATEGIES = (COMMON_PERIOD, PER_MESH, LYAPUNOV)

AFFORDABLE = 20_000
"""Segments of a common period up to which it is the automatic choice: some 7 ms per point of 12 coordinates."""
EXPONENTIALS = 40
"""A period of a smooth function takes about eight Magnus steps of five exponentials, each a segment of its own."""
SAMPLE = 50
"""Periods of the slowest mesh that stand for a system without an affordable common period."""


@dataclass(frozen=True)
class Period:
    """Parts of a common period.

    cycles: N, it is N 2 pi/Omega. mesh_cycles: of each mesh. segments: of constant stiffness, at most; about as many
    exponentials where it is smooth.
    """

    cycles: float
    mesh_cycles: tuple[int, ...]
    segments: int


def common_period(system: GearSystem) -> Period | None:
    """The common period of all that varies, without building it; None where there is none."""
    if not system.commensurate:
        return None
    cycles, counts = system.common_period()
    return Period(float(cycles), counts, round(float(cycles) * segments_a_cycle(system)))


def segments_a_cycle(system: GearSystem) -> float:
    """Return the mean number of segments in 2 pi/Omega, an upper bound; of smooth functions roughly."""
    breaks = [_pieces(mesh.waveform) for mesh in system.meshes]
    breaks += [sum(_pieces(profile) for profile in term.profiles) for term in system.terms]
    return sum(float(ratio) * max(1, b) for ratio, b in zip(system.frequency_ratios, breaks, strict=True))


def _pieces(profile: Profile) -> int:
    """Segments a period of a function."""
    return int(profile.breakpoints().shape[-1]) + (0 if profile.piecewise_constant else EXPONENTIALS)


def exact_pattern(system: GearSystem) -> Pattern | None:
    """Return the segments of the common period of a single system; None where they are too many, or not exact."""
    period = common_period(system)
    if period is None or period.segments > AFFORDABLE or not system.piecewise_constant:
        return None
    return None if unsupported(system, ONLY_MESHES) else prepare(system)[0]


def sample(system: GearSystem) -> Pattern:
    """The mesh stiffness of a single system over its common period or, where there is no affordable one, a window."""
    if (pattern := exact_pattern(system)) is not None:
        return pattern
    if system.piecewise_constant:
        return window(system, SAMPLE / min(float(ratio) for ratio in system.frequency_ratios))[0]
    from gearstab.floquet.smooth import periods

    period = common_period(system)
    if period is None or period.segments > AFFORDABLE:
        # What couples to what depends on which meshes vary alike, not on how fast.
        simple = {ratio: Fraction(1, k + 1) for k, ratio in enumerate(dict.fromkeys(system.frequency_ratios))}
        meshes = tuple(replace(mesh, frequency_ratio=simple[mesh.frequency_ratio]) for mesh in system.meshes)
        system = replace(system, meshes=meshes)
    return next(periods(system))[0]


@dataclass(frozen=True)
class Strategy:
    """The strategy for the mesh frequencies of a system, and what it was chosen for.

    name: one of STRATEGIES. automatic: whether ``auto`` took it. period: None where there is none; affordable: the
    segments up to which it was to be the automatic choice.
    """

    system: GearSystem
    name: str
    automatic: bool
    period: Period | None
    affordable: int

    @property
    def several(self) -> bool:
        """Whether there is more than one frequency, and so anything to choose."""
        return len(set(self.system.frequency_ratios)) > 1

    @cached_property
    def reason(self) -> str:
        """The strategy and why it was taken, in a line, for instance "lyapunov (no common period)"."""
        if self.automatic and self.name == PER_MESH and varying(self.system) < 2:
            return f"{self.name} (a single mesh frequency varies)"
        if self.period is None:
            return f"{self.name} (the mesh frequencies have no common period)"
        cycles = " + ".join(f"{count:,}" for count in dict.fromkeys(self.period.mesh_cycles))
        # Jumps of several meshes may coincide; they are counted where that takes no time.
        pattern = exact_pattern(self.system)
        segments = self.period.segments if pattern is None else len(pattern.states)
        stepped = not self.system.piecewise_constant
        parts = f"some {segments:,} exponentials of Magnus steps" if stepped else f"{segments:,} segments"
        what = f"a common period of {cycles} mesh cycles with {parts}"
        limit = f", more than {self.affordable:,}" if self.automatic and self.name != COMMON_PERIOD else ""
        return f"{self.name} ({what}{limit})"


def chosen(system: GearSystem, asked: str, affordable: int = AFFORDABLE, cycles: float = 500) -> Strategy:
    """Choose the strategy where ``asked`` is one of STRATEGIES or ``auto``.

    ``auto`` is the common period while it has at most ``affordable`` segments; else one frequency at a time where only
    one varies, which is exact, or where there are other periodic terms; else the Lyapunov exponent, unless its window
    of ``cycles`` of the slowest mesh is no shorter than the common period: it would take longer and say less. Raises
    NotPossible where there is no such strategy.
    """
    period = common_period(system)
    if asked == COMMON_PERIOD and period is None:
        raise NotPossible("mesh frequencies of irrational ratio have no common period", "choose per_mesh or lyapunov")
    if (refused := unsupported(system, ONLY_MESHES)) and asked == LYAPUNOV:
        raise NotPossible(f"{LYAPUNOV} {refused[0]}", "choose per_mesh")
    name = asked
    if asked == "auto" and period is not None and period.segments <= affordable:
        name = COMMON_PERIOD
    elif asked == "auto":
        from gearstab.floquet.frequencies.lyapunov import length

        name = PER_MESH if refused or varying(system) < 2 else LYAPUNOV
        if name == LYAPUNOV and period is not None and period.cycles <= length(system, cycles):
            name = COMMON_PERIOD
    return Strategy(system, name, asked == "auto", period, affordable)


def varying(system: GearSystem) -> int:
    """Count the frequencies with which anything varies."""
    moving = [mesh.frequency_ratio for mesh in system.meshes if np.any(mesh.epsilon)]
    return len(set(moving + [term.frequency_ratio for term in system.terms]))


@dataclass(frozen=True)
class FrequencyGroup:
    """Group of meshes with one frequency: names of its meshes, joined by ``+``, and Omega_i/Omega."""

    name: str
    ratio: Fraction | float


def solve(
    system: GearSystem, mesh_frequency: Array, solver: Callable[[GearSystem, Array], FloquetStability]
) -> FloquetStability:
    """Stability of every row of a system at every mesh frequency of the first mesh.

    Parameters
    ----------
    system: any batch shape.
    mesh_frequency: Omega, ``(P,)`` for all rows or ``(rows, P)``.
    solver: what solves a system of one mesh frequency, for instance :func:`gearstab.floquet.solve`.
    """
    omega = np.asarray(mesh_frequency, dtype=float)
    found = [solver(one, ratio * omega) for one, ratio in apart(system)]
    by_mesh = np.stack([one.growth_rate for one in found], axis=-1)
    moves = np.stack([varies(system, group) for group in groups(system)], axis=-1)
    # What does not vary in a row tells only how a constant system decays; where nothing varies that is the answer.
    moves |= ~moves.any(axis=-1, keepdims=True)
    growth = np.where(moves[:, None], by_mesh, -np.inf).max(axis=-1)
    stable = np.min([np.where(moves[:, [k]], one.stable, 1) for k, one in enumerate(found)], axis=0)
    status = np.bitwise_or.reduce([one.status for one in found]) | np.int16(STATUS_FLAGS["per_mesh"])
    errors = [one.error_estimate for one in found if one.error_estimate is not None]
    error = np.max(errors, axis=0) if errors else None
    return FloquetStability(growth, stable.astype(np.int8), status, by_mesh=by_mesh, error_estimate=error)


def groups(system: GearSystem) -> tuple[FrequencyGroup, ...]:
    """One per mesh frequency, in the order of the meshes, then of the terms."""
    parts: list[Mesh | PeriodicTerm] = [*system.meshes, *system.terms]
    names: dict[Fraction | float, list[str]] = {}
    for part in parts:
        names.setdefault(part.frequency_ratio, []).append(part.name)
    meshes = {mesh.name for mesh in system.meshes}
    # A term is named only where no mesh has its frequency.
    return tuple(
        FrequencyGroup("+".join([n for n in own if n in meshes] or own), ratio) for ratio, own in names.items()
    )


def varies(system: GearSystem, group: FrequencyGroup) -> Array:
    """``(rows,)``: whether anything varies with the frequency of a group."""
    found = np.full(system.batch, any(term.frequency_ratio == group.ratio for term in system.terms))
    for mesh in system.meshes:
        if mesh.frequency_ratio == group.ratio:
            low, high = mesh.waveform.extremes()
            found = found | (np.asarray(mesh.epsilon) * (high - low) != 0)
    return np.broadcast_to(found, system.batch).reshape(-1)


def apart(system: GearSystem) -> Iterator[tuple[GearSystem, float]]:
    """The system with each of its groups varying alone, and Omega_i/Omega of that group."""
    whole = system.over(system.batch)
    for group in groups(system):
        yield alone(whole, group), float(group.ratio)


def alone(system: GearSystem, group: FrequencyGroup) -> GearSystem:
    """The system in which only one group varies. Its frequency is Omega, so that the system always has a period."""
    system, one = system.averaged(group.ratio), Fraction(1)
    meshes = tuple(replace(mesh, frequency_ratio=one) for mesh in system.meshes)
    return replace(system, meshes=meshes, terms=tuple(replace(term, frequency_ratio=one) for term in system.terms))
