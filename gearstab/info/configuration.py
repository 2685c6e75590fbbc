"""Facts about a configuration: modes and predicted instability tongues of its base system, as facts."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from gearstab.config import Config
from gearstab.config.sections.design import Design, objective_name
from gearstab.floquet.dispatch import reduction
from gearstab.floquet.segments.reduction import reduce
from gearstab.info import MeanSystem, danger, speeds, train
from gearstab.modal import mesh_energy_shares, modal_damping_ratios, significant_deflection
from gearstab.perturbation import PERTURBATION_FLAGS, first_order, second_order
from gearstab.perturbation.multiple_scales import partitions
from gearstab.perturbation.second_order import SUPPORTS
from gearstab.perturbation.tongues import SELF_EXCITED, overlapping
from gearstab.symmetry import can_couple, deflection_types, natural_modes, phase_step, type_names
from gearstab.system import ANY_LINEAR, GearSystem, of_wholes, unsupported
from gearstab.waveforms import WAVEFORMS

HARMONICS = 3
"""Harmonics whose tongues are listed where the configuration does not ask for perturbation theory itself."""


def describe(config: Config, harmonics: int | None = None) -> dict[str, Any]:
    """Return all that ``info`` shows: numbers, texts, lists and records; None where a number does not exist."""
    system = config.system.build()
    asked = config.methods.perturbation
    theory = asked.order if asked and not unsupported(system, SUPPORTS) else 1
    order = harmonics or (asked.harmonics if asked else HARMONICS)
    sweep = {axis.name: axis.size for axis in config.axes}
    orders = config.system.cycles_of_input()
    dangerous = danger.facts(config, system, order)
    nothing: dict[str, Any] = {"tongues": [], "existence_rule": None}
    return {
        "title": config.title,
        "kind": config.kind,
        "formulation": getattr(config.system, "formulation", None),
        "coordinates": list(system.coordinates),
        "summary": config.system.summary(),
        "sweep": sweep,
        "frequency_range": _frequency_range(config),
        "unit": "" if "time" in system.dimensionless else "rad/s",
        "per_unit": 1.0,
        "meshes": [_mesh(system, i, orders) for i in range(len(system.whole_meshes))],
        "faults": speeds.faults(system, orders),
        "common_period": speeds.common_period(system),
        "frequencies": speeds.frequencies(config, system),
        **_modes(system),
        "mean_system": MeanSystem.of(system),
        "held_rotations": any(rotation.speed_ratio is None for rotation in system.rotations),
        "rotations": speeds.rotation_facts(system, _frequency_range(config)),
        "train": train.facts(config, system),
        "reductions": _reductions(system),
        "terms": [term.name for term in system.terms],
        "design": None if config.design is None else _design(config.design),
        "order": theory,
        "harmonics": order,
        "dangerous": dangerous,
        **(nothing if dangerous.refused else _existence(system, _tongues(system, theory, order))),
    }


def _design(design: Design) -> dict[str, Any]:
    """Goal of a search by ``gearstab design``."""
    return {
        "ranges": [{item.of: [item.low, item.high], "weight": item.weight} for item in design.ranges],
        "variables": {v.name: list(v.bounds) if v.continuous else v.axis.size for v in design.variables},
        "minimise": [objective_name(weights) for weights in design.objectives],
        "constraints": [limit.name for limit in design.limits],
    }


def _frequency_range(config: Config) -> list[float] | None:
    """The lowest and highest mesh frequency of the sweep."""
    found = [axis.mesh_frequency.values for axis in config.axes if axis.mesh_frequency]
    return [float(min(found[0])), float(max(found[0]))] if found else None


def _number(value: Any) -> float | str | None:
    """A number for JSON: no NaN, and infinity by name."""
    number = float(value)
    if number != number:
        return None
    return "infinite" if abs(number) == float("inf") else number


def _mesh(system: GearSystem, i: int, orders: float | None) -> dict[str, Any]:
    """A mesh; orders: cycles of a mesh of frequency ratio 1 per turn of the input, None where no teeth are known."""
    mesh = system.meshes[i]
    low, high = (float(mesh.mean_stiffness + 2 * mesh.amplitude * level) for level in mesh.waveform.extremes())
    contact_ratio = getattr(mesh.waveform, "contact_ratio", None)
    return {
        "name": mesh.name,
        "frequency_ratio": str(mesh.frequency_ratio),
        "order": None if orders is None else orders * float(mesh.frequency_ratio),
        "waveform": next((name for name, kind in reversed(WAVEFORMS.items()) if isinstance(mesh.waveform, kind)), None),
        "mean_stiffness": float(mesh.mean_stiffness),
        "epsilon": float(mesh.epsilon),
        "contact_ratio": None if contact_ratio is None else float(contact_ratio),
        "lag": float(mesh.lag) % 1.0,
        "stiffness": [low, high],
    }


def _modes(system: GearSystem) -> dict[str, Any]:
    modes = natural_modes(system)
    names = [mesh.name for mesh in system.whole_meshes]
    ratios, shares = modal_damping_ratios(system, modes), of_wholes(mesh_energy_shares(system, modes), system.wholes)
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
    found = reduction(system)
    blocks = [{name: list(v) if isinstance(v, tuple) else v for name, v in asdict(p).items()} for p in found.parts]
    return {
        "summary": found.text(),
        "rigid_modes": list(found.rigid),
        "rigid_driven": bool(any(part.rigid_driven.any() for part in reduce(system))),
        "dropped_modes": list(found.dropped),
        "blocks": blocks,
        "saving": _number(found.saving),
    }


def _existence(system: GearSystem, found: dict[str, Any]) -> dict[str, Any]:
    """Return the tongues of :func:`_tongues` with the existence rule L z +- (T_p +- T_q) = j N, None where it does not
    apply.

    ``types`` of a tongue are the T of all modes that share its two frequencies; ``allowed`` whether the rule holds for
    any pair of them. Motions that are no real modes have no rule: their numbers go with the mesh frequency.
    """
    step = None if unsupported(system, ANY_LINEAR) else phase_step(system)
    if step is None:
        return {"existence_rule": None, **found}
    order = system.symmetries[0].order
    modes = natural_modes(system)
    turns = deflection_types(system, modes)
    ((_, groups),) = partitions(modes.natural_frequency[None])
    of = {p + 1: sorted({int(turns[k]) for k in group} - {-1}) for group in groups for p in group}
    for tongue in found["tongues"]:
        first, second = of[tongue["mode_p"]], of[tongue["mode_q"]]
        tongue["types"] = [first, second]
        tongue["allowed"] = any(can_couple(order, step, tongue["harmonic"], a, b) for a in first for b in second)
    return {"existence_rule": {"planets": order, "step": step}, **found}


def _tongues(system: GearSystem, order_of_theory: int, harmonics: int) -> dict[str, Any]:
    """The tongues, and the numbers of the modes that grow by themselves."""
    tongues = (first_order if order_of_theory == 1 else second_order)(system, harmonics)
    second, status = tongues.boundary_error is not None, np.asarray(tongues.status)
    overlap = overlapping(tongues)
    order = np.argsort(tongues.center_frequency, kind="stable")
    rows = [
        {
            "label": tongues.index[k].label,
            "kind": tongues.index[k].kind,
            "mesh": tongues.index[k].mesh,
            "mode_p": tongues.index[k].mode_p,
            "mode_q": tongues.index[k].mode_q,
            "harmonic": tongues.index[k].harmonic,
            "frequency_ratio": tongues.index[k].frequency_ratio,
            "center_frequency": _number(tongues.center_frequency[k]),
            "half_width": _number(tongues.half_width[k]),
            "boundary_frequency": [_number(edge) for edge in tongues.boundary_frequency[k]],
            "threshold": _number(tongues.threshold[k]),
            "overlaps": bool(overlap[k]),
        }
        | ({"boundary_error": [_number(e) for e in np.asarray(tongues.boundary_error)[k]]} if second else {})
        | ({"status": [n for n, bit in PERTURBATION_FLAGS.items() if int(status[k]) & bit]} if second else {})
        for k in order
        if np.isfinite(tongues.center_frequency[k])
    ]
    return {"tongues": rows, "self_excited": [t.mode_p for t in tongues.index if t.kind == SELF_EXCITED]}
