"""What ``gearstab info`` says of several mesh frequencies: the common period and the way exact stability takes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gearstab.config import Config
    from gearstab.system import GearSystem


def common_period(system: GearSystem) -> dict[str, Any] | None:
    """Describe the common period of all meshes; None where there is none."""
    from gearstab.floquet.frequencies import choice
    from gearstab.floquet.segments.pattern import prepare

    period = choice.common_period(system)
    if period is None:
        return None
    segments, states = (period.segments if system.piecewise_constant else None), None
    if segments is not None and segments <= choice.AFFORDABLE and not system.terms:
        (pattern,) = prepare(system)
        segments, states = len(pattern.states), pattern.stiffness.shape[1]
    return {
        "in_periods_of_omega": period.cycles,
        "mesh_cycles": {mesh.name: n for mesh, n in zip(system.meshes, period.mesh_cycles, strict=False)},
        "segments": segments,
        "distinct_stiffness_states": states,
    }


def frequencies(config: Config, system: GearSystem) -> dict[str, Any] | None:
    """Return the strategy of exact stability for several mesh frequencies, and the seconds per point of a sweep on one
    processor, None where not one ends in time; None for a single mesh frequency.
    """
    import numpy as np

    from gearstab.methods.floquet import Floquet, FloquetOptions
    from gearstab.modal import mean_modes
    from gearstab.sweep.effort.estimate import seconds_per_point

    if len(set(system.frequency_ratios)) < 2:
        return None
    options = config.methods.floquet or FloquetOptions()
    whole = Floquet(options.model_copy(update={"modes": None, "block": None, "exponents": False}), system)
    # Where stability is most often asked for: about twice the highest natural frequency with a mesh deflection.
    middle = 2 * float(np.nanmax(mean_modes(system).natural_frequency))

    def points(count: int) -> object:
        return whole.solved(middle * np.linspace(0.5, 1.5, count + 2)[1:-1])

    return {"chosen": whole.outlook(), "seconds_per_point": seconds_per_point(points)}


def text(period: dict[str, Any] | None) -> str:
    """A common period in a line."""
    if period is None:
        return "none: a mesh frequency has an irrational ratio"
    cycles = ", ".join(f"{count} of {name}" for name, count in period["mesh_cycles"].items())
    segments, count = period["segments"], period["distinct_stiffness_states"]
    states = "" if count is None else f", {count} distinct stiffness states"
    parts = "not piecewise constant" if segments is None else f"{segments} segments{states}"
    return f"{period['in_periods_of_omega']:.6g} x 2 pi/Omega ({cycles}); {parts}"


def way(found: dict[str, Any]) -> str:
    """The way of exact stability in a line."""
    from gearstab.sweep.effort.words import duration

    seconds = found["seconds_per_point"]
    taken = "time not known" if seconds is None else duration(seconds)
    return f"{found['chosen']}; {taken} per point on one processor"
