"""What the builders share: arrays from nested parameters, meshes and damping."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from gearstab.modal import modal_damping_matrix
from gearstab.system import Array, GearSystem, Mesh, PeriodicForce
from gearstab.waveforms import Fourier, Rectangular


def vector(values: Sequence[Any] | Array) -> Array:
    """``(..., n)`` from n numbers, any of which may be an array of batch shape."""
    if isinstance(values, np.ndarray):
        return values
    return np.stack(np.broadcast_arrays(*[np.asarray(v, dtype=float) for v in values]), axis=-1)


def matrix(rows: Sequence[Sequence[Any]] | Array) -> Array:
    """``(..., n, m)`` from nested numbers, any of which may be an array of batch shape."""
    if isinstance(rows, np.ndarray):
        return rows
    return np.stack(np.broadcast_arrays(*[vector(row) for row in rows]), axis=-2)


def diagonal(values: Sequence[Any]) -> Array:
    """``(..., n, n)`` diagonal matrix."""
    entries = vector(values)
    return entries[..., :, None] * np.eye(entries.shape[-1])


def mesh(p: dict[str, Any], direction: Array, frequency_ratio: Fraction = Fraction(1), lag: Any = 0.0) -> Mesh:
    """A mesh from its parameters.

    The stiffness is given by ``mean_stiffness`` k_g or ``max_stiffness`` k_max (the stiffer level is kept, Lin & Parker
    2002 section 4: k_g = k_max - 2 k_a (1 - d)), its variation by ``epsilon`` = k_a/k_g or ``amplitude`` = k_a.
    """
    waveform = Rectangular(np.asarray(p["contact_ratio"], dtype=float))
    # A wave that keeps its stiffer level does so for an integer contact ratio too, where it is never reached.
    above_mean = 1.0 - waveform.stiff_fraction
    epsilon, amplitude = p.get("epsilon"), p.get("amplitude")
    if p.get("max_stiffness") is not None:
        maximum = np.asarray(p["max_stiffness"], dtype=float)
        if amplitude is not None:
            mean = maximum - 2 * np.asarray(amplitude) * above_mean
        else:
            mean = maximum / (1 + 2 * np.asarray(epsilon) * above_mean)
    else:
        mean = np.asarray(p["mean_stiffness"], dtype=float)
    if amplitude is not None:
        epsilon = np.asarray(amplitude) / mean
    return Mesh(p["name"], direction, mean, np.asarray(epsilon, dtype=float), waveform, frequency_ratio, lag)


def damped(system: GearSystem, p: dict[str, Any]) -> GearSystem:
    """The system with the damping its parameters ask for.

    ``damping_ratio`` zeta: C = M Phi diag(2 zeta w) Phi^T M; ``damping``: ``{modal: [...]}``, ``{rayleigh: [alpha,
    beta]}`` (C = alpha M + beta K of the mean system) or ``{matrix: C}``; ``damping`` of a mesh adds c_i g_i g_i^T.
    Exactly no damping stays None, so that the undamped theory applies.
    """
    mean = system.mean_stiffness_matrix()
    parts: list[Array] = []
    if _given(p, "damping_ratio"):
        parts.append(modal_damping_matrix(system.mass, mean, np.asarray(p["damping_ratio"])[..., None]))
    spec = p.get("damping") or {}
    if spec.get("modal") is not None:
        parts.append(modal_damping_matrix(system.mass, mean, vector(spec["modal"])))
    if spec.get("rayleigh") is not None:
        alpha, beta = (np.asarray(v)[..., None, None] for v in spec["rayleigh"])
        parts.append(alpha * system.mass + beta * mean)
    if spec.get("matrix") is not None:
        parts.append(matrix(spec["matrix"]))
    for part, item in zip(p["meshes"], system.meshes, strict=True):
        if _given(part, "damping"):
            parts.append(np.asarray(part["damping"])[..., None, None] * item.outer)
    total = np.zeros_like(mean)
    for part in parts:
        total = total + part
    return replace(system, damping=total) if np.any(total) else system


def driven(system: GearSystem, p: dict[str, Any]) -> GearSystem:
    """The system with what drives it.

    ``load``: constant generalised forces, one a coordinate; ``forces``: periodic ones, each a ``direction`` and a
    Fourier series ``sin``, ``cos`` with ``frequency_ratio`` and ``lag``; ``transmission_error`` of a mesh: ``sin``,
    ``cos``. A transmission error acts through the mesh's own damping too.
    """
    meshes = tuple(
        replace(
            item,
            transmission_error=series(part["transmission_error"]) if part.get("transmission_error") else None,
            damping=np.asarray(part["damping"], dtype=float) if _given(part, "damping") else 0.0,
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


def series(p: dict[str, Any]) -> Fourier:
    """A Fourier series from its amplitudes ``sin`` and ``cos``, either of which may be shorter or missing."""
    sin, cos = list(p.get("sin") or []), list(p.get("cos") or [])
    order = max(len(sin), len(cos))
    return Fourier(*(vector([*part, *[0.0] * (order - len(part))]) for part in (sin, cos)))


def _given(p: dict[str, Any], key: str) -> bool:
    """Whether a number is there and not zero everywhere."""
    return p.get(key) is not None and bool(np.any(np.asarray(p[key]) != 0))
