"""Trains for the tests of gearboxes: the tractor gearbox with the reference's own stiffnesses, and small ones."""

import json
from math import cos, pi, radians
from typing import Any

import numpy as np
from scenes import DATA

REFERENCE: dict[str, Any] = json.loads((DATA / "gearbox_train.json").read_text())
RPM = 2 * pi / 60
MESHES = ("I", "II", "III", "IVa", "IVb")
BORES = ((0, 12.5e-3), (0, 15e-3), (0, 16e-3), (0, 20e-3), (0, 20e-3))


def tractor(**changes: Any) -> dict[str, Any]:
    """The parameters of the tractor gearbox, the levels of its mesh stiffness being those of the reference.

    The reference's discs have the radius of the base circle.
    """
    assumed = REFERENCE["assumed"]
    names = ["input", *(f"gear{k}" for k in range(1, 11)), "left", "right"]
    rotors: list[dict[str, Any]] = [{"name": "input", "inertia": assumed["J_in"]}]
    support = {"stiffness": assumed["k_lat"], "damping_ratio": assumed["zeta_lat"]}
    for stage, (teeth, shifts) in enumerate(zip(assumed["teeth"], assumed["profile_shift"], strict=True)):
        for side in (0, 1):
            rotors.append({
                "name": names[1 + 2 * stage + side], "teeth": teeth[side], "profile_shift": shifts[side],
                "body_radius": 1.5e-3 * teeth[side] * cos(radians(20)), "bore_radius": BORES[stage][side],
                "face_width": assumed["face_width"][stage], "support": support,
            })  # fmt: skip
    rotors += [{"name": name, "inertia": assumed["J_out"]} for name in ("left", "right")]
    levels = zip(MESHES, assumed["k_mesh_low_high"], assumed["k_mesh_mean"], REFERENCE["contact_ratio"], strict=True)
    meshes = [
        {"name": name, "gears": [f"gear{2 * k + 1}", f"gear{2 * k + 2}"], "mean_stiffness": mean,
         "epsilon": (high - low) / (2 * mean), "contact_ratio": ratio, "damping_ratio": 0.1}
        for k, (name, (low, high), mean, ratio) in enumerate(levels)
    ]  # fmt: skip
    shafts = [
        {"name": f"shaft{k + 1}", "between": [names[a], names[b]], "stiffness": stiffness, "damping_ratio": 0.05}
        for k, ((a, b), stiffness) in enumerate(zip(assumed["shafts"], assumed["k_shaft"], strict=True))
    ]
    return {
        "kind": "gearbox",
        "gears": {"module": 3e-3, "pressure_angle": radians(20)},
        "rotors": rotors,
        "shafts": shafts,
        "meshes": meshes,
        "input": {"rotor": "input", "speed": 1500 * RPM},
        "outputs": [{"rotor": "left", "torque": 650.0}, {"rotor": "right", "torque": 650.0}],
    } | changes


CROSSCHECK = REFERENCE["stability_crosscheck"]


def crosscheck(**changes: Any) -> dict[str, Any]:
    """The train of the cross-check: levels of the stiffness as given, whose mean is theirs, and little damping."""
    p = tractor(damping_factor=CROSSCHECK["damping_scale"], **changes)
    levels = zip(p["meshes"], REFERENCE["assumed"]["k_mesh_low_high"], REFERENCE["c_mesh"], strict=True)
    for mesh, (low, high), damping in levels:
        mean = low + (mesh["contact_ratio"] - 1) * (high - low)
        del mesh["damping_ratio"]
        mesh |= {"mean_stiffness": mean, "epsilon": (high - low) / (2 * mean), "damping": damping}
    return p


SUPPORT = {"stiffness": 2e8, "damping_ratio": 0.02}


def gear(name: str, teeth: int, **more: Any) -> dict[str, Any]:
    """A gear of 2 mm module and 20 degrees with a lateral support."""
    return {
        "name": name, "teeth": teeth, "module": 2e-3, "pressure_angle": radians(20), "face_width": 0.02,
        "support": SUPPORT,
    } | more  # fmt: skip


def mesh(name: str, driver: str, driven: str, **more: Any) -> dict[str, Any]:
    """A mesh of given stiffness."""
    return {
        "name": name,
        "gears": [driver, driven],
        "mean_stiffness": 3e8,
        "epsilon": 0.25,
        "contact_ratio": 1.6,
    } | more


def train(rotors: list[dict[str, Any]], meshes: list[dict[str, Any]], **more: Any) -> dict[str, Any]:
    """A train whose first rotor drives."""
    start = {"rotor": rotors[0]["name"]}
    return {"kind": "gearbox", "rotors": rotors, "meshes": meshes, "input": start} | more


def turned(system: Any, places: dict[str, complex], spins: dict[str, float]) -> np.ndarray:
    """The velocities of all coordinates while the whole train turns once per second, counter-clockwise, as one body.

    places: centres of the rotors in the complex plane. spins: 1 where a rotor's positive sense is counter-clockwise.
    """
    found = []
    for name in system.coordinates:
        rotor, _, axis = name.partition(".")
        along = 1j * places[rotor]
        found.append(spins[rotor] if not axis else along.real if axis == "x" else along.imag)
    return np.array(found)
