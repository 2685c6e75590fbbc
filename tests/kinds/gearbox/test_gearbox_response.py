"""Steady states of trains under load: load factors by the pairs in contact, transmission errors."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gearbox_trains import REFERENCE, crosscheck, gear, mesh, train

from gearstab.gears.geometry import Gear
from gearstab.gears.mesh_stiffness import StiffnessModel
from gearstab.gears.pair import Pair
from gearstab.modal import static_mesh_force
from gearstab.response import steady_state
from gearstab.response.loads import LoadedTeeth, tooth_loads
from gearstab.response.speeds import speed_response
from gearstab.systems import build


def small(**first: Any) -> dict[str, Any]:
    """Two stages, five cycles of the first mesh to three of the second, and enough damping."""
    rotors = [gear("a", 20), gear("b", 50), gear("c", 30), gear("d", 45)]
    for rotor in rotors:
        rotor["support"] = {"stiffness": 2e8, "damping_ratio": 0.1}
    meshes = [
        mesh("1", "a", "b", damping_ratio=0.1) | first,
        mesh("2", "c", "d", damping_ratio=0.1, contact_ratio=2.3, epsilon=0.1, lag=0.2),
    ]
    shafts = [{"name": "s", "between": ["b", "c"], "stiffness": 2e5, "damping_ratio": 0.1}]
    outputs = [{"rotor": "d", "torque": 200.0}]
    return train(rotors, meshes, shafts=shafts, outputs=outputs)


@pytest.mark.parametrize("first", [{}, {"lag": 0.7}])
def test_measures_over_speed_against_a_history_by_hand(first: dict[str, Any]) -> None:
    system, omega = build(small(**first)), 9e3
    assert [str(item.frequency_ratio) for item in system.meshes] == ["1", "3/5"]
    found = speed_response(system, np.array([omega]), 400)
    history = steady_state(system, omega, 6000)
    samples = len(history.time) - 1
    force, static = history.mesh_force[:-1], static_mesh_force(system)
    # A history of 6000 samples per cycle misses an extreme at a jump by what the force changes in a sample.
    near = 2e-3
    for i, item in enumerate(system.meshes):
        cycles = (5, 3)[i]
        phase = (np.arange(samples) * cycles / samples - float(item.lag)) % 1
        c = float(item.waveform.contact_ratio)
        pairs = np.where(phase < c % 1, np.floor(c) + 1, np.floor(c))
        few = phase > c % 1
        measures = {
            "mesh_force_min": force[:, i].min(),
            "load_factor_fewest_pairs": force[few, i].max() / static[i],
            "tooth_load_factor": (force[:, i] / pairs).max() / static[i],
            "dynamic_load_factor": force[:, i].max() / static[i],
        }
        for name, expected in measures.items():
            assert getattr(found, name)[0, 0, i] == pytest.approx(expected, rel=near), name
        spectrum = np.fft.rfft(history.mesh_deflection[:-1, i]) / samples
        # The rectangle rule over kinks.
        amplitude = 2 * abs(spectrum[cycles])
        assert found.transmission_error_first_harmonic[0, 0, i] == pytest.approx(amplitude, rel=1e-5)


def plain(**more: Any) -> dict[str, Any]:
    """Two gears that only turn."""
    rotors = [gear("a", 20, support=None), gear("b", 50, support=None)]
    link = {"name": "m", "gears": ["a", "b"], "damping_ratio": 0.1} | more
    return train(rotors, [link], outputs=[{"rotor": "b", "torque": 200.0}])


def test_waves_without_a_contact_ratio_have_no_loads_of_teeth() -> None:
    found = speed_response(build(plain(waveform={"kind": "fourier", "sin": [0.4]})), np.array([3e4]), 50)
    assert np.isnan(found.tooth_load_factor[0, 0, 0])
    assert np.isnan(found.load_factor_fewest_pairs[0, 0, 0])
    assert np.isfinite(found.dynamic_load_factor[0, 0, 0])
    assert found.status[0, 0] == 0


def test_with_computed_waves_the_zones_are_those_of_the_teeth() -> None:
    rectangular, computed = (
        speed_response(build(plain(waveform={"kind": kind})), np.array([1.5e4]), 60)
        for kind in ("rectangular", "tooth")
    )
    for found in (rectangular, computed):
        # One pair carries more than each of two.
        assert found.tooth_load_factor[0, 0, 0] == found.load_factor_fewest_pairs[0, 0, 0]
    difference = computed.load_factor_fewest_pairs - rectangular.load_factor_fewest_pairs
    assert 0 < np.abs(difference[0, 0, 0]) < 0.1


@pytest.mark.slow  # half a minute: eight thousand intervals with the vibration at 14 kHz in each
def test_the_tractor_gearbox_has_the_load_factors_of_the_reference() -> None:
    system = build(crosscheck() | {"damping_factor": 1.0})
    found = speed_response(system, np.array([14 * 25 * 2 * np.pi]), 400)
    peak, low, least = np.array(REFERENCE["steady_rect_1500rpm"]["rows"])[:, :3].T
    stages = slice(0, 4)
    # The reference takes extremes among samples of its own, and the dampers' force with the springs'.
    np.testing.assert_allclose(found.dynamic_load_factor[0, 0, stages], peak, rtol=1e-3)
    np.testing.assert_allclose(found.load_factor_fewest_pairs[0, 0, stages], low, rtol=0.015)
    static = np.array(REFERENCE["W_normal"])
    np.testing.assert_allclose(found.mesh_force_min[0, 0, stages] / static, least, atol=0.03)
    np.testing.assert_allclose(found.mesh_force_mean[0, 0, stages], static, rtol=1e-6)
    harmonic = 1e6 * found.transmission_error_first_harmonic[0, 0, stages]
    np.testing.assert_allclose(harmonic, REFERENCE["dte_first_harmonic_um"]["m3 a20"], rtol=0.01)
    # Kuria & Kihiu 2008, Table II: load factors fall from the first stage to the last.
    assert np.all(np.diff(found.load_factor_fewest_pairs[0, 0, stages]) < 0)


@pytest.mark.slow  # ten seconds per speed
@pytest.mark.parametrize("rpm", ["2100", "6000"])
def test_load_factors_over_speed_are_those_of_the_reference(rpm: str) -> None:
    system = build(crosscheck() | {"damping_factor": 1.0})
    found = speed_response(system, np.array([14 * float(rpm) * np.pi / 30]), 100)
    peak, low = np.array(REFERENCE["speed_sweep_dlf"][rpm])[:, :2].T
    np.testing.assert_allclose(found.dynamic_load_factor[0, 0, :4], peak, rtol=0.01)
    np.testing.assert_allclose(found.load_factor_fewest_pairs[0, 0, :4], low, rtol=0.03)


def test_internal_teeth_share_the_load_and_helical_ones_or_teeth_that_would_part_have_none() -> None:
    ring = Pair(Gear(18, 0.002), Gear(60, 0.002, internal=True))
    phase, force = (np.arange(400) + 0.5) / 400, np.full(400, 100.0)
    found = tooth_loads(LoadedTeeth(ring, StiffnessModel(), ("pinion", "ring")), phase, force, 100.0, 20)
    # Where two pairs are in contact each has about a half, elsewhere one has all; three are never in contact here.
    assert 1 < ring.contact_ratio < 2
    alone = np.round(found.load, 12) == 100.0
    assert 0 < alone.sum() < 20
    assert np.all((found.load[~alone] > 35.0) & (found.load[~alone] < 65.0))
    equal = tooth_loads(LoadedTeeth(ring, StiffnessModel(single_pair_stiffness=1e8), ("a", "b")), phase, force, 100, 20)
    assert set(np.round(equal.load, 12)) <= {50.0, 100.0}
    helical = Pair(Gear(18, 0.002, helix_angle=0.3), Gear(60, 0.002, helix_angle=-0.3))
    assert np.isnan(tooth_loads(LoadedTeeth(helical, StiffnessModel(), ("a", "b")), phase, force, 100.0, 20).load).all()
    assert np.isfinite(found.stress[:, 0]).all()
    apart = Pair(Gear(5, 0.002, addendum=0.5, profile_shift=0.6), Gear(40, 0.002, addendum=0.5))
    assert apart.contact_ratio < 1
    nothing = tooth_loads(LoadedTeeth(apart, StiffnessModel(), ("a", "b")), phase, force, 100.0, 20)
    assert np.isnan(nothing.load).all()
    assert np.isnan(nothing.stress).all()
