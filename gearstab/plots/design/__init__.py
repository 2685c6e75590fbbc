"""Figures of design results: before and after, contours, tornado, Pareto front."""
