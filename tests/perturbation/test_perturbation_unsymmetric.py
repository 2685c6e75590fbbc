"""First-order boundaries with friction and mesh damping that varies: all tongues, against exact stability."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scenes import scene_text, succeeds

from gearstab.floquet.boundaries import boundaries
from gearstab.floquet.general import analyse
from gearstab.mesh import Mesh, PeriodicTerm
from gearstab.perturbation import Tongues, first_order, second_order
from gearstab.perturbation.damped import largest_rate
from gearstab.perturbation.unsymmetric import groups
from gearstab.system import GearSystem
from gearstab.waveforms import Constant, Rectangular, Scaled

WAVE = Rectangular(1.5)


def pair(epsilon: float, friction: float) -> GearSystem:
    """Two modes whose damping and friction, means included, are of the order of epsilon."""
    profiles = Scaled(WAVE, 0.3 * epsilon, 1.2 * epsilon), Scaled(Rectangular(1.3), 0.02 * epsilon, 0.5 * epsilon)
    term = PeriodicTerm("friction", friction * np.array([0.3, -0.2]), np.array([1.0, 0.4]), *profiles, lag=0.15)
    mesh = Mesh("mesh", np.array([0.7, 0.7]), np.array(1.0), np.array(epsilon), WAVE)
    damping = 2 * epsilon * np.diag([0.03, 0.09])
    return GearSystem(np.eye(2), np.diag([1.0, 3.0]), (mesh,), damping, terms=(term,))


def random_train(seed: int, epsilon: float) -> GearSystem:
    """Two or three modes, two meshes of 5 : 3, friction and varying damping of both signs, all of the order epsilon."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 4))
    a, b = rng.normal(size=(2, n, n))
    meshes, terms = [], []
    for ratio in (Fraction(1), Fraction(3, 5)):
        waves = [Rectangular(c) for c in rng.uniform(1.1, 1.9, 3)]
        strength = np.array(epsilon * rng.uniform(0.5, 1))
        lag, later = rng.uniform(size=2)
        meshes.append(Mesh(f"mesh{ratio}", 0.6 * rng.normal(size=n), np.array(1.0), strength, waves[0], ratio, lag=lag))
        stiffness = Scaled(waves[1], 0.3 * epsilon * rng.normal(), 1.5 * epsilon * rng.normal())
        damping = Scaled(waves[2], epsilon * rng.uniform(-0.02, 0.02), 0.5 * epsilon * rng.normal())
        left, right = rng.normal(size=(2, n))
        terms.append(PeriodicTerm(f"friction{ratio}", left, right, stiffness, damping, ratio, later))
    damping_matrix = 0.06 * epsilon * (np.eye(n) + b @ b.T / n)
    stiffness_matrix = np.diag(np.sort(rng.uniform(0.5, 6, n)))
    return GearSystem(
        np.eye(n) + 0.2 * a @ a.T / n, stiffness_matrix, tuple(meshes), damping_matrix, terms=tuple(terms)
    )


def alone(found: Tongues, room: float) -> list[int]:
    """Open tongues with boundaries, and no other root as near as ``room``: where theory holds as epsilon tends to 0."""
    center = found.center_frequency
    return [
        k
        for k, half in enumerate(found.half_width)
        if 0 < half < np.inf and np.sum(np.abs(center - center[k]) < room) == 1
    ]


def exact(system: GearSystem, ends: np.ndarray) -> np.ndarray:
    """Both edges of the one region about a predicted one."""
    found = boundaries(system, ends[0] - np.ptp(ends), ends[1] + np.ptp(ends))
    assert len(found.row) == 1
    return np.array([found.lower[0], found.upper[0]])


SEEDS = (0, 1, 2, 3, 4, 9, 11, 14, 16, 17)
"""Random trains with a tongue that is open and apart from others."""


@pytest.mark.parametrize(("kind", "seed"), [*(("pair", k) for k in range(3)), *(("random", k) for k in SEEDS)])
def test_exact_edges_tend_to_those_of_first_order(kind: str, seed: int) -> None:
    """Relative to the width, which is of the order of epsilon, the error of an edge is of first order."""

    def system(epsilon: float) -> GearSystem:
        return random_train(seed, epsilon) if kind == "random" else pair(epsilon, (-1.0, 1.0, 3.0)[seed])

    first = first_order(system(0.01), 3)
    # Narrower ones have the next order to cope with: (epsilon/width)^2 tells which.
    chosen = [k for k in alone(first, 0.08) if first.half_width[k] > 5e-4 * first.center_frequency[k]]
    assert chosen
    for k in chosen:
        errors = []
        for epsilon in (0.01, 0.005, 0.0025):
            ends = first_order(system(epsilon), 3).boundary_frequency[k]
            errors.append(np.abs(exact(system(epsilon), ends) - ends).max() / np.ptp(ends))
        assert errors[0] < 0.1, first.label[k]
        assert errors[2] < 0.3 * errors[0] + 1e-6, (first.label[k], errors)


def test_differences_are_among_them() -> None:
    for seed, label in ((3, "w3-w2"), (9, "w2-w1"), (11, "w2-w1"), (14, "w2-w1 (mesh3/5)")):
        first = first_order(random_train(seed, 0.01), 3)
        assert label in [first.label[k] for k in alone(first, 0.08)]
        tongue = first.index[first.label.index(label)]
        assert (tongue.kind, tongue.harmonic) == ("difference", 1)
        assert tongue.mode_p < tongue.mode_q
        assert first.index[first.label.index("(w2-w1)/2")].kind == "higher difference"


@pytest.mark.parametrize("seed", [2, 3, 14])
def test_motions_grow_between_the_edges_only(seed: int) -> None:
    """Floquet: at an edge the growth rate is of second order in epsilon, and beside it has the sign that it should."""
    system = random_train(seed, 0.0025)
    found = first_order(system, 3)
    chosen = [k for k in alone(found, 0.08) if found.half_width[k] > 5e-4 * found.center_frequency[k]]
    for lower, upper in found.boundary_frequency[chosen]:
        # The edges are right to less than 2 % of the width.
        aside = 0.03 * (upper - lower)
        omega = np.array([lower - aside, lower + aside, 0.5 * (lower + upper), upper - aside, upper + aside])
        rates = analyse(system, omega[None]).growth_rate[0]
        assert (np.sign(rates) == [-1, 1, 1, 1, -1]).all()


@pytest.mark.parametrize("label", ["w1+w2", "w2-w1", "2w1", "w1"])
def test_a_region_opens_at_the_threshold(label: str) -> None:
    """All that varies about its mean times a factor near the threshold, by Floquet theory at many mesh frequencies."""
    epsilon = 0.002
    system = pair(epsilon, 3.0)
    found = first_order(system, 2)
    k = found.label.index(label)
    (mesh,), (term,) = system.meshes, system.terms
    for factor, opens in ((0.97, False), (1.03, True)):
        times = factor * found.threshold[k]
        profiles = (replace(p, factor=times * p.factor) for p in term.profiles)
        scaled = replace(
            system, meshes=(replace(mesh, epsilon=times * mesh.epsilon),),
            terms=(replace(term, stiffness=next(profiles), damping=next(profiles)),),
        )  # fmt: skip
        assert (first_order(scaled, 2).half_width[k] > 0) == opens
        omega = found.center_frequency[k] * (1 + np.linspace(-3, 3, 1201) * epsilon)
        assert (analyse(scaled, omega[None]).growth_rate.max() > 0) == opens


def test_friction_shifts_a_tongue_of_unequally_damped_modes() -> None:
    """The theory would fail the tests above without the imaginary part: the shift is larger than their tolerance."""
    plain, rubbed = (first_order(pair(0.01, f), 1).boundary_frequency[1] for f in (0.0, 1.0))
    assert abs(rubbed.mean() - plain.mean()) > 0.05 * np.ptp(plain)


def star(friction: float, epsilon: float, turn: float = 0.0) -> GearSystem:
    """Modes of frequency sqrt(1.6), twice, and 2, three meshes at 120 degrees; coordinates turned by an angle."""
    angle = 2 * np.pi * np.arange(3) / 3
    g = 0.6 * np.stack([np.cos(angle), np.sin(angle), 0.5 * np.ones(3)], axis=1)
    c, s = np.cos(turn), np.sin(turn)
    rotation = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    meshes, terms = [], []
    for k in range(3):
        size = np.array(epsilon * (1 + 0.3 * k))
        meshes.append(Mesh(f"m{k}", g[k] @ rotation, np.ones(()), size, WAVE, lag=k / 3))
        along = 0.5 * friction * np.array([-g[k, 1], g[k, 0], 0.3])
        profile = Scaled(Rectangular(1.6), 0.1 * epsilon, 1.5 * size)
        terms.append(PeriodicTerm(f"t{k}", along @ rotation, g[k] @ rotation, profile, lag=k / 3 + 0.1))
    damping = rotation.T @ np.diag([0.02, 0.03, 0.05]) @ rotation * epsilon
    return GearSystem(np.eye(3), np.diag([1.06, 1.06, 3.73]), tuple(meshes), damping, terms=tuple(terms))


def test_modes_of_one_frequency() -> None:
    """A doublet: its tongue is that of the amplitude equations of all its modes, whatever the basis chosen for them."""
    found = first_order(star(1.0, 0.01), 1)
    turned = first_order(star(1.0, 0.01, 0.7), 1)
    for name in ("center_frequency", "half_width", "boundary_frequency"):
        np.testing.assert_allclose(getattr(turned, name), getattr(found, name), rtol=1e-8, atol=1e-13)
    # Thresholds of groups have nine digits.
    np.testing.assert_allclose(turned.threshold, found.threshold, rtol=1e-7)
    # The other members of the group are carried by its first one.
    absent = [2 in (tongue.mode_p, tongue.mode_q) for tongue in found.index]
    np.testing.assert_array_equal(np.isnan(found.center_frequency), absent)
    chosen = alone(found, 0.05)
    assert {"2w1", "w1+w3", "w3-w1"} <= {found.label[k] for k in chosen}
    for k in chosen:
        errors = []
        for epsilon in (0.01, 0.005, 0.0025):
            ends = first_order(star(1.0, epsilon), 1).boundary_frequency[k]
            errors.append(np.abs(exact(star(1.0, epsilon), ends) - ends).max() / np.ptp(ends))
        assert errors[0] < 0.1
        assert errors[2] < 0.3 * errors[0] + 1e-6


def coefficients(rng: np.random.Generator, p: int, q: int, rows: int) -> list[np.ndarray]:
    """G, H, M_P and M_Q of amplitude equations of any coefficients, most of them damped."""
    found = [0.3 * (rng.normal(size=(rows, *s)) + 1j * rng.normal(size=(rows, *s))) for s in ((p, q), (q, p))]
    for k in (p, q):
        b, e, odd = rng.normal(size=(3, rows, k, k))
        e -= np.trace(e, axis1=1, axis2=2)[:, None, None] / k * np.eye(k)
        found.append(-0.2 * np.eye(k) - 0.3 * b @ np.swapaxes(b, 1, 2) - 0.1 * odd + 0.5j * e)
    return found


@pytest.mark.parametrize(("p", "q"), [(1, 1), (1, 2), (2, 2), (3, 2)])
def test_groups_against_a_raster_of_detunings(p: int, q: int) -> None:
    """Edges and threshold of the largest real part of an eigenvalue."""
    parts = coefficients(np.random.default_rng(0), p, q, 25)
    shift, half, threshold = groups(*parts)
    lower, upper = shift - half, shift + half
    # The range of some tongues of lightly damped groups is a hundred times as long.
    sigma = np.linspace(-15, 15, 1501)
    open_ = 0
    chosen = np.flatnonzero(np.isfinite(half) & (np.maximum(-lower, upper) < 14))
    for k in chosen:
        inside, below, above = (
            sigma[growing(parts, k, p, f * threshold[k], sigma)] for f in (1 / threshold[k], 0.98, 1.1)
        )
        if len(inside):
            open_ += 1
            # The step of the raster.
            np.testing.assert_allclose([inside[0], inside[-1]], [lower[k], upper[k]], atol=0.0201)
        else:
            # It may miss a range narrower than its step.
            assert half[k] < 0.01
        assert (half[k] > 0) == (threshold[k] < 1)
        assert len(below) == 0
        assert len(above) > 0
    assert 5 <= open_ < len(chosen)


def growing(parts: list[np.ndarray], k: int, p: int, factor: float, sigma: np.ndarray) -> np.ndarray:
    """At which detunings the motions of a row grow, with G and H times a factor."""
    forward, backward, mean_p, mean_q = (part[k] for part in parts)
    matrix = np.block([[mean_p, factor * forward], [factor * backward, mean_q]])
    return np.asarray(largest_rate(sigma, np.broadcast_to(matrix, (len(sigma), *matrix.shape)), p) > 0)


def as_terms(system: GearSystem, numbers: tuple[int, ...]) -> GearSystem:
    """The same system with what varies of some meshes written as terms."""
    terms, meshes = [], list(system.meshes)
    for k in numbers:
        mesh = meshes[k]
        own = Scaled(mesh.waveform, 0.0, 2 * mesh.amplitude)
        terms.append(PeriodicTerm(mesh.name, mesh.direction, mesh.direction, own, None, mesh.frequency_ratio, mesh.lag))
        meshes[k] = replace(mesh, epsilon=0 * mesh.epsilon)
    return replace(system, meshes=tuple(meshes), terms=tuple(terms))


@pytest.mark.parametrize("damped", ["damped", "undamped", "partly damped"])
def test_symmetric_terms_are_meshes(damped: str) -> None:
    """Symmetric terms add the same as meshes, to rounding, doublets included; differences never open."""
    damping = {"damped": star(0.0, 0.05).damping, "undamped": None, "partly damped": np.diag([0.0, 0.0, 0.01])}[damped]
    for plain in (star(0.0, 0.05), random_train(2, 0.05)):
        own = replace(plain, terms=(), damping=damping if plain.size == 3 else plain.damping)
        known, found = first_order(own, 3), first_order(as_terms(own, (0, 1)), 3)
        place = [found.index.index(tongue) for tongue in known.index]
        for name in ("center_frequency", "half_width", "boundary_frequency", "threshold"):
            np.testing.assert_allclose(
                getattr(found, name)[place], getattr(known, name), rtol=1e-9, atol=1e-14, err_msg=name
            )
        differences = [k for k, tongue in enumerate(found.index) if tongue.difference]
        here = [k for k in differences if np.isfinite(found.center_frequency[k])]
        assert len(here) > 0
        assert len(differences) == len(found.index) - len(place)
        open_ = found.half_width[here] > 0
        assert not open_.any() or damped == "partly damped"
        assert (np.isinf(found.threshold[here]) | open_).all()


@pytest.mark.parametrize("twin", [False, True])
def test_meshes_that_all_but_cancel_stay_symmetric(twin: bool) -> None:
    """Two meshes leave 1e-9 of B, and its last seven digits are rounding: GH must be real all the same."""
    sides = ([0.7, 0.31, 0.2], [0.7, -0.31, 0.2])
    meshes = tuple(
        Mesh(name, np.array(g), np.ones(()), np.array(0.1 * part), WAVE, lag=0.13)
        for name, g, part in zip("ab", sides, (1.0, 1.0 + 1e-9), strict=True)
    )
    means = sum(np.outer(g, g) for g in np.array(sides))
    stiffness = np.diag([1.3, 4.1, 1.3 if twin else 7.7]) - means
    plain = GearSystem(np.eye(3), stiffness, meshes)
    quiet = PeriodicTerm("quiet", np.eye(3)[2], np.eye(3)[2], Constant(0.0))
    known, found = first_order(plain, 1), first_order(replace(plain, terms=(quiet,)), 1)
    k = known.label.index("w1+w3" if twin else "w1+w2")
    assert known.half_width[k] > 0
    np.testing.assert_allclose(found.half_width[: len(known.index)], known.half_width, rtol=1e-5)


def undamped(friction: float, antisymmetric: bool) -> GearSystem:
    """Modes of w = 1 and 2.3, B_12 = b and B_21 = +-b, or with friction of another phase."""
    wave = Rectangular(1.5)
    sign = -1.0 if antisymmetric else 1.0
    one, two = np.eye(2)
    terms = (
        PeriodicTerm("to", one, two, Scaled(wave, 0.0, 0.02)),
        PeriodicTerm("fro", two, one, Scaled(wave, 0.0, 0.02 * sign), lag=friction),
    )
    mesh = Mesh("mesh", np.ones(2), np.zeros(()), np.zeros(()), wave)
    return GearSystem(np.eye(2), np.diag([1.0, 2.3**2]), (mesh,), terms=terms)


@pytest.mark.parametrize(("antisymmetric", "open_", "shut"), [(False, "w1+w2", "w2-w1"), (True, "w2-w1", "w1+w2")])
def test_undamped_modes_have_edges_where_the_product_is_real_and_positive(
    antisymmetric: bool, open_: str, shut: str
) -> None:
    found = first_order(undamped(0.0, antisymmetric), 1)
    k, other = (found.label.index(label) for label in (open_, shut))
    # |B| = 0.02/pi, and |sigma| < |B|/sqrt(w_1 w_2).
    assert found.half_width[k] == pytest.approx(0.02 / np.pi / np.sqrt(2.3), rel=1e-12)
    assert (found.half_width[other], found.threshold[k]) == (0, 0)
    assert np.isinf(found.threshold[other])
    omega = found.center_frequency[k] + found.half_width[k] * np.array([-1.05, -0.95, 0.95, 1.05])
    rates = analyse(undamped(0.0, antisymmetric), omega[None]).growth_rate[0]
    np.testing.assert_array_equal(rates > 1e-5, [False, True, True, False])
    still = found.center_frequency[other] + found.half_width[k] * np.linspace(-2, 2, 41)
    assert analyse(undamped(0.0, antisymmetric), still[None]).growth_rate.max() < 1e-5


def test_undamped_modes_with_a_complex_product_grow_at_any_detuning() -> None:
    """The half-width is infinite: Floquet growth falls as 1/sigma on both sides, and does not end."""
    system = undamped(0.1, False)
    found = first_order(system, 1)
    k = found.label.index("w1+w2")
    assert np.isinf(found.half_width[k])
    assert found.threshold[k] == 0
    assert np.isnan(found.boundary_frequency[k]).all()
    sigma = np.array([0.02, 0.04])
    for side in (-1, 1):
        rates = analyse(system, (3.3 + side * sigma)[None]).growth_rate[0]
        # 2nd order of epsilon over sigma.
        assert rates[1] == pytest.approx(rates[0] / 2, rel=0.1)
        assert rates[1] > 1e-5


def test_a_mode_without_damping_beside_a_damped_one_has_no_edges() -> None:
    system = pair(0.01, 1.0)
    # The mean of the friction's damping is taken back in mode 1.
    shapes = np.linalg.eigh(system.mean_stiffness_matrix())[1]
    mean = 0.02 * 0.01 * np.outer([0.3, -0.2], [1.0, 0.4])
    weights = shapes.T @ (system.damping + mean) @ shapes
    bare = system.damping - weights[0, 0] * np.outer(shapes[:, 0], shapes[:, 0])
    found = first_order(replace(system, damping=bare), 1)
    k, other = found.label.index("w1+w2"), found.label.index("2w2")
    assert np.isinf(found.half_width[k])
    assert np.isnan(found.boundary_frequency[k]).all()
    assert 0 < found.half_width[other] < np.inf
    assert found.index[-1].kind != "self-excited"


def test_means_that_destabilise_a_mode() -> None:
    """Negative mean damping: growth at any mesh frequency by Floquet theory too, and a row that says so."""
    system = pair(0.01, 1.0)
    drag = PeriodicTerm("drag", np.array([0.0, 1.0]), np.array([0.0, 1.0]), None, Constant(np.array([-0.004, 0.0])))
    both = replace(system, terms=(*system.terms, drag))
    found = first_order(both, 1)
    assert found.index[-1].label == "mode 2 self-excited"
    # In the other row it is not.
    np.testing.assert_array_equal(found.half_width[-1], [np.inf, 0])
    np.testing.assert_array_equal(found.threshold[-1], [0, np.inf])
    assert np.isnan(found.center_frequency[-1]).all()
    with_mode = [2 in (tongue.mode_p, tongue.mode_q) for tongue in found.index]
    assert np.isinf(found.half_width[with_mode, 0]).all()
    assert 0 < found.half_width[found.label.index("2w1"), 0] < np.inf
    omega = np.random.default_rng(0).uniform(1.0, 6.0, 50)
    rates = analyse(both, np.stack([omega, omega])).growth_rate
    assert rates[0].min() > 0
    assert rates[1].min() < 0


def test_a_circulatory_mean_makes_a_doublet_flutter() -> None:
    """Two modes of one frequency and S = [[0, s], [-s, 0]]: growth s/(2 w) less the damping, at any mesh frequency."""

    def system(s: float) -> GearSystem:
        one, two = np.eye(2)
        terms = (
            PeriodicTerm("to", one, two, Constant(s)),
            PeriodicTerm("fro", two, one, Constant(-s)),
        )
        mesh = Mesh("mesh", one, np.zeros(()), np.zeros(()), WAVE)
        return GearSystem(np.eye(2), 4 * np.eye(2), (mesh,), 0.02 * np.eye(2), terms=terms)

    for s, grows in ((0.03, False), (0.05, True)):
        found = first_order(system(s), 1)
        assert (found.index[-1].label == "mode 1 self-excited") == grows
        rate = analyse(system(s), np.array([[1.7]])).growth_rate[0, 0]
        assert rate == pytest.approx(s / 4 - 0.01, abs=1e-5)


def test_rows_are_solved_as_single_systems() -> None:
    """Rows of a batch that differ in epsilon, friction, contact ratio, lag, damping and degeneracy."""
    values = np.array([[0.0, 0.3, 1.5, 0.0], [0.05, 0.0, 1.3, 0.2], [0.02, -0.5, 1.5, 0.4], [0.03, 0.8, 1.7, 0.1]])
    extra = np.array([0.0, 0.0, 0.3, 0.0])

    def system(v: np.ndarray, soft: np.ndarray) -> GearSystem:
        epsilon, size, ratio, lag = np.moveaxis(v, -1, 0)
        g = np.array([0.5, 0.4, 0.3])
        mesh = Mesh("mesh", g, np.ones(()), epsilon, Rectangular(ratio), lag=lag)
        profile = Scaled(Rectangular(ratio), 0.1 * epsilon, size * epsilon)
        term = PeriodicTerm("rub", np.array([0.2, 0.3, -0.4]), g, profile, None, lag=lag)
        stiffness = np.diag([1.0, 1.0, 3.0]) - np.outer(g, g) + soft[..., None, None] * np.diag([1.0, 0, 0])
        damping = (0.01 + 0.1 * epsilon)[..., None, None] * np.eye(3)
        return GearSystem(np.eye(3), stiffness, (mesh,), damping, terms=(term,))

    batch = first_order(system(values, extra), 2)
    for k in range(4):
        single = first_order(system(values[k], extra[k]), 2)
        assert single.index == batch.index
        for name in ("center_frequency", "half_width", "boundary_frequency", "threshold"):
            np.testing.assert_allclose(getattr(batch, name)[..., k], getattr(single, name), rtol=1e-7, atol=1e-12)


def test_frequencies_of_terms_alone_have_tongues() -> None:
    """Labels give Omega, as those of exact boundaries do; an irrational ratio is a decimal number."""
    for ratio, label in ((Fraction(3, 2), "4w1/3"), (0.6180339887, "2w1/0.618034")):
        system = pair(0.01, 1.0)
        moved = replace(system, terms=tuple(replace(term, frequency_ratio=ratio) for term in system.terms))
        found = first_order(moved, 1)
        tongue = found.index[found.label.index(label)]
        assert (tongue.harmonic, tongue.mesh) == (0, "mesh")
        k = found.label.index(label)
        assert found.center_frequency[k] * float(ratio) == pytest.approx(
            found.center_frequency[found.label.index("2w1")]
        )
        assert found.half_width[k] > 0
        if isinstance(ratio, Fraction):
            ends = found.boundary_frequency[k]
            np.testing.assert_allclose(exact(moved, ends), ends, atol=0.02 * np.ptp(ends))


def test_order_two_refuses_terms() -> None:
    with pytest.raises(ValueError, match="supports only periodic mesh stiffness"):
        second_order(pair(0.01, 1.0), 1)


SWEEP = scene_text("perturbation_unsymmetric_sweep")


def test_a_sweep_over_friction_against_floquet(tmp_path: Path) -> None:
    (tmp_path / "case.yaml").write_text(SWEEP)
    out = tmp_path / "out.h5"
    succeeds("sweep", tmp_path / "case.yaml", "-o", out)
    with xr.open_datatree(out) as tree:
        data, stable = tree["perturbation"].to_dataset(), tree["floquet"]["stable"].values.reshape(-1, 2)
    labels = [str(label) for label in data["label"].values]
    lower, upper = data["boundary_frequency"].values[labels.index("w2-w1")].reshape(2, -1)
    # Friction of either sign opens the difference, on one side of its root or on the other one; the mean of its damping
    # makes mode 2 grow, at any mesh frequency, in every second row.
    assert labels[-1] == "mode 2 self-excited"
    alone = np.isinf(data["half_width"].values[-1].ravel())
    np.testing.assert_array_equal(alone, [False, True] * 3)
    omega = np.array([1.3, 1.4])
    inside = (lower[:, None] < omega) & (omega < upper[:, None])
    np.testing.assert_array_equal(inside[::2], [[False, False], [False, True], [True, False]])
    np.testing.assert_array_equal(stable == 0, inside | alone[:, None])
