"""Driven response and periodic steady state of linear systems."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import mpmath as mp
import numpy as np
import pytest
from driven import (
    CASES,
    force_and_matrices,
    integrated,
    pair,
    series,
    train,
)
from hypothesis import given, settings
from hypothesis import strategies as st

import gearstab as gs
from gearstab.modal import static_equilibrium, static_mesh_force
from gearstab.propagation.segment import divided_exponential
from gearstab.response import RESPONSE_FLAGS, driven_response, free_response, harmonics, steady_state
from gearstab.response import steady as histories
from gearstab.response.spectra import amplitudes, densities
from gearstab.waveforms import Fourier


@pytest.mark.parametrize("name", CASES)
def test_the_steady_state_closes_under_numerical_integration(name: str) -> None:
    """From x(0) the equations in physical coordinates lead back to x(0) after a period, and through all samples."""
    system, omega = CASES[name]
    found = steady_state(system, omega, 20)
    start = np.concatenate([found.displacement[0], found.velocity[0]])
    third = len(found.time) // 3
    for sample in (third, -1):
        state = np.concatenate([found.displacement[sample], found.velocity[sample]])
        # DOP853 works to 1e-12 a step; smooth functions are followed to 1e-9 a period.
        np.testing.assert_allclose(state, integrated(system, omega, start, found.time[sample]), atol=2e-9)
    np.testing.assert_allclose(found.displacement[-1], found.displacement[0], atol=1e-11)
    assert found.status == "complete"
    assert "unstable" not in found.findings


def test_the_steady_state_is_where_long_integration_ends() -> None:
    system, omega = train(damping_ratio=0.7), 2.6
    found = steady_state(system, omega, 20)
    # What is left of the beginning: 1e-12.
    periods = int(np.ceil(np.log(1e12) / -found.growth_rate / found.common_period))
    state = integrated(system, omega, np.zeros(6), periods * found.common_period)
    np.testing.assert_allclose(state, np.concatenate([found.displacement[0], found.velocity[0]]), atol=1e-10)


@pytest.mark.parametrize("beta", [0.05, 0.0])
def test_one_motion_is_followed_as_by_the_maps_of_its_period(beta: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """A chain of 22 rotors under a sampled stiffness with kinks and a slow force: Runge-Kutta steps of the state
    against Magnus steps of the maps.
    """
    n = 22
    chain = 2.2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    wave = {"kind": "sampled", "phase": [0.0, 0.2, 0.5, 0.7], "stiffness": [1.0, 1.4, 0.8, 1.1]}
    mesh = {"name": "mesh", "direction": {"j8": 1.0, "j16": -0.6}, "mean_stiffness": 1.0, "epsilon": 0.2}
    force = {"name": "unbalance", "direction": {"j4": 1.0}, "sin": [1.0], "frequency_ratio": "1/2"}
    document = {"kind": "matrices", "units": "none", "coordinates": [f"j{k}" for k in range(1, n + 1)],
                "mass": np.eye(n).tolist(), "stiffness": chain.tolist(), "damping": {"rayleigh": [0.0, beta]},
                "meshes": [{**mesh, "waveform": wave}], "forces": [force]}  # fmt: skip
    system = gs.build(gs.load({"system": document}))
    start, cycles = np.linspace(0.0, 1.0, n), 5
    found = driven_response(system, 1.3, start, np.zeros(n), cycles * 2 * np.pi / 1.3, 16)
    monkeypatch.setattr(histories, "MAPS", np.inf)
    known = driven_response(system, 1.3, start, np.zeros(n), cycles * 2 * np.pi / 1.3, 16)
    assert len(found.time) == len(known.time) == 16 * cycles + 1
    for name in ("displacement", "velocity", "mesh_force"):
        a, b = getattr(found, name), getattr(known, name)
        # The maps are right to 1e-9 a period; bits would agree if both took the same way.
        assert 0 < np.abs(a - b).max() < 1e-8 * np.abs(b).max()


@pytest.mark.parametrize("name", ["piecewise constant", "unequal frequencies", "forces", "smooth waves", "friction"])
def test_every_driven_motion_ends_there(name: str) -> None:
    system, omega = CASES[name]
    found = steady_state(system, omega, 16)
    periods = int(np.ceil(np.log(1e14) / -found.growth_rate / found.common_period))
    motion = driven_response(system, omega, np.full(3, 0.3), np.zeros(3), periods * found.common_period, 16)
    kept = len(found.time)
    np.testing.assert_allclose(motion.displacement[-kept:], found.displacement, atol=1e-11)
    np.testing.assert_allclose(motion.mesh_force[-kept:], found.mesh_force, atol=1e-11)
    np.testing.assert_allclose(motion.energy[-kept:], found.energy, atol=1e-11)


@pytest.mark.parametrize("omega", [0.7, 1.9995, 2.0, 2.7])
def test_constant_stiffness_has_the_textbook_frequency_response(omega: float) -> None:
    """m x'' + c x' + k x = k e + c e' + f0: amplitude (k + i c nu)/(k - m nu^2 + i c nu) of each harmonic of e."""
    error = {"sin": [0.1, -0.05], "cos": [0.03, 0.02]}
    system = pair(load=[0.8], mesh={"transmission_error": error, "damping": 0.08})
    found = harmonics(system, omega, 3)
    nu = found.frequency
    np.testing.assert_allclose(nu, omega * np.arange(4), rtol=1e-14)
    driving = np.array([0, 0.03 - 0.1j, 0.02 + 0.05j, 0])
    deflection = driving * (4.0 + 0.08j * nu) / (4.0 - nu**2 + 0.08j * nu)
    deflection[0] = 0.8 / 4.0
    np.testing.assert_allclose(found.mesh_deflection[:, 0], deflection, atol=1e-12)
    np.testing.assert_allclose(found.mesh_force[:, 0], 4.0 * (deflection - driving), atol=1e-12)
    history = steady_state(system, omega, 32)
    expected = np.real(deflection @ np.exp(1j * nu[:, None] * history.time))
    np.testing.assert_allclose(history.displacement[:, 0], expected, atol=1e-12)


@pytest.mark.parametrize("ratio", [1.0, 1 + 1e-12, 1 + 1e-6, 0.999])
def test_critical_damping_has_no_eigenvectors_to_rely_on(ratio: float) -> None:
    """k = 4, m = 1, c = 4 zeta: the state falls back on matrix exponentials and closes as any other."""
    system = pair(load=[0.8], damping_ratio=ratio, mesh={"transmission_error": {"sin": [0.1]}})
    nu = 1.7
    amplitude = -0.1j * 4.0 / (4.0 - nu**2 + 4j * ratio * nu)
    found = steady_state(system, nu, 16)
    expected = 0.2 + np.real(amplitude * np.exp(1j * nu * found.time))
    np.testing.assert_allclose(found.displacement[:, 0], expected, atol=1e-12)


@given(
    a=st.complex_numbers(max_magnitude=50),
    step=st.complex_numbers(max_magnitude=30),
    scale=st.sampled_from([1, 1e-9, 0]),
)
def test_difference_quotients_of_the_exponential(a: complex, step: complex, scale: float) -> None:
    b = a + scale * step
    found = complex(divided_exponential(np.array(a), np.array(b)))
    with mp.workdps(60):
        x, y = mp.mpc(a), mp.mpc(b)
        exact = mp.exp(x) * (mp.expm1(y - x) / (y - x) if x != y else 1)
        # Both exponentials are right to |a| eps; that is what their difference can be.
        size = max(abs(mp.exp(x)), abs(mp.exp(y))) * min(1, 2 / abs(y - x) if x != y else 1)
    assert abs(found - complex(exact)) <= 4e-14 * float(size)


def test_undamped_resonance_from_rest_grows_linearly() -> None:
    """x'' + 4 x = 4 e sin 2t has x = e/2 (sin 2t - 2t cos 2t): the closed form holds at resonance too."""
    system = pair(mesh={"transmission_error": {"sin": [0.1]}})
    found = driven_response(system, 2.0, np.zeros(1), np.zeros(1), 50.0, 40)
    t = found.time
    np.testing.assert_allclose(found.displacement[:, 0], 0.05 * (np.sin(2 * t) - 2 * t * np.cos(2 * t)), atol=1e-11)
    assert steady_state(system, 2.0).status == "failed"
    assert "undamped" in steady_state(system, 2.1).findings


def test_work_over_a_period_is_dissipated() -> None:
    """Work of the load, of the transmission error and of the jumps of the stiffness equals the loss in the damping."""
    system, omega = train(), 2.6
    found = steady_state(system, omega, 200)
    mesh = system.meshes[0]

    def powers(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        error, rate = series(mesh.transmission_error, omega * t / (2 * np.pi))
        rate *= omega / (2 * np.pi)
        k = mesh.mean_stiffness * (1 + 2 * mesh.epsilon * mesh.waveform.value(np.asarray(omega * t / (2 * np.pi))))
        into_damper = mesh.damping * rate * (mesh.direction @ v)
        return np.array(
            [system.load @ v, -k * (mesh.direction @ q - error) * rate + into_damper, v @ system.damping @ v]
        )

    start = np.concatenate([found.displacement[0], found.velocity[0]])
    load, error, loss = integrated(system, omega, start, found.common_period, powers)[6:]
    # The energy jumps by dk (g q - e)^2/2, the mesh's strain energy before times dk/k.
    jumps = 0.0
    for item in system.meshes:
        edges = (item.waveform.breakpoints() + item.lag) % 1.0
        for edge, sign in zip(edges, (1, -1), strict=True):
            state = integrated(system, omega, start, edge * found.common_period) if edge > 0 else start
            deflection = item.direction @ state[:3]
            if item.transmission_error is not None:
                deflection -= series(item.transmission_error, edge)[0]
            jumps += sign * item.amplitude * deflection**2
    assert loss > 0.01
    # DOP853 to 1e-12 a step.
    assert load + error + jumps == pytest.approx(loss, abs=1e-9)
    assert load == pytest.approx(0.0, abs=1e-9)  # a constant force does no work over a closed path


def test_a_free_train_turns_under_an_unbalanced_load() -> None:
    """Without input shaft the train accelerates; its mesh forces settle all the same."""
    balanced = train(input_shaft_stiffness=0.0, load=[0.2, 0.0, -0.2])
    found = steady_state(balanced, 2.6, 20)
    assert "unbalanced" not in found.findings
    pushed = replace(balanced, load=balanced.load + 0.7 * balanced.mass @ np.array([1.0, -1.0, 1.0]))
    left_out = steady_state(pushed, 2.6, 20)
    assert "unbalanced" in left_out.findings
    np.testing.assert_allclose(left_out.displacement, found.displacement, atol=1e-12)
    periods = int(np.ceil(np.log(1e12) / -found.growth_rate / found.common_period))
    motion = driven_response(pushed, 2.6, np.zeros(3), np.zeros(3), periods * found.common_period, 20)
    np.testing.assert_allclose(motion.mesh_force[-21:], found.mesh_force, atol=1e-9)
    # 0.7 is the acceleration of the whole train along (1, -1, 1).
    rigid = balanced.mass @ np.array([1.0, -1.0, 1.0]) / np.trace(balanced.mass)
    assert motion.displacement[-1] @ rigid == pytest.approx(0.35 * motion.time[-1] ** 2, rel=1e-10)


def test_a_train_that_bearings_hold_back_turns_steadily() -> None:
    """C = alpha M: the mean velocity of the rigid motion is (r . f)/(alpha r . M r)."""
    system = train(
        input_shaft_stiffness=0.0, damping_ratio=0.0, damping={"rayleigh": [0.1, 0.05]}, load=[0.2, 0.1, 0.3]
    )
    found = steady_state(system, 2.6, 20)
    rigid = np.array([1.0, -1.0, 1.0])
    speed = rigid @ system.load / (0.1 * rigid @ system.mass @ rigid)
    np.testing.assert_allclose(found.drift, speed * rigid, rtol=1e-10)
    np.testing.assert_allclose(found.displacement[-1], found.displacement[0], atol=1e-12)
    # In the frame that moves along, the rest of the load is balanced by the bearings' drag.
    rest = replace(system, load=system.load - 0.1 * speed * system.mass @ rigid)
    np.testing.assert_allclose(steady_state(rest, 2.6, 20).mesh_force, found.mesh_force, atol=1e-12)


def test_an_unstable_steady_state_is_computed_and_flagged() -> None:
    system = pair(load=[1.0], damping_ratio=0.01, mesh={"epsilon": 0.4})
    found = steady_state(system, 4.0, 50)
    assert found.growth_rate > 0
    assert "unstable" in found.findings
    start = np.array([found.displacement[0, 0], found.velocity[0, 0]])
    np.testing.assert_allclose(integrated(system, 4.0, start, found.common_period), start, atol=1e-10)


def test_harmonics_are_the_fourier_series_of_the_history() -> None:
    """The force jumps, so that its series converges slowly; Parseval's sum over many harmonics shows it."""
    system, omega = train(Fraction(2, 3)), 1.31
    found, series_of = steady_state(system, omega, 400), harmonics(system, omega, 400)
    turn = np.exp(1j * series_of.frequency[:, None] * found.time)
    rebuilt = np.real(np.einsum("hi,ht->ti", series_of.mesh_deflection, turn))
    # The deflection has jumps in its second derivative: coefficients fall as h^-3, their rest as 400^-2.
    np.testing.assert_allclose(rebuilt, found.mesh_deflection, atol=5e-6)
    squares = np.abs(series_of.mesh_force) ** 2
    power = squares[0] + squares[1:].sum(axis=0) / 2
    # The rest of a series with coefficients ~ 1/h is ~ 1/400; samples see jumps to half a step.
    np.testing.assert_allclose(power, np.mean(found.mesh_force[:-1] ** 2, axis=0), rtol=2e-3)


def test_static_equilibrium_and_rest() -> None:
    system = train(epsilon=0.0)
    q = static_equilibrium(system)
    np.testing.assert_allclose(system.mean_stiffness_matrix() @ q, system.load, atol=1e-14)
    still = replace(system, meshes=tuple(replace(mesh, transmission_error=None) for mesh in system.meshes))
    found = driven_response(still, 1.3, q, np.zeros(3), 100.0, 20)
    np.testing.assert_allclose(found.displacement, np.broadcast_to(q, found.displacement.shape), atol=1e-13)
    np.testing.assert_allclose(found.mesh_force[-1], static_mesh_force(system), atol=1e-13)
    np.testing.assert_allclose(steady_state(still, 1.3, 20).displacement[7], q, atol=1e-13)


def test_a_system_that_nothing_drives() -> None:
    free = replace(train(), load=None, meshes=tuple(replace(m, transmission_error=None) for m in train().meshes))
    with pytest.raises(ValueError, match="nothing drives"):
        steady_state(free, 1.0)
    q, v = np.array([0.1, -0.2, 0.05]), np.zeros(3)
    driven = driven_response(free, 1.3, q, v, 40.0, 20)
    # Two propagators: exponentials of augmented matrices here, modes and matrix exponentials there.
    np.testing.assert_allclose(
        driven.displacement, free_response(train(), 1.3, q, v, 40.0, 20).displacement, atol=1e-13
    )


def test_teeth_that_would_separate_are_flagged() -> None:
    light = pair(load=[0.001], damping_ratio=0.05, mesh={"epsilon": 0.2, "transmission_error": {"sin": [0.1]}})
    assert "separation" in steady_state(light, 1.7).findings
    assert "separation" not in steady_state(replace(light, load=np.array([5.0])), 1.7).findings


@settings(max_examples=10, deadline=None)
@given(omega=st.floats(0.6, 4.0), load=st.floats(-1, 1), error=st.floats(-0.2, 0.2))
def test_the_steady_state_is_linear_in_what_drives(omega: float, load: float, error: float) -> None:
    base = train(damping_ratio=0.2)
    first, second = base.meshes

    def of(f: float, e: float) -> np.ndarray:
        wave = Fourier(np.array([e, 0.0]), np.array([0.0, 0.3 * e]))
        meshes = (replace(first, transmission_error=wave), second)
        return steady_state(replace(base, load=f * np.array([0.2, 0, 0.5]), meshes=meshes), omega, 8).mesh_force

    parts = load * of(1.0, 0.0) + error * of(0.0, 1.0)
    np.testing.assert_allclose(of(load, error), parts, atol=1e-12 * (1 + np.abs(parts).max()))


def test_densities_hold_the_variance() -> None:
    """One-sided: the integral over the frequency is the variance (of many periods, whatever the window)."""
    system = pair(load=[1.0], damping_ratio=0.02, mesh={"epsilon": 0.2, "transmission_error": {"sin": [0.1]}})
    begin = steady_state(system, 1.3)
    found = driven_response(system, 1.3, begin.displacement[0], begin.velocity[0], 3000.0, 64)
    spectra = densities(found)
    assert spectra is not None
    width = spectra.frequency[1] - spectra.frequency[0]
    np.testing.assert_allclose(spectra.force.sum(axis=0) * width, found.mesh_force.var(axis=0), rtol=1e-3)
    table = amplitudes(harmonics(system, 1.3, 20))
    largest = table.frequency[table.peak_index[:3]]
    np.testing.assert_allclose(spectra.frequency[spectra.peak_index[:3]], largest, atol=width)
    assert np.all(np.diff(table.force[table.peak_index, table.peak_mesh]) <= 0)


def test_flags_are_powers_of_two() -> None:
    bits = list(RESPONSE_FLAGS.values())
    assert len(set(bits)) == len(bits)
    assert all(bit & (bit - 1) == 0 for bit in bits)


def test_the_reference_knows_the_equation() -> None:
    """At t = 0 by hand: k_1 = 1 + 0.6 (1 - 0.47) is stiff, e = 0.03, de/dt = 2.6 (0.1 + 2 0.02)."""
    system = train(damping_ratio=0.0)
    force, stiffness, damping = force_and_matrices(system, 2.6, 0.0)
    k = 1 + 0.6 * 0.53
    np.testing.assert_allclose(force, [0.2 + k * 0.03 + 0.05 * 2.6 * 0.14, k * 0.03 + 0.05 * 2.6 * 0.14, 0.5])
    assert stiffness[0, 0] == pytest.approx(0.5 + k)
    assert damping[0, 0] == pytest.approx(0.05)
