"""Coordinates X_i at the beginnings of the segments of a period, in those of X_1: any choice proves what it proves.

Phi D^-1 keeps J for a D that J makes self-adjoint; X_i = Phi_(i-1) ... Phi_1 D^(-f), f the share of the period gone
by, spreads the growth of V evenly over the period. Where much decays over it, slow directions drown the others: -V is
then what a Lyapunov equation makes of the unit matrix, by sweeps backwards, which they do not disturb.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import matrix_balance

Array = np.ndarray

GRADED, DOUBLINGS = 1e6, 10
"""Condition of Phi beyond which Lyapunov's equation is solved; periods, as a power of 2, of a sweep."""


def coordinates(
    propagators: Array, shares: Array, signs: Array, rate: float, start: Array, decay: Array
) -> list[Array]:
    """``(m, m)`` at the beginning of every part, from the propagators of all and their shares of the period."""
    gone = [start]
    for propagator in propagators:
        gone.append(propagator @ gone[-1])
    whole = np.linalg.solve(start, gone[-1])
    if (signs < 0).all() and np.linalg.cond(whole) > GRADED:
        return _swept(propagators, shares, decay)
    growth = whole.T @ (signs[:, None] * whole) - rate * np.diag(signs)
    inner = np.linalg.inv(np.linalg.cholesky(0.5 * (growth + growth.T)))
    values, basis = np.linalg.eigh(inner @ np.diag(signs) @ inner.T)
    # D^2 = J Phi^T J Phi = vectors diag(squared) vectors^-1.
    vectors, squared = inner.T @ basis, rate + 1 / values
    back, gone_by = np.linalg.inv(vectors), np.cumsum([0.0, *shares])
    return [gone[s] @ ((vectors * squared ** (-0.5 * gone_by[s])) @ back) for s in range(len(propagators))]


def _swept(propagators: Array, shares: Array, decay: Array) -> list[Array]:
    """X_s = P_s^(-1/2), P_s = e^(2 b f_s) F_s^T P_(s+1) F_s + f_s W, F_s of the part.

    b: half the slowest decay in a period; W: twice the decay of each coordinate, which is the slowest at least, less b.
    """
    whole = np.eye(len(decay))
    for flow in propagators:
        whole = flow @ whole
    slow = -0.5 * np.log(np.maximum(np.abs(np.linalg.eigvals(whole)).max(), np.finfo(float).tiny))
    decay = np.maximum(decay, 2 * slow)

    def swept(form: Array) -> list[Array]:
        forms = [form]
        for flow, f in zip(propagators[::-1], shares[::-1], strict=True):
            forms.append(np.exp(2 * slow * f) * flow.T @ forms[-1] @ flow + f * np.diag(2 * (decay - slow)))
        return forms[:0:-1]

    form, power = swept(np.zeros_like(whole))[0], np.exp(slow) * whole
    for _ in range(DOUBLINGS):
        form, power = form + power.T @ form @ power, power @ power
    return [np.linalg.inv(np.linalg.cholesky(0.5 * (p + p.T))).T for p in swept(form)]


REAL = 1e-12
"""Imaginary part, relative to the modulus, below which an eigenvalue is real."""
PARALLEL = 1e5
"""Condition beyond which eigenvectors are no coordinates."""
BALANCING = 5
"""Rounds of balancing the lengths of eigenvectors."""


def modal(generators: Array, share: Array) -> Array:
    """Real coordinates ``(m, m)`` of the eigenvectors of the mean of generators ``(D, m, m)``, in balance; where these
    are nearly parallel, the given coordinates in other units.
    """
    mean = np.tensordot(share, generators, 1)
    scale = matrix_balance(mean, permute=False)[1]
    values, vectors = np.linalg.eig(mean)
    pairs = values.imag > REAL * np.abs(values)
    own = pairs | (np.abs(values.imag) <= REAL * np.abs(values))
    modes = balanced(vectors[:, own], pairs[own], generators, share)
    return modes if np.linalg.cond(modes / np.diag(scale)[:, None]) < PARALLEL else scale


def balanced(vectors: Array, pairs: Array, generators: Array, share: Array) -> Array:
    """Real coordinates of eigenvectors, of such lengths that what couples two of them is alike both ways."""
    owner = np.repeat(np.arange(len(pairs)), 1 + pairs)
    first = np.searchsorted(owner, np.arange(len(pairs)))
    columns = np.empty((len(vectors), len(owner)))
    columns[:, first], columns[:, first[pairs] + 1] = vectors.real, vectors[:, pairs].imag
    try:
        inner = np.linalg.solve(columns, generators @ columns)
    except np.linalg.LinAlgError:
        return columns
    own = (owner == np.arange(len(pairs))[:, None]).astype(float)
    size = own @ np.tensordot(share, inner**2, 1) @ own.T
    np.fill_diagonal(size, 0.0)
    length, coupled = np.ones(len(pairs)), size.any(axis=0) & size.any(axis=1)
    for _ in range(BALANCING):
        into, out = length**-2 @ size, size @ length**2
        length[coupled] = np.sqrt(length[coupled]) * (out[coupled] / into[coupled]) ** 0.125
    return (columns * length[owner]).astype(np.float32).astype(float)
