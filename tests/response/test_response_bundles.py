"""Intervals taken together give what they give one by one, for any number of rows, with either kernel."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

import gearstab as gs
from gearstab.propagation import bundles
from gearstab.propagation.segment import States
from gearstab.response.periodic import harmonics
from gearstab.response.speeds import speed_response
from gearstab.system import Array

TRAIN = {
    "kind": "two_stage", "units": "none", "inertias": [1.0, 0.3, 4.0], "input_shaft_stiffness": 0.5,
    "damping_ratio": 0.05, "load": [0.0, 0.0, 1.0], "tooth_ratio": "7/11",
    "meshes": [
        {"name": "first", "mean_stiffness": 1.0, "epsilon": 0.3, "contact_ratio": 1.5,
         "transmission_error": {"sin": [0.1, 0.02], "cos": [0.0, 0.05]}},
        {"name": "second", "mean_stiffness": 1.0, "epsilon": 0.2, "contact_ratio": 1.6, "phasing": 0.25},
    ],
}  # fmt: skip
OMEGA = np.array([0.7, 1.9, 2.0, 5.0])
TOGETHER = 1e-11
"""Difference of sums over the same period in another order."""


def _close(one: Array, other: Array) -> None:
    np.testing.assert_allclose(one, other, rtol=TOGETHER, atol=TOGETHER * np.nanmax(np.abs(other)))


def _one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(States, "eigen", None)


@pytest.mark.parametrize("entries", [1, 500, 10**6])
def test_intervals_together_are_those_one_by_one(monkeypatch: pytest.MonkeyPatch, entries: int) -> None:
    system = gs.build({"system": TRAIN}, epsilon=np.array([0.1, 0.2, 0.3]))
    monkeypatch.setattr(bundles, "ENTRIES", entries)
    together = speed_response(system, OMEGA, samples_per_cycle=30)
    _one_by_one(monkeypatch)
    alone = speed_response(system, OMEGA, samples_per_cycle=30)
    assert np.isfinite(together.mesh_force_peak).all()
    for name in (field.name for field in fields(alone) if field.name != "connections"):
        _close(getattr(together, name), getattr(alone, name))


def test_harmonics_of_intervals_together(monkeypatch: pytest.MonkeyPatch) -> None:
    system = gs.build({"system": TRAIN})
    together = harmonics(system, 1.9, order=30)
    _one_by_one(monkeypatch)
    alone = harmonics(system, 1.9, order=30)
    _close(together.mesh_force, alone.mesh_force)
    _close(together.mesh_deflection, alone.mesh_deflection)


def test_states_without_eigenvectors_are_taken_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Eigenvectors of critical damping are parallel."""
    system = gs.build({"system": TRAIN})
    expected = speed_response(system, OMEGA)
    monkeypatch.setattr(States, "each", property(lambda states: [None] * len(states.generators)))
    _close(speed_response(system, OMEGA).mesh_force_rms, expected.mesh_force_rms)
