"""Rotors with the interface of ROSS, without that package: speeds of shafts, bearings with coefficients over speed."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import gearstab as gs
from gearstab.errors import NotPossible
from gearstab.floquet.general.mean import mean_motions

Array = np.ndarray
TABLE = np.array([100.0, 300.0, 500.0])
MESH = {"direction": [1, 0.5, 0, 0, 0, 0.1], "mean_stiffness": 1e7, "epsilon": 0.2, "contact_ratio": 1.6}
POLAR = 0.02


@dataclass
class Shaft:
    """A rigid disc on one bearing, of stiffness k(W) = 1e6 + 1e3 W, or constant where no speeds are given."""

    speeds: Array | None = None
    bearing_elements: list[Any] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.bearing_elements = [SimpleNamespace(frequency=self.speeds, tag="journal", n=0)]

    def M(self, speed: float) -> Array:
        return np.diag([2.0, 2.0, 2.0, 0.02, 0.02, 0.04])

    def K(self, speed: float) -> Array:
        k = 1e6 + (0.0 if self.speeds is None else 1e3 * speed)
        return np.diag([k, k, k, 2e4, 2e4, 1e4])

    def C(self, speed: float) -> Array:
        return np.diag([10.0, 10.0, 10.0, 1e-4, 1e-4, 1e-4])

    def G(self) -> Array:
        found = np.zeros((6, 6))
        found[3, 4], found[4, 3] = POLAR, -POLAR
        return found


def test_a_held_speed_is_a_rotation() -> None:
    model = gs.from_ross(Shaft(), meshes=[MESH], speed=400.0)
    ((rotation,), note) = model["rotation"], model.note
    assert (rotation["speed"], note) == (400.0, "")
    system = gs.build(model)
    turned = system.rotations[0].speed * system.rotations[0].gyroscopic
    np.testing.assert_array_equal(turned, 400.0 * Shaft().G())
    assert "rotation" not in gs.from_ross(Shaft(), meshes=[MESH])


def test_coefficients_over_speed_are_those_at_the_speed() -> None:
    model = gs.from_ross(Shaft(TABLE), meshes=[MESH], speed=200.0, speed_ratio="1/20")
    assert model.note == (
        "coefficients over speed are interpolated: journal at node 0 at 200 rad/s, and stay so at every mesh frequency"
    )
    np.testing.assert_array_equal(np.diag(model["stiffness"])[:3], 1.2e6)
    assert [str(part["speed_ratio"]) for part in model["rotation"]] == ["1/20"]
    # Forward and backward tilting: I w^2 -+ I_p W w - k = 0.
    tilt = np.sort(np.abs(np.roots([0.02, POLAR * 200.0, -2e4])))
    mine = mean_motions(gs.build(gs.from_ross(Shaft(TABLE), [MESH | {"direction": [1, 0, 0, 0, 0, 0.1]}], speed=200.0)))
    for expected in tilt:
        # Damping ratios of 1e-6.
        assert np.abs(mine.frequency[0] - expected).min() < 1e-10 * expected


@pytest.mark.parametrize("speed", [0.0, 99.0, 501.0])
def test_speeds_that_a_table_does_not_have_are_refused(speed: float) -> None:
    with pytest.raises(NotPossible, match=f"from 100 to 500 rad/s, and its shaft turns at {speed:g} rad/s"):
        gs.from_ross(Shaft(TABLE), meshes=[MESH], speed=speed)


def test_few_modes_keep_both_notes() -> None:
    found = gs.from_ross(Shaft(TABLE), meshes=[MESH], modes=4, speed=300.0).note
    assert found.startswith("4 of 6 modes are kept")
    assert found.endswith("; coefficients over speed are interpolated: journal at node 0 at 300 rad/s")
