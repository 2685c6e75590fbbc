"""Where samples in equal steps lie among the intervals of a common period."""

from __future__ import annotations

import numpy as np

from gearstab.system import Array

ON_A_JUMP = 1e-9
"""A sample closer to a jump than this part of the sampling step is taken as lying on it, with the stiffness just after;
position and velocity do not jump, so that only the force and the energy depend on it."""


def first_sample(edges: Array) -> Array:
    """The first sample at or after each edge; both in sampling steps."""
    return np.ceil(edges - ON_A_JUMP).astype(int)
