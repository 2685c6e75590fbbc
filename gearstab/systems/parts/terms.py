"""Periodic parts of a stiffness and damping matrix beside the meshes, which need not be symmetric."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from gearstab.config.model.arrays import vector
from gearstab.config.model.conflicts import Conflict, no_direction, within
from gearstab.config.model.fields import (
    AnyRatio,
    ContactRatio,
    Flag,
    NameText,
    Quantity,
    Section,
    Turns,
    Vector,
)
from gearstab.mesh import PeriodicTerm
from gearstab.system import Array
from gearstab.waveforms import Constant, Profile, Scaled
from gearstab.waveforms.section import WaveformSection, build_waveform, shape_conflicts, wave_of

SKEW = 1e-12
"""An antisymmetric part below this part of the largest entry of a matrix is rounding."""

OfStiffness = Annotated[float, Quantity("N/m", ("N", "N m"), entry=True)]
OfDamping = Annotated[float, Quantity("N s/m", ("N s", "N m s"), entry=True)]


class VaryingNumber(Section):
    """A number that may vary periodically, mean + 2 amplitude w(x)."""

    contact_ratio: ContactRatio | None = Field(
        default=None, title="contact ratio of a term", description="c >= 1, of a waveform that has one (1)."
    )
    waveform: WaveformSection | None = Field(
        default=None, title="waveform of a term", description="w, rectangular without, where there is an amplitude."
    )

    @classmethod
    def conflicts(cls, raw: dict[str, Any]) -> Iterator[Conflict]:
        """A mean or an amplitude, and a waveform that is complete where anything varies."""
        wave = wave_of(raw.get("waveform"))
        if all(raw.get(key) is None for key in ("amplitude", "contact_ratio", "waveform")):
            if raw.get("mean") is None:
                yield (), "missing", "has neither mean nor amplitude", "add mean, or amplitude and waveform"
            return
        if wave is not None and wave.of_teeth:
            yield (
                ("waveform", "kind"),
                "not_applicable",
                "a term has no teeth",
                "choose another waveform, such as fourier or sampled",
            )
            return
        if raw.get("amplitude") is None and wave is not None and not wave.own_variation:
            yield ("amplitude",), "missing", "is missing", "add amplitude: half the peak-to-peak of the variation"
        yield from shape_conflicts(raw, "c >= 1, the contact ratio of the wave")


class StiffnessPart(VaryingNumber):
    """The stiffness of a term."""

    mean: OfStiffness | None = Field(
        default=None, title="mean stiffness of a term", description="Its mean (N/m); 0 or that of the samples without."
    )
    amplitude: OfStiffness | None = Field(
        default=None,
        title="stiffness amplitude of a term",
        description="Half the peak-to-peak of its variation (N/m); constant, or that of the samples, without.",
    )


class DampingPart(VaryingNumber):
    """The damping of a term."""

    mean: OfDamping | None = Field(
        default=None, title="mean damping of a term", description="Its mean (N s/m); 0 or that of the samples without."
    )
    amplitude: OfDamping | None = Field(
        default=None,
        title="damping amplitude of a term",
        description="Half the peak-to-peak of its variation (N s/m); constant, or that of the samples, without.",
    )


class Term(Section):
    """a(x) u v^T in the stiffness matrix and c(x) u v^T in the damping matrix."""

    name: NameText | None = Field(
        default=None, title="name of the term", description="What paths and messages call it."
    )
    left: Vector = Field(title="left vector", description="u, along which the term acts (1).")
    right: Vector = Field(title="right vector", description="v: the term acts on v . q and v . q' (1).")
    stiffness: StiffnessPart | None = Field(
        default=None, title="stiffness of a term", description="a(x): mean, amplitude, waveform."
    )
    damping: DampingPart | None = Field(
        default=None, title="damping of a term", description="c(x): mean, amplitude, waveform."
    )
    exact: Flag = Field(
        default=True,
        title="exact frequency ratio of a term",
        description="false: frequency_ratio is a decimal that stands for an irrational number.",
    )
    frequency_ratio: AnyRatio = Field(
        default=Fraction(1),
        title="frequency ratio of a term",
        description='Its frequency over the mesh frequency of the sweep, exact: 1, 0.5 or "1/2"; see exact.',
    )
    lag: Turns = Field(
        default=0.0, title="lag of a term", description="It begins this fraction of its own period late (1)."
    )

    @classmethod
    def conflicts(cls, raw: dict[str, Any], size: int | None) -> Iterator[Conflict]:
        """A stiffness or a damping, and vectors of the size of the system that are not zero."""
        if raw.get("stiffness") is None and raw.get("damping") is None:
            yield (
                (),
                "missing",
                "has neither stiffness nor damping",
                "add stiffness: {mean: ..}, or damping: {mean: ..}",
            )
        for key in ("stiffness", "damping"):
            yield from within(raw, key, VaryingNumber.conflicts)
        for key in ("left", "right"):
            yield from no_direction(raw, key, size, "let the term act on at least one coordinate")


def periodic_terms(p: Any) -> tuple[PeriodicTerm, ...]:
    """The terms of ``p["terms"]``.

    Each has ``left`` u, ``right`` v, ``stiffness`` a(x) and ``damping`` c(x) (``mean``, ``amplitude``, ``waveform``,
    ``contact_ratio``: mean + 2 amplitude w(x)), ``frequency_ratio`` and ``lag``, in periods of its own.
    """
    return tuple(
        PeriodicTerm(
            part.get("name") or f"term{i + 1}", vector(part["left"]), vector(part["right"]),
            _profile(part.get("stiffness")), _profile(part.get("damping")), part["frequency_ratio"],
            np.asarray(part.get("lag", 0.0), dtype=float),
        )
        for i, part in enumerate(p.get("terms") or [])
    )  # fmt: skip


def symmetric(matrix: Array) -> Array:
    """Return the symmetric part of a matrix."""
    return 0.5 * (matrix + matrix.T)


def antisymmetric_terms(name: str, part: str, matrix: Array) -> list[dict[str, Any]]:
    """Return the antisymmetric part of a matrix as constant terms s u v^T in plain data; none of rounding.

    name: of the terms. part: ``stiffness`` or ``damping``. Source: the singular value decomposition of a real matrix.
    """
    skew = 0.5 * (matrix - matrix.T)
    if np.abs(skew).max(initial=0.0) <= SKEW * np.abs(matrix).max(initial=0.0):
        return []
    left, sizes, right = np.linalg.svd(skew)
    return [
        {"name": f"{name} {k + 1}", "left": left[:, k], "right": right[k], part: {"mean": sizes[k]}}
        for k in np.flatnonzero(sizes > SKEW * sizes[0])
    ]


def _profile(p: Any) -> Profile | None:
    if p is None:
        return None
    mean, amplitude = p.get("mean"), p.get("amplitude")
    if all(p.get(key) is None for key in ("amplitude", "contact_ratio", "waveform")):
        return Constant(np.asarray(mean, dtype=float))
    wave = build_waveform(p)
    mean = wave.mean_stiffness if mean is None else mean
    amplitude = wave.amplitude if amplitude is None else amplitude
    return Scaled(wave, np.asarray(mean, dtype=float), 2 * np.asarray(amplitude, dtype=float))
