"""Meshes of many frequencies: one common period, one mesh frequency at a time, or Lyapunov exponents."""

from gearstab.floquet.frequencies.choice import STRATEGIES, chosen, common_period, reason
from gearstab.floquet.frequencies.per_mesh import groups

__all__ = ["STRATEGIES", "chosen", "common_period", "groups", "reason"]
