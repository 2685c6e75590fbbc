"""Planetary gears with a rigid or an elastic ring (Parker 2009; Wu & Parker 2008)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gearstab.config.model.arrays import diagonal, vector
from gearstab.system import Array, Cyclic, GearSystem
from gearstab.systems.parts.damping import with_damping
from gearstab.systems.parts.forcing import with_forcing
from gearstab.systems.parts.mesh import build_mesh
from gearstab.systems.planetary.angles import angles_of
from gearstab.systems.planetary.phasing import lags

CENTRAL = ("ring", "carrier", "sun")
"""The bodies on the axis of the gear."""


def build(p: dict[str, Any]) -> GearSystem:
    """Sun, carrier, ring and N equal planets at the angles psi_n, with 2 N tooth meshes.

    Coordinates, all lengths (m): translations x, y and rotation u = r theta (r the base radius, of the carrier the
    radius of the planets' centres) of the ring's rigid motion, the carrier and the sun; radial and tangential
    displacement xi, eta and rotation u of each planet; amplitudes of the ring's elastic tangential deflection

        v = sum_(m = 2..J) c_m cos m theta + s_m sin m theta,   radially w = -dv/dtheta (inextensible).

    The matrices come from the energies (a dot is d/dt, a dash d/dtheta; U and W are the whole tangential and radial
    motion of the ring, v and w their elastic parts, k_bend = E J/(R^3 (1 - nu^2)))

        2 T = sum of m (x.^2 + y.^2) + (I/r^2) u.^2 over all bodies + m_r/(2 pi) int v.^2 + w.^2 dtheta,
        2 V = int k_bend (w + w'')^2 + k_rus U^2 + k_rbs W^2 dtheta + springs of supports and planet bearings
              + sum_n k_sn delta_sn^2 + k_rn delta_rn^2,

        delta_sn = y_s cos psi_sn - x_s sin psi_sn + u_s - xi_n sin a_s - eta_n cos a_s + u_n,   psi_sn = psi_n - a_s
        delta_rn = y_r cos psi_rn - x_r sin psi_rn + u_r + xi_n sin a_r - eta_n cos a_r - u_n
                   + v(psi_n) cos a_r + v'(psi_n) sin a_r,                                       psi_rn = psi_n + a_r

    and are exact for the deflections kept, |m| <= J (Galerkin). ``motion: rotational`` constrains x = y = 0 and lets
    the planets' centres move with the carrier: xi_n = 0, eta_n = u_c.

    Parameters: ``planets`` N, ``angles`` psi_n (2 pi (n - 1)/N without), ``ring`` (``kind`` rigid or elastic,
    ``harmonics`` J, ``bending_stiffness``), ``motion``, ``masses``, ``inertias`` (I/r^2; the ring's is m_r/cos^2 a_r
    of a thin rim unless given), ``supports`` (``ring`` and ``ring_rotation``, k_r and k_ru of Lin & Parker 1999, hold a
    rigid ring only),
    ``pressure_angles``, ``meshes`` (``sun``, ``ring``), ``phases`` or ``teeth`` (:mod:`.phasing`), damping,
    ``load`` (torques over radii on ``ring``, ``carrier``, ``sun``). ``scaling: dimensionless`` refers masses to m_r,
    stiffnesses to the mean k_rp and so frequencies to sqrt(k_rp/m_r); lengths keep their scale.

    Source: Parker 2009, (1)-(8), (26)-(28) and appendix; derived again from the energies, since L2, L4 and M_j are
    misprinted there (derivatives in L2 act on v and v is projected on |m| >= 2; b_r of L4 depends on n and belongs
    inside the sum; M_j divides by r^2 twice). Rotational model: Lin & Parker 2002 (J. Sound Vib. 249, 129-145).
    """
    gear = _Gear(int(p["planets"]), _harmonics(p["ring"]), tuple(angles_of(p)))
    symmetric = p.get("angles") is None
    angle = {name: np.asarray(p["pressure_angles"][name], dtype=float) for name in ("sun", "ring")}
    parts, meshes = [], []
    for name, lag in lags(p, gear.planets).items():
        for n in range(1, gear.planets + 1):
            parts.append(p["meshes"][name] | {"name": f"{name}{n}"})
            direction = gear.vector(_deflection(gear, name, n, angle[name]))
            meshes.append(build_mesh(parts[-1], direction, lag=lag[n - 1]))
    full = GearSystem(
        gear.diagonal(_masses(gear, p, angle["ring"])), _stiffness(gear, p, angle["ring"]), tuple(meshes),
        coordinates=gear.names, symmetry=gear.cyclic() if symmetric else None,
        drawing={} if symmetric else {"planet_angles": vector(gear.angles)},
    )  # fmt: skip
    system = full if p["motion"] == "planar" else _rotational(full, gear)
    if gear.harmonics > 1 and system.symmetry is not None:
        system = replace(system, symmetry=replace(system.symmetry, still="purely ring"))
    system = with_damping(system, p | {"meshes": parts})
    system = with_forcing(system, {"meshes": parts, "load": _load(system.coordinates, p.get("load"))})
    if p["scaling"] == "SI":
        return system
    return system.scaled(np.asarray(p["masses"]["ring"], dtype=float), meshes[-1].mean_stiffness)


def coordinates(planets: int, harmonics: int, motion: str) -> tuple[str, ...]:
    """Names of the coordinates; ``harmonics`` is 1 for a rigid ring."""
    names = _Gear(planets, harmonics, ()).names
    return names if motion == "planar" else tuple(name for name in names if _free_to_rotate(name))


def _harmonics(ring: dict[str, Any]) -> int:
    """J, the largest number of waves around the ring; 1, its rigid motion alone, of a rigid ring."""
    return int(ring["harmonics"]) if ring["kind"] == "elastic" else 1


@dataclass(frozen=True)
class _Gear:
    """Coordinates of a planar gear. planets: N; harmonics: J; angles: psi_n, any of which may have a batch shape."""

    planets: int
    harmonics: int
    angles: tuple[Array, ...]

    @property
    def names(self) -> tuple[str, ...]:
        found = ["ring_x", "ring_y", "ring_rotation"]
        found += [f"ring_{kind}{m}" for m in self.waves for kind in "cs"]
        found += [f"{body}_{way}" for body in ("carrier", "sun") for way in ("x", "y", "rotation")]
        planets = range(1, self.planets + 1)
        return tuple(found + [f"planet{n}_{way}" for n in planets for way in ("radial", "tangential", "rotation")])

    @property
    def waves(self) -> range:
        """m = 2..J."""
        return range(2, self.harmonics + 1)

    def angle(self, n: int) -> Array:
        """Return psi_n."""
        return self.angles[n - 1]

    def vector(self, entries: dict[str, Any]) -> Array:
        """``(..., n)`` with the given entries, which may have a batch shape; 0 elsewhere."""
        return vector([entries.get(name, 0.0) for name in self.names])

    def diagonal(self, entries: dict[str, Any]) -> Array:
        """``(..., n, n)`` with the given entries on the diagonal."""
        return diagonal([entries.get(name, 0.0) for name in self.names])

    def cyclic(self) -> Cyclic:
        """The symmetry of equally spaced planets."""
        return Cyclic(self.planets, self.turn(), ("rotational", "translational", "planet"))

    def turn(self) -> Array:
        """``(n, n)``, the displacements turned by 2 pi/N: planet n takes what planet n - 1 had."""
        place = {name: k for k, name in enumerate(self.names)}
        turn = np.zeros((len(place), len(place)))
        pairs = [(f"ring_c{m}", f"ring_s{m}", m) for m in self.waves] + [(f"{b}_x", f"{b}_y", 1) for b in CENTRAL]
        for first, second, m in pairs:
            at = [place[first], place[second]]
            cosine, sine = np.cos(m * self.angle(2)), np.sin(m * self.angle(2))
            turn[np.ix_(at, at)] = [[cosine, -sine], [sine, cosine]]
        for body in CENTRAL:
            turn[place[f"{body}_rotation"], place[f"{body}_rotation"]] = 1.0
        for n in range(1, self.planets + 1):
            for way in ("radial", "tangential", "rotation"):
                turn[place[f"planet{n % self.planets + 1}_{way}"], place[f"planet{n}_{way}"]] = 1.0
        return turn


def _masses(gear: _Gear, p: dict[str, Any], ring_angle: Array) -> dict[str, Any]:
    """Twice the kinetic energy is diagonal: int cos^2 + m^2 sin^2 over 2 pi of the ring's mass is (1 + m^2)/2."""
    masses, inertias = p["masses"], dict(p["inertias"])
    ring = np.asarray(masses["ring"], dtype=float)
    if inertias.get("ring") is None:
        inertias["ring"] = ring / np.cos(ring_angle) ** 2
    entries: dict[str, Any] = {}
    for body in CENTRAL:
        entries |= _of_body(body, masses.get(body), inertias[body])
    for n in range(1, gear.planets + 1):
        entries |= {f"planet{n}_radial": masses["planet"], f"planet{n}_tangential": masses["planet"]}
        entries[f"planet{n}_rotation"] = inertias["planet"]
    return entries | {f"ring_{kind}{m}": ring * (1 + m**2) / 2 for m in gear.waves for kind in "cs"}


def _of_body(body: str, translation: Any, rotation: Any) -> dict[str, Any]:
    """What both translations and the rotation of a body have; a translation that is constrained needs nothing."""
    moved = 1.0 if translation is None else translation
    return {f"{body}_x": moved, f"{body}_y": moved, f"{body}_rotation": rotation}


def _stiffness(gear: _Gear, p: dict[str, Any], ring_angle: Array) -> Array:
    """K0: supports, the ring's bending and foundation, and the planet bearings between carrier and planets."""
    supports = p["supports"]
    radial, tangential = (_spring(supports, f"ring_{way}") for way in ("radial", "tangential"))
    moving = np.pi * (radial + tangential) + _spring(supports, "ring")
    turning = 2 * np.pi * tangential / np.cos(ring_angle) ** 2 + _spring(supports, "ring_rotation")
    entries = _of_body("ring", moving, turning)
    for body in ("carrier", "sun"):
        entries |= _of_body(body, supports[body], supports[f"{body}_rotation"])
    for m in gear.waves:
        bending = np.asarray(p["ring"]["bending_stiffness"], dtype=float) * (m * (m**2 - 1)) ** 2
        entries |= dict.fromkeys((f"ring_c{m}", f"ring_s{m}"), np.pi * (bending + tangential + m**2 * radial))
    return gear.diagonal(entries) + _spring(supports, "planet")[..., None, None] * _bearings(gear)


def _spring(supports: dict[str, Any], key: str) -> Array:
    """The stiffness of a support, 0 where there is none."""
    return np.asarray(0.0 if supports.get(key) is None else supports[key], dtype=float)


def _bearings(gear: _Gear) -> Array:
    """Sum over the planets of the squared radial and tangential deflection of a bearing, as a matrix."""
    total: Array = np.zeros((len(gear.names), len(gear.names)))
    for n in range(1, gear.planets + 1):
        cosine, sine = np.cos(gear.angle(n)), np.sin(gear.angle(n))
        radial = {"carrier_x": cosine, "carrier_y": sine, f"planet{n}_radial": -1.0}
        tangential = {"carrier_x": -sine, "carrier_y": cosine, "carrier_rotation": 1.0, f"planet{n}_tangential": -1.0}
        for spring in (gear.vector(radial), gear.vector(tangential)):
            total = total + spring[..., :, None] * spring[..., None, :]
    return total


def _deflection(gear: _Gear, name: str, n: int, angle: Array) -> dict[str, Any]:
    """The mesh deflection of the sun or the ring with planet n. Source: Parker 2009, (26), (27)."""
    psi, sign = gear.angle(n), 1.0 if name == "sun" else -1.0
    along, across = np.cos(angle), np.sin(angle)
    entries = {
        f"{name}_x": -np.sin(psi - sign * angle), f"{name}_y": np.cos(psi - sign * angle), f"{name}_rotation": 1.0,
        f"planet{n}_radial": -sign * across, f"planet{n}_tangential": -along, f"planet{n}_rotation": sign,
    }  # fmt: skip
    if name == "ring":
        for m in gear.waves:
            cosine, sine = np.cos(m * psi), np.sin(m * psi)
            entries |= {f"ring_c{m}": cosine * along - m * sine * across}
            entries |= {f"ring_s{m}": sine * along + m * cosine * across}
    return entries


def _free_to_rotate(name: str) -> bool:
    """Whether a coordinate remains in the rotational model."""
    return not name.endswith(("_x", "_y", "_radial", "_tangential"))


def _rotational(system: GearSystem, gear: _Gear) -> GearSystem:
    """The same gear without translations, its planets' centres fixed to the carrier: q = B q_rotational."""
    names = tuple(name for name in gear.names if _free_to_rotate(name))
    basis = np.zeros((len(gear.names), len(names)))
    for k, name in enumerate(gear.names):
        kept = "carrier_rotation" if name.endswith("_tangential") else name
        if kept in names:
            basis[k, names.index(kept)] = 1.0
    turn = _left_inverse(basis) @ gear.turn() @ basis
    symmetry = None if system.symmetry is None else Cyclic(gear.planets, turn, ("rotational", "planet"))
    return replace(system.projected(basis, names), symmetry=symmetry, drawing=system.drawing)


def _left_inverse(basis: Array) -> Array:
    return np.linalg.solve(basis.T @ basis, basis.T)


def _load(coordinates: Sequence[str], torques: dict[str, Any] | None) -> list[Any] | None:
    """Generalised forces, one per coordinate, of torques over radii on ``ring``, ``carrier`` and ``sun``."""
    if not torques:
        return None
    of = {f"{body}_rotation": torques.get(body, 0.0) for body in CENTRAL}
    return [of.get(name, 0.0) for name in coordinates]
