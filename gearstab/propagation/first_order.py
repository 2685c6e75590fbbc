"""The first-order form of all rows of a system, in its mean modes and without rigid-body motion.

The state is x = (w u, u', b'): elastic modal coordinates u of the mean system, q = Phi u, weighted by their natural
frequencies, their velocities, and the velocities of the rigid-body modes that damping holds back; ' = d/(rate dt), so
that all entries are of one size. The position of a rigid-body mode deflects nothing and never enters; where nothing
damps it, its velocity does not either, and the part of a force that would accelerate it is left out (it acts on the
train as a whole: elastic modes are orthogonal to it).

    x' = A(t) x + B f(t),    A(t) = constant + sum_j s_j(t) parts_j + sum_k W_k^p_k/(1 - a_k W_k^2) by_speed_k

with speeds of rotation W_k = r_k Omega; those that are held are constant.

Where a speed changes, the Lagrangian W/2 q'^T G^T q of a gyroscopic matrix gives M q'' + W G q' + W'/2 G q: so A gains
Omega' by_rate. In the coordinates of a turning frame that is the Euler force, m W' x r. Of a rotor that tilts it is so
for a drive torque that follows half of the tilt; one that follows all of it leaves nothing, a torque about a fixed axis
twice as much. Circulatory matrices and preloads go with the momentary speed.

The motion that a speed leaves free may change with it: where springs carry centrifugal forces (``preload`` of
:mod:`gearstab.mesh`) it is v(W) = (1 - a W^2 P) v(0), P the part of these springs in it. Then u are the elastic
coordinates beside v(W), and u' in the state is that beside v(0): u~' = u' + f(W) D b'. The position of v(W) would be
a double exponent of zero, which rounding makes grow.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gearstab.grouping import equal_rows
from gearstab.mesh import SpeedTerm, speed_factor_slopes, speed_factors
from gearstab.modal import mean_modes
from gearstab.propagation.schedule import acting
from gearstab.system import Array, GearSystem

UNDAMPED = 1e-11
"""Damping of a rigid-body mode below this part of the largest one is rounding."""
FREE = 1e-9
"""A motion is free where forces on it are below this part of their largest share."""
SLOWEST = 1e-6
"""A mode slower than this part of the mean one is weighted as if it had that frequency."""


@dataclass(frozen=True)
class ModalMatrices:
    """Modal matrices of rows of a system, in the modes of the mean system.

    shapes: ``(r, n, n)``, Phi.  squared: ``(r, n)``, w_p^2.  rate: ``(r,)``, the unit of 1/time.
    rigid: ``(r, n)`` bool, rigid-body modes that no mesh feels.
    static, damping: ``(r, n, n)``, Phi^T K0 Phi and Phi^T C Phi.
    parts: what varies, of the meshes, then of the terms' profiles: (whether it acts on velocities, ``(r, n, n)``).
    turning: what acts with a speed of rotation, all arrays with a row for each.
    drift: D of free motions that change with a speed, and f(W).
    """

    shapes: Array
    squared: Array
    rate: Array
    rigid: Array
    static: Array
    damping: Array
    parts: list[tuple[bool, Array]]
    turning: list[SpeedTerm]
    drift: list[SpeedTerm]

    @classmethod
    def of(cls, system: GearSystem) -> ModalMatrices:
        """Compute those of all rows of the flattened batch."""
        modes = mean_modes(system)
        shapes, squared = system.flat(modes.shapes, 2), system.flat(modes.natural_scale, 1)
        deflection = np.swapaxes(system.flat(modes.mesh_deflection, 2), -1, -2)
        back = np.swapaxes(shapes, -1, -2)
        rate, rigid = system.flat(modes.rate), system.flat(modes.rigid, 1) == 1
        damping = back @ system.flat(system.damping_matrix, 2) @ shapes
        parts = [(False, deflection[:, i, :, None] * deflection[:, i, None, :]) for i in range(len(system.meshes))]
        for term in system.terms:
            u, v = (np.einsum("rnp,rn->rp", shapes, system.flat(end, 1)) for end in (term.left, term.right))
            parts += [(on_velocity, u[:, :, None] * v[:, None, :]) for on_velocity, _ in acting(term)]
        static = back @ system.flat(system.stiffness, 2) @ shapes

        def modal(matrix: Array) -> Array:
            return back @ system.flat(matrix, 2) @ shapes

        by_rotation = [_each(rotation.terms(), modal, system.flat) for rotation in system.rotations]
        turning = [term for own in by_rotation for term in own]
        felt, drift = [term.matrix for term in turning if not term.on_velocity], []
        if felt and rigid.any():
            mean = back @ system.flat(system.mean_stiffness_matrix(), 2) @ shapes
            every = [matrix for on_velocity, matrix in parts if not on_velocity]
            found = _drift(by_rotation, mean, every, rigid)
            still = ~acted_on(felt) if found is None else found[1][:, None] | ~acted_on(felt)
            rigid, drift = rigid & still, [] if found is None else [found[0]]
        return cls(shapes, squared, rate, rigid, static, damping, parts, turning, drift)

    def subset(self, index: Array) -> ModalMatrices:
        """Some of the rows, by position."""
        parts = [(on_velocity, matrix[index]) for on_velocity, matrix in self.parts]
        own = {name: getattr(self, name)[index] for name in ("shapes", "squared", "rate", "rigid", "static", "damping")}

        def taken(values: Array) -> Array:
            return values[index]

        turning, drift = (_each(terms, taken, taken) for terms in (self.turning, self.drift))
        return replace(self, parts=parts, turning=turning, drift=drift, **own)

    def dissipative(self) -> list[Array]:
        """Matrices that act on velocities: the damping, then what varies or goes with a speed, each ``(r, n, n)``."""
        turning = (term.matrix for term in self.turning if term.on_velocity)
        return [self.damping, *(matrix for on_velocity, matrix in self.parts if on_velocity), *turning]

    def turned(self, turn: Array) -> ModalMatrices:
        """The same in other modes, Phi T with T ``(r, n, n)`` orthogonal, which leaves elastic modes as they are."""
        back = np.swapaxes(turn, -1, -2)
        own = {name: back @ getattr(self, name) @ turn for name in ("static", "damping")}
        parts = [(on_velocity, back @ matrix @ turn) for on_velocity, matrix in self.parts]
        turning, drift = (_each(terms, lambda matrix: back @ matrix @ turn) for terms in (self.turning, self.drift))
        return replace(self, shapes=self.shapes @ turn, parts=parts, turning=turning, drift=drift, **own)

    @property
    def weight(self) -> Array:
        """``(r, n)``, natural frequencies in units of the rate, that of the slowest mode no less than SLOWEST."""
        frequency = np.sqrt(self.squared) / self.rate[:, None]
        return np.where(np.isinf(frequency), 1.0, np.maximum(frequency, SLOWEST))

    def form(self, rows: Array, elastic: Array, damped: Array, weight: Array) -> FirstOrder:
        """Return the first-order form of these rows, of the state (w u, u', b').

        rows: their positions in the flattened batch. elastic: ``(e,)``, which modes u are; damped: ``(k,)``, which
        rigid-body modes b are; m = 2 e + k. weight: ``(r, e)``, w.
        """
        moving, rate, shapes = np.concatenate([elastic, damped]), self.rate[:, None, None], self.shapes
        n, m = len(elastic), len(elastic) + len(moving)

        def placed(on_velocity: bool, matrix: Array) -> Array:
            """-matrix where it acts, in the units of the state."""
            whole = np.zeros((len(rows), m, m))
            if on_velocity:
                whole[:, n:, n:] = -matrix[:, moving[:, None], moving] / rate
            else:
                whole[:, n:, :n] = -matrix[:, moving[:, None], elastic] / rate**2 / weight[:, None, :]
            return whole

        def carried(matrix: Array) -> Array:
            """How velocities of free motions enter those of elastic coordinates beside them."""
            whole = np.zeros((len(rows), m, m))
            whole[:, :n, n:] = weight[:, :, None] * matrix[:, elastic[:, None], moving]
            return whole

        constant = placed(False, self.static) + placed(True, self.damping)
        constant[:, np.arange(n), n + np.arange(n)] = weight
        turning = [(term, placed(term.on_velocity, term.matrix)) for term in self.turning]
        turning += [(term, carried(term.matrix)) for term in self.drift]
        rates = [0.5 * term.speed_ratio * placed(False, term.matrix) for term in self.turning if term.on_velocity]
        following = [(term, matrix) for term, matrix in turning if not term.held]
        for term, matrix in turning:
            if term.held:
                factor = speed_factors(np.asarray(term.speed), np.asarray(term.power), np.asarray(term.softening))
                constant += factor[:, None, None] * matrix
        inlet, outlet = np.zeros((len(rows), m, shapes.shape[1])), np.zeros((len(rows), shapes.shape[1], m))
        speed = np.zeros_like(outlet)
        inlet[:, n:] = np.swapaxes(shapes[:, :, moving], -1, -2) / rate**2
        outlet[:, :, :n] = shapes[:, :, elastic] / weight[:, None, :]
        speed[:, :, n:] = shapes[:, :, moving] * rate
        still = np.setdiff1d(np.arange(shapes.shape[-1]), moving)
        parts = np.stack([placed(*part) for part in self.parts], axis=1)
        found = FirstOrder(rows, self.rate, constant, parts, inlet, outlet, speed, shapes[:, :, still])
        if not following:
            return found
        by_speed = np.stack([matrix for _, matrix in following], axis=1)
        laws = [
            np.stack(np.broadcast_arrays(term.speed_ratio, term.power, term.softening), axis=-1)
            for term, _ in following
        ]
        return replace(
            found, by_speed=by_speed, laws=np.stack(laws, axis=1), by_rate=sum(rates, np.zeros((len(rows), m, m)))
        )


def _each(
    terms: Iterable[SpeedTerm], matrix: Callable[[Array], Array], number: Callable[[Array], Array] = np.asarray
) -> list[SpeedTerm]:
    """Terms with a function of their matrices, and one of their speeds and softenings."""
    return [
        replace(
            term,
            matrix=matrix(term.matrix),
            speed=number(np.asarray(term.speed)),
            softening=number(np.asarray(term.softening)),
        )
        for term in terms
    ]


@dataclass(frozen=True)
class FirstOrder:
    """Rows of a system that have equally many coordinates of each sort.

    rows: ``(r,)``, positions in the flattened batch.
    rate: ``(r,)``, the unit of 1/time.
    constant: ``(r, m, m)``; parts: ``(r, J, m, m)``, of the meshes, then of the terms' profiles.
    inlet: ``(r, m, n)``, B, for generalised forces in the system's units.
    outlet: ``(r, n, m)``, q from x; speed: ``(r, n, m)``, dq/dt from x.
    undamped_rigid: ``(r, n, k)``, rigid-body modes that nothing holds back, normalised by the mass matrix.
    by_speed: ``(r, S, m, m)``, what goes with the speed; laws: ``(r, S, 3)``, how: W/Omega, power and softening of
    :class:`gearstab.mesh.SpeedTerm`; by_rate: ``(r, m, m)``, what goes with dOmega/dt. None where nothing does.
    """

    rows: Array
    rate: Array
    constant: Array
    parts: Array
    inlet: Array
    outlet: Array
    speed: Array
    undamped_rigid: Array
    by_speed: Array | None = None
    laws: Array | None = None
    by_rate: Array | None = None

    def subset(self, index: Array) -> FirstOrder:
        """Some of the rows, by position."""
        return replace(self, **{name: part[index] for name, part in vars(self).items() if part is not None})

    def only(self, kept: Array) -> FirstOrder:
        """The same of some of the state's components, ``(m,)`` bool, which the others do not act on."""
        square = {name: getattr(self, name) for name in ("constant", "parts", "by_speed", "by_rate")}
        own = {name: part[..., kept, :][..., kept] for name, part in square.items() if part is not None}
        reached = {name: getattr(self, name)[..., kept] for name in ("outlet", "speed")}
        return replace(self, inlet=self.inlet[:, kept], **reached, **own)

    @classmethod
    def joined(cls, parts: Sequence[FirstOrder]) -> FirstOrder:
        """All rows of several that have the same coordinates and laws."""
        given = [name for name, own in vars(parts[0]).items() if own is not None]
        return replace(parts[0], **{name: np.concatenate([getattr(part, name) for part in parts]) for name in given})

    def at_speeds(self, at: Array, speed: Array) -> FirstOrder:
        """Return a row for each of the speeds ``(K,)`` that rows ``at`` (K,) have, with what goes with it in A."""
        own = self.subset(at)
        return own if own.by_speed is None else replace(own, constant=own._static(speed), by_speed=None, laws=None)

    @property
    def scaled_laws(self) -> Array | None:
        """``laws`` of mesh frequencies in units of the rates."""
        return (
            None if self.laws is None else self.laws * np.stack([self.rate, *np.ones((2, len(self.rate)))], -1)[:, None]
        )

    @property
    def size(self) -> int:
        """m."""
        return int(self.constant.shape[-1])

    @property
    def elastic(self) -> int:
        """e, the number of modes whose position is in the state."""
        return int(np.count_nonzero(np.abs(self.outlet[0]).max(axis=0)))

    def state(self, displacement: Array, velocity: Array, mass: Array) -> Array:
        """x ``(m,)`` of the first row from q and dq/dt ``(n,)``: by the mass matrix, by which modes are orthogonal."""
        rate = float(self.rate[0])
        modes = self.inlet[0] * rate**2
        n = self.elastic
        weight = np.diagonal(self.constant[0, :n, n : 2 * n])
        x = modes @ mass @ velocity / rate
        x[:n] = weight * (modes[n : 2 * n] @ mass @ displacement)
        return np.asarray(x)

    def generator(self, values: Array, speed: Array | float = 0.0) -> Array:
        """A ``(..., r, m, m)`` for the values ``(..., r, J)`` of the varying functions, and speeds ``(..., r)``.

        Further values, of what does not act in A, are left out of account.
        """
        flat = self.parts.reshape(*self.parts.shape[:2], self.size**2)
        varying = np.einsum("...rj,rjk->...rk", values[..., : flat.shape[1]], flat)
        return self._static(speed) + varying.reshape(*varying.shape[:-1], self.size, self.size)

    def speed_slope(self, speed: Array) -> Array:
        """dA/dOmega ``(..., r, m, m)`` at speeds ``(..., r)``."""
        if self.by_speed is None or self.laws is None:
            return np.zeros_like(self.constant)
        ratio, power, softening = np.moveaxis(self.laws, -1, 0)
        slope = ratio * speed_factor_slopes(ratio * np.asarray(speed)[..., None], power, softening)
        return np.asarray(np.einsum("...rs,rsij->...rij", slope, self.by_speed))

    def _static(self, speed: Array | float) -> Array:
        """The part of A ``(..., r, m, m)`` that does not vary at speeds ``(..., r)``."""
        if self.by_speed is None or self.laws is None:
            return self.constant
        ratio, power, softening = np.moveaxis(self.laws, -1, 0)
        factor = speed_factors(ratio * np.asarray(speed)[..., None], power, softening)
        return np.asarray(self.constant + np.einsum("...rs,rsij->...rij", factor, self.by_speed))


def _drift(
    by_rotation: list[list[SpeedTerm]], mean: Array, parts: list[Array], rigid: Array
) -> tuple[SpeedTerm, Array] | None:
    """D and f(W) of the rotation with a preload, and in which rows ``(r,)`` its motions are free at every speed.

    mean: ``(r, n, n)``, of the mean stiffness. From K(W) v(W) = 0 at every W, with L the preload and K the centripetal
    matrix, (K + L) v(0) = a K(0) P v(0), which gives the elastic part of P v(0) and, by L P = L, the rigid one.
    """
    preloaded = [own for own in by_rotation if np.any(own[-1].softening)]
    if len(preloaded) != 1:
        return None
    own = [term for term in preloaded[0] if not term.on_velocity]
    elsewhere = (terms for terms in by_rotation if terms is not preloaded[0])
    others = [term.matrix for terms in elsewhere for term in terms if not term.on_velocity]
    preload, free = own[-1], rigid[:, None, :]
    pull = sum(term.matrix for term in own if term.power == 2) * free * ~rigid[:, :, None]
    size = np.abs(mean).max(axis=(1, 2))
    matrix = np.linalg.solve(mean + np.eye(rigid.shape[1]) * (rigid * size[:, None])[:, None, :], pull)
    own_share = np.einsum("rpp,rp->r", preload.matrix, rigid)
    shared = np.sum(preload.matrix * matrix, axis=(1, 2)) / np.where(own_share > 0, own_share, np.inf)
    found = SpeedTerm(False, matrix, 2, preload.speed_ratio, preload.speed, preload.softening - shared)
    squared = 0.1 / np.where(preload.softening > 0, preload.softening, np.inf)

    def factor(term: SpeedTerm) -> Array:
        """At a speed where the springs are a tenth softer."""
        speed, power, softening = (np.asarray(v) for v in (np.sqrt(squared), term.power, term.softening))
        return speed_factors(speed, power, softening)[:, None, None]

    motion = np.eye(rigid.shape[1]) * free - factor(found) * matrix
    stiffness = [mean, *(factor(term) * term.matrix for term in own)]
    forces, shares = sum(stiffness) @ motion, sum(np.abs(part) @ np.abs(motion) for part in stiffness)
    left = np.abs(forces).max(axis=(1, 2)) <= FREE * shares.max(axis=(1, 2))
    for part in (*others, *parts):
        left &= np.abs(part @ motion).max(axis=(1, 2)) <= FREE * (np.abs(part) @ np.abs(motion)).max(axis=(1, 2))
    return replace(found, matrix=matrix * left[:, None, None]), left


def acted_on(matrices: list[Array]) -> Array:
    """``(r, n)``: which modes any of the matrices ``(r, n, n)``, at least one, acts on by more than rounding."""
    columns = np.max([np.abs(matrix).max(axis=1) for matrix in matrices], axis=0)
    return np.asarray(columns > UNDAMPED * columns.max(axis=1, keepdims=True, initial=0.0))


def bases(system: GearSystem, whole: bool = False) -> Iterator[FirstOrder]:
    """All rows, each once.

    whole: keep all modes, positions of rigid-body modes included, for histories that follow the train as it turns.
    """
    modal = ModalMatrices.of(system)
    if whole:
        rigid, elastic = modal.rigid, (~modal.rigid[:, None, :]).astype(float)
        parts = [(on_velocity, matrix if on_velocity else matrix * elastic) for on_velocity, matrix in modal.parts]
        # Rounding in the stiffness of a rigid-body mode would bend its uniform motion in the long run.
        modal = replace(modal, static=modal.static * elastic, parts=parts, rigid=np.zeros_like(rigid), drift=[],
                        squared=np.where(rigid, np.inf, modal.squared))  # fmt: skip
    damped = modal.rigid & acted_on(modal.dissipative())
    for members, _ in equal_rows(modal.rigid.astype(int) + damped):
        own, elastic = modal.subset(members), np.flatnonzero(~modal.rigid[members[0]])
        yield own.form(members, elastic, np.flatnonzero(damped[members[0]]), own.weight[:, elastic])
