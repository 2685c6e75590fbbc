"""Floquet analysis of systems whose periodic K(t) and C(t) need not be symmetric: friction, varying damping."""

from gearstab.floquet.general.solve import analyse

__all__ = ["analyse"]
