"""``kind: planetary`` in configurations, and what commands make of it."""

import json

import numpy as np
import pytest
from planetary_gears import configuration
from scenes import ran, written

from gearstab.config import load
from gearstab.info.text import report
from gearstab.modal import mean_modes
from gearstab.systems import build

SCENE = configuration(
    "ring: {kind: elastic, harmonics: 4, bending_stiffness: 5.0e+7}",
    "supports: {carrier: 5.0e+11, sun: 5.0e+11, planet: 5.0e+11, carrier_rotation: 1.0e+11, sun_rotation: 5.0e+11}",
    "phases: {sun: [0, 0.25, 0.5, 0.75], sun_ring: 0.5}", "scaling: dimensionless",
)  # fmt: skip


@pytest.fixture
def scene(tmp_path):
    return written(tmp_path, SCENE, "scene.yaml")


def test_a_planetary_gear_from_a_configuration(scene):
    system = build(load(scene).system)
    assert [mesh.name for mesh in system.meshes] == [f"{gear}{n}" for gear in ("sun", "ring") for n in (1, 2, 3, 4)]
    assert [float(mesh.lag) % 1 for mesh in system.meshes] == [0, 0.25, 0.5, 0.75, 0.5, 0.75, 0, 0.25]
    assert [float(mesh.epsilon) for mesh in system.meshes] == [0.1] * 4 + [0.2] * 4
    # Table 1 of Parker (2009) to the error that four harmonics leave.
    assert mean_modes(system).natural_frequency[0] == pytest.approx(0.9184, abs=2e-4)


NUMBERS = [
    ("epsilon", 0.3), ("contact_ratio", 1.7), ("meshes.sun.epsilon", 0.3), ("meshes.ring.contact_ratio", 1.7),
    ("meshes.ring.mean_stiffness", 2e8), ("phases.sun_ring", 0.2), ("phases.sun.2", 0.3), ("masses.planet", 3.0),
    ("masses.ring", 5.0), ("inertias.ring", 6.0), ("supports.carrier", 1e9), ("supports.planet", 1e9),
    ("supports.ring_radial", 1e6), ("ring.bending_stiffness", 4e7), ("pressure_angles.sun", 0.3),
    ("damping_ratio", 0.01),
]  # fmt: skip


@pytest.mark.parametrize(("name", "value"), NUMBERS, ids=[name for name, _ in NUMBERS])
@pytest.mark.parametrize("scaling", ["SI", "dimensionless"])
def test_every_number_can_be_an_axis(scene, name, value, scaling):
    """Two rows at once are the two gears one by one, set with ``--set``."""
    values = [value, 1.1 * value]
    alone = [build(load(scene, [f"scaling={scaling}", f"{name}={v}"]).system) for v in values]
    scene.write_text(SCENE + f"sweep:\n  {name}: {values}\nmethods:\n  perturbation: {{}}\n")
    config = load(scene, [f"scaling={scaling}"])
    both = build(config.at({name: np.array([0, 1])}))
    assert both.batch == (2,)
    for k, one in enumerate(alone):
        for rows, single in zip(numbers(both), numbers(one), strict=True):
            # The same operations in the same order, but sums and products of arrays may be rounded otherwise.
            found = np.broadcast_to(rows, (2, *np.shape(single)))[k]
            np.testing.assert_allclose(found, single, rtol=1e-12, atol=1e-13 * np.abs(single).max())


def numbers(system):
    """All that a method can read of a system."""
    damping = np.zeros_like(system.mass) if system.damping is None else system.damping
    yield from (system.mass, system.mean_stiffness_matrix(), damping)
    for mesh in system.meshes:
        yield from (mesh.direction, mesh.mean_stiffness, mesh.epsilon, mesh.lag, mesh.waveform.contact_ratio)


def test_the_rotational_model_needs_fewer_numbers(scene):
    overrides = ["motion=rotational", "masses={ring: 6.35, planet: 4}", "supports={carrier_rotation: 1.0e+11}"]
    assert build(load(scene, overrides).system).size == 3 + 6 + 4


def test_teeth_give_the_phases(scene):
    given = ["phases=", "teeth={sun: 27, planet: 35, ring: 97}"]
    system = build(load(scene, given).system)
    assert [float(mesh.lag) % 1 for mesh in system.meshes] == [0, 0.75, 0.5, 0.25] * 2


def test_info_names_types_and_the_rule(scene):
    result = ran("info", scene, "--json")
    assert result.exit_code == 0, result.output
    facts = json.loads(result.output)
    kinds = [mode["type"] for mode in facts["modes"][:9]]
    short = {"translational": "T", "rotational": "R", "planet": "P", "purely ring": "PR"}
    assert [short[kind] for kind in kinds] == ["T", "T", "R", "P", "T", "T", "R", "PR", "P"]
    assert [mode["mesh_deflection_type"] for mode in facts["modes"][:9]] == [1, 1, 0, 2, 1, 1, 0, None, 2]
    assert facts["existence_rule"] == {"planets": 4, "step": 1}
    first = {t["label"]: t for t in facts["tongues"]}
    assert first["w1+w3"]["allowed"] is True
    assert first["2w3"]["allowed"] is False
    assert first["2w3"]["half_width"] < 1e-9
    text = report(facts)
    assert "purely ring" in text
    assert "Existence rule" in text
