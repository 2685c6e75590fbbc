"""Readable text of the facts of ``gearstab info``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from gearstab.info import (
    MeanSystem,
    ShownSpeeds,
    danger,
    label_text,
    meshes_text,
    over,
    speeds,
    table,
    time_unit,
    train,
)

FEW_MESHES = 4
"""Up to so many meshes have columns of their own."""
FEW_GROUPS = 3
"""Up to so many groups of equal frequencies have lines of their own."""
MANY_TONGUES = 24
"""A longer list is printed on request only: those that matter are ranked."""


def report(facts: dict[str, Any], every: bool = False) -> str:
    """The facts as readable text. every: list all tongues, however many."""
    texts = [_heading(facts)]
    if found := facts["train"]:
        texts += [train.drawing(found), train.teeth(found)]
    texts += [_mesh_table(facts), _mode_table(facts), _reduction_text(facts)]
    texts.append(danger.text(facts["dangerous"], facts["mean_system"].unstable))
    if not facts["dangerous"].refused:
        texts.append(_tongue_table(facts, every))
    return "\n\n".join(texts)


def heading(name: str, unit: str) -> str:
    """The heading of a column with its unit, where there is one."""
    return f"{name} ({unit})" if unit else name


def _text(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _formulation(facts: dict[str, Any]) -> list[str]:
    """A line on a formulation that is not a linear system."""
    if facts["formulation"] in (None, "classical"):
        return []
    return [f"formulation    {facts['formulation']}; modes and tongues below are those of the classical one"]


def _heading(facts: dict[str, Any]) -> str:
    lines = [
        facts["title"],
        *_verdict(facts),
        *speeds.rotation_verdict(facts),
        "",
        f"system         {facts['kind']}, {len(facts['coordinates'])} coordinates: {', '.join(facts['coordinates'])}",
        *(f"{heading:<14} {said}" for heading, said in facts["summary"].items()),
        *_formulation(facts),
        f"common period  {speeds.period_text(facts['common_period'])}",
    ]
    if facts["frequencies"] is not None:
        lines.append(f"floquet        {facts['frequencies']['chosen']}")
    if facts["sweep"]:
        lines.append("sweep          " + " x ".join(f"{name} ({size})" for name, size in facts["sweep"].items()))
    if facts["design"]:
        lines.append(f"design         {_design(facts['design'])}")
    return "\n".join(lines)


def _verdict(facts: dict[str, Any]) -> list[str]:
    """A line on a mean system that grows by itself, none on others.

    The variation of the mesh stiffness may hold such a system at some speeds, as the scan of the range knows.
    """
    mean: MeanSystem = facts["mean_system"]
    if not mean.unstable:
        return []
    growth, frequency = mean.fastest
    one = "" if not facts["unit"] else f" {facts['unit']}"
    share = facts["dangerous"].unstable_share
    verdict = "UNSTABLE"
    if share is not None and share < 1:
        verdict = f"UNSTABLE at {100 * share:.3g} % of the speeds" if share else "STABLE by the varying mesh stiffness"
    return [
        f"{verdict}: the mean system grows by itself, by up to {growth:.4g} e-folds per "
        f"{time_unit(not facts['unit'])} at the frequency {over(frequency, facts['per_unit']):.6g}"
        f"{one}."
    ]


def _mean_lines(facts: dict[str, Any]) -> list[str]:
    """The motions of the mean system with its terms, of which the table of modes shows the symmetric part only."""
    if facts["rotations"] or not (facts["terms"] or facts["held_rotations"]):
        return []
    mean = facts["mean_system"]
    header = ["motion", "like mode", heading("frequency", facts["unit"]), "growth rate"]
    motions = enumerate(zip(mean.mode, mean.frequency, mean.growth_rate, strict=True), 1)
    rows = [[str(k), str(p), _text(over(w, facts["per_unit"])), f"{g:.5g}"] for k, (p, w, g) in motions]
    return [
        "These modes are of the symmetric mean system. With its damping, the means of its terms and held rotations it "
        "moves so:",
        table(header, rows),
    ]


def _design(design: dict[str, Any]) -> str:
    """Return one line on the numbers that may change and the objective."""
    sizes = {
        name: f"{bounds[0]:.6g} .. {bounds[1]:.6g}" if isinstance(bounds, list) else f"{bounds} choices"
        for name, bounds in design["variables"].items()
    }
    return f"minimise {', '.join(design['minimise'])} by {', '.join(f'{n} ({size})' for n, size in sizes.items())}"


def _mesh_table(facts: dict[str, Any]) -> str:
    header = ["mesh", "Omega_i/Omega", "waveform", "mean stiffness", "epsilon", "contact ratio", "lag", "lowest"]
    keys = ["name", "frequency_ratio", "waveform", "mean_stiffness", "epsilon", "contact_ratio", "lag"]
    if any(mesh["order"] is not None for mesh in facts["meshes"]):
        header.insert(2, "order")
        keys.insert(2, "order")
    rows = [
        [_text(mesh[key]) for key in keys] + [_text(level) for level in mesh["stiffness"]] for mesh in facts["meshes"]
    ]
    found = table([*header, "highest"], rows)
    return f"{found}\n\n{speeds.weak_teeth(facts['faults'])}" if facts["faults"] else found


def _gears(names: Sequence[str]) -> dict[str, list[str]]:
    """Meshes of one gear with all planets under its name; many columns of numbers would say no more than one."""
    if len(names) <= FEW_MESHES:
        return {name: [name] for name in names}
    gears: dict[str, list[str]] = {}
    for name in names:
        gears.setdefault(name.rstrip("0123456789") or name, []).append(name)
    return gears


def _mode_table(facts: dict[str, Any]) -> str:
    lines = [train.modes(facts)] if facts["train"] else _mode_lines(facts)
    lines += _mean_lines(facts) + speeds.rotation_text(facts)
    equal = facts["equal_frequencies"]
    if len(equal) > FEW_GROUPS:
        listed = "; ".join(" ".join(map(str, group)) for group in equal)
        lines.append(
            f"Modes of equal frequencies: {listed}. The joint tongue of two groups goes under their first modes."
        )
    else:
        lines += [
            f"Modes {', '.join(map(str, group))} have equal frequencies: their joint tongue goes under the first pair."
            for group in equal
        ]
    rigid = [mode["mode"] for mode in facts["modes"] if mode["type"] == "rigid-body"]
    if rigid and facts["reductions"]["rigid_driven"]:
        lines.append(
            f"warning: damping feeds rigid-body motion (mode {', '.join(map(str, rigid))}), which grows at any mesh "
            "frequency; no modal damping ratio prevents that."
        )
    elif rigid:
        lines.append(f"Rigid-body modes take no part in stability: {', '.join(map(str, rigid))}.")
    still = [mode["mode"] for mode in facts["modes"] if mode["type"] in ("no mesh deflection", "purely ring")]
    if still:
        lines.append(f"No mesh excites these modes, which have no mesh deflection: {', '.join(map(str, still))}.")
    return "\n".join(lines)


def _mode_lines(facts: dict[str, Any]) -> list[str]:
    gears = _gears([mesh["name"] for mesh in facts["meshes"]])
    turning = any(mode["mesh_deflection_type"] is not None for mode in facts["modes"])
    header = ["mode", heading("frequency", facts["unit"]), "type", *(["T"] if turning else []), "damping ratio"]
    header += [f"deflection {name}" for name in gears] + [f"energy {name}" for name in gears]
    rows = []
    for mode in facts["modes"]:
        row = [_text(mode[key]) for key in ("mode", "natural_frequency", "type")]
        row += [_text(mode["mesh_deflection_type"])] if turning else []
        row += [_text(mode["damping_ratio"])]
        row += [f"{_root_mean_square([mode['mesh_deflection'][n] for n in names]):.5g}" for names in gears.values()]
        row += [_percent(_sum([mode["mesh_energy_share"][n] for n in names])) for names in gears.values()]
        rows.append(row)
    if any(len(names) > 1 for names in gears.values()):
        note = "Mesh deflections are root mean squares, energies sums over the meshes of a gear."
        return [table(header, rows), note]
    return [table(header, rows)]


def _reduction_text(facts: dict[str, Any]) -> str:
    """Reductions applied; all of them are exact."""
    found = facts["reductions"]
    if len(found["blocks"]) == 1 and not found["rigid_modes"] and not found["dropped_modes"]:
        return "Reductions applied: none, the meshes couple all modes."
    lines = [f"Reductions applied: {found['summary']}."]
    if len(found["blocks"]) > 1 or any(block["copies"] > 1 for block in found["blocks"]):
        header = ["block", "coordinates", "times", "segments", "made of modes"]
        rows = [
            [str(k), str(b["size"]), str(b["copies"]), str(b["segments"]), " ".join(map(str, b["modes"]))]
            for k, b in enumerate(found["blocks"], 1)
        ]
        lines.append(table(header, rows))
    if isinstance(found["saving"], float) and found["saving"] >= 1.5:
        lines.append(f"No mesh couples the blocks: solved one by one they take {found['saving']:.3g} times less work.")
    return "\n".join(lines)


def _root_mean_square(values: Sequence[float]) -> float:
    """Return the range of several values; a single one keeps its sign."""
    return values[0] if len(values) == 1 else (sum(v * v for v in values) / len(values)) ** 0.5


def _sum(shares: Sequence[float | None]) -> float | None:
    known = [share for share in shares if share is not None]
    return sum(known) if known else None


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.1f} %"


def _tongue_table(facts: dict[str, Any], every: bool) -> str:
    order, second = ("first", False) if facts["order"] == 1 else ("second", True)
    title = f"Instability tongues to {order} order at the base system, harmonics 1 to {facts['harmonics']}"
    # Over the axis of the sweep and in the unit typed there, as the dangerous speeds above.
    swept: ShownSpeeds = facts["dangerous"].shown
    one = swept.teeth if swept.unit == facts["unit"] else swept.scale
    if swept.teeth != 1:
        title += f", by {swept.name}"
    if not facts["tongues"]:
        return f"{title}: none, no mode of positive mean stiffness is deflected by a mesh."
    if len(facts["tongues"]) > MANY_TONGUES and not every:
        return f"{title}: {len(facts['tongues'])}, listed with --all or --json.{_rule(facts)}"
    rule, whole = facts["existence_rule"], "+".join(mesh["name"] for mesh in facts["meshes"])
    header = ["tongue", "kind", "mesh", *(["T_p", "T_q"] if rule else [])]
    header += [
        heading("root" if second else "centre", swept.unit),
        "half-width",
        "lower",
        "upper",
        *(["error"] if second else []),
        "remark",
    ]
    rows = []
    for tongue in facts["tongues"]:
        mesh = "all" if tongue["mesh"] == whole and len(facts["meshes"]) > FEW_MESHES else tongue["mesh"]
        row = [label_text(tongue["label"]), tongue["kind"], meshes_text(mesh.split("+"))]
        row += [" ".join(map(str, types)) or "-" for types in tongue["types"]] if rule else []
        numbers = [tongue["center_frequency"], tongue["half_width"], *tongue["boundary_frequency"]]
        numbers += tongue["boundary_error"][:1] if second else []
        rows.append([*row, *map(_text, over(numbers, one)), _remark(tongue, bool(facts["terms"]))])
    text = "\n".join([title, "", table(header, rows)]) + _rule(facts)
    if any(tongue["overlaps"] for tongue in facts["tongues"]):
        text += "\nThe theory treats each tongue by itself: where tongues overlap, their boundaries are rough."
    if facts["terms"]:
        text += (
            "\nCentres are sums and differences of the frequencies of the symmetric mean system; edges add what the "
            "means of the terms do to first order."
        )
    for mode in facts["self_excited"]:
        text += f"\nMode {mode} grows by itself, at any mesh frequency."
    return text


def _rule(facts: dict[str, Any]) -> str:
    """The existence rule as a line of its own, "" for systems to which it does not apply."""
    rule = facts["existence_rule"]
    return (
        f"\nExistence rule: modes couple only where L z +- (T_p +- T_q) is a multiple of N, N = {rule['planets']}, "
        f"z = {rule['step']} (mod N)."
        if rule
        else ""
    )


def _remark(tongue: dict[str, Any], terms: bool) -> str:
    """In a word or two, what is special about a tongue; terms: whether the system has periodic terms."""
    if "coincident_tongues" in tongue.get("status", []):
        return "another resonance too near"
    if "not_converged" in tongue.get("status", []):
        return "rough: another resonance near"
    if tongue["half_width"] == "infinite":
        return "no boundary" + ("" if terms else ": only one of the modes is damped")
    if tongue["half_width"] is None:
        return "not known: undamped modes of one frequency"
    if tongue["half_width"] == 0:
        if tongue.get("allowed") is False:
            return "excluded by the existence rule"
        closed = isinstance(tongue["threshold"], float) and tongue["threshold"] > 0
        return (
            f"closed by damping, opens at epsilon x {tongue['threshold']:.3g}"
            if closed
            else "not excited to this order"
            if "status" in tongue
            else "not excited to first order"
        )
    return "overlaps" if tongue["overlaps"] else ""
