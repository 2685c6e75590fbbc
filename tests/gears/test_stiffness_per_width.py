"""Mesh stiffness per face width, c_gamma: the mean over the face width that both gears share."""

from typing import Any

import numpy as np
import pytest

import gearstab as gs
from gearstab.config import ConfigError


def pair(**mesh: Any) -> dict[str, Any]:
    rotors = [{"name": "a", "teeth": 20, "face_width": "25 mm"}, {"name": "b", "teeth": 41, "face_width": "20 mm"}]
    gears = {"module": "2 mm", "pressure_angle": "20 deg"}
    meshes = [{"name": "mesh", "gears": ["a", "b"]} | mesh]
    return {"kind": "gearbox", "gears": gears, "rotors": rotors, "meshes": meshes, "input": {"rotor": "a"}}


def test_the_narrower_gear_counts() -> None:
    # 20 N/(mm um) times 20 mm: 400 N/um.
    (mesh,) = gs.build(pair(stiffness_per_width="20 N/(mm um)")).meshes
    np.testing.assert_allclose(mesh.mean_stiffness, 4e8, rtol=1e-14)
    (computed,) = gs.build(pair()).meshes
    np.testing.assert_allclose(mesh.epsilon, computed.epsilon, rtol=1e-14)


@pytest.mark.parametrize(("given", "mean"), [(1.5e10, 3e8), (2e10, 4e8)])
def test_it_scales_measured_samples(given: float, mean: float) -> None:
    wave = {"kind": "sampled", "phase": [0, 0.5], "stiffness": [1, 3]}
    (mesh,) = gs.build(pair(waveform=wave, stiffness_per_width=given)).meshes
    np.testing.assert_allclose(mesh.mean_stiffness, mean, rtol=1e-14)
    # Of the samples: half the peak-to-peak over the mean.
    np.testing.assert_allclose(mesh.epsilon, 0.5, rtol=1e-14)


def test_a_plain_number_of_other_units_is_doubted() -> None:
    with pytest.warns(gs.errors.DoubtWarning, match=r'was "20 N/\(mm um\)" meant\?'):
        gs.load(pair(stiffness_per_width=20))


def test_meshes_of_a_planetary_set_take_it() -> None:
    rotors = [{"name": name, "teeth": teeth, **more} for name, teeth, more in (
        ("sun", 20, {}), ("ring", 80, {"internal": True, "bore_radius": "100 mm"}))]  # fmt: skip
    rotors.append({"name": "carrier", "inertia": 0.1})
    stage = {
        "name": "set", "sun": "sun", "ring": "ring", "carrier": "carrier", "held": "ring",
        "planets": {"count": 4, "teeth": 30}, "meshes": {"sun": {"stiffness_per_width": "15 N/(mm um)"}},
    }  # fmt: skip
    gears = {"module": "2 mm", "pressure_angle": "20 deg", "face_width": "30 mm"}
    data = {"kind": "gearbox", "gears": gears, "rotors": rotors, "planetary_sets": [stage], "input": {"rotor": "sun"}}
    system = gs.build(data)
    np.testing.assert_allclose([mesh.mean_stiffness for mesh in system.meshes[:4]], 4.5e8, rtol=1e-14)
    stage["meshes"]["sun"]["mean_stiffness"] = 1e8
    with pytest.raises(ConfigError, match="stiffness_per_width"):
        gs.load(data)
