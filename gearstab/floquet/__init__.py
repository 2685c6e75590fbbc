"""Exact Floquet analysis: segments, kernels, the decision rule, all multipliers."""

from gearstab.floquet.dispatch import solve
from gearstab.floquet.stability import STATUS_FLAGS, FloquetStability

__all__ = ["STATUS_FLAGS", "FloquetStability", "solve"]
