"""A claim is proved by one of four theorems: 1 and 2 in verifier.py, 3 in counting.py, 4 in lyapunov.py."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from gearstab.certificates.counting import Counter
from gearstab.certificates.lyapunov import decays
from gearstab.certificates.verifier import CARRIED, COUNTED, Certificate, Flow, proves

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
