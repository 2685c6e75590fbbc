"""Numbers that are no mistakes, and hardly what was meant: a unit forgotten, an axis written as a list of its ends.

What is found is said in one line each, and changes nothing else.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from gearstab.config.configuration import Config
from gearstab.config.document import Document, Path, Problem, scalars, sequence, texts, value_at
from gearstab.config.model import MESH_FREQUENCY
from gearstab.config.model.reading import quantity, type_at
from gearstab.config.model.units import to_si
from gearstab.config.sections import INPUT_SPEED
from gearstab.system import GearSystem

if TYPE_CHECKING:
    from gearstab.systems.gearbox.train import Train

TURBINE = 1e10
"""Largest plausible mass or inertia: ten times the rotor of a wind turbine of 20 MW (kg m^2)."""
USUAL: dict[tuple[str, str], tuple[float, float, str]] = {
    ("module", "m"): (2e-5, 0.2, "mm"),
    ("face_width", "m"): (1e-4, 3.0, "mm"),
    ("centre_distance", "m"): (1e-3, 20.0, "mm"),
    ("body_radius", "m"): (1e-4, 10.0, "mm"),
    ("bore_radius", "m"): (0.0, 10.0, "mm"),
    ("radii", "m"): (1e-4, 10.0, "mm"),
    ("diameter", "m"): (1e-4, 5.0, "mm"),
    ("bore", "m"): (0.0, 5.0, "mm"),
    ("length", "m"): (1e-4, 50.0, "mm"),
    ("backlash", "m"): (0.0, 0.01, "um"),
    ("transmission_error", "m"): (0.0, 1e-3, "um"),
    ("stiffness_per_width", "N/m^2"): (1e8, 1e12, "N/(mm um)"),
    ("roughness", "m"): (0.0, 1e-4, "um"),
    ("inertia", "kg m^2"): (1e-10, TURBINE, "kg mm^2"),
    ("inertias", "kg m^2"): (1e-10, TURBINE, "kg mm^2"),
    ("inertias", "kg"): (1e-7, TURBINE, "g"),
    ("mass", "kg"): (1e-7, TURBINE, "g"),
    ("masses", "kg"): (1e-7, TURBINE, "g"),
    ("equivalent_mass", "kg"): (1e-7, TURBINE, "g"),
    ("speed", "rad/s"): (0.0, 4e3, "rpm"),
    (INPUT_SPEED, "rad/s"): (0.0, 4e3, "rpm"),
    ("mesh_frequency", "rad/s"): (0.0, 1e6, "rpm"),
    ("young", "Pa"): (1e8, 2e12, "GPa"),
    ("shear", "Pa"): (1e7, 1e12, "GPa"),
    ("density", "kg/m^3"): (1e2, 3e4, "g/cm^3"),
    ("viscosity", "Pa s"): (1e-5, 10.0, "mPa s"),
    ("position", "rad"): (0.0, 2 * math.pi + 1e-9, "deg"),
    ("damping_ratio", "1"): (0.0, 2.0, "%"),
}
"""Key and unit of a number -> the least and greatest magnitude that gears have, and the unit that was likely meant."""

ALWAYS = ("1", "rad")
"""Units of numbers that models without units have as well."""
SOFTEST = 1e5
"""N/m, and N m/rad over a square metre: models whose meshes are all softer are taken to have units of their own."""
SOFTEST_TORSION = 10.0
"""N m/rad."""
FASTEST = 250.0
"""m/s: pitch line velocities of the fastest turbo gears."""
ROTARY = re.compile(r"[0-9.]\s*(rpm|rps|revolutions?_per_\w+)\s*\Z")
MOST_COMPARED = 1_000_000
"""Values of an axis that are compared."""
LARGEST_PHASE = 1e14
"""Radians; of larger ones double precision does not hold a hundredth."""
OUT_OF_PROPORTION = 1e3
"""Ratio of an inertia or mass to that of a disc as large as the gear."""


def doubts(document: Document, config: Config, system: GearSystem) -> list[Problem]:
    """Return the doubtful entries of a valid configuration. system: that of the base values."""
    found = [*_axes(document, config)]
    for path, message, hint in config.system.doubts():
        found.append(document.problem(("system", *path), "unusual", message, hint))
    known = {*ALWAYS} if not _in_si(config, system) else None
    found += _numbers(document, config, known)
    if known is None and not found and (train := config.system.train()) is not None:
        found += _gears(document, config, train)
    return list(dict.fromkeys(found))


def _in_si(config: Config, system: GearSystem) -> bool:
    """Whether the numbers of a model are in SI units, told from stiffnesses that only they have, or from a unit."""
    if "length" in system.dimensionless:
        return False
    least = SOFTEST_TORSION if system.deflection_unit == "rad" else SOFTEST
    stiff = any(np.max(np.abs(mesh.mean_stiffness)) >= least for mesh in system.meshes)
    return stiff or config.system.needs_units


# ---- numbers


def _numbers(document: Document, config: Config, units: set[str] | None) -> Iterator[Problem]:
    """Numbers of the system, of its axes and of ``respond`` far outside of what gears have.

    units: those of the numbers that are looked at, None for all.
    """
    model = type(config.system)
    swept = {item.path for axis in config.axes for item in axis.assignments}
    turning = config.system.turning()
    for path, value in scalars(config.system):
        kind = quantity(type_at(model, path))
        if kind is None or value is None or path in swept:
            continue
        key, unit = _key(path), kind.unit
        if len(path) == 3 and path[0] == "mass":
            if path[1] != path[2]:  # what couples two coordinates may be as small as rounding leaves it
                continue
            key, unit = ("inertia", "kg m^2") if turning and turning[int(path[1])] else (key, unit)
        place: Path = ("system", *path)
        yield from _unusual(document, place, key, unit, value, value, units)
    for axis in config.axes:
        for item in axis.assignments:
            if item.structural:
                continue
            kind = quantity(type_at(model, item.path))
            key = INPUT_SPEED if axis.name == INPUT_SPEED else _key(item.path)
            unit = "rad/s" if item.path == MESH_FREQUENCY else "" if kind is None else kind.unit
            ends = np.abs(item.values) / item.factor
            yield from _unusual(document, ("sweep", axis.name), key, unit, ends.min(), ends.max(), units)
            if item.path == MESH_FREQUENCY and axis.name != INPUT_SPEED:
                yield from _shaft_speed(document, ("sweep", axis.name))
    if config.respond is not None:
        key = config.respond.frequency_key
        value = getattr(config.respond, key)
        yield from _unusual(document, ("respond", key), key, "rad/s", value, value, units)
        yield from _shaft_speed(document, ("respond", "mesh_frequency"))


def _unusual(
    document: Document, place: Path, key: str, unit: str, low: float, high: float, units: set[str] | None
) -> Iterator[Problem]:
    """A doubt where magnitudes from low to high leave what is usual for a key."""
    if (key, unit) not in USUAL or (units is not None and unit not in units):
        return
    least, most, likely = USUAL[key, unit]
    wrong = [value for value in (abs(high), abs(low)) if value > most or 0 < value < least]
    if not wrong:
        return
    value, given = float(wrong[0]), document.get(place)
    shown = "" if unit == "1" else f" {unit}"
    shown += f" ({value * 30 / math.pi:,.0f} rpm)" if unit == "rad/s" else ""
    hint = _meant(value, unit, likely, (least, most))
    if any(text.strip()[:1] in "+-.0123456789" for _, text in texts(given)):
        hint = "check the unit"
    message = f"{value:.6g}{shown} is far from what gears have"
    yield document.problem(place, "unusual", message, hint, value=None if isinstance(given, dict | list) else given)


def _meant(value: float, unit: str, likely: str, usual: tuple[float, float]) -> str:
    """Return the likely meaning of a plain number."""
    units = () if unit == "1" else (unit,)
    said = f"plain numbers are {'ratios' if unit == '1' else f'in {unit}'}"
    fits = usual[0] <= to_si(f"{value!r} {likely}", units) <= usual[1]
    return f'{said}: was "{value:.6g} {likely}" meant?' if fits else said


def _shaft_speed(document: Document, place: Path) -> Iterator[Problem]:
    """Yield a doubt if a mesh frequency is given in revolutions: it is the number of teeth times that."""
    if any(ROTARY.search(text) for _, text in texts(document.get(place))):
        message = "is in revolutions, and a mesh frequency counts teeth"
        remedy = "multiply the speed by the number of teeth, or give input_speed, where teeth are known"
        yield document.problem(place, "revolutions", message, remedy)


def _key(path: Path) -> str:
    """The name that says what a number is: of the transmission error, or the last one."""
    names = [part for part in path if isinstance(part, str)]
    if "transmission_error" in names:
        return "transmission_error"
    return "masses" if names[0] == "masses" else "inertias" if names[0] == "inertias" else names[-1]


# ---- gears


def _gears(document: Document, config: Config, train: Train) -> Iterator[Problem]:
    """Gears of a gearbox whose inertia or mass does not fit their size, and gears that turn too fast for it."""
    from gearstab.systems.gearbox.bodies import pitch_radius

    fastest = _fastest(config, train)
    for k, rotor in enumerate(train.rotors):
        if rotor.get("teeth") is None:
            continue
        radius = float(pitch_radius(rotor))
        body = float(rotor.get("body_radius") or radius)
        disc = math.pi * body**2 * float(rotor.get("face_width") or 10 * rotor["module"]) * train.material["density"]
        for key, usual, unit, likely in (
            ("inertia", disc * body**2 / 2, "kg m^2", "kg mm^2"),
            ("mass", disc, "kg", "g"),
        ):
            value = value_at(config.system, ("rotors", k, key))
            if value is not None and not 1 / OUT_OF_PROPORTION < value / usual < OUT_OF_PROPORTION:
                place: Path = ("system", "rotors", k, key)
                message = f"is {value / usual:.2g} times that of a disc of its size, {usual:.2g} {unit}"
                hint = _meant(value, unit, likely, (usual / OUT_OF_PROPORTION, usual * OUT_OF_PROPORTION))
                yield document.problem(place, "unusual", message, hint, value=document.get(place))
        if fastest is None:
            continue
        place, speed = fastest
        velocity = speed * float(abs(train.speeds[train.name(k)])) * radius
        if velocity > FASTEST:
            message = f"the teeth of {rotor['name']} run at {velocity:,.0f} m/s at {speed:.6g} rad/s of the input"
            yield document.problem(
                place, "unusual", message, f'plain numbers are in rad/s: was "{speed:.6g} rpm" meant?'
            )
            fastest = None


def _fastest(config: Config, train: Any) -> tuple[Path, float] | None:
    """Return the place of the highest speed of the input, and the speed (rad/s)."""
    found: list[tuple[float, Path]] = []
    cycles = float(train.cycles)
    for axis in config.axes:
        if axis.mesh_frequency:
            found.append((float(np.max(axis.mesh_frequency.values)) / cycles, ("sweep", axis.name)))
    speed = value_at(config.system, ("input", "speed"))
    if speed is not None:
        found.append((float(speed), ("system", "input", "speed")))
    if not found:
        return None
    highest, place = max(found)
    return place, highest


# ---- axes


def _axes(document: Document, config: Config) -> Iterator[Problem]:
    """Axes with equal values, and lists that look like start, stop and number of values."""
    for axis in config.axes:
        place: Path = ("sweep", axis.name)
        values = axis.values if isinstance(axis.values, list) else list(map(float, axis.values[:MOST_COMPARED]))
        if len(set(values)) < len(values):
            again = next(value for k, value in enumerate(values) if value in values[:k])
            shown = f"{again:.6g}" if isinstance(again, float) else again
            message = f"has the value {shown} more than once, and points of equal value cannot be told apart"
            yield document.problem(place, "equal_values", message, "give each value once")
        yield from _ends_and_number(document, place)


def _ends_and_number(document: Document, place: Path) -> Iterator[Problem]:
    given = sequence(document.get(place))
    plain = len(given) == 3 and all(type(value) in (int, float) for value in given)
    if not plain:
        return
    start, stop, count = given
    number = float(count).is_integer() and count >= 3
    apart = abs(count - stop) > 10 * abs(stop - start) if (stop - start) * (count - stop) > 0 else start != stop
    if number and apart and count not in (start, stop):
        message = f"has three values, the last of which, {count:g}, looks like a number of values"
        remedy = f"for a range write {{start: {start:g}, stop: {stop:g}, num: {count:g}}}"
        yield document.problem(place, "looks_like_range", message, remedy, value=given)


def check(document: Document, config: Config) -> list[Problem]:
    """Report what cannot exist anywhere on the grid, or at the base values where a response asks for them.

    Returns what can, and is hardly what was meant.
    """
    config.system.check_feasible(document, config)
    document.stop()
    system = config.system.build()
    _check_phases(document, config, system)
    document.stop()
    uncertain = [] if config.uncertainties is None else config.uncertainties.doubts(document, config)
    return doubts(document, config, system) + uncertain


def _check_phases(document: Document, config: Config, system: GearSystem) -> None:
    """Mesh frequencies so low that phase and decay of a vibration after a period are beyond double precision."""
    if not system.commensurate:
        return
    found = [(("sweep", axis.name), float(np.min(m.values))) for axis in config.axes if (m := axis.mesh_frequency)]
    if config.respond is not None:
        key = config.respond.frequency_key
        found.append((("respond", key), float(getattr(config.respond, key))))
    factor = np.linalg.inv(np.linalg.cholesky(system.mass))
    elastic = np.abs(np.linalg.eigvalsh(factor @ system.mean_stiffness_matrix() @ factor.T))
    viscous = np.abs(np.linalg.eigvals(factor @ system.damping_matrix @ factor.T))
    fastest = float(max(np.sqrt(elastic.max()), viscous.max()))
    lowest = 2 * np.pi * float(system.common_period()[0]) * fastest / LARGEST_PHASE
    for path, frequency in found:
        if frequency < lowest:
            message = (
                f"is too low for double precision at {frequency:.6g}: the fastest vibration or decay, at the rate "
                f"{fastest:.6g}, does not stand out from rounding over a period"
            )
            document.report(path, "impossible", message, f"choose mesh frequencies above {lowest:.2g}")
