"""What the builders share: arrays from nested parameters, meshes and damping."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from gearstab.modal import modal_damping_matrix
from gearstab.system import Array, GearSystem, Mesh, PeriodicForce, PeriodicTerm
from gearstab.systems.arrays import diagonal, given, matrix, series, vector
from gearstab.systems.waveforms import above_mean, own_variation, waveform
from gearstab.waveforms import Scaled

__all__ = ["damped", "diagonal", "driven", "matrix", "mesh", "series", "vector"]


def mesh(p: dict[str, Any], direction: Array, frequency_ratio: Fraction | float = Fraction(1), lag: Any = 0.0) -> Mesh:
    """A mesh from its parameters.

    The stiffness is given by ``mean_stiffness`` k_g or ``max_stiffness`` k_max (the stiffer level is kept, Lin & Parker
    2002 section 4: k_g = k_max - 2 k_a (1 - d)), its variation by ``epsilon`` = k_a/k_g or ``amplitude`` = k_a; what is
    not given is that of a ``waveform`` made from stiffnesses.
    """
    wave = waveform(p)
    epsilon, amplitude, maximum = p.get("epsilon"), p.get("amplitude"), p.get("max_stiffness")
    if epsilon is None and amplitude is None:
        epsilon = _ratio(*own_variation(wave))
    if maximum is not None:
        # A wave that keeps its stiffer level does so for an integer contact ratio too, where it is never reached.
        maximum, above = np.asarray(maximum, dtype=float), above_mean(wave)
        if amplitude is not None:
            mean = maximum - 2 * np.asarray(amplitude) * above
        else:
            mean = maximum / (1 + 2 * np.asarray(epsilon) * above)
    elif p.get("mean_stiffness") is not None:
        mean = np.asarray(p["mean_stiffness"], dtype=float)
    else:
        mean = own_variation(wave)[0]
    if amplitude is not None:
        epsilon = np.asarray(amplitude) / mean
    return Mesh(p["name"], direction, mean, np.asarray(epsilon, dtype=float), wave, frequency_ratio, lag)


def _ratio(mean: Array, amplitude: Array) -> Array:
    """amplitude/mean; 0 where the mean is, which is an error that the configuration reports."""
    return np.where(mean != 0, amplitude / np.where(mean != 0, mean, 1.0), 0.0)


def damped(system: GearSystem, p: dict[str, Any]) -> GearSystem:
    """The system with the damping its parameters ask for.

    ``damping_ratio`` zeta: C = M Phi diag(2 zeta w) Phi^T M; ``damping``: ``{modal: [...]}``, ``{rayleigh: [alpha,
    beta]}`` (C = alpha M + beta K of the mean system) or ``{matrix: C}``; ``damping`` of a mesh adds c_i g_i g_i^T,
    or with ``damping_follows_stiffness`` the periodic term c_i k_i(t)/k_gi g_i g_i^T. Exactly no damping stays None,
    so that the undamped theory applies.
    """
    mean = system.mean_stiffness_matrix()
    parts: list[Array] = []
    if given(p, "damping_ratio"):
        parts.append(modal_damping_matrix(system.mass, mean, np.asarray(p["damping_ratio"])[..., None]))
    spec = p.get("damping") or {}
    if spec.get("modal") is not None:
        parts.append(modal_damping_matrix(system.mass, mean, vector(spec["modal"])))
    if spec.get("rayleigh") is not None:
        alpha, beta = (np.asarray(v)[..., None, None] for v in spec["rayleigh"])
        parts.append(alpha * system.mass + beta * mean)
    if spec.get("matrix") is not None:
        parts.append(matrix(spec["matrix"]))
    terms = []
    for part, item in zip(p["meshes"], system.meshes, strict=True):
        if given(part, "damping") and part.get("damping_follows_stiffness") and np.any(item.epsilon):
            terms.append(_following(item, np.asarray(part["damping"], dtype=float)))
        elif given(part, "damping"):
            parts.append(np.asarray(part["damping"])[..., None, None] * item.outer)
    total = np.zeros_like(mean)
    for part in parts:
        total = total + part
    system = replace(system, terms=system.terms + tuple(terms))
    return replace(system, damping=total) if np.any(total) else system


def _following(mesh: Mesh, damping: Array) -> PeriodicTerm:
    """c k(t)/k_g g g^T: a mesh damping that varies as the mesh stiffness does."""
    profile = Scaled(mesh.waveform, damping, 2 * mesh.epsilon * damping)
    g = mesh.direction
    name, ratio = f"damping of {mesh.name}", mesh.frequency_ratio
    return PeriodicTerm(name, g, g, damping=profile, frequency_ratio=ratio, lag=mesh.lag, mesh=mesh.name)


def driven(system: GearSystem, p: dict[str, Any]) -> GearSystem:
    """The system with what drives it.

    ``load``: constant generalised forces, one a coordinate; ``forces``: periodic ones, each a ``direction`` and a
    Fourier series ``sin``, ``cos`` with ``frequency_ratio`` and ``lag``; ``transmission_error`` of a mesh: ``sin``,
    ``cos``. A transmission error acts through the mesh's own damping too. ``backlash`` of a mesh, 2 b, and its
    ``backlash_zero``, which only the response heeds, come with it.
    """
    meshes = tuple(
        replace(
            item,
            transmission_error=series(part["transmission_error"]) if part.get("transmission_error") else None,
            damping=np.asarray(part["damping"], dtype=float) if _constant_damping(part) else 0.0,
            backlash=np.asarray(part["backlash"], dtype=float) if given(part, "backlash") else 0.0,
            backlash_zero=part.get("backlash_zero", "middle"),
        )
        for part, item in zip(p["meshes"], system.meshes, strict=True)
    )
    forces = tuple(
        PeriodicForce(
            part.get("name") or f"force{i + 1}", vector(part["direction"]), series(part), part["frequency_ratio"],
            np.asarray(part.get("lag", 0.0), dtype=float),
        )
        for i, part in enumerate(p.get("forces") or [])
    )  # fmt: skip
    load = vector(p["load"]) if p.get("load") is not None else None
    return replace(system, meshes=meshes, forces=forces, load=load)


def _constant_damping(p: dict[str, Any]) -> bool:
    return given(p, "damping") and not p.get("damping_follows_stiffness")
