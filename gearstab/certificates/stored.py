"""Certificates as numbers of a result: of all pieces of a row their ends, and of each piece what proves it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gearstab.certificates.verifier import Array, Certificate


def entries(m: int) -> list[str]:
    """Return what the numbers of a certificate of a system ``(m, m)`` are called."""
    separators = [f"separator {k}" for k in range(1, max(m // 2, 1))]
    return ["outside", "rate", *separators, *(f"X[{i},{j}]" for i in range(1, m + 1) for j in range(1, m + 1))]


def packed(pieces: Sequence[Certificate], m: int) -> tuple[Array, Array]:
    """Ends ``(K, 2)`` and numbers ``(K, entries)``, NaN for separators that there are not."""
    ends = np.array([(piece.low, piece.high) for piece in pieces]).reshape(-1, 2)
    numbers = np.full((len(pieces), len(entries(m))), np.nan)
    for line, piece in zip(numbers, pieces, strict=True):
        line[:2] = piece.outside, piece.rate
        line[2 : 2 + len(piece.separators)] = piece.separators
        if piece.rate >= 0:
            line[-m * m :] = piece.coordinates.ravel()
    return ends, numbers


def unpacked(ends: Array, numbers: Array) -> list[Certificate]:
    """The pieces of a row; what is no certificate is one that nobody can prove."""
    m = next((m for m in range(1, numbers.shape[-1] + 1) if len(entries(m)) == numbers.shape[-1]), 0)
    found = []
    for (low, high), line in zip(ends.tolist(), np.asarray(numbers, dtype=float), strict=True):
        separators = [value for value in line[2 : len(line) - m * m].tolist() if not np.isnan(value)]
        outside = int(line[0]) if line[0] in range(m + 1) else -1
        found.append(
            Certificate(low, high, outside, float(line[1]), line[len(line) - m * m :].reshape(m, m), separators)
        )
    return found
