"""Multistage gearboxes: rotors, shafts, meshes, planetary sets and torque flow of any connected train."""
