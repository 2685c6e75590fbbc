"""The forms of damping a linear system takes, and the damping matrix and periodic terms they come to."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from gearstab.config.model.axes import given, matrix, vector
from gearstab.config.model.conflicts import Conflict, exactly_one, wrong_length
from gearstab.config.model.fields import NonNegative, Section, optional
from gearstab.config.model.units import Quantity
from gearstab.mesh import Mesh, PeriodicTerm
from gearstab.modal import modal_damping_matrix
from gearstab.system import Array, GearSystem
from gearstab.waveforms import Scaled

MatrixEntry = Annotated[float, Quantity("N s/m", ("N s", "N m s"), entry=True)]


class Damping(Section):
    """Damping of the whole system, in one of three forms."""

    modal: list[NonNegative] | None = optional("modal damping ratios")
    """One damping ratio per mode, by ascending natural frequency (1)."""
    rayleigh: (
        tuple[Annotated[float, Field(ge=0), Quantity("1/s")], Annotated[float, Field(ge=0), Quantity("s")]] | None
    ) = optional("Rayleigh damping")
    """[alpha (1/s), beta (s)]: C = alpha M + beta K of the mean system."""
    matrix: list[list[MatrixEntry]] | None = optional("damping matrix")
    """C, one row per coordinate (N s/m); symmetric."""

    def conflicts(self, size: int | None) -> Iterator[Conflict]:
        """Exactly one form, of the size of the system."""
        yield from exactly_one(self, ("modal", "rayleigh", "matrix"))
        yield from wrong_length(self, "modal", size, "mode")
        yield from not_square(self, "matrix", size)


def not_square(section: Section, key: str, size: int | None) -> Iterator[Conflict]:
    """A conflict unless the nested lists at a key are ``size`` rows of ``size`` entries."""
    rows = section[key]
    if rows is None or size is None:
        return
    if len(rows) != size:
        yield (key,), "wrong_count", f"has {len(rows)} rows", f"give {size} rows of {size} numbers"
    for i, row in enumerate(rows):
        if len(row) != size:
            yield (key, i), "wrong_count", f"has {len(row)} entries", f"give {size}, one per coordinate"


def with_damping(system: GearSystem, p: Any) -> GearSystem:
    """The system with the damping its parameters ask for.

    ``damping_ratio`` zeta: C = M Phi diag(2 zeta w) Phi^T M; ``damping``: ``{modal: [...]}``, ``{rayleigh: [alpha,
    beta]}`` (C = alpha M + beta K of the mean system) or ``{matrix: C}``; ``damping`` of a mesh adds c_i g_i g_i^T,
    or with ``damping_follows_stiffness`` the periodic term c_i k_i(t)/k_gi g_i g_i^T. Exactly no damping stays None,
    so that the undamped theory applies.
    """
    mean = system.mean_stiffness_matrix()
    parts: list[Array] = []
    if given(p.damping_ratio):
        parts.append(modal_damping_matrix(system.mass, mean, np.asarray(p.damping_ratio)[..., None]))
    spec = p.damping or Damping()
    if spec.modal is not None:
        parts.append(modal_damping_matrix(system.mass, mean, vector(spec.modal)))
    if spec.rayleigh is not None:
        alpha, beta = (np.asarray(v)[..., None, None] for v in spec.rayleigh)
        parts.append(alpha * system.mass + beta * mean)
    if spec.matrix is not None:
        parts.append(matrix(spec.matrix))
    terms = []
    for part, item in zip(p.meshes, system.meshes, strict=True):
        if given(part.damping) and part.damping_follows_stiffness and np.any(item.epsilon):
            terms.append(_following(item, np.asarray(part.damping, dtype=float)))
        elif given(part.damping):
            parts.append(np.asarray(part.damping)[..., None, None] * item.outer)
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
