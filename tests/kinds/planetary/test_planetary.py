"""Planetary gears: the matrices against the energies, the frequencies against Parker's and reference numbers."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from planetary_gears import ANGLE, SEQUENTIAL, parameters, with_epsilon
from plot_results import matrices as matrices_by_hand
from scenes import DATA
from scipy.linalg import eigh

from gearstab.floquet import solve
from gearstab.modal import mean_modes
from gearstab.perturbation import first_order
from gearstab.symmetry import can_couple, deflection_types, natural_modes, phase_step, type_names
from gearstab.system import GearSystem
from gearstab.systems import build
from gearstab.systems.planetary.parts import ToothNumbers, phases_of

REFERENCE = json.loads((DATA / "planetary.json").read_text())
"""Computed elsewhere with another basis (exponentials, projected operators); half-widths by singular values, crossings
by bisection on monodromy matrices of the modes named."""


def frequencies(p):
    return mean_modes(build(p)).natural_frequency


# ---- frequencies


@pytest.mark.parametrize("key", REFERENCE["natural_frequencies"]["k_cu=1e+11"])
def test_frequencies_are_those_of_the_reference(key):
    expected = np.array(REFERENCE["natural_frequencies"]["k_cu=1e+11"][key], dtype=float)
    # Thirteen digits are stored.
    np.testing.assert_allclose(frequencies(parameters(harmonics=int(key[2:])))[:13], expected, rtol=2e-12)


def test_the_printed_support_misses_the_third_frequency():
    """k_cu = 5e11 as printed gives 1.1158 where Table 1 has 1.113; all others of the table agree."""
    p = parameters(harmonics=20)
    printed = [0.9184, 0.9184, 1.113, 2.438, 2.733, 2.733, 2.896, 4.756, 5.045]
    digits = [4, 4, 3, 3, 3, 3, 3, 3, 3]
    found = [round(float(w), d) for w, d in zip(frequencies(p), digits, strict=False)]
    assert found == printed
    p["supports"]["carrier_rotation"] = 5e11
    assert round(float(frequencies(p)[2]), 4) == 1.1158


def test_matrices_are_those_put_together_by_hand():
    names, mass, mean, directions = matrices_by_hand(4, 6)
    p = parameters(harmonics=6)
    p["inertias"] = p["inertias"] | {"ring": 7.681}
    system = build(p)
    assert list(system.coordinates) == names
    np.testing.assert_allclose(system.mass, mass, rtol=1e-14)
    np.testing.assert_allclose(system.mean_stiffness_matrix(), mean, rtol=1e-13, atol=1e-12)
    np.testing.assert_allclose([m.direction for m in system.meshes], directions, atol=1e-14)


def test_purely_ring_frequencies_have_a_closed_form():
    """w^2 = 2 pi k_bend m^2 (m^2 - 1)^2/(1 + m^2), without dimension, for m a multiple of N/2."""
    system = build(parameters(harmonics=8))
    modes = natural_modes(system)
    found = [w for w, kind in zip(modes.natural_frequency, type_names(system, modes), strict=True) if "ring" in kind]
    m = np.array([2.0, 4.0, 6.0, 8.0])
    np.testing.assert_allclose(found, np.sqrt(np.pi * m**2 * (m**2 - 1) ** 2 / (1 + m**2)), rtol=1e-12)


def test_a_stiff_ring_is_rigid():
    stiff = parameters(harmonics=6)
    # The compliance of the ring falls as 1/k_bend: 1e7 stiffer leaves some 1e-7 of the effect of bending.
    stiff["ring"] = stiff["ring"] | {"bending_stiffness": 5e14}
    np.testing.assert_allclose(frequencies(stiff)[:7], frequencies(parameters(harmonics=1))[:7], rtol=1e-7)


def test_dimensionless_is_the_same_gear_in_other_units():
    unit = np.sqrt(1e8 / 6.35)
    damped = parameters(damping={"rayleigh": [20.0, 1e-6]})
    for p in (parameters(), damped):
        one, other = (mean_modes(build(q)).natural_frequency for q in (p, p | {"scaling": "SI"}))
        np.testing.assert_allclose(other, one * unit, rtol=1e-11)
    rates = [np.trace(np.linalg.solve(s.mass, s.damping)) for s in (build(damped | {"scaling": "SI"}), build(damped))]
    assert rates[0] == pytest.approx(rates[1] * unit, rel=1e-12)


# ---- energies


def ring_energies(v, c, s, foundation, points=4096):
    """Energies of the ring from its deflection on a fine grid: (kinetic of dq = q, potential), all by quadrature.

    v: (x, y, u) of the rigid motion; c, s: amplitudes by number of waves. Derivatives by the Fourier transform.
    """
    theta = 2 * np.pi * np.arange(points) / points
    elastic = sum(c[m] * np.cos(m * theta) + s[m] * np.sin(m * theta) for m in c)
    wave = 1j * np.fft.fftfreq(points, 1 / points)

    def slope(values, times=1):
        return np.fft.ifft(np.fft.fft(values) * wave**times).real

    x, y, u = v
    tangential = elastic - x * np.sin(theta) + y * np.cos(theta) + u / np.cos(ANGLE)
    radial = -slope(elastic) + x * np.cos(theta) + y * np.sin(theta)
    step = 2 * np.pi / points
    kinetic = 6.35 / (2 * np.pi) * np.sum(tangential**2 + radial**2) * step / 2
    curvature = radial + slope(radial, 2)
    along, across = foundation
    potential = np.sum(5e7 * curvature**2 + across * radial**2 + along * tangential**2) * step / 2
    return kinetic, potential


def test_the_energies_of_the_ring():
    rng = np.random.default_rng(4)
    p = parameters(harmonics=5, scaling="SI")
    p["supports"] = p["supports"] | {"ring_radial": 3e6, "ring_tangential": 7e6}
    system = build(p)
    v, c, s = rng.normal(size=3), *({m: rng.normal() for m in range(2, 6)} for _ in range(2))
    entries = dict(zip(("ring_x", "ring_y", "ring_rotation"), v, strict=True))
    entries |= {f"ring_c{m}": c[m] for m in c} | {f"ring_s{m}": s[m] for m in s}
    q = np.array([entries.get(name, 0.0) for name in system.coordinates])
    kinetic, potential = ring_energies(v, c, s, (7e6, 3e6))
    assert 0.5 * q @ system.mass @ q == pytest.approx(kinetic, rel=1e-12)
    assert 0.5 * q @ system.stiffness @ q == pytest.approx(potential, rel=1e-9)  # third derivatives of 4096 points


def test_free_gears_have_rigid_body_modes():
    free = {"carrier": 0.0, "sun": 0.0, "planet": 5e11, "carrier_rotation": 0.0, "sun_rotation": 0.0}
    free |= {"ring_radial": 0.0, "ring_tangential": 0.0}
    # T = 0: ring, carrier and sun turn, a planet moves in three ways: six coordinates against two bearing and two mesh
    # springs. T = 1: two translations of each central body, two copies of a planet's three, eight springs.
    assert mean_modes(build(parameters(supports=free))).rigid.sum() == 2 + 4
    assert mean_modes(build(parameters(supports=free, motion="rotational"))).rigid.sum() == 2
    assert mean_modes(build(parameters(supports=free | {"carrier_rotation": 1e8}))).rigid.sum() == 1 + 4
    assert not mean_modes(build(parameters())).rigid.any()


def test_the_rotational_model():
    """Lin & Parker's matrices of the rotational model, by hand: u_c, u_r, u_s, u_1..u_N and 2 N springs."""
    p = parameters(planets=5, harmonics=1, motion="rotational", scaling="SI")
    system = build(p)
    ring, carrier, sun = (system.coordinates.index(f"{body}_rotation") for body in ("ring", "carrier", "sun"))
    mass = np.array([6.35 / np.cos(ANGLE) ** 2, 6.0 + 5 * 4.0, 2.5] + [2.0] * 5)
    stiffness = np.diag([0.0, 1e11, 5e11] + [0.0] * 5)
    for n in range(5):
        for body, sign in ((ring, -1.0), (sun, 1.0)):
            g = np.zeros(8)
            g[body], g[carrier], g[3 + n] = 1.0, -np.cos(ANGLE), sign
            stiffness += 1e8 * np.outer(g, g)
    expected = np.sqrt(np.abs(eigh(stiffness, np.diag(mass), eigvals_only=True)))
    np.testing.assert_allclose(mean_modes(system).natural_frequency, expected, rtol=1e-9)


# ---- types


@pytest.mark.parametrize("planets", range(3, 9))
def test_mode_types_count_as_the_structure_says(planets):
    """With a rigid ring: six rotational, twelve translational, 3 (N - 3) planet modes (Lin & Parker 1999)."""
    system = build(parameters(planets, 1))
    modes = natural_modes(system)
    kinds = type_names(system, modes)
    counts = [kinds.count(kind) for kind in ("rotational", "translational", "planet")]
    assert counts == [6, 12, 3 * (planets - 3)]


@pytest.mark.parametrize("planets", [4, 5, 7])
def test_oriented_modes_are_modes_whose_deflections_go_round(planets):
    system = build(parameters(planets))
    modes = natural_modes(system)
    identity = modes.shapes.T @ system.mass @ modes.shapes
    np.testing.assert_allclose(identity, np.eye(system.size), atol=1e-12)
    for p, kind in enumerate(deflection_types(system, modes)):
        spectrum = np.abs(np.fft.fft(modes.mesh_deflection[p].reshape(2, planets), axis=1))
        others = [k for k in range(planets) if kind < 0 or k not in (kind, planets - kind)]
        # A mode's frequency is within 3e-8 of one of another type at worst: the solver mixes them by eps/3e-8.
        assert spectrum[:, others].max(initial=0.0) < 1e-6


# ---- perturbation


def half_widths(p, harmonics=4):
    tongues = first_order(build(with_epsilon(p, 1.0)), harmonics, modes=range(1, 10))
    kept = [(t.mode_p, t.mode_q, t.harmonic, half) for t, half in zip(tongues.index, tongues.half_width, strict=True)]
    return {(p, q, s): float(width) for p, q, s, width in kept if width > 1e-9}


@pytest.mark.parametrize(
    ("key", "phases"),
    [
        ("inphase", {"sun": [0.0] * 4, "sun_ring": 0.5}),
        ("sequential_lag_gamma=[0,.25,.5,.75]", SEQUENTIAL),
        ("sequential_lead_gamma=[0,.75,.5,.25]", {"sun": [0.0, 0.75, 0.5, 0.25], "sun_ring": 0.5}),
    ],
)
def test_half_widths_are_those_of_the_reference(key, phases):
    expected = {(t["p"], t["q"], t["L"]): max(t["half_width_per_eps"]) for t in REFERENCE["first_order_M=20"][key]}
    found = half_widths(parameters(harmonics=20, phases=phases))
    assert {k for k, v in expected.items() if v > 1e-9} == set(found)
    for tongue, width in found.items():
        assert width == pytest.approx(expected[tongue], rel=1e-6), tongue


def test_the_basis_of_a_pair_changes_nothing(monkeypatch):
    from gearstab.perturbation import multiple_scales

    system = build(parameters(phases=SEQUENTIAL))
    plain = first_order(system, 2)

    def turned(given):
        modes, angle = mean_modes(given), 0.7
        shapes, deflection = modes.shapes.copy(), modes.mesh_deflection.copy()
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        equal = np.flatnonzero(np.diff(modes.natural_frequency) < 1e-9 * modes.natural_frequency[1:])
        assert len(equal) > 8
        for k in equal:
            shapes[:, k : k + 2] = shapes[:, k : k + 2] @ turn
            deflection[k : k + 2] = turn.T @ deflection[k : k + 2]
        return replace(modes, shapes=shapes, mesh_deflection=deflection)

    monkeypatch.setattr(multiple_scales, "mean_modes", turned)
    other = first_order(system, 2)
    np.testing.assert_allclose(other.half_width, plain.half_width, atol=1e-12)
    np.testing.assert_allclose(other.boundary_frequency, plain.boundary_frequency, rtol=1e-12)


def test_numbering_the_planets_from_another_one_changes_nothing():
    """Phases that go round with the numbers describe the same gear at another time."""
    p = parameters(5, phases={"sun": [0.0, 0.1, 0.45, 0.6, 0.83], "sun_ring": 0.3})
    other = parameters(5, phases={"sun": [0.45, 0.6, 0.83, 0.0, 0.1], "sun_ring": 0.3})
    widths = [first_order(build(q), 2).half_width for q in (p, other)]
    np.testing.assert_allclose(widths[0], widths[1], atol=1e-11)  # sqrt(eps) of nothing: the couplings agree to 1e-13
    omega = np.array([1.9, 2.7, 3.6])
    growth = [solve(build(with_epsilon(q, 0.3)), omega).growth_rate for q in (p, other)]
    np.testing.assert_allclose(growth[0], growth[1], atol=1e-9)


@pytest.mark.parametrize("planets", range(3, 8))
def test_the_existence_rule_tells_what_couples(planets):
    """L z_s +- (T_p +- T_q) = j N against the couplings of the modes, for all classes of tooth numbers."""
    for teeth in range(planets):
        phases = {"sun": [n * teeth / planets for n in range(planets)], "sun_ring": 0.37}
        system = build(parameters(planets, 4, phases=phases))
        modes = natural_modes(system)
        kinds = dict(enumerate(deflection_types(system, modes), 1))
        assert phase_step(system) == teeth
        tongues = first_order(with_amplitude(system), 3, modes=range(1, 13))
        for tongue, width in zip(tongues.index, tongues.half_width, strict=True):
            p, q, harmonic = tongue.mode_p, tongue.mode_q, tongue.harmonic
            if np.isnan(width):
                continue
            types = kinds[p], kinds[q]
            excited = min(types) >= 0 and can_couple(planets, teeth, harmonic, *types)
            # Exact zeros come out as rounding, 1e-13 of couplings of order 1; the least of the others is 1e-5.
            assert (width > 1e-9) == excited, (teeth, p, q, harmonic, types, width)


def with_amplitude(system: GearSystem) -> GearSystem:
    return replace(system, meshes=tuple(replace(mesh, epsilon=np.asarray(1.0)) for mesh in system.meshes))


def test_phases_from_tooth_numbers():
    sun, between = phases_of(ToothNumbers(sun=27, planet=35, ring=97), 4)
    assert [float(g) for g in sun] == [0.0, 0.75, 0.5, 0.25]
    assert between == 0
    assert phases_of(ToothNumbers(sun=27, planet=36, ring=99), 3)[1] == 0.5
    # (z_s + z_r)/N an integer: the ring's phases -(n - 1) z_r/N are those of the sun.
    assert [(-n * 97 / 4) % 1 for n in range(4)] == [float(g) for g in sun]


# ---- Parker's closed forms


def lag_angle(p, harmonic):
    c_s, c_r = (p["meshes"][gear]["contact_ratio"] for gear in ("sun", "ring"))
    sines = np.sin(harmonic * np.pi * c_s), np.sin(harmonic * np.pi * c_r)
    return *sines, harmonic * np.pi * (c_r + 2 * p["phases"]["sun_ring"] - c_s)


@pytest.mark.parametrize("harmonic", [1, 2, 3])
@pytest.mark.parametrize("pair", [(3, 3), (3, 7), (4, 4), (4, 9), (9, 9)])
def test_distinct_modes_in_phase_have_parkers_closed_form(pair, harmonic):
    """(38) with (21), dimensionless: mu and eps are k_sp and k_rp times the relative variation."""
    p = parameters()
    system = build(p)
    modes, (i, j) = mean_modes(system), (k - 1 for k in pair)
    s, r = (modes.mesh_deflection[i, k] * modes.mesh_deflection[j, k] for k in (0, 4))
    sine_s, sine_r, angle = lag_angle(p, harmonic)
    square = s**2 * sine_s**2 + r**2 * sine_r**2 + 2 * s * r * sine_s * sine_r * np.cos(angle)
    square *= 4 * 4**2 / (harmonic * np.pi) ** 2
    expected = np.sqrt(square / (modes.natural_frequency[i] * modes.natural_frequency[j])) / harmonic
    assert half_widths(p)[(*pair, harmonic)] == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("harmonic", [1, 2, 3])
@pytest.mark.parametrize("pairs", [(1, 1), (1, 5), (5, 5)])
def test_degenerate_modes_in_phase_have_parkers_closed_form(pairs, harmonic):
    """(44) with (45), (46), max over its two signs, for equally oriented, mass-normalised pairs."""
    p = parameters()
    system = build(p)
    modes = natural_modes(system)
    first, second = pairs
    (sp, rp), (sq, rq), (sr, rr), (sm, rm) = (
        modes.mesh_deflection[k - 1, [0, 4]] for k in (first, first + 1, second, second + 1)
    )
    b1, b2, b3, b4 = sp * sr + sq * sm, rp * rr + rq * rm, sp * sm - sr * sq, rp * rm - rr * rq
    sine_s, sine_r, angle = lag_angle(p, harmonic)
    both = [
        (b1**2 + b3**2) * sine_s**2 + (b2**2 + b4**2) * sine_r**2
        + 2 * sine_s * sine_r * ((b1 * b2 + b3 * b4) * np.cos(angle) + sign * (b1 * b4 - b2 * b3) * np.sin(angle))
        for sign in (1, -1)
    ]  # fmt: skip
    square = 4**2 / (harmonic * np.pi) ** 2 * max(both)
    w = modes.natural_frequency
    expected = np.sqrt(square / (w[first - 1] * w[second - 1])) / harmonic
    assert half_widths(p)[(first, second, harmonic)] == pytest.approx(expected, rel=1e-9)


# ---- Floquet


def of_modes(p, modes):
    """The system restricted to some of its modes, as the reference is."""
    full = build(p)
    shapes = mean_modes(full).shapes[:, np.array(modes) - 1]
    return GearSystem(
        np.eye(len(modes)), shapes.T @ full.stiffness @ shapes,
        tuple(replace(mesh, direction=mesh.direction @ shapes) for mesh in full.meshes),
    )  # fmt: skip


PHASES = {"inphase": {"sun": [0.0] * 4, "sun_ring": 0.5}, "sequential": SEQUENTIAL}


def radius(system, omega):
    """Spectral radius of the monodromy matrix over one mesh period, ``(P,)``."""
    omega = np.atleast_1d(omega)
    return np.exp(solve(system, omega).growth_rate[0] * 2 * np.pi / omega)


@pytest.mark.parametrize(
    "row", REFERENCE["floquet_crossings_J=20"], ids=lambda row: f"{row['phasing']} {row['tongue']} {row['eps']}"
)
def test_crossings_are_those_of_the_reference(row):
    """The spectral radius is 1 + 1e-6 there, to what 1e-7 of the frequency changes it."""
    system = of_modes(with_epsilon(parameters(harmonics=20, phases=PHASES[row["phasing"]]), row["eps"]), row["modes"])
    for name, inward in (("Omega_lo", 1), ("Omega_hi", -1)):
        if row[name] is not None:
            omega = row[name] * (1 + inward * np.array([-1e-7, 1e-7]))
            outside, inside = radius(system, omega) - 1
            assert outside < 1e-6 < inside


@pytest.mark.parametrize("row", REFERENCE["spectral_radii"], ids=lambda row: str(row["Omega"]))
@pytest.mark.parametrize("phasing", ["inphase", "sequential"])
def test_spectral_radii_are_those_of_the_reference(row, phasing):
    p = with_epsilon(parameters(harmonics=20, phases=PHASES[phasing]), row["eps"])
    nine = radius(of_modes(p, range(1, 10)), row["Omega"])[0]
    assert nine == pytest.approx(row[f"rho9_M20_{phasing}"], abs=1e-9)
    p["ring"] = p["ring"] | {"harmonics": 4}
    full = radius(build(p), row["Omega"])[0]
    assert full == pytest.approx(row[f"rho_full_M4_{phasing}"], abs=1e-9)
