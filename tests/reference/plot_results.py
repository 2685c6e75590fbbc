"""Results as the figures read them, made by hand from the published tongues of Lin & Parker's train.

The modes of Parker's planetary gear (2009, Table 1) too: drawings are checked against displacements from here, not
against the program's own model.
"""

import json

import numpy as np
import xarray as xr
from scenes import DATA
from scipy.linalg import eigh

REFERENCE = json.loads((DATA / "lin_parker_2002.json").read_text())


def published(case="fig3"):
    """(labels, centres, half-widths per epsilon) of the first-order tongues of a case, three harmonics."""
    (tongues,) = [c["tongues"] for c in REFERENCE["first_order"] if c["case"] == case]
    labels = [label(t["p"], t["q"], t["harmonic"]) for t in tongues]
    return labels, np.array([t["center"] for t in tongues]), np.array([t["half_width_per_eps"] for t in tongues])


def label(p, q, s):
    if p != q:
        return f"w{p}+w{q}" if s == 1 else f"(w{p}+w{q})/{s}"
    return {1: f"2w{p}", 2: f"w{p}"}.get(s, f"2w{p}/{s}")


def coordinate(name, values, units="1", long_name=None):
    return {name: ((name,), np.asarray(values), {"units": units, "long_name": long_name or name.replace("_", " ")})}


def axes(frequency=None, epsilon=None, **others):
    values = {
        **coordinate("mesh_frequency", np.linspace(0.35, 7, 60) if frequency is None else frequency, "rad/s"),
        **coordinate("epsilon", np.linspace(0, 0.5, 21) if epsilon is None else epsilon, "1", "stiffness variation"),
    }
    for name, entries in others.items():
        values |= coordinate(name, entries)
    return values


def growth(centre, half, frequency, damping=0.0):
    """First-order growth rate, the largest of sqrt(W^2 - (Omega - Omega_0)^2)/2 over the tongues, less a damping."""
    square = half[:, None] ** 2 - (frequency - centre[:, None]) ** 2
    return np.sqrt(np.maximum(square, 0)).max(axis=0) / 2 - damping


def floquet_group(coords, damping=0.0, dims=None):
    """Growth rates over the axes; an axis ``phasing`` or ``case`` narrows the tongues linearly."""
    dims = dims or list(coords)
    frequency, epsilon = coords["mesh_frequency"][1], coords["epsilon"][1]
    others = [name for name in dims if name not in ("mesh_frequency", "epsilon")]
    shape = [len(coords[name][1]) for name in others]
    _, centre, half = published()
    values = np.empty((*shape, epsilon.size, frequency.size))
    for index in np.ndindex(*shape, epsilon.size):
        values[index] = growth(centre, half * epsilon[index[-1]] / (1 + sum(index[:-1])), frequency, damping)
    order = [*others, "epsilon", "mesh_frequency"]
    data = {
        "growth_rate": (order, values, {"units": "1/s", "long_name": "growth rate"}),
        "stable": (order, (values <= 0).astype(np.int8), {"units": "1", "long_name": "stable"}),
        "status": (order, np.zeros(values.shape, np.int16), {"units": "1", "long_name": "status"}),
    }
    return xr.Dataset(data, coords=coords).transpose(*dims)


def boundary_group(coords, case="fig3", factor=1.0):
    """Boundaries of the published tongues over every axis but the mesh frequency."""
    labels, centre, half = published(case)
    others = [name for name in coords if name not in ("mesh_frequency", "epsilon")]
    shape = [len(coords[name][1]) for name in others]
    narrowing = 1 + sum(np.indices(shape)) if shape else np.ones(())
    width = factor * half[(slice(None), *[None] * len(shape), None)] * coords["epsilon"][1] / narrowing[..., None]
    middle = np.broadcast_to(centre[(slice(None), *[None] * len(shape), None)], width.shape)
    edges = np.stack([middle - width, middle + width], axis=1)
    names = {"label": ("tongue", labels), "side": ("side", ["lower", "upper"])}
    own = {name: value for name, value in coords.items() if name != "mesh_frequency"}
    attributes = {"units": "rad/s", "long_name": "boundary"}
    return xr.Dataset(
        {
            "boundary_frequency": (("tongue", "side", *others, "epsilon"), edges, attributes),
            "half_width": (("tongue", *others, "epsilon"), width, attributes),
        },
        coords={**own, **names},
    )


def tree(**groups):
    root = xr.Dataset(attrs={"title": "Three gears (Lin & Parker 2002, Fig. 3)", "gearstab_version": "0"})
    return xr.DataTree.from_dict({"/": root, **{f"/{name}": group for name, group in groups.items()}})


def fig3(damping=0.0, **other_axes):
    coords = axes(**other_axes)
    return tree(floquet=floquet_group(coords, damping), perturbation=boundary_group(coords))


def two_amplitudes():
    """The w2+w3 tongue of Fig. 7(b), half-width |0.40 e1 - 0.45 e2|, and one that never vanishes."""
    first, second = np.linspace(0, 0.5, 21), np.linspace(0, 0.5, 16)
    half = np.stack([np.abs(0.4 * first[:, None] - 0.45 * second), 0.9 * first[:, None] + 0.8 * second])
    centre = np.array([3.715, 5.423])[:, None, None]
    names = ["meshes.first.epsilon", "meshes.second.epsilon"]
    coords = {**coordinate(names[0], first), **coordinate(names[1], second)}
    coords |= {"label": ("tongue", ["w2+w3", "2w3"]), "side": ("side", ["lower", "upper"])}
    edges = np.stack([centre - half, centre + half], axis=1)
    group = xr.Dataset(
        {"boundary_frequency": (("tongue", "side", *names), edges, {"units": "rad/s", "long_name": "boundary"})},
        coords=coords,
    )
    modes = xr.Dataset(coords={"mesh": ["first", "second"]})
    return tree(perturbation=group, modes=modes)


def bench():
    """Times and errors of an exact method and of an integrator at two tolerances."""
    data = {"error": ("setting", [1e-15, 1e-4, 1e-9]), "seconds": ("setting", [1e-6, 1e-3, 1e-2])}
    return tree(bench=xr.Dataset(data, coords={"method": ("setting", ["exact", "DOP853", "DOP853"])}))


def speeds(**more):
    """A response over speed: a resonance at 2 on two meshes, unstable by boundaries between 3 and 3.4."""
    frequency = np.linspace(0.5, 5, 91)
    names = ["mesh_frequency", *more]
    dims = (*names, "mesh")
    peak = 1 / np.abs(4 - frequency**2 + 0.2j * frequency)
    shape = (*(len(values) for values in more.values()), 2)
    factor = peak.reshape(-1, *(1,) * len(shape)) * np.ones(shape) * [1.0, 1.5]
    data = {
        "mesh_force_peak": (dims, 10 * factor, {"units": "N", "long_name": "largest force"}),
        "dynamic_load_factor": (dims, factor, {"units": "1", "long_name": "dynamic load factor"}),
        "transmission_error_peak_to_peak": (dims, factor, {"units": "m", "long_name": "transmission error"}),
        "status": (tuple(names), np.where(np.abs(factor[..., 0]) < 0.1, 1, 0).astype("i2"), {"units": "1"}),
    }
    coords = coordinate("mesh_frequency", frequency, "rad/s") | {"mesh": ["first", "second"]}
    for name, values in more.items():
        coords |= coordinate(name, np.asarray(values))
    edges = np.broadcast_to(np.array([3.0, 3.4]).reshape(1, 2, *(1,) * len(more)), (1, 2, *shape[:-1]))
    boundaries = xr.Dataset(
        {"boundary_frequency": (("tongue", "side", *more), edges, {"units": "rad/s"})},
        coords={"label": ("tongue", ["2w1"]), "side": ["lower", "upper"]} | {k: coords[k] for k in more},
    )
    return tree(response=xr.Dataset(data, coords=coords), boundaries=boundaries)


def crossing():
    """Two modes that cross at the middle of an axis of stiffness, and the region of each under one mesh."""
    speed, stiffness = np.linspace(1.0, 5.0, 9), np.linspace(0.0, 1.0, 5)
    w = np.stack([1.0 + stiffness, 2.0 - stiffness], axis=-1)
    order = np.argsort(w, axis=1, kind="stable")
    shapes = np.eye(2)[order]
    coords = coordinate("mesh_frequency", speed, "rad/s") | coordinate("stiffness", stiffness, "N/m")
    own = {name: value for name, value in coords.items() if name != "mesh_frequency"}
    centre = 2 * np.sort(w, axis=1).T
    edges = np.stack([centre - 0.1, centre + 0.1], axis=1)
    regions = {"mode_p": [1, 2], "mode_q": [1, 2], "harmonic": [1, 1], "label": ["2w1", "2w2"]}
    names = {name: ("tongue", values) for name, values in {**regions, "frequency_ratio": [1.0, 1.0]}.items()}
    names |= {"mesh": ("tongue", ["mesh"] * 2), "side": ("side", ["lower", "upper"])}
    found = {"boundary_frequency": (("tongue", "side", "stiffness"), edges, {"units": "rad/s"})}
    frequencies = xr.Dataset(
        {
            "natural_frequency": (("stiffness", "mode"), np.sort(w, axis=1), {"units": "rad/s"}),
            "mode_shape": (("stiffness", "mode", "dof"), shapes, {"units": "kg^-1/2"}),
        },
        coords=own,
    )
    modes = xr.Dataset({"natural_frequency": ("mode", w[0], {"units": "rad/s"})}, coords={"mesh": ["mesh"]})
    groups = {"boundaries": xr.Dataset(found, coords=coords | names), "natural_frequencies": frequencies}
    return tree(modes=modes, **groups)


def spectra(amplitudes=True):
    """Harmonics of a steady state, or a density, of two meshes; natural frequencies 1 and 2.7."""
    frequency = np.linspace(0, 40, 41 if amplitudes else 4001)
    value = np.stack([1 / (1 + np.abs(frequency - c)) ** 2 for c in (1.0, 2.0)], axis=-1)
    name = "mesh_force_amplitude" if amplitudes else "mesh_force_density"
    data = {name: (("frequency", "mesh"), value, {"units": "N", "long_name": "amplitude of the mesh force"})}
    coords = coordinate("frequency", frequency, "rad/s") | {"mesh": ["first", "second"]}
    modes = xr.Dataset({"natural_frequency": ("mode", [0.0, 1.0, 2.7])})
    return tree(response=xr.Dataset(data, coords=coords), modes=modes)


def response():
    time = np.linspace(0, 20, 401)
    displacement = np.stack([np.cos(time), 0.2 * np.sin(3 * time), np.exp(0.1 * time)], axis=-1)
    data = {
        "displacement": (("time", "dof"), displacement, {"units": "m", "long_name": "displacement"}),
        "mesh_force": (("time", "mesh"), displacement[:, :2] * 3, {"units": "N", "long_name": "dynamic mesh force"}),
    }
    coords = {**coordinate("time", time, "s"), "dof": ["x1", "x2", "x3"], "mesh": ["first", "second"]}
    return tree(response=xr.Dataset(data, coords=coords))


def run_up():
    """Harmonics of two meshes that rise through the natural frequency 20 as the speed doubles."""
    speed, frequency, harmonic = np.linspace(5, 10, 12), np.linspace(0, 60, 121), np.arange(1, 9)
    height = 1 / (1 + np.abs(speed[:, None] * harmonic - 20))
    lines = np.exp(-((frequency[:, None] - speed[:, None, None] * harmonic) ** 2))
    lines = np.einsum("wh,wfh->wf", height, lines)
    data = {
        "mesh_force_spectrogram": (("mesh_frequency", "frequency", "mesh"), np.stack([lines, 0.1 * lines], axis=-1)),
        "mesh_force_harmonic": (("mesh_frequency", "harmonic", "mesh"), np.stack([height, 0.1 * height], axis=-1)),
    }
    coords = coordinate("mesh_frequency", speed, "rad/s") | coordinate("frequency", frequency, "rad/s")
    coords |= {"harmonic": harmonic, "mesh": ["first", "second"]}
    modes = xr.Dataset({"natural_frequency": ("mode", [0.0, 20.0])})
    return tree(response=xr.Dataset(data, coords=coords, attrs={"frequency_ratios": [1.0, 0.5]}), modes=modes)


def backlash():
    """Ten periods of a mesh with backlash, and of one without."""
    time = np.linspace(0, 20 * np.pi, 2001)
    x, v = np.stack([np.cos(time), 0.2 * np.sin(time)]), np.stack([-np.sin(time), 0.2 * np.cos(time)])
    data = {
        "mesh_deflection": (("time", "mesh"), x.T, {"units": "m", "long_name": "mesh deflection"}),
        "mesh_velocity": (("time", "mesh"), v.T, {"units": "m/s", "long_name": "rate of the mesh deflection"}),
        "play": (("mesh", "bound"), [[-2.0, 0.3], [0.0, 0.0]], {"units": "m"}),
    }
    coords = {**coordinate("time", time, "s"), "mesh": ["first", "second"]}
    attributes = {"common_period": 2 * np.pi, "settled_from": 10 * np.pi, "period": 1}
    return tree(response=xr.Dataset(data, coords=coords, attrs=attributes))


def teeth():
    """Loads and root stresses of the teeth of two meshes along their contact."""
    contact = (np.arange(40) + 0.5) / 40
    static = np.where(np.abs(contact - 0.5) < 0.15, 1000.0, 550.0)[:, None] * [1.0, 2.0]
    flanks = ["gear1, mesh I", "gear2, mesh I", "gear3, mesh II", "gear4, mesh II"]
    stress = np.repeat(static, 2, axis=1) * 1e5
    data = {
        "mesh_force": (("time", "mesh"), np.ones((11, 2)), {"units": "N"}),
        "static_tooth_load": (("contact", "mesh"), static, {"units": "N", "long_name": "static load"}),
        "tooth_load": (("contact", "mesh"), 1.2 * static, {"units": "N", "long_name": "largest load"}),
        "static_root_stress": (("contact", "flank"), stress, {"units": "Pa", "long_name": "static stress"}),
        "root_stress": (("contact", "flank"), 1.2 * stress, {"units": "Pa", "long_name": "largest stress"}),
    }
    ways = {"contact": contact, "mesh": ["I", "II"], "flank": flanks}
    coords = {**coordinate("time", np.linspace(0, 1, 11), "s"), **ways}
    return tree(response=xr.Dataset(data, coords=coords))


def pair(spectrum=True, energy_loss=0.2):
    """Ten mesh cycles of a gear pair of one second each, two pairs of teeth in contact for the second half."""
    time = np.arange(2001) / 200
    stiff = time % 1.0 >= 0.5
    frequency = np.linspace(0, 60, 601)
    variables = {
        "phi": (
            "time",
            np.where(stiff, 0.01, 0.02) + 1e-3 * np.sin(40 * time),
            {"units": "rad", "long_name": "deflection"},
        ),
        "energy": ("time", 5.0 - energy_loss * time, {"units": "J", "long_name": "total energy"}),
        "mesh_stiffness": (("time", "mesh"), np.where(stiff, 2.0, 1.0)[:, None], {"units": "N m"}),
        "section_time": ("cycle", np.arange(1.0, 11.0), {"units": "s"}),
    }
    coords = {"time": ("time", time, {"units": "s"}), "mesh": ["mesh"], "cycle": np.arange(1, 11)}
    if spectrum:
        coords["frequency"] = ("frequency", frequency, {"units": "rad/s"})
        coords["normalised_frequency"] = ("frequency", frequency / 5, {"units": "1"})
        variables["power_spectral_density"] = ("frequency", np.exp(-frequency), {"units": "rad2 s"})
    return tree(response=xr.Dataset(variables, coords))


def required_damping():
    """The damping that balances the growth of the published tongues, and a point where none was found."""
    coords = axes(frequency=np.linspace(0.35, 7, 24), epsilon=np.linspace(0, 0.5, 13))
    rate = floquet_group(coords)["growth_rate"].transpose("epsilon", "mesh_frequency").values
    values = rate / coords["mesh_frequency"][1]
    values[2, 3] = np.nan
    words = {"units": "1", "long_name": "damping from which on the system is stable"}
    group = xr.Dataset({"required_damping": (("epsilon", "mesh_frequency"), values, words)}, coords=coords)
    return tree(required_damping=group)


def probability():
    """Probabilities between 0 and 1 beside the published tongues, and a point of which nothing is known."""
    coords = axes(frequency=np.linspace(0.35, 7, 24), epsilon=np.linspace(0, 0.5, 13))
    rate = floquet_group(coords)["growth_rate"].transpose("epsilon", "mesh_frequency").values
    values = np.clip(rate / rate.max(), 0.0, 1.0)
    values[2, 3] = np.nan
    words = {"units": "1", "long_name": "probability of instability"}
    return tree(tolerance=xr.Dataset({"probability": (("epsilon", "mesh_frequency"), values, words)}, coords=coords))


def passage(rates=(-0.1, 0.1, 1.0, 10.0)):
    """E-folds that fall as the inverse rate and with damping, at rates in both directions."""
    coords = axes(frequency=np.linspace(0.35, 7, 24), damping_ratio=np.array([0.0, 0.01, 0.05]))
    rate = np.array(rates)
    base = 2.0 / np.abs(rate) * (1 - 15 * coords["damping_ratio"][1][:, None])
    dims, words = ("damping_ratio", "rate"), {"units": "1", "long_name": "e-folds of the amplitude"}
    own = {"damping_ratio": coords["damping_ratio"], "rate": ("rate", rate, {"units": "rad/s^2", "long_name": "rate"})}
    variables = {"growth": (dims, base, words), "growth_exact": (dims, base + np.sqrt(base), words)}
    return tree(passage=xr.Dataset(variables, own, {"amplification": 10.0}))


# ---- modes of a planetary gear

PRESSURE_ANGLE = np.deg2rad(24.6)


def names(planets, harmonics, motion="planar"):
    discrete = ["x", "y", "rotation"] if motion == "planar" else ["rotation"]
    own = ["radial", "tangential", "rotation"] if motion == "planar" else ["rotation"]
    found = [f"ring_{c}" for c in discrete]
    found += [f"ring_{f}{m}" for m in range(2, harmonics + 1) for f in "cs"]
    found += [f"{body}_{c}" for body in ("carrier", "sun") for c in discrete]
    return found + [f"planet{n}_{c}" for n in range(1, planets + 1) for c in own]


def directions(dofs, planets):
    """Mesh deflections (26), (27) as rows: sun meshes, then ring meshes."""
    a, rows = PRESSURE_ANGLE, []
    for gear in ("sun", "ring"):
        for n in range(1, planets + 1):
            psi = 2 * np.pi * (n - 1) / planets
            at = psi - a if gear == "sun" else psi + a
            sign = 1 if gear == "sun" else -1
            entries = {
                f"{gear}_x": -np.sin(at), f"{gear}_y": np.cos(at), f"{gear}_rotation": 1,
                f"planet{n}_radial": -sign * np.sin(a), f"planet{n}_tangential": -np.cos(a),
                f"planet{n}_rotation": sign,
            }  # fmt: skip
            for m in range(2, 60):
                if gear == "ring":
                    c, s = np.cos(m * psi), np.sin(m * psi)
                    entries[f"ring_c{m}"] = c * np.cos(a) - m * s * np.sin(a)
                    entries[f"ring_s{m}"] = s * np.cos(a) + m * c * np.sin(a)
            rows.append([entries.get(name, 0.0) for name in dofs])
    return np.array(rows)


def matrices(planets=4, harmonics=6):
    """(names, M, K of the mean system, mesh directions), dimensionless as in Parker 2009, k_cu = 1e11 N/m."""
    dofs, m_r, k = names(planets, harmonics), 6.35, 1e8
    mass = {"carrier_x": 5.43, "carrier_y": 5.43, "carrier_rotation": 6.0, "sun_x": 0.4, "sun_y": 0.4}
    mass |= {"sun_rotation": 2.5, "ring_x": m_r, "ring_y": m_r, "ring_rotation": 7.681}
    for n in range(1, planets + 1):
        mass |= {f"planet{n}_radial": 4.0, f"planet{n}_tangential": 4.0, f"planet{n}_rotation": 2.0}
    support = {"carrier_x": 5e11, "carrier_y": 5e11, "carrier_rotation": 1e11}
    support |= {"sun_x": 5e11, "sun_y": 5e11, "sun_rotation": 5e11}
    bending = 0.5
    for m in range(2, harmonics + 1):
        for f in "cs":
            mass[f"ring_{f}{m}"] = m_r * (1 + m**2) / 2
            support[f"ring_{f}{m}"] = k * np.pi * bending * m**2 * (m**2 - 1) ** 2
    stiffness = np.diag([support.get(name, 0.0) / k for name in dofs])
    for n in range(1, planets + 1):
        psi = 2 * np.pi * (n - 1) / planets
        radial = {"carrier_x": np.cos(psi), "carrier_y": np.sin(psi), f"planet{n}_radial": -1}
        across = {"carrier_x": -np.sin(psi), "carrier_y": np.cos(psi), "carrier_rotation": 1}
        for spring in (radial, across | {f"planet{n}_tangential": -1}):
            g = np.array([spring.get(name, 0.0) for name in dofs])
            stiffness += 5e11 / k * np.outer(g, g)
    g = directions(dofs, planets)
    return dofs, np.diag([mass[name] / m_r for name in dofs]), stiffness + g.T @ g, g


def modes_group(planets=4, harmonics=6):
    """The group ``modes``; types are those of the first nine modes of Table 1, the others are "other"."""
    dofs, mass, stiffness, g = matrices(planets, harmonics)
    squares, shapes = eigh(stiffness, mass)
    types = [*"TTRPTTR", "PR", "P"]
    words = {"T": "translational", "R": "rotational", "P": "planet", "PR": "purely ring"}
    numbers = {"T": 1, "R": 0, "P": 2, "PR": -1}
    kinds = [words[t] for t in types] + ["other"] * (len(dofs) - 9) if planets == 4 else ["other"] * len(dofs)
    index = [numbers[t] for t in types] + [-1] * (len(dofs) - 9) if planets == 4 else [-1] * len(dofs)
    meshes = [f"{gear}{n}" for gear in ("sun", "ring") for n in range(1, planets + 1)]
    data = {
        "natural_frequency": ("mode", np.sqrt(np.abs(squares)), {"units": "1", "long_name": "natural frequency"}),
        "mode_shape": (("mode", "dof"), shapes.T, {"units": "1", "long_name": "mode shape"}),
        "mesh_deflection": (("mode", "mesh"), (g @ shapes).T, {"units": "1", "long_name": "modal mesh deflection"}),
        "mode_type": ("mode", kinds),
        "mesh_deflection_type": ("mode", index),
    }
    return xr.Dataset(data, coords={"mode": np.arange(1, len(dofs) + 1), "dof": dofs, "mesh": meshes})


def planetary(**options):
    return tree(modes=modes_group(**options))


def small(dofs, entries, meshes=("mesh",), deflections=((0.0,),), **more):
    """A result with given modes."""
    data = {
        "natural_frequency": ("mode", np.arange(1.0, len(entries) + 1), {"units": "rad/s"}),
        "mode_shape": (("mode", "dof"), np.array(entries, float), {"units": "kg^-1/2"}),
        "mesh_deflection": (("mode", "mesh"), np.array(deflections, float), {"units": "kg^-1/2"}),
        **more,
    }
    return tree(modes=xr.Dataset(data, coords={"dof": list(dofs), "mesh": list(meshes)}))
