"""Commutator-free Magnus schemes: their coefficients, as data.

A step of x' = A(t) x over [t, t + h] is a product of exponentials, the earliest first,

    x(t + h) = exp(h sum_j a_mj A_j) ... exp(h sum_j a_1j A_j) x(t),    A_j = A(t + c_j h),

with the Gauss-Legendre nodes c_j. For an oscillator, A = [[0, I], [-K, -C]] with constant C, each exponential is
itself an oscillator of constant stiffness: with the duration d_i h and the stiffness K_i,

    d_i = sum_j a_ij,    K_i = sum_j a_ij K(t + c_j h) / d_i,

so that a step is symplectic where C = 0. The published coefficients f_in belong to the moments of A over the step,
sum_n f_in (2n - 1) int_0^1 P_{n-1}(2x - 1) A(t + x h) dx; the nodes integrate these exactly where A is a polynomial of
degree 3 at most.

Schemes of sixth order have an exponential of negative duration.

Source: Alvermann & Fehske 2011, J. Comput. Phys. 230, 5930-5956, optimized propagators CFET 4:2 and 6:5; the first
is that of Blanes & Moan 2006, Appl. Numer. Math. 56, 1519-1537. f_23 and f_33 of CFET 6:5 were computed from the other
coefficients and the order conditions sum_i f_i3 = 0, sum_(i<k) (f_i2 f_k3 - f_k2 f_i3) = -1/15.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearstab.system import Array


@dataclass(frozen=True)
class Scheme:
    """order: of convergence. nodes ``(k,)``: c_j, in parts of the step. weights ``(m, k)``: a_ij."""

    name: str
    order: int
    nodes: Array
    weights: Array

    @property
    def exponentials(self) -> int:
        """m, their number per step."""
        return len(self.weights)

    @property
    def durations(self) -> Array:
        """``(m,)``: d_i, in parts of the step; they add up to 1."""
        return np.asarray(self.weights.sum(axis=1))

    @property
    def mixture(self) -> Array:
        """``(m, k)``: a_ij/d_i, with which the stiffnesses at the nodes make up those of the exponentials."""
        return np.asarray(self.weights / self.durations[:, None])


def _from_moments(name: str, order: int, moments: list[tuple[float, float, float]]) -> Scheme:
    """The scheme of the coefficients f_in of its first half, latest exponential first, the middle one included.

    Symmetric in time: f_in of the other half has the sign (-1)^(n - 1).
    """
    middle = moments[-1:] if moments[-1][1] == 0 else []
    first = moments[: len(moments) - len(middle)]
    latest_first = first + middle + [(f1, -f2, f3) for f1, f2, f3 in first[::-1]]
    x, w = np.polynomial.legendre.leggauss(3)
    legendre = np.stack([np.ones(3), x, 0.5 * (3 * x * x - 1)])
    weights = np.array(latest_first[::-1]) @ (np.array([[1.0], [3.0], [5.0]]) * legendre * (0.5 * w))
    return Scheme(name, order, 0.5 * (x + 1), weights)


CF4_2 = _from_moments("CF4:2", 4, [(1 / 2, 1 / 3, 0.0)])
CF6_5 = _from_moments(
    "CF6:5",
    6,
    [
        (0.1714, 0.15409059414309687213, 0.11947178242929061641),
        (0.37496374319946236513, 0.13813675394387646682, -0.13090674649282935741),
        (-0.09272748639892473025, 0.0, 0.02286992812707748200),
    ],
)
