"""The common period of everything that varies: what it consists of, and segments that stand for it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

from gearstab.floquet.segments.pattern import Pattern, prepare, window
from gearstab.support import ONLY_MESHES, unsupported
from gearstab.system import GearSystem
from gearstab.waveforms import Profile

AFFORDABLE = 20_000
"""Segments of a common period up to which it is the automatic choice: some 7 ms per point of 12 coordinates."""
EXPONENTIALS = 40
"""A period of a smooth function takes about eight Magnus steps of five exponentials, each a segment of its own."""
SAMPLE = 50
"""Periods of the slowest mesh that stand for a system without an affordable common period."""


@dataclass(frozen=True)
class Period:
    """What a common period consists of.

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
