"""The periodic terms of a system in its modes, for first-order theory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from gearstab.grouping import Columns
from gearstab.modal import Modes, significant_deflection
from gearstab.perturbation.tongues import harmonic_at
from gearstab.system import Array, GearSystem
from gearstab.waveforms.base import harmonic


@dataclass(frozen=True)
class ModalTerms(Columns):
    """Terms of all rows, with the batch flattened.

    left, right: ``(rows, n, terms)``, Phi^T u and Phi^T v, what is rounding exactly zero; of no terms where there are
    none. stiffness, damping: ``(rows, n, n)``, S = sum_j mean(a_j) Phi^T u_j v_j^T Phi and the same with the means of
    c_j.
    """

    left: Array
    right: Array
    stiffness: Array
    damping: Array


def modal_terms(system: GearSystem, modes: Modes) -> ModalTerms:
    """Return the terms of a system in the modes of its mean system."""
    left, right = (
        _projected(system, modes, [getattr(term, end) for term in system.terms]) for end in ("left", "right")
    )
    means = []
    for kind in ("stiffness", "damping"):
        mean = np.zeros((system.rows, len(system.terms)))
        for j, term in enumerate(system.terms):
            mean[:, j] = _coefficient(system, getattr(term, kind), 0).real
        means.append(np.einsum("rpt,rt,rqt->rpq", left, mean, right))
    return ModalTerms(left, right, *means)


def _projected(system: GearSystem, modes: Modes, vectors: list[Array]) -> Array:
    """Phi^T u of all vectors, ``(rows, n, vectors)``."""
    parts = np.zeros((*system.batch, system.size, len(vectors)))
    for j, vector in enumerate(vectors):
        parts[..., j] = np.einsum("...np,...n->...p", modes.shapes, vector)
    return system.flat(np.where(significant_deflection(replace(modes, mesh_deflection=parts)), parts, 0.0), 2)


def _coefficient(system: GearSystem, profile: object, order: int) -> Array:
    """The Fourier coefficient of a profile in each row, ``(rows,)``; zeros of none."""
    found = np.zeros(()) if profile is None else harmonic(profile, order)  # type: ignore[arg-type]
    return np.broadcast_to(found, system.batch).reshape(-1).astype(complex)


def harmonics(system: GearSystem, ratio: Fraction | float, rows: Array) -> Iterator[tuple[int, Array, Array]]:
    """Yield (number of the term, a, c) of all terms that excite at ratio * Omega; a, c: complex ``(rows,)``.

    Of exp(i nu t) in a_j(t) and c_j(t), lags included.
    """
    for j, term in enumerate(system.terms):
        s = harmonic_at(ratio, term.frequency_ratio)
        if s:
            turn = np.broadcast_to(np.exp(-2j * np.pi * s * np.asarray(term.lag)), system.batch).reshape(-1)
            a, c = (_coefficient(system, profile, s) * turn for profile in (term.stiffness, term.damping))
            yield j, a[rows], c[rows]
