"""Lyapunov functions that come with a radius: a proof that no multiplier crosses the unit circle near a mesh frequency.

Theorem. Let a period consist of segments x' = A_i x of length h_i, F_i = exp(A_i h_i), and let all lengths be stretched
alike by 1 + eta, as they are when Omega falls to Omega/(1 + eta). Let symmetric P_0, ..., P_S = P_0 be given, Y_i =
F_i^T P_(i+1) F_i, Q_i = P_i - Y_i, and E_i(X) = h_i (X A_i + A_i^T X). If for all i

    Q_i > eta' E_i(X)    for X = P_i and X = Y_i,

at eta' = eta and at 0, then M(eta)^T P_0 M(eta) < P_0 for the monodromy matrix M of all stretchings between 0 and eta.

Proof. Stretched, a segment is F_i exp(eta h_i A_i). Along z' = h_i A_i z, 0 <= s <= eta, let V(s) = z^T X(s) z with
X(s) = P_i - (s/eta) Q_i, from P_i to Y_i. V' = z^T (E_i(X(s)) - Q_i/eta) z is negative for eta > 0, as X(s) lies
between P_i and Y_i and E_i is linear (for eta < 0 likewise, s running down). Hence z^T exp(..)^T Y_i exp(..) z < z^T
P_i z, segment by segment. The conditions are linear in eta: what holds at 0 and at eta holds between.

M^T P M < P allows no multiplier on the unit circle (M v = lambda v, |lambda| = 1 would give v^H P v < v^H P v), so that
the number of multipliers outside is the same for all these mesh frequencies: none, if it is none at one of them. P is
positive definite then; where k multipliers are outside it has k negative eigenvalues, and the theorem proves that the
whole stretch is *unstable*.

How P is found. The loss Q is chosen, q_i = |h_i| Theta + (exp(2 beta h_i) - 1) Y_i with the rate Theta at which damping
takes action (:mod:`~gearstab.floquet.kernel.chain`) and, where all multipliers are inside, a part beta of the growth
rate, which keeps P small where one of them is near the circle. This is M'^T P_0 M' - P_0 = -D with M' = exp(beta T) M,
solved by doubling, P = sum (M'^T)^k D M'^k, or, where multipliers are outside, as a linear system.

In floating point. What is tested is the matrices as they are computed: a step from P_(i+1) to Y_i, and Q_i = P_i - Y_i
with the P_i that the next step really starts from, P_0 = P_S included. Only the rounding errors of one segment at a
time are not covered by that; ``rounding`` times the largest entry of P is subtracted from Q for them. This is no
interval arithmetic.

Where A_i changes with the mesh frequency, as speeds of rotation W follow it, F_i(eta) = exp(Z(eta)) with Z = h_i (1 +
eta) A_i(W/(1 + eta)), and h_i A_i gives way to

    G_i = F_i^-1 dF_i/deta = int_0^1 exp(-u Z) Z' exp(u Z) du,    Z' = h_i (A_i - D_i),    D_i = dA_i/d ln Omega:

the proof is the same, with V running from s = eta down to 0, but for the dependence of G_i on eta. With d_u = exp(-u Z)
h_i D_i exp(u Z), which in real modal coordinates is about as large as h_i D_i, and d its mean over u,

    dG_i/deta = (Z'' transported) + 2 d - d_0 - d_1 + O(|d|^2);

what bounds it, times the largest radius, is taken from Q_i too.

The radius grows with damping, to about one damping ratio at epsilon = 0.3, and falls with the distance to an edge.
"""

from __future__ import annotations

import numpy as np

from gearstab.floquet.kernel.chain import Chain
from gearstab.system import Array

LARGEST = 0.5
"""The largest radius that is asked for."""
LEAST = 2.0**-40
"""Part of LARGEST below which a radius is none."""
BISECTIONS = 4
"""Bisections of a radius on a logarithmic scale, between halvings: it is found within 2^(1/16)."""
PART = 0.4
"""Part of the slowest decay that is built into P."""
LONGEST = 1.0
"""Decay of the action in a piece of a segment, at most."""
PIECES = 64.0
"""Most pieces of a segment."""
DOUBLINGS = 60
NEGLIGIBLE = 1e-9
"""Entries of M'^k below this add nothing to P."""


FARTHEST = 1 / 32
"""The largest radius that is asked for where generators change with the mesh frequency."""
SECURE = 1.5
"""Factor by which what bounds the second derivative grows within that radius: (1 - FARTHEST)^-4 is 1.14."""
UNKNOWNS = 80
"""Most unknowns of a linear system for P that is set up; larger P are found from the eigenvectors of M."""


def settings(chain: Chain) -> tuple[float | int, ...]:
    """Return the numbers that the compiled kernel needs."""
    largest = LARGEST if chain.slope is None else FARTHEST
    numbers = (PART, LONGEST, PIECES, chain.rounding, largest, LEAST, NEGLIGIBLE)
    return (*numbers, BISECTIONS, DOUBLINGS, UNKNOWNS, 2 * FARTHEST * SECURE)


def too_many(size: int) -> bool:
    """Whether a linear system for P of this order is too large to be set up."""
    return size * (size + 1) // 2 > UNKNOWNS


def stein(matrix: Array, loss: Array) -> Array:
    """P - M^T P M = D ``(P, m, m)`` from the eigenvectors of M; NaN where these are nearly dependent."""
    values, vectors = np.linalg.eig(matrix)
    sound = np.linalg.cond(vectors) < 1 / np.finfo(float).eps
    vectors = np.where(sound[:, None, None], vectors, np.nan)
    inverse = np.linalg.inv(vectors)
    part = vectors.conj().swapaxes(-1, -2) @ loss @ vectors
    part = part / (1 - values.conj()[:, :, None] * values[:, None, :])
    return (inverse.conj().swapaxes(-1, -2) @ part @ inverse).real
