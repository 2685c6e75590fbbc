"""How long a response takes, roughly: said beforehand where that is long."""

from __future__ import annotations

from math import tau

import numpy as np

from gearstab import ckernel
from gearstab.modal import mean_modes
from gearstab.response.backlash.dynamics import REACH
from gearstab.system import GearSystem

LONG = 20.0
"""Seconds from which on it is said."""
PIECE = {"c": 2e-6, "numpy": 1e-4}
"""Seconds of a piece of a motion with backlash, by the kernel in use; measured on two coordinates."""
ENTRY = 2e-8
"""Seconds of an entry of its generator."""
NORM = 1.2
"""|G| over the fastest frequency, about."""


def motion_with_backlash(system: GearSystem, duration: float) -> str | None:
    """Say how long it takes to follow one for so long, and why; None where that is soon done.

    Pieces are as short as the stiffest part asks for, |G| t <= REACH, whether it vibrates or not.
    """
    fastest = float(np.sqrt(np.abs(mean_modes(system).squared_frequency).max()))
    pieces = NORM * duration * fastest / REACH
    seconds = pieces * (PIECE[ckernel.name()] + ENTRY * (2 * system.size + 1) ** 2)
    if seconds < LONG:
        return None
    text = f"{seconds:.0f} seconds" if seconds < 120 else f"{seconds / 60:,.0f} minutes"
    text = text if seconds < 7200 else f"{seconds / 3600:,.0f} hours"
    return f"this takes some {text}: the fastest mode vibrates {duration * fastest / tau:.2g} times meanwhile"
