"""Any linear model from elsewhere: matrices and one direction vector for each mesh."""

from gearstab.systems.matrices.model import Matrices

__all__ = ["Matrices"]
