"""The stated tolerance of every edge contains its error, rounding included: against 40 digits."""

import json
from fractions import Fraction

import mpmath as mp
import numpy as np
import pytest
from scenes import DATA

from gearstab.floquet.boundaries import boundaries
from gearstab.mesh import Mesh
from gearstab.system import GearSystem
from gearstab.systems import build
from gearstab.waveforms import Rectangular

mp.mp.dps = 40
CONTACT = 1.37
"""Two pairs of teeth carry for 0.37 of the period."""
GROWS = mp.mpf(10) ** -30
"""Relative error of a discriminant at 40 digits and phases of some ten turns, with room."""


def planets(split: float, errors: tuple[float, float, float], epsilon: float) -> GearSystem:
    """A sun gear between three equally spaced planets in phase, on a shaft that is stiffer in one direction by
    ``split``; meshes differ by their ``errors``. Both motions have almost one frequency and leave the circle together.
    """
    meshes = []
    for k, error in enumerate(errors):
        angle = 2 * np.pi * k / 3
        direction, level = np.array([np.cos(angle), np.sin(angle)]), np.array(0.6 * (1 + error))
        meshes.append(Mesh(f"m{k}", direction, level, np.array([epsilon]), Rectangular(CONTACT), Fraction(1), 0.0))
    return GearSystem(np.eye(2), np.diag([1.0, 1.0 + split]), tuple(meshes))


def unstable(system: GearSystem, omega: mp.mpf) -> bool:
    """Whether a multiplier is off the circle, for two coordinates of mass 1: rho = lambda + 1/lambda from the traces of
    M and M^2.
    """
    matrix = mp.eye(4)
    share = mp.mpf(CONTACT) - 1
    for part, wave in ((share, 1 - share), (1 - share, -share)):
        generator = mp.zeros(4)
        generator[0, 2] = generator[1, 3] = 1
        for i in range(2):
            for j in range(2):
                stiffness = mp.mpf(system.stiffness[i, j])
                for mesh in system.meshes:
                    level = mp.mpf(float(mesh.mean_stiffness)) * (1 + 2 * mp.mpf(mesh.epsilon[0]) * wave)
                    stiffness += level * mp.mpf(mesh.direction[i]) * mp.mpf(mesh.direction[j])
                generator[2 + i, j] = -stiffness
        matrix = mp.expm(generator * (2 * mp.pi * part / omega)) * matrix
    square = matrix * matrix
    total, squares = (sum(m[i, i] for i in range(4)) for m in (matrix, square))
    difference = 2 * (squares + 4) - total**2
    if difference < -GROWS:
        return True
    return (abs(total) + mp.sqrt(max(difference, 0))) / 2 > 2 + GROWS


def equal_chains(seed: int) -> GearSystem:
    """Two equal chains of three masses with a mesh each, in phase."""
    rng = np.random.default_rng([31, seed])
    difference = np.eye(3) - np.eye(3, k=-1)
    mass, spring = np.diag(rng.uniform(0.4, 2.5, 3)), difference.T @ np.diag(rng.uniform(0.3, 3, 3)) @ difference
    direction = np.array([rng.uniform(0.5, 2), 1.0, 0.0])
    epsilon = np.array([10 ** rng.uniform(-4, -1)])
    meshes = [
        Mesh(f"m{k}", np.kron(np.eye(2)[k], direction), np.array(1.3), epsilon, Rectangular(CONTACT), Fraction(1), 0.0)
        for k in range(2)
    ]
    return GearSystem(np.kron(np.eye(2), mass), np.kron(np.eye(2), spring), tuple(meshes))


SCENES = [
    (8e-9, (2e-9, 1e-7, 3e-8), 0.0015), (2e-8, (1e-6, 2e-8, 4e-7), 0.00057), (6.8e-8, (1e-5, 3e-6, 1e-9), 0.00022),
    (1.5e-6, (2e-8, 6e-6, 1e-7), 0.00043), (3.4e-5, (4e-8, 1e-6, 2e-5), 0.000067), (4.9e-7, (1e-7, 2e-9, 5e-8), 0.18),
]  # fmt: skip


@pytest.mark.parametrize(("split", "errors", "epsilon"), SCENES)
def test_edges_of_almost_equal_modes(split: float, errors: tuple[float, float, float], epsilon: float) -> None:
    system = planets(split, errors, epsilon)
    found = boundaries(system, 0.6, 3.2)
    assert len(found.row) >= 4
    assert not found.cut.any()
    # What rounding leaves open near 1 and -1 is of the order of the root of 1e-16, over a phase of some radians.
    assert (found.tolerance < 1e-7).all()
    for lower, upper, tolerance in zip(found.lower, found.upper, found.tolerance, strict=True):
        for edge, side in ((lower, 1), (upper, -1)):
            inside, outside = (mp.mpf(edge) * (1 + sign * mp.mpf(tolerance)) for sign in (side, -side))
            assert unstable(system, inside), (edge, tolerance)
            assert not unstable(system, outside), (edge, tolerance)


@pytest.mark.parametrize("seed", range(6))
def test_edges_of_equal_parts_that_are_not_split(seed: int) -> None:
    """Both pairs of multipliers leave the circle at once: the edges are those of one part alone."""
    system = equal_chains(seed)
    whole, split = boundaries(system, 0.7, 4.0, reduction=False), boundaries(system, 0.7, 4.0)
    assert len(whole.row) == len(split.row) >= 4
    allowed = whole.tolerance + split.tolerance
    for name in ("lower", "upper"):
        assert (np.abs(getattr(whole, name) / getattr(split, name) - 1) <= allowed).all()
    # Rounding takes no more than what was asked for, but beside 1 and -1.
    assert np.median(whole.tolerance) < 1e-10


# --- edges of instability regions against those that AUTO found by collocation and continuation (docs/auto.md)


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


OF_AUTO = [(scene, epsilon) for scene in ("pair", "three_gears") for epsilon in AUTO[scene]]


@pytest.mark.parametrize(("scene", "epsilon"), OF_AUTO)
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
