"""The gear pair of Oh, Grosh & Barber (2005) and numbers of it that were computed apart from this program."""

import json
from math import pi
from typing import Any, cast

import numpy as np
from scenes import DATA

from gearstab.rotating_pair import RotatingPair
from gearstab.systems import build

REFERENCE: dict[str, Any] = json.loads((DATA / "energy_pair.json").read_text())
"""Trajectories in 50 digits, orbits and multipliers, edges of tongues, lines of spectra; see "source" in it."""

W0 = REFERENCE["derived"]["w0"]
M = REFERENCE["derived"]["m=M1/M2"]
K0 = REFERENCE["derived"]["k0"]
KAPPA = (1430.0 / K0, 2780.0 / K0)

PARAMETERS: dict[str, Any] = {
    "kind": "gear_pair",
    "formulation": "energy_conserving",
    "teeth": [24, 96],
    "inertias": [2.89e-3, 0.7402],
    "torsional_stiffness": [1430.0, 2780.0],
    "single_contact_angle": 1.73,
    "torque": 21.05,
    "damping_ratio": 0.0,
}


def pair(formulation: str = "energy_conserving", **changes: Any) -> RotatingPair:
    """The pair with changed parameters."""
    return cast(RotatingPair, build(PARAMETERS | {"formulation": formulation} | changes))


def theta_dot(rpm: float) -> float:
    """N1 times the speed of the driving gear."""
    return 24 * rpm * pi / 30


def tolerance(value: float, scale: float = 0.0) -> float:
    """1e-10 of the larger of a number and its scale."""
    return 1e-10 * max(abs(value), abs(scale))


def complex_of(numbers: list[Any]) -> np.ndarray:
    """Multipliers as stored, in order."""
    return np.sort_complex(np.array([complex(*n) if isinstance(n, list) else complex(n) for n in numbers]))
