"""A gear pair on rigid shafts: one degree of freedom, the dynamic transmission error or the deflection of the teeth."""

from __future__ import annotations

from math import tau
from typing import Any

import numpy as np

from gearstab.rotating_pair import PairNumbers, RotatingPair
from gearstab.system import Array, GearSystem, Mesh
from gearstab.systems import assembly
from gearstab.waveforms import Rectangular


def build(p: dict[str, Any]) -> GearSystem:
    """A pair given by its equivalent mass and mesh (:func:`of_mass`) or by its gears (:func:`of_gears`)."""
    return of_gears(p) if "teeth" in p else of_mass(p)


def of_mass(p: dict[str, Any]) -> GearSystem:
    """m x'' + c x' + k(t) x = f(t).

    Parameters: ``equivalent_mass`` m (kg), one mesh, damping. x is the deflection along the line of action.
    """
    mass = np.asarray(p["equivalent_mass"], dtype=float)[..., None, None]
    mesh = assembly.mesh(p["meshes"][0], np.ones(1))
    system = GearSystem(mass, np.zeros((1, 1)), (mesh,), coordinates=("x",))
    return assembly.driven(assembly.damped(system, p), p)


def of_gears(p: dict[str, Any]) -> RotatingPair:
    """phi''/M2 + (2 zeta w0/M2) phi' + k phi = T0, with k of Omega t or, in other formulations, of the rotation.

    Parameters: ``formulation``, ``teeth``, ``inertias``, ``torsional_stiffness``, ``single_contact_angle`` or
    ``contact_ratio``, ``torque``, ``damping_ratio``, and ``module`` or ``radii`` where lengths are known.
    One pair of teeth is in contact from the beginning of a mesh cycle on. Source: Oh, Grosh & Barber 2005, (1)-(6).
    """
    numbers = _numbers(p)
    batch = numbers.batch
    soft, stiff = (np.asarray(level, dtype=float) for level in numbers.stiffness)
    part = numbers.single_part
    mean = part * soft + (1 - part) * stiff
    # The wave is stiff first; the cycle begins with one pair.
    wave = Rectangular(np.asarray(2 - part))
    mesh = Mesh("mesh", np.ones(1), mean, (stiff - soft) / (2 * mean), wave, lag=part)
    mass = np.broadcast_to(1 / numbers.m2, batch)[..., None, None]
    damping = 2 * np.asarray(numbers.zeta) * numbers.w0 / numbers.m2
    return RotatingPair(
        mass=mass,
        stiffness=np.zeros((1, 1)),
        meshes=(mesh,),
        damping=damping[..., None, None] if np.any(damping) else None,
        coordinates=("phi",),
        units=("rad",),
        deflection_unit="rad",
        load=np.asarray(numbers.torque)[..., None],
        formulation=p.get("formulation", "classical"),
        numbers=numbers,
    )


def _numbers(p: dict[str, Any]) -> PairNumbers:
    def pair(values: Any) -> tuple[Array, Array]:
        first, second = values
        return np.asarray(first, dtype=float), np.asarray(second, dtype=float)

    single = p.get("single_contact_angle")
    if single is None:
        single = tau * (2 - np.asarray(p["contact_ratio"], dtype=float))
    lever = None
    if p.get("module") is not None:
        lever = 0.5 * np.asarray(p["module"], dtype=float)
    elif p.get("radii") is not None:
        lever = np.asarray(p["radii"][0], dtype=float) / p["teeth"][0]
    return PairNumbers(
        teeth=(int(p["teeth"][0]), int(p["teeth"][1])),
        inertias=pair(p["inertias"]),
        stiffness=pair(p["torsional_stiffness"]),
        single=np.asarray(single, dtype=float),
        torque=np.asarray(p["torque"], dtype=float),
        zeta=np.asarray(0.0 if p.get("damping_ratio") is None else p["damping_ratio"], dtype=float),
        lever=lever,
    )
