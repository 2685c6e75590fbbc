"""First-order instability boundaries by the method of multiple scales, for any gear system."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from gearstab.modal import mean_modes
from gearstab.perturbation.damped import group_pair, single_pair
from gearstab.perturbation.tongues import Excitation, Tongues, excitations, tongue
from gearstab.system import Array, GearSystem

EQUAL_FREQUENCY = 1e-8
"""Natural frequencies that differ by less than this part count as equal. An eigensolver splits a repeated frequency by about
(n eps/2) (w_max/w)^2, which stays below 1e-8 up to w_max/w = 1e3 for n = 33; a true difference as small as this is far below
the width of any tongue that matters (and below the epsilon^2 that a first-order boundary neglects)."""

ROUNDING = 1e-13
"""Modal quantities below this part of their natural scale are rounding and count as zero, so that a tongue which vanishes
exactly (an integer contact ratio, a mode without mesh deflection) is reported with width zero."""


def first_order(system: GearSystem, harmonics: int, modes: Sequence[int] | None = None) -> Tongues:
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
    modes: numbers (from 1) of the modes to pair; default all that are not rigid-body modes in at least one row. Give them where
        several blocks of rows must have one list of tongues.

    Returns
    -------
    Tongues, with arrays of shape ``(tongue, *system.batch)``; see there for damped, closed and absent tongues.
    Errors of the boundaries are of second order in epsilon, and of first order where tongues overlap.

    Source: Lin & Parker 2002, (13)-(18), (26), (27), (30), (31); Parker 2009, (21)-(23), in the form that adds shared
    frequencies and does not depend on the basis of repeated modes.
    """
    modal = _modal(system)
    if modes is None:
        modes = [int(p) + 1 for p in np.flatnonzero(np.any(modal.frequency != 0, axis=0))]
    pairs = [(p, q) for k, p in enumerate(modes) for q in modes[k:]]
    forces = excitations(system, harmonics)
    index = tuple(tongue(system, force, p, q) for force in forces for p, q in pairs)
    shape = (len(forces), len(pairs), len(modal.frequency))
    center, width, threshold = (np.full(shape, np.nan) for _ in range(3))
    place = {(p - 1, q - 1): k for k, (p, q) in enumerate(pairs)}
    for rows, groups in _partitions(modal.frequency):
        part = modal.rows(rows)
        wanted = [(P, Q, place[P[0], Q[0]]) for k, P in enumerate(groups) for Q in groups[k:] if (P[0], Q[0]) in place]
        for e, force in enumerate(forces):
            weights = _weights(system, force, modal.batch, rows)
            _singles(part, weights, force, wanted, rows, center[e], width[e], threshold[e])
            _groups(part, weights, force, wanted, rows, center[e], width[e], threshold[e])
    full = (len(index), *modal.batch)
    return _tongues(index, *(a.reshape(full) for a in (center, width, threshold)), damped=modal.damping is not None)


@dataclass(frozen=True)
class _Modal:
    """Modal quantities of all rows, flattened: frequency (rows, n), 0 for rigid-body modes; deflection (rows, n, meshes);
    damping (rows, n, n) = Phi^T C Phi/2 or None."""

    frequency: Array
    deflection: Array
    damping: Array | None
    batch: tuple[int, ...]

    def rows(self, rows: Array | slice) -> _Modal:
        damping = None if self.damping is None else self.damping[rows]
        return _Modal(self.frequency[rows], self.deflection[rows], damping, self.batch)


def _modal(system: GearSystem) -> _Modal:
    modes = mean_modes(system)
    batch, n = system.batch, system.size

    def flat(values: Array, core: int) -> Array:
        tail = values.shape[values.ndim - core :]
        return np.broadcast_to(values, (*batch, *tail)).reshape(-1, *tail)

    deflection = modes.mesh_deflection
    # sum_p delta_ip^2 = g_i^T M^-1 g_i is the natural scale of a modal mesh deflection.
    scale = np.sqrt(np.sum(deflection**2, axis=-2, keepdims=True))
    deflection = np.where(np.abs(deflection) <= ROUNDING * scale, 0.0, deflection)
    damping = None
    if system.damping is not None:
        damping = 0.5 * np.swapaxes(modes.shapes, -1, -2) @ system.damping @ modes.shapes
        largest = np.abs(damping).max(axis=(-2, -1), keepdims=True)
        damping = flat(np.where(np.abs(damping) <= ROUNDING * largest, 0.0, damping), 2)
    frequency = flat(modes.natural_frequency, 1).reshape(-1, n)
    return _Modal(frequency, flat(deflection, 2), damping, batch)


def _partitions(frequency: Array) -> Iterator[tuple[Array | slice, list[list[int]]]]:
    """Rows with the same groups of equal frequencies: pairs (rows, groups), rigid and negative-stiffness modes left out."""
    rows, n = frequency.shape
    usable = frequency > 0
    joined = np.zeros((rows, n), dtype=bool)
    gap = np.diff(frequency, axis=-1)
    joined[:, 1:] = usable[:, 1:] & usable[:, :-1] & (gap <= EQUAL_FREQUENCY * frequency[:, 1:])
    patterns = np.concatenate([usable, joined], axis=1)
    if rows and (patterns == patterns[0]).all():
        yield slice(None), _groups_of(patterns[0])
        return
    distinct, member = np.unique(patterns, axis=0, return_inverse=True)
    for k, pattern in enumerate(distinct):
        yield np.flatnonzero(member.ravel() == k), _groups_of(pattern)


def _groups_of(pattern: Array) -> list[list[int]]:
    usable, joined = np.split(pattern, 2)
    groups: list[list[int]] = []
    for p in np.flatnonzero(usable):
        if joined[p]:
            groups[-1].append(int(p))
        else:
            groups.append([int(p)])
    return groups


def _weights(system: GearSystem, force: Excitation, batch: tuple[int, ...], rows: Array | slice) -> list[tuple[int, Array, Array]]:
    """For every contributing mesh (i, epsilon k_g, z e^(-2 pi i s lag)), with ``(rows,)`` each."""
    weights = []
    for i, s in force.parts:
        mesh = system.meshes[i]
        a, b = mesh.waveform.fourier(s)
        wave = (np.asarray(b) - 1j * np.asarray(a)) * np.exp(-2j * np.pi * s * np.asarray(mesh.lag))
        amplitude, wave = (np.broadcast_to(v, batch).reshape(-1)[rows] for v in (mesh.amplitude, wave))
        weights.append((i, amplitude, wave))
    return weights


def _coupling(modal: _Modal, weights: list[tuple[int, Array, Array]], p: list[int], q: list[int]) -> Array:
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


Wanted = list[tuple[list[int], list[int], int]]


def _singles(
    modal: _Modal,
    weights: list[tuple[int, Array, Array]],
    force: Excitation,
    wanted: Wanted,
    rows: Array | slice,
    center: Array,
    width: Array,
    threshold: Array,
) -> None:
    """Fill in the tongues between modes of distinct frequency, all pairs at once."""
    chosen = [(P[0], Q[0], k) for P, Q, k in wanted if len(P) == len(Q) == 1]
    if not chosen:
        return
    p, q, k = (list(column) for column in zip(*chosen, strict=True))
    w = modal.frequency.T
    coupling = np.abs(_coupling(modal, weights, p, q)) / np.sqrt(w[p] * w[q])
    if modal.damping is None:
        half, opening = coupling, np.where(coupling > 0, 0.0, np.inf)
    else:
        mu = np.diagonal(modal.damping, axis1=-2, axis2=-1).T
        half, opening = single_pair(coupling, mu[p], mu[q])
    _store(rows, k, force, w[p] + w[q], half, opening, center, width, threshold)


def _groups(
    modal: _Modal,
    weights: list[tuple[int, Array, Array]],
    force: Excitation,
    wanted: Wanted,
    rows: Array | slice,
    center: Array,
    width: Array,
    threshold: Array,
) -> None:
    """Fill in the tongues where a group of equal frequencies takes part."""
    for P, Q, k in wanted:
        if len(P) == len(Q) == 1:
            continue
        w_p, w_q = modal.frequency[:, P].mean(axis=1), modal.frequency[:, Q].mean(axis=1)
        flat = _coupling(modal, weights, [p for p in P for _ in Q], [q for _ in P for q in Q])
        matrix = (flat / np.sqrt(w_p * w_q)).T.reshape(-1, len(P), len(Q))
        blocks = [np.zeros((len(matrix), len(G), len(G))) for G in (P, Q)]
        if modal.damping is not None:
            blocks = [modal.damping[:, np.array(G)[:, None], G] for G in (P, Q)]
        half, opening = group_pair(matrix, *blocks)
        _store(rows, [k], force, (w_p + w_q)[None], half[None], opening[None], center, width, threshold)


def _store(
    rows: Array | slice,
    pairs: list[int],
    force: Excitation,
    total: Array,
    half: Array,
    opening: Array,
    center: Array,
    width: Array,
    threshold: Array,
) -> None:
    """From nu to Omega = nu/ratio, into the rows and pairs of one excitation."""
    where = (pairs, slice(None)) if isinstance(rows, slice) else np.ix_(pairs, rows)
    center[where], width[where], threshold[where] = total / float(force.ratio), half / float(force.ratio), opening


def _tongues(index: tuple, center: Array, width: Array, threshold: Array, damped: bool) -> Tongues:
    finite = np.where(np.isfinite(width), width, np.nan)
    if damped:
        finite = np.where((finite > 0) | (threshold == 0), finite, np.nan)
    boundary = np.stack([center - finite, center + finite], axis=1)
    return Tongues(index, center, width, boundary, threshold)
