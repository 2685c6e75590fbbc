"""Exponents of a free geared shaft line of finite elements whose damping follows the stiffness."""

import resource
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import scipy.linalg
import yaml
from scenes import written
from scipy.linalg import expm
from scipy.optimize import brentq
from tongues import inside, near_edge

import gearstab as gs
from gearstab.floquet import solve
from gearstab.floquet.boundaries import Boundaries, boundaries
from gearstab.floquet.kernel import factors
from gearstab.mesh import Mesh
from gearstab.system import GearSystem
from gearstab.waveforms import Rectangular

CASE = Path(__file__).parent / "b04_fe_free_rayleigh.yaml"


def shaft(count: int, inertia: float, stiffness: float) -> tuple[np.ndarray, np.ndarray]:
    mass, spring = np.zeros((2, count + 1, count + 1))
    for e in range(count):
        mass[e : e + 2, e : e + 2] += inertia / 6 * np.array([[2, 1], [1, 2]])
        spring[e : e + 2, e : e + 2] += stiffness * np.array([[1, -1], [-1, 1]])
    return mass, spring


@pytest.fixture
def case(tmp_path: Path) -> Path:
    """The configuration with its matrices, which the case was written with."""
    (first, k1), (second, k2) = shaft(60, 2e-5, 4e6), shaft(60, 9e-5, 1.5e7)
    first[0, 0] += 0.8
    first[60, 60] += 2e-3
    second[0, 0] += 0.03
    second[60, 60] += 3.0
    scipy.io.mmwrite(tmp_path / "M04.mtx", scipy.linalg.block_diag(first, second), precision=17)
    scipy.io.mmwrite(tmp_path / "K04.mtx", scipy.linalg.block_diag(k1, k2), precision=17)
    (tmp_path / CASE.name).write_text(CASE.read_text())
    return tmp_path / CASE.name


def test_every_speed_takes_the_short_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """Speeds of a coarser line: between 691 and 864 rad/s windows of neighbouring multipliers end at close pairs."""
    (first, k1), (second, k2) = shaft(17, 2e-5, 1.3e6), shaft(17, 9e-5, 5e6)
    first[0, 0] += 0.8
    first[17, 17] += 2e-3
    second[0, 0] += 0.03
    second[17, 17] += 3.0
    gauge = np.zeros(36)
    gauge[[17, 18]] = 0.045, -0.115
    stiffness = scipy.linalg.block_diag(k1, k2)
    damping = 2e-7 * (stiffness + 3e8 * np.outer(gauge, gauge))
    mesh = Mesh("mesh", gauge, 3e8, 0.25, Rectangular(1.62))
    system = GearSystem(scipy.linalg.block_diag(first, second), stiffness, (mesh,), damping)
    omega, long = np.linspace(690.0, 865.0, 36), []
    chains = factors.chains

    def followed(wide: np.ndarray, segments: int, size: int) -> Iterator[tuple[int, np.ndarray]]:
        long.extend(omega[wide[0]] if wide.shape[1] == len(omega) else ())
        return chains(wide, segments, size)

    monkeypatch.setattr(factors, "chains", followed)
    found = solve(system, omega, exponents=True).exponents
    assert found is not None
    assert long == []
    monkeypatch.setattr(factors, "log_multipliers", lambda pattern, generator, row, omega: np.nan)
    # The periodic QR algorithm, right to 1e-14 times its number of factors; windows are right to 1e-9 each.
    expected = solve(system, omega[8:9], exponents=True).exponents
    assert expected is not None
    np.testing.assert_allclose(np.sort(found[0, 8].real), np.sort(expected[0, 0].real), rtol=1e-9, atol=1e-9)


@pytest.mark.slow
def test_exponents_of_122_coordinates(case: Path) -> None:
    start = time.process_time()
    found = gs.sweep(gs.load(case), jobs=1)["floquet"]
    # 0.1 s for each of the points, where the periodic QR took 4 to 28 s.
    assert time.process_time() - start < 5
    # Its chain of factors held 9 GB.
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss < 2e6
    growth = [-0.0101061797, -0.00903544222, -0.00965797448, -0.0397249059, 0.00074281997]
    np.testing.assert_allclose(found["growth_rate"], growth, rtol=0, atol=2e-7)
    # Liouville: the exponents add up to the trace of -M^-1 C, of the damping of the mean stiffness.
    mass, stiffness = (scipy.io.mmread(case.parent / name) for name in ("M04.mtx", "K04.mtx"))
    gauge = np.zeros(122)
    gauge[[60, 61]] = 0.045, -0.115
    stiffness += 3e8 * np.outer(gauge, gauge)
    trace = -2e-7 * np.trace(np.linalg.solve(mass, stiffness))
    np.testing.assert_allclose(found["exponent_real"].sum("exponent"), trace, rtol=1e-10)


# --- Meissner's equation, x'' + sgn(cos) x = 0, half a period of growth and half a period of rotation
#
# The monodromy matrix has half the trace cosh(T/2) cos(T/2) in T = 2 pi/Omega.


ZERO_MEAN = Path(__file__).with_name("b01_meissner_zero_mean.yaml")
COSINE = {"kind": "fourier", "cos": [0.5]}


def half_trace(omega):
    return np.cosh(np.pi / omega) * np.cos(np.pi / omega)


@pytest.fixture
def config():
    return gs.load(ZERO_MEAN)


def changed(tmp_path, **sections):
    """The case with other sections, as a configuration."""
    text = yaml.safe_load(ZERO_MEAN.read_text())
    wave = sections.pop("waveform", None)
    if wave is not None:
        mesh = text["system"]["meshes"][0]
        del mesh["contact_ratio"]
        mesh["waveform"] = wave
    path = written(tmp_path, yaml.safe_dump({**text, **sections}), "changed.yaml")
    return gs.load(path)


def test_growth_is_that_of_the_closed_form(config):
    found = gs.sweep(config)["floquet"]
    omega = np.asarray(found["mesh_frequency"])
    growth = np.arccosh(np.maximum(np.abs(half_trace(omega)), 1.0)) * omega / (2 * np.pi)
    np.testing.assert_allclose(found["growth_rate"], growth, rtol=0, atol=1e-13)
    np.testing.assert_array_equal(found["stable"], growth == 0)


def test_edge_is_where_the_half_trace_is_minus_one(tmp_path):
    config = changed(
        tmp_path, methods={"boundaries": {}}, sweep={"mesh_frequency": {"start": 0.9, "stop": 7, "num": 3}}
    )
    edge = brentq(lambda omega: half_trace(omega) + 1, 1.5, 1.9, xtol=1e-14)
    found = np.asarray(gs.sweep(config)["boundaries"]["boundary_frequency"])
    assert edge == pytest.approx(1.6754230903822864, abs=1e-12)
    np.testing.assert_allclose(found, [[0.9, edge]], rtol=1e-9)


def test_mode_is_no_rigid_body(config):
    (mode,) = gs.sweep(config)["modes"]["mode_type"].values
    assert mode == "no mean stiffness"


def test_response_grows_or_not_as_stability_says(tmp_path):
    for omega, bounded in ((1.5, False), (1.7, True)):
        config = changed(tmp_path, respond={"mesh_frequency": omega, "cycles": 60, "initial": {"displacement": [1e-3]}})
        q = np.abs(np.asarray(gs.respond(config)["response"]["displacement"]))
        assert (q.max() < 1.0) == bounded


def test_smooth_wave_without_a_mean_is_mathieus_equation(tmp_path):
    # x'' + cos(Omega t) x = 0 is y'' + (a - 2 q cos 2 s) y = 0 with a = 0, q = 2/Omega^2 but for a phase: stable below
    # the q at which the characteristic value b_1(q), an eigenvalue of a tridiagonal matrix (DLMF 28.4.8), is 0.
    order = np.arange(20)

    def characteristic(q):
        side = q * np.eye(20, k=1)
        return np.linalg.eigvalsh(np.diag((2.0 * order + 1) ** 2 - q * (order == 0)) + side + side.T)[0]

    edge = np.sqrt(2 / brentq(characteristic, 0.5, 1.2, xtol=1e-14))
    config = changed(
        tmp_path, waveform=COSINE, sweep={"mesh_frequency": [float(edge * (1 + part)) for part in (-1e-7, 1e-7)]}
    )
    np.testing.assert_array_equal(gs.sweep(config)["floquet"]["stable"], [0, 1])


# --- regions of systems with next to no damping and periodic terms, from configurations: none missed, none too wide


CASES = Path(__file__).parent


def searched(name: str, start: float, stop: float) -> tuple[GearSystem, Boundaries]:
    """A case and its regions between two mesh frequencies."""
    system = gs.build(CASES / f"{name}.yaml")
    return system, boundaries(system, start, stop)


def disagreements(system: GearSystem, found: Boundaries, points: int) -> list[float]:
    """Points of a raster where the sign of the growth rate is not that of the regions; ``stable`` allows for rounding,
    which is more than what damping ratios of 1e-8 leave beside an edge.
    """
    omega = np.linspace(*found.limits, points + 2)[1:-1]
    grows = solve(system, omega).growth_rate[0] > 0
    return omega[(inside(found, 0, omega) != grows) & ~near_edge(found, 0, omega, 1e-8)].tolist()


def edges_hold(system: GearSystem, found: Boundaries) -> None:
    """The growth rate changes its sign within 1e-8 of each edge, where multipliers are right to 1e-13."""
    for edges, cut, outwards in ((found.lower, found.cut[:, 0], -1), (found.upper, found.cut[:, 1], 1)):
        beside = edges[~cut] * (1 + 1e-8 * np.array([[outwards], [-outwards]]))
        growth = solve(system, beside.ravel()).growth_rate[0].reshape(2, -1)
        assert (growth[0] < 0).all()
        assert (growth[1] >= 0).all()  # 0 where so little growth per period counts as stable


def test_missed_regions_by_exponentials_of_matrices() -> None:
    """Four coordinates by hand: contact ratio 1.5, so that two levels last half of a period each."""
    system, found = searched("missed_regions", 0.6, 3.0)
    assert len(found.row) == 7
    g = np.array([1, 0.7, 0.5, 0.03])

    def growth(omega: float) -> float:
        total = np.eye(8)
        for level in (1.3, 0.7):
            stiffness = np.diag([1, 2, 3.5, 7]) + level * np.outer(g, g)
            state = np.block([[np.zeros((4, 4)), np.eye(4)], [-stiffness, -0.03 * level * np.outer(g, g)]])
            total = expm(state * np.pi / omega) @ total
        return float(np.log(np.abs(np.linalg.eigvals(total)).max()))

    for low, high in zip(found.lower, found.upper, strict=True):
        signs = [growth(x) > 0 for x in (low * (1 - 1e-8), low * (1 + 1e-8), high * (1 - 1e-8), high * (1 + 1e-8))]
        assert signs == [False, True, True, False]
    assert disagreements(system, found, 1601) == []


def test_a_region_does_not_enclose_what_is_stable() -> None:
    system, found = searched("region_encloses_stable", 0.7073, 0.95)
    assert disagreements(system, found, 2000) == []
    edges_hold(system, found)


@pytest.mark.parametrize(
    ("start", "stop"), [(36500.0, 40000.0), pytest.param(10000.0, 40000.0, marks=pytest.mark.slow)]
)
def test_a_planetary_gear_with_mesh_damping(start: float, stop: float) -> None:
    system, found = searched("planetary_missed", start, stop)
    assert disagreements(system, found, 400) == []
    edges_hold(system, found)
