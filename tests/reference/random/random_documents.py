"""Random configurations of ordinary and of odd systems, all of them admitted by ``gearstab check``."""

from typing import Any

from hypothesis import strategies as st

Document = dict[str, Any]

SIZES = st.sampled_from([1.0, 0.3, 4.0]) | st.floats(0.05, 20.0)
"""Masses and stiffnesses."""
EPSILONS = st.sampled_from([0.0, 0.3]) | st.floats(0.0, 0.45)
CONTACTS = st.sampled_from([1.0, 1.5, 2.0]) | st.floats(1.0, 2.95)
PHASES = st.sampled_from([0.0, 0.5]) | st.floats(0.0, 1.0)
RATIOS = st.sampled_from(["1", "1/2", "3/5", "2/3", "7/5", "2"])
RAMPS = st.sampled_from([0.0, 0.1]) | st.floats(0.0, 0.9)
INTERPOLATIONS = st.sampled_from([{"interpolation": "linear"}, {"interpolation": "cubic"}])
COEFFICIENTS = st.lists(st.sampled_from([0.0, 0.5, -0.5]) | st.floats(-0.5, 0.5), min_size=1, max_size=3)


def amounts(largest: float) -> st.SearchStrategy[float]:
    """Amounts of damping or of a shaft: none, or more than what is refused as smaller than of any gear."""
    return st.just(0.0) | st.floats(1e-12, largest)


@st.composite
def waveforms(draw: st.DrawFn) -> Document:
    """Keys of a mesh that say how its stiffness varies."""
    kind = draw(st.sampled_from(["rectangular", "rectangular", "trapezoidal", "fourier", "sampled", "pair"]))
    if kind == "sampled":
        count = draw(st.integers(3, 6))
        levels = draw(st.lists(st.sampled_from([1.0, 2.0]) | st.floats(0.5, 2.0), min_size=count, max_size=count))
        if len(set(levels)) == 1:
            levels[0] += 1.0
        wave = {"kind": kind, "phase": [k / count for k in range(count)], "stiffness": levels}
        return {"epsilon": draw(EPSILONS), "waveform": wave | draw(INTERPOLATIONS)}
    if kind == "pair":
        wave = {"kind": kind, "shape": draw(st.sampled_from(["constant", "parabolic"]))}
        return {"epsilon": draw(EPSILONS), "contact_ratio": draw(CONTACTS), "waveform": wave}
    if kind == "fourier":
        # Two harmonics of one half each exceed a peak-to-peak of one and the largest epsilon with them.
        return {"epsilon": draw(st.floats(0.0, 0.15)), "waveform": {"kind": kind, **draw(series())}}
    found = {"epsilon": draw(EPSILONS), "contact_ratio": draw(CONTACTS)}
    if kind == "trapezoidal":
        found["waveform"] = {"kind": kind, "ramp": draw(RAMPS)}
    return found


@st.composite
def series(draw: st.DrawFn) -> Document:
    """Coefficients of a Fourier series."""
    found = {name: draw(COEFFICIENTS) for name in draw(st.sampled_from([("cos",), ("sin",), ("cos", "sin")]))}
    if not any(any(values) for values in found.values()):
        next(iter(found.values()))[0] = 0.5
    return found


@st.composite
def meshes(draw: st.DrawFn, name: str) -> Document:
    """One mesh."""
    found = {"name": name, "mean_stiffness": draw(SIZES), **draw(waveforms())}
    if draw(st.integers(0, 4)) == 0:
        found["damping"] = draw(amounts(0.3))
    return found


@st.composite
def dampings(draw: st.DrawFn, size: int) -> Document:
    """Nothing, one ratio, several, Rayleigh's, or any matrix."""
    kind = draw(st.sampled_from(["none", "ratio", "modal", "rayleigh", "matrix"]))
    ratio = st.sampled_from([0.0, 0.02]) | st.floats(0.0, 1.2)
    if kind == "ratio":
        return {"damping_ratio": draw(ratio)}
    if kind == "modal":
        return {"damping": {"modal": [draw(ratio) for _ in range(size)]}}
    if kind == "rayleigh":
        return {"damping": {"rayleigh": [draw(amounts(0.2)), draw(amounts(0.05))]}}
    return {"damping": {"matrix": draw(symmetric(size, 0.05))}} if kind == "matrix" else {}


@st.composite
def symmetric(draw: st.DrawFn, size: int, scale: float) -> list[list[float]]:
    """Any symmetric matrix, definite or not."""
    entry = st.just(scale) | st.floats(-scale, -1e-12) | amounts(scale)
    found = [[0.0] * size for _ in range(size)]
    for i in range(size):
        for j in range(i + 1):
            found[i][j] = found[j][i] = draw(entry)
    return found


@st.composite
def gear_pairs(draw: st.DrawFn) -> Document:
    """One degree of freedom."""
    system = {"kind": "gear_pair", "equivalent_mass": draw(SIZES), "meshes": [draw(meshes("mesh"))]}
    return system | draw(dampings(1))


@st.composite
def two_stages(draw: st.DrawFn) -> Document:
    """Lin & Parker's train, free or on its shaft."""
    pair = [draw(meshes("first")), draw(meshes("second")) | {"phasing": draw(PHASES)}]
    return {
        "kind": "two_stage",
        "inertias": draw(st.just([1, 1, 1]) | st.lists(SIZES, min_size=3, max_size=3)),
        "input_shaft_stiffness": draw(st.just(0.5) | amounts(3.0)),
        "tooth_ratio": draw(RATIOS),
        "meshes": pair,
    } | draw(dampings(3))


@st.composite
def matrices(draw: st.DrawFn) -> Document:
    """One to four coordinates, one or two meshes, ratios rational or not."""
    size = draw(st.integers(1, 4))
    ends = draw(st.lists(st.sampled_from([0.0, 0.0, 1.0]) | st.floats(0.1, 2.0), min_size=size, max_size=size))
    springs = draw(st.lists(st.sampled_from([0.0, 1.0]) | st.floats(0.1, 3.0), min_size=size - 1, max_size=size - 1))
    stiffness = [[0.0] * size for _ in range(size)]
    for i, end in enumerate(ends):
        stiffness[i][i] += end
    for i, spring in enumerate(springs):
        for a, b, sign in ((i, i, 1), (i + 1, i + 1, 1), (i, i + 1, -1), (i + 1, i, -1)):
            stiffness[a][b] += sign * spring
    mass = [[draw(SIZES) if i == j else 0.0 for j in range(size)] for i in range(size)]
    found = []
    for k in range(draw(st.integers(1, 2))):
        direction = draw(st.lists(st.sampled_from([0.0, 1.0, -1.0]), min_size=size, max_size=size).filter(any))
        mesh = draw(meshes(f"m{k}")) | {"direction": direction, "lag": draw(PHASES)}
        if k:
            irrational = draw(st.integers(0, 3)) == 0
            mesh |= (
                {"frequency_ratio": 0.6180339887498949, "exact": False}
                if irrational
                else {"frequency_ratio": draw(RATIOS)}
            )
        found.append(mesh)
    return {"kind": "matrices", "mass": mass, "stiffness": stiffness, "meshes": found} | draw(dampings(size))


@st.composite
def documents(draw: st.DrawFn) -> Document:
    """A whole configuration with every method that takes its system, and a response."""
    system = draw(gear_pairs() | two_stages() | matrices())
    commensurate = all(mesh.get("exact", True) for mesh in system["meshes"])
    size = len(system["mass"]) if "mass" in system else {"gear_pair": 1, "two_stage": 3}[system["kind"]]
    start = draw(st.floats(0.3, 2.0))
    methods: Document = {"floquet": {"exponents": draw(st.booleans())}, "required_damping": {}}
    methods["perturbation"] = {"order": draw(st.sampled_from([1, 2]))}
    if commensurate:
        methods["boundaries"] = {}
    else:
        methods["floquet"] = {"lyapunov": {"cycles": 20}}
    start_state = {"displacement": [0.1] * size, "velocity": [0.0] * size}
    found: Document = {
        "system": system,
        "sweep": {"mesh_frequency": {"start": start, "stop": 1.5 * start, "num": 5}},
        "methods": methods,
    }
    if commensurate:
        found["respond"] = {"mesh_frequency": start, "cycles": 3, "samples_per_cycle": 20, "initial": start_state}
    return found


def trees() -> st.SearchStrategy[Any]:
    """Any nested data that YAML can hold."""
    characters = st.characters(codec="utf-8", exclude_characters="\0")
    scalars = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(characters, max_size=8)
    keys = st.text(characters, min_size=1, max_size=5)
    return st.recursive(
        scalars, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(keys, inner, max_size=3), max_leaves=8
    )
