"""Speeds of rotation in ``gearstab info``: natural frequencies at both ends of the range, self-excitation."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearstab.config import load
from gearstab.floquet import solve
from gearstab.info.configuration import describe
from gearstab.info.text import report

ROTORS = json.loads((Path(__file__).parents[1] / "data" / "rotation" / "rotors.json").read_text())
RATIO = 20
SPINNING = Path(__file__).parents[2] / "configs" / "spinning"
NEAR = 1e-4
"""Distance of a speed from an edge, of the speed, at which growth tells the side: edges are exact to 1e-7."""


def rotor(rotation: dict[str, Any], damping: float, stiffness: list[float], mass: float, speeds: Any) -> Any:
    """A rotor in two directions that turns once in RATIO mesh cycles; its mesh has no weight."""
    return load({
        "system": {
            "kind": "matrices", "mass": [[mass, 0], [0, mass]], "stiffness": np.diag(stiffness).tolist(),
            "damping": {"matrix": [[damping, 0], [0, damping]]},
            "meshes": [{"direction": [0, 1.0], "mean_stiffness": 1e-9, "epsilon": 0.3, "contact_ratio": 1.6}],
            "rotation": {k: v for k, v in ({"speed_ratio": f"1/{RATIO}"} | rotation).items() if v is not None},
        },
        "sweep": {"mesh_frequency": speeds},
        "methods": {"floquet": {}},
    })  # fmt: skip


def test_flutter_above_the_threshold_of_rotating_damping() -> None:
    own, given = ROTORS["internal_damping"], ROTORS["internal_damping"]["inputs"]
    turning = {"circulatory": [[0, given["ci"]], [-given["ci"], 0]]}
    damping = given["ce"] + given["ci"]
    facts = describe(rotor(turning, damping, [given["k"]] * 2, given["m"], [1e3, 4e4]))
    (part,) = facts["rotations"]["self_excited"]
    assert part["kind"] == "flutter"
    assert part["from"] / RATIO == pytest.approx(own["threshold_speed_rad_s"], rel=1e-9)
    assert part["to"] is None
    frequency, ratio, whirl = (facts["rotations"][key][1] for key in ("natural_frequency", "damping_ratio", "whirl"))
    # Rotating damping drives the forward motion.
    assert whirl[int(np.argmin(ratio))] == 1
    said = report(facts)
    assert f"SELF-EXCITED above {RATIO * own['threshold_speed_rad_s']:.6g} rad/s (mesh frequency): flutter" in said
    assert f"{frequency[0]:.6g}" in said


def test_divergence_between_two_critical_speeds() -> None:
    """k_x < m W^2 < k_y of a mass on a turning shaft."""
    turning = {"gyroscopic": [[0, -2.0], [2.0, 0]], "centripetal": [[-1.0, 0], [0, -1.0]]}
    facts = describe(rotor(turning, 0.0, [1.0, 4.0], 1.0, [2.0, 70.0]))
    (part,) = facts["rotations"]["self_excited"]
    assert part["kind"] == "divergence"
    np.testing.assert_allclose([part["from"], part["to"]], [RATIO * 1.0, RATIO * 2.0], rtol=1e-6)
    assert "SELF-EXCITED from 20 to 40 rad/s (mesh frequency): divergence" in report(facts)


def test_a_held_speed_has_the_motions_of_its_own() -> None:
    turning = {"speed_ratio": None, "speed": 3.0, "gyroscopic": [[0, -2.0], [2.0, 0]]}
    facts = describe(rotor(turning, 0.0, [1.0, 4.0], 1.0, [2.0, 70.0]))
    assert facts["rotations"] is None
    # w^4 - (k_x + k_y + 4 W^2) w^2 + k_x k_y = 0
    expected = np.sqrt(np.sort(np.roots([1.0, -(5.0 + 36.0), 4.0])))
    np.testing.assert_allclose(facts["mean_system"].frequency, expected, rtol=1e-8)
    assert "held rotations" in report(facts)


def test_dangerous_speeds_of_a_rotor_are_those_at_which_vibration_grows() -> None:
    config = load(SPINNING / "rotor.yaml")
    facts, system = describe(config), config.system.build()
    found, (first, last) = facts["dangerous"].judged, facts["frequency_range"]
    ends = np.array([region.boundary_frequency for region in found.open])
    assert "2w6" in {region.label for region in found.open}
    assert found.number_open > len(found.open) >= 10
    growth = solve(system, (ends[..., None] * [1 - NEAR, 1 + NEAR]).ravel()).growth_rate[0].reshape((*ends.shape, 2))
    within = (ends > first) & (ends < last)
    assert (growth[:, 0, 1][within[:, 0]] > 0).all()
    assert (growth[:, 0, 0][within[:, 0]] <= 0).all()
    assert (growth[:, 1, 0][within[:, 1]] > 0).all()
    assert (growth[:, 1, 1][within[:, 1]] <= 0).all()
    # The two regions that are not listed are narrower than all others.
    omega = np.linspace(first, last, 20001)
    grows = solve(system, omega).growth_rate[0] > 0
    inside = ((omega >= ends[:, :1]) & (omega <= ends[:, 1:])).any(axis=0)
    assert not (inside & ~grows)[np.abs(omega - ends.reshape(-1, 1)).min(axis=0) > NEAR * omega].any()
    assert (grows & ~inside).mean() < 2 * np.diff(ends, axis=1).min() / (last - first)
    assert "go by real modes" in report(facts)
