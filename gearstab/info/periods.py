"""What ``gearstab info`` says of several mesh frequencies: the common period and the way exact stability takes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gearstab.config import Config
    from gearstab.system import GearSystem


def common_period(system: GearSystem) -> dict[str, Any] | None:
    """Describe the common period of all meshes; None where there is none."""
    from gearstab.floquet.frequencies import period as periods

    period = periods.common_period(system)
    if period is None:
        return None
    segments, states = (period.segments if system.piecewise_constant else None), None
    if (pattern := periods.exact_pattern(system)) is not None:
        segments, states = len(pattern.states), pattern.stiffness.shape[1]
    return {
        "in_periods_of_omega": period.cycles,
        "mesh_cycles": {mesh.name: n for mesh, n in zip(system.meshes, period.mesh_cycles, strict=False)},
        "segments": segments,
        "distinct_stiffness_states": states,
    }


def frequencies(config: Config, system: GearSystem) -> dict[str, Any] | None:
    """Return the strategy of exact stability for several mesh frequencies; None for a single one."""
    from gearstab.methods.floquet import Floquet

    if len(set(system.frequency_ratios)) < 2:
        return None
    return {"chosen": Floquet.whole(config.methods.floquet, system).outlook()}


def text(period: dict[str, Any] | None) -> str:
    """A common period in a line."""
    if period is None:
        return "none: a mesh frequency has an irrational ratio"
    cycles = ", ".join(f"{count} of {name}" for name, count in period["mesh_cycles"].items())
    segments, count = period["segments"], period["distinct_stiffness_states"]
    states = "" if count is None else f", {count} distinct stiffness states"
    parts = "not piecewise constant" if segments is None else f"{segments} segments{states}"
    return f"{period['in_periods_of_omega']:.6g} x 2 pi/Omega ({cycles}); {parts}"
