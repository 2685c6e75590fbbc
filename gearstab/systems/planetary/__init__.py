"""Planetary gears with a rigid or an elastic ring (Parker 2009)."""

from gearstab.systems.planetary.sections import Planetary

__all__ = ["Planetary"]
