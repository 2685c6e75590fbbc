"""Facts about several mesh frequencies: the common period, the way exact stability takes, weak teeth."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gearstab.info.tables import meshes_text, table

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


NEXT = 3
"""Sidebands of a mesh harmonic that are told on each side."""


def faults(system: GearSystem, orders: float | None) -> list[dict[str, Any]]:
    """Describe the weak teeth. orders: cycles of a mesh of frequency ratio 1 per turn of the input.

    period: after how many cycles of the first mesh the weak pair carries again, exact. order: of its shaft, relative to
    what the mesh is fixed in, per turn of the input. sidebands: beside the first harmonic of the mesh, with the
    amplitude of its stiffness over the mean of the mesh.
    """
    import numpy as np

    known = {mesh.name: mesh for mesh in system.meshes}
    found = []
    for part in system.meshes:
        if not part.part_of:
            continue
        whole = known[part.part_of]
        teeth = round(whole.frequency_ratio / part.frequency_ratio)
        lines = []
        for n in (side for side in range(-NEXT, NEXT + 1) if side and teeth + side > 0):
            amplitude = 2 * float(part.amplitude) * float(np.hypot(*part.waveform.fourier(teeth + n)))
            ratio = float(whole.frequency_ratio + n * part.frequency_ratio)
            order = None if orders is None else orders * ratio
            lines.append({"side": n, "order": order, "amplitude": amplitude / float(whole.mean_stiffness)})
        found.append({
            "name": part.name, "mesh": part.part_of, "period": str(1 / part.frequency_ratio),
            "order": None if orders is None else orders * float(part.frequency_ratio),
            "lost_stiffness": -float(part.mean_stiffness + 2 * part.amplitude * part.waveform.extremes()[0]),
            "lost_mean": -float(part.mean_stiffness), "sidebands": lines,
        })  # fmt: skip
    return found


def weak_teeth(found: list[dict[str, Any]]) -> str:
    """A table of weak teeth."""
    header = ["weak tooth", "period (cycles of the first mesh)", "shaft order", "lost at most", "lost in the mean"]
    rows = []
    for item in found:
        order = "-" if item["order"] is None else f"{item['order']:.6g}"
        rows.append([item["name"], item["period"], order, f"{item['lost_stiffness']:.6g}", f"{item['lost_mean']:.6g}"])
    lines = [table(header, rows)]
    for item in found:
        sides = ", ".join(map(_side, item["sidebands"]))
        lines.append(f"{item['name']}: stiffness beside the mesh frequency, of the mean: {sides}")
    return "\n".join(lines)


def _side(line: dict[str, Any]) -> str:
    order = "" if line["order"] is None else f" (order {line['order']:.6g})"
    return f"{line['side']:+d} shaft{order} {100 * line['amplitude']:.2g} %"


def text(period: dict[str, Any] | None) -> str:
    """A common period in a line."""
    if period is None:
        return "none: a mesh frequency has an irrational ratio"
    alike: dict[int, list[str]] = {}
    for name, count in period["mesh_cycles"].items():
        alike.setdefault(count, []).append(name)
    cycles = ", ".join(f"{count} of {meshes_text(names)}" for count, names in alike.items())
    segments, count = period["segments"], period["distinct_stiffness_states"]
    states = "" if count is None else f", {count} distinct stiffness states"
    parts = "not piecewise constant" if segments is None else f"{segments} segments{states}"
    return f"{period['in_periods_of_omega']:.6g} x 2 pi/Omega ({cycles}); {parts}"
