"""Write configs/many_frequencies/train13.yaml: the gearbox of Kuria & Kihiu (2008) as a train of 13 rotors.

The numbers stand in train13.json, marked as given in the paper, inferred from its results, or assumed.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).parent
TARGET = HERE.parent.parent / "configs" / "many_frequencies" / "train13.yaml"
NAMES = ("I", "II", "III", "IVa", "IVb")
COORDINATES = (
    "input", "pinion_I", "wheel_I", "pinion_II", "wheel_II", "pinion_III", "wheel_III", "pinion_IVa", "wheel_IVa",
    "pinion_IVb", "wheel_IVb", "output_a", "output_b",
)  # fmt: skip


def numbers() -> dict[str, Any]:
    """The contents of train13.json."""
    found: dict[str, Any] = json.loads((HERE / "train13.json").read_text())
    return found


def shafts(data: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """Stiffness and damping of the shafts: c = 2 zeta_s sqrt(k J1 J2/(J1 + J2))."""
    assumed, zeta = data["assumed"], data["given"]["shaft_damping_ratio"]
    inertia = np.array(assumed["inertia"])
    stiffness, damping = np.zeros((2, len(inertia), len(inertia)))
    for (i, j), k in zip(assumed["shafts"], assumed["shaft_stiffness"], strict=True):
        between = np.zeros(len(inertia))
        between[[i, j]] = 1.0, -1.0
        stiffness += k * np.outer(between, between)
        reduced = inertia[i] * inertia[j] / (inertia[i] + inertia[j])
        damping += 2 * zeta * np.sqrt(k * reduced) * np.outer(between, between)
    return stiffness, damping


def rows(matrix: np.ndarray) -> str:
    """A matrix as YAML, a line per row."""
    return "\n".join(f"    - [{', '.join(f'{value:.17g}' for value in row)}]" for row in matrix)


def mesh(data: dict[str, Any], i: int) -> str:
    """One mesh as YAML."""
    assumed = data["assumed"]
    direction = np.zeros(len(assumed["inertia"]))
    (driver, driven), (first, second) = assumed["gears"][i], assumed["base_radii"][i]
    direction[driver], direction[driven] = first, -second
    low, high = assumed["mesh_stiffness_low_high"][i]
    mean = assumed["mesh_stiffness_mean"][i]
    return "\n".join(
        [
            f"    - name: {NAMES[i]}",
            f"      direction: [{', '.join(f'{value:.17g}' for value in direction)}]",
            f"      mean_stiffness: {mean:.17g}",
            f"      epsilon: {0.5 * (high - low) / mean:.17g}",
            f"      contact_ratio: {assumed['contact_ratio'][i]:.17g}",
            f'      frequency_ratio: "{data["inferred"]["mesh_frequency_ratio"][i]}"',
            f"      damping: {assumed['mesh_damping'][i]:.17g}",
        ]
    )


def text() -> str:
    """The configuration."""
    data = numbers()
    stiffness, damping = shafts(data)
    inertia = data["assumed"]["inertia"]
    return f"""# Written by scripts/many_frequencies/train13.py; do not edit.
# The multistage gearbox of Kuria & Kihiu (2008), its 13 torsional coordinates only. SI units, angles in rad.
# Given in the paper: 1500 rpm (350 Hz at mesh I), module 3 mm, 20 deg, damping ratios of the meshes 0.1 and of the
#   shafts 0.05, four stages with five meshes.
# Inferred (reproduces its Table II to rounding): the tooth ratios, hence the mesh frequencies 1 : 7/17 : 21/136 :
#   147/2720, of which 2720 cycles of mesh I make a common period; stage IV is two parallel meshes.
# Assumed: tooth numbers, profile shifts, face widths, and what follows from them (inertias, mesh stiffness, contact
#   ratios); inertias of input and outputs; stiffness of the shafts; equal phases of all meshes.
title: Four mesh frequencies in a gearbox of 13 rotors, near twice its fourth natural frequency
system:
  kind: matrices
  coordinates: [{", ".join(COORDINATES)}]
  coordinate_units: rad
  mass:
{rows(np.diag(inertia))}
  stiffness:
{rows(stiffness)}
  damping:
    matrix:
{rows(damping).replace("    - ", "      - ")}
  meshes:
{chr(10).join(mesh(data, i) for i in range(len(NAMES)))}
sweep:
  mesh_frequency: {{start: "1600 Hz", stop: "1630 Hz", num: 121}}
methods:
  floquet: {{frequencies: common_period}}
  # Which part of the damping suppresses the tongue; with one mesh frequency at a time, which is quick.
  required_damping: {{of: factor, frequencies: per_mesh}}
"""


if __name__ == "__main__":
    TARGET.parent.mkdir(parents=True, exist_ok=True)
    TARGET.write_text(text())
