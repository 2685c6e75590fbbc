"""Excitation of a system, by transmission errors, a constant load and periodic forces, and its damping."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Annotated, Any

import numpy as np
from pydantic import Field, GetJsonSchemaHandler

from gearstab.config.model import given, matrix, vector
from gearstab.config.model.conflicts import Conflict, exactly_one, no_direction, wrong_length
from gearstab.config.model.fields import ExactRatio, NameText, NonNegative, Quantity, Section, Turns, Vector, optional
from gearstab.mesh import Mesh, PeriodicForce, PeriodicTerm
from gearstab.modal import modal_damping_matrix
from gearstab.system import Array, GearSystem
from gearstab.waveforms import Fourier, Scaled

ErrorAmplitude = Annotated[float, Quantity("m", ("rad",), entry=True)]
ForceAmplitude = Annotated[float, Quantity("N", ("N m",), entry=True)]
Load = list[ForceAmplitude]
"""Constant generalised forces, one per coordinate."""


@dataclass(frozen=True)
class OneAsWell:
    """Lets the schema of a list admit its one entry by itself, which ``complete`` of a system makes a list.

    only: whether the list has no more than that one.
    """

    only: bool = False

    def __get_pydantic_json_schema__(self, schema: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        plain = handler(schema)
        return {"anyOf": [plain["items"], plain | ({"minItems": 1, "maxItems": 1} if self.only else {})]}


LoadOfOne = Annotated[Load, OneAsWell(only=True)]
"""Load of a system of one coordinate."""

MOST_HARMONICS = 100


class TransmissionError(Section):
    """The unloaded static transmission error of a mesh as a Fourier series over its period."""

    sin: list[ErrorAmplitude] = Field(
        default=[], max_length=MOST_HARMONICS, title="sine amplitudes of the transmission error"
    )
    """a_s of sin s x, s = 1, 2, ..., x = Omega_i t - 2 pi lag (m, or rad where the mesh turns)."""
    cos: list[ErrorAmplitude] = Field(
        default=[], max_length=MOST_HARMONICS, title="cosine amplitudes of the transmission error"
    )
    """b_s of cos s x, s = 1, 2, ... (m, or rad where the mesh turns)."""

    def conflicts(self) -> Iterator[Conflict]:
        """Yield a conflict without any harmonic."""
        yield from no_harmonics(self, "m")


class GearError(TransmissionError):
    """A transmission error that repeats with the revolution of a gear, as a Fourier series over it."""

    gear: NameText
    """Name of the gear that has it."""


class Force(Section):
    """A periodic external force, given by its Fourier series."""

    name: NameText | None = optional("name of the force")
    """Name of the force in messages."""
    direction: Vector = Field(title="direction of the force")
    """u, the force acts as u times its value: one number per coordinate, or {coordinate: value} (1)."""
    sin: list[ForceAmplitude] = Field(default=[], max_length=MOST_HARMONICS, title="sine amplitudes of the force")
    """Amplitudes of sin s x, s = 1, 2, ..., x = r Omega t - 2 pi lag (N, or N m of a rotation)."""
    cos: list[ForceAmplitude] = Field(default=[], max_length=MOST_HARMONICS, title="cosine amplitudes of the force")
    """Amplitudes of cos s x, s = 1, 2, ... (N, or N m of a rotation)."""
    frequency_ratio: ExactRatio = Field(default=Fraction(1), title="frequency ratio of the force")
    """r, its frequency over the mesh frequency of the sweep, exact: 1, 0.5 or "1/2"."""
    lag: Turns = Field(default=0.0, title="lag of the force")
    """It begins this fraction of its own period late (1)."""

    def conflicts(self, size: int | None) -> Iterator[Conflict]:
        """Yield conflicts without any harmonic, and of a direction that is zero or not of the size of the system."""
        yield from no_harmonics(self, "N")
        yield from no_direction(self, "direction", size, "let the force act on at least one coordinate")


def no_harmonics(series: TransmissionError | Force, unit: str) -> Iterator[Conflict]:
    """A conflict where neither sin nor cos has an entry, nor an unknown key stands for them."""
    if series.model_fields_set <= {*Force.model_fields, *GearError.model_fields} and not series.sin and not series.cos:
        yield (), "missing", "has no harmonics", f"add sin: [..] or cos: [..], amplitudes of the harmonics ({unit})"


def with_forcing(system: GearSystem, p: Any) -> GearSystem:
    """The system with what drives it.

    ``load``: constant generalised forces, one per coordinate; ``forces``: periodic ones, each a ``direction`` and a
    Fourier series ``sin``, ``cos`` with ``frequency_ratio`` and ``lag``; ``transmission_error`` of a mesh: ``sin``,
    ``cos``. A transmission error acts through the mesh's own damping too. ``backlash`` of a mesh, 2 b, and its
    ``backlash_zero``, which only the response heeds, come with it.
    """
    meshes = tuple(_driven(item, part) for part, item in zip(p.meshes, system.meshes, strict=True))
    forces = tuple(
        PeriodicForce(
            part.name or f"force{i + 1}", vector(part.direction), Fourier.build(part),
            part.frequency_ratio, np.asarray(part.lag, dtype=float),
        )
        for i, part in enumerate(getattr(p, "forces", ()))
    )  # fmt: skip
    load = None if getattr(p, "load", None) is None else vector(p.load)
    return replace(system, meshes=meshes, forces=forces, load=load)


def _driven(mesh: Mesh, p: Any) -> Mesh:
    """The mesh with its transmission error, damping and backlash; most have none."""
    if all(part is None for part in (p.transmission_error, p.damping, p.backlash)):
        return mesh
    return replace(
        mesh,
        transmission_error=None if p.transmission_error is None else Fourier.build(p.transmission_error),
        damping=np.asarray(p.damping, dtype=float) if _constant_damping(p) else 0.0,
        backlash=np.asarray(p.backlash, dtype=float) if given(p.backlash) else 0.0,
        backlash_zero=p.backlash_zero,
    )


def _constant_damping(mesh: Any) -> bool:
    return given(mesh.damping) and not mesh.damping_follows_stiffness


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
    if not (given(p.damping_ratio) or p.damping or any(given(part.damping) for part in p.meshes)):
        return system
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
