"""Boundaries found block by block: the regions of systems whose meshes do not couple all coordinates."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from planetary_gears import cyclic, planetary
from systems import COSINE, CURVE, GENERAL, LINES, TRAPEZOID, WAVE, oscillator, smooth_train, with_ramps

from gearstab.floquet import solve
from gearstab.floquet.boundaries import Boundaries, boundaries, undamped
from gearstab.floquet.boundaries.smooth import parts
from gearstab.floquet.segments.blocks import split
from gearstab.floquet.segments.pattern import prepare
from gearstab.modal import mean_modes
from gearstab.system import GearSystem
from gearstab.systems import build
from gearstab.waveforms import Rectangular, Waveform


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
    monkeypatch.setattr(undamped, "DENSITY", density)
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


# --- smooth mesh stiffness searched block by block: the edges of the whole, of each part alone, and of a raster


def waved(system: GearSystem, sun: Waveform, ring: Waveform) -> GearSystem:
    """A planetary gear with other waves."""
    waves = {"s": sun, "r": ring}
    return replace(system, meshes=tuple(replace(m, waveform=waves[m.name[0]]) for m in system.meshes))


def beside(first: GearSystem, second: GearSystem, damping: np.ndarray | None = None) -> GearSystem:
    """Two systems that know nothing of each other, as one."""
    n, m = first.size, second.size

    def diagonal(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.block([[a, np.zeros((n, m))], [np.zeros((m, n)), b]])

    meshes = [replace(mesh, direction=np.pad(mesh.direction, (0, m))) for mesh in first.meshes]
    meshes += [
        replace(mesh, direction=np.pad(mesh.direction, (n, 0)), name=f"other {mesh.name}") for mesh in second.meshes
    ]
    return GearSystem(
        diagonal(first.mass, second.mass), diagonal(first.stiffness, second.stiffness), tuple(meshes), damping
    )


COPIES = 5e-8
"""Searched as a whole, copies of a block have their multipliers at the same places, where rounding moves edges by some
square roots of eps, 1.5e-8; blocks are right to their tolerance."""


def same(found: Boundaries, known: Boundaries, rounding: float = 1e-13) -> None:
    """The same regions, each edge within the tolerances of both, and the same names where one name is all there is."""
    np.testing.assert_array_equal(found.row, known.row)
    np.testing.assert_array_equal(found.cut, known.cut)
    assert len(found.row)
    for own, other, near in zip(edges(found), edges(known), found.tolerance + known.tolerance, strict=True):
        np.testing.assert_allclose(own, other, rtol=near + rounding)
    for own, other in zip(found.members, known.members, strict=True):
        assert own == other or len(own) > 1 or len(other) > 1


def check_raster(found: Boundaries, system: GearSystem, points: int = 150) -> None:
    """Check that points are unstable by the other method just where they lie in a region."""
    omega = np.linspace(*found.limits, points)
    inside = np.zeros((found.rows, points), dtype=bool)
    for row, (lower, upper) in zip(found.row, edges(found), strict=True):
        inside[row] |= (omega >= lower) & (omega <= upper)
    assert inside.any()
    assert not inside.all()
    np.testing.assert_array_equal(solve(system, omega).stable.reshape(inside.shape) == 0, inside)


RAMPS = TRAPEZOID, replace(TRAPEZOID, contact_ratio=1.6)
WAVES = {"sinusoids": (COSINE, COSINE), "series": (WAVE, COSINE), "ramps": RAMPS, "samples": (LINES, CURVE)}


class TestPlanetary:
    @pytest.mark.parametrize("waves", WAVES.values(), ids=WAVES)
    def test_meshes_in_phase(self, waves):
        system = waved(cyclic(3, epsilon=0.2), *waves)
        found = boundaries(system, 5.0, 5.6, 1e-9, 1e-5)
        same(found, boundaries(system, 5.0, 5.6, 1e-9, 1e-5, reduction=False), COPIES)
        same(found, boundaries(system, 5.0, 5.6, 1e-11, 1e-5))
        check_raster(found, system)

    def test_modes_of_one_type_only_are_named_together(self):
        system = with_ramps(planetary())
        sizes = sorted((part.pattern.size, part.copies) for part, division in parts(system, True) if division)
        assert sizes == [(3, 1), (6, 1), (12, 1)]
        found = boundaries(system, 5.0, 6.0, 1e-10, 1e-5)
        same(found, boundaries(system, 5.0, 6.0, 1e-10, 1e-5, reduction=False), COPIES)
        kinds = mode_types(system)
        assert all(kinds[t.mode_p - 1] == kinds[t.mode_q - 1] for members in found.members for t in members)

    @pytest.mark.parametrize("kind", ["stiffness", "mass"])
    def test_damped(self, kind):
        """In proportion to the stiffness, and to the mass: uniform."""
        system = waved(cyclic(3, epsilon=0.2), *RAMPS)
        drag = 0.003 * system.mean_stiffness_matrix() if kind == "stiffness" else 0.01 * system.mass
        system = replace(system, damping=drag)
        found = boundaries(system, 5.2, 5.6, 1e-9, 1e-5)
        same(found, boundaries(system, 5.2, 5.6, 1e-9, 1e-5, reduction=False), COPIES)
        check_raster(found, system)

    @pytest.mark.slow
    def test_rows_with_and_without_damping(self):
        system = with_ramps(planetary())
        ratios = np.array([0.0, 1e-4, 1e-3])[:, None, None]
        system = replace(system, damping=ratios * system.mean_stiffness_matrix())
        found = boundaries(system, 5.3, 6.0, 1e-10, 1e-5)
        same(found, boundaries(system, 5.3, 6.0, 1e-10, 1e-5, reduction=False), COPIES)
        check_raster(found, system, 800)


class TestApart:
    """A train and an oscillator beside it: the regions of both, each searched by itself."""

    @pytest.mark.parametrize("drag", [None, 0.02 * np.eye(3), 0.03 * np.diag([1.0, 0.3, 4.0]), GENERAL])
    @pytest.mark.parametrize("wave", [COSINE, Rectangular(1.4)], ids=["smooth", "jumps"])
    def test_regions_are_united(self, drag, wave):
        train = smooth_train(TRAPEZOID, WAVE, damping=drag)
        other = oscillator(wave, 0.4, 3.3, damping=None if drag is None else 0.02)
        total = None if drag is None else np.pad(drag, (0, 1)) + np.diag([0.0, 0.0, 0.0, 0.02])
        system = beside(train, other, total)
        found = boundaries(system, 1.5, 6.5)
        each = [boundaries(one, 1.5, 6.5) for one in (train, other)]
        assert len(found.row) < sum(len(one.row) for one in each) or drag is not None
        # All are right to 1e-10, with some share of the steps' error.
        np.testing.assert_allclose(edges(found), joined(*each), rtol=3e-10)
        check_raster(found, system)

    def test_identical_parts_are_searched_once(self):
        one = smooth_train(TRAPEZOID, WAVE)
        twins, single = boundaries(beside(one, one), 1.5, 6.5), boundaries(one, 1.5, 6.5)
        np.testing.assert_allclose(edges(twins), edges(single), rtol=3e-10)
        # Searched twice it would take twice as many.
        assert twins.evaluations.sum() < 1.5 * single.evaluations.sum()
        np.testing.assert_array_equal(twins.contacts, 2 * single.contacts)

    def test_rows_that_split_differently(self):
        """In one row the second part's stiffness does not vary, in another both parts are alike."""
        epsilon = np.array([0.4, 0.0, 0.2])
        system = beside(oscillator(COSINE, 0.4), oscillator(COSINE, epsilon))
        found = boundaries(system, 0.6, 4.0)
        for row, own in enumerate(epsilon):
            each = [boundaries(oscillator(COSINE, e), 0.6, 4.0) for e in (0.4, own)]
            np.testing.assert_allclose(edges(found)[found.row == row], joined(*each), rtol=3e-10)

    @pytest.mark.parametrize("still", [0.0, 0.3])
    def test_a_mode_that_no_mesh_deflects_needs_no_steps(self, still):
        mesh = replace(oscillator(COSINE, 0.4).meshes[0], direction=np.array([1.0, 0.0]))
        drag = np.diag([0.02, still])
        system = GearSystem(np.eye(2), np.diag([0.0, 7.0]), (mesh,), drag)
        assert sorted(division is None for _, division in parts(system, True)) == [False, True]
        found, one = boundaries(system, 0.6, 4.0), boundaries(oscillator(COSINE, 0.4, damping=0.02), 0.6, 4.0)
        np.testing.assert_allclose(edges(found), edges(one), rtol=3e-10)
        assert {(t.mode_p, t.mode_q) for members in found.members for t in members} == {(1, 1)}

    def test_a_still_mode_that_grows_by_itself_is_unstable_everywhere(self):
        mesh = replace(oscillator(COSINE, 0.4).meshes[0], direction=np.array([1.0, 0.0]))
        system = GearSystem(np.eye(2), np.diag([0.0, 7.0]), (mesh,), np.diag([0.02, -0.01]))
        found = boundaries(system, 0.6, 4.0)
        np.testing.assert_allclose(edges(found), [[0.6, 4.0]], rtol=1e-15)
        assert found.members[0][0].label == "mode 2 self-excited"
