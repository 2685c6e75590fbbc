"""Mistakes that users of drivetrains make, each told in one line with file, line, path and what to do."""

from __future__ import annotations

from pathlib import Path

import pytest
from scenes import CONFIGS

from gearstab.config import ConfigError, load

TEXT = (CONFIGS / "drivetrains/nrel_5mw.yaml").read_text()
BYPASS = "    - {name: bypass, between: [%s, %s], stiffness: 1e6}\n    - {name: generator shaft"
HIGH_SPEED = next(line for line in TEXT.splitlines(keepends=True) if "{name: high speed" in line)
ONE, TWO = "planets: {count: 3, teeth: 17,", "planets: {count: 3, teeth: 36,"

CASES = {
    "other module of the mate": ("teeth: 24, module: 14 mm", "teeth: 24, module: 13.5 mm",
        "meshes.0", "{name: stage 3, gears", "of 95 teeth and", "one module"),
    "unequal module in a set": ("teeth: 56, internal: true, module: 45 mm", "teeth: 56, internal: true, module: 44 mm",
        "planetary_sets.0", "- name: stage 1", "base pitches differ", "one module"),
    "planets of another module": (ONE, ONE + " module: 44 mm,",
        "planetary_sets.0", "- name: stage 1", "of 17 teeth", "one module"),
    "planets that cannot be assembled": (ONE, "planets: {count: 4, teeth: 17,",
        "planetary_sets.0.planets.teeth", "count: 4", "= 75/4 is no integer", "angles: assemble"),
    "planets between wrong gears": (TWO, "planets: {count: 3, teeth: 48,",
        "planetary_sets.1.planets.teeth", "teeth: 48", "z_s + 2 z_p = 114", "give 114 teeth"),
    "two planets": (ONE, "planets: {count: 2, teeth: 17,",
        "planetary_sets.0.planets.count", "count: 2", "whole number >= 3", ""),
    "angles at which no tooth fits": (ONE, f'{ONE} angles: ["0 deg", "121 deg", "239 deg"],',
        "planetary_sets.0.planets.angles", "121 deg", "planet 2 do not fit", '"120 deg"'),
    "angles in degrees without the unit": (ONE, f"{ONE} angles: [0, 120, 240],",
        "planetary_sets.0.planets.angles", "angles: [0, 120", "do not fit", "plain numbers are radians"),
    "two held members": ("held: ring\n      planets: {count: 3, teeth: 17", "held: [ring, sun]\n      " + ONE[:-1],
        "planetary_sets.0.held", "held: [ring, sun]", "held member", "sun, ring, carrier"),
    "a member held that a shaft turns": ("held: ring\n      " + TWO, "held: carrier\n      " + TWO,
        "shafts.1", "{name: intermediate", "the train jams here", "release one"),
    "nothing held": ("      held: ring\n      " + TWO, "      " + TWO,
        "rotors.5", "{name: sun 2", "is not determined", "hold a member"),
    "a shaft too many": ("    - {name: generator shaft", BYPASS % ("turbine", "generator"),
        "meshes.0", "{name: stage 3, gears", "the train jams here", ""),
    "sun and carrier joined": ("    - {name: generator shaft", BYPASS % ("sun 1", "carrier 1"),
        "shafts.3", "{name: bypass", "jams here: no speeds of turbine, ring 1, sun 1", ""),
    "a rotor of no train": (HIGH_SPEED, "", "rotors.7", "{name: wheel", "not connected to the input", "add a shaft"),
    "an unknown member": ("sun: sun 1", "sun: sun 3",
        "planetary_sets.0.sun", "sun: sun 3", "no rotor 'sun 3'", "did you mean"),
    "a ring with teeth outside": ("teeth: 56, internal: true,", "teeth: 56,",
        "planetary_sets.0.ring", "ring: ring 1", "not an internal gear", "internal: true"),
    "a centre distance without its unit": ("centre_distance: 861 mm", "centre_distance: 861",
        "meshes.0", "{name: stage 3, gears", "at the centre distance 861 m", '"160 mm"'),
    "a centre distance that is too short": ("centre_distance: 863 mm", "centre_distance: 600 mm",
        "planetary_sets.0", "- name: stage 1", "base to base", "centre_distance"),
    "a profile shift of the other sign": ("profile_shift: 0.501,", "profile_shift: -0.501,",
        "planetary_sets.0", "- name: stage 1", "planet and ring overlap", "profile_shift"),
    "minus teeth of a ring": ("teeth: 56,", "teeth: -56,",
        "rotors.3.teeth", "teeth: -56", "whole number >= 3", ""),
    "a force for a torque": ("torque: 3950 kN m", "torque: 3950 kN",
        "input.torque", "torque: 3950 kN,", "wrong dimension", "N m"),
    "a unit with a slip": ("speed: 12.1 rpm", "speed: 12.1 rmp",
        "input.speed", "12.1 rmp", "unknown unit 'rmp'", ""),
    "an output that is held": ("outputs: [{rotor: generator}]", "outputs: [{rotor: ring 1}]",
        "planetary_sets.0.held", "held: ring", "is an output, which turns", "hold another"),
    "no output": ("  outputs: [{rotor: generator}]\n", "", "outputs", "system:", "are missing", "name the rotors"),
    "no width of teeth": ("teeth: 19, module: 45 mm, face_width: 491 mm", "teeth: 19, module: 45 mm",
        "rotors.2.face_width", "{name: sun 1", "stiffness of the sun's meshes", "add face_width"),
    "a carrier without inertia": ("{name: carrier 1, inertia: 6.0e+4}", "{name: carrier 1}",
        "rotors.1.inertia", "{name: carrier 1}", "is missing", "add inertia"),
    "a mesh with a rotor without teeth": ("gears: [wheel, pinion]", "gears: [wheel, generator]",
        "meshes.0.gears.1", "gears: [wheel, generator]", "has no teeth", ""),
    "relief without a torque": ("damping_ratio: 0.02}\n  shafts", "damping_ratio: 0.02, "
        "relief: {tip: {amount: 60 um, length: 10 mm}}}\n  shafts", "meshes.0.relief", "relief:", "no torques",
        "add a torque"),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_a_mistake_is_told_in_one_line(tmp_path: Path, name: str) -> None:
    old, new, path, marker, words, remedy = CASES[name]
    assert TEXT.count(old) >= 1
    text = TEXT.replace(old, new, 1)
    if name == "relief without a torque":
        text = text.replace("torque: 3950 kN m, ", "")
    file = tmp_path / "train.yaml"
    file.write_text(text)
    with pytest.raises(ConfigError) as caught:
        load(file)
    said = str(caught.value)
    assert "\n" not in said
    line = next(number for number, content in enumerate(text.splitlines(), 1) if marker in content)
    assert said.startswith(f"{file}:{line}: system.{path}: ")
    assert words in said
    assert remedy in said
