"""The damping that makes a system stable."""

from gearstab.floquet.required_damping.growth import scalable
from gearstab.floquet.required_damping.search import FLAGS, required_damping

__all__ = ["FLAGS", "required_damping", "scalable"]
