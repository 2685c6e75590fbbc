"""A mode of a planetary gear as a picture: sun, carrier, planets and ring displaced over where they rest.

Coordinates go by name (``sun_x``, ``carrier_rotation``, ``planet2_radial``, ``ring_c3``, ...), see
:mod:`gearstab.systems.planetary`. Those that a model does not have are zero, but for planets without coordinates of
their centre, which go with the carrier. Radii are those of a drawing: the model has none, its rotations are
displacements at the base circle.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.lines import Line2D

from gearstab.plots.drawing.style import CASES

Array = np.ndarray

LARGEST = 0.16
"""The largest displacement of any point as a part of the ring's radius."""
REST: dict[str, Any] = {"color": "#9a9a9a", "linewidth": 0.5, "linestyle": (0, (3, 2)), "zorder": 1}
COLOURS = {"ring": CASES[0], "carrier": CASES[4], "sun": CASES[1], "planets": CASES[2]}
NAMED = {"ring": "ring", "carrier": "carrier", "sun": "sun", "planets": "planet"}
SUN_AND_PLANET = (0.4, 0.3)
"""Radii over that of the ring, for few planets."""
MARKS = 24
"""Short marks across the ring."""
ROOM = 0.42
"""Planets take no more than this of the distance between their centres."""
STILL = 1e-9
"""A mesh deflection below this part of the root of the sum of its squares over all modes is a rounding error."""


@dataclass(frozen=True)
class GearPositions:
    """Where the bodies rest: ring of radius 1 at the origin, planets at the angles psi_n, ``(N,)``."""

    angles: Array
    sun: float
    planet: float

    @property
    def planets(self) -> int:
        """N."""
        return len(self.angles)

    @property
    def orbit(self) -> float:
        """Radius on which the planets' centres lie."""
        return 1 - self.planet


@dataclass(frozen=True)
class Displaced:
    """The displacements of one mode, exaggerated for drawing.

    centres: (x, y) of ``sun``, ``carrier``, ``planet1``, ... from where each rests; turns: angle of each, in radians.
    ring: ``(2, points)``, points of the deflected ring; ring_turn: angle of its rigid rotation.
    """

    centres: Mapping[str, Array]
    turns: Mapping[str, float]
    ring: Array
    ring_turn: float


def is_planetary(modes: xr.Dataset) -> bool:
    """Whether the coordinates are those of a planetary gear."""
    return "dof" in modes.coords and {"sun_rotation", "planet1_rotation"} <= set(modes["dof"].values.astype(str))


def layout_of(names: list[str], angles: Array | None = None) -> GearPositions:
    """The drawing for as many planets as the coordinates name, which shrink where there are many.

    angles: psi_n; equal ones, 2 pi (n - 1)/N, without.
    """
    planets = max(int(match[1]) for match in map(re.compile(r"planet(\d+)_").match, names) if match)
    psi = 2 * np.pi * np.arange(planets) / planets if angles is None else np.asarray(angles)
    gap = np.diff([*np.sort(psi), psi.min() + 2 * np.pi]).min()
    half = ROOM * 2 * np.sin(gap / 2)  # of the orbit's radius
    planet = min(SUN_AND_PLANET[1], half / (1 + half))
    return GearPositions(psi, 1 - 2 * planet if planet < SUN_AND_PLANET[1] else SUN_AND_PLANET[0], planet)


def ring_shape(entries: Mapping[str, float], angle: Array) -> tuple[Array, Array]:
    """Tangential and radial elastic deflection of the ring at ``angle``.

        v = sum_m c_m cos m theta + s_m sin m theta,   w = -dv/dtheta

    w outward; inextensible. Source: Parker 2009, below Table of symbols, and (28).
    """
    v, w = np.zeros_like(angle), np.zeros_like(angle)
    for name, value in entries.items():
        match = re.fullmatch(r"ring_([cs])(\d+)", name)
        if not match:
            continue
        m = int(match[2])
        if match[1] == "c":
            v, w = v + value * np.cos(m * angle), w + value * m * np.sin(m * angle)
        else:
            v, w = v + value * np.sin(m * angle), w - value * m * np.cos(m * angle)
    return v, w


def planet_centre(entries: Mapping[str, float], n: int, psi: float) -> tuple[float, float]:
    """Radial and tangential displacement of a planet's centre; with the carrier where it has none of its own."""
    if f"planet{n}_tangential" in entries or f"planet{n}_radial" in entries:
        return entries.get(f"planet{n}_radial", 0.0), entries.get(f"planet{n}_tangential", 0.0)
    x, y, u = (entries.get(f"carrier_{c}", 0.0) for c in ("x", "y", "rotation"))
    return x * np.cos(psi) + y * np.sin(psi), -x * np.sin(psi) + y * np.cos(psi) + u


def displaced(layout: GearPositions, entries: Mapping[str, float], angle: Array) -> Displaced:
    """The bodies of a mode, scaled so that none of their points moves further than ``LARGEST``.

    entries: by name of the coordinate. angle: where the ring's points rest.
    """
    radii = {"sun": layout.sun, "carrier": layout.orbit}
    centres = {body: np.array([entries.get(f"{body}_{c}", 0.0) for c in "xy"]) for body in radii}
    for n, psi in enumerate(layout.angles, start=1):
        radial, tangential = planet_centre(entries, n, psi)
        c, s = np.cos(psi), np.sin(psi)
        centres[f"planet{n}"] = np.array([radial * c - tangential * s, radial * s + tangential * c])
        radii[f"planet{n}"] = layout.planet
    rims = {body: entries.get(f"{body}_rotation", 0.0) for body in radii}
    turn = entries.get("ring_rotation", 0.0)
    v, w = ring_shape(entries, angle)
    shift = np.array([entries.get("ring_x", 0.0), entries.get("ring_y", 0.0)])
    c, s = np.cos(angle), np.sin(angle)
    moved = np.hypot(w + shift[0] * c + shift[1] * s, v + turn - shift[0] * s + shift[1] * c)
    largest = max(float(moved.max()), *(float(np.hypot(*centres[body])) + abs(rims[body]) for body in radii))
    scale = LARGEST / largest if largest > 0 else 0.0
    radius, at = 1 + scale * w, angle + scale * (v + turn)
    ring = radius * np.array([np.cos(at), np.sin(at)]) + scale * shift[:, None]
    turns = {body: scale * rims[body] / radii[body] for body in radii}
    return Displaced({body: scale * centre for body, centre in centres.items()}, turns, ring, scale * turn)


def circle(centre: Array, radius: float, angle: Array) -> Array:
    """``(2, points)``."""
    return np.asarray(centre)[:, None] + radius * np.array([np.cos(angle), np.sin(angle)])


def draw_gear(ax: Axes, rest: Array, radius: float, moved: Array, turn: float, colour: str, mark: float) -> Line2D:
    """A disc over its rest outline, with the radius that pointed to the angle ``mark`` before it turned."""
    angle = np.linspace(0, 2 * np.pi, 91)
    ax.plot(*circle(rest, radius, angle), **REST)
    ax.plot(*np.transpose([rest, circle(rest, radius, np.array([mark]))[:, 0]]), **REST)
    outline = circle(rest + moved, radius, angle + turn)
    ax.fill(*outline, facecolor=to_rgba(colour, 0.13), edgecolor="none", zorder=2)
    (line,) = ax.plot(*outline, color=colour, linewidth=0.9, zorder=3)
    tip = circle(rest + moved, radius, np.array([mark + turn]))[:, 0]
    ax.plot(*np.transpose([rest + moved, tip]), color=colour, linewidth=0.9, zorder=3)
    ax.plot(*(rest + moved), "o", color=colour, markersize=1.6, zorder=3)
    return line


def draw_carrier(ax: Axes, layout: GearPositions, found: Displaced) -> Line2D:
    """Arms from the carrier's centre to the planets' pins, at rest and displaced."""
    rest = circle(np.zeros(2), layout.orbit, layout.angles)
    moved = circle(found.centres["carrier"], layout.orbit, layout.angles + found.turns["carrier"])
    lines = []
    for pins, centre, look in (
        (rest, np.zeros(2), REST),
        (moved, found.centres["carrier"], {"color": COLOURS["carrier"], "linewidth": 1.0, "zorder": 2.5}),
    ):
        arms = np.full((2, 3 * layout.planets), np.nan)
        arms[:, 0::3], arms[:, 1::3] = np.asarray(centre)[:, None], pins
        lines += ax.plot(*arms, **look)
    ax.plot(*moved, "s", color=COLOURS["carrier"], markersize=2.2, zorder=3.5)
    return lines[1]


def draw_ring(ax: Axes, angle: Array, found: Displaced) -> Line2D:
    """The ring's pitch circle deflected, with short marks across it that turn with it."""
    ax.plot(np.cos(angle), np.sin(angle), **REST)
    ax.fill(*found.ring, facecolor=to_rgba(COLOURS["ring"], 0.04), edgecolor="none", zorder=0.5)
    (line,) = ax.plot(*found.ring, color=COLOURS["ring"], linewidth=1.3, zorder=3)
    step = (angle.size - 1) // MARKS
    rest = np.array([np.cos(angle), np.sin(angle)])
    for points, look in ((rest, {**REST, "linestyle": "-"}), (found.ring, {"color": COLOURS["ring"], "zorder": 3})):
        every = points[:, :-1:step]
        ends = np.full((2, 3 * MARKS), np.nan)
        ends[:, 0::3], ends[:, 1::3] = every, every * 1.055
        ax.plot(*ends, **{"linewidth": 0.7, **look})
    return line


def mesh_deflection(modes: xr.Dataset) -> Array:
    """``(mode, mesh)``, with rounding errors of the eigenvectors as zero."""
    values = modes["mesh_deflection"].transpose("mode", "mesh").values
    return np.where(np.abs(values) > STILL * np.sqrt(np.sum(values**2, axis=0)), values, 0.0)


def draw_meshes(ax: Axes, layout: GearPositions, modes: xr.Dataset, p: int) -> dict[str, Any]:
    """A dot at each mesh whose area goes with its deflection: full where positive, open where negative."""
    names, values = modes["mesh"].values.astype(str), mesh_deflection(modes)[p]
    largest = np.abs(values).max()
    dots = {}
    for name, value in zip(names, values, strict=True):
        match = re.fullmatch(r"(sun|ring)[_ ]?(\d+)", name)
        if not match or value == 0:
            continue
        radius = layout.sun if match[1] == "sun" else 1.0
        at = circle(np.zeros(2), radius, layout.angles[[int(match[2]) - 1]])[:, 0]
        size = 5.5 * np.sqrt(abs(value) / largest)
        face = "#6b3fa0" if value > 0 else "white"
        dots[name] = ax.plot(
            *at, "o", markersize=size, markerfacecolor=face, markeredgecolor="#6b3fa0", markeredgewidth=0.7, zorder=4
        )[0]
    return dots


def draw_mode(ax: Axes, modes: xr.Dataset, p: int) -> dict[str, Any]:
    """The picture of mode p (from 0): lines of ``ring``, ``carrier``, ``sun``, ``planets`` and dots of ``meshes``."""
    names = [str(name) for name in modes["dof"].values]
    layout, angle = layout_of(names, modes.attrs.get("planet_angles")), np.linspace(0, 2 * np.pi, 361)
    entries = dict(zip(names, map(float, modes["mode_shape"].values[p]), strict=True))
    found = displaced(layout, entries, angle)
    artists: dict[str, Any] = {"ring": draw_ring(ax, angle, found), "carrier": draw_carrier(ax, layout, found)}
    artists["sun"] = draw_gear(
        ax, np.zeros(2), layout.sun, found.centres["sun"], found.turns["sun"], COLOURS["sun"], np.pi / 2
    )
    rests = circle(np.zeros(2), layout.orbit, layout.angles).T
    artists["planets"] = [
        draw_gear(
            ax, rest, layout.planet, found.centres[f"planet{n}"], found.turns[f"planet{n}"], COLOURS["planets"],
            layout.angles[n - 1] + np.pi / 2,
        )
        for n, rest in enumerate(rests, start=1)
    ]  # fmt: skip
    artists["meshes"] = draw_meshes(ax, layout, modes, p)
    ax.set_aspect("equal")
    ax.set(xlim=(-1.21, 1.21), ylim=(-1.21, 1.21))
    ax.set_axis_off()
    return artists


def legend(picture: Mapping[str, Any]) -> list[Line2D]:
    """Legend of the colours and dots of a picture."""
    lines = [Line2D([], [], color=COLOURS[body], linewidth=1.2, label=NAMED[body]) for body in COLOURS]
    dot: dict[str, Any] = {"marker": "o", "linestyle": "none", "markeredgecolor": "#6b3fa0", "markeredgewidth": 0.7}
    return [
        *lines,
        Line2D([], [], **{k: v for k, v in REST.items() if k != "zorder"}, label="at rest"),
        Line2D([], [], **dot, markerfacecolor="#6b3fa0", markersize=4.5, label="mesh deflection > 0"),
        Line2D([], [], **dot, markerfacecolor="white", markersize=4.5, label="mesh deflection < 0"),
    ]
