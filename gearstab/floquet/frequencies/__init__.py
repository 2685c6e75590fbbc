"""Meshes of many frequencies: one common period, one mesh frequency at a time, or Lyapunov exponents."""

from gearstab.floquet.frequencies.choice import STRATEGIES, Strategy, chosen
from gearstab.floquet.frequencies.per_mesh import apart, groups
from gearstab.floquet.frequencies.period import common_period

__all__ = ["STRATEGIES", "Strategy", "apart", "chosen", "common_period", "groups"]
