"""Edges of instability regions of systems with periodic terms besides the mesh stiffness."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from systems import DAMPING, SHAFT, WITH_TERMS, friction, with_terms

from gearstab.floquet.boundaries import Boundaries, boundaries
from gearstab.floquet.boundaries.damped import proof
from gearstab.floquet.general import analyse
from gearstab.mesh import Mesh, PeriodicTerm
from gearstab.system import GearSystem
from gearstab.waveforms import Rectangular, Scaled

START, STOP = 1.5, 5.0


def inside(found: Boundaries, omega: np.ndarray, row: int = 0) -> np.ndarray:
    """Which mesh frequencies lie in a region of a row."""
    mine = found.row == row
    return np.any((omega[:, None] > found.lower[mine]) & (omega[:, None] < found.upper[mine]), axis=1)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * name.startswith("smooth")) for name in WITH_TERMS]
)
def test_regions_are_where_products_of_exponentials_grow(name: str) -> None:
    system = WITH_TERMS[name]
    found = boundaries(system, START, STOP)
    assert len(found.row) >= 4
    assert found.tolerance.max() < 1e-10
    # Random, so that no point falls on an end of the range.
    omega = np.random.default_rng(1).uniform(START, STOP, 100)
    np.testing.assert_array_equal(analyse(system, omega[None]).growth_rate[0] > 0, inside(found, omega))
    # The growth rate changes its sign within 1e-8 of each edge, where it is some 1e-9.
    for edges, cut, outwards in ((found.lower, found.cut[:, 0], -1), (found.upper, found.cut[:, 1], 1)):
        beside = edges[~cut] * (1 + 1e-8 * np.array([[outwards], [-outwards]]))
        growth = analyse(system, beside.reshape(1, -1), tolerance=1e-11).growth_rate.reshape(2, -1)
        assert np.all(growth[0] < 0)
        assert np.all(growth[1] > 0)


def pair(damping: float, swing: float) -> GearSystem:
    """u'' + c(t) u' + k(t) u = 0, c = damping + swing/2 and k = 1.3 for half of a period, then less of both."""
    wave = Rectangular(1.5)
    mesh = Mesh("mesh", np.ones(1), np.ones(()), np.array(0.3), wave)
    term = PeriodicTerm("drag", np.ones(1), np.ones(1), None, Scaled(wave, damping, swing))
    return GearSystem(np.eye(1), np.zeros((1, 1)), (mesh,), terms=(term,))


def test_mesh_damping_that_follows_the_stiffness_against_the_closed_form() -> None:
    """The larger multiplier of the product of two damped oscillators is 1 in size: |tr M| = 1 + det M."""
    damping, swing = 0.02, 0.03

    def excess(omega: float) -> float:
        total = np.eye(2)
        for sign in (1.0, -1.0):
            t, mu = np.pi / omega, 0.5 * (damping + sign * swing / 2)
            w = np.sqrt(1 + sign * 0.3 - mu**2)
            c, s = np.cos(w * t), np.sin(w * t) / w
            step = np.array([[c + mu * s, s], [-(w**2 + mu**2) * s, c - mu * s]])
            total = np.exp(-mu * t) * step @ total
        return abs(np.trace(total)) - 1 - np.linalg.det(total)

    omega = np.linspace(0.4, 3.0, 4001)
    value = np.array([excess(x) for x in omega])
    expected = [
        brentq(excess, omega[k], omega[k + 1], xtol=1e-15, rtol=1e-15)
        for k in np.flatnonzero(value[1:] * value[:-1] < 0)
    ]
    found = boundaries(pair(damping, swing), 0.4, 3.0, tolerance=1e-12)
    assert len(expected) >= 6
    np.testing.assert_allclose(np.sort(np.concatenate([found.lower, found.upper])), expected, rtol=1e-11)
    assert found.labels()[-1] == "2w1"


def test_a_mesh_written_as_a_term_has_the_same_edges() -> None:
    """Against the search of symmetric damped systems, in other coordinates and with another mean system."""
    system = with_terms(DAMPING)
    mesh = system.meshes[1]
    wave = Scaled(mesh.waveform, mesh.mean_stiffness, 2 * mesh.epsilon)
    term = PeriodicTerm("second", mesh.direction, mesh.direction, wave, None, mesh.frequency_ratio, mesh.lag)
    other = replace(system, meshes=system.meshes[:1], terms=(term,))
    found, expected = (boundaries(one, START, STOP) for one in (other, system))
    np.testing.assert_allclose(found.lower, expected.lower, rtol=3e-10)
    np.testing.assert_allclose(found.upper, expected.upper, rtol=3e-10)


def stretches(parts: np.ndarray, count: int) -> np.ndarray:
    """Random points in intervals."""
    rng = np.random.default_rng(0)
    k = rng.choice(len(parts), count, p=np.ptp(parts, axis=1) / np.ptp(parts, axis=1).sum())
    return parts[k, 0] + rng.uniform(0, 1, count) * np.ptp(parts[k], axis=1)


@pytest.mark.parametrize("name", [name for name in WITH_TERMS if "damping" not in name])
def test_what_is_proved_stable_is_stable(name: str) -> None:
    system = WITH_TERMS[name]
    smooth = name.startswith("smooth")
    found = boundaries(system, START, 2.0 if smooth else STOP)
    assert found.stable_share(found.proved)[0] > 0.99
    omega = stretches(found.proved[0], 10 if smooth else 300)
    assert analyse(system, omega[None]).growth_rate.max() < 0


@pytest.mark.parametrize(("damping", "share"), [(DAMPING, 1), (1e-9 * DAMPING, 0), (None, 1)])
def test_what_is_not_proved_says_so(damping: np.ndarray | None, share: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where no proof is begun the scan counts; with next to nothing damped nothing is claimed; without any damping the
    system is Hamiltonian, and all collisions are counted. Regions are right anyway.
    """
    monkeypatch.setattr(proof, "HOPELESS", 0.0)
    system = replace(WITH_TERMS["gyroscopic"], damping=damping)
    found = boundaries(system, 2.5, 3.5)
    proved, counted = (float(found.stable_share(p)[0]) for p in (found.proved, found.counted))
    assert proved == 0
    assert counted == pytest.approx(share, abs=1e-4)
    omega = np.random.default_rng(2).uniform(2.5, 3.5, 300)
    np.testing.assert_array_equal(analyse(system, omega[None]).stable[0] == 0, inside(found, omega))


def test_rows_and_rigid_bodies() -> None:
    """Every row of a batch as if it were alone; friction that drives a free train's rotation leaves it in peace."""
    sizes = np.array([0.1, 0.3])
    terms = [friction(Scaled(Rectangular(1.3), 0.05, s)) for s in sizes]
    batch = friction(Scaled(Rectangular(np.array([1.3, 1.3])), np.array([0.05, 0.05]), sizes))
    for stiffness in (SHAFT, 0 * SHAFT):
        found = boundaries(with_terms(DAMPING, stiffness, [batch]), START, STOP)
        for row, term in enumerate(terms):
            alone = boundaries(with_terms(DAMPING, stiffness, [term]), START, STOP)
            mine = found.row == row
            np.testing.assert_allclose(found.lower[mine], alone.lower, rtol=3e-10)
            assert [found.labels()[k] for k in np.flatnonzero(mine)] == alone.labels()


def test_a_row_without_one_of_the_segments_is_proved_like_the_others() -> None:
    """A contact ratio that is whole: what other rows have a segment for takes no time."""
    ratio = np.array([1.5, 2.0])
    mesh = Mesh("mesh", np.ones(1), np.ones(2), np.full(2, 0.3), Rectangular(ratio))
    drag = PeriodicTerm(
        "drag", np.ones(1), np.ones(1), None, Scaled(Rectangular(ratio), np.full(2, 0.1), np.full(2, 0.02))
    )
    found = boundaries(GearSystem(np.eye(1), np.zeros((1, 1)), (mesh,), terms=(drag,)), 0.5, 3.5)
    assert found.stable_share(found.proved).min() > 0.99


def test_a_term_that_feeds_a_mode() -> None:
    drive = friction(None, Scaled(Rectangular(1.3), -0.5, 0.3), left=(1.0, 0, 0), right=(1.0, 0, 0))
    found = boundaries(with_terms(DAMPING, terms=[drive]), START, STOP)
    assert len(found.row) == 1
    assert found.cut.all()
    assert "self-excited" in found.labels()[0]
