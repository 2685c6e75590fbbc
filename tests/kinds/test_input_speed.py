"""Input speeds of the kinds whose teeth are known, against the kinematics of rolling circles."""

from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from scenes import problems, read, written

from gearstab.systems import section
from gearstab.systems.planetary.phasing import Turning

RPM = np.pi / 30
SWEEP = 'sweep: {input_speed: {start: "600 rpm", stop: "1200 rpm", num: 3}}\nmethods: {floquet: {}}\n'
MESH = "mean_stiffness: 3.0e8, epsilon: 0.3, contact_ratio: 1.6"
PAIR = f"system: {{kind: gear_pair, equivalent_mass: 0.5, teeth: [20, 63], load: 1000, meshes: [{{{MESH}}}]}}\n"
GEARS = (
    "system: {kind: gear_pair, teeth: [24, 96], inertias: [2.89e-3, 0.7402], torsional_stiffness: [1430, 2780], "
    "contact_ratio: 1.7, torque: 21.05, damping_ratio: 0.1}\n"
)
TRAIN = (
    "system: {kind: two_stage, inertias: [1, 0.3, 4], input_shaft_stiffness: 5.0e7, teeth: [17, 34, 21, 50], load: "
    f"[100, 0, -50], damping_ratio: 0.01, meshes: [{{{MESH}}}, {{{MESH}}}]}}\n"
)
PLANETARY = f"""\
system:
  kind: planetary
  planets: 4
  ring: {{kind: rigid}}
  motion: rotational
  masses: {{ring: 6.35, planet: 4.0}}
  inertias: {{ring: 7.681, carrier: 6.0, sun: 2.5, planet: 2.0}}
  supports: {{ring_rotation: 1.0e9}}
  pressure_angles: {{sun: "24.6 deg", ring: "24.6 deg"}}
  meshes: {{sun: {{{MESH}}}, ring: {{{MESH}}}}}
  teeth: {{sun: 28, planet: 20, ring: 68}}
"""


@pytest.mark.parametrize(
    ("system", "per_turn"),
    [(PAIR, 20), (GEARS, 24), (TRAIN, 17), (PLANETARY, 28 * 68 / 96), (PLANETARY + "  input: carrier\n", 68),
     (PLANETARY + "  fixed: carrier\n", 28), (PLANETARY + "  input: ring\n  fixed: carrier\n", 68)],
)  # fmt: skip
def test_the_mesh_frequency_of_an_input_speed(tmp_path: Path, system: str, per_turn: float) -> None:
    (axis,) = read(tmp_path, system + SWEEP).axes
    assert axis.mesh_frequency is not None
    np.testing.assert_allclose(axis.mesh_frequency.values, np.array([600, 900, 1200]) * RPM * per_turn, rtol=1e-14)
    assert (axis.typed_units, axis.long_name) == ("rpm", "input speed")


@pytest.mark.parametrize(("driving", "fixed"), list(permutations(("sun", "carrier", "ring"), 2)))
def test_planets_roll_without_slip(driving: str, fixed: str) -> None:
    """The velocities of a planet's points of contact, sun and ring side, are those of the sun and of the ring.

    Radii are teeth; unknown speeds sun, carrier, ring, planet from the two contacts, the drive and the fixed body.
    """
    z_s, z_p, z_r = 28.0, 20.0, 68.0
    order = ["sun", "carrier", "ring", "planet"]
    arm = z_s + z_p
    rows = [[-z_s, arm, 0, -z_p], [0, arm, -z_r, z_p]]
    rows += [[float(name == body) for name in order] for body in (driving, fixed)]
    speed = dict(zip(order, np.linalg.solve(rows, [0, 0, 1, 0]), strict=True))
    passing = abs(z_s * (speed["sun"] - speed["carrier"]))  # teeth of the sun past a planet's centre
    assert passing == pytest.approx(abs(z_r * (speed["ring"] - speed["carrier"])), rel=1e-12)
    motion = Turning.of(section({"kind": "planetary", "input": driving, "fixed": fixed}), z_s, z_r)
    assert motion is not None
    assert float(motion.cycles) == pytest.approx(passing, rel=1e-12)


def test_the_teeth_of_a_train_give_its_ratio(tmp_path: Path) -> None:
    config = read(tmp_path, TRAIN + SWEEP)
    assert config.tree["system"]["tooth_ratio"] == "34/21"
    same = read(tmp_path, TRAIN.replace("teeth:", "tooth_ratio: 34/21, teeth:") + SWEEP)
    assert same.system["tooth_ratio"] == config.system["tooth_ratio"]


@pytest.mark.parametrize("system", [PAIR, TRAIN])
def test_a_response_at_an_input_speed_is_that_at_its_mesh_frequency(tmp_path: Path, system: str) -> None:
    teeth = 20 if system is PAIR else 17
    config = read(tmp_path, f'{system}respond: {{input_speed: "900 rpm", steady_state: true}}')
    assert config.respond is not None
    assert config.respond.mesh_frequency == pytest.approx(900 * RPM * teeth, rel=1e-14)
    assert config.tree["respond"]["mesh_frequency"] == config.respond.mesh_frequency


def test_a_naive_pair_is_told_what_it_may_leave_out(tmp_path: Path) -> None:
    (problem,) = problems(tmp_path, PAIR.replace("teeth:", "face_width: 20 mm, teeth:") + SWEEP)
    assert problem.path == "system.face_width"
    assert "leave it out" in problem.hint
    found = problems(tmp_path, "system: {kind: gear_pair, teeth: [20, 63], module: 2 mm}\n" + SWEEP)
    (teeth,) = [p for p in found if p.path == "system.teeth"]
    assert "may be left out" in teeth.hint
    assert "kind: gearbox" in teeth.hint


def test_a_resolved_configuration_is_read_again(tmp_path: Path) -> None:
    config = read(tmp_path, TRAIN + SWEEP + 'respond: {input_speed: "900 rpm", steady_state: true}\n')
    again = read(tmp_path, config.resolved)
    assert again.resolved == config.resolved
    assert written(tmp_path, config.resolved).is_file()
