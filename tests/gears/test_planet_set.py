"""Lag of the ring's meshes behind the sun's: closed form, flanks turned by brute force, and tabulated gears.

Lengths in m; NREL's stages from the published 5 MW gearbox (profile shifts, centre distances and tip radii).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.optimize import brentq

from gearstab.errors import NotPossible
from gearstab.gears.geometry import Gear
from gearstab.gears.pair import Pair, PlanetSet, closing_shifts, halfway

ALPHA = np.deg2rad(20.0)
BODIES = ("sun", "planet", "ring")


@dataclass(frozen=True)
class Stage:
    """Numbers of sun, planet and ring as they are tabulated."""

    teeth: tuple[int, int, int]
    module: float
    shifts: tuple[float, float, float]
    centre: float
    tips: tuple[float, float, float]

    def gears(self) -> list[Gear]:
        found = []
        for z, x, tip, sign in zip(self.teeth, self.shifts, self.tips, (1, 1, -1), strict=True):
            short = 1 - sign * ((tip - self.module * z / 2) / self.module - x)
            found.append(Gear(z, self.module, profile_shift=x, tip_shortening=short, internal=sign < 0))
        return found

    def planet_set(self, sun_drives: bool) -> PlanetSet:
        sun, planet, ring = self.gears()
        away = not sun_drives
        return PlanetSet(Pair(sun, planet, self.centre, away), Pair(planet, ring, self.centre, away))


FIRST = Stage((19, 17, 56), 0.045, (0.617, 0.802, 0.501), 0.863, (0.489404, 0.452729, 1.237545))
SECOND = Stage((18, 36, 93), 0.021, (0.389, 0.504, -0.117), 0.584, (0.216419, 0.407834, 0.953043))
STANDARD = Stage((30, 24, 78), 0.003, (0.0, 0.0, 0.0), 0.081, (0.048, 0.039, 0.114))
STAGES = pytest.mark.parametrize("stage", [FIRST, SECOND, STANDARD], ids=["first", "second", "standard"])


def window(stage: Stage, side: int, pitch_point: float, room: Callable[[complex], float]) -> tuple[float, float]:
    """First and last angle of a tooth of the planet while its flank on one side (1: counter-clockwise) touches.

    Law of gearing alone: the normal of the flank, by differences of its points, goes through the pitch point.
    room: how far a point of contact is inside the mate's tip circle.
    """
    z, x, tip = stage.teeth[1], stage.shifts[1], stage.tips[1]
    base = stage.module * z / 2 * np.cos(ALPHA)
    half = (np.pi / 2 + 2 * x * np.tan(ALPHA)) / z + np.tan(ALPHA) - ALPHA
    step = 1e-5 * base

    def flank(radius: float) -> complex:
        a = np.arccos(base / radius)
        return radius * np.exp(1j * side * (half - np.tan(a) + a))

    def turned(radius: float) -> float:
        along, here = flank(radius + step) - flank(radius - step), flank(radius)
        opening = np.arccos(np.clip((np.conj(along) * here).real / abs(along * pitch_point), -1, 1))
        both = [np.angle(pitch_point) - np.angle(along) + sign * opening for sign in (1, -1)]
        return float(min(both, key=lambda angle: abs(here * np.exp(1j * angle) - pitch_point)))

    def inside(radius: float) -> float:
        return room(flank(radius) * np.exp(1j * turned(radius)))

    radii = np.linspace(base + 20 * step, tip, 401)
    touching = np.flatnonzero([inside(radius) >= 0 for radius in radii])
    ends = []
    for last, beyond in ((touching[0], touching[0] - 1), (touching[-1], touching[-1] + 1)):
        there = 0 <= beyond < len(radii)
        ends.append(float(brentq(inside, radii[beyond], radii[last], xtol=1e-14)) if there else float(radii[last]))
    first, last = np.unwrap([turned(radius) for radius in ends])
    return min(first, last), max(first, last)


def brute_force(stage: Stage, sun_drives: bool, turn: int) -> tuple[float, float, float]:
    """(lag of the ring's entry in mesh periods, contact ratios); turn: 1 for a planet that turns counter-clockwise.

    The planet's axis is the origin, the others' lies at -a. A sun that drives pushes the flank of the planet that goes
    behind, and the planet pushes the ring with the one in front.
    """
    a, (z_s, z_p, z_r) = stage.centre, stage.teeth
    side = -turn if sun_drives else turn
    sun = window(stage, side, -a * z_p / (z_s + z_p), lambda p: stage.tips[0] - abs(p + a))
    ring = window(stage, -side, a * z_p / (z_r - z_p), lambda p: abs(p + a) - stage.tips[2])
    entry = 0 if turn > 0 else 1
    pitch = 2 * np.pi / z_p
    return turn * (ring[entry] - sun[entry]) / pitch % 1, (sun[1] - sun[0]) / pitch, (ring[1] - ring[0]) / pitch


@STAGES
@pytest.mark.parametrize("sun_drives", [True, False])
@pytest.mark.parametrize("turn", [1, -1])
def test_the_lag_of_entries_is_that_of_turned_flanks(stage: Stage, sun_drives: bool, turn: int) -> None:
    lag, at_sun, at_ring = brute_force(stage, sun_drives, turn)
    planet = stage.planet_set(sun_drives)
    # Differences over 1e-5 base radii leave 1e-7 of a pitch.
    assert planet.entry_lag == pytest.approx(lag, abs=1e-6)
    assert (planet.sun.contact_ratio, planet.ring.contact_ratio) == pytest.approx((at_sun, at_ring), abs=1e-6)


@pytest.mark.parametrize(
    ("stage", "pitch_points", "approaches"),
    [
        (FIRST, 0.8766161469295595, (0.48836083112066186, 1.2365785867711536)),
        (SECOND, 0.4067417027749478, (0.7092255255744387, 1.6295713266929461)),
        (STANDARD, 0.5, (0.800951453748709, 1.1153743189843992)),
    ],
    ids=["first", "second", "standard"],
)  # fmt: skip
def test_tabulated_gears_have_the_lags_and_approaches_of_another_program(
    stage: Stage, pitch_points: float, approaches: tuple[float, float]
) -> None:
    """Between pitch points where the sun drives; approaches over the base pitch of NREL's, whose planets drive."""
    planet = stage.planet_set(sun_drives=True)
    assert planet.pitch_lag == pytest.approx(pitch_points, abs=1e-9)
    planet = planet if stage is STANDARD else stage.planet_set(sun_drives=False)
    for pair, approach in zip((planet.sun, planet.ring), approaches, strict=True):
        assert pair.pitch_phase == pytest.approx(approach % 1, abs=1e-9)


def test_standard_teeth_have_the_lag_of_parkers_rule_between_pitch_points_and_another_between_entries() -> None:
    planet = STANDARD.planet_set(sun_drives=True)
    assert planet.pitch_lag == 0.5
    assert planet.entry_lag == pytest.approx(0.1855771347643117, abs=1e-9)


@STAGES
def test_power_the_other_way_is_time_backwards(stage: Stage) -> None:
    """Teeth that entered leave: the lag is c_s - c_r less that of power from the sun."""
    there, back = stage.planet_set(True), stage.planet_set(False)
    turns = there.entry_lag + back.entry_lag - there.sun.contact_ratio + there.ring.contact_ratio
    assert turns == pytest.approx(round(turns), abs=1e-9)
    assert (there.pitch_lag + back.pitch_lag) % 1 == pytest.approx(0, abs=1e-9)


GIVEN = pytest.mark.parametrize("given", [{}, {"sun": 0.6}, {"planet": 0.2}, {"ring": 0.1}], ids=str)


@GIVEN
@pytest.mark.parametrize(("sun", "planet", "ring"), [(19, 17, 56), (18, 36, 93), (30, 24, 78), (40, 31, 99)])
def test_profile_shifts_close_the_backlash_of_both_meshes(
    sun: int, planet: int, ring: int, given: dict[str, float]
) -> None:
    module, teeth = 0.004, {"sun": sun, "planet": planet, "ring": ring}
    centre = halfway(module, sun, ring)
    shifts = closing_shifts(teeth, module, ALPHA, centre, given)
    assert given.items() <= shifts.items()
    gears = [Gear(teeth[b], module, profile_shift=shifts[b], addendum=0.8, internal=b == "ring") for b in BODIES]
    for pair in (Pair(gears[0], gears[1], centre), Pair(gears[1], gears[2], centre)):
        assert pair.backlash == pytest.approx(0, abs=1e-12 * module)


def test_standard_teeth_need_no_profile_shift() -> None:
    teeth = {"sun": 30, "planet": 24, "ring": 78}
    assert set(closing_shifts(teeth, 0.003, ALPHA, halfway(0.003, 30, 78), {}).values()) == {0.0}


def test_teeth_that_overlap_are_refused() -> None:
    sun, planet, ring = STANDARD.gears()
    with pytest.raises(NotPossible, match="planet and sun overlap"):
        PlanetSet(Pair(sun, planet, 0.0805), Pair(planet, ring, 0.0805))


def test_a_centre_distance_within_the_base_circles_is_refused() -> None:
    with pytest.raises(NotPossible, match="base to base"):
        closing_shifts({"sun": 19, "planet": 17, "ring": 56}, 0.045, ALPHA, 0.81, {})
