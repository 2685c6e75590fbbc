"""A further matrix, added to a system in one place, arrives wherever motions are propagated, or is refused.

The toy is a constant skew matrix on velocities. References are integrations of the equations of motion in physical
coordinates, to 1e-12 a step: a thousand steps leave 1e-9.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from driven import integrated, integrated_along, train

from gearstab.floquet import general, solve
from gearstab.floquet.truncation import neglected
from gearstab.mesh import PeriodicTerm, Rotation
from gearstab.methods import METHODS, OptionError
from gearstab.modal import mean_modes, static_equilibrium
from gearstab.passage.propagator import growth, motion
from gearstab.propagation.equation import Equation, excitation
from gearstab.propagation.first_order import bases
from gearstab.propagation.intervals import SteadyPoints
from gearstab.propagation.path import Path
from gearstab.propagation.phase import PhaseEquation
from gearstab.response import driven_response, ramp_response, steady_state
from gearstab.response.steady import start
from gearstab.system import Feature, GearSystem, unsupported
from gearstab.waveforms import Constant, Fourier, Trapezoidal

Array = np.ndarray

SKEW = np.array([[0.0, 0.3, -0.2], [-0.3, 0.0, 0.4], [0.2, -0.4, 0.0]])
OMEGA = 1.31
SMOOTH = Trapezoidal(1.47, 0.2), Fourier(np.array([0.4, 0.1]), np.array([0.2, 0.0]))


def bare(smooth: bool = False) -> GearSystem:
    system = train(Fraction(1, 2))
    waves = SMOOTH if smooth else [mesh.waveform for mesh in system.meshes]
    meshes = tuple(replace(mesh, waveform=wave) for mesh, wave in zip(system.meshes, waves, strict=True))
    return replace(system, meshes=meshes)


def toy(smooth: bool = False) -> GearSystem:
    system = bare(smooth)
    return replace(system, damping=system.damping + SKEW)


BOTH = pytest.mark.parametrize("smooth", [False, True])


def period(system: GearSystem) -> float:
    return float(2 * np.pi * system.common_period()[0] / OMEGA)


def propagated(system: GearSystem) -> Array:
    """The monodromy matrix of (q, q')."""
    return integrated(system.undriven(), OMEGA, np.eye(6), period(system))


@BOTH
def test_floquet_exponents(smooth: bool) -> None:
    found, without = (solve(s, np.array([OMEGA]), exponents=True).exponents[0, 0] for s in (toy(smooth), bare(smooth)))
    multipliers = np.linalg.eigvals(propagated(toy(smooth)))

    def distance(exponents: Array) -> float:
        gap = np.abs(np.exp(exponents * period(toy()))[:, None] - multipliers)
        return float(max(gap.min(axis=0).max(), gap.min(axis=1).max()))

    assert distance(found) < 1e-8
    assert distance(without) > 1e-2


@BOTH
def test_steady_state(smooth: bool) -> None:
    found, without = (steady_state(s, OMEGA, 8) for s in (toy(smooth), bare(smooth)))
    shift = integrated(toy(smooth), OMEGA, np.zeros(6), period(toy()))
    expected = np.linalg.solve(np.eye(6) - propagated(toy(smooth)), shift)
    np.testing.assert_allclose(np.concatenate([found.displacement[0], found.velocity[0]]), expected, atol=1e-8)
    assert np.abs(without.displacement[0] - expected[:3]).max() > 1e-2


@BOTH
def test_history(smooth: bool) -> None:
    q, v = np.array([0.1, -0.2, 0.3]), np.array([0.2, 0.1, -0.1])
    found, without = (driven_response(s, OMEGA, q, v, 20.0, 10) for s in (toy(smooth), bare(smooth)))
    expected = integrated(toy(smooth), OMEGA, np.concatenate([q, v]), float(found.time[-1]))
    np.testing.assert_allclose(np.concatenate([found.displacement[-1], found.velocity[-1]]), expected, atol=1e-8)
    assert np.abs(without.displacement[-1] - expected[:3]).max() > 1e-2


PATH = Path(np.array([0.0, 12.0]), np.array([1.0, 2.2]))


@BOTH
def test_run_up(smooth: bool) -> None:
    found, without = (ramp_response(s, PATH, 8) for s in (toy(smooth), bare(smooth)))
    rest = np.concatenate([static_equilibrium(toy()), np.zeros(3)])
    expected = integrated_along(toy(smooth), PATH, found.time, rest)
    # Magnus steps and quadrature work to about 1e-9.
    np.testing.assert_allclose(np.hstack([found.displacement, found.velocity]), expected, atol=1e-8)
    assert np.abs(without.displacement - expected[:, :3]).max() > 1e-2


def amplification(system: GearSystem, propagator: Array) -> float:
    """Largest ratio of the square roots of the energy of the mean system, after over before."""
    weight = np.zeros((6, 6))
    weight[:3, :3] = np.linalg.cholesky(system.mean_stiffness_matrix()).T
    weight[3:, 3:] = np.linalg.cholesky(system.mass).T
    return float(np.log(np.linalg.norm(weight @ propagator @ np.linalg.inv(weight), 2)))


@BOTH
def test_passage(smooth: bool) -> None:
    found, without = (growth(motion(s), PATH).through for s in (toy(smooth), bare(smooth)))
    expected = integrated_along(toy(smooth).undriven(), PATH, np.array([0.0, PATH.time[-1]]), np.eye(6))[-1]
    assert found == pytest.approx(amplification(toy(), expected), abs=1e-7)
    assert abs(without - found) > 1e-2


LEFT, RIGHT = np.array([0.1, -0.2, 0.05]), np.array([0.2, 0.3, -0.1])


def held(speed: float) -> GearSystem:
    """The bare system with Omega times the toy and Omega^2 u v^T, at one speed."""
    term = PeriodicTerm("hold", LEFT, RIGHT, stiffness=Constant(speed**2))
    return replace(bare(), damping=bare().damping + speed * SKEW, terms=(term,))


def turning() -> GearSystem:
    """The bare system with the toy in proportion to the mesh frequency, and u v^T to its square."""
    nothing = np.zeros((3, 3))
    own = Rotation(Fraction(1), gyroscopic=SKEW, circulatory=nothing, centripetal=np.outer(LEFT, RIGHT))
    return replace(bare(), rotations=(own,))


def test_what_goes_with_the_speed_is_constant_at_a_constant_speed() -> None:
    at, omega = np.zeros(2, dtype=int), np.array([OMEGA, 1.9])
    (form,) = bases(turning())
    found = start(SteadyPoints.of(Equation(form, excitation(bare())), at, omega)).x
    for speed, x in zip(omega, found, strict=True):
        equation = Equation(next(bases(held(speed))), excitation(held(speed)))
        expected = start(SteadyPoints.of(equation, at[:1], np.array([speed]))).x[0]
        np.testing.assert_allclose(x, expected, atol=1e-12 * np.abs(expected).max())


def test_floquet_exponents_with_what_goes_with_the_speed() -> None:
    omega = np.array([OMEGA, 1.9, 2.4])
    found = general.analyse(turning(), omega[None], exponents=True)
    for k, speed in enumerate(omega):
        expected = general.analyse(held(speed), omega[None, [k]], exponents=True)
        # The same matrices but for rounding, which a period of some thirty radians multiplies.
        np.testing.assert_allclose(found.growth_rate[0, k], expected.growth_rate[0, 0], rtol=1e-11)
        np.testing.assert_allclose(found.exponents[0, k], expected.exponents[0, 0], rtol=1e-9)


def test_what_goes_with_the_speed_changes_along_a_path() -> None:
    (form,) = bases(turning())
    time = np.linspace(0.0, PATH.time[-1], 30)
    begin = np.array([0.1, -0.2, 0.3, 0.2, 0.1, -0.1])
    x = PhaseEquation(form, excitation(bare())).follow(PATH, time, form.state(begin[:3], begin[3:], bare().mass))
    expected = integrated_along(turning(), PATH, time, begin)
    np.testing.assert_allclose(np.hstack([x @ form.outlet[0].T, x @ form.speed[0].T]), expected, atol=1e-8)


@pytest.mark.parametrize("name", [n for n, m in METHODS.items() if Feature.UNSYMMETRIC_DAMPING not in m.supports])
def test_a_method_that_does_not_declare_it_refuses(name: str) -> None:
    with pytest.raises(OptionError, match="symmetric damping matrix"):
        METHODS[name](None, toy()).require(METHODS[name].supports, METHODS[name].remedies)


def test_methods_that_take_the_first_order_form_declare_it() -> None:
    declared = {name for name, method in METHODS.items() if Feature.UNSYMMETRIC_DAMPING in method.supports}
    refuse = {"branches", "tongue_probability", "uncoupled"}
    assert declared == set(METHODS) - refuse
    assert unsupported(toy(), METHODS["floquet"].supports) is None


def test_modes_of_a_system_that_rotates_are_chosen_by_what_its_meshes_couple() -> None:
    system = turning()
    basis = mean_modes(system).shapes[:, :2]
    assert neglected(system, basis) == neglected(bare(), basis) > 0
