"""Exact Floquet analysis: segments, kernels, the decision rule, all multipliers."""

from gearstab.floquet.solve import STATUS_FLAGS, Floquet, solve

__all__ = ["STATUS_FLAGS", "Floquet", "solve"]
