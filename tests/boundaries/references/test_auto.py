"""Edges of instability regions against those that AUTO found by collocation and continuation (docs/auto.md)."""

import json
from fractions import Fraction

import numpy as np
import pytest
from scenes import DATA

from gearstab.floquet.boundaries import boundaries
from gearstab.systems import build

AUTO = json.loads((DATA / "auto.json").read_text())


def cosine(name: str, epsilon: object) -> dict:
    return {"name": name, "mean_stiffness": 1.0, "epsilon": epsilon, "waveform": {"kind": "fourier", "cos": [1.0]}}


def system(scene: str, epsilon: object):
    if scene == "pair":
        return build(
            {"kind": "gear_pair", "equivalent_mass": 1.0, "damping_ratio": 0.02, "meshes": [cosine("mesh", epsilon)]}
        )
    return build(
        {
            "kind": "two_stage", "inertias": [1.0, 0.3, 4.0], "input_shaft_stiffness": 0.5, "tooth_ratio": Fraction(1),
            "damping": {"rayleigh": [0.02, 0.01]},
            "meshes": [cosine("first", epsilon), cosine("second", epsilon) | {"phasing": -0.25}],
        }
    )  # fmt: skip


SCENES = [(scene, epsilon) for scene in ("pair", "three_gears") for epsilon in AUTO[scene]]


@pytest.mark.parametrize(("scene", "epsilon"), SCENES)
def test_edges_are_those_of_auto(scene: str, epsilon: str) -> None:
    start, stop = {"pair": (0.55, 3.2), "three_gears": (0.9, 8.0)}[scene]
    found = boundaries(system(scene, float(epsilon)), start, stop, tolerance=1e-12)
    assert not found.cut.any()
    expected = np.array(AUTO[scene][epsilon], dtype=object)
    order = np.argsort(expected[:, 1].astype(float))
    kind, place = expected[order, 0], expected[order, 1].astype(float)
    ours = np.sort(np.concatenate([found.lower, found.upper]))
    assert len(ours) == len(place)
    # AUTO's tolerance for special points, 1e-10 of its continuation parameter.
    np.testing.assert_allclose(ours, place, rtol=2e-10)
    # A torus bifurcation is the edge of a combination instability, and no other is.
    combination = [any("combination" in t.kind for t in members) for members in found.members]
    sides = np.argsort(np.concatenate([found.lower, found.upper]))
    np.testing.assert_array_equal(np.array(combination * 2)[sides], kind == "TR")


def test_rows_together_are_rows_alone() -> None:
    """Regions and their names, of smooth waves with damping: only some of the rows leave doubts about a name."""
    epsilons = [0.1, 0.2, 0.3]
    together = boundaries(system("three_gears", np.array(epsilons)), 0.9, 8.0)
    for row, epsilon in enumerate(epsilons):
        alone = boundaries(system("three_gears", epsilon), 0.9, 8.0)
        own = np.flatnonzero(together.row == row)
        np.testing.assert_allclose(together.lower[own], alone.lower, rtol=1e-9)
        names = [[t.label for t in together.members[k]] for k in own]
        assert names == [[t.label for t in members] for members in alone.members]
