"""Systems whose mean stiffness is zero or negative along some modes: scales do not come from the mean alone."""

from dataclasses import replace

import h5py
import numpy as np
import oracle
import pytest
from scenes import scene_text, succeeds, written
from systems import COSINE, Smooth

from gearstab.floquet import solve
from gearstab.floquet.boundaries import boundaries
from gearstab.floquet.frequencies import lyapunov
from gearstab.mesh import Mesh, PeriodicTerm
from gearstab.modal import mean_modes
from gearstab.system import GearSystem
from gearstab.waveforms import Rectangular

OMEGA = np.array([0.5, 1.0, 1.5, 1.7, 3.5, 6.0])
PULL = np.array([1.0, -1.0])


def mesh(direction, stiffness=1.0, epsilon=1.0, contact_ratio=1.5, lag=0.0):
    return Mesh(f"{direction}", np.array(direction), stiffness, epsilon, Rectangular(contact_ratio), lag=lag)


SYSTEMS = {
    "one": GearSystem(np.eye(1), -np.eye(1), (mesh([1.0]),)),
    "free pair": GearSystem(np.eye(2), -np.outer(PULL, PULL), (mesh(PULL),)),
    "twins": GearSystem(np.eye(2), -np.eye(2), (mesh([1.0, 0.0]), mesh([0.0, 1.0]))),
    "zero and negative": GearSystem(
        np.diag([1.0, 2.0]), -np.diag([1.0, 0.5]), (mesh([1.0, 0.5]), mesh([0.2, 1.0], 0.7, 1.0, 1.3, 0.2))
    ),
    "three": GearSystem(
        np.diag([1.0, 2.0, 0.5]),
        np.array([[-0.8, -0.2, 0.0], [-0.2, 0.3, -0.1], [0.0, -0.1, 0.1]]),
        (mesh([1.0, 0.5, 0.0], 1.0, 0.8), mesh([0.0, 0.2, 1.0], 0.7, 1.0, 1.3, 0.2)),
    ),
    "beside others": GearSystem(
        np.diag([1.0, 2.0, 0.5]),
        np.diag([-1.0, 0.0, 3.0]),
        (mesh([1.0, 0.0, 0.0], 1.0, 0.8), mesh([0.0, 1.0, 1.0], 0.7, 0.3, 1.3, 0.2)),
    ),
}
DAMPINGS = {"none": None, "uniform": 0.05, "general": np.array([0.1, 0.03, 0.02])}


def damped(system, damping):
    """With damping: in proportion to the mass, or of single coordinates."""
    if damping is None:
        return system
    size = system.size
    return replace(system, damping=damping * system.mass if np.ndim(damping) == 0 else np.diag(damping[:size]))


@pytest.mark.parametrize("damping", DAMPINGS)
@pytest.mark.parametrize("name", SYSTEMS)
def test_growth_and_verdict_are_those_of_forty_digits(name, damping):
    system = damped(SYSTEMS[name], DAMPINGS[damping])
    # The oracle takes its time for three coordinates.
    chosen = OMEGA if system.size < 3 else OMEGA[2:5:2]
    found = solve(system, chosen, exponents=True)
    expected = np.array([oracle.solve(oracle.plain(system), omega).growth_rate for omega in chosen])
    np.testing.assert_allclose(found.growth_rate[0], expected, rtol=0, atol=1e-13)
    # A growth of nothing comes out of the 40 digits as 1e-60.
    np.testing.assert_array_equal(found.stable[0] == 1, expected < 1e-20)
    # A rigid-body mode has an exponent 0.
    largest = np.maximum(expected, 0.0) if name == "free pair" else expected
    np.testing.assert_allclose(found.exponents[0].real.max(axis=-1), largest, rtol=0, atol=1e-13)


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_term_that_is_zero_changes_nothing(name):
    system = SYSTEMS[name]
    end = np.eye(system.size)[0]
    term = PeriodicTerm("nothing", end, end, stiffness=Smooth(0.0, 0.0))
    found, expected = solve(replace(system, terms=(term,)), OMEGA), solve(system, OMEGA)
    np.testing.assert_allclose(found.growth_rate, expected.growth_rate, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(found.stable, expected.stable)


@pytest.mark.parametrize("smooth", [False, True], ids=["jumps", "smooth"])
@pytest.mark.parametrize("damping", DAMPINGS)
@pytest.mark.parametrize("name", ["one", "twins", "three", "beside others"])
def test_regions_are_those_of_a_raster(name, damping, smooth):
    system = damped(SYSTEMS[name], DAMPINGS[damping])
    if smooth:
        wave = replace(COSINE, cos=np.array([0.5]))
        system = replace(system, meshes=tuple(replace(one, waveform=wave) for one in system.meshes))
    found, omega = boundaries(system, 0.9, 7.0), np.linspace(0.9, 7.0, 301)
    inside = np.any((omega[:, None] >= found.lower) & (omega[:, None] <= found.upper), axis=1)
    np.testing.assert_array_equal(inside, solve(system, omega).stable[0] == 0)


@pytest.mark.parametrize("name", ["one", "twins", "beside others"])
def test_lyapunov_exponents_are_within_their_intervals(name):
    system, omega = SYSTEMS[name], np.array([0.5, 1.5, 2.0, 3.5])
    found = lyapunov.solve(system, omega, cycles=60)
    expected = solve(system, omega)
    assert np.all(np.abs(found.growth_rate - expected.growth_rate) <= found.interval)
    np.testing.assert_array_equal(found.stable, expected.stable)


def test_rigid_motion_is_told_from_a_mesh_without_a_mean():
    modes = mean_modes(SYSTEMS["free pair"])
    np.testing.assert_array_equal(modes.squared_frequency, 0.0)
    np.testing.assert_array_equal(modes.rigid, [True, False])
    np.testing.assert_allclose(np.abs(modes.mesh_deflection[:, 0]), [0.0, np.sqrt(2)], rtol=0, atol=1e-15)


def test_unit_of_stiffness_does_not_matter():
    """A mean that cancels but for rounding counts as zero, too."""
    for size in (1e-12, 0.1, 1e12):
        # (0.3 + 0.3 + 0.3) - 0.9 leaves 1e-16.
        system = GearSystem(np.eye(1), -0.9 * size * np.eye(1), tuple(mesh([1.0], 0.3 * size) for _ in range(3)))
        found = solve(system, OMEGA * np.sqrt(0.9 * size), exponents=True)
        expected = solve(SYSTEMS["one"], OMEGA)
        np.testing.assert_allclose(found.growth_rate / np.sqrt(0.9 * size), expected.growth_rate, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(mean_modes(system).squared_frequency, 0.0)


# --- results hold no negative zeros, which read as if something decayed


SWEEP = scene_text("negative_zeros_sweep")
APART = scene_text("negative_zeros_apart")


@pytest.mark.parametrize(
    ("command", "text", "changes"),
    [("sweep", SWEEP, []), ("sweep", SWEEP, ["--set", "damping_ratio=0.02"]), ("respond", APART, [])],
    ids=["sweep", "damped", "backlash"],
)
def test_zeros_have_no_sign(tmp_path, command, text, changes):
    path, out = written(tmp_path, text, "scene.yaml"), tmp_path / "out.h5"
    succeeds(command, path, "-o", out, *changes)
    negative = []

    def look(name, item):
        if isinstance(item, h5py.Dataset) and item.dtype.kind == "f":
            values = item[()]
            if np.any((values == 0) & np.signbit(values)):
                negative.append(name)

    with h5py.File(out) as file:
        file.visititems(look)
    assert not negative
