"""Models of other programs: rotors and geared rotors of ROSS, torsional models of openTorsion (optional packages)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from gearstab.errors import NotPossible
from gearstab.exchange import Model, dense, linear_model, merged
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
    speed: of the (driving) rotor, rad/s, at which bearings are taken and which gyroscopic effects go with, as
        ``rotation`` of the system, an entry for each shaft. What is antisymmetric in the bearings becomes ``terms``.
        Coefficients over speed are interpolated, which ``note`` says.
    speed_ratio: of the (driving) rotor to the first mesh, exact, ``"1/37"`` of a gear of 37 teeth: then gyroscopic
        effects follow the mesh frequency; bearings stay those at ``speed``.

    Raises NotPossible where the meshes do not fit the rotor, its coupling is no spring along one direction, or a
    bearing has coefficients over other speeds only.
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
    shafts = list(_shafts(rotor))
    note = _bearings(shafts, speed, speed_ratio is not None)
    nodes = range(len(stiffness) // len(LETTERS))
    more: dict[str, Any] = {
        "coordinates": [f"{letter}{node}" for node in nodes for letter in LETTERS],
        "coordinate_units": ["m", "m", "m", "rad", "rad", "rad"] * len(nodes),
    }
    if speed_ratio is not None or speed:
        first = None if speed_ratio is None else Fraction(speed_ratio)
        more["rotation"] = [
            ({"speed": float(own) * speed} if first is None else {"speed_ratio": str(first * own)})
            | {"gyroscopic": matrix}
            for _, own, matrix in shafts
        ]
    found = linear_model(dense(rotor.M(speed)), stiffness, dense(rotor.C(speed)), entries, modes, **more)
    found.note = "; ".join(filter(None, (found.note, note)))
    return found


def _shafts(rotor: Any) -> Iterator[tuple[Any, Fraction, Array]]:
    """(each shaft, its speed over that of the driving one, its gyroscopic matrix ``(n, n)``)."""
    if not hasattr(rotor, "mesh"):
        yield rotor, Fraction(1), dense(rotor.G())
        return
    driving, driven = (list(_shafts(rotor.rotors[name])) for name in ("driving", "driven"))
    size, mesh = driving[0][2].shape[0], rotor.mesh
    whole = size + driven[0][2].shape[0]
    ratio = Fraction(int(mesh.driving_gear.n_teeth), int(mesh.driven_gear.n_teeth))
    for part, factor, begin in ((driving, Fraction(1), 0), (driven, -ratio, size)):
        for shaft, speed, own in part:
            matrix = np.zeros((whole, whole))
            matrix[begin : begin + len(own), begin : begin + len(own)] = own
            yield shaft, factor * speed, matrix


def _bearings(shafts: Sequence[tuple[Any, Fraction, Array]], speed: float, follows: bool) -> str:
    """Return a note on bearings whose coefficients go with the speed; "" without any. Raises NotPossible."""
    named = []
    for shaft, ratio, _ in shafts:
        own = abs(float(ratio)) * speed
        for bearing in shaft.bearing_elements:
            table = np.ravel(np.asarray(0.0 if bearing.frequency is None else bearing.frequency, dtype=float))
            if len(table) < 2:
                continue
            name = f"{bearing.tag or 'a bearing'} at node {bearing.n}"
            if not table.min() <= own <= table.max():
                raise NotPossible(
                    f"{name} has coefficients from {table.min():g} to {table.max():g} rad/s, and its shaft turns at "
                    f"{own:g} rad/s", "give speed, of the driving rotor, so that it lies in there",
                )  # fmt: skip
            named.append(f"{name} at {own:g} rad/s")
    if not named:
        return ""
    stays = ", and stay so at every mesh frequency" if follows else ""
    return f"coefficients over speed are interpolated: {', '.join(named)}{stays}"


def _geared(rotor: Any) -> Iterator[Any]:
    """The multi-rotors that a rotor is made of, itself first."""
    if hasattr(rotor, "mesh"):
        yield rotor
        for part in rotor.rotors.values():
            yield from _geared(part)


def _direction(rotor: Any, geared: Any, speed: float) -> tuple[Array, float]:
    """The direction g of a mesh and its stiffness k, from K with and without it: k g g^T."""
    mean = float(geared.mesh.stiffness)
    coupled, held = np.array(rotor.K(speed), dtype=float), geared.mesh.stiffness
    geared.mesh.stiffness = 0.0  # for a while
    try:
        coupled -= rotor.K(speed)
    finally:
        geared.mesh.stiffness = held
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


def from_opentorsion(
    assembly: Any, meshes: Sequence[Mapping[str, Any]] | None = None, modes: int | None = None
) -> Model:
    """Turn an assembly of openTorsion into the section ``system`` of a configuration.

    Parameters
    ----------
    assembly: an ``opentorsion.Assembly``. Its elastic gears are the meshes: the angle between the gears is theta_parent
        + (R/R_parent) theta, the stiffness is in N m/rad; rigid gears are constraints, as there.
    meshes: what varies, one entry for each elastic gear in their order: ``[{"epsilon": 0.2, "contact_ratio": 1.6}]``,
        and any other key of a mesh; further entries need ``direction`` (one number per coordinate) and
        ``mean_stiffness``.
    modes: how many of the lowest modes to keep, default all; ``note`` of the result says what that neglects.

    Raises NotPossible where the meshes do not fit the assembly.
    """
    size = assembly.dofs
    transform = assembly.T(assembly.E()) if assembly.gear_elements is not None else np.eye(size)
    known: list[dict[str, Any]] = []
    stiffness = dense(assembly.K)
    for gear in assembly.elastic_gear_elements or ():
        if gear.parent is None:
            continue
        (mean, across), _ = gear.K()
        direction = np.zeros(size)
        direction[[gear.parent.node, gear.node]] = 1.0, across / mean
        direction = transform.T @ direction
        stiffness -= mean * np.outer(direction, direction)
        name = f"gear{len(known) + 1}"
        known.append({"name": name, "direction": direction, "mean_stiffness": float(mean)})
    entries = merged(known, meshes, "assembly")
    # The nodes that are left after the rigid gears: those that are a coordinate by themselves.
    rows = [np.flatnonzero((transform == unit).all(axis=1)) for unit in np.eye(transform.shape[1])]
    names = [f"node{row[0]}" for row in rows]
    more = {"coordinates": names, "coordinate_units": "rad", "deflection_unit": "rad"}
    return linear_model(dense(assembly.M), stiffness, dense(assembly.C), entries, modes, **more)
