"""Cost of points that ask for more than a product: matrices that act with speeds of rotation, branches of motions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import process_time

import numpy as np
from scipy.linalg import expm

from gearstab.bench.scene import Scene
from gearstab.floquet import solve
from gearstab.mesh import speed_factors
from gearstab.response.backlash.branches import BranchSearch, Starts
from gearstab.response.backlash.continuation import StepLimits
from gearstab.response.backlash.motions import speed_cycles
from gearstab.response.backlash.sections import SectionMap
from gearstab.system import Array, GearSystem

POINTS, PRODUCTS = 1 << 15, 500
"""Mesh frequencies at which the product is timed, and products of exponentials, which take a hundred times as long."""
SMOOTH_POINTS = 1 << 11
"""Mesh frequencies where waves are smooth, whose points take Magnus steps."""
RUNS = 5
"""Number of runs; their median counts."""


@dataclass(frozen=True)
class TurningCost:
    """Processor time per point, in seconds; difference: the largest one of ln max |lambda| over a common period.

    products: None where waves are smooth, of which there are no products; difference then is the error estimate.
    """

    speeds: str
    seconds: float
    products: float | None
    difference: float

    def text(self) -> str:
        """Return the line that bench prints."""
        points = f"{self.speeds}: {1 / self.seconds:,.0f} points/s"
        if self.products is None:
            return f"{points}; multipliers are right to {self.difference:.1e}"
        return (
            f"{points}, {self.products / self.seconds:.0f} times as many as by products of expm with eigenvalues; "
            f"growths differ by up to {self.difference:.1e}"
        )


def turning_costs(system: GearSystem, low: float, high: float) -> list[TurningCost]:
    """Measure points of a single system without further terms over a range of mesh frequencies.

    With all speeds held, at the values that they have in the middle of the range, and as given where some follow the
    mesh frequency.
    """
    middle = 0.5 * (low + high)
    held = tuple(
        rotation if rotation.speed_ratio is None
        else replace(rotation, speed_ratio=None, speed=float(rotation.speed_ratio) * middle)
        for rotation in system.rotations
    )  # fmt: skip
    found = [_cost("speeds held", replace(system, rotations=held), low, high)]
    if any(rotation.speed_ratio is not None for rotation in system.rotations):
        found.append(_cost("speeds that follow the mesh frequency", system, low, high))
    return found


def _cost(name: str, system: GearSystem, low: float, high: float) -> TurningCost:
    if not system.piecewise_constant:
        many = np.linspace(low, high, SMOOTH_POINTS)
        error = solve(system, many).error_estimate
        assert error is not None
        return TurningCost(name, _median(lambda: solve(system, many)) / SMOOTH_POINTS, None, float(error.max()))
    few = np.linspace(low, high, PRODUCTS)
    ours = solve(system, few).growth_rate[0] * 2 * np.pi * float(system.common_period()[0]) / few
    theirs = exponential_products(system, few)
    seconds = _median(lambda: solve(system, np.linspace(low, high, POINTS))) / POINTS
    products = _median(lambda: exponential_products(system, few)) / PRODUCTS
    # A stable point of the product has no positive growth.
    return TurningCost(name, seconds, products, float(np.abs(np.maximum(ours, 0.0) - np.maximum(theirs, 0.0)).max()))


def _median(run: Callable[[], object]) -> float:
    times = []
    for _ in range(RUNS):
        start = process_time()
        run()
        times.append(process_time() - start)
    return float(np.median(times))


def exponential_products(system: GearSystem, omega: Array) -> Array:
    """ln max |lambda| over a common period at mesh frequencies ``(P,)``, from batched scipy.linalg.expm of all segments
    and numpy.linalg.eigvals.
    """
    scene, n = Scene(system, float(omega.min()), float(omega.max())), system.size
    stiffness, damping = np.zeros((2, len(omega), n, n))
    for rotation in system.rotations:
        for term in rotation.terms():
            speed = np.broadcast_to(term.speed + term.speed_ratio * omega, omega.shape)
            factor = speed_factors(speed, np.asarray(term.power), np.asarray(term.softening))[:, None, None]
            (damping if term.on_velocity else stiffness)[...] += factor * term.matrix
    product = np.broadcast_to(np.eye(2 * n), (len(omega), 2 * n, 2 * n))
    moving = np.linalg.solve(system.mass, np.concatenate([stiffness, damping], axis=2))
    for duration, levels in scene.segments:
        generator = np.broadcast_to(scene.generator(levels), product.shape).copy()
        generator[:, n:] -= moving
        product = expm(generator * (duration * 2 * np.pi / omega)[:, None, None]) @ product
    return np.log(np.abs(np.linalg.eigvals(product)).max(axis=-1))


STARTS, SPEEDS = 5, 20
"""Mesh frequencies at which branches begin, and at which motions are run on to."""


@dataclass(frozen=True)
class BranchCost:
    """Processor time per motion, in seconds.

    motions: how many were found along branches, of which ``unstable``.  along: of one of these;  on: of running on.
    """

    motions: int
    unstable: int
    along: float
    on: float

    def text(self, cycles: float) -> str:
        """Return the line that bench prints."""
        return (
            f"branches: {self.motions} motions ({self.unstable} unstable) in {self.motions * self.along:.3g} s, "
            f"{1e3 * self.along:.3g} ms each; running on over {cycles:g} cycles: {1e3 * self.on:.3g} ms each"
        )


def branch_cost(system: GearSystem, low: float, high: float, points: int = 300, cycles: float = 200) -> BranchCost:
    """Measure both over a range of mesh frequencies, of a system with backlash."""
    begin = process_time()
    search = BranchSearch(SectionMap(system), StepLimits(low, high, points))
    search.run(Starts(tuple(np.linspace(low, high, STARTS).tolist()), cycles=cycles))
    middle = process_time()
    speed_cycles(system, np.linspace(low, high, SPEEDS), cycles=cycles)
    end = process_time()
    unstable = sum(not motion.stability.stable for branch in search.found for motion in branch.motions)
    return BranchCost(search.points, unstable, (middle - begin) / max(1, search.points), (end - middle) / SPEEDS)
