"""First-order tongues with matrices that act with a speed of rotation, and of unsymmetric systems.

tongues.json holds tongues of undamped gyroscopic systems by the Krein signatures of their motions,
tongues_two_meshes.json growth by the amplitude equations, both beside exact Floquet analysis.
"""

import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearstab.floquet import solve
from gearstab.mesh import Mesh, Rotation
from gearstab.methods import METHODS, OptionError
from gearstab.perturbation import first_order
from gearstab.perturbation.whirling import resonance_of, whirling_rows
from gearstab.system import GearSystem
from gearstab.waveforms import Rectangular

Array = np.ndarray
DATA = Path(__file__).parents[1] / "data" / "rotation"
SIGNATURES = json.loads((DATA / "tongues.json").read_text())["cases"]
TWO_MESHES = json.loads((DATA / "tongues_two_meshes.json").read_text())["cases"]


def built(given: dict[str, Any], epsilon: float, held: float | None = None, scale: float = 1.0) -> GearSystem:
    """A case; epsilon: what every mesh's own one, or 1, is multiplied by; scale: that of damping and cross-coupling."""
    meshes = tuple(
        Mesh(
            m["name"], np.array(m["direction"]), np.asarray(m["mean_stiffness"]),
            np.asarray(epsilon * (m["epsilon"] or 1.0)), Rectangular(m["contact_ratio"]), lag=m["lag"],
        )
        for m in given["meshes"]
    )  # fmt: skip
    held = given.get("speed_held", held)
    ratio = Fraction(given["speed_ratio"]) if held is None else None
    matrices = {name: np.array(given[name]) for name in ("gyroscopic", "centripetal")}
    rotations = [Rotation(ratio, held or 0.0, **matrices)]
    if "circulatory" in given:
        rotations.append(Rotation(None, 1.0, circulatory=scale * np.array(given["circulatory"])))
    damping = scale * np.array(given["damping"]) if "damping" in given else None
    return GearSystem(
        np.array(given["mass"]), np.array(given["stiffness"]), meshes, damping, rotations=tuple(rotations)
    )


def named(system: GearSystem, tongue: dict[str, Any]) -> tuple[float, float, float, Array]:
    """(centre, half-width, threshold, ends) of one tongue of a single system."""
    found = first_order(system, 3)
    p, q = sorted((tongue["mode_p"], tongue["mode_q"]))
    (k,) = (
        k for k, own in enumerate(found.index)
        if (own.mode_p, own.mode_q, own.harmonic) == (p, q, tongue["harmonic"])
        and own.difference == (tongue["type"] == "difference")
    )  # fmt: skip
    values = (found.center_frequency[k], found.half_width[k], found.threshold[k])
    return *map(float, values), found.boundary_frequency[k]


IN_40_DIGITS = {
    (1, 1, 1): 0.092434116744982729, (2, 2, 1): 0.36523489887224435, (1, 2, 1): 0.1937236210746736,
    (1, 2, 2): 0.013489821421260241,
}  # fmt: skip
"""Half-widths over epsilon of the first case from the closed form of two coordinates (mpmath), derivatives included."""
CASES = [(case["system"], tongue) for case in SIGNATURES for tongue in case["tongues"]]


@pytest.mark.parametrize(("given", "tongue"), CASES)
def test_tongues_by_signature(given: dict[str, Any], tongue: dict[str, Any]) -> None:
    epsilon = 1e-3
    center, half, threshold, _ = named(built(given, epsilon), tongue)
    assert center == pytest.approx(tongue["centre_mesh_frequency"], rel=1e-10)
    expected = tongue["half_width_over_epsilon_first_order"]
    # What is forbidden is so exactly. Where speeds follow, dw/dOmega is a difference in the reference: nine digits.
    assert half == pytest.approx(epsilon * expected, rel=1e-10 if "speed_held" in given else 5e-9, abs=0)
    key = tongue["mode_p"], tongue["mode_q"], tongue["harmonic"]
    if "speed_held" not in given and key in IN_40_DIGITS:
        assert half == pytest.approx(epsilon * IN_40_DIGITS[key], rel=1e-12)
    assert threshold == (0.0 if expected else np.inf)


def edge(system: GearSystem, stable: float, unstable: float) -> float:
    """The boundary between two mesh frequencies, by the sign of the growth."""
    for _ in range(45):
        middle = 0.5 * (stable + unstable)
        if solve(system, np.array([middle])).stable[0, 0]:
            stable = middle
        else:
            unstable = middle
    return 0.5 * (stable + unstable)


OPEN = [(given, tongue) for given, tongue in CASES if tongue["half_width_over_epsilon_first_order"] > 0]


@pytest.mark.parametrize(("given", "tongue"), OPEN)
def test_errors_of_boundaries_fall_with_the_square_of_epsilon(given: dict[str, Any], tongue: dict[str, Any]) -> None:
    errors = []
    for epsilon in (0.04, 0.02):
        system = built(given, epsilon)
        center, half, _, ends = named(system, tongue)
        found = [edge(system, center + 1.9 * side * half, center) for side in (-1, 1)]
        errors.append(np.abs(np.array(found) - ends).max())
    # Four, but for terms of the third order.
    assert 3.0 < errors[0] / errors[1] < 5.6 or errors[0] < 1e-7


ROWS = [(case["system"] | {"speed_held": case["speed_held"]}, row) for case in TWO_MESHES for row in case["rows"]]


@pytest.mark.parametrize(("given", "row"), ROWS)
def test_boundaries_lie_where_the_growth_of_the_amplitude_equations_is_zero(
    given: dict[str, Any], row: dict[str, Any]
) -> None:
    """Boundaries of both scales: at the offset of the reference, inside or outside, and at its centre."""
    for scale, growth in zip(row["scales"], row["first_order_growth_over_scale"], strict=True):
        system = built(given, scale, given["speed_held"], scale)
        center, half, _, (low, high) = named(system, row)
        (mean,) = whirling_rows(system)
        if mean.frequencies(np.ones(1))[1].max() > 0:
            # Damping to the housing drives a motion of negative signature.
            assert np.isinf(half)
            continue
        at = center + scale * row["offset_of_mesh_frequency_over_scale"]
        assert (low < at < high) == (growth > 1e-9)
        p, q = sorted((row["mode_p"], row["mode_q"]))
        assert _growth(mean, at, center, p, q, row) / scale == pytest.approx(growth, rel=1e-8, abs=1e-9)
        for end in (low, high):
            # Without damping the growth is the root of the distance from the edge, which is known to 1e-16.
            assert abs(_growth(mean, float(end), center, p, q, row)) < 1e-9


def _growth(mean: Any, at: float, center: float, p: int, q: int, row: dict[str, Any]) -> float:
    """The larger growth of two amplitudes at a mesh frequency, from the equations of the docstring alone."""
    from gearstab.perturbation.tongues import excitations

    difference = row["type"] == "difference"
    force = next(f for f in excitations(mean.system, 3) if f.ratio == row["harmonic"])
    (motions,) = mean._motions(np.array([center]))
    first, second = ([q - 1], [p - 1]) if difference else ([p - 1], [q - 1])
    parts = mean._harmonics(force)
    (((there,),), _), (((back,),), _) = (
        motions.coupling(first, second, parts, not difference),
        motions.coupling(second, first, parts, not difference, conjugate=True),
    )
    sigma = row["harmonic"] * (at - center)
    rates = motions.exponent.real
    matrix = [[rates[first[0]] - 0.5j * sigma, there], [back, rates[second[0]] + 0.5j * sigma]]
    return float(np.linalg.eigvals(np.array(matrix)).real.max())


def train(damping: Array | None, epsilon: float = 0.02) -> GearSystem:
    mass = np.diag([1.0, 2.0, 1.5])
    stiffness = np.array([[2.0, -1.0, 0.0], [-1.0, 3.0, -0.5], [0.0, -0.5, 1.0]])
    one = Mesh("one", np.array([1.0, -0.5, 0.2]), np.asarray(0.8), np.asarray(epsilon), Rectangular(1.4))
    two = Mesh("two", np.array([0.1, 0.7, -1.0]), np.asarray(0.6), np.asarray(0.7 * epsilon), Rectangular(1.7), lag=0.3)
    return GearSystem(mass, stiffness, (one, two), damping)


SMALL = 1e-6


@pytest.mark.parametrize("damped", [False, True])
def test_symmetric_systems_are_a_special_case(damped: bool) -> None:
    """Against the theory of real modes, whose damping is small: errors are of its square."""
    damping = SMALL * np.array([[0.1, 0.02, 0.0], [0.02, 0.2, 0.0], [0.0, 0.0, 0.3]]) if damped else None
    plain = train(damping, SMALL)
    turning = replace(plain, rotations=(Rotation(Fraction(1), gyroscopic=np.zeros((3, 3))),))
    expected, found = first_order(plain, 2), first_order(turning, 2)
    place = {own: k for k, own in enumerate(found.index)}
    chosen = [place[own] for own in expected.index]
    np.testing.assert_allclose(found.center_frequency[chosen], expected.center_frequency, rtol=1e-11)
    np.testing.assert_allclose(found.half_width[chosen], expected.half_width, rtol=1e-5, atol=SMALL**2)
    np.testing.assert_allclose(found.threshold[chosen], expected.threshold, rtol=1e-5)
    others = np.setdiff1d(np.arange(len(found.index)), chosen)
    # Differences of equal signatures.
    assert all(found.index[k].difference for k in others)
    np.testing.assert_array_equal(found.half_width[others], 0.0)


def test_unsymmetric_damping_with_a_skew_part_is_that_of_a_held_speed() -> None:
    skew = np.array([[0.0, 0.2, 0.0], [-0.2, 0.0, 0.1], [0.0, -0.1, 0.0]])
    plain = train(0.01 * np.eye(3))
    one = first_order(replace(plain, damping=plain.damping + 0.7 * skew), 2)
    other = first_order(replace(plain, rotations=(Rotation(None, 0.7, gyroscopic=skew),)), 2)
    assert one.index == other.index
    for name in ("center_frequency", "half_width", "threshold", "boundary_frequency"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-10)


@pytest.mark.parametrize("damping", [0.0, 0.002])
def test_groups_of_equal_frequencies(damping: float) -> None:
    """Two equal rotors side by side: their motions of one frequency have one tongue, whichever vectors they have."""
    skew = np.array([[0.0, -1.0], [1.0, 0.0]])
    twice = [np.kron(np.eye(2), own) for own in (np.eye(2), np.diag([1.0, 1.6]), skew)]
    meshes = tuple(
        Mesh(name, np.array(g), np.asarray(1.0), np.asarray(0.02), Rectangular(1.45), lag=lag)
        for name, g, lag in (("one", [0.8, 0.6, 0.0, 0.0], 0.0), ("two", [0.0, 0.0, 0.8, 0.6], 0.3))
    )
    system = GearSystem(
        twice[0], twice[1], meshes, damping * np.eye(4), rotations=(Rotation(Fraction(1, 8), gyroscopic=twice[2]),)
    )
    single = replace(
        system, mass=np.eye(2), stiffness=np.diag([1.0, 1.6]), damping=damping * np.eye(2),
        meshes=(replace(meshes[0], direction=np.array([0.8, 0.6])),),
        rotations=(Rotation(Fraction(1, 8), gyroscopic=skew),),
    )  # fmt: skip
    own, pair = first_order(single, 2), first_order(system, 2)
    place = {(t.mode_p, t.mode_q, t.harmonic, t.difference): k for k, t in enumerate(pair.index)}
    for k, t in enumerate(own.index):
        at = place[2 * t.mode_p - 1, 2 * t.mode_q - 1, t.harmonic, t.difference]
        assert pair.center_frequency[at] == pytest.approx(own.center_frequency[k], rel=1e-9)
        assert pair.half_width[at] == pytest.approx(own.half_width[k], rel=1e-6, abs=1e-12)
    others = [k for k, t in enumerate(pair.index) if not (t.mode_p % 2 and t.mode_q % 2)]
    assert np.isnan(pair.half_width[others]).all()


def test_a_motion_that_grows_by_itself_has_no_boundary() -> None:
    """Negative damping of one of two coordinates that a held speed couples."""
    turning = Rotation(None, 3.0, gyroscopic=0.05 * np.array([[0.0, 1.0], [-1.0, 0.0]]))
    mesh = Mesh("mesh", np.array([0.8, 0.6]), np.asarray(0.1), np.asarray(0.1), Rectangular(1.5))
    system = GearSystem(np.eye(2), np.diag([1.0, 2.0]), (mesh,), np.diag([0.06, -0.02]), rotations=(turning,))
    found = first_order(system, 1)
    alone = [own.mode_p for own in found.index if own.kind == "self-excited"]
    assert len(alone) == 1
    touched = [k for k, own in enumerate(found.index) if alone[0] in (own.mode_p, own.mode_q)]
    assert np.isinf(found.half_width[touched]).all()
    assert solve(system, np.array([0.3, 1.7])).growth_rate.min() > 0


def test_nothing_is_left_of_a_product_that_is_rounding() -> None:
    none, one = np.zeros((1, 1)), np.ones((1, 1))
    free = np.zeros(1, dtype=complex)
    assert resonance_of(none, none, one, one, free, free, True) == (0.0, 0.0, np.inf)


def test_second_order_says_what_it_does_not_take() -> None:
    system = replace(train(None), rotations=(Rotation(Fraction(1), gyroscopic=np.zeros((3, 3))),))
    METHODS["perturbation"](METHODS["perturbation"].Options(), system).check()
    with pytest.raises(OptionError, match="speed of rotation") as refused:
        METHODS["perturbation"](METHODS["perturbation"].Options(order=2), system).check()
    assert "order: 1" in refused.value.remedy
