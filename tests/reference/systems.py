"""Systems that many tests look at: Lin & Parker's train, oscillators, stars, chains, and cases that are hard."""

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from gearstab import modal
from gearstab.floquet.kernel import damped
from gearstab.floquet.segments.pattern import Pattern, prepare
from gearstab.mesh import Mesh, PeriodicTerm
from gearstab.system import GearSystem
from gearstab.waveforms import Constant, Fourier, Rectangular, Sampled, Scaled, Trapezoidal, Waveform

Parameters = dict[str, Any]


def both(value: Any) -> tuple[Any, Any]:
    """Return the value given for both meshes, or for each of them."""
    return value if isinstance(value, tuple | list) else (value, value)


def two_stage(
    tooth_ratio: Any = 1, epsilon: Any = 0.3, contact_ratio: Any = 1.5, phasing: Any = 0.0, **changes: Any
) -> Parameters:
    """Parameters of Lin & Parker's two-stage train (2002, Table 1); a tuple has a value for each mesh.

    mean_stiffness is one of the meshes too, first and second are more of theirs; other changes are of the train.
    """
    values = both(changes.pop("mean_stiffness", 1.0)), both(epsilon), both(contact_ratio)
    first, second = (
        {"name": name, "mean_stiffness": k, "epsilon": e, "contact_ratio": c} | changes.pop(name, {})
        for name, k, e, c in zip(("first", "second"), *values, strict=True)
    )
    train = {"kind": "two_stage", "inertias": [1.0, 0.3, 4.0], "input_shaft_stiffness": 0.5}
    meshes = [first, {"phasing": phasing} | second]
    return train | {"tooth_ratio": Fraction(tooth_ratio), "meshes": meshes} | changes


def lone_pair(teeth: int, mass: float, mesh: Parameters) -> Parameters:
    """Two gears a and b, of ratio 1 to 3, of which one coordinate is left: with J = 2 m r_b^2, m_e = m."""
    radii = [1e-3 * n * np.cos(np.deg2rad(20)) for n in (teeth, 3 * teeth)]
    rotors = [
        {"name": name, "teeth": n, "inertia": 2 * mass * r**2}
        for name, n, r in zip("ab", (teeth, 3 * teeth), radii, strict=True)
    ]
    return {
        "kind": "gearbox",
        "gears": {"module": "2 mm", "pressure_angle": "20 deg", "face_width": "20 mm"},
        "rotors": rotors,
        "meshes": [{"name": "mesh", "gears": ["a", "b"]} | mesh],
        "input": {"rotor": "a"},
    }


def unequal(tooth_ratio: Any = 1, epsilon: Any = 0.3, **changes: Any) -> Parameters:
    """The train with unequal meshes, so that no symmetry helps."""
    levels = {"mean_stiffness": (1.0, 1.1), "contact_ratio": (1.47, 1.57), "phasing": 0.2}
    return two_stage(tooth_ratio, (epsilon, 0.8 * epsilon), **levels | changes)


def point_a(phasing: float, mesh: Parameters | None = None, **changes: Any) -> Parameters:
    """Lin & Parker 2002, point A of Fig. 8: the stiffer level 1 of both meshes is kept, k_a = 0.3."""
    alike = {"max_stiffness": 1.0, "amplitude": 0.3} | (mesh or {})
    first, second = ({"name": name, "contact_ratio": c} for name, c in (("first", 1.47), ("second", 1.57)))
    return two_stage(meshes=[alike | first, alike | second | {"phasing": phasing}], **changes)


def pair(mesh: Parameters | None = None, **changes: Any) -> Parameters:
    """Parameters of a gear pair with changes of its mesh and of its own."""
    base = {"name": "mesh", "mean_stiffness": 1.0, "epsilon": 0.3, "contact_ratio": 1.5}
    return {"kind": "gear_pair", "equivalent_mass": 1.0, "meshes": [base | (mesh or {})]} | changes


def train(
    epsilon: Any = 0.3,
    contact_ratio: Any = 1.5,
    lag: Any = 0.0,
    ratio: Any = 1,
    *,
    waves: tuple[Waveform, Waveform] | None = None,
    shaft: float = 0.5,
    inertias: Any = (1.0, 0.3, 4.0),
    damping: Any = None,
) -> GearSystem:
    """Lin & Parker's train put together by hand, its second mesh at any frequency and both of any wave."""
    waves = waves or tuple(Rectangular(c) for c in both(contact_ratio))
    (one, two), ratio = both(epsilon), ratio if isinstance(ratio, float) else Fraction(ratio)
    meshes = (
        Mesh("first", np.array([1.0, 1.0, 0.0]), np.asarray(1.0), np.asarray(one), waves[0]),
        Mesh("second", np.array([0.0, 1.0, 1.0]), np.asarray(1.0), np.asarray(two), waves[1], ratio, lag),
    )
    return GearSystem(np.diag(inertias), np.diag([shaft, 0.0, 0.0]), meshes, damping)


def oscillator(wave: Waveform, epsilon: Any, stiffness: Any = 1.0, damping: float | None = None) -> GearSystem:
    """y'' + c y' + k (1 + 2 eps w) y = 0."""
    mesh = Mesh("mesh", np.ones(1), np.asarray(stiffness), np.asarray(epsilon), wave)
    return GearSystem(np.eye(1), np.zeros((1, 1)), (mesh,), None if damping is None else np.array([[damping]]))


def star(epsilon=0.2, contact_ratio=1.5, phases=(0.0, 0.0, 0.0)):
    """A hub and three identical satellites, like a small planetary train: one pair of degenerate modes."""
    g = np.array([[1.0, -1.0, 0, 0], [1.0, 0, -1.0, 0], [1.0, 0, 0, -1.0]])
    wave = Rectangular(contact_ratio)
    meshes = tuple(Mesh(str(i), g[i], 1.0, epsilon, wave, Fraction(1), phases[i]) for i in range(3))
    return GearSystem(np.diag([1.7, 0.6, 0.6, 0.6]), np.diag([0.4, 0.2, 0.2, 0.2]), meshes)


def random_rotation(seed: int) -> np.ndarray:
    """Four coordinates turned at random."""
    return np.linalg.qr(np.random.default_rng(seed).normal(size=(4, 4)))[0]


def turned_star(rotation: np.ndarray, damping: np.ndarray | None = None) -> GearSystem:
    """A hub with three equal branches in rotated coordinates: two modes of one frequency, in a basis eigh picks."""
    meshes = []
    for k, lag in enumerate((0.0, 0.3, 0.45)):
        direction = np.zeros(4)
        direction[0], direction[k + 1] = 1.0, -1.0
        wave = Rectangular(1.3 + 0.1 * k)
        meshes.append(Mesh(f"m{k}", rotation.T @ direction, np.asarray(1.0), np.asarray(0.2 + 0.1 * k), wave, lag=lag))
    mass, ground = np.diag([2.0, 1.0, 1.0, 1.0]), np.diag([0.4, 0.7, 0.7, 0.7])
    turned = [None if a is None else rotation.T @ a @ rotation for a in (mass, ground, damping)]
    return GearSystem(turned[0], turned[1], tuple(meshes), turned[2])


def chain(n, meshes, damping=0.0, seed=33):
    """n masses on a line of springs, ``meshes`` of which are teeth of different contact ratios."""
    rng = np.random.default_rng(seed)
    mass = np.diag(rng.uniform(0.5, 2.0, n))
    difference = np.eye(n) - np.eye(n, k=-1)
    spring = difference.T @ np.diag(rng.uniform(0.5, 3.0, n)) @ difference
    places = np.linspace(1, n - 1, meshes).astype(int)
    items = tuple(
        Mesh(f"m{i}", np.eye(n)[p] - np.eye(n)[p - 1], 2.0, 0.3, Rectangular(1.2 + 0.17 * i), Fraction(1), 0.13 * i)
        for i, p in enumerate(places)
    )
    return GearSystem(mass, spring, items, damping * spring if damping else None)


def comb(teeth):
    """Six meshes at frequency ratios 1..6: hundreds of segments for a common period of ``teeth`` cycles."""
    items = tuple(
        Mesh(f"m{i}", np.eye(3)[i % 3], 1.0, 0.15, Rectangular(1.3 + 0.1 * i), Fraction(7 * i + 1, teeth), 0.07 * i)
        for i in range(6)
    )
    spring = 0.3 * np.array([[2.0, -1, 0], [-1, 2, -1], [0, -1, 2]])
    return GearSystem(np.eye(3), spring, items)


def random_split(rng, groups, copies):
    """Independent systems of one mesh each, hidden by an orthogonal change of coordinates; the first one repeated."""
    n = sum(groups) + (copies - 1) * groups[0]
    mass, spring = np.zeros((n, n)), np.zeros((n, n))
    meshes, start = [], 0
    own = [rng.standard_normal((m, m)) for m in groups]
    shape = [rng.standard_normal(m) for m in groups]
    for k in [0] * copies + list(range(1, len(groups))):
        m = groups[k]
        part = slice(start, start + m)
        mass[part, part] = np.eye(m)
        spring[part, part] = own[k] @ own[k].T + 0.3 * np.eye(m)
        direction = np.zeros(n)
        direction[part] = shape[k]
        lag = 0.1 * k
        meshes.append(Mesh(f"m{start}", direction, 0.5 + 0.2 * k, 0.3, Rectangular(1.4 + 0.1 * k), Fraction(1), lag))
        start += m
    turn, _ = np.linalg.qr(rng.standard_normal((n, n)))
    turned = tuple(replace(mesh, direction=turn @ mesh.direction) for mesh in meshes)
    return GearSystem(turn @ mass @ turn.T, turn @ spring @ turn.T, turned)


def rotated(seed):
    """Modes of the mean system with the basis of each group of equal frequencies turned at random."""

    def turned(system):
        rng = np.random.default_rng(seed)
        modes = modal.mean_modes(system)
        shapes, squared = modes.shapes.copy(), modes.squared_frequency
        edges = np.flatnonzero(np.diff(squared) > 1e-9 * np.abs(squared[1:])) + 1
        for group in np.split(np.arange(len(squared)), edges):
            turn, _ = np.linalg.qr(rng.standard_normal((len(group), len(group))))
            shapes[:, group] = shapes[:, group] @ turn
        deflection = [modal.mesh_deflection(shapes, mesh.direction) for mesh in system.meshes]
        return replace(modes, shapes=shapes, mesh_deflection=np.stack(deflection, axis=-1))

    return turned


# ---- every branch of a kernel

KINDS = ("generic", "negative stiffness", "free state", "rigid", "no excitation", "one mesh", "ratios")
BATCH = 3


def system(n: int, kind: str, seed: int, damping: float = 0.0, epsilon: float = 0.4) -> GearSystem:
    """A system of n coordinates with a batch of BATCH rows of different excitation."""
    rng = np.random.default_rng([n, KINDS.index(kind), seed])
    size = n + (kind == "rigid")
    mass = np.diag(rng.uniform(0.4, 2.5, size))
    factor = rng.standard_normal((size, size))
    stiffness = factor @ factor.T + 0.2 * np.eye(size)
    directions = [rng.standard_normal(size) for _ in range(1 if kind == "one mesh" else 2)]
    if kind == "rigid":
        free = np.ones(size) / np.sqrt(size)
        keep = np.eye(size) - np.outer(free, free)
        stiffness = keep @ stiffness @ keep
        directions = [keep @ g for g in directions]
    if kind == "free state":
        # The softer level of the only spring along the first coordinate is exactly zero: c = 1.5, epsilon = 1.
        stiffness[0] = stiffness[:, 0] = 0.0
        directions = [np.eye(size)[0], *directions[1:]]
    factors = np.linspace(0.8, 1.0, BATCH)
    strength = {"negative stiffness": 3.5, "no excitation": 0.0}.get(kind, epsilon)
    meshes = []
    for i, g in enumerate(directions):
        first_free = kind == "free state" and i == 0
        ratio = Fraction(3, 2) if kind == "ratios" and i else Fraction(1)
        contact = 1.5 if first_free else rng.uniform(1.2, 2.8)
        level = np.ones(BATCH) if first_free else strength * factors
        meshes.append(Mesh(f"m{i}", g, np.array(1.3), level, Rectangular(contact), ratio, rng.uniform()))
    c = None
    if damping:
        b = rng.standard_normal((size, size))
        c = damping * (b @ b.T)
        if kind == "rigid":
            c = keep @ c @ keep
    return GearSystem(mass, stiffness, tuple(meshes), c)


def patterns(item: GearSystem, points: int, low: float = 0.15, high: float = 9.0) -> list[tuple[Pattern, np.ndarray]]:
    """Patterns and mesh frequencies ``(r, points)`` in their units."""
    omega = np.geomspace(low, high, points)
    return [(p, omega / p.elastic.rate[:, None]) for p in prepare(item)]


def damped_patterns(
    item: GearSystem, points: int, low: float = 0.15
) -> list[tuple[Pattern, damped.Generators, np.ndarray]]:
    """The same with the generators of general damping."""
    found = patterns(item, points, low)
    return [(p, damped.generators(p), omega) for p, omega in found if not p.elastic.conservative]


# ---- smooth waves

WAVE = Fourier(np.array([0.6, 0.2, -0.1, 0.05]), np.array([0.1, 0.15, 0.05, -0.02]))
COSINE = Fourier(np.array([0.0]), np.array([1.0]))
TRAPEZOID = Trapezoidal(1.5, 0.2)
SHORT_RAMPS = Trapezoidal(1.7, 0.05)
LINES = Sampled(np.array([0.0, 0.15, 0.4, 0.7, 0.9]), np.array([1.0, 2.0, 1.8, 0.7, 0.9]))
CURVE = Sampled(np.linspace(0, 1, 7)[:-1], np.array([1.0, 2.0, 1.8, 0.7, 0.9, 0.8]), "cubic")
GENERAL = np.array([[0.02, -0.01, 0.0], [-0.01, 0.03, 0.005], [0.0, 0.005, 0.05]])


def smooth_train(first, second, epsilon=0.3, ratio=1, damping=None, lag=0.1):
    return train(epsilon, lag=lag, ratio=ratio, waves=(first, second), damping=damping)


def with_ramps(system):
    """The same system with trapezoids in place of rectangles."""
    meshes = tuple(replace(m, waveform=Trapezoidal(m.waveform.contact_ratio, 0.1)) for m in system.meshes)
    return replace(system, meshes=meshes)


SMOOTH_SYSTEMS = {
    "Fourier": (smooth_train(WAVE, WAVE), 40),
    "trapezoids": (smooth_train(TRAPEZOID, SHORT_RAMPS), 40),
    "mixed with a rectangle": (smooth_train(Rectangular(1.4), WAVE, 0.4), 40),
    "samples": (smooth_train(LINES, CURVE), 40),
    "two frequencies": (smooth_train(WAVE, TRAPEZOID, 0.3, Fraction(1, 2)), 70),
    "decay of all alike": (smooth_train(TRAPEZOID, WAVE, 0.3, damping=0.03 * np.diag([1.0, 0.3, 4.0])), 40),
    "general damping": (smooth_train(WAVE, TRAPEZOID, 0.3, damping=GENERAL), 40),
    "one coordinate": (oscillator(COSINE, 0.35), 40),
}
SMOOTH_OMEGA = np.sort(np.random.default_rng(3).uniform(0.8, 6.0, 24))


# ---- hard cases


@dataclass(frozen=True)
class HardCase:
    """A system at a few mesh frequencies; ``tags`` say what is hard, ``flags`` which status bits must be reported."""

    name: str
    tags: frozenset[str]
    system: GearSystem
    omega: tuple[float, ...]
    flags: frozenset[str] = frozenset()


def case(name, tags, system, *omega, flags=()):
    return HardCase(name, frozenset(tags.split()), system, omega, frozenset(flags))


HARD_CASES = (
    case("very slow", "slow", train(), 0.01, 0.0037),
    case("very slow, damped", "slow damped", train(damping=np.diag([0.02, 0.01, 0.05])), 0.01),
    case("strong variation", "strong", train(0.9), 0.7, 2.1, 5.0),
    case("strong and slow", "strong slow", train(0.9), 0.01),
    case("almost integer contact ratio", "strong", train(0.4, (1.000001, 1.999999)), 1.3, 4.4),
    case("degenerate pair", "degenerate", star(), 0.9, 1.7, 2.6),
    case("no variation, on a collision", "degenerate", train(0.0), 2 * 1.0034685657919578, 2.7117237630996285),
    case("free-free", "rigid", train(shaft=0.0), 0.5, 2.6),
    case("free-free, damped", "rigid damped", train(shaft=0.0, damping=np.diag([0.02, 0.0, 0.01])), 0.5, 2.6),
    case("stiff shaft", "stiff", train(shaft=1e8), 0.9, 3.3),
    case("spread masses", "stiff", train(inertias=(1e-4, 1.0, 1e4)), 0.9, 3.3),
    case("long period", "long many", train(0.3, (1.4, 1.7), 0.2, "41/37"), 1.1, 3.2),
    case("many segments", "many", comb(5), 0.8, 2.3),
    case("negative stiffness", "strong negative", train(1.3), 0.6, 2.2, flags=["negative_stiffness"]),
    case("beyond 1e300", "strong negative slow long", train(2.5), 0.003, flags=["negative_stiffness", "rescaled"]),
    case("33 coordinates", "large", chain(33, 5), 0.8, 2.2),
    case("33 coordinates, damped", "large damped", chain(33, 5, 0.003), 0.8, 2.2),
)


G1, G2 = np.array([1.0, 1.0, 0.0]), np.array([0.0, 1.0, 1.0])
MASS = np.diag([1.0, 0.3, 4.0])
SHAFT = np.diag([0.5, 0.0, 0.0])
DAMPING = 0.02 * np.eye(3) + 0.01 * np.outer(G1, G1)


@dataclass(frozen=True)
class Smooth:
    """mean + size sin(2 pi x) exp(cos(2 pi x)/3), all harmonics and no kink."""

    mean: float
    size: float
    piecewise_constant = False
    batch: tuple[int, ...] = ()

    def value(self, x: Any) -> np.ndarray:
        """The function."""
        x = 2 * np.pi * np.asarray(x)
        return self.mean + self.size * np.sin(x) * np.exp(np.cos(x) / 3)

    def breakpoints(self) -> np.ndarray:
        """It has none."""
        return np.zeros(0)


def with_terms(damping: Any = None, stiffness: Any = SHAFT, terms: Any = ()) -> GearSystem:
    """The train with further periodic terms."""
    system = train((0.3, 0.2), (1.5, 1.4), 0.2, "3/5", damping=damping)
    return replace(system, stiffness=stiffness, terms=tuple(terms))


def friction(
    stiffness: Any, damping: Any = None, left: Any = (0.3, -0.1, 0.2), right: Any = G1, **other: Any
) -> PeriodicTerm:
    """A term of the train that is not symmetric."""
    return PeriodicTerm("friction", np.array(left), np.asarray(right, dtype=float), stiffness, damping, **other)


WITH_TERMS = {
    "piecewise constant friction": with_terms(DAMPING, terms=[friction(Scaled(Rectangular(1.3), 0.05, 0.4))]),
    "friction of another mesh": with_terms(
        DAMPING, terms=[friction(Scaled(Rectangular(1.6), 0.1, 0.3), frequency_ratio=Fraction(3, 5), lag=0.1)]
    ),
    "damping that follows the stiffness": with_terms(
        None, terms=[friction(None, Scaled(Rectangular(1.5), 0.05, 0.03), left=G1)]
    ),
    "smooth friction": with_terms(DAMPING, terms=[friction(Smooth(0.1, 0.2), Smooth(0.02, 0.01))]),
    "gyroscopic": with_terms(
        DAMPING,
        terms=[
            friction(None, Constant(0.3), left=[1, 0, 0], right=[0, 0, 1]),
            friction(None, Constant(-0.3), left=[0, 0, 1], right=[1, 0, 0]),
        ],
    ),
}
