"""Reconstructed gearbox that the statements share, other teeth for it, and its stages one at a time."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cache
from math import pi, radians
from typing import Any

import numpy as np

from gearstab.config import load
from gearstab.floquet import frequencies
from gearstab.floquet.frequencies import groups
from gearstab.gears.pair import Pair
from gearstab.gears.stress import mesh_root_stress
from gearstab.modal import static_mesh_force
from gearstab.response.speeds import SpeedResponse, speed_response
from gearstab.systems import build, section
from gearstab.systems.gearbox.train import Train
from statements import CONFIGS

STAGES = ("I", "II", "III", "IV")
SPEED = 1500 * pi / 30
SAMPLES = 400


@dataclass(frozen=True)
class Design:
    """Other teeth for the gearbox.

    module: m. teeth, shifts: of pinion and wheel of stages I to IV; the centre distance is that without backlash.
    pressure_angle: degrees. addendum: of stages I to IV, in modules; the dedendum is a quarter of a module more.
    """

    module: float = 3e-3
    teeth: tuple[tuple[int, int], ...] = ((14, 34), (14, 40), (15, 40), (14, 40))
    shifts: tuple[tuple[float, float], ...] = ((0.19, -0.19), (0.19, -0.19), (0.13, -0.13), (0.19, -0.19))
    pressure_angle: float = 20.0
    addendum: tuple[float, ...] = (1.0,) * 4


NO_SHIFT = ((0.0, 0.0),) * 4
LITTLE = ((0.01, -0.01), (0.01, -0.01), (0.0, 0.0), (0.01, -0.01))

# Pitch radii as with a module of 3 mm, to half a millimetre; shifts only where undercut asks for them.
FINER = {
    2.5e-3: Design(2.5e-3, ((17, 41), (17, 48), (18, 48), (17, 48)), LITTLE),
    2.0e-3: Design(2.0e-3, ((21, 51), (21, 60), (22, 60), (21, 60)), NO_SHIFT),
}

# The same teeth with a contact ratio of 2: longer ones, profile shifts and working centre distances, chosen among
# addenda from 1.15 to 1.4 in steps of 0.01 and shifts x1 from -0.2 to 0.6, x2 from -0.8 to 0.5 in steps of 0.05.
# With a module of 2 mm hundreds of these are free of notices; with 2.5 mm and 17 teeth none is from a contact ratio of
# 1.96 on (18 teeth: 2.01), and those here have a tip narrower than 0.3 modules as their only notice.
LONG_TEETH = {
    2.5e-3: replace(
        FINER[2.5e-3],
        shifts=((0.25, -0.65), (0.25, -0.65), (0.2, -0.6), (0.25, -0.65)),
        addendum=(1.22, 1.221, 1.21, 1.221),
    ),
    2.0e-3: replace(
        FINER[2.0e-3], shifts=((0.05, 0.0), (0.2, -0.2), (0.2, -0.3), (0.2, -0.2)), addendum=(1.25, 1.25, 1.23, 1.25)
    ),
}


@cache
def base() -> Mapping[str, Any]:
    """The section system of configs/kuria_kihiu_2008/gearbox.yaml as plain data."""
    return load(CONFIGS / "kuria_kihiu_2008" / "gearbox.yaml").tree["system"]


def parameters(design: Design) -> dict[str, Any]:
    """Return the parameters of the gearbox with other teeth."""
    p = deepcopy(dict(base()))
    p["gears"] |= {"module": design.module, "pressure_angle": radians(design.pressure_angle)}
    stages = [*range(4), 3]
    for k, stage in enumerate(stages):
        for side in (0, 1):
            rotor = p["rotors"][1 + 2 * k + side]
            rotor["teeth"] = design.teeth[stage][side]
            rotor["profile_shift"] = design.shifts[stage][side]
            rotor["addendum"] = design.addendum[stage]
            rotor["dedendum"] = design.addendum[stage] + 0.25
    return p


@cache
def response(design: Design = Design()) -> list[SpeedResponse]:
    """The steady state at 1500 rpm with the stiffness of one stage varying at a time, the others at their mean."""
    system = build(parameters(design))
    omega = np.array([design.teeth[0][0] * SPEED])
    found = []
    for group in groups(system):
        alone = frequencies.alone(system, group)
        # Enough for the vibration of the teeth, at 14 kHz, in the slowest mesh.
        samples = round(SAMPLES / float(group.ratio))
        found.append(speed_response(alone, float(group.ratio) * omega, samples))
    return found


def of_stages(design: Design, measure: str) -> np.ndarray:
    """A measure of the steady state, of each stage's own mesh."""
    return np.array([getattr(found, measure)[0, 0, k] for k, found in enumerate(response(design))])


@cache
def pairs(design: Design = Design()) -> list[Pair]:
    """The gears of stages I to IV."""
    train = Train(section(parameters(design)))
    return [train.pair_teeth[k].pairs[0] for k in range(4)]


@cache
def static_forces(design: Design = Design()) -> np.ndarray:
    """Static forces of stages I to IV."""
    return np.asarray(static_mesh_force(build(parameters(design)))[:4])


@cache
def root_stress(design: Design = Design()) -> np.ndarray:
    """``(4, 2)``, MPa: the largest static root stress of pinion and wheel of each stage."""
    x = np.linspace(0, 1, 400, endpoint=False)
    loaded = zip(pairs(design), static_forces(design), strict=True)
    return np.array([[1e-6 * part.max() for part in mesh_root_stress(pair, x, force)] for pair, force in loaded])
