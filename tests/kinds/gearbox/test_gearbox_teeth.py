"""Loads and root stresses of single teeth in steady states: by hand, in result files and in figures."""

from __future__ import annotations

import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gearbox_trains import CROSSCHECK, MESHES, REFERENCE, crosscheck
from scenes import scene_text, succeeds, written

from gearstab.config import load
from gearstab.errors import PlotError
from gearstab.floquet import frequencies, solve
from gearstab.floquet.segments.pattern import prepare
from gearstab.gears.geometry import Gear
from gearstab.gears.mesh_stiffness import StiffnessModel
from gearstab.gears.pair import Pair
from gearstab.gears.stress import mesh_root_stress, root_stress
from gearstab.plots import draw
from gearstab.response import loads as measure
from gearstab.response.loads import LoadedTeeth, positions, tooth_loads
from gearstab.results import open_result
from gearstab.sweep import plan, run
from gearstab.systems import build

PAIR = Pair(Gear(19, 2e-3, face_width=0.02), Gear(48, 2e-3, face_width=0.02))
RING = Pair(Gear(19, 2e-3, face_width=0.02), Gear(60, 2e-3, face_width=0.02, internal=True), wheel_drives=True)
PLAIN, MEASURED = StiffnessModel(), StiffnessModel(single_pair_stiffness=2e8)

CONFIG = scene_text("gearbox_teeth")


@pytest.mark.parametrize(("pair", "model"), [(PAIR, PLAIN), (RING, MEASURED)])
def test_under_a_constant_mesh_force_the_load_is_the_static_one(pair: Pair, model: StiffnessModel) -> None:
    phase = np.arange(0, 3, 1 / 1000) + 5e-4
    found = tooth_loads(LoadedTeeth(pair, model, ("a", "b")), phase, np.full(len(phase), 500.0), 500.0)
    inner = np.abs(found.static_load[1:-1] - 0.5 * (found.static_load[2:] + found.static_load[:-2])) < 5
    # A part of the contact has the largest value in it, not that in its middle; jumps aside.
    np.testing.assert_allclose(found.load[1:-1][inner], found.static_load[1:-1][inner], rtol=0.01)
    assert found.load.max() == pytest.approx(500.0 / np.floor(pair.contact_ratio), rel=1e-12)
    # At the pitch point one pair carries, or several equally.
    x = np.arange(0, 1, 1e-3)
    stresses = mesh_root_stress(pair, x, 500.0, model)
    for side, stress in enumerate(stresses):
        if np.all(np.isnan(stress)):
            assert np.all(np.isnan(found.static_stress[:, side]))
            continue
        assert found.static_stress[:, side].max() == pytest.approx(stress.max(), rel=0.03)


def test_the_largest_of_many_engagements_counts() -> None:
    phase = np.arange(0, 6, 1 / 400) + 1e-3
    force = np.where(phase < 3, 500.0, 800.0)
    found = tooth_loads(LoadedTeeth(PAIR, PLAIN, ("a", "b")), phase, force, 500.0)
    np.testing.assert_allclose(found.load.max(), 800.0, rtol=1e-12)
    ratio = found.stress[:, 0] / found.load
    # Stress over load at a point is a property of the teeth: of the pinion it grows towards its tip.
    s = PAIR.path[0] + positions(100) * PAIR.contact_ratio * PAIR.base_pitch
    expected = root_stress(PAIR.pinion, s / PAIR.pinion.base_radius, 1.0, 0.02)
    np.testing.assert_allclose(ratio, expected, rtol=1e-9)
    assert np.all(np.diff(ratio[10:]) > 0)
    assert np.all(np.diff(found.stress[:-10, 1] / found.load[:-10]) < 0)


def test_a_ring_that_drives_begins_contact_at_the_tip_of_its_pinion() -> None:
    phase = np.arange(0, 3, 1 / 1000)
    found = tooth_loads(LoadedTeeth(RING, MEASURED, ("ring", "pinion")), phase, np.full(len(phase), 500.0), 500.0)
    assert LoadedTeeth(RING, MEASURED, ("ring", "pinion")).in_order == ("pinion", "ring")
    per_load = found.static_stress[:, 0] / found.static_load
    assert np.all(np.diff(per_load[:-20]) < 0)


@pytest.fixture(scope="module")
def response(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("teeth")
    (folder / "case.yaml").write_text(CONFIG)
    succeeds("respond", folder / "case.yaml", "-o", folder / "case.h5")
    return open_result(folder / "case.h5")


def test_a_steady_state_of_a_gearbox_has_the_loads_of_its_teeth(response: Any) -> None:
    data = response["response"].to_dataset()
    assert data.sizes["contact"] == 100
    assert list(data["flank"].values) == ["pinion, mesh m", "gear, mesh m"]
    assert data.sizes["time"] == 126
    static = float(data["static_mesh_force"][0])
    assert static == pytest.approx(100 / (48e-3 * np.cos(np.radians(20))), rel=1e-9)
    # Loads come from the whole period, of which half is stored.
    assert np.isfinite(data["tooth_load"].values).all()
    assert float(data["tooth_load"].max()) > 1.02 * static
    assert float(data["static_tooth_load"].max()) == pytest.approx(static, rel=1e-9)
    np.testing.assert_allclose(data["peak_root_stress"].values, data["root_stress"].max("contact").values)
    assert data["root_stress"].attrs["units"] == "Pa"


def test_figures_of_teeth(response: Any) -> None:
    figure, artists = draw(response, "teeth")
    assert len(artists["lines"]) == len(artists["static"]) == 1
    loads = response["response"]["tooth_load"].values[:, 0]
    np.testing.assert_array_equal(artists["lines"][0].get_ydata(), loads)
    assert figure.axes[0].get_title() == "mesh m"
    _, artists = draw(response, "teeth", variable="root_stress")
    assert len(artists["lines"]) == 2
    np.testing.assert_allclose(
        artists["lines"][1].get_ydata(), 1e-6 * response["response"]["root_stress"].values[:, 1], rtol=1e-12
    )
    with pytest.raises(PlotError, match="there is tooth_load"):
        draw(response, "teeth", variable="energy")


def test_stored_cycles_belong_to_steady_states(tmp_path: Path) -> None:
    path = written(tmp_path, CONFIG.replace("steady_state: true", "cycles: 3"))
    with pytest.raises(ValueError, match="belongs to a steady state"):
        load(path)


def test_a_long_history_is_shared_out_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Loads are the same; the integrals over the teeth of all samples at once would take 200 MB."""
    phase = np.linspace(0.0, 97.3, 30_000)
    force, teeth = 500.0 + 50.0 * np.sin(phase), LoadedTeeth(PAIR, PLAIN, ("a", "b"))
    tracemalloc.start()
    found = tooth_loads(teeth, phase, force, 500.0)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 50e6
    monkeypatch.setattr(measure, "AT_ONCE", len(phase))
    whole = tooth_loads(teeth, phase, force, 500.0)
    np.testing.assert_array_equal(found.load, whole.load)
    np.testing.assert_array_equal(found.stress, whole.stress)


# --- stability of the tractor gearbox against an independent program, in every way through its mesh frequencies


SPEEDS = 2 * np.pi * np.array(CROSSCHECK["f_in_Hz"])
PRINTED = 5.001e-4
"""Half of the last digit of growth rates in 1/s, and rounding."""


def close(found: np.ndarray, printed: list[float]) -> None:
    """To the printed digits, of which there are two where only 0.02 or so is printed."""
    for value, number in zip(found, printed, strict=True):
        digits = len(str(number).partition(".")[2])
        assert abs(value - number) <= 0.5001 * 10**-digits, (value, number)


def test_growth_rates_of_one_mesh_alone_to_the_printed_digits() -> None:
    found = frequencies.solve(build(crosscheck()), 14 * SPEEDS, solve)
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
