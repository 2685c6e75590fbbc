"""Rotors and geared rotors of ROSS (an optional package)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from fractions import Fraction
from typing import Any

import numpy as np

from gearstab.errors import NotPossible
from gearstab.exchange.files import dense
from gearstab.exchange.model import Model, merged, model
from gearstab.system import Array

LETTERS = ("x", "y", "z", "alpha", "beta", "theta")
"""The coordinates of a node there: displacements, then rotations about these axes."""
SINGLE = 1e-9
"""A second eigenvalue of a mesh's stiffness matrix beyond this part of the first one is no rounding error."""


def from_ross(
    rotor: Any,
    meshes: Sequence[Mapping[str, Any]] | None = None,
    modes: int | None = None,
    speed: float = 0.0,
    speed_ratio: Fraction | str | None = None,
) -> Model:
    """Turn a rotor, or geared rotors, of ROSS into the section ``system`` of a configuration.

    Parameters
    ----------
    rotor: a ``ross.Rotor`` or ``ross.MultiRotor``. The gear mesh of a multi-rotor is the first mesh; where ROSS
        computed its stiffness over a mesh period (``GearElementTVMS``) that is its wave.
    meshes: what else is to be said of the meshes, one entry each: ``[{"epsilon": 0.2, "contact_ratio": 1.6}]``; needed
        where the stiffness is constant there. Further entries need ``direction`` (one number per coordinate) and
        ``mean_stiffness``.
    modes: how many of the lowest modes to keep, default all; ``note`` of the result says what that neglects.
    speed: of the (driving) rotor, rad/s, at which bearings are taken and which gyroscopic effects go with. These, and
        what is antisymmetric in the bearings, become ``terms`` of the system.
    speed_ratio: of the (driving) rotor to the first mesh, exact, ``"1/37"`` of a gear of 37 teeth: then gyroscopic
        effects follow the mesh frequency, as ``rotation`` of the system; bearings stay those at ``speed``.

    Raises NotPossible where the meshes do not fit the rotor, or its coupling is no spring along one direction.
    """
    known = []
    stiffness = dense(rotor.K(speed))
    for number, geared in enumerate(_geared(rotor), 1):
        direction, mean = _direction(rotor, geared, speed)
        stiffness -= mean * np.outer(direction, direction)
        entry = {"name": f"mesh{number}", "direction": direction, **_wave(geared.mesh, mean)}
        known.append(entry | ({"frequency_ratio": None} if number > 1 else {}))
    entries = merged(known, meshes, "rotor")
    for entry in entries:
        if entry.get("frequency_ratio", 1) is None:
            raise NotPossible(f"nothing says how fast mesh '{entry['name']}' turns", "give frequency_ratio, exact")
    damping, gyroscopic = dense(rotor.C(speed)), dense(rotor.G())
    nodes = range(len(stiffness) // len(LETTERS))
    more: dict[str, Any] = {
        "coordinates": [f"{letter}{node}" for node in nodes for letter in LETTERS],
        "coordinate_units": ["m", "m", "m", "rad", "rad", "rad"] * len(nodes),
    }
    if speed_ratio is None:
        damping = damping + speed * gyroscopic
    else:
        more["rotation"] = [{"speed_ratio": speed_ratio, "gyroscopic": gyroscopic}]
    return model(dense(rotor.M(speed)), stiffness, damping, entries, modes, **more)


def _geared(rotor: Any) -> Iterator[Any]:
    """The multi-rotors that a rotor is made of, itself first."""
    if hasattr(rotor, "mesh"):
        yield rotor
        for part in rotor.rotors.values():
            yield from _geared(part)


@contextmanager
def _loose(mesh: Any) -> Iterator[None]:
    """A gear mesh without stiffness, for a while."""
    before = mesh.stiffness
    mesh.stiffness = 0.0
    try:
        yield
    finally:
        mesh.stiffness = before


def _direction(rotor: Any, geared: Any, speed: float) -> tuple[Array, float]:
    """The direction g of a mesh and its stiffness k, from K with and without it: k g g^T."""
    mean = float(geared.mesh.stiffness)
    coupled = np.array(rotor.K(speed), dtype=float)
    with _loose(geared.mesh):
        coupled -= rotor.K(speed)
    values, vectors = np.linalg.eigh(0.5 * (coupled + coupled.T))
    if not mean > 0 or values[-1] <= 0 or np.abs(values[:-1]).max() > SINGLE * values[-1]:
        raise NotPossible("the coupling of the rotors is no spring along one direction", "give the matrices yourself")
    direction = vectors[:, -1] * np.sqrt(values[-1] / mean)
    # Entries that rounding made: the whole matrix went into them.
    direction[np.abs(direction) < SINGLE * np.abs(direction).max()] = 0.0
    return direction, mean


def _wave(mesh: Any, mean: float) -> dict[str, Any]:
    """Return the data of a mesh's stiffness: its course over a period, or its mean."""
    course = np.asarray(getattr(mesh, "stiffness_range", ()), dtype=float)
    if not len(course) or np.ptp(course) <= SINGLE * np.abs(course).max():
        return {"mean_stiffness": mean}
    phase = np.asarray(mesh.theta_range, dtype=float) / float(mesh.theta_range[-1])
    return {"waveform": {"kind": "sampled", "phase": phase[:-1], "stiffness": course[:-1]}}
