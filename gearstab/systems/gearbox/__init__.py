"""Multistage gearboxes: rotors, shafts, meshes, lateral supports and torque flow of any connected train."""

from gearstab.systems.gearbox.build import build, teeth
from gearstab.systems.gearbox.train import TrainError

__all__ = ["TrainError", "build", "teeth"]
