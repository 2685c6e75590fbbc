"""Perturbation theory: instability tongues to first and second order, and an older approximation to compare with."""

from gearstab.perturbation.mathieu import uncoupled
from gearstab.perturbation.multiple_scales import first_order
from gearstab.perturbation.second_order import STATUS_FLAGS as PERTURBATION_FLAGS
from gearstab.perturbation.second_order import second_order
from gearstab.perturbation.tongues import Tongue, Tongues

__all__ = ["PERTURBATION_FLAGS", "Tongue", "Tongues", "first_order", "second_order", "uncoupled"]
