"""Claims that multipliers suggest, in floating point. Coordinates are Floquet vectors, those that grow most first."""

from __future__ import annotations

import numpy as np

from gearstab import ckernel
from gearstab.certificates.choices import REAL, balanced
from gearstab.certificates.equations import Array, Flow
from gearstab.certificates.verifier import Certificate

WIDE = 1e6
"""Ratio of multipliers above which the modes of the mean system serve as coordinates."""
CIRCLE = 1e-9
"""Growth over a period that is rounding."""
WITHIN = 0.25
"""Where between the growth of two directions, as logarithms, the rate that tells them apart lies."""


def claimed(flow: Flow, low: float, high: float) -> Certificate | None:
    """Return what the multipliers in the middle suggest; None where rounding has the last word."""
    omega = float(np.sqrt(low * high))
    own, share = flow.enclosed(omega), np.bincount(flow.states, flow.fractions)
    generators = 2 * np.pi * flow.cycles * np.einsum("i,dijk->djk", flow.powers(omega), own.terms)
    states, fractions, sorts = flow.sorts
    steps, monodromy = ckernel.exponentials(generators[states] * fractions[:, None, None]), np.eye(len(own.modes))
    for sort in sorts:
        monodromy = steps[sort] @ monodromy
    if not np.isfinite(monodromy).all():
        return None
    values, vectors = np.linalg.eig(monodromy)
    least, most = np.abs(values).min(), np.abs(values).max()
    # The condition is 1 at least, and takes longest to find.
    if most < 1 and least * WIDE <= most and np.linalg.cond(vectors) * least * WIDE <= most:
        values, vectors = np.linalg.eig(np.tensordot(share, generators, 1))
        # Of rates what orders and pairs them: multipliers themselves may be below all doubles.
        values = np.exp(values.real / np.abs(values.real).max() - 2 + 1j * np.sign(values.imag))
    order = np.argsort(-np.abs(values), kind="stable")
    values, vectors = values[order], vectors[:, order]
    pairs = values.imag > REAL * np.abs(values)
    kept = pairs | (np.abs(values.imag) <= REAL * np.abs(values))
    values, vectors, pairs = values[kept], vectors[:, kept], pairs[kept]
    if len(values) + pairs.sum() != len(monodromy) or not values.all():
        return None
    coordinates = (own.modes @ balanced(vectors, pairs, generators, share)).astype(np.float32).astype(float)
    growth = np.log(np.abs(np.repeat(values, 1 + pairs)))
    gap = growth - np.maximum(np.append(growth[1:], -np.inf), 0.0)
    outside = int(np.argmax(gap)) + 1
    if gap[outside - 1] > CIRCLE:
        next_growth = growth[outside] if outside < len(growth) else growth[-1]
        log_rate = 2 * max(0.0, next_growth + WITHIN * (growth[outside - 1] - next_growth))
        return Certificate(low, high, outside, _single(np.exp(log_rate)), coordinates)
    if flow.form is None:
        return Certificate(low, high, 0, 1.0, coordinates)
    return Certificate(low, high, 0, 0.0, coordinates, _separators(own.forms[0], values, vectors))


def _separators(form: Array, values: Array, vectors: Array) -> tuple[float, ...]:
    """Numbers between the 2 cos(theta) of neighbours of unequal Krein signature."""
    signature = np.sign(np.einsum("ij,ik,kj->j", vectors.conj(), form, vectors).imag)
    turns = 2 * np.cos(np.angle(values))
    order = np.argsort(turns)
    middle, change = 0.5 * (turns[order][1:] + turns[order][:-1]), np.diff(signature[order]) != 0
    return tuple(_single(value) for value in middle[change])


def _single(value: float) -> float:
    return float(np.float32(value))
