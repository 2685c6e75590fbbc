"""Regions of systems with next to no damping and periodic terms, from configurations: none missed, none too wide."""

from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm
from tongues import inside, near_edge

import gearstab as gs
from gearstab.floquet import solve
from gearstab.floquet.boundaries import Boundaries, boundaries
from gearstab.system import GearSystem

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
