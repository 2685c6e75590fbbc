"""Laws of any valid configuration, from the document to the growth rates, whatever its numbers are."""

from __future__ import annotations

import copy
import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_documents import Document, gear_pairs, matrices, two_stages

from gearstab.config import load
from gearstab.floquet import FloquetStability, solve
from gearstab.systems import build

FREQUENCIES = np.array([0.37, 0.83, 1.19, 1.94, 3.1])
NEAR = 1e-4
"""Error of growth per common period: multipliers are within 1e-9, and a double one moves by the square root of that."""
MASS, RATE = 3.0, 7.0
"""New units: numbers of masses are so many times as large, and those of rates."""


def solved(system: Document, folder: Path, factor: float = 1.0) -> tuple[FloquetStability, np.ndarray]:
    """The solution at ``factor`` times the frequencies, and the common periods there."""
    path = folder / "random.yaml"
    path.write_text(json.dumps({"system": system}))
    built = build(load(path).system)
    frequencies = FREQUENCIES * factor
    return solve(built, frequencies), 2 * np.pi * float(built.common_period()[0]) / frequencies


def alike(found: FloquetStability, other: FloquetStability, period: np.ndarray, rate: float = 1.0) -> None:
    """Both tell the same, where the growth rates of the other are ``rate`` times as large."""
    growth, again = found.growth_rate * period, other.growth_rate / rate * period
    np.testing.assert_allclose(again, growth, atol=NEAR, rtol=1e-6)
    clear = np.abs(growth) > 10 * NEAR
    np.testing.assert_array_equal(other.stable[clear], found.stable[clear])


def commensurate(system: Document) -> bool:
    return all(mesh.get("exact", True) for mesh in system["meshes"])


def at_rest(system: Document, folder: Path) -> None:
    """Meshes whose stiffness does not vary leave a system with springs and dampers stable."""
    system = copy.deepcopy(system)
    for mesh in system["meshes"]:
        mesh["epsilon"] = 0.0
    found, period = solved(system, folder)
    np.testing.assert_array_equal(found.stable, 1)
    assert np.all(found.growth_rate * period < NEAR)


def permuted(system: Document, folder: Path) -> None:
    """The order of meshes is of no account; that of the first one sets which frequency is the reference."""
    found, period = solved(system, folder)
    first, second = copy.deepcopy(system["meshes"])
    ratio = Fraction(second.pop("frequency_ratio"))
    first["frequency_ratio"] = str(1 / ratio)
    other, _ = solved({**system, "meshes": [second, first]}, folder, float(ratio))
    alike(found, other, period)


def scaled(system: Document, folder: Path) -> None:
    """Other units of mass and time."""
    found, period = solved(system, folder)
    stiffness, damping = MASS * RATE**2, MASS * RATE
    factors = {"mass": MASS, "equivalent_mass": MASS, "inertias": MASS, "stiffness": stiffness}
    factors["input_shaft_stiffness"] = stiffness
    other = {key: times(value, factors.get(key)) for key, value in system.items()}
    other["meshes"] = [
        {**mesh, "mean_stiffness": mesh["mean_stiffness"] * stiffness, "damping": mesh.get("damping", 0.0) * damping}
        for mesh in system["meshes"]
    ]
    given = system.get("damping", {})
    if "matrix" in given:
        other["damping"] = {"matrix": times(given["matrix"], damping)}
    if "rayleigh" in given:
        other["damping"] = {"rayleigh": [given["rayleigh"][0] * RATE, given["rayleigh"][1] / RATE]}
    again, _ = solved(other, folder, RATE)
    alike(found, again, period, RATE)


def times(value: Any, factor: float | None) -> Any:
    """A number, or all numbers in lists, times a factor."""
    if factor is None:
        return copy.deepcopy(value)
    return [times(item, factor) for item in value] if isinstance(value, list) else value * factor


SYSTEMS = (gear_pairs() | two_stages() | matrices()).filter(commensurate)
PASSIVE = SYSTEMS.filter(lambda system: "matrix" not in system.get("damping", {}))
"""Damping matrices may drive a system."""
TWO_MESHES = matrices().filter(lambda system: commensurate(system) and len(system["meshes"]) == 2)
INVARIANTS = [(at_rest, PASSIVE), (permuted, TWO_MESHES), (scaled, SYSTEMS)]
NAMES = [invariant.__name__ for invariant, _ in INVARIANTS]


@pytest.mark.parametrize(("invariant", "systems"), INVARIANTS, ids=NAMES)
@settings(max_examples=15)
@given(data=st.data())
def test_some_systems(invariant: Any, systems: Any, data: Any, tmp_path_factory: pytest.TempPathFactory) -> None:
    invariant(data.draw(systems), tmp_path_factory.mktemp("random"))


@pytest.mark.slow
@pytest.mark.parametrize(("invariant", "systems"), INVARIANTS, ids=NAMES)
@settings(max_examples=500)
@given(data=st.data())
def test_many_systems(invariant: Any, systems: Any, data: Any, tmp_path_factory: pytest.TempPathFactory) -> None:
    invariant(data.draw(systems), tmp_path_factory.mktemp("random"))
