"""The modes of Parker's planetary gear (2009, Table 1) as a result holds them, put together by hand.

For figures: the drawing is checked against displacements from here, not against the program's own model.
"""

from __future__ import annotations

import numpy as np
import xarray as xr
from plot_results import tree
from scipy.linalg import eigh

PRESSURE_ANGLE = np.deg2rad(24.6)


def names(planets, harmonics, motion="planar"):
    discrete = ["x", "y", "rotation"] if motion == "planar" else ["rotation"]
    own = ["radial", "tangential", "rotation"] if motion == "planar" else ["rotation"]
    found = [f"ring_{c}" for c in discrete]
    found += [f"ring_{f}{m}" for m in range(2, harmonics + 1) for f in "cs"]
    found += [f"{body}_{c}" for body in ("carrier", "sun") for c in discrete]
    return found + [f"planet{n}_{c}" for n in range(1, planets + 1) for c in own]


def directions(dofs, planets):
    """Mesh deflections (26), (27) as rows: sun meshes, then ring meshes."""
    a, rows = PRESSURE_ANGLE, []
    for gear in ("sun", "ring"):
        for n in range(1, planets + 1):
            psi = 2 * np.pi * (n - 1) / planets
            at = psi - a if gear == "sun" else psi + a
            sign = 1 if gear == "sun" else -1
            entries = {
                f"{gear}_x": -np.sin(at), f"{gear}_y": np.cos(at), f"{gear}_rotation": 1,
                f"planet{n}_radial": -sign * np.sin(a), f"planet{n}_tangential": -np.cos(a),
                f"planet{n}_rotation": sign,
            }  # fmt: skip
            for m in range(2, 60):
                if gear == "ring":
                    c, s = np.cos(m * psi), np.sin(m * psi)
                    entries[f"ring_c{m}"] = c * np.cos(a) - m * s * np.sin(a)
                    entries[f"ring_s{m}"] = s * np.cos(a) + m * c * np.sin(a)
            rows.append([entries.get(name, 0.0) for name in dofs])
    return np.array(rows)


def matrices(planets=4, harmonics=6):
    """(names, M, K of the mean system, mesh directions), dimensionless as in Parker 2009, k_cu = 1e11 N/m."""
    dofs, m_r, k = names(planets, harmonics), 6.35, 1e8
    mass = {"carrier_x": 5.43, "carrier_y": 5.43, "carrier_rotation": 6.0, "sun_x": 0.4, "sun_y": 0.4}
    mass |= {"sun_rotation": 2.5, "ring_x": m_r, "ring_y": m_r, "ring_rotation": 7.681}
    for n in range(1, planets + 1):
        mass |= {f"planet{n}_radial": 4.0, f"planet{n}_tangential": 4.0, f"planet{n}_rotation": 2.0}
    support = {"carrier_x": 5e11, "carrier_y": 5e11, "carrier_rotation": 1e11}
    support |= {"sun_x": 5e11, "sun_y": 5e11, "sun_rotation": 5e11}
    bending = 0.5
    for m in range(2, harmonics + 1):
        for f in "cs":
            mass[f"ring_{f}{m}"] = m_r * (1 + m**2) / 2
            support[f"ring_{f}{m}"] = k * np.pi * bending * m**2 * (m**2 - 1) ** 2
    stiffness = np.diag([support.get(name, 0.0) / k for name in dofs])
    for n in range(1, planets + 1):
        psi = 2 * np.pi * (n - 1) / planets
        radial = {"carrier_x": np.cos(psi), "carrier_y": np.sin(psi), f"planet{n}_radial": -1}
        across = {"carrier_x": -np.sin(psi), "carrier_y": np.cos(psi), "carrier_rotation": 1}
        for spring in (radial, across | {f"planet{n}_tangential": -1}):
            g = np.array([spring.get(name, 0.0) for name in dofs])
            stiffness += 5e11 / k * np.outer(g, g)
    g = directions(dofs, planets)
    return dofs, np.diag([mass[name] / m_r for name in dofs]), stiffness + g.T @ g, g


def modes_group(planets=4, harmonics=6):
    """The group ``modes``; types are those of the first nine modes of Table 1, the others are "other"."""
    dofs, mass, stiffness, g = matrices(planets, harmonics)
    squares, shapes = eigh(stiffness, mass)
    types = [*"TTRPTTR", "PR", "P"]
    words = {"T": "translational", "R": "rotational", "P": "planet", "PR": "purely ring"}
    numbers = {"T": 1, "R": 0, "P": 2, "PR": -1}
    kinds = [words[t] for t in types] + ["other"] * (len(dofs) - 9) if planets == 4 else ["other"] * len(dofs)
    index = [numbers[t] for t in types] + [-1] * (len(dofs) - 9) if planets == 4 else [-1] * len(dofs)
    meshes = [f"{gear}{n}" for gear in ("sun", "ring") for n in range(1, planets + 1)]
    data = {
        "natural_frequency": ("mode", np.sqrt(np.abs(squares)), {"units": "1", "long_name": "natural frequency"}),
        "mode_shape": (("mode", "dof"), shapes.T, {"units": "1", "long_name": "mode shape"}),
        "mesh_deflection": (("mode", "mesh"), (g @ shapes).T, {"units": "1", "long_name": "modal mesh deflection"}),
        "mode_type": ("mode", kinds),
        "mesh_deflection_type": ("mode", index),
    }
    return xr.Dataset(data, coords={"mode": np.arange(1, len(dofs) + 1), "dof": dofs, "mesh": meshes})


def planetary(**options):
    return tree(modes=modes_group(**options))


def small(dofs, entries, meshes=("mesh",), deflections=((0.0,),), **more):
    """A result with given modes."""
    data = {
        "natural_frequency": ("mode", np.arange(1.0, len(entries) + 1), {"units": "rad/s"}),
        "mode_shape": (("mode", "dof"), np.array(entries, float), {"units": "kg^-1/2"}),
        "mesh_deflection": (("mode", "mesh"), np.array(deflections, float), {"units": "kg^-1/2"}),
        **more,
    }
    return tree(modes=xr.Dataset(data, coords={"dof": list(dofs), "mesh": list(meshes)}))
