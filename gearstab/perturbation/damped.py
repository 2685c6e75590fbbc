"""Width of a tongue from the first-order amplitude equations of two groups of modes, with and without damping.

Near nu = w_P + w_Q + sigma the slow amplitudes of the groups P and Q of equal natural frequencies obey, in symmetric
scaling,

    a' = (-D_P - i sigma/2) a + (i/2) G b,    b' = -(i/2) G^H a + (-D_Q + i sigma/2) b,    G = B[P, Q]/sqrt(w_P w_Q)

with D = Phi^T C Phi/2 restricted to each group (zeta_p w_p for modal damping) and b the conjugate amplitude of Q. The
matrix is H + (i sigma/2) S with H Hermitian and S = diag(-1, 1), hence:

* undamped: unstable for |sigma| < sigma_max(G), the largest singular value;
* damped: stable at every sigma if H is negative definite, which fails first at sigma = 0; the tongue opens when
  sigma_max(D_P^(-1/2) G D_Q^(-1/2)) = 2;
* one mode each, mu = zeta w: |sigma| = (mu_p + mu_q) sqrt(|G|^2/(4 mu_p mu_q) - 1). As both mu vanish this tends to
  (mu_p + mu_q)/(2 sqrt(mu_p mu_q)) |G|: unequal damping widens an open tongue beyond its undamped width |G|;
* only one of two modes damped: unstable at *every* sigma, with a growth rate that falls as sigma^-2. First-order theory
  then has no boundary; the half-width is reported as infinite;
* negative damping of one of the modes: unstable at every sigma too, infinite.

The derivation is that of Lin & Parker 2002, (13)-(16), with the viscous terms kept; |G| = epsilon sqrt(Lambda_pq).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gearstab.system import Array

ROUNDING = 1e-12
"""A damping rate or coupling below this part of the largest one of its block is rounding and counts as zero."""

BISECTIONS = 60
"""Halvings of a bracket whose ends are found exactly: enough for the last bit of a double."""


def single_pair(coupling: Array, mu_p: Array, mu_q: Array) -> tuple[Array, Array]:
    """Half-width in nu and threshold of one mode against one mode, see the module's text; all arguments ``(...)``.

    coupling: |G| >= 0. Returns (half_width, threshold); the threshold is the factor on G at which the tongue opens.
    """
    if not (mu_p.any() or mu_q.any()):
        return coupling, np.zeros_like(coupling)
    return product_pair(0.25 * coupling**2 + 0j, mu_p, mu_q)[1:]


def product_pair(product: Array, mu_p: Array, mu_q: Array) -> tuple[Array, Array, Array]:
    """(shift, half_width, threshold) of one mode against one mode whose amplitude equations are, all ``(...)``,

        a' = (-mu_p - i sigma/2) a + G b,    b' = H a + (-mu_q + i sigma/2) b.

    product: G H, complex; it is |G|^2/4 of the module's text where the excitation is symmetric. The detuning sigma
    enters the unstable range at ``shift - half_width`` and leaves it at ``shift + half_width``; threshold: the factor
    on G and H at which there is such a range. See :mod:`gearstab.perturbation.unsymmetric` for the equations.
    """
    real, imag, size, both = product.real, product.imag, np.abs(product), mu_p * mu_q
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        # |GH| + Re GH without the difference of equal numbers.
        excess = np.where(real < 0, imag**2 / (size - real), size + real)
        lean = 0.5 * imag / both
        half = (mu_p + mu_q) * np.sqrt(np.maximum(lean**2 + real / both - 1, 0.0))
        threshold = np.where(excess > 0, np.sqrt(np.maximum(2 * both, 0.0) / excess), np.inf)
        shift = lean * (mu_p - mu_q)
    damped, free = (mu_p > 0) & (mu_q > 0), (mu_p == 0) & (mu_q == 0)
    shift = np.where(damped & (half > 0), shift, 0.0)
    # Without damping of both there is growth at any detuning, on one side at least, unless GH is real.
    half = np.where(damped, half, np.where(excess > 0, np.inf, 0.0))
    half = np.where(free & (imag == 0), 2 * np.sqrt(np.maximum(real, 0.0)), half)
    threshold = np.where(free & (size == 0), 0.0, threshold)
    grows = (mu_p < 0) | (mu_q < 0)
    return shift, np.where(grows, np.inf, half), np.where(grows, 0.0, threshold)


def group_pair(coupling: Array, damping_p: Array, damping_q: Array) -> tuple[Array, Array]:
    """Half-width in nu and threshold of a group of P modes against a group of Q modes.

    coupling: G ``(rows, P, Q)``, complex; damping_p ``(rows, P, P)``, damping_q ``(rows, Q, Q)``, symmetric.
    Returns (half_width, threshold), ``(rows,)`` each; the half-width is that of the outermost boundary.
    """
    rows = coupling.shape[0]
    width, threshold = np.zeros(rows), np.zeros(rows)
    least_p, least_q = (np.linalg.eigvalsh(d)[:, 0] for d in (damping_p, damping_q))
    free = ~(damping_p.any(axis=(-2, -1)) | damping_q.any(axis=(-2, -1)))
    definite = (least_p > _tiny(damping_p)) & (least_q > _tiny(damping_q))
    if free.any():
        width[free] = undamped(coupling[free])
    if definite.any():
        width[definite], threshold[definite] = _definite(coupling[definite], damping_p[definite], damping_q[definite])
    for row in np.flatnonzero(~free & ~definite):
        width[row], threshold[row] = _semidefinite(coupling[row], damping_p[row], damping_q[row])
    return width, threshold


def undamped(coupling: Array) -> Array:
    """Half-width in nu without damping: the largest singular value of G ``(rows, P, Q)``."""
    values: Array = np.linalg.svd(coupling, compute_uv=False)
    return values[:, 0]


def _tiny(matrix: Array) -> Array:
    """Value that counts as zero compared with the entries of ``matrix``: rounding of the modal transformation."""
    return np.asarray(ROUNDING * np.abs(matrix).max(axis=(-2, -1)))


def growth(sigma: Array, coupling: Array, damping_p: Array, damping_q: Array) -> Array:
    """Largest real part of the eigenvalues of H + (i sigma/2) S, ``(rows,)``."""
    return largest_rate(sigma, _hermitian(coupling, damping_p, damping_q), coupling.shape[-2])


def largest_rate(sigma: Array, matrix: Array, p: int) -> Array:
    """Largest real part of the eigenvalues of A + (i sigma/2) S, ``(rows,)``, for any A ``(rows, n, n)``.

    p: the size of the group P, whose amplitudes come first: S = diag(-1, ..., 1, ...).
    """
    turned = matrix + 0.5j * sigma[:, None, None] * np.diag(_sides(p, matrix))
    return np.asarray(np.linalg.eigvals(turned).real.max(axis=-1))


def _sides(p: int, matrix: Array) -> Array:
    """The diagonal of S."""
    return np.where(np.arange(matrix.shape[-1]) < p, -1.0, 1.0)


def outermost(points: Array, unstable: Array, grows: Callable[[Array], Array]) -> tuple[Array, Array]:
    """Return the outermost edges of growth, ``(rows,)`` each, found from ascending detunings ``(K, rows)``.

    unstable: ``(K, rows)``, where there is growth; grows: tells it at any detunings ``(rows,)``.
    """
    each, end = np.arange(unstable.shape[1]), len(points) - 1
    first, last = np.argmax(unstable, axis=0), end - np.argmax(unstable[::-1], axis=0)
    lower = edge(points[first, each], points[np.maximum(first - 1, 0), each], grows)
    return lower, edge(points[last, each], points[np.minimum(last + 1, end), each], grows)


def edge(inside: Array, outside: Array, grows: Callable[[Array], Array]) -> Array:
    """Return where growth ends between detunings with and without it, ``(rows,)``."""
    for _ in range(BISECTIONS):
        half = 0.5 * (inside + outside)
        there = grows(half)
        inside, outside = np.where(there, half, inside), np.where(there, outside, half)
    return np.asarray(0.5 * (inside + outside))


def _hermitian(coupling: Array, damping_p: Array, damping_q: Array) -> Array:
    adjoint = np.conj(np.swapaxes(coupling, -1, -2))
    return np.block([[-damping_p, 0.5j * coupling], [-0.5j * adjoint, -damping_q]])


def _definite(coupling: Array, damping_p: Array, damping_q: Array) -> tuple[Array, Array]:
    """Both groups damped in every direction.

    Between the detunings of :func:`crossings` the sign of the growth cannot change; the outermost boundary is the
    largest of them with an unstable interval below it, and is then refined by bisection across it.
    """
    left, right = (np.swapaxes(np.linalg.inv(np.linalg.cholesky(d)), -1, -2) for d in (damping_p, damping_q))
    ratio = np.linalg.svd(np.swapaxes(left, -1, -2) @ coupling @ right, compute_uv=False)[:, 0] / 2
    with np.errstate(divide="ignore"):
        threshold = 1 / ratio
    width = np.zeros(len(coupling))
    if not (ratio > 1).any():
        return width, threshold
    parts = tuple(a[ratio > 1] for a in (coupling, damping_p, damping_q))
    # Beyond the last crossing all is stable: the sentinel makes "the interval above the last one" exist.
    # Keeping the complex ones as well only divides an interval once more; the spectrum is symmetric in sigma.
    marks = np.sort(np.abs(crossings(_hermitian(*parts), coupling.shape[-2]).real), axis=-1)
    marks = np.concatenate([np.zeros((len(marks), 1)), marks, 2 * marks[:, -1:] + 1], axis=1)
    middles = 0.5 * (marks[:, 1:] + marks[:, :-1])
    unstable = np.stack([growth(middles[:, k], *parts) > 0 for k in range(middles.shape[1])], axis=1)
    unstable[:, 0] = True
    last = unstable.shape[1] - 1 - np.argmax(unstable[:, ::-1], axis=1)
    each = np.arange(len(marks))
    low, high = middles[each, last], middles[each, np.minimum(last + 1, middles.shape[1] - 1)]
    low = np.where(last == 0, 0.0, low)
    width[ratio > 1] = edge(low, high, lambda sigma: growth(sigma, *parts) > 0)
    return width, threshold


def crossings(matrix: Array, p: int) -> Array:
    """Detunings, ``(rows, 2 P Q)`` complex, among which is every real sigma at which A + (i sigma/2) S has an imaginary
    eigenvalue, for any A ``(rows, n, n)`` whose blocks on P x P and Q x Q have eigenvalues of negative real part.

    Then A(sigma) x I + I x conj(A(sigma)) = X + (i sigma/2) Y is singular, with X = A x I + I x conj(A) and Y = S x I -
    I x S, zero on P x P and Q x Q where X is regular: eliminating those leaves an ordinary eigenproblem for sigma on
    P x Q and Q x P.
    """
    n = matrix.shape[-1]
    eye = np.eye(n)
    total = np.einsum("rij,kl->rikjl", matrix, eye) + np.einsum("ij,rkl->rikjl", eye, np.conj(matrix))
    total = total.reshape(-1, n * n, n * n)
    sides = _sides(p, matrix)
    weight = (sides[:, None] - sides[None, :]).ravel()
    mixed, same = np.flatnonzero(weight), np.flatnonzero(weight == 0)
    inner = np.linalg.solve(total[:, same[:, None], same], total[:, same[:, None], mixed])
    reduced = total[:, mixed[:, None], mixed] - total[:, mixed[:, None], same] @ inner
    return np.asarray(np.linalg.eigvals(2j * reduced / weight[mixed][:, None]))


def _semidefinite(coupling: Array, damping_p: Array, damping_q: Array) -> tuple[float, float]:
    """One row where some direction of a group is undamped (or negatively damped).

    If nothing couples undamped to damped directions, each kind forms a block of its own. Otherwise the tongue opens at
    once, and the growth of the undamped directions far from resonance, W/sigma^2, tells whether it ever ends.
    """
    (zero_p, rest_p, negative_p), (zero_q, rest_q, negative_q) = (_split(d) for d in (damping_p, damping_q))
    if negative_p or negative_q:
        return np.inf, 0.0
    across = np.concatenate([(zero_p.T @ coupling @ rest_q).ravel(), (rest_p.T @ coupling @ zero_q).ravel()])
    if np.abs(across).max(initial=0.0) > _tiny(coupling):
        adjoint = coupling.conj().T
        if max(_far_growth(coupling, damping_p, damping_q), _far_growth(adjoint, damping_q, damping_p)) >= 0:
            return np.inf, 0.0
        # The edge depends smoothly on a damping too small to matter, which makes the block definite.
        small = 1e-9 * max(np.abs(damping_p).max(), np.abs(damping_q).max())
        parts = (coupling, damping_p + small * zero_p @ zero_p.T, damping_q + small * zero_q @ zero_q.T)
        return float(_definite(*(part[None] for part in parts))[0][0]), 0.0
    widths, thresholds = [0.0], [np.inf]
    if zero_p.shape[1] and zero_q.shape[1]:
        widths.append(float(undamped((zero_p.T @ coupling @ zero_q)[None])[0]))
        thresholds.append(0.0)
    if rest_p.shape[1] and rest_q.shape[1]:
        parts = (rest_p.T @ coupling @ rest_q, rest_p.T @ damping_p @ rest_p, rest_q.T @ damping_q @ rest_q)
        width, threshold = _definite(*(part[None] for part in parts))
        widths.append(float(width[0]))
        thresholds.append(float(threshold[0]))
    return max(widths), min(thresholds)


def _far_growth(coupling: Array, damping_p: Array, damping_q: Array) -> float:
    """The largest growth, times sigma^2, of the undamped directions N of a group far from resonance; -inf without any.

    Eliminating the other group leaves a' = [-D_P + i E/sigma + G D_Q G^H/(4 sigma^2)] a, E = G G^H/4, and eliminating
    the damped directions R as well W = N^H (G D_Q G^H/4) N - E_NR D_R^-1 E_RN in the eigenbasis of E_NN.
    """
    zero, rest, _ = _split(damping_p)
    if not zero.shape[1]:
        return -np.inf
    shift = 0.25 * coupling @ coupling.conj().T
    gain = 0.25 * zero.T @ coupling @ damping_q @ coupling.conj().T @ zero
    if rest.shape[1]:
        mixed = zero.T @ shift @ rest
        gain = gain - mixed @ np.linalg.solve(rest.T @ damping_p @ rest, mixed.conj().T)
    # A little of W chooses the basis where E_NN alone leaves it open.
    weight = 1e-9 * np.abs(shift).max() / max(np.abs(gain).max(), np.finfo(float).tiny)
    basis = np.linalg.eigh(zero.T @ shift @ zero + weight * gain)[1]
    return float(np.einsum("ik,ij,jk->k", basis.conj(), gain, basis).real.max())


def _split(damping: Array) -> tuple[Array, Array, bool]:
    """Orthonormal bases of the undamped and the damped directions, and whether a direction is negatively damped."""
    values, vectors = np.linalg.eigh(damping)
    zero = np.abs(values) <= _tiny(damping)
    return vectors[:, zero], vectors[:, ~zero], bool(np.any(values[~zero] < 0))
