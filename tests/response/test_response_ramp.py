"""Run-ups and coast-downs against direct integration of the equation whose speed changes."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from driven import CASES, integrated_along, train
from scenes import ROOT

from gearstab.config import load
from gearstab.errors import NotPossible
from gearstab.mesh import Mesh
from gearstab.modal import static_equilibrium
from gearstab.propagation import phase
from gearstab.propagation.path import Path
from gearstab.response import RESPONSE_FLAGS, driven_response, harmonics, ramp_response
from gearstab.response.command.system import path_of
from gearstab.response.spectra import waterfall
from gearstab.system import GearSystem
from gearstab.systems import build
from gearstab.systems.respond import Respond
from gearstab.waveforms import Rectangular

Array = np.ndarray


def at_rest(system) -> Array:
    """Static equilibrium."""
    return np.concatenate([static_equilibrium(system), np.zeros(system.size)])


@pytest.mark.parametrize("downwards", [False, True])
@pytest.mark.parametrize("name", CASES)
def test_a_run_up_is_what_integration_gives(name: str, downwards: bool) -> None:
    system, omega = CASES[name]
    ends = (1.6 * omega, 0.8 * omega) if downwards else (0.8 * omega, 1.6 * omega)
    path = Path(np.array([0.0, 8.0]), np.array(ends))
    found = ramp_response(system, path, 8)
    expected = integrated_along(system, path, found.time, at_rest(system))
    n = system.size
    # DOP853 works to 1e-12 a step, quadrature and Magnus steps to about 1e-9.
    np.testing.assert_allclose(found.displacement, expected[:, :n], atol=5e-9)
    np.testing.assert_allclose(found.velocity, expected[:, n:], atol=5e-9)
    np.testing.assert_allclose(found.mesh_frequency, np.linspace(*ends, 2)[0] + path.rate[0] * found.time, rtol=1e-14)


def test_a_critically_damped_train_has_no_eigenvectors_to_go_by() -> None:
    """Then Magnus steps take their place."""
    system = train(damping_ratio=1.0)
    path = Path(np.array([0.0, 8.0]), np.array([1.2, 2.0]))
    found = ramp_response(system, path, 8)
    # Two eigenvalues of each mode are one at the mean stiffness: that state is defective.
    states = integrated_along(system, path, found.time, at_rest(system))
    np.testing.assert_allclose(found.displacement, states[:, : system.size], atol=5e-9)


def test_the_number_of_steps_that_are_prepared_together_is_of_no_effect(monkeypatch: pytest.MonkeyPatch) -> None:
    system, _ = CASES["unequal frequencies"]
    path = Path(np.array([0.0, 60.0]), np.array([1.2, 2.0]))
    whole = ramp_response(system, path, 20)
    monkeypatch.setattr(phase, "STEPS_AT_ONCE", 50)
    parts = ramp_response(system, path, 20)
    # The same sums in another order of rounding.
    np.testing.assert_allclose(parts.displacement, whole.displacement, atol=1e-12)


def test_a_ramp_without_end_is_a_constant_speed() -> None:
    """Rates of 1e-9 change the phase by 1e-6 within the run, and the motion by about as much."""
    system, omega = CASES["forces"]
    constant = driven_response(system, omega, static_equilibrium(system), np.zeros(3), 30.0, 20)
    slow = ramp_response(system, Path(np.array([0.0, 31.0]), np.array([omega, omega + 3.1e-8])), 20)
    count = min(len(slow.time), len(constant.time))
    np.testing.assert_allclose(slow.mesh_deflection[:count], constant.mesh_deflection[:count], atol=1e-5)


def test_rigid_body_motion_is_left_out() -> None:
    """Two free masses: their mean position stays, whatever load accelerates them, and the mesh force is the same."""
    free, balanced = two_free([0.4, 0.1]), two_free([0.275, -0.275])
    path = Path(np.array([0.0, 20.0]), np.array([0.7, 1.5]))
    found, other = (ramp_response(system, path, 30) for system in (free, balanced))
    np.testing.assert_allclose(found.displacement @ np.diag(free.mass), 0.0, atol=1e-10)
    assert np.ptp(found.mesh_force) > 0.01
    # r^T f M r of each load leaves the part (f1 m2 - f2 m1)/(m1 + m2) that deflects: 0.275 for masses of 1 and 3.
    np.testing.assert_allclose(found.mesh_force, other.mesh_force, atol=1e-10)


def two_free(load: list[float]) -> GearSystem:
    mass, direction = np.diag([1.0, 3.0]), np.array([1.0, -1.0])
    mesh = Mesh("m", direction, np.array(1.0), np.array(0.3), Rectangular(np.array(1.6)))
    damping = 0.03 * np.outer(direction, direction)
    return GearSystem(mass, np.zeros((2, 2)), (mesh,), damping, load=np.array(load))


def test_what_outgrows_double_precision_ends_the_history() -> None:
    mesh = Mesh("m", np.ones(1), np.array(1.0), np.array(0.45), Rectangular(np.array(1.5)))
    system = GearSystem(np.eye(1), np.zeros((1, 1)), (mesh,), load=np.ones(1))
    found = ramp_response(system, Path(np.array([0.0, 6000.0]), np.array([1.9, 2.1])), 4)
    assert found.flags & RESPONSE_FLAGS["overflow"]
    assert np.isfinite(found.mesh_force).all()
    assert found.flags & RESPONSE_FLAGS["separation"]


def test_too_long_a_run_is_refused_before_it_begins() -> None:
    with pytest.raises(NotPossible, match="raise the rate"):
        ramp_response(train(), Path(np.array([0.0, 1e9]), np.array([1.0, 2.0])), 2)


# ---- spectrogram and harmonics


def test_the_harmonics_of_a_slow_run_up_are_those_of_steady_states() -> None:
    """Damped by 10 %, so slowly that the motion follows: within the part by which the speed changes in a window."""
    system = train(epsilon=0.1)
    path = Path(np.array([0.0, 4e3]), np.array([2.4, 2.8]))
    found = ramp_response(system, path, 24)
    heard = waterfall(system, found)
    assert heard is not None
    for k in np.linspace(10, len(heard.moment) - 10, 4).astype(int):
        steady = harmonics(system, float(heard.mesh_frequency[k]), 8)
        expected = np.abs(steady.mesh_force[1:5])
        np.testing.assert_allclose(heard.harmonics[k, :4], expected, atol=0.01 * expected.max())
        # The first two stand in the spectrogram too, in the nearest of its frequencies (a window tells 1/T apart).
        for s in (1, 2):
            near = np.abs(heard.frequency - s * heard.mesh_frequency[k]).argmin()
            peak = heard.spectrum[k, near - 1 : near + 2].max(axis=0)
            # Hann's window loses at most 15 % between two of its frequencies, and the ramp smears as much again.
            assert (peak > 0.6 * expected[s - 1]).all()
            assert (peak < 1.1 * expected[s - 1] + 0.01 * expected.max()).all()


def test_a_run_of_a_few_samples_has_no_spectrogram() -> None:
    system = train()
    assert waterfall(system, ramp_response(system, Path(np.array([0.0, 3.0]), np.array([2.0, 2.2])), 12)) is None


def test_a_run_up_of_a_large_gearbox_takes_little_memory() -> None:
    """No matrix for each of its steps: 16384 at once, of 64 x 64 complex numbers, would be 1074 MB."""
    config = load(ROOT / "configs" / "design" / "gearbox_run_up.yaml", needs=("respond",))
    assert isinstance(config.respond, Respond)
    system = build(config.system)
    tracemalloc.start()
    found = ramp_response(system, path_of(config.respond), config.respond.samples_per_cycle)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(found.time) > 2**14
    assert peak < 300e6
