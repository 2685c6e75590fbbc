"""Claims: as numbers of a result, and proved by one of five theorems: 1 and 2 in verifier.py, 3 and 5 in
circle.py, 4 in lyapunov.py.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from gearstab.certificates.counting import Counter
from gearstab.certificates.equations import Array, Flow
from gearstab.certificates.lyapunov import decays
from gearstab.certificates.verifier import CARRIED, COUNTED, Certificate, proves

MANY, LONG = 10, 100
"""States and segments up to which Theorem 3 is cheaper."""


def counter(flow: Flow) -> Counter | None:
    """Return what counts multipliers of a flow; None where Theorem 3 is not about it, or it is too large."""
    if flow.following or flow.generators[0].nrows() > MANY or len(flow.states) > LONG:
        return None
    try:
        return Counter(flow)
    except (ValueError, ZeroDivisionError, np.linalg.LinAlgError):  # no coordinates
        return None


class Proof:
    """Whether claims about one flow are proved; what is known of it serves all of them."""

    def __init__(self, flow: Flow) -> None:
        self.flow = flow

    @cached_property
    def counter(self) -> Counter | None:
        """For all pieces without coordinates."""
        return counter(self.flow)

    def __call__(self, piece: Certificate) -> bool:
        """Whether the claim of a piece is proved; False for everything else, be the piece malformed."""
        if piece.rate == CARRIED:
            return piece.outside == 0 and decays(self.flow, piece.low, piece.high)
        if piece.rate != COUNTED:
            return proves(self.flow, piece)
        if self.counter is None or piece.outside not in (0, 1) or not 0 < piece.low <= piece.high < np.inf:
            return False
        found = self.counter.outside(piece.low, piece.high)
        return found is not None and (found > 0) == (piece.outside == 1)


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
