"""Helical pairs: a converged reference, slices, harmonics, the spur limit, whole overlap ratios, ISO 6336."""

import json
from dataclasses import replace
from math import cos, isclose, pi, radians, sin, tan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from iso6336 import iso_stiffness
from scenes import DATA

from gearstab.errors import NotPossible
from gearstab.gears.compliance import pair_stiffness, tooth_compliance
from gearstab.gears.friction import ConstantFriction, mesh_friction
from gearstab.gears.geometry import Gear, involute
from gearstab.gears.mesh_stiffness import StiffnessModel, contact_stiffness, mesh_stiffness
from gearstab.gears.pair import Pair
from gearstab.waveforms import Helical, Rectangular
from gearstab.waveforms.tooth import Piecewise, averaged, stacked

CASES = json.loads((DATA / "teeth" / "reference_helical.json").read_text())["cases"]
REFERENCE = pytest.mark.parametrize("case", CASES, ids=lambda case: case["name"])
OF_INPUTS = {"normal_module": "module", "normal_pressure_angle": "pressure_angle", "rounding": "rack_tip_radius",
             "E": "young", "nu": "poisson", "addendum": "addendum", "dedendum": "dedendum",
             "face_width": "face_width"}  # fmt: skip


def pair_of(case) -> Pair:
    given = case["inputs"]
    both = {key: given[name] for name, key in OF_INPUTS.items()}
    helix = given["helix_angle"]
    one, two = (
        Gear(given["teeth"][k], profile_shift=given["profile_shift"][k], bore_radius=given["bore_radius"][k],
             helix_angle=(helix, -helix)[k], **both) for k in (0, 1)
    )  # fmt: skip
    return Pair(one, two)


def wide(overlap: float, **more) -> Pair:
    """24/57 teeth of 20 degrees whose face width gives this overlap ratio."""
    beta = radians(20)
    width = overlap * pi * 0.003 / sin(beta)
    common = {"module": 0.003, "face_width": width} | more
    return Pair(Gear(24, helix_angle=beta, **common), Gear(57, helix_angle=-beta, **common))


@REFERENCE
def test_geometry_of_the_reference(case) -> None:
    pair = pair_of(case)
    gear = pair.pinion
    found = [gear.transverse_module, gear.transverse_angle, gear.base_helix, pair.pressure_angle, pair.centre,
             pair.base_pitch, pair.contact_ratio, pair.overlap_ratio, *pair.path]  # fmt: skip
    names = ["transverse_module", "transverse_pressure_angle", "base_helix_angle", "operating_pressure_angle",
             "centre_distance", "base_pitch", "epsilon_alpha", "epsilon_beta"]  # fmt: skip
    expected = [*(case[name] for name in names), *case["path_start_end_from_T1"]]
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-15)
    assert pair.total_contact_ratio == pair.contact_ratio + pair.overlap_ratio


@REFERENCE
def test_stiffness_of_the_reference(case) -> None:
    """Its tolerance is 1e-8, that of its own interpolation."""
    pair, width = pair_of(case), case["inputs"]["face_width"]
    single = pair_stiffness(pair, pair.pitch_point) / width
    assert isclose(single, case["single_pair_per_width_at_pitch_point"], rel_tol=1e-10)
    ends = pair_stiffness(pair, np.linspace(*pair.path, 3)) / width
    np.testing.assert_allclose(ends, case["single_pair_per_width_at_path_start_middle_end"], rtol=1e-10)
    for gear, arm, name in (
        (pair.pinion, pair.pitch_point, "pinion_at_pitch_point_bending_shear_axial_foundation"),
        (pair.wheel, pair.wheel_arm(pair.pitch_point), "wheel_at_pitch_point"),
    ):
        tooth = tooth_compliance(gear, arm / gear.base_radius, 1.0)
        parts = [tooth.bending, tooth.shear, tooth.axial, tooth.foundation]
        np.testing.assert_allclose(parts, case[f"compliance_parts_{name}"], rtol=1e-10)
    mesh = mesh_stiffness(pair)
    np.testing.assert_allclose(mesh.curve.value(np.array(case["phases"])), case["mesh_stiffness_N_m"], rtol=1e-8)
    assert isclose(mesh.mean, case["mean_N_m"], rel_tol=1e-8)
    # The reference has its extremes from samples.
    np.testing.assert_allclose(mesh.extremes, case["min_max_N_m"], rtol=2e-6)
    harmonics = case["harmonic_amplitude_over_mean_and_angle_1_2_3"]
    np.testing.assert_allclose([mesh.harmonic(s) for s in (1, 2, 3)], [size for size, _ in harmonics], atol=1e-10)
    for order, (size, angle) in enumerate(harmonics, start=1):
        a, b = mesh.curve.fourier(order)
        if size > 1e-12:
            assert isclose(np.angle(complex(b, -a)), angle, abs_tol=1e-7)


def test_slices_converge_to_the_average() -> None:
    """Thin slices side by side, each delayed: the error falls as 1/n, as pairs enter with a jump."""
    pair = wide(1.37)
    mesh = mesh_stiffness(pair)
    x = (np.arange(200) + 0.5) / 200
    errors = []
    for slices in (25, 250, 2500):
        delay = pair.overlap_ratio * (np.arange(slices) + 0.5) / slices
        found = mesh.transverse.value(x[:, None] - delay).mean(axis=-1)
        errors.append(np.max(np.abs(found / mesh.curve.value(x) - 1)))
    assert errors[0] < 3e-2
    assert errors[2] < 3e-4
    assert errors[1] < errors[0] / 4
    direct = np.sum(contact_stiffness(pair, x)[1], axis=-1)
    np.testing.assert_allclose(mesh.transverse.value(x), direct, rtol=1e-10)


@settings(deadline=None, max_examples=40)
@given(st.floats(0.01, 4.5), st.floats(0.05, 0.95), st.integers(1, 6))
def test_harmonics_are_those_of_spur_teeth_times_sinc(width, second, order) -> None:
    rng = np.random.default_rng(7)
    curve = Piecewise(np.array([0.0, second]), rng.normal(size=(2, 6)))
    mean = averaged(curve, width)
    a, b = curve.fourier(order)
    turned = complex(b, -a) * np.sinc(order * width) * np.exp(-1j * np.pi * order * width)
    found = mean.fourier(order)
    assert abs(complex(found[1], -found[0]) - turned) < 1e-13 / width + 1e-13
    assert isclose(float(mean.mean), float(curve.mean), rel_tol=1e-12, abs_tol=1e-14)


def test_the_spur_limit_is_exact() -> None:
    gears = {"module": 0.003, "face_width": 0.02, "bore_radius": 0.012}
    spur = Pair(Gear(24, **gears), Gear(57, **gears))
    assert spur.overlap_ratio == 0
    assert mesh_stiffness(spur).curve is mesh_stiffness(spur).transverse
    x = (np.arange(400) + 0.5) / 400
    exact = mesh_stiffness(spur).curve.value(x)
    for beta in (1e-3, 1e-6, 1e-9, 1e-13):
        pair = Pair(*(replace(gear, helix_angle=sign * beta) for gear, sign in ((spur.pinion, 1), (spur.wheel, -1))))
        found = mesh_stiffness(pair).curve.value(x)
        c = pair.contact_ratio
        clear = (x > pair.overlap_ratio + 1e-9) & (np.abs(x - (c % 1) - pair.overlap_ratio / 2) > pair.overlap_ratio)
        # The average over a window of width eps_beta differs by its half times the slope; 1e-12 is rounding.
        np.testing.assert_allclose(found[clear], exact[clear], rtol=beta + 1e-12)


def test_whole_overlap_ratios_leave_a_constant_and_their_neighbours_little() -> None:
    for overlap in (1, 2, 3):
        mesh = mesh_stiffness(wide(overlap))
        assert mesh.epsilon < 1e-14
        assert mesh.waveform.piecewise_constant
        near = [mesh_stiffness(wide(overlap + d)).epsilon for d in (-1e-3, -1e-6, 1e-6, 1e-3)]
        # Proportional to the distance, on both sides alike: sin(pi eps_beta)/(pi eps_beta).
        assert near[0] == pytest.approx(near[3], rel=1e-2)
        assert near[1] == pytest.approx(near[0] * 1e-3, rel=1e-2)
        assert near[2] == pytest.approx(near[1], rel=1e-2)


@pytest.mark.parametrize("keep", ["levels", "peak-to-peak", "first harmonic"])
def test_a_rectangular_wave_becomes_a_trapezoid(keep) -> None:
    for overlap in (0.3, 0.8, 1.6):
        pair = wide(overlap)
        mesh = mesh_stiffness(pair)
        reduced = mesh.rectangular(keep)
        wave = Helical(reduced.contact_ratio, pair.overlap_ratio)
        rectangle = Rectangular(reduced.contact_ratio)
        step = Piecewise(rectangle.breakpoints(), np.array(rectangle.value(rectangle.breakpoints()))[:, None])
        exact = averaged(step, pair.overlap_ratio)
        x = (np.arange(300) + 0.5) / 300
        np.testing.assert_allclose(wave.value(x), exact.value(x), atol=1e-14)
        np.testing.assert_allclose(wave.extremes(), exact.extremes, atol=1e-14)
        for order in (1, 2, 5):
            np.testing.assert_allclose(wave.fourier(order), exact.fourier(order), atol=1e-14)
        assert set(np.round(wave.breakpoints(), 12)) == set(np.round(exact.breakpoints(), 12))
        if keep == "first harmonic":
            found = 2 * reduced.epsilon * np.hypot(*wave.fourier(1))
            assert isclose(found, mesh.harmonic(1), rel_tol=1e-10)


@REFERENCE
def test_means_lie_within_the_scatter_of_iso_6336(case) -> None:
    """c_gamma by method B, without the rack's factor: 0.96 to 1.11 of it in the author's nine cases."""
    pair = pair_of(case)
    mean = mesh_stiffness(pair).mean / pair.face_width
    assert 0.95 < mean / iso_stiffness(pair, rack_factor=False).mesh < 1.12


def test_iso_6336_by_hand_for_helical_teeth() -> None:
    beta = radians(20)
    pair = Pair(Gear(24, 0.003, helix_angle=beta, young=206e9), Gear(57, 0.003, helix_angle=-beta, young=206e9))
    z1, z2 = 24 / cos(beta) ** 3, 57 / cos(beta) ** 3
    q = 0.04723 + 0.15551 / z1 + 0.25791 / z2
    expected = 0.8 * cos(beta) / q * 1e9
    assert isclose(iso_stiffness(pair, rack_factor=False).single, expected, rel_tol=1e-12)


def test_contact_that_the_helix_keeps_up() -> None:
    """Short teeth with a transverse contact ratio below 1: another pair always carries at some slice."""
    short = {"addendum": 0.55, "dedendum": 1.2}
    pair = wide(0.8, **short)
    assert pair.contact_ratio < 1 < pair.total_contact_ratio
    mesh = mesh_stiffness(pair)
    assert mesh.extremes[0] > 0
    x = (np.arange(500) + 0.5) / 500
    delay = pair.overlap_ratio * (np.arange(4000) + 0.5) / 4000
    slices = mesh.transverse.value(x[:, None] - delay).mean(axis=-1)
    np.testing.assert_allclose(mesh.curve.value(x), slices, rtol=3e-3)
    assert "contact_ratio" not in {notice.name for notice in pair.notices}
    narrow = wide(0.05, **short)
    assert "contact_ratio" in {notice.name for notice in narrow.notices}
    with pytest.raises(NotPossible, match="contact breaks off"):
        mesh_stiffness(narrow)


def test_a_measured_variation_is_that_of_the_whole_width() -> None:
    mesh = mesh_stiffness(wide(0.6), StiffnessModel(variation=0.1))
    assert isclose(2 * mesh.epsilon, 0.1, rel_tol=1e-11)
    assert isclose(mesh.mean, mesh_stiffness(wide(0.6)).mean, rel_tol=1e-12)


def test_batches_of_spur_and_helical_curves_are_those_of_their_entries() -> None:
    curves = [mesh_stiffness(wide(overlap)).curve for overlap in (0.4, 1.0, 1.3)]
    spur = mesh_stiffness(Pair(Gear(24, 0.003), Gear(57, 0.003))).curve
    both = stacked([spur, *curves], (4,))
    x = (np.arange(50) + 0.5) / 50
    found = both.value(x[:, None])
    for k, curve in enumerate([spur, *curves]):
        np.testing.assert_allclose(found[:, k], curve.value(x), rtol=1e-14)
        np.testing.assert_allclose([f[k] for f in both.fourier(3)], curve.fourier(3), rtol=1e-9, atol=1e-4)
        np.testing.assert_allclose([f[k] for f in both.extremes], curve.extremes, rtol=1e-13)


def test_a_helical_tooth_is_as_thick_as_the_rack_cuts_it() -> None:
    """In the transverse section s_t = (pi/2 + 2 x tan alpha_n) m_n/cos beta (ISO 21771)."""
    beta = radians(25)
    gear = Gear(31, 0.002, profile_shift=0.3, helix_angle=beta)
    assert isclose(gear.thickness(gear.radius), (pi / 2 + 0.6 * tan(pi / 9)) * 0.002 / cos(beta), rel_tol=1e-12)
    angle = gear.transverse_angle
    assert isclose(gear.base_half_angle, pi / 62 + 0.6 * tan(pi / 9) / 31 + involute(angle), rel_tol=1e-12)
    # Undercut sets in at h - (z/cos beta) sin^2(alpha_t)/2 modules.
    assert isclose(gear.least_shift, gear.straight_depth - 31 / cos(beta) * sin(angle) ** 2 / 2, rel_tol=1e-12)


@pytest.mark.parametrize(
    ("one", "two", "internal", "words"),
    [
        (20, -18, False, "the helix angles differ: 20 and 18 deg"),
        (20, 0, False, "the helix angles differ: 20 and 0 deg"),
        (20, 20, False, "helical gears in mesh must have opposite hands, not right and right"),
        (-20, -20, False, "opposite hands, not left and left"),
        (20, -20, True, "must have the same hand, as one of them is internal, not right and left"),
    ],
)
def test_helices_that_do_not_mesh(one, two, internal, words) -> None:
    with pytest.raises(NotPossible, match=words):
        Pair(
            Gear(24, 0.003, helix_angle=radians(one)),
            Gear(81, 0.003, helix_angle=radians(two), internal=internal),
        )


def test_what_helical_gears_cannot_have() -> None:
    with pytest.raises(NotPossible, match="helix_angle must lie within 60 degrees"):
        Gear(24, 0.003, helix_angle=radians(61))
    with pytest.raises(NotPossible, match="friction between helical teeth is not computed"):
        mesh_friction(wide(0.5), ConstantFriction(0.05), 100.0, 1000.0)
