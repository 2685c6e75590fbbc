"""Which kernel runs, and what a kernel is.

A kernel is a module that offers, for a pattern (:class:`~gearstab.floquet.segments.pattern.Pattern`) and mesh
frequencies ``(r, P)`` in units of the pattern's rate:

* ``scan(pattern, omega) -> (verdict, growth)``: int8 of UNSTABLE, STABLE, DOUBTFUL and ln max |lambda| a common period
  of a conservative pattern, ``(r, P)`` each;
* ``rates(pattern, mesh_frequency, place, stable, growth) -> (row, point)``: the same of mesh frequencies ``(P,)`` of
  all rows or ``(r, P)`` in the units of the system, as flags (int8) and growth rates in these units, less the pattern's
  uniform decay, written to the rows ``place`` ``(r,)`` of two arrays ``(rows, P)`` that are contiguous when transposed;
  returns the points in doubt, where they mean nothing;
* ``monodromy(pattern, row, omega) -> (matrix, scale)``: monodromy matrices ``(P, 2n, 2n)`` over exp(scale) at
  ``(P,)`` frequencies of one row or of a row each, for what ``scan`` leaves in doubt;
* ``log_multipliers(pattern, omega, bound) -> ln lambda``, ``(r, P, 2n)``, imaginary parts in (-pi, pi]; NaN where an
  entry of the monodromy matrix exceeds the bound;
* ``scan_traces(pattern, omega, interpolate) -> (verdict, growth, rho, magnified)``: ``scan`` and lambda + 1/lambda of
  all multipliers, ``(r, P, n)`` in no order; NaN where the monodromy matrix had to be scaled; by how much rounding
  errors exceed those of a product, ``(r, P)``, where matrices may be interpolated over mesh frequency;
* ``trace_change(rho, other, weight) -> (change, largest)``: how far two such sets of traces are apart;
* ``trace_condition(rho, least) -> (moved, apart)``: how far a small change of the matrix moves multipliers, and how
  close two of them are;
* ``scan_damped(pattern, generator, omega) -> (growth, scale)``: ln max |lambda| a common period of a damped pattern
  and the logarithm of the size of its monodromy matrix, ``(r, P)`` each;
* ``multipliers_damped(pattern, generator, omega) -> (growth, scale, multipliers)``: the same and all multipliers over
  exp(scale), ``(r, P, m)``;
* ``log_multipliers_damped(pattern, generator, omega) -> ln lambda``, ``(r, P, m)``, imaginary parts in (-pi, pi], right
  to some 1e-14 times the spread of ln |lambda| however large that is;
* ``graded(factors) -> ln lambda``, ``(P, m)``, the same of a product of factors ``(P, m, m)``, see
  :mod:`gearstab.floquet.kernel.graded`;
* ``products(chain, row, cycle)``, ``moduli(chain, row, cycle)``, ``radii(chain, row, cycle, growth)``: monodromy
  matrices, ln |lambda| of multipliers and radii of Lyapunov functions at single points of damped systems, see
  :mod:`gearstab.floquet.kernel.lyapunov`.

:mod:`gearstab.ckernel` says which one is in use.
"""

from __future__ import annotations

from types import ModuleType

from gearstab.ckernel import available, checked, name, record, recorded, said, using
from gearstab.floquet.kernel import c_kernel, numpy_kernel

KERNELS: dict[str, ModuleType] = {"numpy": numpy_kernel, "c": c_kernel}


def current() -> ModuleType:
    """The kernel in use, to compute with it now."""
    chosen = name()
    record(chosen)
    return KERNELS[chosen]


__all__ = ["KERNELS", "available", "checked", "current", "name", "record", "recorded", "said", "using"]
