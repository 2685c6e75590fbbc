"""Planets at unequal angles: where teeth fit, mesh phases (Parker & Lin 2004) and modes (Lin & Parker 2000)."""

import json
from fractions import Fraction
from math import pi, tau
from pathlib import Path

import numpy as np
import pytest
from planetary_gears import SUPPORTS, configuration, parameters
from scenes import problems, ran, read, written

from gearstab.floquet import solve
from gearstab.modal import mean_modes
from gearstab.system import GearSystem
from gearstab.systems import build, section
from gearstab.systems.planetary.planets import nearest

SCENE = configuration(
    "angles: assemble", "ring: {kind: rigid}", "teeth: {sun: 27, planet: 20}",
    "supports: {carrier: 2.0e+8, sun: 2.0e+8, planet: 3.0e+8, ring: 1.0e+8, ring_rotation: 1.0e+8}",
)  # fmt: skip
BY_PHASES = {"teeth: {sun: 27, planet: 20}": "phases: {sun: [0, 0, 0, 0], sun_ring: 0.5}"}


def text(**lines: str) -> str:
    """The scene with other lines, by the text that they replace."""
    found = SCENE
    for old, new in lines.items():
        assert old in found
        found = found.replace(old, new)
    return found


def gear(angles: list[float] | None, **changes: object) -> GearSystem:
    """Parker's gear with a rigid ring on soft supports."""
    return build(parameters(harmonics=1, supports=SUPPORTS, angles=angles, **changes))


@pytest.mark.parametrize(("sun", "ring", "planets"), [(27, 67, 4), (27, 67, 3), (16, 46, 5), (23, 61, 7), (31, 80, 6)])
def test_the_nearest_places_are_those_of_a_search_through_all(sun: int, ring: int, planets: int) -> None:
    places = tau * np.arange(sun + ring) / (sun + ring)
    for n, angle in enumerate(nearest(sun, ring, planets)):
        assert np.abs(places - angle).min() < 1e-12
        assert abs(angle - tau * n / planets) <= np.abs(places - tau * n / planets).min() + 1e-12


def test_an_even_number_of_planets_stays_diametrically_opposite() -> None:
    angles = nearest(27, 67, 6)
    np.testing.assert_allclose(np.array(angles[3:]) - angles[:3], pi, rtol=1e-14)


def test_phases_are_those_of_parker_and_lin_of_sun_and_ring(tmp_path: Path) -> None:
    """gamma_sn = z_s psi_n/2 pi, gamma_rn - gamma_r1 = -z_r psi_n/2 pi: equal only where the planets fit."""
    config = read(tmp_path, SCENE)
    psi = config.system["angles"]
    assert config.system["teeth"]["ring"] == 27 + 2 * 20
    lags = {mesh.name: float(mesh.lag) for mesh in build(config.system).meshes}
    for n, angle in enumerate(psi, start=1):
        for name, teeth in (("sun", 27), ("ring", -67)):
            turns = lags[f"{name}{n}"] - lags[f"{name}1"] - teeth * angle / tau
            assert turns == pytest.approx(round(turns), abs=1e-9)


def test_equal_angles_written_out_are_the_gear_without_them() -> None:
    """The same matrices and lags; the one is solved block by block, the other as a whole."""
    equal, listed = gear(None), gear([tau * n / 4 for n in range(4)])
    assert equal.symmetries
    assert not listed.symmetries
    np.testing.assert_allclose(listed.mean_stiffness_matrix(), equal.mean_stiffness_matrix(), rtol=0, atol=1e-12)
    omega = np.linspace(0.5, 3.0, 40)
    blocks, whole = (solve(system, omega).growth_rate for system in (equal, listed))
    assert blocks.max() > 1e-3
    np.testing.assert_allclose(whole, blocks, rtol=1e-7, atol=1e-9)


def test_a_gear_turned_as_a_whole_keeps_its_frequencies() -> None:
    psi = np.array([0.0, 1.4, 3.0, 4.9])
    first, turned = (mean_modes(gear(list(angles))).natural_frequency for angles in (psi, psi + 0.7))
    np.testing.assert_allclose(turned, first, rtol=1e-11, atol=1e-9)


@pytest.mark.parametrize("turn", [0.7, -2.0, 10.5 * tau / 94])
def test_a_gear_turned_as_a_whole_keeps_the_phases_of_its_teeth(turn: float) -> None:
    psi, teeth = np.array(nearest(27, 67, 4)), {"sun": 27, "planet": 20, "ring": 67}
    first, turned = ([mesh.lag for mesh in gear(list(a), teeth=teeth, phases=None).meshes] for a in (psi, psi + turn))
    assert len(set(map(float, first))) > 2
    np.testing.assert_allclose(turned, first, rtol=0, atol=1e-12)


def test_modes_of_opposite_planets_turn_or_move_the_bodies_on_the_axis_but_not_both() -> None:
    """Lin & Parker 2000: diametrically opposed planets leave rotational and translational modes apart."""
    apart, mixed = gear([0.0, 1.3, pi, pi + 1.3]), gear([0.0, 1.3, pi, pi + 1.5])
    assert np.max(together(apart)) < 1e-6
    assert np.max(together(mixed)) > 1e-2


def together(system: GearSystem) -> np.ndarray:
    """The smaller of the largest rotation and the largest translation of a body on the axis, for every mode."""
    modes, names = mean_modes(system), system.coordinates
    axis = [k for k, name in enumerate(names) if name.startswith(("ring", "carrier", "sun"))]
    turning = [k for k in axis if names[k].endswith("rotation")]
    moving = [k for k in axis if k not in turning]
    scaled = np.abs(modes.shapes) / np.abs(modes.shapes).max(axis=0)
    return np.minimum(scaled[turning].max(axis=0), scaled[moving].max(axis=0))


def test_an_angle_can_be_an_axis(tmp_path: Path) -> None:
    scene = text(**BY_PHASES, **{"angles: assemble": "angles: [0, 1.5, 3.1, 4.6]"})
    config = read(tmp_path, f"{scene}sweep: {{angles.1: [1.4, 1.6]}}\nmethods: {{perturbation: {{}}}}\n")
    both = build(config.at({"angles.1": np.array([0, 1])}))
    for k, angle in enumerate((1.4, 1.6)):
        one = build(config.system.model_copy(update={"angles": [0, angle, 3.1, 4.6]}))
        np.testing.assert_allclose(both.mean_stiffness_matrix()[k], one.mean_stiffness_matrix(), rtol=1e-12, atol=1e-6)


def test_the_resolved_configuration_holds_angles_and_teeth(tmp_path: Path) -> None:
    config = read(tmp_path, SCENE)
    assert len(config.tree["system"]["angles"]) == 4
    assert read(tmp_path, config.resolved).resolved == config.resolved


def test_equal_angles_that_can_be_assembled_keep_the_symmetry(tmp_path: Path) -> None:
    p = read(tmp_path, text(**{"sun: 27": "sun: 28"})).system
    assert p["angles"] is None
    assert build(p).symmetries


def test_angles_that_do_not_fit_are_refused_with_the_nearest_that_do(tmp_path: Path) -> None:
    wrong = text(**{"angles: assemble": 'angles: [0, "91 deg", "180 deg", "271 deg"]'})
    (problem,) = problems(tmp_path, wrong)
    assert problem.path == "system.angles"
    degrees = 360 * Fraction(24, 94)
    assert f"{float(degrees):.7g} deg" in problem.hint
    right = [f'"{360 * step / 94:.7g} deg"' for step in (0, 24, 47, 71)]
    read(tmp_path, text(**{"angles: assemble": f"angles: [{', '.join(right)}]"}))


def test_an_axis_of_teeth_at_which_the_angles_do_not_fit_is_refused(tmp_path: Path) -> None:
    axis = "sweep: {t: {targets: [teeth.sun, teeth.ring], values: [[27, 28], [67, 68]]}}\nmethods: {perturbation: {}}\n"
    (problem,) = problems(tmp_path, SCENE + axis)
    assert problem.path == "sweep.t"


def test_info_says_where_the_planets_are_and_the_order_of_the_mesh(tmp_path: Path) -> None:
    config = written(tmp_path, SCENE)
    facts = json.loads(ran("info", config, "--json").stdout)
    assert "91.9149, 180, 271.915 deg" in facts["summary"]["planets"]
    assert "ring 67" in facts["summary"]["teeth"]
    # The sun drives, the ring is held: of a turn of the sun z_s z_r/(z_s + z_r) teeth (Willis).
    assert facts["meshes"][0]["order"] == pytest.approx(27 * 67 / 94)


def test_the_input_speed_follows_from_the_teeth_alone() -> None:
    known = section({"kind": "planetary", "teeth": {"sun": Fraction(27), "ring": Fraction(67)}})
    assert known.cycles_of_input() == pytest.approx(27 * 67 / 94)
