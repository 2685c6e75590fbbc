"""Meshes of many frequencies: one common period, one mesh frequency at a time, or Lyapunov exponents."""

from gearstab.floquet.frequencies.choice import STRATEGIES, Choice, chosen, common_period
from gearstab.floquet.frequencies.per_mesh import apart, groups

__all__ = ["STRATEGIES", "Choice", "apart", "chosen", "common_period", "groups"]
