"""``gearstab info``: modes and predicted instability tongues of the base system of a configuration."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gearstab.cli import periods

if TYPE_CHECKING:
    from gearstab.config import Config
    from gearstab.system import GearSystem

FEW_MESHES = 4
"""Up to so many meshes have columns of their own."""
FEW_GROUPS = 3
"""Up to so many groups of equal frequencies have lines of their own."""
MANY_TONGUES = 150
"""A longer list leaves out tongues that are closed, or far from the sweep."""
HARMONICS = 3
"""Harmonics whose tongues are listed where the configuration does not ask for perturbation theory itself."""


@click.command()
@click.argument("config", type=click.Path(path_type=Path))
@click.option("--set", "overrides", multiple=True, metavar="PATH=VALUE", help="Override a value of CONFIG; repeatable.")
@click.option(
    "--harmonics", type=click.IntRange(1, 50), help="List tongues up to this harmonic [default: as in CONFIG]."
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(config: Path, overrides: tuple[str, ...], harmonics: int | None, as_json: bool) -> None:
    """Show natural frequencies, modes and the tongues that perturbation theory predicts for CONFIG."""
    from gearstab.cli.errors import user_errors

    with user_errors():
        from gearstab.config import load

        loaded = load(config, overrides)
    facts = describe(loaded, harmonics)
    if as_json:
        import json

        click.echo(json.dumps(facts, indent=2, allow_nan=False))
    else:
        click.echo(report(facts))


def describe(config: Config, harmonics: int | None = None) -> dict[str, Any]:
    """All that ``info`` shows, as plain numbers, texts and lists; None where a number does not exist."""
    from gearstab.systems import build

    system = build(config.parameters)
    asked = config.methods.perturbation
    order = harmonics or (asked.harmonics if asked else HARMONICS)
    sweep = {axis.name: axis.size for axis in config.axes}
    return {
        "title": config.title,
        "kind": config.kind,
        "coordinates": list(system.coordinates),
        "sweep": sweep,
        "frequency_range": _frequency_range(config),
        "meshes": [_mesh(system, i) for i in range(len(system.meshes))],
        "common_period": periods.common_period(system),
        "frequencies": periods.frequencies(config, system),
        **_modes(system),
        "reductions": _reductions(system),
        "harmonics": order,
        **_existence(system, _tongues(system, order)),
    }


def _frequency_range(config: Config) -> list[float] | None:
    """The lowest and highest mesh frequency of the sweep."""
    found = [axis.values for axis in config.axes if axis.name == "mesh_frequency"]
    return [float(min(found[0])), float(max(found[0]))] if found else None


def _number(value: Any) -> float | str | None:
    """A number for JSON: no NaN, and infinity by name."""
    number = float(value)
    if number != number:
        return None
    return "infinite" if abs(number) == float("inf") else number


def _mesh(system: GearSystem, i: int) -> dict[str, Any]:
    mesh = system.meshes[i]
    low, high = (float(mesh.mean_stiffness + 2 * mesh.amplitude * level) for level in mesh.waveform.extremes())
    contact_ratio = getattr(mesh.waveform, "contact_ratio", None)
    return {
        "name": mesh.name,
        "frequency_ratio": str(mesh.frequency_ratio),
        "mean_stiffness": float(mesh.mean_stiffness),
        "epsilon": float(mesh.epsilon),
        "contact_ratio": None if contact_ratio is None else float(contact_ratio),
        "lag": float(mesh.lag) % 1.0,
        "stiffness": [low, high],
    }


def _modes(system: GearSystem) -> dict[str, Any]:
    import numpy as np

    from gearstab.modal import mean_modes, mesh_energy_shares, modal_damping_ratios, significant_deflection
    from gearstab.perturbation.multiple_scales import partitions
    from gearstab.symmetry import deflection_types, oriented, type_names

    modes = oriented(system, mean_modes(system))
    names = [mesh.name for mesh in system.meshes]
    ratios, shares = modal_damping_ratios(system, modes), mesh_energy_shares(system, modes)
    kinds, turns = type_names(system, modes), deflection_types(system, modes)
    deflection = np.where(significant_deflection(modes), modes.mesh_deflection, 0.0)
    listed = [
        {
            "mode": p + 1,
            "natural_frequency": _number(modes.natural_frequency[p]),
            "type": kinds[p],
            "mesh_deflection_type": int(turns[p]) if turns[p] >= 0 else None,
            "damping_ratio": _number(ratios[p]),
            "mesh_deflection": {name: float(deflection[p, i]) for i, name in enumerate(names)},
            "mesh_energy_share": {name: _number(shares[p, i]) for i, name in enumerate(names)},
        }
        for p in range(system.size)
    ]
    ((_, groups),) = partitions(modes.natural_frequency[None])
    return {"modes": listed, "equal_frequencies": [[p + 1 for p in group] for group in groups if len(group) > 1]}


def _reductions(system: GearSystem) -> dict[str, Any]:
    """How exact Floquet analysis takes the system apart."""
    from dataclasses import asdict

    from gearstab.floquet.report import reduction

    found = reduction(system)
    blocks = [{name: list(v) if isinstance(v, tuple) else v for name, v in asdict(p).items()} for p in found.parts]
    return {
        "summary": found.text(),
        "rigid_modes": list(found.rigid),
        "dropped_modes": list(found.dropped),
        "blocks": blocks,
        "saving": _number(found.saving),
    }


def _existence(system: GearSystem, tongues: list[dict[str, Any]]) -> dict[str, Any]:
    """The tongues with the existence rule L z +- (T_p +- T_q) = j N, None for a system to which it does not apply.

    ``types`` of a tongue are the T of all modes that share its two frequencies; ``allowed`` whether the rule holds for
    any pair of them.
    """
    from gearstab.modal import mean_modes
    from gearstab.perturbation.multiple_scales import partitions
    from gearstab.symmetry import can_couple, deflection_types, oriented, phase_step

    step = phase_step(system)
    if step is None or system.symmetry is None:
        return {"existence_rule": None, "tongues": tongues}
    order = system.symmetry.order
    modes = oriented(system, mean_modes(system))
    turns = deflection_types(system, modes)
    ((_, groups),) = partitions(modes.natural_frequency[None])
    of = {p + 1: sorted({int(turns[k]) for k in group} - {-1}) for group in groups for p in group}
    for tongue in tongues:
        first, second = of[tongue["mode_p"]], of[tongue["mode_q"]]
        tongue["types"] = [first, second]
        tongue["allowed"] = any(can_couple(order, step, tongue["harmonic"], a, b) for a in first for b in second)
    return {"existence_rule": {"planets": order, "step": step}, "tongues": tongues}


def _tongues(system: GearSystem, harmonics: int) -> list[dict[str, Any]]:
    import numpy as np

    from gearstab.perturbation import first_order
    from gearstab.perturbation.tongues import overlapping

    tongues = first_order(system, harmonics)
    overlap = overlapping(tongues)
    order = np.argsort(tongues.center_frequency, kind="stable")
    return [
        {
            "label": tongues.label[k],
            "kind": tongues.kind[k],
            "mesh": tongues.mesh[k],
            "mode_p": tongues.mode_p[k],
            "mode_q": tongues.mode_q[k],
            "harmonic": tongues.harmonic[k],
            "frequency_ratio": tongues.frequency_ratio[k],
            "center_frequency": _number(tongues.center_frequency[k]),
            "half_width": _number(tongues.half_width[k]),
            "boundary_frequency": [_number(edge) for edge in tongues.boundary_frequency[k]],
            "threshold": _number(tongues.threshold[k]),
            "overlaps": bool(overlap[k]),
        }
        for k in order
        if np.isfinite(tongues.center_frequency[k])
    ]


# ---- text


def report(facts: dict[str, Any]) -> str:
    """The facts as readable text."""
    parts = (_heading, _mesh_table, _mode_table, _reduction_text, _tongue_table)
    return "\n\n".join(part(facts) for part in parts)


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Columns of text: the first to the left, numbers to the right, two spaces between."""
    numeric = [all(row[k] in {"", "-"} or row[k][0] in "+-.0123456789" for row in rows) for k in range(len(header))]
    widths = [max(len(line[k]) for line in [header, *rows]) for k in range(len(header))]
    lines = [header, ["-" * width for width in widths], *rows]
    pads = [str.rjust if right else str.ljust for right in numeric]
    padded = ([pad(cell, width) for pad, cell, width in zip(pads, line, widths, strict=True)] for line in lines)
    return "\n".join("  ".join(cells).rstrip() for cells in padded)


def _text(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _heading(facts: dict[str, Any]) -> str:
    lines = [
        facts["title"],
        "",
        f"system         {facts['kind']}, {len(facts['coordinates'])} coordinates: {', '.join(facts['coordinates'])}",
        f"common period  {periods.text(facts['common_period'])}",
    ]
    if facts["frequencies"] is not None:
        lines.append(f"floquet        {periods.way(facts['frequencies'])}")
    if facts["sweep"]:
        lines.append("sweep          " + " x ".join(f"{name} ({size})" for name, size in facts["sweep"].items()))
    return "\n".join(lines)


def _mesh_table(facts: dict[str, Any]) -> str:
    header = ["mesh", "Omega_i/Omega", "mean stiffness", "epsilon", "contact ratio", "lag", "lowest", "highest"]
    keys = ["name", "frequency_ratio", "mean_stiffness", "epsilon", "contact_ratio", "lag"]
    rows = [
        [_text(mesh[key]) for key in keys] + [_text(level) for level in mesh["stiffness"]] for mesh in facts["meshes"]
    ]
    return table(header, rows)


def _gears(names: Sequence[str]) -> dict[str, list[str]]:
    """Meshes of one gear with all planets under its name; many columns of numbers would say no more than one."""
    if len(names) <= FEW_MESHES:
        return {name: [name] for name in names}
    gears: dict[str, list[str]] = {}
    for name in names:
        gears.setdefault(name.rstrip("0123456789") or name, []).append(name)
    return gears


def _mode_table(facts: dict[str, Any]) -> str:
    gears = _gears([mesh["name"] for mesh in facts["meshes"]])
    turning = any(mode["mesh_deflection_type"] is not None for mode in facts["modes"])
    header = ["mode", "frequency", "type", *(["T"] if turning else []), "damping ratio"]
    header += [f"deflection {name}" for name in gears] + [f"energy {name}" for name in gears]
    rows = []
    for mode in facts["modes"]:
        row = [_text(mode[key]) for key in ("mode", "natural_frequency", "type")]
        row += [_text(mode["mesh_deflection_type"])] if turning else []
        row += [_text(mode["damping_ratio"])]
        row += [f"{_root_mean_square([mode['mesh_deflection'][n] for n in names]):.5g}" for names in gears.values()]
        row += [_percent(_sum([mode["mesh_energy_share"][n] for n in names])) for names in gears.values()]
        rows.append(row)
    lines = [table(header, rows)]
    if any(len(names) > 1 for names in gears.values()):
        lines.append("Mesh deflections are root mean squares, energies sums over the meshes of a gear.")
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
    if rigid:
        lines.append(f"Rigid-body modes take no part in stability: {', '.join(map(str, rigid))}.")
    still = [mode["mode"] for mode in facts["modes"] if mode["type"] in ("no mesh deflection", "purely ring")]
    if still:
        lines.append(f"No mesh excites these modes, which have no mesh deflection: {', '.join(map(str, still))}.")
    return "\n".join(lines)


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
    """Of several values; a single one keeps its sign."""
    return values[0] if len(values) == 1 else (sum(v * v for v in values) / len(values)) ** 0.5


def _sum(shares: Sequence[float | None]) -> float | None:
    known = [share for share in shares if share is not None]
    return sum(known) if known else None


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.1f} %"


def _tongue_table(facts: dict[str, Any]) -> str:
    title = f"Instability tongues to first order at the base system, harmonics 1 to {facts['harmonics']}"
    if not facts["tongues"]:
        return f"{title}: none, there is no elastic mode."
    rule, every = facts["existence_rule"], "+".join(mesh["name"] for mesh in facts["meshes"])
    listed, left_out = _worth_listing(facts)
    header = ["tongue", "kind", "mesh", *(["T_p", "T_q"] if rule else [])]
    header += ["centre", "half-width", "lower", "upper", "remark"]
    rows = []
    for tongue in listed:
        mesh = "all" if tongue["mesh"] == every and len(facts["meshes"]) > FEW_MESHES else tongue["mesh"]
        row = [tongue["label"], tongue["kind"], mesh]
        row += [" ".join(map(str, types)) or "-" for types in tongue["types"]] if rule else []
        row += [_text(tongue["center_frequency"]), _text(tongue["half_width"])]
        rows.append([*row, *(_text(edge) for edge in tongue["boundary_frequency"]), _remark(tongue)])
    text = "\n".join([title, "", table(header, rows) if rows else "None in the range of the sweep.", *left_out])
    if rule:
        text += (
            f"\nExistence rule: modes couple only where L z +- (T_p +- T_q) is a multiple of N, N = {rule['planets']}, "
            f"z = {rule['step']} (mod N)."
        )
    if any(tongue["overlaps"] for tongue in facts["tongues"]):
        text += "\nFirst order treats each tongue by itself: where tongues overlap, their boundaries are rough."
    return text


def _worth_listing(facts: dict[str, Any]) -> tuple[list[dict[str, Any]], list[str]]:
    """The tongues to list and what is said of the others: where there are many, those of the sweep that open."""
    tongues = facts["tongues"]
    if len(tongues) <= MANY_TONGUES:
        return tongues, []
    listed = [t for t in tongues if t["half_width"] != 0]
    notes = [f"{len(tongues) - len(listed)} tongues are not excited to first order or closed by damping."]
    if facts["frequency_range"] is not None:
        low, high = facts["frequency_range"]
        inside = [t for t in listed if low <= t["center_frequency"] <= high]
        notes.append(f"{len(listed) - len(inside)} are centred outside of the sweep, {_text(low)} to {_text(high)}.")
        listed = inside
    return listed, [*notes, "All of them: --json."]


def _remark(tongue: dict[str, Any]) -> str:
    """In a word or two, what is special about a tongue."""
    if tongue["half_width"] == "infinite":
        return "no boundary: only one of the modes is damped"
    if tongue["half_width"] == 0:
        if tongue.get("allowed") is False:
            return "excluded by the existence rule"
        closed = isinstance(tongue["threshold"], float) and tongue["threshold"] > 0
        return (
            f"closed by damping, opens at epsilon x {tongue['threshold']:.3g}"
            if closed
            else "not excited to first order"
        )
    return "overlaps" if tongue["overlaps"] else ""
