"""Stability of the tractor gearbox against an independent program, in every way through its mesh frequencies."""

from pathlib import Path

import numpy as np
import pytest
from gearbox_trains import CROSSCHECK, MESHES, REFERENCE, crosscheck

from gearstab.config import load
from gearstab.floquet import solve
from gearstab.floquet.frequencies import per_mesh
from gearstab.floquet.segments.pattern import prepare
from gearstab.results import open_result
from gearstab.sweep import plan, run
from gearstab.systems import build

SPEEDS = 2 * np.pi * np.array(CROSSCHECK["f_in_Hz"])
PRINTED = 5.001e-4
"""Half of the last digit of growth rates in 1/s, and rounding."""


def close(found: np.ndarray, printed: list[float]) -> None:
    """To the printed digits, of which there are two where only 0.02 or so is printed."""
    for value, number in zip(found, printed, strict=True):
        digits = len(str(number).partition(".")[2])
        assert abs(value - number) <= 0.5001 * 10**-digits, (value, number)


def test_growth_rates_of_one_mesh_alone_to_the_printed_digits() -> None:
    found = per_mesh.solve(build(crosscheck()), 14 * SPEEDS, solve)
    assert found.by_mesh is not None
    close(found.by_mesh[0, :, 0], CROSSCHECK["mesh_I_only_floquet"])


def test_growth_rates_of_two_meshes_to_the_printed_digits() -> None:
    p = crosscheck()
    for mesh in p["meshes"][2:]:
        mesh["epsilon"] = 0.0
    close(solve(build(p), 14 * SPEEDS).growth_rate[0], CROSSCHECK["mesh_I_plus_II_exact"])


def test_growth_rates_over_the_common_period_to_the_printed_digits() -> None:
    system = build(crosscheck())
    (pattern,) = prepare(system)
    # Four frequencies: two levels each.
    assert len(pattern.states) == 8493
    assert pattern.stiffness.shape[1] == 16
    found = solve(system, 14 * SPEEDS)
    close(found.growth_rate[0], CROSSCHECK["all_meshes_exact_common_period"])
    assert list(found.stable[0]) == [0, 0, 1, 1]


def test_at_the_printed_damping_the_slowest_mode_decays_last() -> None:
    p = crosscheck() | {"damping_factor": 1.0}
    found = solve(build(p), np.array([14 * 25 * 2 * np.pi]))
    assert round(float(found.growth_rate[0, 0]), 2) == -0.40
    # The mode of 32 Hz: zeta omega.
    expected = REFERENCE["modal_zeta"][1] * 2 * np.pi * REFERENCE["natural_freq_Hz_33dof"][1]
    assert float(-found.growth_rate[0, 0]) == pytest.approx(expected, rel=0.01)


def test_a_sweep_takes_the_way_that_is_asked_for(root: Path, tmp_path: Path) -> None:
    source = root / "configs/kuria_kihiu_2008/map.yaml"
    speeds = [f"{60 * f} rpm" for f in CROSSCHECK["f_in_Hz"][:2]]
    rates = {}
    for way in ("per_mesh", "common_period"):
        settings = [f"sweep={{input_speed: [{', '.join(speeds)}], damping_factor: [0.05]}}"]
        config = load(source, [*settings, f"methods={{floquet: {{frequencies: {way}}}}}"])
        out = tmp_path / f"{way}.h5"
        run(plan(config), out)
        tree = open_result(out)
        rates[way] = tree["floquet/growth_rate"].values[:, 0]
        if way == "per_mesh":
            assert list(tree["floquet/mesh"].values) == list(MESHES)
            assert tree["floquet/growth_rate_mesh"].dims == ("input_speed", "damping_factor", "mesh")
            # Two meshes of stage IV vary together.
            by_mesh = tree["floquet/growth_rate_mesh"].values
            np.testing.assert_allclose(by_mesh[..., 3], by_mesh[..., 4], rtol=1e-12)
            np.testing.assert_allclose(by_mesh.max(axis=-1), tree["floquet/growth_rate"].values, rtol=1e-12)
    # With the teeth of this program the levels differ by 3e-5, and near an edge growth rates by some hundredths.
    np.testing.assert_allclose(rates["per_mesh"][1], CROSSCHECK["mesh_I_only_floquet"][1], atol=0.02)
    np.testing.assert_allclose(rates["common_period"], CROSSCHECK["all_meshes_exact_common_period"][:2], atol=0.03)
