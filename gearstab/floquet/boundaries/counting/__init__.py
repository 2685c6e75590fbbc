"""Counting the collisions of multipliers: Krein signatures, pairs, points of a scan."""
