"""Facts about a system whose speeds of rotation follow the mesh frequency: its mean system there."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gearstab.info.tables import table
from gearstab.info.units import over

if TYPE_CHECKING:
    from gearstab.system import GearSystem

SPEEDS = 65
"""Number of speeds of a range at which motions of the mean system are looked at."""
HALVINGS = 40
"""Halvings of a step between two of them, for the speed from which on one grows."""
SMALL = 1e-3
"""Value of 2 W/w_1 below which what acts with the speed W is negligible."""
SENSES = {1: "forward", -1: "backward", 0: "-"}


def facts(system: GearSystem, ends: list[float] | None) -> dict[str, Any] | None:
    """Return natural frequencies at both ends of a range of mesh frequencies, and where motions grow by themselves.

    None where no speed of rotation follows the mesh frequency, or no range is known.
    """
    import numpy as np

    from gearstab.floquet.general.whirl import whirl_motions

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
    from gearstab.floquet.general.mean import mean_motions

    for _ in range(HALVINGS):
        middle = 0.5 * (stable + growing)
        if mean_motions(system, middle).unstable.any():
            growing = middle
        else:
            stable = middle
    return float(growing)


def verdict(facts: dict[str, Any]) -> list[str]:
    """Return a line for each stretch of speeds at which the mean system grows by itself."""
    own, shown = facts["rotations"], facts["dangerous"]
    lines = []
    for part in own["self_excited"] if own else ():
        ends = [None if end is None else f"{end / shown['scale']:.6g}" for end in (part["from"], part["to"])]
        where = f"from {ends[0]} to {ends[1]}" if ends[1] else f"{'from' if part['at_once'] else 'above'} {ends[0]}"
        rate = f"by up to {part['growth_rate']:.4g} e-folds per {'second' if facts['unit'] else 'unit of time'}"
        frequency = f"{over(part['frequency'], facts['per_unit']):.6g} {facts['unit']}".strip()
        how = f"flutter at {frequency}" if part["kind"] == "flutter" else "divergence"
        lines.append(
            f"SELF-EXCITED {where} {shown['unit']}".rstrip() + f" ({shown['axis']}): {how}, {rate}, without any "
            "variation of the mesh stiffness."
        )
    return lines


def rows(own: dict[str, Any], ends: list[str], unit: str, per_unit: float = 1.0) -> tuple[list[str], list[list[str]]]:
    """Return heading and rows of the table of motions at both ends of a range.

    own: of :func:`facts`. ends: both speeds as text. unit: of frequencies, as a heading has it. per_unit: what they are
    divided by.
    """
    header, columns = ["motion"], []
    for k, end in enumerate(ends):
        header += [f"at {end}{unit}", "damping ratio", "whirl"]
        columns.append([f"{over(w, per_unit):.6g}" for w in own["natural_frequency"][k]])
        columns.append(["-" if ratio is None else f"{ratio + 0.0:.4g}" for ratio in own["damping_ratio"][k]])
        columns.append([SENSES[sense] for sense in own["whirl"][k]])
    return header, [[str(k), *row] for k, row in enumerate(zip(*columns, strict=True), 1)]


def text(facts: dict[str, Any]) -> list[str]:
    """Return the table of natural frequencies at both ends of the range, none without one."""
    own, shown, unit = facts["rotations"], facts["dangerous"], facts["unit"]
    if not own:
        return []
    ends = [f"{end / shown['scale']:.6g} {shown['unit']}".strip() for end in own["range"]]
    lines = [
        f"These modes are of the system at rest. With what acts with its speeds of rotation, over the {shown['axis']}:",
        table(*rows(own, ends, f" ({unit})" if unit else "", facts["per_unit"])),
    ]
    if own["size"] is not None and own["size"] < SMALL:
        lines.append(f"What acts with the speeds W is negligible: 2 W/w_1 is {own['size']:.2g} at most.")
    return lines
