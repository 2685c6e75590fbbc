"""Planetary gears with a rigid or an elastic ring (Parker 2009)."""
