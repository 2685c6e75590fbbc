"""Speed against error: every way to compute stability that fits a scene, measured side by side."""

from gearstab.bench.scene import Scene, without_rigid_modes
from gearstab.bench.work_precision import Measurement, measure

__all__ = ["Measurement", "Scene", "measure", "without_rigid_modes"]
