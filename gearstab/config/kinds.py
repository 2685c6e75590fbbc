"""The kinds of systems that a configuration can describe: one file each, one line in the table."""

from gearstab.config.gear_pair import GearPair
from gearstab.config.gearbox import Gearbox
from gearstab.config.matrices import Matrices
from gearstab.config.planetary import Planetary
from gearstab.config.system import System
from gearstab.config.two_stage import TwoStage

KINDS: dict[str, type[System]] = {
    "gear_pair": GearPair,
    "two_stage": TwoStage,
    "planetary": Planetary,
    "gearbox": Gearbox,
    "matrices": Matrices,
}
