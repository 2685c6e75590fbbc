"""Why a design is good, in words: which closed-form rule of first-order theory closes or widens which region.

A mesh i drives the region of modes p, q at its harmonic s with a phasor of modulus and phase

    eps_i k_gi delta_ip delta_iq (2/s pi) sin(s pi c_i),    -s pi (c_i + 2 lag_i)

(Lin & Parker 2002, (4), (17), (18)). The phasors of meshes with one frequency add up: a harmonic that is missing,
s c_i an integer, drives nothing, and with two meshes the phase s (c_1 - c_2 + 2 h) pi decides whether they work
together or against each other (there, (21)-(23) and (30)-(34)).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from gearstab.design.judge import Goal, Judge
from gearstab.design.problem import DesignProblem
from gearstab.design.regions import WEIGHTS, step
from gearstab.modal import mean_modes, significant_deflection
from gearstab.perturbation import Tongue
from gearstab.perturbation.tongues import SELF_EXCITED
from gearstab.symmetry import can_couple, deflection_types, natural_modes, phase_step
from gearstab.system import Array, GearSystem, whirls
from gearstab.waveforms import Rectangular

TOGETHER, AGAINST = 0.9, -0.9
"""Cosines of the phase between two meshes."""
MISSING = 0.02
"""|sin s pi c| below which a harmonic counts as missing."""
MOST_LABELS = 6
HIGHEST = 3
"""Harmonic of which it is said that it is missing."""
CLOSED = 0.05
"""Part of the phasors' moduli below which their sum counts as nothing."""


@dataclass(frozen=True)
class DrivenRegion:
    """A region and the phasors (complex) of the meshes (numbers from 0) that drive it, each at its harmonic."""

    tongue: Tongue
    meshes: tuple[int, ...]
    harmonics: tuple[int, ...]
    phasors: tuple[complex, ...]

    @property
    def left(self) -> float:
        """Return the modulus of a sum over the sum of the moduli."""
        total = sum(abs(z) for z in self.phasors)
        return abs(sum(self.phasors)) / total if total else 0.0


def driven(system: GearSystem, tongues: Sequence[Tongue]) -> list[DrivenRegion]:
    """Return what drives each of the regions of a single system to first order."""
    modes = mean_modes(system)
    deflection = np.where(significant_deflection(modes), modes.mesh_deflection, 0.0)
    found = []
    for tongue in tongues:
        parts = []
        for i, mesh in enumerate(system.meshes):
            s = round(tongue.frequency_ratio / float(mesh.frequency_ratio))
            if s < 1 or abs(s * float(mesh.frequency_ratio) - tongue.frequency_ratio) > 1e-9 * s:
                continue
            a, b = mesh.waveform.fourier(s)
            strength = float(mesh.amplitude) * deflection[tongue.mode_p - 1, i] * deflection[tongue.mode_q - 1, i]
            turn = np.exp(-2j * np.pi * s * float(mesh.lag))
            parts.append((i, s, complex(strength * (float(b) - 1j * float(a)) * turn)))
        if parts:
            found.append(DrivenRegion(tongue, *(tuple(column) for column in zip(*parts, strict=True))))
    return found


def explanation(system: GearSystem, tongues: Sequence[Tongue]) -> list[str]:
    """Return sentences on the regions of a single system, given those of interest; none where modes are not real."""
    if whirls(system):
        return []
    unique = {(t.mode_p, t.mode_q, t.frequency_ratio): t for t in tongues if t.kind != SELF_EXCITED}
    known = driven(system, list(unique.values()))
    rules = (_existence, _pairs, _missing, _many)
    return list(dict.fromkeys(text for rule in rules for text in rule(system, known)))


def _listed(labels: Sequence[str]) -> str:
    """Labels for a sentence, the first ones of many."""
    unique = list(dict.fromkeys(labels))
    more = f" and {len(unique) - MOST_LABELS} more" if len(unique) > MOST_LABELS else ""
    return ", ".join(unique[:MOST_LABELS]) + more


def _missing(system: GearSystem, known: list[DrivenRegion]) -> Iterator[str]:
    """Harmonics that a contact ratio leaves out."""
    for i, mesh in enumerate(system.meshes):
        if not isinstance(mesh.waveform, Rectangular):
            continue
        ratio = float(mesh.waveform.contact_ratio)
        for s in sorted({item.harmonics[item.meshes.index(i)] for item in known if i in item.meshes}):
            if s > HIGHEST or abs(np.sin(s * np.pi * ratio)) > MISSING:
                continue
            at = [item.tongue.label for item in known if i in item.meshes and item.harmonics[item.meshes.index(i)] == s]
            times = "" if s == 1 else f"{s} "
            yield (
                f"{times}c = {s * ratio:.4g} of mesh {mesh.name} is an integer: its harmonic {s} is missing and drives "
                f"nothing of {_listed(at)}"
            )


def _pairs(system: GearSystem, known: list[DrivenRegion]) -> Iterator[str]:
    """Two meshes of one frequency with rectangular waves: the rule of c_1 - c_2 + 2 h."""
    both = [item for item in known if len(item.meshes) == 2 and min(map(abs, item.phasors)) > 0]
    groups = sorted({(item.meshes, item.harmonics) for item in both})
    for meshes, harmonics in groups:
        first, second = (system.meshes[i] for i in meshes)
        if not (isinstance(first.waveform, Rectangular) and isinstance(second.waveform, Rectangular)):
            continue
        if harmonics[0] != harmonics[1]:
            continue
        s = harmonics[0]
        lead = float(first.lag) - float(second.lag)
        ratios = float(first.waveform.contact_ratio) - float(second.waveform.contact_ratio)
        rule = ("" if s == 1 else f"{s} ") + "(c1 - c2 + 2h)" if s > 1 else "c1 - c2 + 2h"
        value = s * (ratios + 2 * lead)
        words = list(_effects([item for item in both if (item.meshes, item.harmonics) == (meshes, harmonics)]))
        if words:
            names = "" if len(system.meshes) == 2 else f" (meshes {first.name}, {second.name})"
            yield f"{rule} = {value:.4g}{names} {' and '.join(words)}"


def _effects(items: list[DrivenRegion]) -> Iterator[str]:
    """closes .., narrows .., widens .., by the phase between two meshes and how equal they are."""
    groups: dict[str, list[str]] = {"closes": [], "narrows": [], "widens": []}
    for item in items:
        one, other = item.phasors
        cosine = (one * other.conjugate()).real / (abs(one) * abs(other))
        if cosine < AGAINST:
            groups["closes" if item.left < CLOSED else "narrows"].append(item.tongue.label)
        elif cosine > TOGETHER:
            groups["widens"].append(item.tongue.label)
    for word, labels in groups.items():
        if labels:
            yield f"{word} {_listed(labels)}"


def _many(system: GearSystem, known: list[DrivenRegion]) -> Iterator[str]:
    """More meshes than two whose phasors cancel."""
    closed = [item.tongue.label for item in known if len(item.meshes) > 2 and item.left < CLOSED]
    if closed:
        yield f"the meshes of one frequency cancel each other in {_listed(closed)}"


def _existence(system: GearSystem, known: list[DrivenRegion]) -> Iterator[str]:
    """The rule of cyclic symmetry, Parker 2009, conclusion 2."""
    step = phase_step(system)
    if step is None:
        return
    order = system.symmetries[0].order
    types = deflection_types(system, natural_modes(system))
    for harmonic in sorted({item.tongue.harmonic for item in known}):
        groups: dict[tuple[int, int], bool] = {}
        for item in known:
            pair = sorted((int(types[item.tongue.mode_p - 1]), int(types[item.tongue.mode_q - 1])))
            if item.tongue.harmonic == harmonic and pair[0] >= 0:
                groups[pair[0], pair[1]] = can_couple(order, step, harmonic, *pair)
        barred = [f"T = {p} with T = {q}" for (p, q), allowed in sorted(groups.items()) if not allowed]
        if barred:
            yield (
                f"planets out of phase by z = {step} of N = {order}: harmonic {harmonic} cannot couple modes of "
                f"{', '.join(barred)} (L z +- (T_p +- T_q) is no multiple of N)"
            )


DEGRADED = 0.1
"""Part of the optimum by which the objective may grow; of the given design's objective where the optimum is 0."""
LOOKED_AT = 24
"""Designs between the optimum and a bound, of which the first that is degraded counts."""
HALVINGS = 40
DEAR_LOOKED_AT, DEAR_HALVINGS = 6, 10
"""The same where judging a design takes long."""


def allowed(optimum: float, initial: float) -> float:
    """The largest objective that counts as not degraded.

    1.1 J of an optimum J > 0 (J + 0.1 |J| of a negative one); where J = 0, a tenth of the given design's objective, and
    0 where that is 0 as well: the margin then ends where the first instability begins.
    """
    if optimum != 0:
        return optimum + DEGRADED * abs(optimum)
    return DEGRADED * max(initial, 0.0)


def margins(problem: DesignProblem, judge: Judge, goal: Goal, design: Array, most: float) -> Array:
    """``(2, variables)``, how far each variable may go down and up until the goal exceeds ``most``.

    At most as far as its bounds, of a phasing that may take every value a whole turn; whole choices of integers; NaN of
    other choices.
    """
    found = np.full((2, len(problem.variables)), np.nan)
    for v, variable in enumerate(problem.variables):
        if variable.form == "integers":
            found[:, v] = _steps(problem, judge, goal, design, most, v)
    sides = [(k, int(v)) for v in np.flatnonzero(problem.continuous) for k in (0, 1)]
    if not sides:
        return found
    start = np.array([design[v] for _, v in sides])
    turning = np.array([problem.variables[v].periodic for _, v in sides])
    ends = np.where(turning, start + [2 * k - 1 for k, _ in sides], [problem.bounds[k, v] for k, v in sides])
    looked, halvings = (DEAR_LOOKED_AT, DEAR_HALVINGS) if problem.dear else (LOOKED_AT, HALVINGS)
    part = np.linspace(0.0, 1.0, looked + 1)[1:]
    places = start[:, None] + (ends - start)[:, None] * part
    bad = _values(problem, judge, goal, design, sides, places) > most
    first = np.where(bad.any(axis=1), np.argmax(bad, axis=1), looked)
    outside = np.where(first < looked, (first + 1) / looked, np.nan)
    inside = first / looked
    for _ in range(halvings):
        middle = 0.5 * (inside + np.where(np.isnan(outside), inside, outside))
        places = (start + (ends - start) * middle)[:, None]
        wrong = _values(problem, judge, goal, design, sides, places)[:, 0] > most
        outside = np.where(np.isnan(outside) | ~wrong, outside, middle)
        inside = np.where(wrong | np.isnan(outside), inside, middle)
        if np.nanmax(np.append(outside - inside, 0.0)) < 1e-9:
            break
    for (k, v), length in zip(sides, np.abs(ends - start) * inside, strict=True):
        found[k, v] = length
    return found


def _values(
    problem: DesignProblem, judge: Judge, goal: Goal, design: Array, sides: list[tuple[int, int]], places: Array
) -> Array:
    """The goal ``(sides, K)`` with one variable at a time at places ``(sides, K)``; infinite where none is possible."""
    designs = np.repeat(design[None], places.size, axis=0)
    turning = np.array([problem.variables[v].periodic for _, v in sides])[:, None]
    low = np.array([problem.bounds[0, v] for _, v in sides])[:, None]
    within = np.where(turning, low + np.mod(places - low, 1.0), places)
    designs[np.arange(places.size), np.repeat([v for _, v in sides], places.shape[1])] = within.ravel()
    objectives = judge.worth(designs).objectives
    value = np.where(np.isnan(objectives).any(axis=1), np.inf, goal(np.nan_to_num(objectives)))
    return np.asarray(value).reshape(places.shape)


def _steps(problem: DesignProblem, judge: Judge, goal: Goal, design: Array, most: float, v: int) -> list[float]:
    """Choices that an integer may go down and up."""
    size = problem.variables[v].axis.size
    places = np.arange(size, dtype=float)
    good = _values(problem, judge, goal, design, [(0, v)], places[None])[0] <= most
    here = int(design[v])
    runs = (good[:here][::-1], good[here + 1 :])
    return [float(np.argmin(run)) if not run.all() else float(len(run)) for run in runs]


def sensitivities(problem: DesignProblem, judge: Judge, design: Array) -> Array:
    """``(objectives, variables)``, d(objective)/d(variable) by differences of the exact objective; NaN of choices.

    On a kink, where a region just closes, it is the mean of the slopes on both sides.
    """
    found = np.full((len(problem.design.objectives), len(problem.variables)), np.nan)
    moving = [int(v) for v in np.flatnonzero(problem.continuous)]
    if not moving:
        return found
    rows = [(v, k) for v in moving for k in WEIGHTS]
    designs = np.repeat(design[None], len(rows), axis=0)
    for row, (v, k) in enumerate(rows):
        designs[row, v] += k * step(problem, v)
    values = judge.worth(designs).objectives
    for row, (v, k) in enumerate(rows):
        found[:, v] = np.nan_to_num(found[:, v]) + WEIGHTS[k] * values[row] / step(problem, v)
    return found
