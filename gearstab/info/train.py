"""Facts about a gearbox: a drawing of the train, its teeth, the strain energy of its modes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from math import pi
from typing import TYPE_CHECKING, Any

import numpy as np

from gearstab.config.model.units import scale
from gearstab.info import table
from gearstab.modal import static_mesh_force
from gearstab.symmetry import natural_modes

if TYPE_CHECKING:
    from gearstab.config import Config
    from gearstab.system import GearSystem
    from gearstab.systems.gearbox.planet_set import TrainMesh, TrainSet
    from gearstab.systems.gearbox.train import Train


def facts(config: Config, system: GearSystem) -> dict[str, Any] | None:
    """All that is said of a train, as plain numbers, texts and lists; None for other kinds of systems."""
    train = config.system.train()
    if train is None:
        return None
    from gearstab.systems.gearbox.loads import torques

    loaded = system.load is not None
    forces = np.abs(static_mesh_force(system)) if loaded else np.full(len(system.whole_meshes), np.nan)
    speed = train.p.input.speed
    applied = {rotor: float(value) for rotor, value in torques(train).items()}
    return {
        "speed": None if speed is None else float(speed),
        "rotors": [_rotor(train, k, applied.get(train.name(k))) for k in range(len(train.rotors))],
        "shafts": _shafts(train),
        "sets": [_set(train, item, applied.get(train.p.input.rotor)) for item in train.sets],
        "meshes": [
            _mesh(train, mesh, float(force) if loaded else None, speed)
            for mesh, force in zip(train.meshes, forces, strict=True)
        ],
        "input": train.p.input.rotor,
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
        "held": train.name(k) in train.held,
        "torque": torque,
    }


def _set(train: Train, item: TrainSet, torque: float | None) -> dict[str, Any]:
    """A planetary set. torque: on the input rotor, N m; the members' are counter-clockwise where the input turns so."""
    _, sun_drives, _ = train.power(item)
    torques = None
    if torque is not None and (carried := train.reactions.get(item.where)):
        unit = float(-carried / train.reactions["input",]) * torque
        z = {"sun": item.counted("sun"), "ring": item.counted("ring")}
        shares = z | {"carrier": -z["sun"] - z["ring"]}
        torques = {item.body[member]: share * unit for member, share in shares.items()}
    mass, inertia = item.teeth.body("planet")
    shifts = {gear: float(cut["profile_shift"]) for gear, cut in item.teeth.cut.items()}
    return {
        "name": item.name,
        "members": {member: item.body[member] for member in ("sun", "ring", "carrier")},
        "held": item.p.held,
        "teeth": {gear: item.counted(gear) for gear in ("sun", "planet", "ring")},
        "planets": item.count,
        "angles": [math.degrees(float(angle)) for angle in item.angles],
        "planet_speed_ratio": str(train.speeds[item.planet]),
        "planet_mass": float(mass),
        "planet_inertia": float(inertia),
        "centre_distance": float(item.teeth.centre),
        "profile_shift": shifts,
        "sun_drives": sun_drives,
        "torques": torques,
    }


def _shafts(train: Train) -> list[dict[str, Any]]:
    from gearstab.systems.gearbox.build import shaft_stiffness

    return [
        {"name": s.name, "between": list(s.between), "stiffness": float(shaft_stiffness(train, s))}
        for s in train.p.shafts
    ]


def _mesh(train: Train, mesh: TrainMesh, force: float | None, speed: float | None) -> dict[str, Any]:
    """The teeth of a mesh and what they carry. force: the static one, N; speed: of the input rotor, rad/s."""
    pair, motion, names = mesh.teeth.pairs[0], mesh.motion, list(mesh.gears)
    parts = dict(zip(("pinion", "wheel"), names[::-1] if pair.wheel_drives else names, strict=True))
    order = motion.frequency(train.speeds)
    rolling = pair.base_pitch / math.cos(pair.pressure_angle) * float(order) / (2 * math.pi)
    return {
        "name": mesh.name,
        "gears": names,
        "relative_to": motion.fixed_in or None,
        "teeth": list(motion.teeth),
        "speed_ratio": str(order / motion.teeth[0]),
        "order": str(order),
        "frequency": None if speed is None else float(order) * float(speed) / (2 * math.pi),
        "frequency_ratio": str(train.frequency_ratio(motion)),
        "lag": str(mesh.lag) if isinstance(mesh.lag, Fraction) else f"{float(mesh.lag) % 1:.12g}",
        "centre_distance": pair.centre,
        "pressure_angle": math.degrees(pair.pressure_angle),
        "contact_ratio": pair.contact_ratio,
        "overlap_ratio": pair.overlap_ratio,
        "total_contact_ratio": pair.total_contact_ratio,
        "helix_angle": abs(math.degrees(pair.pinion.helix_angle)),
        "force": force,
        "axial_force": None if force is None else float(train.thrust(mesh)) * force,
        "velocity": None if speed is None else rolling * float(speed),
        "relief": _relief(mesh),
        "notices": [_notice(notice, parts) for notice in pair.notices],
    }


def _relief(mesh: TrainMesh) -> dict[str, float] | None:
    """Effect of the load on teeth with relief; None of others."""
    if not mesh.teeth.relieved:
        return None
    (found, *_) = mesh.teeth.loaded
    return {
        "force": found.force,
        "mean_transmission_error": found.mean_error,
        "transmission_error_peak_to_peak": found.peak_to_peak,
        "contact_ratio": found.contact_ratio,
        "tangent_stiffness": found.mean,
        "secant_stiffness": found.secant,
    }


def _notice(notice: Any, parts: dict[str, str]) -> dict[str, Any]:
    from gearstab.systems.gearbox.feasibility import NOTICES

    beyond = abs(notice.number - notice.limit)
    numbers = {"number": notice.number, "limit": notice.limit, "number_mm": 1e3 * notice.number,
               "limit_mm": 1e3 * notice.limit, "beyond": 1e3 * beyond, "beyond_angle": beyond}  # fmt: skip
    part = parts.get(notice.part)
    return {
        "name": notice.name,
        "gear": part,
        "number": float(notice.number),
        "limit": float(notice.limit),
        "text": NOTICES[notice.name].detail.format(**numbers),
    }


def _shares(train: Train, system: GearSystem) -> list[dict[str, float | None]]:
    """Return the shares of each mode's strain energy in the shafts and in the supports; None of rigid-body modes."""

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
    of_set = {m["name"].rsplit(".", 2)[0]: m for m in found["meshes"] if m["relative_to"]}
    links += [(list(s["members"].values()), _around(s, of_set[s["name"]], found["speed"])) for s in found["sets"]]
    links += [(m["gears"], _through(m)) for m in found["meshes"] if not m["relative_to"]]
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
    ways = []
    for _, ends, text in onward:
        others = [other for other in ends if other != name]
        ways += [(other, text.split(",")[0] if k else text) for k, other in enumerate(others)]
    for place, (other, text) in enumerate(ways):
        last = place == len(ways) - 1
        deeper = margin + ("   " if last else "|  ")
        _branch(other, margin + "+- ", deeper, text, links, known, speed, used, seen, lines)


def _through(mesh: dict[str, Any]) -> str:
    numbers = [f"{mesh['teeth'][0]}/{mesh['teeth'][1]}"]
    numbers += [] if mesh["force"] is None else [f"{mesh['force']:.1f} N"]
    numbers += [] if mesh["velocity"] is None else [f"{mesh['velocity']:.3g} m/s", _frequency(mesh["frequency"])]
    return f"mesh {mesh['name']}, {', '.join(numbers)}"


def _around(item: dict[str, Any], mesh: dict[str, Any], speed: float | None) -> str:
    """A planetary set in a line, with its mesh frequency."""
    z = item["teeth"]
    numbers = [f"{z['sun']}/{z['planet']}/{z['ring']}, {item['planets']} planets"]
    numbers.append(f"planets {_speed(item['planet_speed_ratio'], speed)}")
    numbers.append(f"{mesh['order']} cycles a turn of the input" if speed is None else _frequency(mesh["frequency"]))
    return f"set {item['name']}, {', '.join(numbers)}"


def _frequency(hertz: float) -> str:
    return f"{hertz:.5g} Hz ({60 * hertz:.5g} rpm)"


def _speed(ratio: str, speed: float | None) -> str:
    """A speed in rpm, or over that of the input. speed: of the input, rad/s."""
    return f"{float(Fraction(ratio)) * speed * 30 / pi:.5g} rpm" if speed is not None else f"{ratio} of the input speed"


def _body(rotor: dict[str, Any], speed: float | None) -> str:
    parts = [] if rotor["teeth"] is None else [f"z = {rotor['teeth']}" + (" internal" if rotor["internal"] else "")]
    parts.append("held" if rotor["held"] else _speed(rotor["speed_ratio"], speed))
    parts.append(f"{rotor['inertia']:.4g} kg m^2")
    if rotor["torque"] is not None:
        parts.append(f"{'drives with' if rotor['torque'] > 0 else 'takes'} {abs(rotor['torque']):.5g} N m")
    return f"{rotor['name']}: {', '.join(parts)}"


def teeth(found: dict[str, Any]) -> str:
    """The teeth of all meshes, and what a designer should know of them."""
    header = ["mesh", "driver", "driven", "teeth", "centre distance (mm)", "pressure angle (deg)", "contact ratio"]
    header += ["static force (N)", "velocity (m/s)"]
    helical = [m for m in _different(found) if m["helix_angle"]]
    rows = [
        [m["name"], *m["gears"], "/".join(map(str, m["teeth"])), f"{1e3 * m['centre_distance']:.4f}",
         f"{m['pressure_angle']:.4f}", f"{m['contact_ratio']:.4f}",
         "-" if m["force"] is None else f"{m['force']:.1f}", "-" if m["velocity"] is None else f"{m['velocity']:.4g}"]
        for m in _different(found)
    ]  # fmt: skip
    lines = [table(header, rows)]
    for m in helical:
        text = f"mesh {m['name']}: helical, {m['helix_angle']:.6g} deg; total contact ratio "
        text += f"{m['total_contact_ratio']:.4f} = {m['contact_ratio']:.4f} + overlap ratio {m['overlap_ratio']:.4f}"
        if m["axial_force"] is not None:
            text += (
                f"; axial force {m['axial_force']:.1f} N along z on {m['gears'][0]}, the opposite on {m['gears'][1]}"
            )
        lines.append(text)
    for item in found["sets"]:
        lines.append(_told(item))
    lines += [_loaded(m) for m in _different(found) if m["relief"] is not None]
    for m in _different(found):
        lines += [f"warning: mesh {m['name']}, {n['gear'] or 'both gears'}: {n['text']}" for n in m["notices"]]
    return "\n".join(lines)


def _loaded(mesh: dict[str, Any]) -> str:
    """The static transmission error and the stiffness of teeth with relief."""
    r = mesh["relief"]
    return (
        f"relief of {mesh['name']} under {r['force']:.1f} N: static transmission error "
        f"{1e6 * r['mean_transmission_error']:.4g} um in the mean, {1e6 * r['transmission_error_peak_to_peak']:.4g} um "
        f"peak to peak, effective contact ratio {r['contact_ratio']:.4f}; stability and response have the tangent "
        f"stiffness, {r['tangent_stiffness']:.4g} N/m in the mean, not the secant {r['secant_stiffness']:.4g} N/m"
    )


def _different(found: dict[str, Any]) -> list[dict[str, Any]]:
    """The meshes but for those of further planets, which are alike."""
    return [m for m in found["meshes"] if not m["relative_to"] or m["name"].endswith(".1")]


def _told(item: dict[str, Any]) -> str:
    """Where the planets of a set are, its geometry, who drives, and the torques on its members."""
    shifts = ", ".join(f"{gear} {value:.4g}" for gear, value in item["profile_shift"].items())
    text = (
        f"set {item['name']}: planets at {', '.join(f'{angle:.6g}' for angle in item['angles'])} deg, centre distance "
    )
    text += f"{1e3 * item['centre_distance']:.4f} mm, profile shifts {shifts}; "
    text += f"the {'sun' if item['sun_drives'] else 'planet'} drives in the sun's meshes"
    if item["torques"] is not None:
        text += f"; torques {', '.join(f'{name} {value:.5g} N m' for name, value in item['torques'].items())}"
    return text


def modes(facts: dict[str, Any]) -> str:
    """The modes with the shares of their strain energy."""
    # Beside another unit, that of the field.
    hertz = scale(facts["unit"], "rad/s") / (2 * pi) if facts["unit"] != "Hz" else None
    names = [mesh["name"] for mesh in facts["meshes"]]
    header = ["mode", f"frequency ({facts['unit']})", *(["Hz"] if hertz else []), "type", "damping ratio"]
    header += [f"energy {name}" for name in names]
    rows = []
    for mode, share in zip(facts["modes"], facts["train"]["energy_share"], strict=True):
        ratio, frequency = mode["damping_ratio"], mode["natural_frequency"]
        row = [str(mode["mode"]), f"{frequency:.6g}", *([f"{frequency * hertz:.5g}"] if hertz else []), mode["type"]]
        row.append("-" if ratio is None else f"{ratio:.4g}" if not isinstance(ratio, str) else ratio)
        shares = [*(mode["mesh_energy_share"][name] for name in names), share["shafts"], share["supports"]]
        rows.append(row + ["-" if part is None else f"{100 * part:.1f} %" for part in shares])
    return table([*header, "shafts", "supports"], rows)
