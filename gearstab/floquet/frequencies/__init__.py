"""Meshes of many frequencies: one common period, one mesh frequency at a time, or Lyapunov exponents."""

from gearstab.floquet.frequencies.choice import STRATEGIES, Strategy, chosen, common_period
from gearstab.floquet.frequencies.per_mesh import apart, groups

__all__ = ["STRATEGIES", "Strategy", "apart", "chosen", "common_period", "groups"]
