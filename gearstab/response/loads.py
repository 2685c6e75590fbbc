"""Loads of single parts: forces of bearings, torques of shafts, forces and root stress of teeth along their contact.

A connection carries F = k r q + c r q'. A pair of teeth carries F(t) k_p/k of the mesh force while it moves from its
first point of contact to its last one; over a common period it does so many times, each a little different, and the
largest value at each point of the contact counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.gears.mesh_stiffness import StiffnessModel
from gearstab.gears.pair import Pair
from gearstab.gears.stress import load_shares, root_stress
from gearstab.grouping import Columns
from gearstab.response.panels import CURVES, Readings, extremes
from gearstab.response.steady import SteadyStart
from gearstab.system import Array, GearSystem

HARMONICS = 4
"""Harmonics of each mesh frequency that are followed."""


@dataclass(frozen=True)
class ConnectionForces:
    """Measures of the forces of connections at K operating points.

    peak, mean, rms: ``(K, C)``, largest magnitude, mean and root mean square about it.
    harmonic: ``(K, O, C)``, amplitudes at the orders of :func:`orders`.
    """

    peak: Array
    mean: Array
    rms: Array
    harmonic: Array

    @classmethod
    def empty(cls, system: GearSystem, shape: tuple[int, ...]) -> ConnectionForces:
        """Return NaN for points of a shape in place of K."""
        count = len(system.connections)
        peak, mean, rms = np.full((3, *shape, count), np.nan)
        return cls(peak, mean, rms, np.full((*shape, len(orders(system)), count), np.nan))

    def put(self, row: Array, column: Array, found: ConnectionForces, failed: Array) -> None:
        """Write what was found at some points, but for those that failed."""
        for name, table in vars(self).items():
            values = getattr(found, name)
            values[failed] = np.nan
            table[row, column] = values


def orders(system: GearSystem) -> list[float]:
    """Multiples of the mesh frequency Omega at which meshes excite: the first harmonics of each, in ascending order."""
    ratios = {mesh.frequency_ratio for mesh in system.meshes}
    return sorted({float(s * ratio) for ratio in ratios for s in range(1, HARMONICS + 1)})


class ForceMeter:
    """Measures of the forces of connections, from one part of the common period after the other.

    Forces are exact at the nodes of the panels, their derivatives those of the polynomial through deflections and
    rates; see :mod:`.panels` for integrals and extremes.
    """

    def __init__(self, system: GearSystem, begin: SteadyStart) -> None:
        points, names = begin.points, system.connections
        rows = np.stack([system.flat(item.row, 1) for item in names], axis=1)[points.basis.rows]
        stiffness, damping = (
            np.stack([system.flat(getattr(item, what)) for item in names], axis=1) for what in ("stiffness", "damping")
        )
        self.k, self.c = (part[points.basis.rows][points.at] for part in (stiffness, damping))
        self.gauges = np.concatenate([rows @ points.basis.outlet, rows @ points.basis.speed], axis=1)
        """``(r, 2 C, m)``, deflections of the connections and their derivatives with respect to time from x."""
        self.period = 2 * np.pi * points.excitation.cycles / points.omega
        self.cycles = np.array(orders(system)) * points.excitation.cycles
        shape = (len(begin.x), len(names))
        self.low, self.high = np.full(shape, np.inf), np.full(shape, -np.inf)
        self.first, self.second = np.zeros((2, *shape))
        self.harmonic = np.zeros((len(begin.x), len(self.cycles), len(names)), dtype=complex)
        self.origin: Array | None = None

    def add(self, piece: Readings) -> None:
        """Take a part of the common period into account."""
        force, rate = self._force(piece)
        # Deviations from a value of the motion itself: a small fluctuation of a large force keeps its digits.
        self.origin = force[0, 0, 0] if self.origin is None else self.origin
        least, greatest, _ = extremes(force, rate)
        self.low, self.high = np.minimum(self.low, least.min(axis=0)), np.maximum(self.high, greatest.max(axis=0))
        self.first = self.first + piece.mean(force - self.origin)
        self.second = self.second + piece.mean((force - self.origin) ** 2)
        turns = np.exp(-2j * np.pi * piece.tau[..., None] * self.cycles)
        self.harmonic += 2 * piece.mean(turns[..., None] * force[..., None, :])

    def found(self) -> ConnectionForces:
        """Return the measures of the whole period."""
        assert self.origin is not None
        rms = np.sqrt(np.maximum(self.second - self.first**2, 0.0))
        peak = np.maximum(np.abs(self.low), np.abs(self.high))
        return ConnectionForces(peak, self.origin + self.first, rms, np.abs(self.harmonic))

    def _force(self, piece: Readings) -> tuple[Array, Array]:
        """F and its derivative times the length of a panel, ``(panels, 5, Q, K, C)``."""
        deflection, speed = np.split(piece.values, 2, axis=-1)
        duration = (piece.length * self.period)[..., None]
        rate = speed * duration
        curve = np.einsum("fj,pj...->pf...", CURVES, np.concatenate([deflection, rate], axis=1))
        return self.k * deflection + self.c * speed, self.k * rate + self.c * curve / duration


MOST_POINTS = 100
"""Parts of the contact in which the largest value is sought."""
AT_ONCE = 4096
"""Samples whose load is shared out at once: each takes integrals over two or more teeth, 2 kB apiece."""
AFTER = 1e-9
"""Part of a cycle: a history has the mesh force just after a jump where a sample falls on one."""


@dataclass(frozen=True)
class LoadedTeeth:
    """The teeth of a mesh: pair of gears, how its stiffness is computed, names of the driver and the driven gear."""

    pair: Pair
    model: StiffnessModel
    gears: tuple[str, str]

    @property
    def in_order(self) -> tuple[str, str]:
        """Names of pinion and wheel."""
        return (self.gears[1], self.gears[0]) if self.pair.wheel_drives else self.gears


@dataclass(frozen=True)
class ToothLoads:
    """Loads of one mesh, over the contact from its first point (0) to its last (1), in the middle of equal parts.

    load, static_load: ``(points,)``, the largest load of a pair, and that under the static mesh force, N.
    stress, static_stress: ``(points, 2)``, at the roots of pinion and wheel, Pa; NaN for an internal gear.
    """

    load: Array
    static_load: Array
    stress: Array
    static_stress: Array


def positions(points: int) -> Array:
    """``(points,)``, 0 to 1, the middle of equal parts."""
    return (np.arange(points) + 0.5) / points


def phases(system: GearSystem, mesh: int, time: Array, mesh_frequency: float) -> Array:
    """Return the phases of a mesh at times, in its cycles; 0 is the entry of a pair of teeth."""
    item = system.meshes[mesh]
    return time * mesh_frequency * float(item.frequency_ratio) / (2 * np.pi) - float(item.lag) + AFTER


def tooth_loads(teeth: LoadedTeeth, phase: Array, force: Array, static: float, points: int = MOST_POINTS) -> ToothLoads:
    """Compute the loads of teeth from the mesh force ``(samples,)`` at phases ``(samples,)``, in cycles, and the static
    mesh force.

    points: parts of the contact; with fewer samples in a mesh cycle some of them may be empty, NaN. All are NaN for
    helical teeth, and where the teeth by themselves would part, with a contact ratio below 1.
    """
    pair, model = teeth.pair, teeth.model
    ratio = pair.contact_ratio
    if ratio < 1 or pair.overlap_ratio > 0:
        none, both = np.full(points, np.nan), np.full((points, 2), np.nan)
        return ToothLoads(none, none, both, both)
    load = np.full(points, -np.inf)
    for i in range(0, len(phase), AT_ONCE):
        own = phase[i : i + AT_ONCE]
        _, share = load_shares(pair, own, model)
        # Pairs from the youngest: each has travelled the phase and whole cycles.
        travelled = (own - np.floor(own))[:, None] + np.arange(share.shape[1])
        touching = travelled < ratio
        part = np.minimum((travelled[touching] / ratio * points).astype(int), points - 1)
        np.maximum.at(load, part, (force[i : i + AT_ONCE, None] * share)[touching])
    load = np.where(np.isfinite(load), load, np.nan)
    middle = positions(points) * ratio
    _, own = load_shares(pair, middle, model)
    resting = static * own[np.arange(points), np.floor(middle).astype(int)]
    unit = _stress_of_unit_load(pair, middle)
    return ToothLoads(load, resting, unit * load[:, None], unit * resting[:, None])


def _stress_of_unit_load(pair: Pair, travelled: Array) -> Array:
    """``(points, 2)``, at the roots of pinion and wheel, Pa/N, after base pitches travelled since the entry."""
    way = travelled * pair.base_pitch
    s = np.clip(pair.path[1] - way if pair.wheel_drives else pair.path[0] + way, *pair.path)
    sides = ((pair.pinion, s), (pair.wheel, pair.wheel_arm(s)))
    found = [root_stress(gear, arm / gear.base_radius, 1.0, pair.face_width) for gear, arm in sides]
    return np.stack(found, axis=-1)


@dataclass(frozen=True)
class Contact(Columns):
    """Values of all meshes, ``(rows, meshes)`` each; NaN for waves of which the contact ratio c is not known.

    begin: phase from which on the fewest pairs carry, until the end of the mesh period: c - floor(c).
    pairs: how many these are, floor(c).
    lag: of the phase.
    """

    begin: Array
    pairs: Array
    lag: Array

    def fewest(self, phase: Array) -> Array:
        """Whether the fewest pairs carry at phases ``(..., rows, meshes)`` of the unlagged mesh cycle."""
        own = phase - self.lag
        return np.asarray(own - np.floor(own) >= self.begin)


def contact(system: GearSystem) -> Contact:
    """Return the pairs in contact of the meshes of a system of any batch."""
    waves = [mesh.waveform for mesh in system.whole_meshes]
    ratios = [getattr(wave, "total_contact_ratio", getattr(wave, "contact_ratio", None)) for wave in waves]
    c = np.stack([system.flat(np.nan if ratio is None else ratio, 0) for ratio in ratios], axis=-1)
    lag = np.stack([system.flat(mesh.lag, 0) for mesh in system.whole_meshes], axis=-1)
    return Contact(c - np.floor(c), np.floor(c), lag)
