"""Tooth and mesh stiffness beside those of ROSS (`pip install ross-rotordynamics`), an independent program.

    python scripts/compare_ross.py

prints, for the benchmark pairs of docs/gears.md, the contact ratio, the parts of the teeth's compliance at the pitch
point and the mean mesh stiffness as ROSS finds them over ours. ROSS is no dependency of gearstab; only this uses it.
"""

from __future__ import annotations

import importlib
import warnings
from typing import Any

import numpy as np

from gearstab.gears.compliance import FOUNDATION, pair_stiffness, tooth_compliance
from gearstab.gears.geometry import Gear, tooth_profile
from gearstab.gears.mesh_stiffness import mesh_stiffness
from gearstab.gears.pair import Pair

BENCHMARKS = ((19, 48, 3.175e-3, 0.016), (28, 28, 3.175e-3, 0.0254), (25, 25, 3e-3, 0.02))


def ross_gear(ross: Any, gear: Gear) -> Any:
    """The same gear there."""
    steel = ross.Material(name="steel", rho=gear.density, E=gear.young, Poisson=gear.poisson)
    return ross.GearElementTVMS(
        n=0,
        material=steel,
        width=gear.face_width,
        bore_diameter=2 * gear.bore,
        module=gear.module,
        n_teeth=gear.teeth,
        pr_angle=gear.pressure_angle,
    )


def foundation_as_ross(gear: Gear, roll: float) -> float:
    """Sainsot's foundation as ROSS takes it.

    u_f = y_c - r_f, at the height of the contact point, where the paper has that of the force on the tooth's axis; and
    the tooth's half angle at the root without the tip clearance, which its own fillet has.
    """
    profile = tooth_profile(gear)
    clearance = (gear.dedendum - gear.addendum) * np.tan(gear.pressure_angle)
    theta, root = profile.root_half_angle - 2 * clearance / gear.teeth, gear.root_radius
    h = root / gear.bore
    big_l, big_m, big_p, big_q = FOUNDATION @ np.array([1 / theta**2, h**2, h / theta, 1 / theta, h, 1.0])
    beta = roll - gear.base_half_angle
    u = (float(profile.involute(roll)[1]) - root) / (2 * root * theta)
    shape = big_l * u**2 + big_m * u + big_p * (1 + big_q * np.tan(beta) ** 2)
    return float(np.cos(beta) ** 2 * shape / (gear.young * gear.face_width))


def compare(ross: Any, one: int, two: int, module: float, width: float) -> str:
    """One line of the table."""
    pair = Pair(Gear(one, module, face_width=width), Gear(two, module, face_width=width))
    roll = np.tan(pair.pressure_angle)
    parts = []
    for gear in (pair.pinion, pair.wheel):
        other, own = ross_gear(ross, gear), tooth_compliance(gear, roll)
        beta = other._to_tau(gear.pressure_angle)
        theirs = [getattr(other, f"_inv_k{part}")(beta) for part in "bsaf"]
        ours = [own.bending, own.shear, own.axial, own.foundation]
        parts.append([*np.divide(theirs, ours), theirs[3] / foundation_as_ross(gear, roll)])
    meshed = ross.Mesh(ross_gear(ross, pair.pinion), ross_gear(ross, pair.wheel))
    single = 1 / sum(1 / g._compute_stiffness(g.pr_angle) for g in (meshed.driving_gear, meshed.driven_gear))
    single = 1 / (1 / single + 1 / meshed.hertzian_stiffness)
    figures = [
        meshed.contact_ratio / pair.contact_ratio,
        *np.max(parts, axis=0),
        single / pair_stiffness(pair, pair.pitch_point),
        np.mean(meshed.stiffness_range) / mesh_stiffness(pair).mean,
    ]
    return f"{one}/{two}  " + "  ".join(f"{figure:10.7f}" for figure in figures)


def main() -> None:
    """Print the table."""
    warnings.simplefilter("ignore")
    ross = importlib.import_module("ross")
    heads = ("ratio", "bending", "shear", "axial", "foundation", "as ROSS", "single", "mean")
    print(f"ROSS {ross.__version__} over gearstab (the larger of both gears)")
    print("       " + "  ".join(f"{head:>10}" for head in heads))
    for row in BENCHMARKS:
        print(compare(ross, *row))


if __name__ == "__main__":
    main()
