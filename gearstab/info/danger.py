"""Dangerous mesh frequencies or speeds: ranked, and what would close each region."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf
from typing import Any

from gearstab.config import Config
from gearstab.config.model.units import scale as scale_of
from gearstab.errors import NotPossible
from gearstab.floquet.general.mean import mean_motions
from gearstab.info import (
    DangerousRegion,
    DangerousSpeeds,
    JudgedRegions,
    Remedies,
    ShownSpeeds,
    label_text,
    meshes_text,
    table,
    verified,
)
from gearstab.info.verified import OpenRegion, SpeedScan, Trial, peak
from gearstab.perturbation import remedies
from gearstab.perturbation.multiple_scales import group_of, modal_rows
from gearstab.perturbation.remedies import RankedRegion, Ranking, Resonance, rank
from gearstab.perturbation.tongues import SELF_EXCITED, Tongue
from gearstab.symmetry import can_couple, deflection_types, natural_modes, phase_step, turns
from gearstab.system import ANY_LINEAR, WHIRLING, Array, GearSystem, unsupported

WORTHWHILE = 0.5
"""A remedy that leaves more than this part of a region is not mentioned."""
MOST, NEAREST = 12, 3
"""Regions that are listed: open ones, and closed ones that are next to open."""


def facts(config: Config, system: GearSystem, harmonics: int) -> DangerousSpeeds:
    """Return the regions in the range of the sweep by what they do there. harmonics: at least so many are looked at."""
    axis = next((a for a in config.axes if a.mesh_frequency is not None), None)
    low, high, shown = 0.0, inf, ShownSpeeds("mesh frequency", "" if "time" in system.dimensionless else "rad/s", 1.0)
    if axis is not None and axis.mesh_frequency is not None:
        values, teeth = axis.mesh_frequency.values, axis.mesh_frequency.factor
        low, high = float(min(values)), float(max(values))
        one = scale_of(axis.typed_units, axis.units) if axis.typed_units else 1.0
        shown = ShownSpeeds(axis.long_name, axis.typed_units or shown.unit, teeth * one, teeth)
    refused = unsupported(system, ANY_LINEAR | WHIRLING)
    return DangerousSpeeds(
        shown,
        None if axis is None else [low / shown.scale, high / shown.scale],
        refused and refused[0],
        None if refused else judged(config, system, low, high, harmonics),
    )


def judged(config: Config, system: GearSystem, low: float, high: float, harmonics: int) -> JudgedRegions:
    """Return the regions between two mesh frequencies."""
    found = rank(system, low, high, harmonics, MOST, MOST)
    width, effort = high - low, verified.effort(system)
    decided = _decided(system, found, low, high) if effort <= verified.AFFORDABLE else None
    if decided is None:
        opened, closest, looked = [_region(config, system, r, width) for r in found.open], found.closest, None
        count = found.opened
    else:
        rows, closest, looked = decided
        tried = 0 if not found.real_modes else MOST if effort <= verified.CHEAP else verified.FEW
        opened = [_open(config, system, *row, (low, high), k < tried) for k, row in enumerate(rows[:MOST])]
        count = max(found.opened - len(found.open), 0) + len(rows)
    return JudgedRegions(
        harmonics=found.harmonics,
        verified=decided is not None,
        scanned=0 if looked is None else len(looked.omega),
        unstable_share=None if looked is None else float(looked.unstable.mean()),
        not_judged=_not_judged(system) if found.real_modes else [],
        without_remedies=not found.real_modes,
        open=opened,
        closest=[_region(config, system, region, width) for region in closest[:NEAREST]],
        number_open=count,
        number_closed_by_damping=found.closed,
        number_not_excited=found.quiet,
        refuted=sum(len(row.closed_by.refuted or ()) for row in opened),
    )


def _decided(
    system: GearSystem, found: Ranking, low: float, high: float
) -> tuple[list[tuple[OpenRegion, Tongue, Resonance | None]], tuple[RankedRegion, ...], SpeedScan | None] | None:
    """Exact regions in a range with the tongue each stands under, the widest there first; candidates that are closed;
    and the scan for others, None without a range. None where one of them could not be decided.
    """
    rows: list[tuple[OpenRegion, Tongue, Resonance | None]] = []
    closed: list[RankedRegion] = []
    # Where the mean system grows by itself, no tongue is what makes a speed dangerous.
    alone = found.real_modes and bool(mean_motions(system).unstable.any())
    for region in () if alone else (*found.open, *found.closest):
        window = verified.window(system, region.tongue, region.half_width, region.root)
        near = verified.whole_regions(system, region.tongue, *window)
        if near is None:
            return None
        own = [item for item in near if any(verified.same(t, region.tongue) for t in item.tongues)]
        own = [item for item in own if item.lower < high and item.upper > low]
        if not own and region.threshold > 1:
            closed.append(region)
        known = [row[0] for row in rows]
        rows += [(item, region.tongue, region.amplitudes) for item in own if not _listed(item, known)]
    looked = verified.scan(system, low, high) if high < float("inf") and high > low else None
    if looked is not None:
        for item in verified.unlisted(system, looked, [row[0] for row in rows], MOST):
            if not _listed(item, [row[0] for row in rows]):
                rows.append((item, item.tongues[0], None))
    rows.sort(key=lambda row: -_inside(row[0], low, high))
    return rows, tuple(closed), looked


def _not_judged(system: GearSystem) -> list[int]:
    """Numbers of the modes that meshes deflect and whose mean stiffness is not positive."""
    modes = natural_modes(system)
    return [k + 1 for k, own in enumerate(~(modes.squared_frequency > 0) & ~modes.rigid) if own]


def _listed(item: OpenRegion, known: Sequence[OpenRegion]) -> bool:
    """Whether a region is one of the known ones, found in another window."""
    return any(item.lower < other.upper and item.upper > other.lower for other in known)


def _inside(item: OpenRegion, low: float, high: float) -> float:
    return min(item.upper, high) - max(item.lower, low)


def _region(config: Config, system: GearSystem, region: RankedRegion, width: float) -> DangerousRegion:
    """A region as first order has it."""
    found = region.amplitudes
    advice = {} if found is None else _advice(config, system, region.tongue, found)
    return DangerousRegion.of(
        region.tongue,
        boundary_frequency=None if region.lower != region.lower else [region.lower, region.upper],
        endless=region.endless,
        share_of_range=region.inside / width if width < float("inf") and width > 0 else None,
        center_frequency=region.center,
        growth_rate=None if found is None else found.growth_rate,
        threshold=region.threshold,
        closed_by=Remedies() if found is None else Remedies(damping_ratio=found.damping_ratio, **advice),
    )


def _open(
    config: Config, system: GearSystem, region: OpenRegion, tongue: Tongue, amplitudes: Resonance | None,
    span: tuple[float, float], trying: bool,
) -> DangerousRegion:  # fmt: skip
    """An exact region and, where they are tried, the remedies of first order that hold."""
    width, growth = span[1] - span[0], peak(system, region)
    trying &= tongue.kind != SELF_EXCITED
    return DangerousRegion.of(
        tongue,
        boundary_frequency=[region.lower, region.upper],
        endless=False,
        share_of_range=_inside(region, *span) / width if width < float("inf") and width > 0 else None,
        center_frequency=0.5 * (region.lower + region.upper),
        growth_rate=growth,
        threshold=None,
        closed_by=_tried(config, system, region, growth, tongue, amplitudes) if trying else Remedies(),
    )


def _tried(
    config: Config, system: GearSystem, region: OpenRegion, growth: float, tongue: Tongue, amplitudes: Resonance | None
) -> Remedies:
    """The remedies of a region that exact search near it confirms; ``refuted`` names the kinds of the others."""
    low, high = verified.window(system, tongue, region.width)
    trial = verified.Trial(config, system, region, growth, tongue, min(low, region.lower), max(high, region.upper))
    closed: dict[str, Any] = {}
    refuted = []
    try:
        closed["damping_ratio"] = trial.damping_ratio()
        refuted += [] if closed["damping_ratio"] is not None else ["damping_ratio"]
    except NotPossible:
        pass  # no damping ratio belongs to this region
    advice = _advice(config, system, tongue, amplitudes) if amplitudes is not None else {}
    for kind, given in advice.items():
        held = _held(trial, kind, given)
        closed |= held
        refuted += [] if held else [kind]
    return Remedies(**closed, refuted=refuted or None)


def _held(trial: Trial, kind: str, given: dict[str, Any]) -> dict[str, Any]:
    """A remedy and the part of the region that it leaves; empty where that is more than WORTHWHILE or not decided."""
    if kind == "sun_teeth_modulo":
        left = {z: trial.lags(_turned(trial.system, z)) for z in given["remainders"]}
        good = {z: part for z, part in left.items() if part is not None and part <= WORTHWHILE}
        return {kind: given | {"remainders": list(good), "leaves": max(good.values())}} if good else {}
    if kind == "phasing":
        left_over = trial.phasing(given["number"], given["key"], given["value"])
    else:
        groups = _alike(trial.system, getattr(trial.config.system, "meshes", None))
        left_over = trial.contact_ratios({i: ratio for name, ratio in given.items() for i in groups[name]})
    if left_over is None or left_over > WORTHWHILE:
        return {}
    if kind == "phasing":
        return {kind: given | {"leaves": left_over}}
    return {kind: given, "contact_ratio_leaves": left_over}


def _turned(system: GearSystem, step: int) -> Array:
    """Lags to add to all meshes of a planetary gear for another phase step z; 0 for the first mesh of each gear."""
    present = phase_step(system) or 0
    return turns(system) * (step - present) / system.symmetries[0].order


def _advice(config: Config, system: GearSystem, tongue: Tongue, found: Resonance) -> dict[str, Any]:
    """Contact ratios, a phasing or tooth numbers that close a region to first order, those there are."""
    meshes: Any = getattr(config.system, "meshes", None)
    advice: dict[str, Any] = {}
    groups = _alike(system, meshes)
    ratios = remedies.contact_ratios(system, found, list(groups.values()))
    if ratios:
        names = {numbers[0]: name for name, numbers in groups.items()}
        advice["contact_ratio"] = {names[i]: ratio for i, ratio in ratios.items()}
    if phase_step(system) is not None:
        planets = system.symmetries[0].order
        allowed = _excluding(system, tongue, planets)
        return advice | ({"sun_teeth_modulo": {"planets": planets, "remainders": allowed}} if allowed else {})
    best = remedies.phasing(found) if isinstance(meshes, list | tuple) else None
    if (
        best is not None
        and best.left <= WORTHWHILE
        and (place := _places(meshes).get(system.meshes[best.mesh].name)) is not None
    ):
        key, value = _phase(meshes[place], best.shift)
        left = 0.0 if best.closes else best.left
        name = meshes[place].name
        advice["phasing"] = {"mesh": name, "number": place, "key": key, "value": value, "leaves": left}
    return advice


def _alike(system: GearSystem, meshes: Any) -> dict[str, list[int]]:
    """Numbers of the meshes of the system by what describes them: an entry of the configuration, or part of a set."""
    found: dict[str, list[int]] = {}
    for i, mesh in enumerate(system.whole_meshes):
        name = mesh.name if mesh.name in _places(meshes) else mesh.name.rstrip("0123456789").rstrip(".")
        found.setdefault(name, []).append(i)
    return found


def _places(meshes: Any) -> dict[str, int]:
    """Places of the meshes in a list of the configuration, by name."""
    return {mesh.name: k for k, mesh in enumerate(meshes)} if isinstance(meshes, list | tuple) else {}


def _phase(mesh: Any, shift: float) -> tuple[str, float]:
    """The key of a mesh that says when its wave begins, and the value that adds ``shift`` to its lag."""
    key, sense = ("phasing", -1) if hasattr(mesh, "phasing") else ("lag", 1)
    return key, round((float(getattr(mesh, key, 0.0)) + sense * shift) % 1.0, 9) % 1.0


def _excluding(system: GearSystem, tongue: Tongue, planets: int) -> list[int]:
    """Remainders of the sun's tooth number over the number of planets that exclude a region by the existence rule."""
    turns = deflection_types(system, natural_modes(system))
    modal = modal_rows(system)
    types = [{int(turns[k]) for k in group_of(modal, mode - 1)} - {-1} for mode in (tongue.mode_p, tongue.mode_q)]
    return [
        z
        for z in range(planets)
        if not any(can_couple(planets, z, tongue.harmonic, a, b) for a in types[0] for b in types[1])
    ]


# ---- text


def text(dangerous: DangerousSpeeds, unstable: bool = False) -> str:
    """The ranked regions as a table, or what is next to open; unstable: whether the mean system grows by itself."""
    shown, found = dangerous.shown, dangerous.judged
    within = "" if dangerous.range is None else " from {:.6g} to {:.6g}".format(*dangerous.range)
    where = f"{shown.name}{within} {shown.unit}".strip()
    if found is None:
        return f"Dangerous speeds: {where}: not listed, as first-order theory {dangerous.refused}; sweep boundaries."
    lines = [f"Dangerous speeds: {where} ({_how(found)})", ""]
    if unstable:
        lines.append("The mean system grows by itself, see above: remedies of parametric instability are not tried.")
    if found.not_judged and not found.verified:
        modes = ", ".join(map(str, found.not_judged))
        lines.append(f"First order says nothing of modes without a positive mean stiffness ({modes}).")
    if found.open:
        lines += _table(found, shown.scale)
    elif found.unstable_share:
        lines.append(f"Unstable at {100 * found.unstable_share:.3g} % of the speeds; their edges were not found.")
    elif found.unstable_share == 0 or not unstable:
        lines.append("No region of instability is open there" + ("." if found.verified else " to first order."))
    if not found.open and not unstable:
        lines += [_next(region, shown.scale, shown.unit) for region in found.closest]
    if count := found.number_closed_by_damping:
        lines.append(f"To first order damping closes {count} region{'s' * (count != 1)} centred there.")
    if count := found.refuted:
        lines.append(f"Left out: {count} remed{'ies' if count > 1 else 'y'} of first order that exact search refutes.")
    return "\n".join(lines)


def _table(found: JudgedRegions, scale: float) -> list[str]:
    """The open regions and what closes them."""
    columns = {heading: [cell(r.closed_by) for r in found.open] for heading, cell in CLOSED_BY.items()}
    columns = {heading: cells for heading, cells in columns.items() if any(cells)}
    more = zip(*columns.values(), strict=True) if columns else ([] for _ in found.open)
    rows = [[*_row(region, scale), *cells] for region, cells in zip(found.open, more, strict=True)]
    lines = [table([*HEADER, *columns], rows)]
    sure = "" if found.verified else " to first order, not verified"
    if columns:
        lines.append(f"Any one of the last columns closes a region{sure}, or leaves the part of it in brackets.")
    if found.without_remedies:
        lines.append("What would close them is not proposed: the rules for it go by real modes, which do not whirl.")
    elif any(region.closed_by == Remedies() and region.kind != SELF_EXCITED for region in found.open):
        lines.append("Remedies were tried for the first regions only.")
    if found.number_open > len(found.open):
        lines.append(f"and {found.number_open - len(found.open)} narrower ones, to first order.")
    return lines


def _how(found: JudgedRegions) -> str:
    """How sure the list is."""
    looked = f"harmonics up to {found.harmonics}"
    if not found.verified:
        return f"first order, not verified, base system, {looked}"
    scanned = f" and at {found.scanned} speeds" if found.scanned else ""
    return f"exact near tongues{scanned}; base system, {looked}"


def _row(region: DangerousRegion, scale: float) -> list[str]:
    edges, share = region.boundary_frequency or (), region.share_of_range
    mesh = meshes_text(region.mesh.split("+"))
    mesh = mesh if mesh.count(",") < 2 else "several"
    growth = "-" if region.growth_rate is None else f"{region.growth_rate:.4g}"
    ends = [f"{edge / scale:.6g}" for edge in edges]
    if region.endless:
        ends = ["(no end)", "(no end)"]
    return [label_text(region.label), mesh, *ends, "-" if share is None else f"{100 * share:.2f} %", growth]


def _contact_ratios(closed: Remedies) -> str:
    found = closed.contact_ratio or {}
    numbers = {f"{ratio:.4g}" for ratio in found.values()}
    left = _left(closed.contact_ratio_leaves)
    if len(numbers) == 1 and len(found) > 1:
        return f"{', '.join(found)} {numbers.pop()}{left}"
    return ", ".join(f"{name} {ratio:.4g}" for name, ratio in found.items()) + left


def _left(part: float | None) -> str:
    """Region that a remedy leaves, "" where it closes the region."""
    return f" ({100 * part:.2g} %)" if part else ""


def _phasing(closed: Remedies, key: str) -> str:
    p = closed.phasing
    return "" if p is None or p["key"] != key else f"{p['mesh']} {p['value']:.4g}{_left(p['leaves'])}"


def _sun_teeth(closed: Remedies) -> str:
    p = closed.sun_teeth_modulo
    return f"{' or '.join(map(str, p['remainders']))} (mod {p['planets']}){_left(p.get('leaves'))}" if p else ""


HEADER = ("region", "mesh", "from", "to", "of the sweep", "growth rate")
CLOSED_BY: dict[str, Callable[[Remedies], str]] = {
    "damping ratio": lambda closed: f"{closed.damping_ratio:.3g}" if closed.damping_ratio else "",
    "contact ratio": _contact_ratios,
    "phasing": lambda closed: _phasing(closed, "phasing"),
    "lag": lambda closed: _phasing(closed, "lag"),
    "sun's teeth": _sun_teeth,
}
"""Heading -> what closes a region, "" where it does not."""


def _next(region: DangerousRegion, scale: float, unit: str) -> str:
    where = f"{region.center_frequency / scale:.6g} {unit}".strip()
    ratio = region.closed_by.damping_ratio
    less = "" if ratio is None else f" or with a damping ratio below {ratio:.3g}"
    return f"{label_text(region.label)} at {where} opens, to first order, at epsilon x {region.threshold:.3g}{less}."
