"""Planetary gears with a rigid or an elastic ring (Parker 2009; Wu & Parker 2008)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gearstab.config.model import vector
from gearstab.config.model.reading import held
from gearstab.system import Array, Cyclic, GearSystem
from gearstab.systems.assembly import Assembly, Coordinates, Element, MeshElement, Row
from gearstab.systems.planetary.parts import lags, speed_of
from gearstab.systems.planetary.planets import SetRows, angles_of, turn_matrix

CENTRAL = ("ring", "carrier", "sun")
"""The bodies on the axis of the gear."""


def build(p: Any) -> GearSystem:
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
    ``load`` (torques over radii on ``ring``, ``carrier``, ``sun``), ``carrier_speed`` and ``pin_preload``
    (:meth:`.SetRows.of_frame`). ``scaling: dimensionless`` refers masses to m_r, stiffnesses to the mean k_rp and so
    frequencies to sqrt(k_rp/m_r); lengths keep their scale.

    Source: Parker 2009, (1)-(8), (26)-(28) and appendix; derived again from the energies, since L2, L4 and M_j are
    misprinted there (derivatives in L2 act on v and v is projected on |m| >= 2; b_r of L4 depends on n and belongs
    inside the sum; M_j divides by r^2 twice). Rotational model: Lin & Parker 2002 (J. Sound Vib. 249, 129-145).
    """
    gear = _gear(p, tuple(angles_of(p.planets, p.angles)))
    symmetric = p.angles is None
    angle = {name: np.asarray(p.pressure_angles[name], dtype=float) for name in ("sun", "ring")}
    meshes = [
        MeshElement(
            p.meshes[name].model_copy(update={"name": f"{name}{n}"}),
            _mesh_row(gear, name, n, angle[name]),
            lag=lag[n - 1],
        )
        for name, lag in lags(p, gear.planets).items()
        for n in gear.numbers
    ]
    elements = [*_bodies(gear, p, angle["ring"]), *_supports(gear, p, angle["ring"])]
    torques = p.load
    place = Coordinates(dict.fromkeys(gear.names, "m"))
    system = Assembly(place, elements, meshes).system(
        p,
        {f"{body}_rotation": torques[body] for body in CENTRAL} if torques else None,
        symmetries=(gear.cyclic(),) if symmetric else (),
        drawing={} if symmetric else {"planet_angles": vector(gear.angles)},
    )
    ratio, speed = speed_of(p)
    if ratio or np.any(speed):
        waves = [({f"ring_c{m}": 1.0}, {f"ring_s{m}": 1.0}, _wave_mass(p, m), m) for m in gear.waves]
        moving = {body: (p.masses[body.rstrip("0123456789")], 0.0) for body in gear.bodies}
        turning = gear.of_frame(place, moving, p.supports.planet, ratio, speed, waves, p.pin_preload)
        system = replace(system, rotations=(turning,))
    if p.scaling == "SI":
        return system
    return system.scaled(np.asarray(p.masses.ring, dtype=float), meshes[-1].wave.mean_stiffness)


def size(p: Any) -> int:
    """Number of coordinates."""
    return len(_gear(p, ()).names)


def _gear(p: Any, angles: tuple[Array, ...]) -> _Gear:
    """Return the coordinates of a gear: J is 1, of the rigid motion alone, of a rigid ring."""
    return _Gear(int(p.planets), angles, 1 if p.ring.kind == "rigid" else int(p.ring.harmonics), p.motion == "planar")


def _mesh_row(gear: _Gear, name: str, n: int, angle: Array) -> Row:
    """The deflection of a mesh, in which an elastic ring takes part."""
    row, psi = gear.deflection(name, n, angle), gear.angle(n)
    along, across = np.cos(angle), np.sin(angle)
    for m in gear.waves if name == "ring" else ():
        cosine, sine = np.cos(m * psi), np.sin(m * psi)
        row |= {f"ring_c{m}": cosine * along - m * sine * across, f"ring_s{m}": sine * along + m * cosine * across}
    return row


@dataclass(frozen=True)
class _Gear(SetRows):
    """Coordinates of a gear.

    harmonics: J; planar: whether bodies move in the plane.
    """

    harmonics: int
    planar: bool

    @property
    def names(self) -> tuple[str, ...]:
        body, planet = (("x", "y"), ("radial", "tangential")) if self.planar else ((), ())
        found = [f"ring_{way}" for way in (*body, "rotation")] + [
            f"ring_{kind}{m}" for m in self.waves for kind in "cs"
        ]
        found += [f"{name}_{way}" for name in ("carrier", "sun") for way in (*body, "rotation")]
        return tuple(found + [f"planet{n}_{way}" for n in self.numbers for way in (*planet, "rotation")])

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of all bodies."""
        return (*CENTRAL, *(f"planet{n}" for n in self.numbers))

    @property
    def waves(self) -> range:
        """m = 2..J."""
        return range(2, self.harmonics + 1)

    def rotation(self, body: str) -> Row:
        return {f"{body}_rotation": 1.0}

    def shift(self, body: str, x: Any, y: Any) -> Row:
        if not body.startswith("planet"):
            return {f"{body}_x": x, f"{body}_y": y} if self.planar else {}
        return {f"{body}_radial": x, f"{body}_tangential": y} if self.planar else {"carrier_rotation": y}

    def cyclic(self) -> Cyclic:
        """The symmetry of equally spaced planets."""
        types = ("rotational", "translational", "planet") if self.planar else ("rotational", "planet")
        still = {"still": "purely ring"} if self.harmonics > 1 else {}
        return Cyclic(self.planets, self.turn(), types, **still)

    def turn(self) -> Array:
        """``(n, n)``, the displacements turned by 2 pi/N: planet n takes what planet n - 1 had."""
        ways = ("radial", "tangential", "rotation") if self.planar else ("rotation",)
        planets = [[f"planet{n}_{way}" for n in self.numbers] for way in ways]
        index = {name: k for k, name in enumerate(self.names)}
        waves = [(f"ring_c{m}", f"ring_s{m}", m) for m in self.waves]
        waves += [(f"{body}_x", f"{body}_y", 1) for body in CENTRAL if self.planar]
        return turn_matrix(index, self.planets, waves, planets)


def _bodies(gear: _Gear, p: Any, ring_angle: Array) -> Iterator[Element]:
    """Yield the masses; int cos^2 + m^2 sin^2 over 2 pi of the ring's is (1 + m^2)/2."""
    masses, inertias = p.masses, p.inertias
    thin = np.asarray(masses.ring, dtype=float) / np.cos(ring_angle) ** 2 if inertias.ring is None else None
    for body in gear.bodies:
        kind = body.rstrip("0123456789")
        for along in ((1.0, 0.0), (0.0, 1.0)):
            yield Element(gear.shift(body, *along), mass=0.0 if masses[kind] is None else masses[kind])
        yield Element({f"{body}_rotation": 1.0}, mass=thin if kind == "ring" and thin is not None else inertias[kind])
    for m in gear.waves:
        for kind in "cs":
            yield Element({f"ring_{kind}{m}": 1.0}, mass=_wave_mass(p, m))


def _wave_mass(p: Any, m: int) -> Array:
    """Return m_r (1 + m^2)/2, the mass of a deflection of the ring by m waves."""
    return np.asarray(p.masses.ring, dtype=float) * (1 + m**2) / 2


def _supports(gear: _Gear, p: Any, ring_angle: Array) -> Iterator[Element]:
    """Yield supports, the ring's bending and foundation, and the planet bearings between carrier and planets."""
    given: dict[str, Array] = {key: np.asarray(value, dtype=float) for key, value in held(p.supports).items()}
    zero = np.zeros(())
    radial, tangential = (given.get(f"ring_{way}", zero) for way in ("radial", "tangential"))
    springs = given | {
        "ring": np.pi * (radial + tangential) + given.get("ring", zero),
        "ring_rotation": 2 * np.pi * tangential / np.cos(ring_angle) ** 2 + given.get("ring_rotation", zero),
    }
    for body in CENTRAL:
        for way, along in (("x", (1.0, 0.0)), ("y", (0.0, 1.0))):
            yield Element(gear.shift(body, *along), stiffness=springs.get(body, zero), name=f"{body}_{way}")
        twist = f"{body}_rotation"
        yield Element({twist: 1.0}, stiffness=springs.get(twist, zero), name=twist)
    for m in gear.waves:
        bending = np.asarray(p.ring.bending_stiffness, dtype=float) * (m * (m**2 - 1)) ** 2
        for kind in "cs":
            yield Element({f"ring_{kind}{m}": 1.0}, stiffness=np.pi * (bending + tangential + m**2 * radial))
    for n in gear.numbers if gear.planar else ():
        for way, row in zip(("radial", "tangential"), gear.bearing(n), strict=True):
            yield Element(row, stiffness=given.get("planet", zero), name=f"planet{n}_{way}")
