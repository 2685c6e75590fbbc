"""Maps of chosen modes or of one type of mesh deflection, from the function to the result file and ``info``."""

import json

import numpy as np
import pytest
import xarray as xr
from planetary_gears import cyclic
from scenes import ran, refused, scene_text, succeeds, written
from systems import star, train

from gearstab.floquet import solve
from gearstab.floquet.dispatch import reduction
from gearstab.floquet.truncation import modes_basis, neglected, split_degenerate_group, type_basis
from gearstab.system import Cyclic, GearSystem

OMEGA = np.linspace(0.7, 5.2, 31)

STAR = scene_text("truncation_star")


@pytest.fixture
def config(tmp_path):
    return written(tmp_path, STAR, "star.yaml")


def turned_star():
    """The star with its symmetry: a turn takes satellite n to n + 1."""
    turn = np.zeros((4, 4))
    turn[0, 0] = turn[2, 1] = turn[3, 2] = turn[1, 3] = 1.0
    base = star()
    return GearSystem(
        base.mass, base.stiffness, base.meshes, symmetries=(Cyclic(3, turn, ("rotational", "translational", "planet")),)
    )


def test_all_modes_are_the_system_itself():
    system = train()
    same = solve(system.projected(modes_basis(system, [1, 2, 3])), OMEGA)
    assert np.abs(same.growth_rate - solve(system, OMEGA).growth_rate).max() < 1e-11


def test_blocks_by_modes_make_up_the_whole():
    """In phase: the growth of the whole is the largest of the parts, of which each neglects nothing."""
    system = cyclic(4)
    whole = solve(system, OMEGA, reduction=False)
    growth = []
    for part in reduction(system).parts:
        basis = modes_basis(system, list(part.modes))
        assert neglected(system, basis) == 0
        assert split_degenerate_group(system, part.modes) == ()
        growth.append(solve(system.projected(basis), OMEGA).growth_rate)
    assert len(growth) == 3
    # The whole has double multipliers.
    assert np.abs(whole.growth_rate - np.max(growth, axis=0)).max() < 1e-9


def test_types_of_a_star():
    """T = 0: hub and the sum of the satellites; T = 1: one satellite against another, w^2 = (0.2 + k)/0.6."""
    system = turned_star()
    assert type_basis(system, 0).shape == (4, 2)
    assert np.array_equal(type_basis(system, "translational"), type_basis(system, 1))
    pair = system.projected(type_basis(system, 1))
    frequencies = np.linalg.eigvalsh(np.linalg.solve(pair.mass, pair.mean_stiffness_matrix()))
    assert frequencies == pytest.approx([2.0, 2.0], rel=1e-13)
    parts = [solve(system.projected(type_basis(system, t)), OMEGA).growth_rate for t in (0, 1)]
    assert all(neglected(system, type_basis(system, t)) == 0 for t in (0, 1))
    whole = solve(system, OMEGA, reduction=False).growth_rate
    assert np.abs(np.maximum(*parts) - whole).max() < 1e-9


def test_what_is_neglected_is_the_coupling_left_out():
    """Two modes of a train: the largest change of stiffness between a mode inside and the one outside, over w_p w_q."""
    system = train(epsilon=0.3)
    values, shapes = np.linalg.eigh(system.mean_stiffness_matrix() / np.sqrt(np.outer(*[np.diag(system.mass)] * 2)))
    shapes = shapes / np.sqrt(np.diag(system.mass))[:, None]
    delta = np.array([mesh.direction for mesh in system.meshes]) @ shapes
    # Contact ratio 1.5: both meshes step by +-epsilon together.
    coupling = 0.3 * np.abs(delta.T @ delta) / np.sqrt(np.outer(values, values))
    assert neglected(system, modes_basis(system, [1, 3])) == pytest.approx(
        max(coupling[0, 1], coupling[2, 1]), rel=1e-9
    )


@pytest.mark.parametrize(("kind", "message"), [(2, "from 0 to 1"), ("planets", "rotational, translational")])
def test_unknown_types(kind, message):
    with pytest.raises(ValueError, match=message):
        type_basis(turned_star(), kind)


def test_types_need_a_symmetry():
    with pytest.raises(ValueError, match="no cyclic symmetry"):
        type_basis(star(), 0)


def test_torn_pairs():
    assert split_degenerate_group(star(), [2]) == (2, 3)
    assert split_degenerate_group(star(), [2, 3, 4]) == ()
    assert split_degenerate_group(star(), [1]) == ()


def test_result_says_what_was_reduced(config, tmp_path):
    out = tmp_path / "star.h5"
    succeeds("sweep", config, "-o", out, "-q")
    with xr.open_datatree(out) as tree:
        found = tree["floquet"].attrs
        assert found["reduction"] == "blocks of 2, 1 (twice) modes"
        # 4^3 operations a segment, or 2^3 + 1.
        assert found["reduction_saving"] == pytest.approx(64 / 9)
        assert "restriction" not in found


def test_map_of_chosen_modes(config, tmp_path):
    out = tmp_path / "star.h5"
    succeeds("sweep", config, "-o", out, "-q", "--set", "methods.floquet={modes: [3, 2], exponents: true}")
    with xr.open_datatree(out) as tree:
        group = tree["floquet"]
        assert group.attrs["restriction"].startswith("modes 2, 3 of the base system: 2 of 4 modes, which nothing")
        assert group.sizes["exponent"] == 4
        growth = group["growth_rate"].values
    # The pair alone: x'' + (0.2 + k(t))/0.6 x = 0.
    system = star()
    alone = GearSystem(np.array([[0.6]]), np.array([[0.2]]), (system.meshes[0].__class__(
        "m", np.array([1.0]), 1.0, 0.2, system.meshes[0].waveform),))  # fmt: skip
    assert np.abs(growth - solve(alone, OMEGA).growth_rate[0]).max() < 1e-9


def test_info_shows_the_reduction(config):
    text = ran("info", config).output
    assert "Reductions applied: blocks of 2, 1 (twice) modes." in text
    facts = json.loads(ran("info", config, "--json").output)["reductions"]
    assert facts["dropped_modes"] == []
    assert {tuple(block["modes"]) for block in facts["blocks"]} == {(1, 4), (2, 3)}
    assert sorted((block["size"], block["copies"]) for block in facts["blocks"]) == [(1, 2), (2, 1)]


def edges_of(result):
    """Edges of the regions of a result by name."""
    with xr.open_datatree(result) as tree:
        group = tree["boundaries"].to_dataset()
        named = zip(group["label"].values, group["boundary_frequency"].values, strict=True)
        return {str(label): edges for label, edges in named if np.isfinite(edges).all()}, dict(group.attrs)


def test_boundaries_of_chosen_modes_bear_their_numbers_in_the_whole_system(config, tmp_path):
    """The satellites in phase do not couple with those out of phase: both have the regions of the whole star."""
    found = {}
    for name, options in (("whole", "{}"), ("in phase", "{modes: [1, 4]}"), ("out of phase", "{modes: [2, 3]}")):
        out = tmp_path / f"{name}.h5"
        succeeds("sweep", config, "-o", out, "-q", "--set", f"methods.boundaries={options}")
        found[name], attributes = edges_of(out)
        assert ("restriction" in attributes) == (name != "whole")
    for label in ("2w1", "w1+w4", "2w4", "w4"):
        np.testing.assert_allclose(found["in phase"][label], found["whole"][label], rtol=1e-9)
    # A region of modes 2 and 3, of equal frequencies, is named after either.
    either = {label.replace("w3", "w2"): edges for label, edges in found["out of phase"].items()}
    for label in ("2w2", "w2"):
        np.testing.assert_allclose(either[label], found["whole"][label], rtol=1e-9)
    assert not any("w2" in label or "w3" in label for label in found["in phase"])


def test_boundaries_refuse_a_part_of_a_pair_of_modes(config, tmp_path):
    said = refused("sweep", config, "-o", tmp_path / "x.h5", "--set", "methods.boundaries={modes: [2]}")
    assert "methods.boundaries.modes" in said
    assert "modes 2, 3 have equal frequencies" in said
