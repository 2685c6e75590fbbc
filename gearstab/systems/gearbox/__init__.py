"""Multistage gearboxes: rotors, shafts, meshes, lateral supports and torque flow of any connected train."""

from gearstab.systems.gearbox.sections import Gearbox
from gearstab.systems.gearbox.train import TrainError

__all__ = ["Gearbox", "TrainError"]
