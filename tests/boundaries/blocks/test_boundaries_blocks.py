"""Boundaries found block by block: the regions of systems whose meshes do not couple all coordinates."""

from fractions import Fraction

import numpy as np
import pytest
from planetary_gears import planetary

from gearstab.floquet import solve
from gearstab.floquet.boundaries import Boundaries, boundaries
from gearstab.floquet.boundaries.undamped import search
from gearstab.floquet.segments.blocks import split
from gearstab.floquet.segments.pattern import prepare
from gearstab.modal import mean_modes
from gearstab.system import GearSystem
from gearstab.systems import build


def pairs(first: float, second: float, damping: list[float] | None = None, **other: object) -> GearSystem:
    """Two gear pairs of the given masses that know nothing of each other, on one drive."""
    mesh = {"mean_stiffness": 1.0, "epsilon": 0.4, "contact_ratio": 1.5, "frequency_ratio": Fraction(1)}
    meshes = [
        mesh | {"name": "a", "direction": np.array([1.0, 0.0])},
        mesh | {"name": "b", "direction": np.array([0.0, 1.0])} | other,
    ]
    drag = {} if damping is None else {"damping": {"matrix": np.diag(damping)}}
    scene = {"kind": "matrices", "mass": np.diag([first, second]), "stiffness": np.zeros((2, 2)), "meshes": meshes}
    return build(scene | drag)


def alone(mass: float, damping: float | None = None, **other: object) -> GearSystem:
    """One of them."""
    mesh = {"name": "m", "direction": np.array([1.0]), "mean_stiffness": 1.0, "epsilon": 0.4, "contact_ratio": 1.5}
    drag = {} if damping is None else {"damping": {"matrix": np.array([[damping]])}}
    scene = {"kind": "matrices", "mass": np.array([[mass]]), "stiffness": np.zeros((1, 1))}
    return build(scene | drag | {"meshes": [mesh | {"frequency_ratio": Fraction(1)} | other]})


def mode_types(system: GearSystem) -> np.ndarray:
    """The number of waves around the sun's four meshes in which each mode deflects them."""
    waves = np.abs(np.fft.rfft(mean_modes(system).mesh_deflection[:, :4], axis=1))
    return waves.argmax(axis=1)


def edges(found: Boundaries) -> np.ndarray:
    return np.stack([found.lower, found.upper], axis=-1)


def joined(*found: Boundaries) -> np.ndarray:
    """The union of intervals, one by one."""
    result: list[list[float]] = []
    for low, high in sorted(np.concatenate([edges(f) for f in found]).tolist()):
        if result and low < result[-1][1]:
            result[-1][1] = max(result[-1][1], high)
        else:
            result.append([low, high])
    return np.array(result)


@pytest.mark.parametrize("density", [0.3, 0.4, 0.6, 0.8, 1.0])
def test_edges_beside_a_multiplier_that_passes_one(density: float, monkeypatch: pytest.MonkeyPatch) -> None:
    # Multipliers meet 3e-5 rad from 1 just after one of them passed 1: there too long a step loses their signs.
    system = planetary()
    monkeypatch.setattr(search, "DENSITY", density)
    found = boundaries(system, 4.1, 6.2, 1e-10, 1e-5, reduction=False)
    known = boundaries(system, 4.5, 4.6, 1e-10, 1e-5)
    own = (found.lower > 4.5) & (found.upper < 4.6)
    np.testing.assert_allclose(edges(found)[own], edges(known), rtol=3e-10)


@pytest.mark.parametrize(("changes", "start", "stop"), [({}, 4.1, 6.2), ({"damping_ratio": 0.005}, 5.3, 6.2)])
def test_a_planetary_gear_in_blocks_and_as_a_whole(changes: dict, start: float, stop: float) -> None:
    system = planetary(**changes)
    assert sorted(b.pattern.size for p in prepare(system) for b in split(p)) == [3, 6, 12]
    found = boundaries(system, start, stop, 1e-10, 1e-5)
    whole = boundaries(system, start, stop, 1e-10, 1e-5, reduction=False)
    # Equal to what `boundaries` promises for a whole of several equal parts, whose twins coincide but for rounding; the
    # blocks are right to their own tolerance: 3e-10 away the growth rate is zero on one side of an edge only.
    np.testing.assert_allclose(edges(found), edges(whole), rtol=3e-8)
    if not changes:
        outside, inside = edges(found) * [1 - 3e-10, 1 + 3e-10], edges(found) * [1 + 3e-10, 1 - 3e-10]
        assert not (solve(system, outside.ravel()).growth_rate > 0).any()
        assert (solve(system, inside.ravel()).growth_rate > 0).all()
    np.testing.assert_array_equal(found.cut, whole.cut)
    # Multipliers of different blocks pass each other without a collision that would have to be looked into. (How many
    # evaluations that saves hangs on where brackets happen to lie. With damping no collisions are counted.)
    assert found.contacts.sum() < 0.5 * whole.contacts.sum() or changes
    # Named by modes that meshes in phase can couple, which the whole cannot always tell where regions overlap.
    kinds = mode_types(system)
    assert all(kinds[t.mode_p - 1] == kinds[t.mode_q - 1] for members in found.members for t in members)
    single = [(a, b) for a, b in zip(found.members, whole.members, strict=True) if len(a) == len(b) == 1]
    assert single
    assert all(a == b for a, b in single)


@pytest.mark.parametrize("masses", [(1.0, 1.3), (1.0, 0.37), (0.2, 2.9)])
@pytest.mark.parametrize("damping", [None, (0.02, 0.05)])
def test_regions_of_uncoupled_pairs_are_united(
    masses: tuple[float, float], damping: tuple[float, float] | None
) -> None:
    drag = None if damping is None else list(damping)
    found = boundaries(pairs(*masses, drag), 0.4, 5.0)
    each = [boundaries(alone(m, None if drag is None else drag[k]), 0.4, 5.0) for k, m in enumerate(masses)]
    np.testing.assert_allclose(edges(found), joined(*each), rtol=1e-9)
    assert {(t.mode_p, t.mode_q) for members in found.members for t in members} == {(1, 1), (2, 2)}
    assert any(len(members) > 1 for members in found.members) == (len(found.row) < sum(len(f.row) for f in each))


def test_identical_pairs_are_searched_once() -> None:
    twins, one = boundaries(pairs(1.0, 1.0), 0.4, 5.0), boundaries(alone(1.0), 0.4, 5.0)
    np.testing.assert_allclose(edges(twins), edges(one), rtol=1e-12)
    assert [[t.label for t in members] for members in twins.members] == [
        [t.label for t in members] for members in one.members
    ]
    # Searched twice it would take twice as many.
    assert twins.evaluations.sum() < 1.5 * one.evaluations.sum()


def test_rows_that_split_differently() -> None:
    """In one of three rows the second pair's stiffness does not vary, in another both are alike."""
    system = pairs(1.0, 1.0, epsilon=np.array([0.4, 0.0, 0.2]))
    found = boundaries(system, 0.4, 5.0)
    for row, epsilon in enumerate((0.4, 0.0, 0.2)):
        each = [boundaries(alone(1.0, epsilon=e), 0.4, 5.0) for e in (0.4, epsilon)]
        np.testing.assert_allclose(edges(found)[found.row == row], joined(*each), rtol=1e-9)


def test_a_mode_that_no_mesh_deflects_takes_no_part() -> None:
    """Damped or not, and without a share of its own in the search."""
    mesh = {"name": "m", "direction": np.array([1.0, 0.0]), "mean_stiffness": 1.0, "epsilon": 0.4, "contact_ratio": 1.5}
    meshes = [mesh | {"frequency_ratio": Fraction(1)}]
    scene = {"kind": "matrices", "mass": np.eye(2), "stiffness": np.diag([0.0, 7.0]), "meshes": meshes}
    for drag in ([0.02, 0.0], [0.02, 0.3]):
        found = boundaries(build(scene | {"damping": {"matrix": np.diag(drag)}}), 0.4, 5.0)
        one = boundaries(alone(1.0, 0.02), 0.4, 5.0)
        np.testing.assert_allclose(edges(found), edges(one), rtol=1e-9)
        assert {(t.mode_p, t.mode_q) for members in found.members for t in members} == {(1, 1)}
