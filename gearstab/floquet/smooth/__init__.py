"""Floquet analysis of smooth and mixed mesh stiffness: Magnus steps on the kernel of the exact method."""

from gearstab.floquet.smooth.solve import sampled, solutions

__all__ = ["sampled", "solutions"]
