"""The teeth of a sun, its planets and a ring: geometry, bodies, stiffness of the meshes and the lag between them.

Sun and planets are discs of the pitch radius, the ring an annulus from its pitch circle to 1.2 root radii. Of centre
distance and profile shifts, what is not given is chosen such that the meshes have no backlash.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import cos
from typing import Any

import numpy as np

from gearstab.config.model.reading import held
from gearstab.errors import NotPossible
from gearstab.gears.pair import PlanetSet, closing_shifts, halfway
from gearstab.system import Array
from gearstab.systems.gearbox import bodies
from gearstab.systems.gearbox.bodies import STEEL
from gearstab.systems.gearbox.teeth import MeshTeeth, entries_of
from gearstab.systems.kinematics import TrainError
from gearstab.systems.planetary.parts import RULES, SENSES, Inertias, Masses, Phases, PressureAngles, Turning, lags

BODIES = ("sun", "planet", "ring")
HANDS = {"sun": "right", "planet": "left", "ring": "left"}
"""One of two ways in which helical gears of a set mesh."""
CUT = ("module", "pressure_angle", "helix_angle", "addendum", "profile_shift", "tip_radius")
"""Numbers of a gear on which profile shifts and tips depend."""


@dataclass(frozen=True)
class SetTeeth:
    """The teeth of one set.

    gears: parameters of ``sun``, ``planet`` and ``ring``; meshes: of both kinds of meshes, ``sun`` and ``ring``;
    material: of all gears; centre_distance: m, None where it follows; force: returns that of a mesh, N, where it is
    known. Numbers may have a batch shape.
    """

    gears: dict[str, dict[str, Any]]
    meshes: Mapping[str, Any]
    material: dict[str, Any]
    centre_distance: Any = None
    force: Callable[[], Array] | None = None

    @cached_property
    def _cut(self) -> dict[tuple[str, str], Array]:
        """Centre distance, profile shifts and tip shortenings, by body and key."""
        table = {(b, key): g[key] for b, g in self.gears.items() for key in CUT if g.get(key) is not None}
        if self.centre_distance is not None:
            table["", "centre_distance"] = self.centre_distance
        shape, entries = entries_of(table)
        cuts = [self._one(numbers) for numbers in entries]
        return {key: np.reshape([cut[key] for cut in cuts], shape) for key in cuts[0]}

    def _one(self, numbers: dict[tuple[str, str], float]) -> dict[tuple[str, str], float]:
        """Shifts and tips of one entry of the batch."""
        counts = {body: int(self.gears[body]["teeth"]) for body in BODIES}
        module, alpha = numbers["sun", "module"], numbers["sun", "pressure_angle"]
        beta = abs(numbers.get(("sun", "helix_angle"), 0.0))
        transverse = module / cos(beta)
        given = {body: numbers[body, "profile_shift"] for body in BODIES if (body, "profile_shift") in numbers}
        centre = numbers.get(("", "centre_distance"))
        if centre is None and {"sun", "planet"} <= given.keys():
            cut = {"module": module, "pressure_angle": alpha, "helix_angle": beta}
            first, second = (
                self.gears[b] | cut | {"profile_shift": given[b], "hand": HANDS[b]} for b in ("sun", "planet")
            )
            centre = MeshTeeth((first, second), None, STEEL).pairs[0].centre
        elif centre is None:
            centre = halfway(transverse, counts["sun"], counts["ring"])
        shifts = closing_shifts(counts, module, alpha, centre, given, beta)
        moved = (centre - transverse * (counts["sun"] + counts["planet"]) / 2) / module
        shortening = max(round(shifts["sun"] + shifts["planet"] - moved, 12), 0.0)
        found = {("", "centre_distance"): centre}
        for body in BODIES:
            found[body, "profile_shift"] = shifts[body]
            found[body, "tip_shortening"] = 0.0 if body == "ring" else shortening
            if (tip := numbers.get((body, "tip_radius"))) is not None:
                above = (tip - transverse * counts[body] / 2) / module - shifts[body]
                above *= -1 if body == "ring" else 1
                found[body, "tip_shortening"] = numbers.get((body, "addendum"), 1.0) - above
        return found

    @property
    def centre(self) -> Array:
        """Centre distance, m."""
        return self._cut["", "centre_distance"]

    @cached_property
    def cut(self) -> dict[str, dict[str, Any]]:
        """The gears with profile shifts and shortened tips."""
        return {
            body: gear | {key: self._cut[body, key] for key in ("profile_shift", "tip_shortening")}
            for body, gear in self.gears.items()
        }

    @cached_property
    def pairs(self) -> dict[str, MeshTeeth]:
        """The teeth of the meshes of both kinds: ``sun`` and planet, planet and ``ring``."""
        found = {}
        for name, first, second in (("sun", "sun", "planet"), ("ring", "planet", "ring")):
            p = self.meshes[name].model_copy(update={"centre_distance": self.centre})
            found[name] = MeshTeeth((self.cut[first], self.cut[second]), p, self.material, self.force)
        return found

    def filled(self, name: str) -> Any:
        """Return the parameters of the ``sun`` or the ``ring`` meshes, with what the teeth give. Raises TrainError."""
        try:
            return self.pairs[name].filled()
        except TrainError:
            raise
        except NotPossible as error:
            remedy = f"{error.remedy or 'change the teeth'}, or mean_stiffness and epsilon"
            raise TrainError(("meshes", name), error.message, remedy) from None

    def body(self, name: str) -> tuple[Array, Array]:
        """Return mass and moment of inertia of the sun, a planet or the ring."""
        gear = self.cut[name]
        if name == "ring" and gear.get("body_radius") is None:
            gear = gear | {
                "body_radius": self.pairs["ring"].each(lambda pair: pair.wheel.bore),
                "bore_radius": self.pairs["ring"].each(lambda pair: pair.wheel.radius),
            }
        density = self.material["density"]
        return bodies.mass(gear, density), bodies.inertia(gear, density)

    def lag(self, rule: str, sun_drives: bool) -> Array:
        """Return gamma_sr, by which a planet's mesh with the ring lags the one with the sun, in mesh periods.

        Raises NotPossible where teeth overlap.
        """
        sun, ring = self.pairs["sun"], self.pairs["ring"]
        batch = np.broadcast_shapes(sun.batch, ring.batch)
        number = [np.broadcast_to(np.arange(len(m.pairs)).reshape(m.batch), batch).ravel() for m in (sun, ring)]
        found = []
        for i, j in zip(*number, strict=True):
            two = (replace(pair, wheel_drives=not sun_drives) for pair in (sun.pairs[i], ring.pairs[j]))
            planet = PlanetSet(*two)
            found.append(planet.pitch_lag if rule == "pitch_point" else planet.entry_lag)
        return np.reshape(found, batch)


def with_teeth(p: Any) -> Any:
    """Return the parameters of a planetary gear with what its teeth give, in place of ``gears``. Raises TrainError."""
    if p.gears is None:
        return p
    counts, tips, shifts = p.teeth, held(p.teeth.tip_radius), held(p.teeth.profile_shift)
    gears = {
        body: held(p.gears) | {"teeth": counts[body], "internal": body == "ring", "hand": hand,
                            "tip_radius": tips.get(body), "profile_shift": shifts.get(body)}
        for body, hand in HANDS.items()
    }  # fmt: skip
    found = SetTeeth(gears, dict(p.meshes), STEEL, counts.centre_distance)
    moving, phases = Turning.of(p, counts.sun, counts.ring), held(p.phases)
    try:
        solids = {name: found.body(name) for name in BODIES}
        angles = {name: mesh.each(lambda pair: pair.pressure_angle) for name, mesh in found.pairs.items()}
        if phases.get("sun_ring") is None and moving is not None:
            phases["rule"] = phases.get("rule") or "entry"
            phases["sun_ring"] = found.lag(phases["rule"], moving.sun_drives)
    except NotPossible as error:
        raise TrainError(("gears",), error.message, error.remedy or "change the teeth") from None
    inertias = {name: inertia / bodies.base_radius(gears[name]) ** 2 for name, (_, inertia) in solids.items()}
    # Under a clockwise torque on the sun the other flanks carry.
    flank = 1 if moving is None else moving.torque
    shifts = {body: gear["profile_shift"] for body, gear in found.cut.items()}
    masses = {name: mass for name, (mass, _) in solids.items()}
    pressure_angles = {name: flank * angle for name, angle in angles.items()}
    update = {
        "gears": None,
        "masses": Masses.model_construct(**masses | held(p.masses)),
        "inertias": Inertias.model_construct(**inertias | held(p.inertias)),
        "pressure_angles": PressureAngles.model_construct(**pressure_angles | held(p.pressure_angles)),
        "meshes": p.meshes.model_copy(update={name: found.filled(name) for name in ("sun", "ring")}),
        "teeth": counts.model_copy(update={"centre_distance": found.centre, "profile_shift": shifts}),
        "phases": Phases.model_construct(**phases),
    }
    return p.model_copy(update=update)


def shifted(teeth: Any) -> int:
    """Teeth of the ring beyond z_s + 2 z_p."""
    return int(teeth.ring - teeth.sun - 2 * teeth.planet)


def listed(teeth: Any) -> str:
    """Numbers of teeth, and the geometry that gears were computed with."""
    extra = shifted(teeth)
    said = f"sun {teeth.sun}, planet {teeth.planet}, ring {teeth.ring} = z_s + 2 z_p" + (
        f" {'+' if extra > 0 else '-'} {abs(extra)}" if extra else ""
    )
    if teeth.centre_distance is not None:
        said += f"; centre distance {teeth.centre_distance:.6g} m"
    if shifts := held(teeth.profile_shift):
        said += ", profile shifts " + ", ".join(f"{body} {value:.4g}" for body, value in shifts.items())
    return said


def phasing_of(p: Any) -> str:
    """How planets turn, and by which rule the ring's meshes lag the sun's."""
    phases, moving = p.phases or Phases(), Turning.of(p, int(p.teeth.sun), int(p.teeth.ring))
    rule = phases.rule or ("as given" if phases.sun_ring is not None else "pitch_point")
    lag = float(lags(p, 1)["ring"][0])
    said = f"the ring's mesh lags the sun's by {lag:.6g}, {RULES.get(rule, rule)}"
    if moving is None:
        return said
    driver = "sun" if moving.sun_drives else "planet"
    way = SENSES[moving.planets_turn < 0]
    return f"{said}; planets turn {way} on the carrier, the {driver} drives in the sun's meshes"
