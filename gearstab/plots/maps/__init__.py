"""Figures over the axes of a sweep: maps, boundaries, surfaces, curves, slices."""
