"""Assemblies of openTorsion: natural frequencies and forced responses equal theirs."""

from typing import Any

import numpy as np
import pytest

import gearstab as gs
from gearstab.errors import NotPossible

opentorsion = pytest.importorskip("opentorsion")

MESH = {"epsilon": 0.2, "contact_ratio": 1.6}


def assembly(rigid: bool = False) -> Any:
    """Motor, gears and a load on shafts; ``rigid``: with a stage of rigid gears behind."""
    shafts = [(0, 1, 1e5), (2, 3, 3e5)] + ([(4, 5, 2e5)] if rigid else [])
    disks = [(0, 0.8), (3, 2.0)] + ([(5, 4.0)] if rigid else [])
    driver = opentorsion.ElasticGear(1, I=0.05, R=0.1, k=4e6, c=20.0)
    driven = opentorsion.ElasticGear(2, I=0.4, R=0.25, k=4e6, c=20.0, parent=driver)
    gears = None
    if rigid:
        first = opentorsion.Gear(3, I=0.01, R=0.1)
        gears = [first, opentorsion.Gear(4, I=0.3, R=0.2, parent=first)]
    return opentorsion.Assembly(
        [opentorsion.Shaft(a, b, L=None, odl=None, k=k, I=0.0, c=5.0) for a, b, k in shafts],
        [opentorsion.Disk(node, inertia) for node, inertia in disks],
        gear_elements=gears,
        elastic_gear_elements=[driver, driven],
    )


@pytest.mark.parametrize("rigid", [False, True])
def test_natural_frequencies_are_theirs(rigid: bool) -> None:
    model = assembly(rigid)
    section = gs.from_opentorsion(model, meshes=[MESH])
    system = gs.build(section)
    np.testing.assert_allclose(system.mean_stiffness_matrix(), model.K, rtol=1e-12, atol=1e-6)
    damped = np.sort(np.abs(model.modal_analysis()[0]))
    mine = [mode["natural_frequency"] for mode in gs.info(section)["modes"]]
    # Each twice, moduli of damped eigenvalues: they differ by zeta^2/2, and the damping ratios here are below 1 %.
    np.testing.assert_allclose(mine[1:], damped[damped > 1.0][::2], rtol=5e-5)


@pytest.mark.parametrize("rigid", [False, True])
def test_forced_responses_are_theirs(rigid: bool) -> None:
    model, omega = assembly(rigid), 700.0
    section = gs.from_opentorsion(model, meshes=[MESH | {"epsilon": 0.0}])
    size = len(model.M)
    section["forces"] = [{"name": "motor", "direction": np.eye(size)[0], "cos": [10.0]}]
    section["coordinate_units"] = "rad"
    tree = gs.respond({"system": section, "respond": {"mesh_frequency": omega, "steady_state": True}})
    response = tree["response"]
    phase = omega * response["time"].values
    waves = np.column_stack([np.cos(phase), -np.sin(phase), np.ones(len(phase))])
    amplitude = np.linalg.lstsq(waves, response["displacement"].values, rcond=None)[0]
    force = np.zeros((size, 1), complex)
    force[0] = 10.0
    theirs = model.ss_response(force, np.array([omega]))[0][:, 0]
    np.testing.assert_allclose(amplitude[0] + 1j * amplitude[1], theirs, rtol=1e-7, atol=1e-9 * np.abs(theirs).max())


def test_what_varies_is_the_mesh() -> None:
    model = assembly()
    section = gs.from_opentorsion(model, meshes=[MESH])
    system = gs.build(section)
    (mesh,) = system.meshes
    np.testing.assert_allclose(mesh.direction, [0.0, 1.0, 2.5, 0.0], rtol=1e-14)
    assert float(mesh.mean_stiffness) == pytest.approx(4e6)
    assert section["coordinates"] == ["node0", "node1", "node2", "node3"]
    assert gs.from_opentorsion(assembly(rigid=True), meshes=[MESH])["coordinates"] != section["coordinates"]
    # Without the mesh the two shafts turn freely, each by itself.
    free = np.linalg.eigvalsh(np.linalg.solve(np.linalg.cholesky(system.mass), system.stiffness))
    assert np.sum(np.linalg.matrix_rank(system.stiffness)) == 2
    assert len(free) == 4


def test_mistakes() -> None:
    with pytest.raises(NotPossible, match="nothing says how the stiffness of mesh 'gear1' varies"):
        gs.from_opentorsion(assembly())
    bare = opentorsion.Assembly([opentorsion.Shaft(0, 1, L=None, odl=None, k=1e5, I=0.0)], [opentorsion.Disk(0, 1.0)])
    with pytest.raises(NotPossible, match="the assembly has no elastic mesh"):
        gs.from_opentorsion(bare)
