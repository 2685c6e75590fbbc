"""Floquet analysis of smooth and mixed mesh stiffness: Magnus steps on the kernel of the exact method."""

from gearstab.floquet.smooth.solve import periods, solutions

__all__ = ["periods", "solutions"]
