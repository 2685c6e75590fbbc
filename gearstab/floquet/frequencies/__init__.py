"""Meshes of many frequencies: one common period, one mesh frequency at a time, or Lyapunov exponents."""

from gearstab.floquet.frequencies.choice import WAYS, chosen, common_period, reason
from gearstab.floquet.frequencies.per_mesh import groups
from gearstab.floquet.frequencies.result import ManyFrequencies

__all__ = ["WAYS", "ManyFrequencies", "chosen", "common_period", "groups", "reason"]
