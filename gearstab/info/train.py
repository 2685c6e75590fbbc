"""What ``gearstab info`` says of a gearbox: a drawing of the train, its teeth, the strain energy of its modes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from gearstab.info.tables import table

if TYPE_CHECKING:
    from gearstab.config import Config
    from gearstab.system import GearSystem
    from gearstab.systems.gearbox.train import Train

NOTICES = {
    "undercut": "undercut, the profile shift is {number:.4g} and should be at least {limit:.4g}",
    "top_land": "its teeth are {number:.3g} modules thick at the tip, less than {limit:.3g}",
    "interference": "interference, the contact is cut off: its tip would reach the mate {beyond:.3g} mm beyond the "
    "end of the mate's involute",
    "fillet_contact": "the mate's tip touches it at the radius {number_mm:.4f} mm, inside its fillet, which ends at "
    "{limit_mm:.4f} mm",
    "contact_ratio": "contact breaks off, the contact ratio is {number:.4g}",
    "tip_clearance": "its tip is {number:.3g} modules off the root of its mate, less than {limit:.3g}",
    "backlash": "the teeth are too thick for the centre distance by {beyond:.3g} mm",
    "trochoid_interference": "the tips collide outside of the path of contact, by {beyond_angle:.3g} rad",
    "trimming": "the pinion cannot be put in radially, for {beyond_angle:.3g} rad",
}
"""By the name of a notice of :mod:`gearstab.gears.pair`."""


def facts(config: Config, system: GearSystem) -> dict[str, Any] | None:
    """All that is said of a train, as plain numbers, texts and lists; None for other kinds of systems."""
    import numpy as np

    from gearstab.response.linear.equilibrium import static_mesh_force
    from gearstab.systems import train_of

    train = train_of(config.parameters)
    if train is None:
        return None
    from gearstab.systems.gearbox.build import torques

    loaded = system.load is not None
    forces = np.abs(static_mesh_force(system)) if loaded else np.full(len(system.meshes), np.nan)
    speed = (config.parameters.get("input") or {}).get("speed")
    applied = {rotor: float(value) for rotor, value in torques(train).items()}
    return {
        "speed": None if speed is None else float(speed),
        "rotors": [_rotor(train, k, applied.get(train.name(k))) for k in range(len(train.rotors))],
        "shafts": _shafts(train),
        "meshes": [_mesh(train, k, float(forces[k]) if loaded else None, speed) for k in range(len(system.meshes))],
        "input": config.parameters["input"]["rotor"],
        "energy_share": _shares(train, system),
    }


def _rotor(train: Train, k: int, torque: float | None) -> dict[str, Any]:
    rotor = train.rotors[k]
    return {
        "name": rotor["name"],
        "teeth": None if rotor.get("teeth") is None else int(rotor["teeth"]),
        "internal": bool(rotor.get("internal")),
        "inertia": float(train.inertias[k]),
        "mass": float(train.masses[k]) if k in train.masses else None,
        "speed_ratio": str(train.speeds[train.name(k)]),
        "torque": torque,
    }


def _shafts(train: Train) -> list[dict[str, Any]]:
    from gearstab.systems.gearbox.build import shaft_stiffness

    shafts = train.p.get("shafts") or []
    return [
        {"name": s["name"], "between": list(s["between"]), "stiffness": float(shaft_stiffness(train, s))}
        for s in shafts
    ]


def _mesh(train: Train, k: int, force: float | None, speed: float | None) -> dict[str, Any]:
    """The teeth of a mesh and what they carry. force: the static one, N; speed: of the input rotor, rad/s."""
    import math

    driver, driven = train.meshes[k]
    pair = train.teeth_of(k).pairs[0]
    names = [train.rotors[gear]["name"] for gear in (driver, driven)]
    parts = dict(zip(("pinion", "wheel"), names[::-1] if pair.wheel_drives else names, strict=True))
    rolling = pair.pitch_radii[1 if pair.wheel_drives else 0] * float(abs(train.speeds[train.name(driver)]))
    return {
        "name": train.p["meshes"][k]["name"],
        "gears": names,
        "teeth": [train.teeth(driver), train.teeth(driven)],
        "centre_distance": pair.centre,
        "pressure_angle": math.degrees(pair.pressure_angle),
        "contact_ratio": pair.contact_ratio,
        "force": force,
        "velocity": None if speed is None else rolling * float(speed),
        "notices": [_notice(notice, parts) for notice in pair.notices],
    }


def _notice(notice: Any, parts: dict[str, str]) -> dict[str, Any]:
    beyond = abs(notice.number - notice.limit)
    numbers = {"number": notice.number, "limit": notice.limit, "number_mm": 1e3 * notice.number,
               "limit_mm": 1e3 * notice.limit, "beyond": 1e3 * beyond, "beyond_angle": beyond}  # fmt: skip
    part = parts.get(notice.part)
    return {
        "name": notice.name,
        "gear": part,
        "number": float(notice.number),
        "limit": float(notice.limit),
        "text": NOTICES[notice.name].format(**numbers),
    }


def _shares(train: Train, system: GearSystem) -> list[dict[str, float | None]]:
    """Of the strain energy of each mode, what is in the shafts and what in the supports; None of rigid-body modes."""

    from gearstab.symmetry import natural_modes
    from gearstab.systems.gearbox.build import shaft_elements

    modes = natural_modes(system)
    twist = train.coordinates.stamped([(shaft.row, shaft.stiffness) for shaft in shaft_elements(train)])
    found: list[dict[str, float | None]] = []
    for p in range(system.size):
        q, squared = modes.shapes[:, p], float(modes.squared_frequency[p])
        if modes.rigid[p]:
            found.append({"shafts": None, "supports": None})
            continue
        shafts = float(q @ twist @ q) / squared
        found.append({"shafts": shafts, "supports": float(q @ (system.stiffness - twist) @ q) / squared})
    return found


# ---- text


def drawing(found: dict[str, Any]) -> str:
    """The train as a tree from its input, one line a rotor: the shaft or mesh that leads to it, and how it turns."""
    known = {rotor["name"]: rotor for rotor in found["rotors"]}
    links = [(s["between"], f"{s['name']}, {s['stiffness']:.4g} N m/rad") for s in found["shafts"]]
    links += [(m["gears"], _through(m)) for m in found["meshes"]]
    lines: list[str] = []
    _branch(found["input"], "", "", None, links, known, found["speed"], set(), set(), lines)
    return "\n".join(lines)


def _branch(
    name: str, lead: str, margin: str, how: str | None, links: Sequence[tuple[list[str], str]],
    known: dict[str, dict[str, Any]], speed: float | None, used: set[int], seen: set[str], lines: list[str],
) -> None:  # fmt: skip
    again = name in seen
    seen.add(name)
    text = f"{name} (above)" if again else _body(known[name], speed)
    lines.append(f"{lead}{text}" if how is None else f"{lead}{how} -- {text}")
    if again:
        return
    onward = [(k, ends, text) for k, (ends, text) in enumerate(links) if name in ends and k not in used]
    used.update(k for k, _, _ in onward)
    for place, (_, ends, text) in enumerate(onward):
        last = place == len(onward) - 1
        other = ends[1] if ends[0] == name else ends[0]
        deeper = margin + ("   " if last else "|  ")
        _branch(other, margin + "+- ", deeper, text, links, known, speed, used, seen, lines)


def _through(mesh: dict[str, Any]) -> str:
    numbers = [f"{mesh['teeth'][0]}/{mesh['teeth'][1]}"]
    numbers += [] if mesh["force"] is None else [f"{mesh['force']:.1f} N"]
    numbers += [] if mesh["velocity"] is None else [f"{mesh['velocity']:.3g} m/s"]
    return f"mesh {mesh['name']}, {', '.join(numbers)}"


def _body(rotor: dict[str, Any], speed: float | None) -> str:
    from fractions import Fraction
    from math import pi

    parts = [] if rotor["teeth"] is None else [f"z = {rotor['teeth']}" + (" internal" if rotor["internal"] else "")]
    ratio = Fraction(rotor["speed_ratio"])
    parts.append(f"{float(ratio) * speed * 30 / pi:.5g} rpm" if speed is not None else f"{ratio} of the input speed")
    parts.append(f"{rotor['inertia']:.4g} kg m^2")
    if rotor["torque"] is not None:
        parts.append(f"{'drives with' if rotor['torque'] > 0 else 'takes'} {abs(rotor['torque']):.5g} N m")
    return f"{rotor['name']}: {', '.join(parts)}"


def teeth(found: dict[str, Any]) -> str:
    """The teeth of all meshes, and what a designer should know of them."""
    header = ["mesh", "driver", "driven", "teeth", "centre distance (mm)", "pressure angle (deg)", "contact ratio"]
    header += ["static force (N)", "velocity (m/s)"]
    rows = [
        [m["name"], *m["gears"], "/".join(map(str, m["teeth"])), f"{1e3 * m['centre_distance']:.4f}",
         f"{m['pressure_angle']:.4f}", f"{m['contact_ratio']:.4f}",
         "-" if m["force"] is None else f"{m['force']:.1f}", "-" if m["velocity"] is None else f"{m['velocity']:.4g}"]
        for m in found["meshes"]
    ]  # fmt: skip
    lines = [table(header, rows)]
    for m in found["meshes"]:
        lines += [f"warning: mesh {m['name']}, {n['gear'] or 'both gears'}: {n['text']}" for n in m["notices"]]
    return "\n".join(lines)


def modes(facts: dict[str, Any]) -> str:
    """The modes with the shares of their strain energy."""
    from math import pi

    from gearstab.config.model.units import scale

    # Beside another unit, that of the field.
    hertz = scale(facts["unit"], "rad/s") / (2 * pi) if facts["unit"] != "Hz" else None
    names = [mesh["name"] for mesh in facts["meshes"]]
    header = ["mode", f"frequency ({facts['unit']})", *(["Hz"] if hertz else []), "type", "damping ratio"]
    header += [f"energy {name}" for name in names]
    rows = []
    for mode, share in zip(facts["modes"], facts["train"]["energy_share"], strict=True):
        damping, frequency = mode["damping_ratio"], mode["natural_frequency"]
        row = [str(mode["mode"]), f"{frequency:.6g}", *([f"{frequency * hertz:.5g}"] if hertz else []), mode["type"]]
        row.append("-" if damping is None else f"{damping:.4g}" if not isinstance(damping, str) else damping)
        shares = [*(mode["mesh_energy_share"][name] for name in names), share["shafts"], share["supports"]]
        rows.append(row + ["-" if part is None else f"{100 * part:.1f} %" for part in shares])
    return table([*header, "shafts", "supports"], rows)
