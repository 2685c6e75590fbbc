"""First-order amplitude equations with periodic terms that need not be symmetric: friction, mesh damping that varies.

With the harmonics B exp(i nu t) + c.c. of the modal stiffness Phi^T K(t) Phi, and D of the damping, the amplitudes of
two modes near nu = w_p + w_q + sigma follow

    A_p' = (-mu_p - i sigma/2) A_p + G conj(A_q),    G = (B_pq - i w_q D_pq) i/(2 w_p),
    conj(A_q)' = H A_p + (-mu_q + i sigma/2) conj(A_q),    conj(H) = (B_qp - i w_p D_qp) i/(2 w_q).

An eigenvalue is imaginary at the two detunings

    sigma = [Im(GH) (mu_p - mu_q) +- (mu_p + mu_q) sqrt(Im(GH)^2 + 4 mu_p mu_q Re(GH) - 4 mu_p^2 mu_q^2)]/(2 mu_p mu_q),

and there is growth between them (:func:`gearstab.perturbation.damped.product_pair`). The root is positive, and the
tongue open, where |GH| + Re(GH) > 2 mu_p mu_q. Where B is symmetric and D zero, or where p = q and both are symmetric,
GH is real and positive. In general it is not: the tongue of unequally damped modes is shifted to one side, and

* *differences* of frequencies become resonant. Near nu = w_p - w_q + sigma, w_p > w_q, the equations are the same with
  -w_q in place of w_q, and A_q in place of its conjugate. With B symmetric and D zero GH is then -|B_pq|^2/(4 w_p w_q),
  and the tongue never opens; it does, above the damping, where B_pq and B_qp have different signs or phases, or D is
  large enough. (With B antisymmetric, sums and differences exchange their parts.)
* where no mode is damped and GH is not real, or where one mode is not and GH is not real and negative, there is growth
  on both sides or on one as far as the theory reaches, and no boundary: the half-width is infinite.
* the means of the terms, small as they are, add to the damping and shift w_p by S_pp/(2 w_p). Of a group of modes of
  equal frequency they are a matrix, E = S[P, P]/(2 w_P). A mode, or a combination of modes of a group, that -D + i E
  makes grow by itself is *self-excited* at any mesh frequency; its tongues have no boundaries then.

Groups P and Q of several modes have matrices in place of the scalars, and edges at some of the detunings of
:func:`gearstab.perturbation.damped.crossings`. Derived as Lin & Parker 2002, (13)-(16).
"""

from __future__ import annotations

import numpy as np

from gearstab.perturbation.damped import crossings, group_pair, largest_rate, outermost
from gearstab.system import Array

ROUNDING = 1e-12
"""Parts of a matrix below this part of its largest entry are rounding."""
DEFECT = 1e-7
"""Relative effect of a rounding error on the eigenvalues of a matrix of two that coincide: its square root."""
LARGEST = 2.0**20
"""Factors on the coupling beyond which a tongue of groups counts as one that never opens."""
HALVINGS = 36
"""Halvings of the factor, in its logarithm: the threshold of groups has nine digits."""


def decaying(mean: Array) -> tuple[Array, Array]:
    """(whether all of a group decays, whether some of it grows by itself), ``(rows,)`` each.

    mean: -D + i E of a group, ``(rows, P, P)``.
    """
    rates = np.linalg.eigvals(mean).real.max(axis=-1)
    damping, shift = (np.abs(part).max(axis=(-2, -1)) for part in (mean.real, mean.imag))
    tiny = ROUNDING * damping + (DEFECT * shift if mean.shape[-1] > 1 else 0.0)
    return rates < -tiny, rates > tiny


def _passive(mean: Array) -> Array:
    """Whether no motion of a group gains energy, even for a moment: the Hermitian part is not positive."""
    hermitian = 0.5 * (mean + np.conj(np.swapaxes(mean, -1, -2)))
    largest = np.linalg.eigvalsh(hermitian)[:, -1]
    return np.asarray(largest <= ROUNDING * np.abs(mean).max(axis=(-2, -1)))


def groups(
    forward: Array, backward: Array, mean_p: Array, mean_q: Array, noise: Array | float = 0.0
) -> tuple[Array, Array, Array]:
    """(shift, half_width, threshold) of two groups, ``(rows,)`` each, as of :func:`damped.product_pair`.

        a' = (M_P - i sigma/2) a + G b,    b' = H a + (M_Q + i sigma/2) b.

    forward: G ``(rows, P, Q)``; backward: H ``(rows, Q, P)``; mean_p, mean_q: M_P and M_Q, the shifts that all modes of
    a group have in common left out, in the scaling in which H is the adjoint of G where the excitation is symmetric.
    noise: ``(rows,)``, what is rounding in the entries of G and H.

    Of several unstable ranges of sigma the outermost ends count. NaN where some motion of a group is not damped and the
    equations are not symmetric: then whether there is a boundary is not decided here.
    """
    shift, half, threshold = np.zeros(len(forward)), np.full(len(forward), np.nan), np.full(len(forward), np.nan)
    (damped_p, grows_p), (damped_q, grows_q) = decaying(mean_p), decaying(mean_q)
    size = np.maximum(np.abs(forward).max(axis=(-2, -1)), np.abs(backward).max(axis=(-2, -1)))
    adjoint = np.conj(np.swapaxes(forward, -1, -2))
    # Coupling in one direction only, and coupling that keeps the sum of the squared amplitudes, make nothing grow.
    still = ~forward.any(axis=(-2, -1)) | ~backward.any(axis=(-2, -1))
    keeps = np.abs(backward + adjoint).max(axis=(-2, -1)) <= ROUNDING * size + noise
    still |= keeps & _passive(mean_p) & _passive(mean_q)
    symmetric = np.abs(backward - adjoint).max(axis=(-2, -1)) <= ROUNDING * size + noise
    for mean in (mean_p, mean_q):
        symmetric &= ~mean.imag.any(axis=(-2, -1))
        odd = np.abs(mean.real - np.swapaxes(mean.real, -1, -2)).max(axis=(-2, -1))
        symmetric &= odd <= ROUNDING * np.abs(mean.real).max(axis=(-2, -1))
    if symmetric.any():
        half[symmetric], threshold[symmetric] = group_pair(
            -2j * forward[symmetric], -mean_p[symmetric].real, -mean_q[symmetric].real
        )
    left = ~symmetric
    half[left & still], threshold[left & still] = 0.0, np.inf
    grows = left & (grows_p | grows_q)
    half[grows], threshold[grows] = np.inf, 0.0
    rows = np.flatnonzero(left & ~still & damped_p & damped_q)
    if len(rows):
        problem = _Damped(mean_p[rows], mean_q[rows], forward[rows], backward[rows])
        threshold[rows] = problem.thresholds()
        half[rows] = 0.0
        open_ = threshold[rows] < 1
        if open_.any():
            lower, upper = problem.subset(open_).edges()
            shift[rows[open_]], half[rows[open_]] = 0.5 * (lower + upper), 0.5 * (upper - lower)
    return shift, half, threshold


class _Damped:
    """Two groups whose motions all decay without excitation."""

    def __init__(self, mean_p: Array, mean_q: Array, forward: Array, backward: Array) -> None:
        self.parts, self.p = (mean_p, mean_q, forward, backward), forward.shape[-2]

    def subset(self, rows: Array) -> _Damped:
        """Return the coefficients of some rows."""
        return _Damped(*(part[rows] for part in self.parts))

    def matrix(self, factor: Array) -> Array:
        """A with G and H times a factor ``(rows,)``."""
        mean_p, mean_q, forward, backward = self.parts
        times = factor[:, None, None]
        return np.block([[mean_p, times * forward], [times * backward, mean_q]])

    def unstable(self, factor: Array) -> tuple[Array, Array]:
        """(detunings ascending, one between any two neighbours where the sign of the growth may change, and one below
        and above all of those ``(rows, K)``; whether there is growth there).
        """
        matrix = self.matrix(factor)
        marks = np.sort(crossings(matrix, self.p).real, axis=-1)
        size = np.abs(matrix).max(axis=(-2, -1))
        reach = np.abs(marks).max(axis=-1) + size
        marks = np.concatenate([marks[:, :1] - reach[:, None], marks, marks[:, -1:] + reach[:, None]], axis=1)
        middles = 0.5 * (marks[:, 1:] + marks[:, :-1])
        every = np.repeat(matrix, middles.shape[1], axis=0)
        rates = largest_rate(middles.ravel(), every, self.p).reshape(middles.shape)
        return middles, rates > ROUNDING * size[:, None]

    def edges(self) -> tuple[Array, Array]:
        """The outermost detunings of growth, of rows in which there is some."""
        matrix = self.matrix(np.ones(len(self.parts[0])))
        middles, unstable = self.unstable(np.ones(len(matrix)))
        return outermost(middles.T, unstable.T, lambda sigma: largest_rate(sigma, matrix, self.p) > 0)

    def thresholds(self) -> Array:
        """The factor on G and H at which growth at some detuning begins, below 1 where there is some without a factor.

        Infinite where none up to LARGEST has any.
        """
        high = np.ones(len(self.parts[0]))
        opened = self._opens(high)
        low = np.where(opened, 1 / LARGEST, 1.0)
        while True:
            rows = ~opened & (high < LARGEST)
            if not rows.any():
                break
            high = np.where(rows, np.minimum(4 * high, LARGEST), high)
            opened[rows] = self.subset(rows)._opens(high[rows])
            low = np.where(rows & ~opened, np.maximum(low, high), low)
        result = np.full(len(low), np.inf)
        own, low, high = self.subset(opened), low[opened], high[opened]
        for _ in range(HALVINGS if opened.any() else 0):
            middle = np.sqrt(low * high)
            grows = own._opens(middle)
            low, high = np.where(grows, low, middle), np.where(grows, middle, high)
        result[opened] = high
        return result

    def _opens(self, factor: Array) -> Array:
        """Whether there is growth at some detuning."""
        return np.asarray(self.unstable(factor)[1].any(axis=1))
