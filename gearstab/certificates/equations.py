"""M q'' + C_s q' + K_s q = 0 as x' = A_s x in balls, rigid-body modes split off.

All numbers are doubles and are taken exactly; C_s and K_s may be any matrices. Without rigid-body modes x = (q, q'),
and where M and all K_s are symmetric and C_s = C is skew (gyroscopic, no damping), Q = [[C, M], [-M, 0]] is kept.

**Rigid-body modes.** A multiplier 1 that belongs to a free rotation r is no question of proof but of definition: K_s r
= 0 is *imposed*. As many coordinates as there are vectors r are singled out; the entries of K_s in their columns are
replaced by what K_s r = 0 makes of the others. It is refused unless what is stored agrees to 1e-9.

* If C_s r = 0, r^T K_s = 0 and r^T C_s = 0 to 1e-9 too, these are imposed as well, on rows and columns. With
  q = r a + E z, E the unit vectors of the other coordinates, r^T times the equation gives
  a'' = -(r^T M r)^-1 r^T M E z'': the rest moves by itself, with E^T C_s E, E^T K_s E and the Schur complement
  E^T M E - E^T M r (r^T M r)^-1 r^T M E as its matrices. What is proved is about z: about q except for r (a + b t).
* Else velocities along r count: x = (z, q') with z' = E^T q' - E^T r (D^T r)^-1 D^T q', D the unit vectors of the
  coordinates singled out, and q'' = -M^-1 (C_s q' + K_s E z). What is proved is about q except for a constant r a.

**Matrices that follow the speed**, Omega G q' + (Omega H + Omega^2 K) q. In the time Omega t and with u = 1/Omega the
equation is M q'' + (G + u C_s) q' + (K + u H + u^2 K_s) q = 0, so that A_s = A_0 + u A_1 + u^2 A_2. r is imposed on all
matrices alike. Q is kept where C_s = 0, all else is symmetric and G, its C, skew.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from flint import arb_mat, ctx

from gearstab.certificates.balls import enclosed, exact, near
from gearstab.certificates.choices import modal

Array = np.ndarray

BITS = 160
"""Precision of the midpoints (bits): more than any proof takes."""
IMPOSED = 1e-9
"""Part of |K| |r| up to which K r counts as 0."""
COORDINATES = 4
"""Coordinates in an octave of mesh frequencies where matrices follow the speed."""


@dataclass(frozen=True)
class Segments:
    """A system as stored.

    mass ``(n, n)``; damping, stiffness ``(D, n, n)`` of its states; states, fractions ``(S,)`` of the segments; N,
    cycles, of a period 2 pi N/Omega; rigid ``(n, k)``, the vectors r. following: G, H, K ``(n, n)`` in
    Omega G q' + (Omega H + Omega^2 K) q; None where nothing follows the speed.
    """

    mass: Array
    damping: Array
    stiffness: Array
    states: Sequence[int]
    fractions: Sequence[float]
    cycles: float
    rigid: Array
    following: tuple[Array, Array, Array] | None = None


@dataclass(frozen=True)
class Enclosed:
    """A flow in doubles, in coordinates ``modes`` of the modes of a mean system.

    terms ``(D, I, m, m)``: A, or A_0, A_1, A_2, of each state, and radii ``(D, I)``; forms ``(2, m, m)``: Q and Q^-1.
    """

    modes: Array
    terms: Array
    radii: Array
    forms: Array
    form_radii: Array


@dataclass(frozen=True)
class Flow:
    """A of each state; of each segment its state and f_s; cycles N; form Q, None where something is damped.

    following: of each state (A_1, A_2) where matrices follow the speed: the generators are then A_0.
    """

    generators: Sequence[arb_mat]
    states: Sequence[int]
    fractions: Sequence[float]
    cycles: float
    form: arb_mat | None
    following: Sequence[tuple[arb_mat, arb_mat]] = ()
    found: dict[int, Enclosed] = field(default_factory=dict, init=False, repr=False)

    def enclosed(self, omega: float) -> Enclosed:
        """In coordinates of the mean modes near a mesh frequency: any coordinates would be right."""
        key = round(COORDINATES * float(np.log2(omega))) if self.following else 0
        if key not in self.found:
            self.found[key] = self._enclosed(2.0 ** (-key / COORDINATES))
        return self.found[key]

    def _enclosed(self, u: float) -> Enclosed:
        ctx.prec = BITS
        every = [[a] for a in self.generators]
        for parts, more in zip(every, self.following, strict=False):
            parts += more
        whole = np.array([sum(near(part) * u**k for k, part in enumerate(parts)) for parts in every])
        modes = modal(whole, np.bincount(self.states, self.fractions))
        turn = exact(modes)
        back, form = turn.inv(), None if self.form is None else turn.transpose() * self.form * turn
        terms, radii = enclosed([[back * part * turn for part in parts] for parts in every])
        forms, form_radii = enclosed([[form, form.inv()]]) if form is not None else (np.empty((1, 0)), np.empty((1, 0)))
        return Enclosed(modes, terms, radii, forms[0], form_radii[0])

    def powers(self, omega: float) -> Array:
        """Return the factors on the terms of each state over a period, without 2 pi N: 1/Omega, or 1, 1/Omega, ..."""
        return omega ** -np.arange(3.0) if self.following else np.array([1 / omega])

    def decay(self, own: Enclosed, omega: float) -> Array:
        """Return how much each mode of the mean system decays in a period, about."""
        mean = np.tensordot(np.bincount(self.states, self.fractions), own.terms, 1)
        return -2 * np.pi * self.cycles * np.einsum("i,ijj->j", self.powers(omega), mean)

    @cached_property
    def sorts(self) -> tuple[Array, Array, Array]:
        """State and f_s of each sort of segments, and the sort of every segment."""
        (states, fractions), index = np.unique([self.states, self.fractions], axis=1, return_inverse=True)
        return states.astype(int), fractions, np.ravel(index)


def flow(system: Segments) -> Flow:
    """The system in balls; raises ValueError where the vectors are no rigid-body modes."""
    ctx.prec = BITS
    mass, damping, stiffness = exact(system.mass), system.damping, system.stiffness
    turning = (
        [np.zeros((0, *system.mass.shape))] * 3 if system.following is None else [*np.array(system.following)[:, None]]
    )
    columns: tuple[arb_mat, arb_mat] | None = None
    if system.rigid.shape[1]:
        felt, drags = np.concatenate([stiffness, *turning[1:]]), np.concatenate([damping, turning[0]])
        if _left(felt, system.rigid) > IMPOSED:
            raise ValueError("these vectors are no rigid-body modes")
        single = _singled_out(system.rigid)
        others = np.setdiff1d(np.arange(len(system.mass)), single)
        rigid = exact(system.rigid)
        unit = exact(np.eye(len(system.mass))[:, others])
        if max(_left(m, system.rigid) for m in (drags, _turned(drags), _turned(felt))) <= IMPOSED:
            share = rigid.transpose() * mass
            mass = unit.transpose() * (mass - mass * rigid * (share * rigid).inv() * share) * unit
            damping, stiffness, *turning = (part[:, others][:, :, others] for part in (damping, stiffness, *turning))
        else:
            drop = exact(np.eye(len(system.mass))[single])
            columns = unit, unit.transpose() - exact(system.rigid[others]) * (drop * rigid).inv() * drop
    plain = columns is None and np.array_equal(system.mass, system.mass.T)
    if system.following is None:
        states = [_generator(mass, exact(c), exact(k), columns) for c, k in zip(damping, stiffness, strict=True)]
        form = _form(mass, damping, stiffness) if plain else None
        return Flow(states, list(system.states), list(system.fractions), system.cycles, form)
    (g,), (h,), (square,) = turning
    no = np.zeros_like(g)
    still = _generator(mass, exact(no), exact(no), columns)
    fixed = _generator(mass, exact(g), exact(square), columns)
    terms = [
        (_generator(mass, exact(c), exact(h), columns) - still, _generator(mass, exact(no), exact(k), columns) - still)
        for c, k in zip(damping, stiffness, strict=True)
    ]
    every = np.concatenate([stiffness, h[None], square[None]])
    form = _form(mass, g[None], every) if plain and not damping.any() else None
    return Flow([fixed] * len(terms), list(system.states), list(system.fractions), system.cycles, form, terms)


def _form(mass: arb_mat, damping: Array, stiffness: Array) -> arb_mat | None:
    """Q = [[C, M], [-M, 0]], None where C is no one skew matrix or a stiffness is not symmetric."""
    if not np.array_equal(stiffness, _turned(stiffness)) or not all(np.array_equal(c, -damping[0].T) for c in damping):
        return None
    return _blocks([[exact(damping[0]), mass], [-1 * mass, 0 * mass]])


def _generator(mass: arb_mat, damping: arb_mat, stiffness: arb_mat, columns: tuple[arb_mat, arb_mat] | None) -> arb_mat:
    force, drag = -1 * mass.solve(stiffness), -1 * mass.solve(damping)
    if columns is None:
        unit = exact(np.eye(mass.nrows()))
        return _blocks([[0 * unit, unit], [force, drag]])
    unit, rates = columns
    return _blocks([[0 * (rates * unit), rates], [force * unit, drag]])


def _blocks(parts: list[list[arb_mat]]) -> arb_mat:
    lines = [zip(*(part.tolist() for part in row), strict=True) for row in parts]
    return arb_mat([[value for part in line for value in part] for row in lines for line in row])


def _turned(matrices: Array) -> Array:
    return np.swapaxes(matrices, -1, -2)


def _left(matrices: Array, rigid: Array) -> float:
    """|K r| as a part of |K| |r|, the largest of all rows, vectors and matrices; 0 where all vanish."""
    size = np.abs(matrices) @ np.abs(rigid)
    return float(np.max(np.abs(matrices @ rigid) / np.where(size > 0, size, 1.0)))


def _singled_out(rigid: Array) -> list[int]:
    """As many coordinates as there are vectors, in which these are independent: elimination with pivots."""
    rest, found = rigid.astype(float), []
    for column in range(rigid.shape[1]):
        found.append(int(np.argmax(np.abs(rest[:, column]))))
        rest = rest - np.outer(rest[:, column], rest[found[-1]] / rest[found[-1], column])
    return found
