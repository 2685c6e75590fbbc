"""Planetary gears from their teeth: against formulas of discs and involutes, and the same mesh in a gearbox."""

from pathlib import Path

import numpy as np
import pytest
from scenes import problems, read, scene_text

from gearstab.config import Config
from gearstab.systems import build
from gearstab.systems.planetary.sections import Planetary
from gearstab.systems.planetary.teeth import with_teeth

Z = {"sun": 28, "planet": 20, "ring": 68}
M, ALPHA, WIDTH, DENSITY = 0.002, np.deg2rad(20), 0.025, 7850.0
TEXT = scene_text("planetary_teeth_text")
GEARS, TEETH = TEXT.splitlines(keepends=True)[4:6]
PAIR = scene_text("planetary_teeth_pair")


def radius(body: str) -> float:
    return M * Z[body] / 2


@pytest.fixture
def gear(tmp_path: Path) -> Config:
    return read(tmp_path, TEXT)


def test_masses_and_inertias_are_those_of_discs(gear: Config) -> None:
    p = with_teeth(gear.system)
    for body in ("sun", "planet"):
        mass = np.pi * DENSITY * WIDTH * radius(body) ** 2
        assert p["masses"][body] == pytest.approx(mass, rel=1e-12)
        assert p["inertias"][body] == pytest.approx(mass / 2 / np.cos(ALPHA) ** 2, rel=1e-12)  # m r^2/2 over r_b^2
    outer, inner = 1.2 * (radius("ring") + 1.25 * M), radius("ring")
    mass = np.pi * DENSITY * WIDTH * (outer**2 - inner**2)
    assert p["masses"]["ring"] == pytest.approx(mass, rel=1e-12)
    of_ring = mass * (outer**2 + inner**2) / 2 / (inner * np.cos(ALPHA)) ** 2
    assert p["inertias"]["ring"] == pytest.approx(of_ring, rel=1e-12)
    assert (p["masses"]["carrier"], p["inertias"]["carrier"]) == (1.5, 1.2)


def test_contact_ratios_are_those_of_involutes(gear: Config) -> None:
    centre, pitch = radius("sun") + radius("planet"), np.pi * M * np.cos(ALPHA)

    def reach(body: str, addendum: float) -> float:
        return float(np.sqrt((radius(body) + addendum) ** 2 - (radius(body) * np.cos(ALPHA)) ** 2))

    p = with_teeth(gear.system)
    meshes = p["meshes"]
    outside = (reach("sun", M) + reach("planet", M) - centre * np.sin(ALPHA)) / pitch
    inside = (reach("planet", M) - reach("ring", -M) + centre * np.sin(ALPHA)) / pitch
    assert meshes["sun"]["contact_ratio"] == pytest.approx(outside, rel=1e-10)
    assert meshes["ring"]["contact_ratio"] == pytest.approx(inside, rel=1e-10)
    assert dict(p.pressure_angles) == pytest.approx({"sun": ALPHA, "ring": ALPHA}, rel=1e-10)


LAG = 0.1855771347643117
"""Lag of 30/24/78 teeth from entry to entry, computed by another program."""


def lag_of(config: Config) -> float:
    """The lag of the ring's meshes behind the sun's."""
    lags = {mesh.name: float(mesh.lag) for mesh in build(config.system).meshes}
    differences = {round((lags[f"ring{n}"] - lags[f"sun{n}"]) % 1, 9) for n in (1, 2, 3, 4)}
    assert len(differences) == 1
    return differences.pop()


@pytest.mark.parametrize(
    ("lines", "lag", "said"),
    [
        ("", LAG, "from entry to entry"),
        ("phases: {rule: entry}", LAG, "from entry to entry"),
        ("phases: {rule: pitch_point}", 0.5, "from pitch point to pitch point"),
        ("phases: {sun_ring: 0.3}", 0.3, "as given"),
        # What enters leaves in time backwards: c_s - c_r less the lag of power from the sun.
        ("phases: {drives: planet}", (1.627708394200191 - 1.916325772733108 - LAG) % 1, "the planet drives"),
        ("input: carrier", (1.627708394200191 - 1.916325772733108 - LAG) % 1, "the planet drives"),
    ],
)  # fmt: skip
def test_the_ring_lags_by_the_rule_asked_for(tmp_path: Path, lines: str, lag: float, said: str) -> None:
    text = TEXT.replace("sun: 28, planet: 20, ring: 68", "sun: 30, planet: 24, ring: 78")
    config = read(tmp_path, text.replace("  planets: 4\n", f"  planets: 4\n  {lines}\n"))
    assert lag_of(config) == pytest.approx(lag, abs=1e-8)
    assert said in Planetary.summary(config.system)["phases"]
    assert lag_of(read(tmp_path, config.resolved)) == pytest.approx(lag, abs=1e-8)


def test_the_stiffness_is_that_of_the_same_teeth_in_a_gearbox(gear: Config, tmp_path: Path) -> None:
    mesh, same = build(gear.system).meshes[0], build(read(tmp_path, PAIR).system).meshes[0]
    assert mesh.mean_stiffness == pytest.approx(float(same.mean_stiffness), rel=1e-12)
    assert mesh.epsilon == pytest.approx(float(same.epsilon), rel=1e-12)
    # The ring's is measured: so much for each of the pairs in contact.
    ring = build(gear.system).meshes[-1]
    low, high = (ring.mean_stiffness + 2 * ring.amplitude * level for level in ring.waveform.extremes())
    assert (low, high) == pytest.approx((3.0e8, 6.0e8), rel=1e-12)


def test_what_is_given_stands(tmp_path: Path) -> None:
    text = TEXT.replace("carrier: 1.5", "carrier: 1.5, sun: 9").replace("sun: {}", "sun: {epsilon: 0.1}")
    p = with_teeth(read(tmp_path, text).system)
    assert (p["masses"]["sun"], p["meshes"]["sun"]["epsilon"]) == (9, 0.1)
    assert p["meshes"]["sun"]["contact_ratio"] > 1


def test_the_resolved_configuration_is_as_the_user_wrote_it(gear: Config, tmp_path: Path) -> None:
    """Values that follow from the teeth are not written into it, so that it stays right where they are changed."""
    assert gear.tree["system"]["masses"] == {"carrier": 1.5}
    assert read(tmp_path, gear.resolved).resolved == gear.resolved


def test_without_gears_their_numbers_are_missing(tmp_path: Path) -> None:
    assert "system.masses.ring" in [p.path for p in problems(tmp_path, TEXT.replace(GEARS, ""))]


@pytest.mark.parametrize(
    ("axis", "changed"),
    [
        ("t: [{label: a, teeth.sun: 28, teeth.ring: 68}, {label: b, teeth.sun: 32, teeth.ring: 72}]",
         {"sun: 28": "sun: 32", "ring: 68": "ring: 72"}),
        ("gears.module: [0.002, 0.0025]", {"module: 2 mm": "module: 2.5 mm"}),
        ("gears.face_width: [0.025, 0.04]", {"face_width: 25 mm": "face_width: 40 mm"}),
        ("teeth.centre_distance: [0.048, 0.0485]", {"ring: 68}": "ring: 68, centre_distance: 48.5 mm}"}),
    ],
    ids=["teeth", "module", "width", "centre"],
)  # fmt: skip
def test_an_axis_of_the_teeth_takes_masses_and_stiffness_along(
    tmp_path: Path, axis: str, changed: dict[str, str]
) -> None:
    text = f"{TEXT}sweep:\n  mesh_frequency: [1.0e4, 2.0e4]\n  {axis}\nmethods: {{floquet: {{}}}}\n"
    if "centre" in axis:
        text = text.replace("ring: 68}", "ring: 68, centre_distance: 48 mm}")
    config = read(tmp_path, text)
    place = config.axes[1]
    together = np.array([1]) if place.assignments[0].structural else np.array([0, 1])
    swept = build(config.at({place.name: together}))
    other = TEXT
    for old, new in changed.items():
        other = other.replace(old, new)
    alone = build(read(tmp_path, other).system)
    np.testing.assert_allclose(swept.mass[-1] if swept.mass.ndim == 3 else swept.mass, alone.mass, rtol=1e-12)
    for mesh, same in zip(swept.meshes, alone.meshes, strict=True):
        for key in ("mean_stiffness", "epsilon", "lag"):
            assert np.ravel(getattr(mesh, key))[-1] == pytest.approx(float(getattr(same, key)), rel=1e-12, abs=1e-14)


def test_a_fixed_body_that_nothing_holds_is_told(gear: Config, tmp_path: Path) -> None:
    free = read(tmp_path, TEXT.replace(", ring_rotation: 1.0e9", ""))
    assert "fixed" not in Planetary.summary(gear.system)
    assert "supports.ring_rotation" in Planetary.summary(free.system)["fixed"]
    other = read(tmp_path, TEXT.replace("  planets: 4\n", "  planets: 4\n  fixed: carrier\n"))
    assert "supports.carrier_rotation" in Planetary.summary(other.system)["fixed"]
