"""Facts about several frequencies: common period, weak teeth, and the mean system at speeds of rotation."""

from __future__ import annotations

from typing import Any

import numpy as np

from gearstab.config import Config
from gearstab.floquet import frequencies as periods
from gearstab.floquet.general.mean import mean_motions, whirl_motions
from gearstab.info import meshes_text, over, table, time_unit
from gearstab.methods.floquet import Floquet
from gearstab.system import GearSystem


def common_period(system: GearSystem) -> dict[str, Any] | None:
    """Describe the common period of all meshes; None where there is none."""
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


def period_text(period: dict[str, Any] | None) -> str:
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


SPEEDS = 65
"""Number of speeds of a range at which motions of the mean system are looked at."""
HALVINGS = 40
"""Halvings of a step between two of them, for the speed from which on one grows."""
SMALL = 1e-3
"""Value of 2 W/w_1 below which what acts with the speed W is negligible."""
SENSES = {1: "forward", -1: "backward", 0: "-"}


def rotation_facts(system: GearSystem, ends: list[float] | None) -> dict[str, Any] | None:
    """Return natural frequencies at both ends of a range of mesh frequencies, and where motions grow by themselves.

    None where no speed of rotation follows the mesh frequency, or no range is known.
    """
    ratios = [abs(float(rotation.speed_ratio)) for rotation in system.rotations if rotation.speed_ratio is not None]
    if not ratios or ends is None:
        return None
    speeds = np.linspace(ends[0], ends[1], SPEEDS) if ends[1] > ends[0] else np.array(ends[:1])
    found = whirl_motions(system, speeds)
    ascending = np.argsort(found.natural_frequency[0], kind="stable")
    grows = (found.growth_rate > 0).any(axis=1)
    changes = np.flatnonzero(np.diff(np.concatenate([[False], grows, [False]]).astype(int))).reshape(-1, 2)
    stretches = []
    for first, last in changes:
        low = speeds[0] if first == 0 else _onset(system, speeds[first - 1], speeds[first])
        high = None if last == len(speeds) else _onset(system, speeds[last], speeds[last - 1])
        fastest = np.unravel_index(np.argmax(found.growth_rate[first:last]), found.growth_rate[first:last].shape)
        at = first + int(fastest[0]), int(fastest[1])
        frequency = float(found.natural_frequency[at])
        stretches.append({
            "from": float(low), "to": high, "at_once": bool(first == 0),
            "kind": "flutter" if frequency > 0 else "divergence",
            "frequency": frequency, "growth_rate": float(found.growth_rate[at]),
        })  # fmt: skip
    elastic = found.natural_frequency[0][found.natural_frequency[0] > 0]
    return {
        "range": list(map(float, ends)),
        "natural_frequency": found.natural_frequency[[0, -1]][:, ascending].tolist(),
        "damping_ratio": [
            [None if z != z else z for z in row] for row in found.damping_ratio[[0, -1]][:, ascending].tolist()
        ],
        "whirl": found.whirl[[0, -1]][:, ascending].tolist(),
        "self_excited": stretches,
        "size": float(2 * max(ratios) * ends[1] / elastic.min()) if len(elastic) else None,
    }


def _onset(system: GearSystem, stable: float, growing: float) -> float:
    """The speed between two at which a motion of the mean system begins to grow."""
    for _ in range(HALVINGS):
        middle = 0.5 * (stable + growing)
        if mean_motions(system, middle).unstable.any():
            growing = middle
        else:
            stable = middle
    return float(growing)


def rotation_verdict(facts: dict[str, Any]) -> list[str]:
    """Return a line for each stretch of speeds at which the mean system grows by itself."""
    own, shown = facts["rotations"], facts["dangerous"].shown
    lines = []
    for part in own["self_excited"] if own else ():
        ends = [None if end is None else f"{end / shown.scale:.6g}" for end in (part["from"], part["to"])]
        where = f"from {ends[0]} to {ends[1]}" if ends[1] else f"{'from' if part['at_once'] else 'above'} {ends[0]}"
        rate = f"by up to {part['growth_rate']:.4g} e-folds per {time_unit(not facts['unit'])}"
        frequency = f"{over(part['frequency'], facts['per_unit']):.6g} {facts['unit']}".strip()
        how = f"flutter at {frequency}" if part["kind"] == "flutter" else "divergence"
        lines.append(
            f"SELF-EXCITED {where} {shown.unit}".rstrip() + f" ({shown.name}): {how}, {rate}, without any "
            "variation of the mesh stiffness."
        )
    return lines


def rotation_rows(
    own: dict[str, Any], ends: list[str], unit: str, per_unit: float = 1.0
) -> tuple[list[str], list[list[str]]]:
    """Return heading and rows of the table of motions at both ends of a range.

    own: of :func:`rotation_facts`. ends: both speeds as text. unit: of frequencies, as a heading has it. per_unit: what
    they are divided by.
    """
    header, columns = ["motion"], []
    for k, end in enumerate(ends):
        header += [f"at {end}{unit}", "damping ratio", "whirl"]
        columns.append([f"{over(w, per_unit):.6g}" for w in own["natural_frequency"][k]])
        columns.append(["-" if ratio is None else f"{ratio + 0.0:.4g}" for ratio in own["damping_ratio"][k]])
        columns.append([SENSES[sense] for sense in own["whirl"][k]])
    return header, [[str(k), *row] for k, row in enumerate(zip(*columns, strict=True), 1)]


def rotation_text(facts: dict[str, Any]) -> list[str]:
    """Return the table of natural frequencies at both ends of the range, none without one."""
    own, shown, unit = facts["rotations"], facts["dangerous"].shown, facts["unit"]
    if not own:
        return []
    ends = [f"{end / shown.scale:.6g} {shown.unit}".strip() for end in own["range"]]
    lines = [
        f"These modes are of the system at rest. With what acts with its speeds of rotation, over the {shown.name}:",
        table(*rotation_rows(own, ends, f" ({unit})" if unit else "", facts["per_unit"])),
    ]
    if own["size"] is not None and own["size"] < SMALL:
        lines.append(f"What acts with the speeds W is negligible: 2 W/w_1 is {own['size']:.2g} at most.")
    return lines
