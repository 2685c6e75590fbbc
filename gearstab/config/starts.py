"""A configuration to start from, for every kind of system: one that runs, with what its keys mean beside them.

The comments are the descriptions of the fields, so that they say what the program knows. The values are those below.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from gearstab.config.document.problems import nearest
from gearstab.config.model.introspection import inner_type, is_model
from gearstab.config.sections.methods import Methods
from gearstab.errors import NotPossible
from gearstab.systems import KINDS

MESH = {"mean_stiffness": 2.0e8, "epsilon": 0.2, "contact_ratio": 1.6}
METHODS: dict[str, Any] = {"floquet": {}, "boundaries": {}, "perturbation": {"harmonics": 2}}

STARTS: dict[str, tuple[str, dict[str, Any], dict[str, Any]]] = {
    "gear_pair": (
        "A gear pair: the dynamic transmission error is its only coordinate",
        {"kind": "gear_pair", "equivalent_mass": 0.5, "damping_ratio": 0.02, "meshes": [{"name": "mesh", **MESH}]},
        {
            "mesh_frequency": ({"start": 5000.0, "stop": 50000.0, "num": 301}, "rad/s; or rpm: \"3000 rpm\""),
            "epsilon": ({"start": 0.0, "stop": 0.4, "num": 41}, "of the mesh"),
        },
    ),
    "two_stage": (
        "A two-stage train on an input shaft: coordinates along the lines of action",
        {
            "kind": "two_stage", "inertias": [1.0, 0.3, 4.0], "input_shaft_stiffness": 1.0e8, "tooth_ratio": "3/5",
            "damping_ratio": 0.01, "meshes": [{"name": "first", **MESH}, {"name": "second", **MESH, "phasing": 0.0}],
        },
        {
            "mesh_frequency": ({"start": 5000.0, "stop": 100000.0, "num": 401}, "rad/s, of the first mesh"),
            "epsilon": ({"start": 0.0, "stop": 0.4, "num": 41}, "of both meshes"),
        },
    ),
    "planetary": (
        "A planetary gear with a rigid ring",
        {
            "kind": "planetary", "planets": 4, "damping_ratio": 0.02, "ring": {"kind": "rigid"},
            "masses": {"ring": 2.4, "carrier": 5.4, "sun": 0.4, "planet": 0.7},
            "inertias": {"ring": 3.0, "carrier": 6.3, "sun": 0.4, "planet": 0.6},
            "supports": {
                "carrier": 1.0e8, "sun": 1.0e8, "planet": 1.0e8, "carrier_rotation": 0.0, "sun_rotation": 0.0,
                "ring_radial": 1.0e8, "ring_tangential": 1.0e9,
            },
            "pressure_angles": {"sun": "24.6 deg", "ring": "24.6 deg"},
            "meshes": {"sun": MESH | {"contact_ratio": 1.4}, "ring": MESH | {"contact_ratio": 1.8}},
            "teeth": {"sun": 27, "planet": 35, "ring": 97},
        },
        {
            "mesh_frequency": ({"start": 5000.0, "stop": 60000.0, "num": 301}, "rad/s"),
            "epsilon": ({"start": 0.0, "stop": 0.4, "num": 9}, "of all meshes"),
        },
    ),
    "gearbox": (
        "A two-stage gearbox, from its teeth",
        {
            "kind": "gearbox", "damping_ratio": 0.005,
            "gears": {"module": "2 mm", "pressure_angle": "20 deg", "face_width": "20 mm"},
            "rotors": [
                {"name": "motor", "inertia": 0.01}, {"name": "pinion", "teeth": 20}, {"name": "wheel", "teeth": 60},
                {"name": "second pinion", "teeth": 20, "module": "2.5 mm", "face_width": "30 mm"},
                {"name": "second wheel", "teeth": 80, "module": "2.5 mm", "face_width": "30 mm"},
                {"name": "machine", "inertia": 0.2},
            ],
            "shafts": [
                {"name": "input", "between": ["motor", "pinion"], "stiffness": 1.0e4},
                {"name": "middle", "between": ["wheel", "second pinion"], "stiffness": 5.0e4},
                {"name": "output", "between": ["second wheel", "machine"], "stiffness": 8.0e4},
            ],
            "meshes": [
                {"name": "first", "gears": ["pinion", "wheel"]},
                {"name": "second", "gears": ["second pinion", "second wheel"]},
            ],
            "input": {"rotor": "motor", "torque": 20.0}, "outputs": [{"rotor": "machine"}],
        },
        {"input_speed": ({"start": "300 rpm", "stop": "9000 rpm", "num": 301}, "of the motor")},
    ),
    "matrices": (
        "A model from elsewhere: two inertias and two gears on shafts, as matrices",
        {
            "kind": "matrices", "coordinates": ["motor", "pinion", "gear", "load"], "coordinate_units": "rad",
            "mass": [[0.02, 0, 0, 0], [0, 0.002, 0, 0], [0, 0, 0.05, 0], [0, 0, 0, 0.4]],
            "stiffness": [
                [1.0e4, -1.0e4, 0, 0], [-1.0e4, 1.0e4, 0, 0], [0, 0, 5.0e4, -5.0e4], [0, 0, -5.0e4, 5.0e4],
            ],
            "damping_ratio": 0.01,
            "meshes": [{"name": "mesh", "direction": [0, 0.034, -0.102, 0], **MESH}],
        },
        {
            "mesh_frequency": ({"start": 500.0, "stop": 30000.0, "num": 301}, "rad/s"),
            "epsilon": ({"start": 0.0, "stop": 0.4, "num": 41}, "of the mesh"),
        },
    ),
}  # fmt: skip
"""By kind: title, section ``system``, and section ``sweep`` with a remark on each axis."""

COLUMN, WIDTH = 46, 150
"""Where comments begin, and where lines end if they can."""


def start(kind: str) -> str:
    """Return a commented configuration of a kind of system. Raises NotPossible for an unknown kind."""
    if kind not in STARTS:
        raise NotPossible(f"there is no kind of system '{kind}'", f"{nearest(kind, STARTS)} ({', '.join(STARTS)})")
    title, system, sweep = STARTS[kind]
    axes = [(f"  {name}: {flow(spec)}", remark) for name, (spec, remark) in sweep.items()]
    lines = [
        (f"title: {json.dumps(title)}", ""), ("", ""),
        ("system:", ""), *_mapping(system, KINDS[kind], 2, True), ("", ""),
        ("sweep:", "the grid: any number of the system can be an axis, by its path, meshes.0.contact_ratio"), *axes,
        ("", ""), ("methods:", "what is computed over the grid"), *_mapping(METHODS, Methods, 2, False),
    ]  # fmt: skip
    return "\n".join([*HEAD, "", *(_joined(text, comment) for text, comment in lines)])


HEAD = (
    "# To use it, with this text in train.yaml:",
    "#   gearstab check train.yaml            is it right?",
    "#   gearstab info train.yaml             natural frequencies, and the speeds to expect instability at",
    "#   gearstab sweep train.yaml            writes results/train.h5",
    "#   gearstab plot results/train.h5       draws results/train.png",
    "# Numbers are in SI units, or texts with a unit: \"25 mm\". docs/configuration.md lists every key.",
)  # fmt: skip


def _mapping(section: dict[str, Any], model: Any, indent: int, others: bool) -> Iterator[tuple[str, str]]:
    """The lines of a section and their comments, which are the descriptions of the model's fields.

    others: whether to name the keys that the section does not use.
    """
    for key, value in section.items():
        kind = inner_type(model, key)
        said = model.model_fields[key].description if is_model(model) and key != "name" else ""
        said = (said or "").rstrip(".")
        blank = " " * indent
        if isinstance(value, dict) and value and is_model(kind):
            yield f"{blank}{key}:", said
            yield from _mapping(value, kind, indent + 2, key == "meshes")
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            yield f"{blank}{key}:", said
            yield from _entries(value, kind, indent + 2)
        elif isinstance(value, list) and value and isinstance(value[0], list):
            yield f"{blank}{key}:", said
            yield from ((f"{blank}  - {flow(row)}", "") for row in value)
        else:
            yield f"{blank}{key}: {flow(value)}", said
    if others and is_model(model):
        more = [name for name in model.model_fields if name not in section]
        yield from [(f"{' ' * indent}# more keys: {', '.join(more)}", "")] if more else ()


def _entries(entries: list[dict[str, Any]], kind: Any, indent: int) -> Iterator[tuple[str, str]]:
    """The entries of a list: the first one key by key, if its keys have more to say, the others on a line each."""
    blank = " " * indent
    first, model = entries[0], inner_type(kind, 0)
    if len(first) < 3:
        yield from ((f"{blank}- {flow(entry)}", "") for entry in entries)
        return
    lines = list(_mapping(first, model, indent + 2, False))
    yield f"{blank}- {lines[0][0].lstrip()}", lines[0][1]
    yield from lines[1:]
    yield from ((f"{blank}- {flow(entry)}", "") for entry in entries[1:])


def flow(value: Any) -> str:
    """Return a value on one line of YAML."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {flow(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(flow, value)) + "]"
    if isinstance(value, float):
        return f"{value:.1e}" if value >= 1e6 else f"{value:g}" if value % 1 else f"{value:.1f}"
    if isinstance(value, str) and (" " in value or "/" in value):
        return json.dumps(value)
    return str(value)


def _joined(text: str, comment: str) -> str:
    """A line and its comment, which begins in a column where there is room."""
    if not comment:
        return text
    return f"{text.ljust(COLUMN) if len(text) < COLUMN else text + '  '}# {comment}"
