"""Edges of all instability regions of conservative systems."""

import json
from fractions import Fraction

import numpy as np
import oracle
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import DATA
from scipy.optimize import brentq
from tongues import disagreements, inside, train

from gearstab.floquet import solve
from gearstab.floquet.boundaries import BOUNDARY_FLAGS, boundaries, union
from gearstab.perturbation import first_order
from gearstab.system import GearSystem
from gearstab.systems import build

CASES = json.loads((DATA / "lin_parker_2002_edges.json").read_text())["cases"]
EPSILONS = np.array([0.005, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5])


def both(epsilon: object, *args: object, **options: object) -> GearSystem:
    """Lin & Parker's train with the same epsilon in both meshes."""
    return train(*args, epsilon=(epsilon, epsilon), **options)


def matrices(mass: object, stiffness: object, meshes: list[dict], **options: object) -> GearSystem:
    common = {"mean_stiffness": 1.0, "contact_ratio": 1.5, "frequency_ratio": Fraction(1)}
    meshes = [{"name": f"m{k}", **common, **mesh} for k, mesh in enumerate(meshes)]
    mass, stiffness = np.asarray(mass, dtype=float), np.asarray(stiffness, dtype=float)
    return build({"kind": "matrices", "mass": mass, "stiffness": stiffness, "meshes": meshes, **options})


@pytest.mark.parametrize("case", CASES, ids=lambda c: f"{c['contact_ratio']}-{c['phasing']}-{c['R']}-{c['epsilon']}")
def test_agrees_with_published_edges(case: dict) -> None:
    system = both(np.array([case["epsilon"]]), tuple(case["contact_ratio"]), case["phasing"], case["R"])
    found = boundaries(system, *case["range"])
    edges = np.concatenate([found.lower, found.upper])
    distance = np.abs(np.array(case["edges"])[:, None] - edges).min(axis=1)
    # Nine decimals, and edges of rho - 1 = 1e-6, which lie up to 1e-9 inside of rho = 1.
    assert distance.max() < 2e-9


def test_no_disagreement_with_a_raster_and_few_evaluations() -> None:
    system = both(EPSILONS)
    found = boundaries(system, 0.5, 7.0)
    assert disagreements(found, system, 0.5, 7.0, 6000) == {}
    # A raster of 1e-4 in [0.5, 7] has 65,000 points.
    assert found.evaluations.max() <= 65_000 / 40
    assert found.tolerance.max() < 1e-10
    assert len(found.row) > 180


@pytest.mark.parametrize(
    ("tooth_ratio", "contact_ratio"), [("1", (1.37, 1.62)), ("3/5", (1.5, 1.5)), ("2/3", (1.1, 1.9))]
)
def test_strong_variation(tooth_ratio: str, contact_ratio: tuple[float, float]) -> None:
    """epsilon = 0.9, where phases have no obvious number of turns and nearly all tongues have merged."""
    system = both(np.array([0.7, 0.9]), contact_ratio, 0.2, tooth_ratio)
    found = boundaries(system, 1.0, 7.0)
    assert disagreements(found, system, 1.0, 7.0, 6000) == {}


def test_low_mesh_frequencies() -> None:
    system = both(np.array([0.01, 0.9]))
    found = boundaries(system, 0.2, 0.3)
    assert disagreements(found, system, 0.2, 0.3, 6000) == {}
    assert (found.row == 0).sum() > 20


def meissner(omega: float, epsilon: float) -> float:
    """Half of the trace of a gear pair's monodromy matrix, m = k_g = 1, contact ratio 1.5."""
    half, a, b = np.pi / omega, np.sqrt(1 + epsilon), np.sqrt(1 - epsilon)
    return np.cos(a * half) * np.cos(b * half) - 0.5 * (a / b + b / a) * np.sin(a * half) * np.sin(b * half)


@pytest.mark.parametrize("epsilon", [0.01, 0.4, 0.9])
def test_gear_pair_against_the_closed_form(epsilon: float) -> None:
    mesh = {"name": "mesh", "mean_stiffness": 1.0, "epsilon": np.array([epsilon]), "contact_ratio": 1.5}
    found = boundaries(
        build({"kind": "gear_pair", "equivalent_mass": 1.0, "meshes": [mesh]}), 0.3, 3.0, tolerance=1e-12
    )
    omega = 1 / np.linspace(1 / 3.0, 1 / 0.3, 200_001)
    edges = []
    for level in (1.0, -1.0):
        value = np.array(meissner(omega, epsilon)) - level
        for k in np.flatnonzero(value[1:] * value[:-1] < 0):
            edges.append(
                brentq(lambda x, y=level: meissner(x, epsilon) - y, omega[k + 1], omega[k], xtol=1e-15, rtol=1e-15)
            )
    ours = np.concatenate([found.lower, found.upper])
    ours = np.sort(ours[~found.cut.T.ravel()])
    assert len(ours) == len(edges)
    # The trace is right to 1e-15 and has a slope of some epsilon^2 at least at the edge of the narrowest tongue.
    np.testing.assert_allclose(ours, np.sort(edges), rtol=1e-10 if epsilon < 0.1 else 2e-12)


def test_narrow_tongues_are_confirmed_in_forty_digits() -> None:
    """The narrowest tongues at epsilon = 0.005: unstable in the middle, stable just outside."""
    system = both(np.array([0.005]))
    found = boundaries(system, 0.9, 7.0)
    plain = oracle.plain(system, 0)
    width = found.upper - found.lower
    for k in np.argsort(width)[:3]:
        middle = 0.5 * (found.lower[k] + found.upper[k])
        assert oracle.solve(plain, middle).growth_rate > 1e-9
        for edge, side in ((found.lower[k], -1), (found.upper[k], 1)):
            assert oracle.verdict(plain, edge * (1 + side * 2e-10), 60)
            assert not oracle.verdict(plain, edge * (1 - side * 2e-10), 60)


def test_tolerance_and_floor_are_obeyed() -> None:
    system = both(np.array([0.05]))
    coarse = boundaries(system, 0.9, 7.0, tolerance=1e-5, width_floor=1e-3)
    fine = boundaries(system, 0.9, 7.0, tolerance=1e-13, width_floor=1e-9)
    assert coarse.tolerance.max() < 1e-5
    assert fine.tolerance.max() < 1e-13
    assert coarse.evaluations[0] < fine.evaluations[0]
    assert ((coarse.upper - coarse.lower) / coarse.lower).min() > 1e-3
    assert len(coarse.row) < len(fine.row)
    for low, high in zip(coarse.lower, coarse.upper, strict=True):
        k = np.argmin(np.abs(fine.lower - low))
        assert (low, high) == (pytest.approx(fine.lower[k], rel=1e-5), pytest.approx(fine.upper[k], rel=1e-5))


def test_regions_are_cut_at_the_range() -> None:
    system = both(np.array([0.3]))
    whole = boundaries(system, 0.9, 7.0)
    k = int(np.argmax(whole.upper - whole.lower))
    middle = 0.5 * float(whole.lower[k] + whole.upper[k])
    below, above = boundaries(system, 0.9, middle), boundaries(system, middle, 7.0)
    assert below.upper[-1] == middle
    assert above.lower[0] == middle
    assert below.cut[-1].tolist() == [False, True]
    assert above.cut[0].tolist() == [True, False]
    assert below.lower[-1] == pytest.approx(whole.lower[k], rel=1e-9)
    assert above.upper[0] == pytest.approx(whole.upper[k], rel=1e-9)
    assert below.members[-1] == above.members[0] == whole.members[k]


def test_without_variation_there_is_no_region() -> None:
    assert len(boundaries(both(np.array([0.0, 0.0])), 0.5, 7.0).row) == 0
    assert len(boundaries(both(np.array([0.3]), (2.0, 1.0)), 0.5, 7.0).row) == 0
    partly = boundaries(both(np.array([0.0, 0.3]), (1.5, 2.0)), 0.5, 7.0)
    assert set(partly.row) == {1}


DEGENERATE = {
    "two equal oscillators": ([[1, 0], [0, 1]], np.zeros((2, 2)), [[1, 0], [0, 1]], (0.0, 0.0)),
    "threefold symmetry in phase": (np.eye(3), np.diag([0, 0, 1.0]), "star", (0.0, 0.0, 0.0)),
    "threefold symmetry in sequence": (np.eye(3), np.diag([0, 0, 1.0]), "star", (0.0, 1 / 3, 2 / 3)),
    "coordinates without a mesh": (np.eye(3), np.diag([0, 0.7, 2.0]), [[1, 0, 0]], (0.0,)),
    "rigid-body mode": (np.diag([1.0, 0.3, 4.0]), np.zeros((3, 3)), [[1, 1, 0], [0, 1, 1]], (0.0, 0.2)),
}


@pytest.mark.parametrize("name", DEGENERATE)
def test_degenerate_systems(name: str) -> None:
    mass, stiffness, directions, lags = DEGENERATE[name]
    if directions == "star":
        directions = [[np.cos(a), np.sin(a), 0.5] for a in 2 * np.pi * np.arange(3) / 3]
    epsilon = np.array([0.0, 0.05, 0.4])
    meshes = [{"direction": d, "epsilon": epsilon, "lag": lag} for d, lag in zip(directions, lags, strict=True)]
    system = matrices(mass, stiffness, meshes)
    found = boundaries(system, 0.4, 4.0)
    assert set(found.row) == {1, 2}
    assert disagreements(found, system, 0.4, 4.0, 4000) == {}


def test_negative_stiffness() -> None:
    """A state, and the mean, may be negative: the count holds for every K(t)."""
    soft = [{"direction": [1, 0.4], "epsilon": np.array([0.5, 1.2, 2.5])}]
    system = matrices(np.eye(2), np.diag([0.3, 0.6]), soft)
    assert disagreements(boundaries(system, 0.3, 4.0), system, 0.3, 4.0, 4000) == {}
    unstable = [{"direction": [1, 0.4], "epsilon": np.array([0.1, 1.2]), "mean_stiffness": 0.25}]
    system = matrices(np.eye(2), np.diag([-0.3, 0.6]), unstable)
    found = boundaries(system, 0.3, 4.0)
    assert disagreements(found, system, 0.3, 4.0, 4000) == {}
    assert (found.lower[0], found.upper[0]) == (0.3, 4.0)


def test_five_coordinates_and_a_long_period() -> None:
    rng = np.random.default_rng(5)
    ratios = (Fraction(1), Fraction(1, 2), Fraction(3))
    meshes = [{"direction": rng.normal(size=5), "epsilon": np.array([0.3]), "frequency_ratio": r} for r in ratios]
    system = matrices(np.diag(rng.uniform(0.5, 2, 5)), np.diag(rng.uniform(0.5, 3, 5)), meshes)
    found = boundaries(system, 1.5, 3.0)
    assert disagreements(found, system, 1.5, 3.0, 2000) == {}
    assert len(found.row) > 20
    long = both(np.array([0.3]), tooth_ratio="7/17")
    assert disagreements(boundaries(long, 4.0, 7.0), long, 4.0, 7.0, 2000) == {}


@settings(max_examples=12)
@given(st.integers(0, 10_000), st.floats(0.05, 0.95), st.sampled_from(["1", "1/2", "2/3"]))
def test_random_pairs_of_meshes(seed: int, epsilon: float, ratio: str) -> None:
    rng = np.random.default_rng(seed)
    meshes = [
        {
            "direction": rng.normal(size=2),
            "epsilon": np.array([epsilon]),
            "contact_ratio": rng.uniform(1, 3),
            "lag": rng.uniform(),
            "mean_stiffness": rng.uniform(0.3, 2),
            "frequency_ratio": r,
        }
        for r in (Fraction(1), Fraction(ratio))
    ]
    system = matrices(np.eye(2), np.diag(rng.uniform(0.1, 2, 2)), meshes)
    found = boundaries(system, 0.8, 3.0)
    assert disagreements(found, system, 0.8, 3.0, 1500) == {}


@pytest.mark.parametrize("tooth_ratio", ["1", "3/5"])
def test_names_at_small_epsilon_are_those_of_perturbation_theory(tooth_ratio: str) -> None:
    """Each region of the first order, and only those, opens in proportion to epsilon, at the place and width
    predicted."""
    epsilon = np.array([1e-3])
    system = both(epsilon, (1.37, 1.62), 0.2, tooth_ratio)
    found = boundaries(system, 1.6, 7.0, width_floor=3e-5)
    theory = first_order(system, 8)
    predicted = {t: k for k, t in enumerate(theory.index)}
    assert len(found.row) > 6
    seen = set()
    for k, members in enumerate(found.members):
        assert len(members) == 1
        seen.add(members[0])
        j = predicted[members[0]]
        assert 0.5 * (found.lower[k] + found.upper[k]) == pytest.approx(theory.center_frequency[j, 0], rel=3e-6)
        assert found.upper[k] - found.lower[k] == pytest.approx(2 * theory.half_width[j, 0], rel=2e-2)
    centre, width = theory.center_frequency[:, 0], 2 * theory.half_width[:, 0]
    near = (centre > 1.6) & (centre < 7)
    # A tongue whose width is close to the floor may be on either side of it.
    for factor, compare in ((1.1, set.issuperset), (0.9, set.issubset)):
        wide = near & (width > factor * 3e-5 * centre)
        assert compare(seen, {t for t, w in zip(theory.index, wide, strict=True) if w})


def test_names_continue_from_epsilon_to_epsilon() -> None:
    """In steps of epsilon a region keeps its name: it moves less than to the next root, and no name comes twice in a
    row."""
    epsilon = np.linspace(0.02, 0.4, 39)
    found = boundaries(both(epsilon, (1.37, 1.62), 0.2), 1.3, 7.0)
    edges = found.arranged()
    centre = edges.boundary_frequency.mean(axis=1)
    step = np.abs(np.diff(centre, axis=1))
    assert np.nanmax(step) < 0.02
    assert all(occurrence == 0 for _, occurrence in edges.index)
    names = [t.label for t, _ in edges.index]
    assert {"w1+w3", "w2+w3", "2w2", "2w3", "w3", "(w2+w3)/2", "(w1+w3)/2", "w3/2", "2w3/3"} == set(names)
    opened = np.isfinite(centre)
    for name in ("w1+w3", "w2+w3", "2w2", "2w3", "w3"):
        assert opened[names.index(name)].all()


def test_merged_regions_stand_once() -> None:
    """At epsilon = 0.3 the tongues of w1+w2 and (w2+w3)/3 have become one region."""
    found = boundaries(both(np.array([0.02, 0.3]), (1.37, 1.62), 0.2), 1.1, 1.4)
    assert [sorted(t.label for t in m) for m in found.members if len(m) > 1] == [["(w2+w3)/3", "w1+w2"]]
    edges = found.arranged()
    names = [t.label for t, _ in edges.index]
    first, second = names.index("w1+w2"), names.index("(w2+w3)/3")
    flags = edges.flags[[first, second]]
    assert (flags[:, 0] == BOUNDARY_FLAGS["open"]).all()
    holder = edges.holder[first, 1]
    assert holder in (first, second)
    assert holder == edges.holder[second, 1]
    other = first + second - holder
    assert edges.flags[holder, 1] == BOUNDARY_FLAGS["open"] | BOUNDARY_FLAGS["merged"]
    assert edges.flags[other, 1] == BOUNDARY_FLAGS["absorbed"]
    assert np.isnan(edges.boundary_frequency[other, :, 1]).all()
    assert np.isfinite(edges.boundary_frequency[holder, :, 1]).all()


def test_arranged_holds_every_region_once() -> None:
    system = both(np.array([0.01, 0.2, 0.5, 0.9]), (1.3, 1.8), 0.1, "2/3")
    found = boundaries(system, 1.0, 7.0)
    edges = found.arranged()
    for row in range(4):
        pairs = edges.boundary_frequency[:, :, row]
        pairs = pairs[np.isfinite(pairs).all(axis=1)]
        mine = found.row == row
        assert np.array_equal(pairs[np.argsort(pairs[:, 0])], np.stack([found.lower, found.upper], axis=1)[mine])
    assert np.array_equal(np.isfinite(edges.tolerance), (edges.flags & BOUNDARY_FLAGS["open"]) > 0)


def test_blocks_unite() -> None:
    """Two halves of a batch, brought to one list of tongues, are the whole batch."""
    epsilon = np.array([0.05, 0.3, 0.5])
    whole = boundaries(both(epsilon), 0.9, 7.0).arranged()
    parts = [boundaries(both(e), 0.9, 7.0).arranged() for e in (epsilon[:1], epsilon[1:])]
    index = union(part.index for part in parts)
    assert index == whole.index
    for part, rows in zip(parts, (slice(0, 1), slice(1, None)), strict=True):
        place = [index.index(key) for key in part.index]
        # Rows are computed independently, but in chunks of another size: rounding may differ in the last bits.
        own = whole.boundary_frequency[place][..., rows]
        np.testing.assert_allclose(part.boundary_frequency, own, rtol=1e-10)
        assert np.array_equal(part.flags, whole.flags[place][:, rows])
        assert np.array_equal(np.append(place, -1)[part.holder], whole.holder[place][:, rows])
        others = np.setdiff1d(np.arange(len(index)), place)
        assert not whole.flags[others][:, rows].any()


def test_frequencies_that_no_harmonic_has() -> None:
    """Meshes at speeds 1 and 5/3 act at their difference too: tongues of second order at nu = 2/3 Omega and the
    like."""
    system = both(np.array([0.2]), tooth_ratio="3/5")
    found = boundaries(system, 1.5, 7.0)
    mixed = [k for k, members in enumerate(found.members) if members[0].harmonic == 0]
    assert len(mixed) > 5
    middle = 0.5 * (found.lower + found.upper)[mixed]
    assert (solve(system, middle).growth_rate[0] > 0).all()
    for k in mixed:
        tongue = found.members[k][0]
        assert tongue.mesh == "first+second"
        assert (3 * tongue.frequency_ratio) % 3 != pytest.approx(0)


@pytest.mark.parametrize(
    ("start", "stop", "options"),
    [(0, 1, {}), (2, 1, {}), (1, np.nan, {}), (1, 2, {"tolerance": 0}), (1, 2, {"width_floor": -1})],
)
def test_senseless_requests(start: float, stop: float, options: dict) -> None:
    with pytest.raises(ValueError, match="must"):
        boundaries(both(np.array([0.1])), start, stop, **options)


def test_single_system() -> None:
    """A system without a batch is one row."""
    found = boundaries(both(0.3), 0.9, 7.0)
    assert found.rows == 1
    assert inside(found, 0, np.array([5.4]))[0]
    assert found.labels()[-1] == "2w3"


def test_names_are_kept_from_small_to_large_epsilon() -> None:
    """Down to low mesh frequencies, where the leading part of a solution carries less than half of its action: once
    open, a tongue stays open or goes into the region of another one; it never changes its name for that of
    another."""
    epsilon = np.linspace(0.02, 0.5, 25)
    edges = boundaries(both(epsilon), 0.35, 7.0).arranged()
    centre = edges.boundary_frequency.mean(axis=1)
    merged = (edges.flags & BOUNDARY_FLAGS["merged"]) > 0
    for k, (tongue, occurrence) in enumerate(edges.index):
        assert occurrence == 0
        present = np.flatnonzero(edges.flags[k])
        assert np.array_equal(present, np.arange(present[0], 25)), tongue.label
        alone = np.where(merged[k], np.nan, centre[k])
        assert np.nanmax(np.abs(np.diff(alone)), initial=0.0) < 0.02, tongue.label


def test_modes_without_mesh_deflection_have_no_tongue() -> None:
    """Their multipliers meet others inside regions of the rest, which must not be named after them."""
    system = matrices(np.eye(3), np.diag([0, 0.7, 2.0]), [{"direction": [1, 0, 0], "epsilon": np.array([0.1, 0.4])}])
    found = boundaries(system, 0.3, 4.0)
    assert len(found.row) > 8
    assert {(t.mode_p, t.mode_q) for members in found.members for t in members} == {(2, 2)}
    assert all(len(members) == 1 for members in found.members)
