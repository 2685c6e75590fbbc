"""Finding the numbers of a gear system that suppress its instability over a range of speeds: ``gearstab design``."""

from gearstab.design.run import check, design

__all__ = ["check", "design"]
