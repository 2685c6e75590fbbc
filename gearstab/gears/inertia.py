"""Mass and polar moment of inertia of a gear: of the toothed body, and of a disc in its place."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from gearstab.gears.geometry import Gear
from gearstab.gears.profile import NODES, tooth_profile

Array = np.ndarray


@dataclass(frozen=True)
class Inertia:
    """mass in kg, polar moment of inertia in kg m^2."""

    mass: float
    polar: float


def disc_inertia(gear: Gear, radius: float | None = None, bore_radius: float = 0.0) -> Inertia:
    """Of a disc of the gear's face width; radius None: the base radius, as Kuria & Kihiu 2008 take gears."""
    outer = gear.base_radius if radius is None else radius
    return _body(gear, pi * (outer**2 - bore_radius**2), pi / 2 * (outer**4 - bore_radius**4))


def gear_inertia(gear: Gear) -> Inertia:
    """Of the gear with its teeth, from bore to tip; of an internal gear, from tip to rim, its teeth without fillets.

    By Green's theorem along the tooth: area int r^2 dphi/2, polar moment int r^4 dphi/4.
    """
    area, polar = _ring(gear) if gear.internal else _toothed(gear)
    return _body(gear, area, polar)


def _body(gear: Gear, area: float, polar: float) -> Inertia:
    layer = gear.density * gear.face_width
    return Inertia(layer * area, layer * polar)


def _toothed(gear: Gear) -> tuple[float, float]:
    profile = tooth_profile(gear)
    root, bore, tip = gear.root_radius, gear.bore, gear.tip_radius
    x, y, _, _ = profile.involute(profile.tip_roll)
    top, land = float(np.arctan2(x, y)), pi / gear.teeth - profile.root_half_angle
    area = top * tip**2 / 2 + land * root**2 / 2
    polar = top * tip**4 / 4 + land * root**4 / 4
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    ends = ((profile.fillet, pi / 2, profile.fillet_end), (profile.involute, profile.form_roll, profile.tip_roll))
    for curve, start, end in ends:
        x, y, dx, dy = curve(start + (end - start) * (nodes + 1) / 2)
        swept = (x * dy - y * dx) * weights * (end - start) / 2
        area += float(np.sum(swept)) / 2
        polar += float(np.sum(swept * (x**2 + y**2))) / 4
    return 2 * gear.teeth * area - pi * bore**2, 2 * gear.teeth * polar - pi / 2 * bore**4


def _ring(gear: Gear) -> tuple[float, float]:
    rim, root = gear.bore, gear.root_radius
    area, polar = pi * (rim**2 - root**2), pi / 2 * (rim**4 - root**4)
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    base = min(max(gear.base_radius, gear.tip_radius), root)
    for start, end in ((gear.tip_radius, base), (base, root)):  # below the base circle the flank is radial
        r = start + (end - start) * (nodes + 1) / 2
        angle = np.arccos(np.minimum(gear.base_radius / r, 1.0))
        strip = 2 * gear.teeth * (gear.base_half_angle + np.tan(angle) - angle) * weights * (end - start) / 2
        area += float(np.sum(strip * r))
        polar += float(np.sum(strip * r**3))
    return area, polar
