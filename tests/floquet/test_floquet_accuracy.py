"""Characteristic exponents against the high-precision reference: 1e-12 of the largest |exponent|, or 1e-12.

The bound is the documented accuracy of the solver; what rounding leaves is 1e-16..1e-14. The frequencies are generic:
on the edge of an instability region two exponents coincide and depend on any parameter like a square root, so that no
solver in double precision can be better than 1e-8 there.
"""

from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from oracle import assert_exponents_match, plain, solve
from systems import pair, unequal

from gearstab.floquet import solve as analyse
from gearstab.systems import build

Parameters = dict[str, Any]


def mesh_damped(tooth_ratio: Fraction) -> Parameters:
    parameters = unequal(tooth_ratio)
    parameters["meshes"][1]["damping"] = 0.05
    return parameters


FULL_DAMPING = [[0.05, 0.01, 0.0], [0.01, 0.03, -0.02], [0.0, -0.02, 0.09]]
DAMPED: dict[str, dict[str, Any]] = {
    "undamped": {},
    "modal": {"damping_ratio": 0.02},
    "rayleigh": {"damping": {"rayleigh": [0.01, 0.02]}},
    "mass proportional": {"damping": {"rayleigh": [0.03, 0.0]}},
    "matrix": {"damping": {"matrix": FULL_DAMPING}},
    "overdamped": {"damping_ratio": 1.7},
}


def general(epsilon: float = 0.3, **changes: Any) -> Parameters:
    """Five coordinates, full matrices, three meshes at the frequency ratios 1, 1/2, 3, a contact ratio above 2."""
    mass = np.diag([1.0, 0.4, 2.5, 0.8, 1.6]) + 0.1 * np.ones((5, 5))
    chain = 2.0 * np.eye(5) - np.eye(5, k=1) - np.eye(5, k=-1)
    stiffness = 0.7 * chain + np.diag([0.3, 0.0, 0.1, 0.0, 0.6])
    meshes = [
        ([1.0, -0.8, 0.0, 0.2, 0.0], 1.2, epsilon, 2.35, 0.0, Fraction(1)),
        ([0.0, 0.5, 1.0, 0.0, -0.3], 0.9, 0.7 * epsilon, 1.6, 0.15, Fraction(1, 2)),
        ([0.1, 0.0, -0.4, 1.0, 0.9], 1.5, 0.9 * epsilon, 1.25, 0.4, Fraction(3)),
    ]
    names = ("direction", "mean_stiffness", "epsilon", "contact_ratio", "lag", "frequency_ratio")
    listed = [dict(zip(names, mesh, strict=True)) | {"name": f"mesh {i}"} for i, mesh in enumerate(meshes)]
    return {"kind": "matrices", "mass": mass, "stiffness": stiffness, "meshes": listed} | changes


def check(parameters: Parameters, omegas: list[float]) -> None:
    """Every exponent of every frequency, and the growth rate, the largest real part of the elastic ones."""
    system = build(parameters)
    found = analyse(system, np.array(omegas), exponents=True)
    growth = np.ravel(found.growth_rate)
    assert found.exponents is not None
    exponents = np.reshape(found.exponents, (len(omegas), 2 * system.size))
    for i, omega in enumerate(omegas):
        reference = solve(plain(system), omega)
        expected = reference.all_exponents()
        assert_exponents_match(exponents[i], expected, float(reference.period))
        assert growth[i] == pytest.approx(
            reference.growth_rate, rel=0, abs=max(1e-12, 1e-12 * np.max(np.abs(expected)))
        )


@pytest.mark.parametrize("damping", DAMPED)
@pytest.mark.parametrize(
    "tooth_ratio", [Fraction(1), pytest.param(Fraction(2, 3), marks=pytest.mark.slow), Fraction(1, 2)], ids=str
)
def test_two_stage(tooth_ratio: Fraction, damping: str) -> None:
    check(unequal(tooth_ratio, **DAMPED[damping]), [0.37, 2.03, 5.41])


@pytest.mark.parametrize("tooth_ratio", [Fraction(1), Fraction(2, 3)], ids=str)
def test_damping_of_a_mesh(tooth_ratio: Fraction) -> None:
    check(mesh_damped(tooth_ratio), [0.37, 2.03])


@pytest.mark.parametrize("damping", ["undamped", "modal", "matrix"])
def test_low_mesh_frequency(damping: str) -> None:
    """A common period of some 1700 radians of the highest mode."""
    check(unequal(Fraction(2, 3), **DAMPED[damping]), [0.01])


@pytest.mark.parametrize("damping", ["undamped", "modal"])
@pytest.mark.parametrize("tooth_ratio", [Fraction(1), Fraction(2, 3)], ids=str)
def test_strong_excitation(tooth_ratio: Fraction, damping: str) -> None:
    # epsilon 0.9, 0.72 with these contact ratios leaves the softer levels at 0.154 and 0.197.
    check(unequal(tooth_ratio, 0.9, **DAMPED[damping]), [0.11, 1.73])


@pytest.mark.parametrize("damping", ["undamped", "modal", "matrix"])
def test_negative_stiffness(damping: str) -> None:
    check(unequal(Fraction(1), 2.4, allow_negative_stiffness=True, **DAMPED[damping]), [0.9, 3.1])


OVERFLOWING = 0.007


SLOW = pytest.mark.slow
"""For 40 digits of long periods, of which one each stays."""


@pytest.mark.parametrize("damping", ["undamped", pytest.param("modal", marks=SLOW), pytest.param("matrix", marks=SLOW)])
def test_multipliers_beyond_the_range_of_doubles(damping: str) -> None:
    """Growth by more than 1e308 and decay by as much within one period."""
    parameters = unequal(Fraction(1), 3.0, allow_negative_stiffness=True, **DAMPED[damping])
    check(parameters, [OVERFLOWING])
    assert abs(solve(plain(build(parameters)), OVERFLOWING).multipliers[0]) > 1e308


@pytest.mark.slow
@pytest.mark.parametrize("damping", ["undamped", "matrix"])
def test_multipliers_far_beyond_the_range_of_doubles(damping: str) -> None:
    """|lambda| around 1e1200."""
    check(unequal(Fraction(1), 3.0, allow_negative_stiffness=True, **DAMPED[damping]), [0.002])


def test_a_level_of_zero() -> None:
    """epsilon = 1, c = 1.5: the softer level of the first mesh is exactly zero."""
    parameters = unequal(Fraction(1), 1.0)
    parameters["meshes"][0]["contact_ratio"] = 1.5
    check(parameters, [0.63, 2.9])
    check(pair({"mean_stiffness": 1.3, "epsilon": 1.0}, equivalent_mass=0.7), [0.63, 2.9])


@pytest.mark.parametrize("damping", DAMPED)
@pytest.mark.parametrize("tooth_ratio", [Fraction(1), Fraction(2, 3)], ids=str)
def test_rigid_body_mode(tooth_ratio: Fraction, damping: str) -> None:
    # The full matrix couples the rigid velocity to the elastic modes; the others leave it free or decaying on its own.
    check(unequal(tooth_ratio, input_shaft_stiffness=0.0, **DAMPED[damping]), [0.53, 2.03])


@pytest.mark.parametrize("damping", ["undamped", "modal", "rayleigh", "overdamped"])
@pytest.mark.parametrize(("epsilon", "contact_ratio"), [(0.3, 1.5), (0.9, 1.47), (0.4, 2.85), (2.5, 1.6), (0.3, 2.0)])
def test_gear_pair(epsilon: float, contact_ratio: float, damping: str) -> None:
    mesh = {"mean_stiffness": 1.3, "epsilon": epsilon, "contact_ratio": contact_ratio}
    check(pair(mesh, equivalent_mass=0.7, **DAMPED[damping]), [0.01, 0.41, 2.21, 9.7])


@pytest.mark.parametrize("damping", [{}, {"damping_ratio": 0.02}], ids=["undamped", "modal"])
def test_five_coordinates_and_three_meshes(damping: dict[str, Any]) -> None:
    check(general(**damping), [1.31])


@pytest.mark.slow
@pytest.mark.parametrize("epsilon", [0.1, 0.9])
@pytest.mark.parametrize(
    "damping",
    [
        {},
        {"damping_ratio": 0.02},
        {"damping": {"rayleigh": [0.01, 0.02]}},
        {"damping": {"modal": [0, 0.1, 0, 0.2, 0.05]}},
    ],
    ids=["undamped", "modal", "rayleigh", "unequal"],
)
def test_five_coordinates_over_the_frequencies(epsilon: float, damping: dict[str, Any]) -> None:
    check(general(epsilon, **damping), [0.01, 0.23, 0.87, 4.9])


@pytest.mark.slow
@pytest.mark.parametrize("damping", DAMPED)
@pytest.mark.parametrize("tooth_ratio", [Fraction(1), Fraction(2, 3), Fraction(1, 2), Fraction(3, 5)], ids=str)
def test_two_stage_over_the_frequencies(tooth_ratio: Fraction, damping: str) -> None:
    # The reference follows a decay by thousands of digits at 0.01: beyond its means.
    slowest = 0.13 if damping == "overdamped" else 0.01
    for epsilon in (0.02, 0.9):
        check(unequal(tooth_ratio, epsilon, **DAMPED[damping]), [slowest, 0.71, 2.77, 6.83])


@pytest.mark.slow
def test_many_segments() -> None:
    """Incommensurate in practice: a common period of 143 cycles of the second mesh, some 500 segments."""
    check(unequal(Fraction(127, 143)), [1.37])
