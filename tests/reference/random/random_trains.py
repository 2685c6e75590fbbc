"""Random trains and an independent raster of growth rates with damping, refined until nothing new appears."""

from dataclasses import replace
from fractions import Fraction

import mpmath as mp
import numpy as np
from driven import generators, monodromy
from tongues import inside, near_edge

from gearstab.floquet import solve
from gearstab.floquet.boundaries import Boundaries, boundaries
from gearstab.mesh import PeriodicTerm
from gearstab.modal import mean_modes
from gearstab.system import GearSystem
from gearstab.systems import build
from gearstab.waveforms import Constant, Rectangular, Scaled

GOLDEN = (np.sqrt(5) - 1) / 2
ROUNDS = 40
COLLISIONS = 60
"""Collisions of multipliers of mean modes in the range of an undamped train, about; long periods have thousands."""

CLEAR = 1e-8
"""Growth a period of which double precision tells the sign, also where two multipliers are nearly equal, which halves
its digits; stability to 1e-10 a period is all that the package tells."""


def random_train(seed: int, proportional: bool | None = None) -> tuple[GearSystem, float, float]:
    """A train of one to six coordinates and one to three meshes, with the range of mesh frequencies to look at.

    Ratios of the mesh frequencies have denominators to 7, damping ratios are 0.002 to 0.05. proportional: modal
    damping, or a random positive definite matrix; None for one or the other.
    """
    rng = np.random.default_rng([4711, seed])
    n, count = int(rng.integers(1, 7)), int(rng.integers(1, 4))
    epsilon = rng.uniform(0.05, 0.6)
    ratios = [Fraction(1)] + [Fraction(int(rng.integers(1, 8)), int(rng.integers(1, 8))) for _ in range(count - 1)]
    meshes = [
        {"name": f"m{k}", "direction": rng.normal(size=n), "mean_stiffness": rng.uniform(0.5, 2), "lag": rng.random(),
         "epsilon": epsilon * rng.uniform(0.3, 1), "contact_ratio": rng.uniform(1.1, 1.9), "frequency_ratio": ratio}
        for k, ratio in enumerate(ratios)
    ]  # fmt: skip
    spring = rng.normal(size=(n, n))
    parts = {"kind": "matrices", "mass": np.diag(rng.uniform(0.5, 2, n)), "meshes": meshes}
    parts["stiffness"] = spring @ spring.T / n + 0.3 * np.eye(n)
    zeta = float(np.exp(rng.uniform(np.log(0.002), np.log(0.05))))
    if rng.random() < 0.5 if proportional is None else proportional:
        parts["damping"] = {"modal": zeta * rng.uniform(0.5, 2, n)}
    else:
        root = rng.normal(size=(n, n))
        parts["damping"] = {"matrix": zeta * (root @ root.T + 0.5 * np.eye(n))}
    system = build(parts)
    w = mean_modes(system).natural_frequency
    return system, 0.35 * float(w.min()), 2.2 * float(w.max())


def conservative_train(seed: int) -> tuple[GearSystem, float, float]:
    """One of these trains without its damping, and a range with not too many collisions of multipliers."""
    system, start, stop = random_train(seed)
    system = replace(system, damping=None)
    w = mean_modes(system).natural_frequency
    stop *= float(np.random.default_rng([4712, seed]).uniform(0.2, 1))
    rate = float(system.common_period()[0]) * float(w.sum()) * (system.size + 1)
    return system, max(min(start, 0.7 * stop), 1 / (1 / stop + COLLISIONS / rate)), stop


def light_train(seed: int) -> tuple[GearSystem, float, float]:
    """One of these trains with damping ratios of 1e-9 to 1e-2, log-uniform, of each mode or of all, and periodic terms:
    mesh damping that follows the stiffness, friction, both, or gyroscopic terms with a drag that varies.
    """
    system, start, stop = conservative_train(seed)
    rng = np.random.default_rng([4713, seed])
    modes, n = mean_modes(system), system.size
    w = modes.natural_frequency

    def ratio(size: int = 1) -> np.ndarray:
        return np.exp(rng.uniform(np.log(1e-9), np.log(1e-2), size))

    weighted, terms, kind = system.mass @ modes.shapes, [], int(rng.integers(0, 4))
    damping = (weighted * (2 * ratio(n if rng.random() < 0.5 else 1) * w)) @ weighted.T
    if kind in (0, 1):
        for m in system.meshes:
            d = float(2 * ratio()[0] * w.min() / max(float(((modes.shapes.T @ m.direction) ** 2).sum()), 1e-3))
            wave = Scaled(m.waveform, d, 2 * m.epsilon * d)
            terms.append(PeriodicTerm(f"drag {m.name}", m.direction, m.direction, None, wave, m.frequency_ratio, m.lag))
    if kind in (1, 2):
        m, size = system.meshes[0], float(np.exp(rng.uniform(np.log(1e-3), np.log(0.2))))
        wave = Scaled(Rectangular(rng.uniform(1.1, 1.9)), size * rng.uniform(-0.3, 0.3), size)
        terms.append(PeriodicTerm("friction", rng.normal(size=n), m.direction, wave, None, m.frequency_ratio, 0.3))
    if kind == 3:
        (u, v), c, d = rng.normal(size=(2, n)), float(np.exp(rng.uniform(np.log(1e-3), np.log(0.3)))), float(ratio()[0])
        terms += [PeriodicTerm("one", u, v, None, Constant(c)), PeriodicTerm("other", v, u, None, Constant(-c))]
        terms.append(PeriodicTerm("drag", u, u, None, Scaled(Rectangular(1.6), d, d), lag=0.2))
    return replace(system, damping=damping, terms=tuple(terms)), start, stop


def light_raster(system: GearSystem, start: float, stop: float, points: int) -> np.ndarray:
    """Mesh frequencies of a raster, of the extrema of the growth rate on it, and in and about the regions of the same
    system without damping and terms, which its own search has counted.
    """
    free = boundaries(replace(system, terms=(), damping=None), start, stop)
    near = (free.lower[:, None] + np.outer(free.upper - free.lower, np.linspace(-2, 3, 41))).ravel()
    omega = np.unique(
        np.concatenate([np.geomspace(start, stop, points + 2)[1:-1], near[(near > start) & (near < stop)]])
    )
    growth = solve(system, omega).growth_rate[0]
    sign = np.where(growth[1:-1] <= 0, 1.0, -1.0)
    f, left, right = sign * growth[1:-1], sign * growth[:-2], sign * growth[2:]
    k = np.flatnonzero((f >= left) & (f >= right)) + 1
    return np.unique(np.concatenate([omega, *_extrema(system, sign[k - 1], omega[k - 1], omega[k + 1], 1e-8)]))


def light_contradictions(system: GearSystem, found: Boundaries, start: float, stop: float) -> tuple[int, list[float]]:
    """How many points a raster has, and which of them contradict the regions by more than the width floor."""
    omega = light_raster(system, start, stop, 2000)
    unstable = solve(system, omega).stable[0] != 1
    wrong = omega[(inside(found, 0, omega) != unstable) & ~near_edge(found, 0, omega, 1e-9)]
    beside = 1 + found.width_floor * np.array([-1.0, 1.0])
    wrong = [x for x in wrong if inside(found, 0, np.array([x]))[0] != grows(system, x)]
    return len(omega), [float(x) for x in wrong if grows(system, x) in [grows(system, x * k) for k in beside]]


def grows(system: GearSystem, omega: float) -> bool:
    """Whether a multiplier of a piecewise constant system is outside the unit circle: products of exponentials in
    physical coordinates, in 30 digits where double precision has none to spare.
    """
    growth = float(np.log(np.abs(np.linalg.eigvals(monodromy(system, np.array([omega]))[0])).max()))
    if abs(growth) > CLEAR:
        return growth > 0
    with mp.workdps(30):
        exact = mp.eye(2 * system.size)
        for part, matrix in generators(system):
            exact = mp.expm(mp.matrix(matrix.tolist()) * (mp.mpf(part) / mp.mpf(float(omega)))) * exact
        return bool(max(abs(value) for value in mp.eig(exact, left=False, right=False)) > 1)


def raster(system: GearSystem, start: float, stop: float, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Mesh frequencies and growth rates, uniform in ln Omega, with all local extrema that may change sign pursued by
    golden section.
    """
    omega = np.geomspace(start, stop, points)
    growth = solve(system, omega).growth_rate[0]
    sign = np.where(growth[1:-1] <= 0, 1.0, -1.0)
    f, left, right = sign * growth[1:-1], sign * growth[:-2], sign * growth[2:]
    k = np.flatnonzero((f >= left) & (f >= right)) + 1
    every = np.unique(np.concatenate([omega, *_extrema(system, sign[k - 1], omega[k - 1], omega[k + 1], 1e-9)]))
    return every, solve(system, every).growth_rate[0]


def _extrema(system: GearSystem, sign: np.ndarray, a: np.ndarray, b: np.ndarray, least: float) -> list[np.ndarray]:
    """Mesh frequencies on the way to the maxima of sign times the growth rate, by golden section between a and b."""
    found = []
    for _ in range(ROUNDS):
        x, y = b - GOLDEN * (b - a), a + GOLDEN * (b - a)
        if len(x) == 0:
            break
        fx, fy = sign * solve(system, np.concatenate([x, y])).growth_rate[0].reshape(2, -1)
        found += [x, y]
        a, b = np.where(fx > fy, a, x), np.where(fx > fy, y, b)
        # An extremum that has changed its sign is one no more.
        left = (np.maximum(fx, fy) <= 0) & (b - a > least * b)
        a, b, sign = a[left], b[left], sign[left]
    return found


def missed(system: GearSystem, found: Boundaries, start: float, stop: float, points: int) -> list[float]:
    """Mesh frequencies of a raster, refined until nothing new appears, that contradict the regions: none is right.

    What is narrower than the width floor may be left out.
    """
    runs = -1
    while True:
        omega, growth = raster(system, start, stop, points)
        unstable = growth > 0
        wrong = (inside(found, 0, omega) != unstable) & ~near_edge(found, 0, omega, 1e-9)
        changes = int((np.diff(unstable.astype(int)) != 0).sum())
        if changes == runs or wrong.any():
            break
        runs, points = changes, 2 * points
    return [float(x) for x in omega[wrong] if _wide(system, float(x), found.width_floor)]


def _wide(system: GearSystem, omega: float, floor: float) -> bool:
    """Whether what contradicts at a point is as wide as the floor."""
    around = solve(system, omega * np.array([1 - floor, 1.0, 1 + floor])).growth_rate[0] > 0
    return bool(around[0] == around[1] or around[2] == around[1])
