"""The tractor gearbox of Kuria & Kihiu 2008 against an independent program and the numbers that the paper prints."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from gearbox_trains import MESHES, REFERENCE, tractor

from gearstab.config import load
from gearstab.modal import mean_modes, static_mesh_force
from gearstab.system import GearSystem
from gearstab.systems import build

CONFIG = "configs/kuria_kihiu_2008/gearbox.yaml"


@pytest.fixture(scope="module")
def system() -> GearSystem:
    return build(tractor())


@pytest.fixture(scope="module")
def from_teeth(root: Path) -> GearSystem:
    return build(load(root / CONFIG).system)


def rigid_motion() -> np.ndarray:
    """Speeds over that of the input, from the numbers of teeth alone."""
    speeds = [1.0, 1.0]
    for driver, driven in REFERENCE["assumed"]["teeth"][:4]:
        speeds += [speeds[-1] * driver / driven] * 2
    # Both last stages turn alike, and so do the wheels.
    return np.array([*speeds[:7], speeds[7], speeds[8], speeds[7], speeds[8], speeds[8], speeds[8], *[0.0] * 20])


def test_it_has_33_coordinates_and_one_rigid_mode(system: GearSystem) -> None:
    assert system.size == 33
    assert len(set(system.coordinates)) == 33
    assert np.count_nonzero(mean_modes(system).rigid) == 1


def test_mass_damping_and_mesh_vectors_are_those_of_the_reference(system: GearSystem) -> None:
    lateral = np.repeat(REFERENCE["gear_mass"], 2)
    # Both programs round products of a few numbers.
    np.testing.assert_allclose(np.diag(system.mass), [*REFERENCE["J"], *lateral], rtol=1e-13)
    for mesh, entries in zip(system.meshes, REFERENCE["mesh_vectors"], strict=True):
        expected = np.zeros(33)
        expected[[int(k) for k in entries]] = list(entries.values())
        np.testing.assert_allclose(mesh.direction, expected, atol=1e-15)
    np.testing.assert_allclose([mesh.damping for mesh in system.meshes], REFERENCE["c_mesh"], rtol=1e-12)


def test_natural_frequencies_and_modal_damping(system: GearSystem) -> None:
    modes = mean_modes(system)
    found = modes.natural_frequency / (2 * np.pi)
    # Rounding of the largest squared frequency, 1e-16 of 14 kHz squared, is 1e-11 of 32 Hz squared.
    np.testing.assert_allclose(found[1:], REFERENCE["natural_freq_Hz_33dof"][1:], rtol=1e-10)
    modal = np.diag(modes.shapes.T @ system.damping @ modes.shapes)[1:] / (2 * modes.natural_frequency[1:])
    np.testing.assert_allclose(modal, REFERENCE["modal_zeta"][1:], rtol=1e-9)


def test_without_supports_thirteen_rotations_are_left() -> None:
    parameters = tractor()
    for rotor in parameters["rotors"]:
        rotor.pop("support", None)
    found = mean_modes(build(parameters)).natural_frequency / (2 * np.pi)
    np.testing.assert_allclose(found[1:], REFERENCE["natural_freq_Hz_torsional13"][1:], rtol=1e-10)


def test_static_loads_and_velocities_of_table_ii_to_the_printed_digits(system: GearSystem) -> None:
    forces = static_mesh_force(system)
    assert [round(float(force)) for force in forces[:4]] == REFERENCE["given_table_II"]["W_static"]
    # Both last stages carry half; by hand: torque over base radius.
    assert forces[3] == pytest.approx(forces[4], rel=1e-9)
    assert forces[4] == pytest.approx(650 / (1.5e-3 * 40 * np.cos(np.radians(20))), rel=1e-9)
    np.testing.assert_allclose(forces[:4], REFERENCE["W_normal"], rtol=1e-9)
    speed = 1500 * 2 * np.pi / 60 * rigid_motion()
    velocities = [speed[1 + 2 * k] * 1.5e-3 * REFERENCE["assumed"]["teeth"][k][0] for k in range(4)]
    assert [round(float(v), 2) for v in velocities] == REFERENCE["given_table_II"]["v"]


def test_torques_balance_in_power(system: GearSystem) -> None:
    assert system.load is not None
    assert system.load[0] == pytest.approx(REFERENCE["Tin"], rel=1e-12)
    assert list(system.load[11:13]) == [-650.0, -650.0]
    assert system.load @ rigid_motion() == pytest.approx(0.0, abs=1e-12)


def test_mesh_frequencies(system: GearSystem) -> None:
    expected = [Fraction(text) for text in REFERENCE["determined"]["mesh_freq_ratio"]]
    assert [mesh.frequency_ratio for mesh in system.meshes] == [*expected, expected[-1]]
    cycles, counts = system.common_period()
    assert cycles == 2720
    assert list(counts) == [*REFERENCE["determined"]["common_period_mesh_cycles"], 147]
    drivers = 14 * 25 * np.array([float(ratio) for ratio in system.frequency_ratios])
    np.testing.assert_allclose(drivers, REFERENCE["mesh_freq_Hz_1500rpm"], rtol=1e-14)


def test_the_train_turns_freely_with_friction_and_damping() -> None:
    parameters = tractor()
    for mesh in parameters["meshes"]:
        mesh["friction"] = {"kind": "xu_kahraman", "viscosity": 1e-2, "roughness": 0.4e-6}
    system, rigid = build(parameters), rigid_motion()
    assert len(system.terms) == 10
    for term in system.terms:
        assert np.abs(term.right @ rigid) <= 1e-16
        assert term.stiffness is not None
        assert np.ptp(term.stiffness.value(np.linspace(0, 1, 50))) > 0
    stiff = system.mean_stiffness_matrix()
    # Entries up to 1e9 cancel in each row.
    np.testing.assert_allclose(stiff @ rigid, 0.0, atol=1e-15 * np.abs(stiff).max())
    damping = np.asarray(system.damping)
    np.testing.assert_allclose(damping @ rigid, 0.0, atol=1e-14 * np.abs(damping).max())


def test_the_teeth_give_what_the_reference_gives(from_teeth: GearSystem, system: GearSystem) -> None:
    assumed = REFERENCE["assumed"]
    for k, mesh in enumerate(from_teeth.meshes):
        assert mesh.name == MESHES[k]
        assert mesh.waveform.contact_ratio == pytest.approx(REFERENCE["contact_ratio"][k], abs=1e-4)
        # Foundation and fillet of two programs differ by less than a thousandth, as single teeth do.
        assert mesh.mean_stiffness == pytest.approx(assumed["k_mesh_mean"][k], rel=1e-3)
        assert mesh.lowest_stiffness == pytest.approx(assumed["k_mesh_low_high"][k][0], rel=1e-3)
        np.testing.assert_array_equal(mesh.direction, system.meshes[k].direction)
    found, expected = (mean_modes(one).natural_frequency[1:] for one in (from_teeth, system))
    np.testing.assert_allclose(found, expected, rtol=5e-4)
