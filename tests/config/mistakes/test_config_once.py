"""One mistake in a configuration is one line, however much follows from it."""

from __future__ import annotations

from pathlib import Path

import pytest

from gearstab.config import ConfigError, load

TRAIN = """\
system:
  kind: matrices
  mass: [[1, 0], [0, 2]]
  stiffness: [[1, 0], [0, 1]]
  terms: [{left: [1, 1], right: [1, 0], stiffness: {mean: 0.1}}]
  meshes:
    - {direction: [1, -1], mean_stiffness: 1.0, epsilon: 0.3, contact_ratio: 1.5, damping: 0.1}
sweep:
  mesh_frequency: [1.0, 2.0]
methods:
  floquet: {}
"""
GEARBOX = """\
system:
  kind: gearbox
  gears: {module: 0.003, pressure_angle: "20 deg", face_width: 0.02}
  rotors:
    - {name: motor, inertia: 0.01}
    - {name: pinion, teeth: 20}
    - {name: wheel, teeth: 40, support: {stiffness: 1.0e+8}}
    - {name: load, inertia: 0.1}
  shafts:
    - {name: s1, between: [motor, pinion], stiffness: 1.0e+5}
    - {name: s2, between: [wheel, load], stiffness: 1.0e+5}
  meshes:
    - {name: one, gears: [pinion, wheel], damping_ratio: 0.05}
  input: {rotor: motor, torque: 50}
  outputs: [{rotor: load}]
"""
PAIR = """\
system:
  kind: gear_pair
  teeth: [24, 96]
  inertias: [0.01, 0.1]
  torsional_stiffness: [1000.0, 2000.0]
  contact_ratio: 1.7
  torque: 20.0
respond:
  speed: 60.0
  cycles: 10
"""
SAMPLED = "waveform: {kind: sampled, file: k.csv, phase: [0, 0.5], stiffness: [1, 2]}"
PAIR_WAVE = "contact_ratio: 1.5, waveform: {kind: pair, shape: constant, stiffness: [1, 2], ends: 1}"
STEADY = "respond: {mesh_frequency: 1, steady_state: true, cycles: 3}"
ALL = "face_width to gears, which holds for all, or give inertia and mass and mean_stiffness instead"


@pytest.mark.parametrize(
    ("right", "old", "new", "line", "said"),
    [
        (TRAIN, "contact_ratio: 1.5", SAMPLED, 7,
         "system.meshes.0.waveform.stiffness: file is given already; keep one of file, stiffness"),
        (TRAIN, "contact_ratio: 1.5", PAIR_WAVE, 7, "system.meshes.0.waveform.stiffness: shape is given already; "
         "keep one of shape, file, stiffness"),
        (TRAIN, "contact_ratio: 1.5", "waveform: {kind: sampled, pair_stiffness: 3, phase: [0, 0.5], "
         "stiffness: [1, 2]}", 7, "system.meshes.0.waveform.pair_stiffness: a sampled wave takes no pair_stiffness; "
         "remove it, or choose kind: pair"),
        (TRAIN, "contact_ratio: 1.5", "contact_ration: 1.5", 7,
         "system.meshes.0.contact_ration: unknown key; did you mean 'contact_ratio'?"),
        (TRAIN, "epsilon: 0.3", "epsilom: 0.3", 7, "system.meshes.0.epsilom: unknown key; did you mean 'epsilon'?"),
        (TRAIN, "epsilon: 0.3, ", "", 7, "system.meshes.0: epsilon or amplitude is missing; add epsilon or amplitude"),
        (TRAIN, "right: [1, 0], stiffness", "right: [1, 0], stifness", 5,
         "system.terms.0.stifness: unknown key; did you mean 'stiffness'?"),
        (TRAIN, "damping: 0.1", "transmission_error: {tan: [1]}", 7,
         "system.meshes.0.transmission_error.tan: unknown key; available: sin, cos"),
        (TRAIN, "contact_ratio: 1.5", "waveform: {kind: fourier, tan: [1]}", 7,
         "system.meshes.0.waveform.tan: unknown key; available: kind, ramp, sin, cos, shape, ends, pair_stiffness, "
         "file, interpolation, phase, stiffness, torque, ..."),
        (TRAIN.replace("mesh_fr", "epsilon: [0.1, 0.2]\n  mesh_fr"), "  meshes:", "  meses:", 6,
         "system.meses: unknown key; did you mean 'meshes'?"),
        (TRAIN, "  mass: [[1, 0], [0, 2]]", "  masses: [[1, 0], [0, 2]]", 3,
         "system.masses: unknown key; did you mean 'mass'?"),
        (TRAIN, "sweep:\n  mesh_frequency: [1.0, 2.0]\nmethods:\n  floquet: {}", STEADY, 8,
         "respond.steady_state: nothing drives the system; give a load (a gearbox: torques of input or outputs), a "
         "mesh's transmission_error or forces"),
        (GEARBOX, "module: 0.003, ", "", 3,
         "system.gears.module: is missing; add module to gears, which holds for all, or to each gear"),
        (GEARBOX, ", face_width: 0.02", "", 3, "system.gears.face_width: is missing, needed for the inertia of pinion, "
         f"the inertia of wheel, the mass of wheel, the stiffness of mesh one; add {ALL}"),
        (GEARBOX, ", face_width: 0.02}\n  rotors:\n    - {name: motor, inertia: 0.01}\n    - {name: pinion, teeth: 20",
         "}\n  rotors:\n    - {name: motor, inertia: 0.01}\n    - {name: pinion, teeth: 20, face_width: 0.02", 7,
         "system.rotors.2.face_width: is missing, needed for the inertia of wheel, the mass of wheel, the stiffness of "
         "mesh one; add face_width to this rotor, or give inertia and mass and mean_stiffness instead"),
        (GEARBOX, "name: wheel,", "name: pinion,", 6,
         "system.rotors.1.name: two rotors are called 'pinion'; give each a name of its own"),
        (GEARBOX, "damping_ratio: 0.05}", "damping_ratio: 0.05, waveform: {kind: tooth}, contact_ratio: 1.6}", 13,
         "system.meshes.0.contact_ratio: the teeth give it; remove it, or choose waveform: {kind: rectangular}; "
         "measured values are single_pair_stiffness and variation"),
        (GEARBOX, "load}]\n", "load}]\nsweep: {mesh_frequency: [1000], meshes.one.friction.coefficient: [0, 0.1]}\n"
         "methods: {floquet: {}}\n", 16, "sweep.meshes.one.friction.coefficient: there is no friction here; add "
         "system.meshes.0.friction, of which the axis sets a number"),
        (GEARBOX, "{name: pinion, teeth: 20}", "{name: pinion, teeth: 20, bore_radius: 0.028}", 13, "system.meshes.0: "
         "bore_radius 0.028 m must lie inside the root circle, 0.02625 m; change the teeth, or give the stiffness of "
         "the mesh"),
        (PAIR, "torque: 20.0", "torque: 20.0\n  module: 3\n  radii: [1, 2]", 9,
         "system.radii: module is given already; keep one of module, radii"),
        (PAIR, "[1000.0, 2000.0]", "[1000.0, -1.0]", 5,
         "system.torsional_stiffness.1: must be > 0 (got -1.0); choose a value > 0"),
        (PAIR, "cycles: 10", "cyles: 10", 10, "respond.cyles: unknown key; did you mean 'cycles'?"),
    ],
)  # fmt: skip
def test_one_mistake_is_one_line(tmp_path: Path, right: str, old: str, new: str, line: int, said: str) -> None:
    assert right.count(old) == 1
    (tmp_path / "k.csv").write_text("0, 1\n0.5, 2\n")
    path = tmp_path / "case.yaml"
    path.write_text(right.replace(old, new))
    with pytest.raises(ConfigError) as caught:
        load(path)
    assert str(caught.value) == f"{path}:{line}: {said}"


@pytest.mark.parametrize("right", [TRAIN, GEARBOX, PAIR])
def test_the_right_ones_are(tmp_path: Path, right: str) -> None:
    path = tmp_path / "case.yaml"
    path.write_text(right)
    load(path)


def test_two_mistakes_are_two_lines(tmp_path: Path) -> None:
    """A key that is unlike any other stands for none that is missing."""
    path = tmp_path / "case.yaml"
    path.write_text(TRAIN.replace("epsilon: 0.3, contact_ratio: 1.5", "colour: red, contact_ration: -1"))
    with pytest.raises(ConfigError) as caught:
        load(path)
    assert [(p.path, p.code) for p in caught.value.problems] == [
        ("system.meshes.0", "missing"),
        ("system.meshes.0.colour", "unknown_key"),
        ("system.meshes.0.contact_ration", "unknown_key"),
    ]


def test_gears_that_lack_a_number_each_are_named_each(tmp_path: Path) -> None:
    path = tmp_path / "case.yaml"
    text = GEARBOX.replace("module: 0.003, ", "").replace("teeth: 40,", "teeth: 40, module: 0.003,")
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        load(path)
    assert [(p.path, p.line) for p in caught.value.problems] == [("system.rotors.1.module", 6)]
