"""Laws of the stability of any system: bounds, limits and symmetries, on random ones."""

import copy
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from random_documents import Document, gear_pairs, matrices, two_stages
from scenes import examples

from gearstab.config import load
from gearstab.floquet import FloquetStability, solve
from gearstab.mesh import Mesh
from gearstab.system import GearSystem
from gearstab.systems import build
from gearstab.waveforms import Fourier, Rectangular, Trapezoidal

SYSTEMS = gear_pairs() | two_stages() | matrices()
FREQUENCIES = st.lists(st.floats(0.3, 6.0), min_size=3, max_size=3).map(np.array)


def built(document: Document, *, damped: bool = False) -> GearSystem:
    """A system with a common period, without damping unless that is asked for."""
    system = build(load({"system": document}).system)
    assume(system.commensurate)
    if not damped:
        meshes = tuple(replace(mesh, damping=0.0) for mesh in system.meshes)
        system = replace(system, damping=None, meshes=meshes)
    return system


def same(found: FloquetStability, expected: FloquetStability, period: np.ndarray, scale: float = 1.0) -> None:
    """Whether growth per period agrees: up to 1e-4 for 1e-9 of the multipliers, whose roots count where two meet."""
    np.testing.assert_allclose(found.growth_rate / scale * period, expected.growth_rate * period, rtol=1e-5, atol=1e-4)
    sure = np.abs(expected.growth_rate * period) > 1e-3
    np.testing.assert_array_equal(found.stable[sure], expected.stable[sure])


def period_of(system: GearSystem, frequency: np.ndarray) -> np.ndarray:
    return 2 * np.pi * system.common_period()[0] / frequency


def checked_units(document: Document, frequency: np.ndarray, mass: float, time: float) -> None:
    """Other units of mass and time, from the document on, change growth rates by that of time alone."""
    system, stiffness, damping = built(document, damped=True), mass / time**2, mass / time
    factors = {"mass": mass, "equivalent_mass": mass, "inertias": mass, "stiffness": stiffness}
    factors["input_shaft_stiffness"] = stiffness
    other = {key: times(value, factors.get(key)) for key, value in document.items()}
    other["meshes"] = [
        {**mesh, "mean_stiffness": mesh["mean_stiffness"] * stiffness, "damping": mesh.get("damping", 0.0) * damping}
        for mesh in document["meshes"]
    ]
    given = document.get("damping", {})
    if "matrix" in given:
        other["damping"] = {"matrix": times(given["matrix"], damping)}
    if "rayleigh" in given:
        other["damping"] = {"rayleigh": [given["rayleigh"][0] / time, given["rayleigh"][1] * time]}
    found = solve(built(other, damped=True), frequency / time)
    same(found, solve(system, frequency), period_of(system, frequency), 1 / time)


def times(value: Any, factor: float | None) -> Any:
    """A number, or all numbers in lists, times a factor."""
    if factor is None:
        return copy.deepcopy(value)
    return [times(item, factor) for item in value] if isinstance(value, list) else value * factor


def checked_order(document: Document, frequency: np.ndarray) -> None:
    """The order of meshes is of no account; that of the first one sets which frequency is the reference."""
    system = built(document, damped=True)
    first, second = copy.deepcopy(document["meshes"])
    ratio = Fraction(second.pop("frequency_ratio"))
    first["frequency_ratio"] = str(1 / ratio)
    other = built({**document, "meshes": [second, first]}, damped=True)
    same(solve(other, frequency * float(ratio)), solve(system, frequency), period_of(system, frequency))


def reversed_in_time(mesh: Mesh) -> Mesh:
    """The mesh whose stiffness at t is that of this one at -t."""
    wave = mesh.waveform
    if isinstance(wave, Fourier):
        return replace(mesh, waveform=replace(wave, sin=-np.asarray(wave.sin)), lag=-np.asarray(mesh.lag))
    assume(isinstance(wave, Rectangular | Trapezoidal))
    # Symmetric about the middle of what is stiff, which lasts from phase 0 to d.
    return replace(mesh, lag=-(np.asarray(mesh.lag) + np.asarray(wave.contact_ratio) % 1))


def checked_time(document: Document, frequency: np.ndarray) -> None:
    """Without damping multipliers come in pairs lambda, 1/lambda: time may run backwards."""
    system = built(document)
    other = replace(system, meshes=tuple(reversed_in_time(mesh) for mesh in system.meshes))
    same(solve(other, frequency), solve(system, frequency), period_of(system, frequency))


def checked_bound(document: Document, frequency: np.ndarray) -> None:
    """With the energy E of the mean system dE/dt <= max |M^-1/2 K_v K^-1/2| E, and amplitudes grow half as fast."""
    system = built(document)
    mean = system.stiffness + sum(mesh.mean_stiffness * mesh.outer for mesh in system.meshes)
    values, vectors = np.linalg.eigh(mean)
    # Rigid-body motions have no such energy.
    assume(values.min() > 1e-6 * values.max())
    soft, light = vectors / np.sqrt(values), np.diag(1 / np.sqrt(np.diag(system.mass)))
    assume(np.count_nonzero(system.mass - np.diag(np.diag(system.mass))) == 0)
    bound = 0.0
    for mesh in system.meshes:
        most = np.abs(2 * mesh.amplitude * np.array(mesh.waveform.extremes())).max()
        bound += 0.5 * most * np.linalg.norm(light @ mesh.direction) * np.linalg.norm(soft.T @ mesh.direction)
    found = solve(system, frequency)
    assert np.all(found.growth_rate <= bound + 1e-4 / period_of(system, frequency))
    assert np.all(found.growth_rate >= -1e-4 / period_of(system, frequency))


def checked_limit(document: Document, frequency: np.ndarray) -> None:
    """Constant stiffness that is positive is stable, with damping or without."""
    for damped in (False, True):
        system = built(document, damped=damped)
        mean = system.stiffness + sum(mesh.mean_stiffness * mesh.outer for mesh in system.meshes)
        assume(np.linalg.eigvalsh(mean).min() > 0)
        drag = np.zeros_like(mean) if system.damping is None else system.damping
        total = drag + sum(np.asarray(mesh.damping) * mesh.outer for mesh in system.meshes)
        assume(np.linalg.eigvalsh(total).min() >= 0)
        constant = replace(system, meshes=tuple(replace(mesh, epsilon=np.zeros(())) for mesh in system.meshes))
        found = solve(constant, frequency)
        assert np.all(found.stable == 1)
        assert np.all(found.growth_rate <= 1e-9)


SCALES = st.sampled_from([1e-3, 0.7, 40.0])


@pytest.mark.parametrize("law", [checked_time, checked_bound, checked_limit], ids=lambda law: law.__name__)
@examples(15, 400)
@given(document=SYSTEMS, frequency=FREQUENCIES)
def test_laws(law, document: Document, frequency: np.ndarray) -> None:
    law(document, frequency)


@examples(15, 400)
@given(document=SYSTEMS, frequency=FREQUENCIES, mass=SCALES, time=SCALES)
def test_units(document: Document, frequency: np.ndarray, mass: float, time: float) -> None:
    checked_units(document, frequency, mass, time)


@examples(15, 400)
@given(document=matrices().filter(lambda system: len(system["meshes"]) == 2), frequency=FREQUENCIES)
def test_order(document: Document, frequency: np.ndarray) -> None:
    checked_order(document, frequency)
