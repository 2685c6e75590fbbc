"""Edges of damped regions: the proof of the stable rest, the scan, roots of the growth rate."""
