"""Edges of all instability regions along the mesh frequency: ``methods.boundaries``."""

from gearstab.floquet.boundaries.regions import BOUNDARY_FLAGS, Boundaries, Edges, union
from gearstab.floquet.boundaries.solve import boundaries

__all__ = ["BOUNDARY_FLAGS", "Boundaries", "Edges", "boundaries", "union"]
