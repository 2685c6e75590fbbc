"""Gear pairs with backlash whose periodic motions, multipliers and folds are known to many digits."""

import json
from typing import Any

import numpy as np
from scenes import ROOT

from gearstab.system import GearSystem
from gearstab.systems import build

Array = np.ndarray
CASES: list[dict[str, Any]] = json.loads((ROOT / "tests" / "data" / "backlash_reference.json").read_text())["cases"]
MOTIONS = [(case, motion) for case in CASES for part in (case, case.get("period_two", {"solutions": []}))
           for motion in part["solutions"]]  # fmt: skip


def pair(case: dict[str, Any]) -> GearSystem:
    """x'' + 2 zeta x' + k(t) g(x) = F; the damping always, or in contact only."""
    own = case["parameters"]
    mesh = {"name": "mesh", "mean_stiffness": 1.0, "epsilon": own["epsilon"], "contact_ratio": own["contact_ratio"],
            "backlash": 2 * own["half_backlash_b"]}  # fmt: skip
    system = {"kind": "gear_pair", "units": "none", "equivalent_mass": 1.0, "load": [own["load_F"]], "meshes": [mesh]}
    if own["damping"] == "always":
        return build(system | {"damping_ratio": own["zeta"]})
    return build(system | {"meshes": [mesh | {"damping": 2 * own["zeta"]}]})


def sorted_multipliers(motion: dict[str, Any]) -> Array:
    """Multipliers by descending magnitude, of a pair the one with the positive imaginary part first."""
    found = np.array([complex(*value) for value in motion["multipliers"]])
    return found[np.lexsort((-found.imag, -np.round(np.abs(found), 9)))]
