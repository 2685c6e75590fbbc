"""Exact Floquet analysis: segments, kernels, the decision rule, all multipliers."""

from gearstab.floquet.solve import Floquet, solve
from gearstab.floquet.status import STATUS_FLAGS

__all__ = ["STATUS_FLAGS", "Floquet", "solve"]
