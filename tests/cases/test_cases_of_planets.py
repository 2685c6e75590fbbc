"""Planetary stages of a public 5 MW gearbox, phases as fractions, and what is not modelled."""

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import CONFIGS, TRAIN, plain, ran, read, refused, succeeds, written

import gearstab as gs
from gearstab.config import Config, load
from gearstab.modal import mean_modes
from gearstab.systems import build
from gearstab.systems.planetary.teeth import with_teeth

CASES = Path(__file__).parent
STAGE_TWO, STAGE_ONE = CASES / "b20_nrel_planetary.yaml", CASES / "c1_nrel_planetary_teeth.yaml"
DRAWING = [
    "teeth.centre_distance=863 mm",
    "teeth.profile_shift={sun: 0.617, planet: 0.802, ring: 0.501}",
    "teeth.tip_radius={sun: 489.404 mm, planet: 452.729 mm, ring: 1237.545 mm}",
]
"""Values of the first stage, as published; the ring's profile shift in this program's sign."""


def sun_ring(config: Config) -> float:
    """The lag of the first planet's ring mesh."""
    lags = {mesh.name: float(mesh.lag) for mesh in build(config.system).meshes}
    return (lags["ring1"] - lags["sun1"]) % 1


def test_b20_a_stage_with_profile_shift_is_accepted_and_its_lag_called_unknown() -> None:
    done = succeeds("check", STAGE_TWO)
    assert "3 more than z_s + 2 z_p" in done.output
    assert "give phases.sun_ring" in done.output
    assert ran("check", STAGE_TWO, "--set", "phases.sun_ring=0.3").output.count("\n") == 1


@pytest.mark.parametrize(("change", "words"), [("planets=4", "(z_s + z_r)/N = 111/4"), ("teeth.ring=97", "give 90")])
def test_b20_what_cannot_be_assembled_is_refused(change: str, words: str) -> None:
    assert words in refused("check", STAGE_TWO, "--set", change)


def test_c1_gears_alone_are_placed_halfway_and_told() -> None:
    succeeds("check", STAGE_ONE)
    teeth = with_teeth(load(STAGE_ONE).system)["teeth"]
    assert teeth["centre_distance"] == pytest.approx(0.045 * (19 + 56) / 4, rel=1e-12)
    said = ran("info", STAGE_ONE).output
    assert "= z_s + 2 z_p + 3; centre distance 0.84375 m, profile shifts sun 0.427, planet 0.427, ring -0.1944" in said
    assert "from entry to entry; planets turn clockwise on the carrier, the planet drives in the sun's meshes" in said


def test_c1_with_its_drawing_has_its_angles_contact_ratios_and_lag() -> None:
    """Angles and contact ratios as published programs have them; the lag from flanks turned by brute force."""
    config = load(STAGE_ONE, DRAWING)
    p = with_teeth(config.system)
    # The carrier drives counter-clockwise: the load on the sun is clockwise, and the other flanks carry.
    angles = [-0.49074362558843027, -0.29950993333338166]
    assert [p["pressure_angles"][name] for name in ("sun", "ring")] == pytest.approx(angles, abs=1e-9)
    ratios = [1.1146989629482964, 1.2785713181521987]
    assert [p["meshes"][name]["contact_ratio"] for name in ("sun", "ring")] == pytest.approx(ratios, abs=1e-9)
    assert sun_ring(config) == pytest.approx(0.375166, abs=1e-6)
    between = load(STAGE_ONE, [*DRAWING, "phases.rule=pitch_point"])
    assert sun_ring(between) == pytest.approx(1 - 0.8766161469295595, abs=1e-9)
    forwards = load(STAGE_ONE, [*DRAWING, "phases={rule: pitch_point, drives: sun}"])
    assert sun_ring(forwards) == pytest.approx(0.8766161469295595, abs=1e-9)


def test_c1_keeps_its_numbers_once_resolved(tmp_path: Path) -> None:
    config = load(STAGE_ONE, DRAWING)
    again = read(tmp_path, config.resolved)
    assert again.resolved == config.resolved
    assert sun_ring(again) == sun_ring(config)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("c2_gearbox_without_carrier", "add a shaft or a mesh to it, or a planetary set with it"),
    ],
)
def test_what_is_not_modelled_is_said_in_one_line(name: str, words: str) -> None:
    assert words in refused("check", CASES / f"{name}.yaml")


# ---- the whole gearbox as matrices

STAGES = {"c1": (19, 17, 56, 0.045), "s1": (18, 36, 93, 0.021)}
"""Teeth and module by the carrier: the sun of the first stage carries the planets of the second."""


def gearbox() -> dict[str, Any]:
    """NREL's gearbox in torsion: two planetary stages and a pair, rotations in the housing's frame."""
    names = ["hub", "c1", *(f"a{i}" for i in range(3)), "s1", *(f"b{i}" for i in range(3)), "s2", "pinion", "generator"]
    inertia = dict.fromkeys(names, 40.0) | {"hub": 3.5444e7, "c1": 8e4, "s1": 2.2e4, "generator": 534.0}
    stiffness = np.zeros((len(names), len(names)))
    for one, other, k in (("hub", "c1", 9e8), ("pinion", "generator", 6e7)):
        spring = np.array([(name == one) - float(name == other) for name in names])
        stiffness += k * np.outer(spring, spring)
    meshes, ratio = [], Fraction(1)
    for (carrier, (z_s, z_p, z_r, module)), sun, planet in zip(STAGES.items(), ("s1", "s2"), "ab", strict=True):
        sun_r, planet_r, ring_r = (z * module / 2 * np.cos(np.deg2rad(20)) for z in (z_s, z_p, z_r))
        for i in range(3):
            lag, own = str(Fraction(z_s * i, 3) % 1), f"{planet}{i}"
            common = {"frequency_ratio": str(ratio), "mean_stiffness": 1.4e10, "epsilon": 0.15, "contact_ratio": 1.4}
            first = {sun: sun_r, own: planet_r, carrier: -sun_r - planet_r}
            meshes.append(common | {"name": f"{sun}_{i}", "direction": first, "lag": lag if "/" in lag else 0})
            second = {own: -planet_r, carrier: planet_r - ring_r}
            meshes.append(common | {"name": f"ring_{own}", "direction": second, "lag": "3/8"})
        # The sun turns 1 + z_r/z_s times as fast as its carrier, and z_r teeth mesh in a turn of the carrier.
        ratio = ratio * (1 + Fraction(z_r, z_s)) * Fraction({56: 93, 93: 95}[z_r], z_r)
    meshes.append(
        {"name": "pair", "direction": {"s2": 0.6, "pinion": -0.16}, "mean_stiffness": 6e9, "epsilon": 0.1,
         "contact_ratio": 1.5, "frequency_ratio": str(ratio)}
    )  # fmt: skip
    mass = np.diag([inertia[name] for name in names])
    model = gs.from_matrices(
        mass, stiffness, meshes=meshes, coordinates=names, coordinate_units="rad", damping_ratio=0.02
    )
    return {"system": model, "sweep": {"mesh_frequency": [30.0, 60.0]}, "methods": {"floquet": {}}}


@pytest.mark.filterwarnings("ignore::gearstab.errors.DoubtWarning")
def test_c4_a_train_of_planetary_stages_goes_as_matrices() -> None:
    system = build(gs.load(gearbox()).system)
    ratios = {mesh.frequency_ratio for mesh in system.meshes}
    assert ratios == {Fraction(1), Fraction(6975, 1064), Fraction(4625, 112)}
    lags = [float(mesh.lag) for mesh in system.meshes if mesh.name.startswith("s1_")]
    assert lags == [0.0, 1 / 3, 2 / 3]
    # All that turns together is the only motion without strain, ratios of Willis included.
    frequencies = mean_modes(system).natural_frequency
    assert frequencies[0] < 1e-3 < 1.0 < frequencies[1]


# ---- fractions

FRACTIONS = pytest.mark.parametrize(
    ("text", "value"), [("1/3", 1 / 3), ("-1/3", -1 / 3), (" 5 / 8 ", 0.625), ("7/3", 7 / 3)]
)


@FRACTIONS
def test_a_phasing_may_be_a_fraction(tmp_path: Path, text: str, value: float) -> None:
    second = TRAIN.replace("name: second", f'name: second, phasing: "{text}"')
    assert read(tmp_path, second).system["meshes"][1]["phasing"] == value
    assert read(tmp_path, TRAIN, f"phasing={text}").system["meshes"][1]["phasing"] == value
    swept = read(tmp_path, f'{TRAIN}sweep: {{phasing: ["{text}", 0.1]}}\nmethods: {{perturbation: {{}}}}\n')
    assert swept.axes[0].values[0] == value


@FRACTIONS
def test_phases_of_planets_and_samples_may_be_fractions(tmp_path: Path, text: str, value: float) -> None:
    given = CONFIGS / "parker_2009" / "fig4.yaml"
    phases = plain(load(given, [f'phases={{sun: ["{text}", 0, 0, 0], sun_ring: "{text}"}}']).system["phases"])
    assert phases == {"sun": [value, 0, 0, 0], "sun_ring": value}
    wave = '{kind: sampled, phase: [0, "1/3", "2/3"], stiffness: [1, 1.2, 0.8]}'
    sampled = TRAIN.replace("mean_stiffness: 1.0, epsilon: 0.3, contact_ratio: 1.5", f"waveform: {wave}", 1)
    assert read(tmp_path, sampled).system["meshes"][0]["waveform"]["phase"] == [0, 1 / 3, 2 / 3]


def test_a_stiffness_is_no_fraction(tmp_path: Path) -> None:
    assert ran("check", written(tmp_path, TRAIN.replace("epsilon: 0.3", 'epsilon: "1/3"', 1))).exit_code == 2
