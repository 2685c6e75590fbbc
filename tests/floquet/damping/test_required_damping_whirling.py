"""The damping that stabilises systems with matrices that act with a speed of rotation, and other unsymmetric ones."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from driven import train, with_friction, with_waves
from random_rotors import random_rotor
from scenes import scene_data

import gearstab as gs
from gearstab.config import ConfigError
from gearstab.floquet import solve
from gearstab.floquet.required_damping import FLAGS, required_damping
from gearstab.mesh import Mesh, Rotation
from gearstab.modal import modal_damping_matrix
from gearstab.perturbation import first_order
from gearstab.system import GearSystem
from gearstab.waveforms import Fourier, Rectangular, Scaled, Trapezoidal

Array = np.ndarray
M, K, STILL, TURNING = 2.0, 800.0, 1.0, 0.6
"""A rotor on a shaft: mass, stiffness, damping to the housing and damping that turns with the shaft."""


def jeffcott(ratio: Fraction | None = Fraction(1), speed: float = 0.0) -> GearSystem:
    mesh = Mesh("mesh", np.ones(2), np.asarray(1e-12), np.asarray(0.0), Rectangular(1.5))
    circulatory = TURNING * np.array([[0.0, 1.0], [-1.0, 0.0]])
    rotation = Rotation(ratio, speed, circulatory=circulatory)
    one = np.eye(2)
    return GearSystem(M * one, K * one, (mesh,), (STILL + TURNING) * one, rotations=(rotation,))


def test_rotating_damping_in_closed_form() -> None:
    """c w > c_i W for stability, with w^2 = k/m, and c = 2 zeta m w."""
    speeds, w = np.array([5.0, 20.0, 60.0, 100.0, 300.0]), np.sqrt(K / M)
    factor = required_damping(jeffcott(), speeds, of="factor", tolerance=1e-9)
    expected = TURNING * speeds / w / (STILL + TURNING)
    np.testing.assert_allclose(factor.value[0], expected, rtol=2e-9)
    ratio = required_damping(jeffcott(), speeds, tolerance=1e-9)
    np.testing.assert_allclose(ratio.value[0], TURNING * speeds / w / (2 * M * w), rtol=2e-9)
    assert not (factor.status | ratio.status).any()
    held = [required_damping(jeffcott(None, speed), speeds[:1], tolerance=1e-9).value[0, 0] for speed in speeds]
    np.testing.assert_allclose(held, ratio.value[0], rtol=3e-9)
    beyond = required_damping(jeffcott(), np.array([2000.0]))
    assert beyond.status[0, 0] == FLAGS["beyond"]
    assert np.isnan(beyond.value[0, 0])


def damped(system: GearSystem, of: str, value: float) -> GearSystem:
    """The system with so much damping, its skew part kept."""
    given = system.damping_matrix
    skew = 0.5 * (given - given.T)
    if of == "factor":
        return replace(system, damping=value * (given - skew) + skew)
    ratios = np.full(system.size, value)
    return replace(system, damping=modal_damping_matrix(system.mass, system.mean_stiffness_matrix(), ratios) + skew)


WAVES = {"jumps": None, "smooth": Trapezoidal(1.5, 0.1)}


@pytest.mark.parametrize("wave", WAVES)
@pytest.mark.parametrize(("seed", "of"), [(0, "damping_ratio"), (4, "damping_ratio"), (3, "factor"), (5, "factor")])
def test_the_verdict_changes_at_the_value(seed: int, of: str, wave: str) -> None:
    """Gyroscopic and unsymmetric systems, some held at their speed."""
    system = random_rotor(seed, hamiltonian=of != "factor")
    if WAVES[wave] is not None:
        system = with_waves(system, *[WAVES[wave]] * len(system.meshes))
    omega = np.linspace(0.8, 6.0, 60)
    found = required_damping(system, omega, of=of)
    needed = np.flatnonzero(found.value[0] > 0)
    assert len(needed) > 3
    # The tolerance is 1e-6, and on the stable side.
    for k in needed[:: max(1, len(needed) // 12)]:
        value = found.value[0, k]
        assert solve(damped(system, of, value), omega[k]).stable[0, 0] == 1
        assert solve(damped(system, of, value * (1 - 3e-6)), omega[k]).stable[0, 0] == 0


def test_a_tongue_of_first_order_is_closed_by_the_threshold() -> None:
    """At the damping that is required at the worst speed the threshold of first order is one, but for epsilon."""
    system = random_rotor(5, hamiltonian=True)
    system = replace(system, meshes=tuple(replace(mesh, epsilon=np.asarray(0.02)) for mesh in system.meshes))
    free = first_order(system, 1)
    checked = 0
    for k in np.argsort(-np.nan_to_num(free.half_width, posinf=0.0))[:3]:
        omega = free.center_frequency[k] + np.linspace(-0.4, 0.4, 41) * free.half_width[k]
        largest = required_damping(system, omega).value.max()
        found = first_order(damped(system, "damping_ratio", largest), 1)
        assert found.label[k] == free.label[k]
        assert found.threshold[k] == pytest.approx(1.0, abs=0.03)
        checked += 1
    assert checked == 3


@pytest.mark.parametrize("of", ["factor", "damping_ratio"])
def test_damping_that_follows_the_mesh_stiffness_is_damping_and_friction_is_not(of: str) -> None:
    profile = Fourier(np.array([0.4]), np.array([0.1]))
    system = with_friction(train(epsilon=0.45), Scaled(profile, 0.0, 0.6))
    omega = np.linspace(1.0, 3.0, 30)
    found = required_damping(system, omega, of=of).value[0]
    friction, drag = system.terms
    assert np.count_nonzero(found > 0) > 3
    for k in np.flatnonzero(found > 0)[::2]:
        for value, stable in ((found[k], 1), (found[k] * (1 - 3e-6), 0)):
            terms = (friction, replace(drag, left=value * drag.left)) if of == "factor" else (friction,)
            own = replace(damped(system, of, value), terms=terms)
            assert solve(own, omega[k], tolerance=1e-11).stable[0, 0] == stable


def test_rows_are_those_of_single_systems() -> None:
    system, omega = random_rotor(3, hamiltonian=True), np.linspace(0.8, 6.0, 50)
    stiffness = np.stack([system.stiffness, 1.1 * system.stiffness, 1.3 * system.stiffness])
    found = required_damping(replace(system, stiffness=stiffness), omega).value
    for own, expected in zip(stiffness, found, strict=True):
        single = required_damping(replace(system, stiffness=own), omega).value[0]
        # Each is within its tolerance.
        np.testing.assert_allclose(single, expected, rtol=2e-6)


ROTOR = scene_data("required_damping_rotor")


def test_from_a_configuration_to_a_result() -> None:
    tree = gs.sweep(gs.load(ROTOR))
    required, unstable = tree["required_damping/required_damping"].values > 0, tree["floquet/stable"].values == 0
    # Beside a combination tongue a little damping may be worse than none.
    more = tree["required_damping/status"].values == FLAGS["not_monotone"]
    assert required[unstable].all()
    np.testing.assert_array_equal(required & ~unstable, more & ~unstable)
    assert unstable.sum() > 15
    with pytest.raises(ConfigError, match="there is no damping to multiply"):
        gs.sweep(gs.load(ROTOR | {"methods": {"required_damping": {"of": "factor"}}}))
