"""Multistage gearboxes: rotors, shafts, meshes, lateral supports and torque flow of any connected train."""

from gearstab.systems.gearbox.sections import Gearbox

__all__ = ["Gearbox"]
