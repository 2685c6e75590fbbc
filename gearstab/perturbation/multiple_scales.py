"""First-order instability boundaries by the method of multiple scales, for any gear system."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from gearstab.modal import mean_modes, significant_deflection
from gearstab.perturbation.damped import group_pair, single_pair, undamped
from gearstab.perturbation.tongues import ParametricExcitation, Tongues, excitations, tongue
from gearstab.system import Array, GearSystem

EQUAL_FREQUENCY = 1e-8
"""Natural frequencies that differ by less than this part count as equal. An eigensolver splits a repeated frequency by
about (n eps/2) (w_max/w)^2, which stays below 1e-8 up to w_max/w = 1e3 for n = 33; a true difference as small as this
is far below the width of any tongue that matters (and below the epsilon^2 that a first-order boundary neglects)."""

ROUNDING = 1e-13
"""Couplings and damping rates below this part of the terms they are the sum of are rounding and count as zero, so that
a tongue that vanishes exactly (an integer contact ratio, meshes that cancel) is reported with width zero."""

Group = list[int]
"""Modes (numbers from 0) of equal natural frequency."""

Weights = list[tuple[int, Array, Array]]
"""For every mesh that contributes to an excitation: its number, epsilon k_g and z exp(-2 pi i s lag), ``(rows,)``."""


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

    A group of equal frequencies has one tongue, independent of the basis chosen for its modes: the first pair of its
    modes carries it, the other members are NaN. Groups may differ from row to row.

    Parameters
    ----------
    system: with any batch of rows.
    harmonics: excitation frequencies up to this harmonic of each mesh.
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
    modal = modal_rows(system)
    if modes is None:
        modes = [int(p) + 1 for p in np.flatnonzero(np.any(modal.frequency != 0, axis=0))]
    pairs = [(p, q) for k, p in enumerate(modes) for q in modes[k:]]
    forces = (*excitations(system, harmonics), *further)
    place = {(p - 1, q - 1): k for k, (p, q) in enumerate(pairs)}
    center, width, threshold = np.full((3, len(forces), len(pairs), len(modal.frequency)), np.nan)
    for rows, groups in partitions(modal.frequency):
        part = modal.rows(rows)
        wanted = [(P, Q, place[P[0], Q[0]]) for k, P in enumerate(groups) for Q in groups[k:] if (P[0], Q[0]) in place]
        for e, force in enumerate(forces):
            ratio = float(force.ratio)
            for k, total, half, opening in _solve(part, _weights(system, force, modal.batch, rows), wanted):
                where = np.ix_(np.array([e]), np.array(k), rows)
                center[where], width[where], threshold[where] = total / ratio, half / ratio, opening
    index = tuple(tongue(system, force, p, q) for force in forces for p, q in pairs)
    full = (len(index), *modal.batch)
    center, width, threshold = (a.reshape(full) for a in (center, width, threshold))
    return Tongues(index, center, width, _boundaries(center, width, threshold), threshold)


def _boundaries(center: Array, width: Array, threshold: Array) -> Array:
    """Both ends of each tongue, NaN where it is closed by damping or has no boundary."""
    closed = (width == 0) & (threshold > 0)
    half = np.where(np.isfinite(width) & ~closed, width, np.nan)
    return np.stack([center - half, center + half], axis=1)


@dataclass(frozen=True)
class ModalQuantities:
    """Modal quantities of all rows, with the batch flattened.

    frequency ``(rows, n)``, 0 for rigid-body modes and NaN for negative stiffness, and its square, which is then
    negative; deflection ``(rows, n, meshes)``; damping ``(rows, n, n)`` = Phi^T C Phi/2, or None.
    """

    frequency: Array
    squared_frequency: Array
    deflection: Array
    damping: Array | None
    batch: tuple[int, ...]

    def rows(self, rows: Array) -> ModalQuantities:
        damping = None if self.damping is None else self.damping[rows]
        return ModalQuantities(
            self.frequency[rows], self.squared_frequency[rows], self.deflection[rows], damping, self.batch
        )


def modal_rows(system: GearSystem) -> ModalQuantities:
    """See :class:`ModalQuantities`; mesh deflections and damping rates that are rounding are exactly zero."""
    modes = mean_modes(system)
    deflection = np.where(significant_deflection(modes), modes.mesh_deflection, 0.0)
    damping = None
    if system.damping is not None:
        damping = 0.5 * np.swapaxes(modes.shapes, -1, -2) @ system.damping @ modes.shapes
        largest = np.abs(damping).max(axis=(-2, -1), keepdims=True)
        damping = system.flat(np.where(np.abs(damping) <= ROUNDING * largest, 0.0, damping), 2)
    frequency, squared = (system.flat(a, 1) for a in (modes.natural_frequency, modes.squared_frequency))
    return ModalQuantities(frequency, squared, system.flat(deflection, 2), damping, system.batch)


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


def _weights(system: GearSystem, force: ParametricExcitation, batch: tuple[int, ...], rows: Array) -> Weights:
    """Strength and phase of every mesh that contributes to an excitation."""
    weights = []
    for i, s in force.parts:
        mesh = system.meshes[i]
        a, b = mesh.waveform.fourier(s)
        wave = (np.asarray(b) - 1j * np.asarray(a)) * np.exp(-2j * np.pi * s * np.asarray(mesh.lag))
        amplitude, wave = (np.broadcast_to(v, batch).reshape(-1)[rows] for v in (mesh.amplitude, wave))
        weights.append((i, amplitude, wave))
    return weights


def _coupling(modal: ModalQuantities, weights: Weights, p: Group, q: Group) -> Array:
    """B_pq for matching lists of modes, ``(len(p), rows)``, exactly zero where only rounding is left."""
    total = np.zeros((len(p), len(modal.frequency)), dtype=complex)
    size = np.zeros(total.shape)
    for i, amplitude, wave in weights:
        delta = modal.deflection[:, :, i].T
        product = amplitude * delta[p] * delta[q]
        total += product * wave
        size += np.abs(product)
    total[np.abs(total) <= ROUNDING * size] = 0.0
    return total


def _solve(
    modal: ModalQuantities, weights: Weights, wanted: list[tuple[Group, Group, int]]
) -> Iterator[tuple[list[int], Array, Array, Array]]:
    """Yield (places, w_P + w_Q, half-width in nu, threshold) of the wanted pairs, ``(places, rows)`` each."""
    single = [(P[0], Q[0], k) for P, Q, k in wanted if len(P) == len(Q) == 1]
    if single:
        p, q, k = (list(column) for column in zip(*single, strict=True))
        yield k, *_single_pairs(modal, weights, p, q)
    for P, Q, place in wanted:
        if len(P) > 1 or len(Q) > 1:
            total, width, threshold = _group_pair(modal, weights, P, Q)
            yield [place], total[None], width[None], threshold[None]


def _single_pairs(modal: ModalQuantities, weights: Weights, p: Group, q: Group) -> tuple[Array, Array, Array]:
    """Tongues between modes of distinct frequency, all pairs at once."""
    w = modal.frequency.T
    coupling = np.abs(_coupling(modal, weights, p, q)) / np.sqrt(w[p] * w[q])
    if modal.damping is None:
        return w[p] + w[q], coupling, np.zeros_like(coupling)
    mu = np.diagonal(modal.damping, axis1=-2, axis2=-1).T
    return w[p] + w[q], *single_pair(coupling, mu[p], mu[q])


def _block(modal: ModalQuantities, weights: Weights, P: Group, Q: Group) -> Array:
    """G ``(rows, P, Q)`` of two groups."""
    w_p, w_q = modal.frequency[:, P].mean(axis=1), modal.frequency[:, Q].mean(axis=1)
    flat = _coupling(modal, weights, [p for p in P for _ in Q], [q for _ in P for q in Q])
    return (flat / np.sqrt(w_p * w_q)).T.reshape(-1, len(P), len(Q))


def block(modal: ModalQuantities, system: GearSystem, force: ParametricExcitation, P: Group, Q: Group) -> Array:
    """Return G = B[P, Q]/sqrt(w_P w_Q) of an excitation, ``(rows, P, Q)``. modal: of the same system."""
    rows = np.arange(len(modal.frequency))
    return _block(modal, _weights(system, force, modal.batch, rows), P, Q)


def group_of(modal: ModalQuantities, mode: int) -> Group:
    """Return the modes (from 0) of one row that share the frequency of a mode."""
    ((_, groups),) = partitions(modal.frequency)
    return next(group for group in groups if mode in group)


def _group_pair(modal: ModalQuantities, weights: Weights, P: Group, Q: Group) -> tuple[Array, Array, Array]:
    """The tongue of two groups of which at least one has several modes."""
    w_p, w_q = modal.frequency[:, P].mean(axis=1), modal.frequency[:, Q].mean(axis=1)
    matrix = _block(modal, weights, P, Q)
    if modal.damping is None:
        return w_p + w_q, undamped(matrix), np.zeros(len(matrix))
    blocks = (modal.damping[:, np.array(G)[:, None], G] for G in (P, Q))
    return w_p + w_q, *group_pair(matrix, *blocks)
