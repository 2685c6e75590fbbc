"""What ``gearstab info`` says of dangerous mesh frequencies or speeds: ranked, and what would close each region."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from gearstab.info.tables import table

if TYPE_CHECKING:
    from gearstab.config import Config
    from gearstab.perturbation.ranking import RankedRegion
    from gearstab.system import GearSystem

WORTHWHILE = 0.5
"""A phasing that leaves more than this part of a region is not mentioned."""


def facts(config: Config, system: GearSystem, harmonics: int) -> dict[str, Any]:
    """Return the regions in the range of the sweep by what they do there, as plain numbers, texts and lists.

    Without an axis of the mesh frequency all regions count. harmonics: at least so many are looked at.
    """
    from math import inf

    from gearstab.perturbation.ranking import rank

    axis = next((a for a in config.axes if a.mesh_frequency is not None), None)
    low, high, unit, scale, teeth = 0.0, inf, "" if "time" in system.dimensionless else "rad/s", 1.0, 1.0
    if axis is not None and axis.mesh_frequency is not None:
        from gearstab.config.model.units import scale as scale_of

        values = axis.mesh_frequency.values
        low, high = float(min(values)), float(max(values))
        unit = axis.typed_units or unit
        teeth = axis.mesh_frequency.factor
        scale = teeth * (scale_of(axis.typed_units, axis.units) if axis.typed_units else 1.0)
    found = rank(system, low, high, harmonics)
    step = planets_step(system)
    return {
        "axis": "mesh frequency" if axis is None else axis.long_name,
        "unit": unit,
        "range": None if axis is None else [low / scale, high / scale],
        "scale": scale,
        "teeth": teeth,
        "harmonics": found.harmonics,
        "open": [_region(config, system, region, high - low, step) for region in found.open],
        "closest": [_region(config, system, region, high - low, step) for region in found.closest],
        "number_open": found.opened,
        "number_closed_by_damping": found.closed,
        "number_not_excited": found.quiet,
    }


def planets_step(system: GearSystem) -> tuple[int, int] | None:
    """Return the number of planets and z of a system to which the existence rule applies."""
    from gearstab.symmetry import phase_step

    step = phase_step(system)
    return None if step is None or system.symmetry is None else (system.symmetry.order, step)


def _region(
    config: Config, system: GearSystem, region: RankedRegion, width: float, step: tuple[int, int] | None
) -> dict[str, Any]:
    tongue, found = region.tongue, region.amplitudes
    return {
        "label": tongue.label,
        "kind": tongue.kind,
        "mesh": tongue.mesh,
        "harmonic": tongue.harmonic,
        "center_frequency": sum(found.frequencies) / tongue.frequency_ratio,
        "boundary_frequency": None if region.lower != region.lower else [region.lower, region.upper],
        "endless": region.endless,
        "share_of_range": region.inside / width if width < float("inf") and width > 0 else None,
        "growth_rate": found.growth_rate,
        "threshold": region.threshold,
        "closed_by": remedies_of(config, system, region, step),
    }


def remedies_of(
    config: Config, system: GearSystem, region: RankedRegion, step: tuple[int, int] | None
) -> dict[str, Any]:
    """Return the damping ratio, contact ratios, phasing or tooth numbers that close a region to first order."""
    from gearstab.perturbation import remedies

    found, meshes = region.amplitudes, config.parameters.get("meshes")
    closed: dict[str, Any] = {"damping_ratio": found.damping_ratio}
    groups = _alike(system, meshes)
    ratios = remedies.contact_ratios(system, found, list(groups.values()))
    names = {numbers[0]: name for name, numbers in groups.items()}
    if ratios:
        closed["contact_ratio"] = {names[i]: ratio for i, ratio in ratios.items()}
    if step is not None:
        allowed = _excluding(system, region, step[0])
        return closed | ({"sun_teeth_modulo": {"planets": step[0], "remainders": allowed}} if allowed else {})
    best = remedies.phasing(found) if isinstance(meshes, list) else None
    if best is not None and best.left <= WORTHWHILE:
        key, value = _phase(meshes[best.mesh] if isinstance(meshes, list) else {}, best.shift)
        left = 0.0 if best.closes else best.left
        closed["phasing"] = {"mesh": system.meshes[best.mesh].name, "key": key, "value": value, "leaves": left}
    return closed


def _alike(system: GearSystem, meshes: Any) -> dict[str, list[int]]:
    """Numbers of the meshes of the system by the entry of the configuration that describes them."""
    if not isinstance(meshes, dict):
        return {mesh.name: [i] for i, mesh in enumerate(system.meshes)}
    return {key: [i for i, mesh in enumerate(system.meshes) if mesh.name.rstrip("0123456789") == key] for key in meshes}


def _phase(mesh: dict[str, Any], shift: float) -> tuple[str, float]:
    """The key of a mesh that says when its wave begins, and the value that adds ``shift`` to its lag."""
    key, sense = ("phasing", -1) if "phasing" in mesh else ("lag", 1)
    return key, round((float(mesh.get(key, 0.0)) + sense * shift) % 1.0, 9) % 1.0


def _excluding(system: GearSystem, region: RankedRegion, planets: int) -> list[int]:
    """Remainders of the sun's tooth number over the number of planets that exclude a region by the existence rule."""
    from gearstab.modal import mean_modes
    from gearstab.perturbation.multiple_scales import group_of, modal_rows
    from gearstab.symmetry import can_couple, deflection_types, oriented

    turns = deflection_types(system, oriented(system, mean_modes(system)))
    modal, tongue = modal_rows(system), region.tongue
    types = [{int(turns[k]) for k in group_of(modal, mode - 1)} - {-1} for mode in (tongue.mode_p, tongue.mode_q)]
    return [
        z
        for z in range(planets)
        if not any(can_couple(planets, z, tongue.harmonic, a, b) for a in types[0] for b in types[1])
    ]


# ---- text


def text(found: dict[str, Any], terms: Sequence[str] = ()) -> str:
    """The ranked regions as a table, or what is next to open; terms: names of periodic terms, which the ranking leaves
    out.
    """
    unit, scale = found["unit"], found["scale"]
    within = "" if found["range"] is None else " from {:.6g} to {:.6g}".format(*found["range"])
    where = f"{found['axis']}{within} {unit}".strip()
    how = f"first order, base system, harmonics up to {found['harmonics']}"
    lines = [f"Dangerous speeds: {where} ({how})", ""]
    if found["open"]:
        columns = {heading: [cell(r["closed_by"]) for r in found["open"]] for heading, cell in CLOSED_BY.items()}
        columns = {heading: cells for heading, cells in columns.items() if any(cells)}
        more = zip(*columns.values(), strict=True)
        rows = [[*_row(region, scale), *cells] for region, cells in zip(found["open"], more, strict=True)]
        lines.append(table([*HEADER, *columns], rows))
        lines.append("Any one of the last columns closes a region, or leaves the given part of it.")
        if found["number_open"] > len(found["open"]):
            lines.append(f"and {found['number_open'] - len(found['open'])} narrower ones.")
    else:
        lines.append("No region of instability is open there.")
        lines += [_next(region, scale, unit) for region in found["closest"]]
    if count := found["number_closed_by_damping"]:
        lines.append(f"Damping closes {count} region{'s' * (count != 1)} centred there.")
    if terms:
        lines.append(f"These regions leave out {', '.join(terms)}; those of the tongues do not.")
    return "\n".join(lines)


def _row(region: dict[str, Any], scale: float) -> list[str]:
    edges, share = region["boundary_frequency"], region["share_of_range"]
    mesh = region["mesh"] if region["mesh"].count("+") < 2 else "several"
    growth = f"{region['growth_rate']:.4g}"
    ends = [f"{edge / scale:.6g}" for edge in edges]
    if region["endless"]:
        ends = ["(no end)", "(no end)"]
    return [region["label"], mesh, *ends, "-" if share is None else f"{100 * share:.2f} %", growth]


def _contact_ratios(closed: dict[str, Any]) -> str:
    found = closed.get("contact_ratio", {})
    numbers = {f"{ratio:.4g}" for ratio in found.values()}
    if len(numbers) == 1 and len(found) > 1:
        return f"{', '.join(found)} {numbers.pop()}"
    return ", ".join(f"{name} {ratio:.4g}" for name, ratio in found.items())


def _phasing(closed: dict[str, Any], key: str) -> str:
    p = closed.get("phasing")
    if p is None or p["key"] != key:
        return ""
    return f"{p['mesh']} {p['value']:.4g}" + (f" ({100 * p['leaves']:.0f} % left)" if p["leaves"] else "")


def _sun_teeth(closed: dict[str, Any]) -> str:
    if "sun_teeth_modulo" not in closed:
        return ""
    p = closed["sun_teeth_modulo"]
    return f"{' or '.join(map(str, p['remainders']))} (mod {p['planets']})"


HEADER = ("region", "mesh", "from", "to", "of the sweep", "growth rate")
CLOSED_BY: dict[str, Callable[[dict[str, Any]], str]] = {
    "damping ratio": lambda closed: f"{closed['damping_ratio']:.3g}",
    "contact ratio": _contact_ratios,
    "phasing": lambda closed: _phasing(closed, "phasing"),
    "lag": lambda closed: _phasing(closed, "lag"),
    "sun's teeth": _sun_teeth,
}
"""Heading -> what closes a region, "" where it does not."""


def _next(region: dict[str, Any], scale: float, unit: str) -> str:
    where = f"{region['center_frequency'] / scale:.6g} {unit}".strip()
    opens = f"opens at epsilon x {region['threshold']:.3g}, or with a damping ratio below"
    return f"{region['label']} at {where} {opens} {region['closed_by']['damping_ratio']:.3g}."
