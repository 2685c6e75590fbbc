"""First-order instability boundaries by the method of multiple scales, for any gear system."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gearstab.modal import mean_modes, significant_deflection
from gearstab.perturbation.damped import group_pair, product_pair, single_pair
from gearstab.perturbation.tongues import (
    ModalTerms,
    ParametricExcitation,
    Tongue,
    Tongues,
    excitations,
    modal_terms,
    self_excited,
    tongue,
)
from gearstab.perturbation.tongues import harmonics as harmonics_of_terms
from gearstab.perturbation.unsymmetric import decaying
from gearstab.perturbation.unsymmetric import groups as unsymmetric_groups
from gearstab.perturbation.whirling import whirling_rows
from gearstab.system import Array, GearSystem, whirls

EQUAL_FREQUENCY = 1e-8
"""Natural frequencies that differ by less than this part count as equal. An eigensolver splits a repeated frequency by
about (n eps/2) (w_max/w)^2, which stays below 1e-8 up to w_max/w = 1e3 for n = 33; a true difference as small as this
is far below the width of any tongue that matters (and below the epsilon^2 that a first-order boundary neglects)."""

ROUNDING = 1e-12
"""Couplings and damping rates below this part of the terms they are the sum of are rounding and count as zero, so that
a tongue that vanishes exactly (an integer contact ratio, meshes that cancel) is reported with width zero. Of planets in
sequence more than 1e-13 is left, as much as the processor rounds."""

Group = list[int]
"""Modes (numbers from 0) of equal natural frequency."""


@dataclass(frozen=True)
class Exciter:
    """A mesh or a term that contributes to an excitation: its part in B_pq is size left_p right_q wave.

    left, right: ``(n, rows)``; size: ``(rows,)``, epsilon k_g of a mesh; wave: ``(rows,)``, z exp(-2 pi i s lag).
    drag: ``(rows,)``, takes the place of ``wave`` in D_pq; None of a mesh.
    """

    left: Array
    right: Array
    size: Array
    wave: Array
    drag: Array | None = None


Tried = tuple[Group, Group, bool, int]
"""Two groups P and Q, whether their difference is meant, and the place of their tongue."""

Found = tuple[Array, Array, Array, Array]
"""Root, shift of the middle from it, half-width in nu and threshold, ``(places, rows)`` each."""


def first_order(
    system: GearSystem, harmonics: int, modes: Sequence[int] | None = None, further: Sequence[ParametricExcitation] = ()
) -> Tongues:
    """First-order boundaries of all instability regions.

    With z_i^(s) = (b_i^(s) - i a_i^(s)) exp(-2 pi i s lag_i), the mesh harmonics that share a frequency nu add up to

        B_pq(nu) = sum_(i, s: s r_i Omega = nu) epsilon_i k_gi delta_ip delta_iq z_i^(s)

    and for groups P, Q of equal natural frequencies, nu is unstable near w_P + w_Q for

        |nu - (w_P + w_Q)| < sigma_max(B[P, Q])/sqrt(w_P w_Q)

    without damping; with damping the amplitude equations of :mod:`gearstab.perturbation.damped` are solved, with
    D = Phi^T C Phi/2 between modes of one group (its other entries have no effect in first order).

    Periodic terms add their harmonics and means; those of :mod:`gearstab.perturbation.unsymmetric` are then the
    amplitude equations, and differences of natural frequencies follow in the list after the sums, of every excitation,
    and at its end modes that grow by themselves.

    With matrices that act with a speed of rotation, or damping that is not symmetric, motions are no real modes, and
    :mod:`gearstab.perturbation.whirling` takes their place: modes are numbered by ascending frequency at the root
    of each tongue, which are damped frequencies, and no damping is taken as small.

    A group of equal frequencies has one tongue, independent of the basis chosen for its modes: the first pair of its
    modes carries it, the other members are NaN. Groups may differ from row to row.

    Parameters
    ----------
    system: with any batch of rows.
    harmonics: excitation frequencies up to this harmonic of each mesh and term.
    modes: numbers (from 1) of the modes to pair; default all that are not rigid-body modes in at least one row. Give
        them where several blocks of rows must have one list of tongues.
    further: excitation frequencies to add to those.

    Returns
    -------
    Tongues, with arrays of shape ``(tongue, *system.batch)``; see there for damped, closed and absent tongues.
    Errors of the boundaries are of second order in epsilon, and of first order where tongues overlap.

    Source: Lin & Parker 2002, (13)-(18), (26), (27), (30), (31); Parker 2009, (21)-(23), in the form that adds shared
    frequencies and does not depend on the basis of repeated modes.
    """
    if whirls(system):
        return _whirling(system, (*excitations(system, harmonics), *further), modes)
    modal = modal_rows(system)
    if modes is None:
        modes = [int(p) + 1 for p in np.flatnonzero(np.any(modal.frequency != 0, axis=0))]
    pairs = [(p, q, False) for k, p in enumerate(modes) for q in modes[k:]]
    pairs += [(p, q, True) for p, q, _ in pairs if p != q] if modal.unsymmetric else []
    forces = (*excitations(system, harmonics), *further)
    place = {(p - 1, q - 1, difference): k for k, (p, q, difference) in enumerate(pairs)}
    center, middle, width, threshold = np.full((4, len(forces), len(pairs), len(modal.frequency)), np.nan)
    growing = np.zeros((system.size, len(modal.frequency)), dtype=bool)
    for rows, groups in partitions(modal.frequency):
        part = modal.rows(rows)
        wanted = [
            (P, Q, difference, place[P[0], Q[0], difference])
            for k, P in enumerate(groups)
            for Q in groups[k:]
            for difference in (False, True)
            if (P[0], Q[0], difference) in place
        ]
        for e, force in enumerate(forces):
            ratio = float(force.ratio)
            for k, root, shift, half, opening in _solve(part, _exciters(system, force, part, rows), wanted):
                where = np.ix_(np.array([e]), np.array(k), rows)
                center[where], middle[where] = root / ratio, (root + shift) / ratio
                width[where], threshold[where] = half / ratio, opening
        if part.unsymmetric:
            for P in groups:
                group = np.array([P])
                growing[P[0], rows] = decaying(_mean(part, group, _middle(part, group))[0][0])[1]
    index = [tongue(system, force, p, q, difference) for force in forces for p, q, difference in pairs]
    found = (a.reshape(-1, len(modal.frequency)) for a in (center, middle, width, threshold))
    return _gathered(system, index, np.stack(list(found)), {p: growing[p - 1] for p in modes if growing[p - 1].any()})


def _gathered(system: GearSystem, index: list[Tongue], found: Array, growing: dict[int, Array]) -> Tongues:
    """Tongues from (root, middle, half-width, threshold) ``(4, tongues, rows)``, and those of modes that grow alone.

    growing: in which rows ``(rows,)``, by the number of the mode.
    """
    grows = np.array(list(growing.values()), dtype=bool).reshape(len(growing), found.shape[2])
    nowhere = np.full(grows.shape, np.nan)
    alone = [nowhere, nowhere, np.where(grows, np.inf, 0.0), np.where(grows, 0.0, np.inf)]
    center, middle, width, threshold = np.concatenate([found, alone], axis=1)
    ends = _boundaries(middle, width, threshold)
    whole = (a.reshape(*a.shape[:-1], *system.batch) for a in (center, width, ends, threshold))
    return Tongues((*index, *(self_excited(system, p) for p in growing)), *whole)


def _whirling(
    system: GearSystem, forces: Sequence[ParametricExcitation], modes: Sequence[int] | None = None
) -> Tongues:
    """:func:`first_order` of motions that are no real modes."""
    modes = range(1, system.size + 1) if modes is None else modes
    pairs = [(p, q, False) for k, p in enumerate(modes) for q in modes[k:]]
    pairs += [(p, q, True) for p, q, _ in pairs if p != q]
    wanted = [(force, p, q, difference) for force in forces for p, q, difference in pairs]
    rows = [row.tongues(wanted) for row in whirling_rows(system)]
    oscillates, grows = (np.stack([getattr(row, name) for row in rows], axis=1) for name in ("oscillates", "grows"))
    some = np.asarray(oscillates.any(axis=1))
    kept = [k for k, (_, p, q, _) in enumerate(wanted) if some[p - 1] and some[q - 1]]
    names = ("root", "middle", "half_width", "threshold")
    found = np.stack([np.stack([getattr(row, name)[kept] for row in rows], axis=1) for name in names])
    index = [tongue(system, *wanted[k]) for k in kept]
    return _gathered(system, index, found, {p: grows[p - 1] for p in modes if grows[p - 1].any()})


def _boundaries(center: Array, width: Array, threshold: Array) -> Array:
    """Both ends of each tongue, NaN where it is closed by damping or has no boundary."""
    closed = (width == 0) & (threshold > 0)
    half = np.where(np.isfinite(width) & ~closed, width, np.nan)
    return np.stack([center - half, center + half], axis=1)


@dataclass(frozen=True)
class ModalQuantities:
    """Modal quantities of all rows, with the batch flattened.

    frequency ``(rows, n)``, 0 for rigid-body modes and NaN for negative stiffness, and its square, which is then
    negative; deflection ``(rows, n, meshes)``; damping ``(rows, n, n)`` = Phi^T C Phi/2, means of terms included.
    """

    frequency: Array
    squared_frequency: Array
    deflection: Array
    damping: Array
    batch: tuple[int, ...]
    terms: ModalTerms

    @property
    def unsymmetric(self) -> bool:
        """Whether the amplitude equations are those of :mod:`gearstab.perturbation.unsymmetric`."""
        return self.terms.left.shape[-1] > 0

    def rows(self, rows: Array) -> ModalQuantities:
        arrays = ("frequency", "squared_frequency", "deflection", "damping")
        return replace(self, terms=self.terms.chosen(rows), **{name: getattr(self, name)[rows] for name in arrays})


def modal_rows(system: GearSystem) -> ModalQuantities:
    """See :class:`ModalQuantities`; mesh deflections and damping rates that are rounding are exactly zero."""
    modes = mean_modes(system)
    deflection = np.where(significant_deflection(modes), modes.mesh_deflection, 0.0)
    terms = modal_terms(system, modes)
    modal = 0.5 * np.swapaxes(modes.shapes, -1, -2) @ system.damping_matrix @ modes.shapes
    damping = 0.5 * terms.damping + system.flat(modal, 2)
    largest = np.abs(damping).max(axis=(-2, -1), keepdims=True)
    damping = np.where(np.abs(damping) <= ROUNDING * largest, 0.0, damping)
    frequency, squared = (system.flat(a, 1) for a in (modes.natural_frequency, modes.squared_frequency))
    return ModalQuantities(frequency, squared, system.flat(deflection, 2), damping, system.batch, terms)


def partitions(frequency: Array) -> Iterator[tuple[Array, list[Group]]]:
    """Groups of equal natural frequency.

    frequency: ``(rows, n)``, ascending; 0 for rigid-body modes and NaN for negative stiffness, which are in no group.
    Yields pairs (rows, groups) of all rows with the same groups; modes are counted from 0.
    """
    rows, n = frequency.shape
    usable = frequency > 0
    joined = np.zeros((rows, n), dtype=bool)
    gap = np.diff(frequency, axis=-1)
    joined[:, 1:] = usable[:, 1:] & usable[:, :-1] & (gap <= EQUAL_FREQUENCY * frequency[:, 1:])
    patterns = np.concatenate([usable, joined], axis=1)
    if rows and (patterns == patterns[0]).all():
        yield np.arange(rows), _groups_of(patterns[0])
        return
    distinct, member = np.unique(patterns, axis=0, return_inverse=True)
    for k, pattern in enumerate(distinct):
        yield np.flatnonzero(member.ravel() == k), _groups_of(pattern)


def _groups_of(pattern: Array) -> list[Group]:
    usable, joined = np.split(pattern, 2)
    groups: list[Group] = []
    for p in np.flatnonzero(usable):
        if joined[p]:
            groups[-1].append(int(p))
        else:
            groups.append([int(p)])
    return groups


def _exciters(system: GearSystem, force: ParametricExcitation, modal: ModalQuantities, rows: Array) -> list[Exciter]:
    """Everything that contributes to an excitation. modal: of these rows."""
    found = []
    for i, s in force.parts:
        mesh = system.meshes[i]
        a, b = mesh.waveform.fourier(s)
        wave = (np.asarray(b) - 1j * np.asarray(a)) * np.exp(-2j * np.pi * s * np.asarray(mesh.lag))
        amplitude, wave = (np.broadcast_to(v, modal.batch).reshape(-1)[rows] for v in (mesh.amplitude, wave))
        delta = modal.deflection[:, :, i].T
        found.append(Exciter(delta, delta, amplitude, wave))
    for j, wave, drag in harmonics_of_terms(system, force.ratio, rows):
        ends = (modal.terms.left[:, :, j].T, modal.terms.right[:, :, j].T)
        found.append(Exciter(*ends, np.ones(len(rows)), wave, drag))
    return found


def _coupling(
    modal: ModalQuantities, exciters: list[Exciter], p: Array, q: Array, velocity: Array | None = None
) -> tuple[Array, Array]:
    """B_pq - i w_q D_pq of modes p and q, exactly zero where only rounding is left, and the sum of the sizes of its
    parts, ``(*shape, rows)`` each.

    p, q: arrays that fit one another in ``shape``. velocity: w_q ``(*shape, rows)``, negative where mode q stands with
    its difference; None where D is zero.
    """
    total = np.zeros((*np.broadcast_shapes(p.shape, q.shape), len(modal.frequency)), dtype=complex)
    size = np.zeros(total.shape)
    for own in exciters:
        product = own.size * own.left[p] * own.right[q]
        if own.drag is None or velocity is None:
            total += product * own.wave
            size += np.abs(product)
        else:
            total += product * (own.wave - 1j * velocity * own.drag)
            size += np.abs(product) * (np.abs(own.wave) + np.abs(velocity * own.drag))
    total[np.abs(total) <= ROUNDING * size] = 0.0
    return total, size


def _solve(
    modal: ModalQuantities, exciters: list[Exciter], wanted: list[Tried]
) -> Iterator[tuple[list[int], Array, Array, Array, Array]]:
    """Yield places and what is found there, of all pairs of groups of the same sizes at once."""
    for shape in dict.fromkeys((len(P), len(Q), difference) for P, Q, difference, _ in wanted):
        alike = [one for one in wanted if (len(one[0]), len(one[1]), one[2]) == shape]
        P, Q, _, places = zip(*alike, strict=True)
        p, q, difference = np.array(P), np.array(Q), shape[2]
        single = shape[:2] == (1, 1)
        if not modal.unsymmetric:
            found = _single_pairs(modal, exciters, p[:, 0], q[:, 0]) if single else _group_pairs(modal, exciters, p, q)
        elif single:
            found = _unsymmetric_pairs(modal, exciters, p[:, 0], q[:, 0], difference)
        else:
            found = _unsymmetric_groups(modal, exciters, p, q, difference)
        yield list(places), *found


def _single_pairs(modal: ModalQuantities, exciters: list[Exciter], p: Array, q: Array) -> Found:
    """Tongues between modes of distinct frequency, all pairs at once."""
    w = modal.frequency.T
    coupling = np.abs(_coupling(modal, exciters, p, q)[0]) / np.sqrt(w[p] * w[q])
    mu = np.diagonal(modal.damping, axis1=-2, axis2=-1).T
    return w[p] + w[q], np.zeros_like(coupling), *single_pair(coupling, mu[p], mu[q])


def _unsymmetric_pairs(modal: ModalQuantities, exciters: list[Exciter], p: Array, q: Array, difference: bool) -> Found:
    """The same with periodic terms, at sums or at differences of frequencies: w_q - w_p is that with -w_p for w_p."""
    w, one = modal.frequency.T, (q, p) if difference else (p, q)
    own, other = w[one[0]], -w[one[1]] if difference else w[one[1]]
    there, size = _coupling(modal, exciters, *one, other)
    back, size_back = _coupling(modal, exciters, *one[::-1], own)
    product = 0.25 * there * np.conj(back) / (own * other)
    # Of parts that cancel more than the last digits are rounding.
    noise = ROUNDING * (np.abs(there) * size_back + np.abs(back) * size) / np.abs(4 * own * other)
    product = np.where(np.abs(product.imag) <= noise, product.real, product)
    mu, mean = (np.diagonal(a, axis1=-2, axis2=-1).T for a in (modal.damping, modal.terms.stiffness))
    shift, half, threshold = product_pair(product, mu[one[0]], mu[one[1]])
    if difference:
        threshold = np.where(product == 0, np.where(np.isinf(half), threshold, np.inf), threshold)
    return own + other, shift + 0.5 * (mean[one[0]] / own + mean[one[1]] / other), half, threshold


def _blocks(
    modal: ModalQuantities, exciters: list[Exciter], P: Array, Q: Array, velocity: Array | None = None
) -> tuple[Array, Array]:
    """B[P, Q] of pairs of groups and the sizes of its parts ``(pairs, rows, p, q)``, see :func:`_coupling`.

    P ``(pairs, p)``, Q ``(pairs, q)``; velocity: ``(pairs, rows)``.
    """
    apart = None if velocity is None else velocity[:, None, None]
    total, size = _coupling(modal, exciters, P[:, :, None], Q[:, None, :], apart)
    return np.moveaxis(total, -1, 1), np.moveaxis(size, -1, 1)


def _middle(modal: ModalQuantities, groups: Array) -> Array:
    """The natural frequency of each group ``(pairs, rows)``; groups: ``(pairs, members)``."""
    return np.asarray(modal.frequency[:, groups].mean(axis=-1).T)


def _within(matrix: Array, groups: Array) -> Array:
    """The blocks ``(pairs, rows, p, p)`` of a matrix of all modes ``(rows, n, n)`` between the modes of each group."""
    return np.moveaxis(matrix[:, groups[:, :, None], groups[:, None, :]], 0, 1)


def block(modal: ModalQuantities, system: GearSystem, force: ParametricExcitation, P: Group, Q: Group) -> Array:
    """Return G = B[P, Q]/sqrt(w_P w_Q) of an excitation by meshes, ``(rows, P, Q)``. modal: of the same system."""
    exciters = _exciters(replace(system, terms=()), force, modal, np.arange(len(modal.frequency)))
    return _symmetric(modal, exciters, np.array([P]), np.array([Q]))[0]


def _symmetric(modal: ModalQuantities, exciters: list[Exciter], P: Array, Q: Array) -> Array:
    """G = B[P, Q]/sqrt(w_P w_Q) of pairs of groups, ``(pairs, rows, p, q)``."""
    scale = np.sqrt(_middle(modal, P) * _middle(modal, Q))
    return np.asarray(_blocks(modal, exciters, P, Q)[0] / scale[..., None, None])


def group_of(modal: ModalQuantities, mode: int) -> Group:
    """Return the modes (from 0) of one row that share the frequency of a mode."""
    ((_, groups),) = partitions(modal.frequency)
    return next(group for group in groups if mode in group)


def _group_pairs(modal: ModalQuantities, exciters: list[Exciter], P: Array, Q: Array) -> Found:
    """The tongues of pairs of groups of the same sizes, of which at least one has several modes."""
    root, coupling = _middle(modal, P) + _middle(modal, Q), _symmetric(modal, exciters, P, Q)
    flat = coupling.reshape(-1, *coupling.shape[2:])
    blocks = (_within(modal.damping, G).reshape(-1, *2 * G.shape[1:]) for G in (P, Q))
    half, threshold = (a.reshape(root.shape) for a in group_pair(flat, *blocks))
    return root, np.zeros(root.shape), half, threshold


def _unsymmetric_groups(modal: ModalQuantities, exciters: list[Exciter], P: Array, Q: Array, difference: bool) -> Found:
    """The same with periodic terms, at sums or differences of frequencies."""
    sign = -1.0 if difference else 1.0
    P, Q = (Q, P) if difference else (P, Q)
    own, other = _middle(modal, P), _middle(modal, Q)
    # In the scaling in which amplitudes are actions, G is the adjoint of H where the excitation is symmetric.
    scale = np.sqrt(own * other)[..., None, None]
    there, size = _blocks(modal, exciters, P, Q, sign * other)
    back, size_back = _blocks(modal, exciters, Q, P, own)
    noise = ROUNDING * np.maximum(size.max(axis=(-2, -1)), size_back.max(axis=(-2, -1))) / scale[..., 0, 0]
    (mean_p, shift_p), (mean_q, shift_q) = _mean(modal, P, own), _mean(modal, Q, -sign * other)
    parts = (there * 0.5j / scale, np.conj(back * 0.5j / (sign * scale)), mean_p, mean_q, noise)
    found = unsymmetric_groups(*(a.reshape(-1, *a.shape[2:]) for a in parts))
    shift, half, threshold = (a.reshape(own.shape) for a in found)
    if difference:
        threshold = np.where(~there.any(axis=(-2, -1)) & np.isfinite(half), np.inf, threshold)
    return own + sign * other, shift + shift_p - shift_q, half, threshold


def _mean(modal: ModalQuantities, groups: Array, frequency: Array) -> tuple[Array, Array]:
    """(-D + i E without the part of E that all modes have in common ``(pairs, rows, p, p)``, that part ``(pairs,
    rows)``).

    E = S[P, P]/(2 w_P). groups: ``(pairs, p)``; frequency: w_P ``(pairs, rows)``, negative for conjugate amplitudes.
    """
    moved = _within(modal.terms.stiffness, groups) / (2 * frequency[..., None, None])
    common = np.trace(moved, axis1=-2, axis2=-1) / groups.shape[1]
    own = moved - common[..., None, None] * np.eye(groups.shape[1])
    largest = np.abs(moved).max(axis=(-2, -1), keepdims=True)
    return -_within(modal.damping, groups) + 1j * np.where(np.abs(own) <= ROUNDING * largest, 0.0, own), common
