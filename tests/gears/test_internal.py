"""Teeth of internal gears: a reference, quadrature over the height, and their meshes."""

import json
from dataclasses import replace
from math import isclose

import numpy as np
import pytest
from scenes import DATA
from scipy.integrate import quad
from scipy.optimize import brentq

from gearstab.gears.compliance import contact_compliance, pair_stiffness, tooth_compliance
from gearstab.gears.geometry import Gear, involute
from gearstab.gears.mesh_stiffness import StiffnessModel, contact_stiffness, mesh_stiffness
from gearstab.gears.pair import Pair

ROWS = json.loads((DATA / "teeth" / "reference_relief_internal_phases.json").read_text())["internal"]
RING = Pair(Gear(24, 0.003), Gear(78, 0.003, internal=True))


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row['teeth']}")
def test_teeth_of_the_reference(row) -> None:
    names = ("teeth", "module", "alpha", "profile_shift", "addendum", "dedendum")
    gear = Gear(*(row[name] for name in names), young=row["E"], poisson=row["nu"], internal=True, face_width=1.0)
    found = [gear.tip_radius, gear.root_radius, gear.base_radius]
    np.testing.assert_allclose(found, [row[f"{name}_radius"] for name in ("tip", "root", "base")], rtol=1e-12)
    for point in row["points"]:
        tooth = tooth_compliance(gear, point["roll"])
        np.testing.assert_allclose([tooth.bending, tooth.shear, tooth.axial], point["bending_shear_axial"], rtol=1e-11)


@pytest.mark.parametrize("shift", [-0.2, 0.0, 0.4])
def test_compliance_by_adaptive_quadrature_over_the_height(shift) -> None:
    """The half thickness at each height from the half angle of the tooth at the radius that has this height."""
    gear = Gear(61, 0.002, profile_shift=shift, internal=True, face_width=0.01)

    def half_angle(radius: float) -> float:
        return gear.base_half_angle + involute(gear.profile_angle(radius))

    def height(radius: float) -> float:
        return radius * np.cos(half_angle(radius))

    roll = 0.39
    radius = gear.base_radius * np.hypot(1, roll)
    x_c, y_c, foot = radius * np.sin(half_angle(radius)), height(radius), height(gear.root_radius)
    beta = np.arccos(gear.base_radius / radius) + half_angle(radius)
    sin, cos = np.sin(beta), np.cos(beta)

    def half(y: float) -> float:
        at = brentq(lambda r: height(r) - y, gear.base_radius * 1.0001, gear.root_radius * 1.001, xtol=1e-15)
        return at * np.sin(half_angle(at))

    def integral(function) -> float:
        return quad(function, y_c, foot, epsabs=0, epsrel=1e-10)[0]

    b, e = gear.face_width, gear.young
    moment = integral(lambda y: ((y - y_c) * cos - x_c * sin) ** 2 / (e * 2 / 3 * half(y) ** 3 * b))
    area = integral(lambda y: 1 / (2 * half(y) * b))
    tooth = tooth_compliance(gear, roll)
    assert isclose(tooth.bending, moment, rel_tol=1e-8)
    assert isclose(tooth.shear, 1.2 * cos**2 * area * 2 * (1 + gear.poisson) / e, rel_tol=1e-8)
    assert isclose(tooth.axial, sin**2 * area / e, rel_tol=1e-8)


def test_a_tooth_of_an_internal_gear_is_stiffer_than_that_of_an_external_one() -> None:
    """It grows thicker towards its root; as the number of teeth grows both become the tooth of a rack."""
    near = {}
    for teeth in (99, 20000):
        inside, outside = (Gear(teeth, 0.003, internal=internal, rack_tip_radius=0.0) for internal in (True, False))
        alpha = inside.transverse_angle
        parts = [tooth_compliance(gear, np.tan(alpha)) for gear in (inside, outside)]
        near[teeth] = parts[0].bending / parts[1].bending
    assert near[99] < 0.75
    assert isclose(near[20000], 1.0, abs_tol=0.003)


def test_the_mesh_is_the_sum_of_its_pairs() -> None:
    mesh = mesh_stiffness(RING)
    x = (np.arange(997) + 0.5) / 997
    np.testing.assert_allclose(mesh.curve.value(x), np.sum(contact_stiffness(RING, x)[1], axis=-1), rtol=1e-10)
    s = np.linspace(*RING.path, 7)
    parts = contact_compliance(RING)
    for gear, arm in ((RING.pinion, s), (RING.wheel, RING.length + s)):
        parts = parts + tooth_compliance(gear, arm / gear.base_radius, RING.face_width).total
    np.testing.assert_allclose(pair_stiffness(RING, s), 1 / parts, rtol=1e-13)
    assert isclose(mesh.mean, float(np.mean(np.sum(contact_stiffness(RING, x)[1], axis=-1))), rel_tol=1e-3)


def test_a_measured_pair_is_as_stiff_all_along_its_path() -> None:
    mesh = mesh_stiffness(RING, StiffnessModel(single_pair_stiffness=3e8))
    assert mesh.waveform.piecewise_constant
    assert isclose(mesh.mean, 3e8 * RING.contact_ratio, rel_tol=1e-12)


def test_helical_internal_pairs_average_too() -> None:
    helical = [replace(gear, helix_angle=0.2) for gear in (RING.pinion, RING.wheel)]
    mesh = mesh_stiffness(Pair(*helical))
    x = (np.arange(300) + 0.5) / 300
    delay = mesh.pair.overlap_ratio * (np.arange(3000) + 0.5) / 3000
    slices = mesh.transverse.value(x[:, None] - delay).mean(axis=-1)
    np.testing.assert_allclose(mesh.curve.value(x), slices, rtol=1e-3)
