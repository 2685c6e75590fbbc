"""Planets of a set: their angles, whether teeth fit there, and how they enter deflections in carrier coordinates."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import islice, product
from math import floor, tau
from typing import Any

import numpy as np

from gearstab.config.document import Document, Path, mapping
from gearstab.config.model import Grid
from gearstab.config.model.conflicts import Conflict, plain_number
from gearstab.mesh import Rotation
from gearstab.system import Array
from gearstab.systems.assembly import Coordinates, Row, total

ASSEMBLE = "assemble"
"""Written in place of the angles: the nearest to equal ones that can be assembled."""
FIT = 1e-3
"""Parts of the least turn between two places of a planet by which a typed angle may be off one of them."""


def angles_of(planets: Any, given: Sequence[Any] | None) -> list[Array]:
    """Return psi_1..psi_N, any of which may have a batch shape: those given, or 2 pi (n - 1)/N of N planets."""
    if given is None:
        return [np.asarray(tau * n / int(planets)) for n in range(int(planets))]
    return [np.asarray(angle, dtype=float) for angle in given]


def nearest(sun: int, ring: int, planets: int) -> list[float]:
    """Return the angles nearest to equal ones at which the teeth of all planets fit between sun and ring.

    A planet fits at every multiple of 2 pi/(z_s + z_r) from the first one: turning sun and ring from one place of
    their teeth to the next, against each other, moves it by one such step. Halves are rounded up, which leaves planets
    of even number diametrically opposite.

    Source: Lin & Parker 2000 (J. Sound Vib. 233, 921-928), where the step is the least mesh angle.
    """
    places = sun + ring
    return [tau * floor(places * n / planets + 0.5) / places for n in range(planets)]


def misfit(sun: int, ring: int, angles: Sequence[Any]) -> tuple[int, str, str] | None:
    """Return the number, from 1, of the first planet whose teeth do not fit, message and remedy; None where all do."""
    places = sun + ring
    for n, angle in enumerate(angles, start=1):
        steps = np.asarray(angle - angles[0], dtype=float) * places / tau
        if np.any(np.abs(steps - np.rint(steps)) > FIT):
            near = 360 / places * round(float(np.ravel(steps)[0]))
            message = f"the teeth of planet {n} do not fit: angles are multiples of 360 deg/(z_s + z_r)"
            return n, message, f'give "{near:.7g} deg" from the first one, or write angles: {ASSEMBLE}'
    return None


def write_out_teeth(document: Document, raw: dict[str, Any]) -> None:
    """Write out the ring's teeth and the angles that are to be assembled, in the section as written.

    z_r = z_s + 2 z_p, as the planets' centres are at one distance from the axis.
    """
    teeth: Any = mapping(raw.get("teeth"))
    if _counts(teeth.get("sun"), teeth.get("planet")):
        ring = teeth["sun"] + 2 * teeth["planet"]
        document.fill(("system", "teeth", "ring"), ring, document.where(("system", "teeth")))
    hint = "add teeth: {sun: .., planet: ..}, or give the angles"
    numbers = teeth.get("sun"), teeth.get("ring"), raw.get("planets")
    assemble(document, ("system", "angles"), raw, numbers, hint)


def assemble(document: Document, path: Path, section: dict[str, Any], numbers: tuple[Any, Any, Any], hint: str) -> None:
    """Write out the angles of a section that are to be assembled, at a path. numbers: z_s, z_r and N, as written."""
    if section.get("angles") != ASSEMBLE:
        return
    if not _counts(*numbers):
        document.report(path, "needs_other", "needs the numbers of teeth", hint)
        del section["angles"]
    elif (numbers[0] + numbers[1]) % numbers[2]:
        document.put(path, nearest(*numbers), document.where(path))
    else:
        del section["angles"]  # equal ones, which leave the gear its symmetry


def _counts(*numbers: Any) -> bool:
    """Whether values as written are positive whole numbers."""
    return all(type(number) is int and number > 0 for number in numbers)


MOST_PLANETS = 30
MOST_SHIFTED = 6
"""Teeth of the ring beyond or below z_s + 2 z_p. Each two of them put the centre distances of standard teeth a module
apart, which profile shifts must make up for; teeth become pointed or undercut where they add up to some 3 modules."""
OF_ASSEMBLY = ("teeth", "planets", "angles")
"""Keys that decide it."""
MOST_ASSEMBLIES = 100_000
"""Points of a grid of teeth that are looked at."""


def check_assembly(document: Document, grid: Grid[Any]) -> None:
    """Report the first point of the grid, over axes of OF_ASSEMBLY, at which the gear cannot be assembled."""
    axes = [axis for axis in grid.axes if any(item.path[0] in OF_ASSEMBLY for item in axis.assignments)]
    if grid.system.teeth is None:
        return
    for places in islice(product(*(range(axis.size) for axis in axes)), MOST_ASSEMBLIES):
        at = {axis.name: np.array(k) for axis, k in zip(axes, places, strict=True)}
        p = grid.at(at)
        sun, planet, ring = int(p.teeth.sun), int(p.teeth.planet), int(p.teeth.ring)
        wrong = next(assembly(sun, planet, ring, int(p.planets), p.angles), None)
        if wrong is not None and not axes:
            path, code, message, hint = wrong
            document.report(("system", *path), code, message, hint)
        elif wrong is not None:
            values = ", ".join(f"{axis.name} = {axis.values[k]}" for axis, k in zip(axes, places, strict=True))
            hint = "tie teeth.sun, teeth.planet and teeth.ring to one axis, or let gearstab design go through them"
            numbers = f"z_s, z_p, z_r = {sun}, {planet}, {ring} with {p.planets} planets"
            said = f"cannot be assembled at {values}: {numbers}"
            document.report(("sweep", axes[0].name), "impossible", said, hint)
            return


def assembly(sun: int, planet: int, ring: int, planets: Any, angles: Sequence[Any] | None = None) -> Iterator[Conflict]:
    """Yield what keeps teeth from fitting into each other, and planets at equal or given angles between them."""
    standard = sun + 2 * planet
    if abs(ring - standard) > MOST_SHIFTED:
        message = f"is more than {MOST_SHIFTED} teeth from z_s + 2 z_p = {standard}, too many for profile shifts"
        yield ("teeth", "ring"), "inconsistent", message, f"give {standard} teeth, or a number close to it"
    elif angles is not None:
        if found := misfit(sun, ring, angles):
            yield ("angles",), "inconsistent", *found[1:]
    elif whole(planets, 3, MOST_PLANETS) and (sun + ring) % int(planets):
        possible = [str(k) for k in range(3, MOST_PLANETS + 1) if (sun + ring) % k == 0]
        remedy = f"write angles: {ASSEMBLE}, or change the teeth"
        remedy += f", or take one of planets: {', '.join(possible)}" if possible else ""
        message = f"{planets} equally spaced planets cannot be assembled: (z_s + z_r)/N = {sun + ring}/{planets}"
        yield ("teeth",), "inconsistent", f"{message} is no integer", remedy


def clear_of_each_other(sun: int, planet: int, ring: int, angles: Sequence[Any]) -> bool:
    """Whether the tips of neighbouring planets stay apart, with an addendum of one module.

    (z_s + z_r)/2 sin(gap/2) > z_p + 2, the gap between neighbours being 2 pi/N where they are equally spaced; the
    centre distance is (z_s + z_r)/4 modules.
    """
    psi = np.sort(np.array([float(angle) for angle in angles]))
    gaps = np.diff([*psi, psi[0] + 2 * np.pi])
    return bool((sun + ring) / 2 * np.sin(min(gaps) / 2) > planet + 2)


def whole(value: Any, low: int, high: int) -> bool:
    """Return whether a value as written is a whole number within limits."""
    number = plain_number(value)
    return number is not None and low <= number <= high and number.is_integer()


@dataclass(frozen=True)
class SetRows:
    """Bodies ``sun``, ``ring``, ``carrier`` and ``planet1`` to ``planetN``, whose motions are rows over coordinates.

    planets: N; angles: psi_n, any of which may have a batch shape.
    """

    planets: int
    angles: tuple[Array, ...]

    @property
    def numbers(self) -> range:
        """n = 1..N."""
        return range(1, self.planets + 1)

    def angle(self, n: int) -> Array:
        """Return psi_n."""
        return self.angles[n - 1]

    def rotation(self, body: str) -> Row:
        """Return u = r theta, counter-clockwise: r the base radius, of the carrier the centre distance."""
        raise NotImplementedError

    def shift(self, body: str, x: Any, y: Any) -> Row:
        """Return x times the first and y times the second translation of a body; a planet's are radial, tangential."""
        raise NotImplementedError

    def deflection(self, name: str, n: int, angle: Array) -> dict[str, Any]:
        """Return the deflection of the mesh of ``sun`` or ``ring`` with planet n. Source: Parker 2009, (26), (27).

        angle: the pressure angle, negative where the other flanks carry.
        """
        psi, sign = self.angle(n), 1.0 if name == "sun" else -1.0
        turned = {key: sign * value for key, value in self.rotation(f"planet{n}").items()}
        return total(
            self.rotation(name), turned,
            self.shift(name, -np.sin(psi - sign * angle), np.cos(psi - sign * angle)),
            self.shift(f"planet{n}", -sign * np.sin(angle), -np.cos(angle)),
        )  # fmt: skip

    def bearing(self, n: int) -> tuple[Row, Row]:
        """Return the radial and the tangential deflection of the bearing of planet n."""
        cosine, sine = np.cos(self.angle(n)), np.sin(self.angle(n))
        radial = total(self.shift("carrier", cosine, sine), self.shift(f"planet{n}", -1.0, 0.0))
        turning = self.rotation("carrier")
        return radial, total(self.shift("carrier", -sine, cosine), turning, self.shift(f"planet{n}", 0.0, -1.0))

    def of_frame(
        self,
        place: Coordinates,
        bodies: Mapping[str, tuple[Any, Any]],
        bearing: Any,
        ratio: Fraction | None,
        speed: Array | float = 0.0,
        waves: Sequence[tuple[Row, Row, Array, int]] = (),
        pins: bool = True,
    ) -> Rotation:
        """Return what the carrier's speed W adds in coordinates that turn with it, r Omega or held.

            G = 2 j m (y^T x - x^T y),   K = -j^2 m (x^T x + y^T y),   H = c (y^T x - x^T y)

        of a body of mass m with the damping c to the housing, j = 1, or of the deflection of a ring at rest by j waves,
        which passes the frame; and on the carrier's rotation the tension of the pins, W^2 m/(1 - W^2 m/k_p) of each
        planet, as a bearing carries the centrifugal force of the planet, which turns with the pin: without it the free
        rotation would have a stiffness. Other damping acts between bodies and the frame, so that it turns with it.

        place: coordinates. bodies: mass and damping of each body that moves. bearing: k_p, None of rigid ones.
        waves: rows x and y, mass and j of each deflection of the ring. pins: whether they carry. Source: Lin & Parker
        1999 (J. Vib. Acoust. 121, 316), without the tension; that is derived from the nonlinear carrier.
        """
        moving = [(self.shift(body, 1.0, 0.0), self.shift(body, 0.0, 1.0), *own, 1) for body, own in bodies.items()]
        moving += [(x, y, m, 0.0, j) for x, y, m, j in waves]
        mass = np.asarray(bodies["planet1"][0], dtype=float)
        drag = place.skew([(x, y, c) for x, y, _, c, _ in moving])
        return Rotation(
            speed_ratio=ratio,
            speed=speed,
            gyroscopic=place.skew([(x, y, 2 * j * np.asarray(m)) for x, y, m, _, j in moving]),
            circulatory=drag if np.any(drag) else None,
            centripetal=place.stamped([(row, -(j**2) * np.asarray(m)) for x, y, m, _, j in moving for row in (x, y)]),
            preload=place.stamped([(self.rotation("carrier"), self.planets * mass)]) if pins else None,
            softening=0.0 if bearing is None or not pins else mass / bearing,
        )  # fmt: skip


def turn_matrix(
    index: Mapping[str, int], order: int, waves: Sequence[tuple[str, str, int]], planets: Sequence[Sequence[str]]
) -> Array:
    """Return ``(n, n)``, the displacements turned by 2 pi/N: planet n takes what planet n - 1 had.

    index: number of each coordinate; those that are not named stay. order: N. waves: pairs of coordinates that turn by
    m times the angle, with m. planets: the coordinates that go round, of each kind.
    """
    turn = np.eye(len(index))
    for first, second, m in waves:
        at = [index[first], index[second]]
        cosine, sine = np.cos(m * tau / order), np.sin(m * tau / order)
        turn[np.ix_(at, at)] = [[cosine, -sine], [sine, cosine]]
    for cycle in planets:
        at = [index[name] for name in cycle]
        turn[np.ix_(at, at)] = np.roll(np.eye(order), 1, axis=0)
    return turn
