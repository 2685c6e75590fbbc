"""Tooth stiffness by ISO 6336-1, an estimate independent of the one computed from the teeth."""

from dataclasses import dataclass
from math import cos, degrees

from gearstab.gears.pair import Pair

STEEL = 206e9  # Pa, for which the standard's constants hold
THEORY_FACTOR = 0.8  # C_M: measured over theoretical, for solid discs


@dataclass(frozen=True)
class IsoStiffness:
    """Stiffness per unit face width, N/m^2 (1 N/(mm um) = 1e9 N/m^2).

    Parameters
    ----------
    theoretical: c'_th, the largest stiffness of one pair.
    single: c' = c'_th C_M C_B.
    mesh: c_gamma = c' (0.75 epsilon_alpha + 0.25), the mean of the mesh.
    """

    theoretical: float
    single: float
    mesh: float


def iso_stiffness(pair: Pair, rack_factor: bool = True) -> IsoStiffness:
    """c', c_gamma of a pair of solid discs by method B of ISO 6336-1:2006: c' takes cos beta, q' the numbers of teeth
    z/cos^3 beta of equivalent spur gears, c_gamma the transverse contact ratio.

    ``rack_factor``: C_B = [1 + 0.5 (1.2 - h_fP/m)] [1 - 0.02 (20 - alpha)], without which c' holds for the basic rack
    of h_fP = 1.2 m and 20 degrees; the mean of both gears' is taken. Materials other than steel enter by the mean of
    their moduli. An internal wheel counts as one of infinitely many teeth.

    The standard gives it for x1 >= x2 and -0.5 <= x1 + x2 <= 2, contact ratios from 1.2 to 1.9 and more than 100 N/mm.
    """
    one, two = pair.pinion, pair.wheel
    x1, x2, z1 = one.profile_shift, two.profile_shift, one.teeth / cos(one.helix_angle) ** 3
    inverse2 = 0.0 if two.internal else cos(two.helix_angle) ** 3 / two.teeth
    q = 0.04723 + 0.15551 / z1 + 0.25791 * inverse2 - 0.00635 * x1 - 0.11654 * x1 / z1
    q += -0.00193 * x2 - 0.24188 * x2 * inverse2 + 0.00529 * x1**2 + 0.00182 * x2**2
    material = 2 * one.young * two.young / (one.young + two.young) / STEEL
    theoretical = 1e9 * material / q
    factor = sum(
        (1 + 0.5 * (1.2 - gear.dedendum)) * (1 - 0.02 * (20 - degrees(gear.pressure_angle))) for gear in (one, two)
    )
    single = theoretical * THEORY_FACTOR * cos(one.helix_angle) * (factor / 2 if rack_factor else 1.0)
    return IsoStiffness(theoretical, single, single * (0.75 * pair.contact_ratio + 0.25))
