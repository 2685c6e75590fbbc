"""Gear pairs given by their gears, as a user meets them: configuration, respond, sweep."""

from math import pi, tau
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from energy_pair_reference import REFERENCE, W0
from scenes import opened, plain, ran, refused, scene_text, succeeds

from gearstab.config import load
from gearstab.config.document import ConfigError
from gearstab.floquet import solve
from gearstab.response.rotating_pair import STATUS, InitialState, respond
from gearstab.response.rotating_pair.stability import stability
from gearstab.results import open_result
from gearstab.systems import build

SYSTEM = scene_text("energy_pair_command_system")
RESPOND = scene_text("energy_pair_command_respond")
SWEEP = scene_text("energy_pair_command_sweep")


def written(folder: Path, text: str) -> Path:
    path = folder / "pair.yaml"
    path.write_text(text)
    return path


def answered(folder: Path, *settings: str) -> xr.DataTree:
    """The result of ``respond`` with changed values."""
    out = folder / "out.h5"
    sets = [part for text in settings for part in ("--set", text)]
    succeeds("respond", written(folder, SYSTEM + RESPOND), "-o", out, *sets)
    return opened(out)


def problems(folder: Path, text: str, *settings: str) -> dict[str, str]:
    with pytest.raises(ConfigError) as caught:
        load(written(folder, text), settings)
    return {p.path: f"{p.message}; {p.hint}" for p in caught.value.problems}


def test_the_file_holds_the_response(tmp_path: Path) -> None:
    found = answered(tmp_path)["response"]
    system = build(load(tmp_path / "pair.yaml").system)
    step = tau / (24 * 600 * pi / 30) / 50
    expected = respond(system, InitialState(24 * 600 * pi / 30, 0.01472027972), step, cycles=12)
    for name in ("time", "phi", "phi_dot", "theta", "theta_dot", "energy"):
        np.testing.assert_array_equal(found[name].values, getattr(expected, name))
        assert found[name].dims == ("time",)
    for name in ("phi", "phi_dot", "theta", "theta_dot", "time", "energy"):
        np.testing.assert_array_equal(found[f"section_{name}"].values, getattr(expected.sections, name))
        assert found[f"section_{name}"].dims == ("cycle",)
    assert found["cycle"].values.tolist() == list(range(1, 13))
    assert found.sizes["event"] == 24
    np.testing.assert_array_equal(found["event_phi"].values, expected.events.phi)
    assert found["event_pairs_after"].values.tolist() == [2, 1] * 12
    assert int(found["status"]) == 0
    assert found.attrs["status"] == "complete"
    assert found["status"].attrs["flag_meanings"].split() == list(STATUS)
    assert list(found["status"].attrs["flag_masks"]) == list(STATUS.values())
    for name, data in found.data_vars.items():
        assert data.attrs["units"], name
        assert data.attrs["long_name"], name


def test_the_spectrum_is_over_the_damped_natural_frequency(tmp_path: Path) -> None:
    found = answered(tmp_path, "respond.spectrum.peaks=3", "respond.spectrum.discard=2")["response"]
    unit = found.attrs["damped_natural_frequency"]
    # (16).
    assert unit == pytest.approx(14929.031330706157 * np.sqrt(1 - 0.01), rel=1e-12)
    np.testing.assert_allclose(found["normalised_frequency"].values, found["frequency"].values / unit)
    step = float(found["time"][1])
    kept = found["phi"].values[100:-1]
    assert found["frequency"].values[-1] == pytest.approx(pi / step, rel=0.02)
    assert found.sizes["frequency"] == len(kept) // 2 + 1
    heights = found["peak_power_spectral_density"].values
    assert len(heights) == 3
    assert np.all(np.diff(heights) <= 0)
    # The largest peak is at the mesh frequency, which falls with the speed.
    assert 0.9 < found["peak_frequency"].values[0] / found.attrs["mesh_frequency"] <= 1.0 + 1 / 12


@pytest.mark.parametrize("zeta", [1.0, 1.5])
def test_without_a_damped_frequency_there_are_no_normalised_ones(tmp_path: Path, zeta: float) -> None:
    found = answered(tmp_path, f"damping_ratio={zeta}", "respond.spectrum.peaks=3")["response"]
    assert np.all(np.isnan(found["normalised_frequency"].values))
    assert np.all(np.isfinite(found["frequency"].values))
    assert "; from the damping ratio 1 on there is no w_d, and" in found.attrs["comment"]


def test_a_response_until_the_gears_stall(tmp_path: Path) -> None:
    text = SYSTEM + 'respond: {speed: "60 rpm", until: stalled}\n'
    out = tmp_path / "out.h5"
    done = succeeds("respond", written(tmp_path, text), "-o", out)
    assert "stalled" in done.stderr
    with open_result(out) as tree:
        found = tree["response"]
        assert int(found["status"]) & STATUS["stalled"]
        assert found.attrs["stall_time"] == found.attrs["end_time"]


def test_gears_that_wander_are_given_up(tmp_path: Path) -> None:
    """Without damping, too slow to get past the change of stiffness for good: they turn back and forth."""
    respond = 'respond: {speed: "600 rpm", cycles: 100, samples_per_cycle: 50}\n'
    path = written(tmp_path, SYSTEM.replace("damping_ratio: 0.1", "damping_ratio: 0") + respond)
    done = succeeds("respond", path, "-o", tmp_path / "out.h5")
    found = opened(tmp_path / "out.h5")["response"]
    advance = (found["theta"].values[-1] - found["theta"].values[0]) / tau
    assert {"time_limit", "unpredictable"} <= set(found.attrs["status"].split(", "))
    # Ten times 100 cycles at 600 rpm of 24 teeth.
    assert found.attrs["end_time"] == pytest.approx(10 * 100 / 240, rel=1e-12)
    # To within the last sample, a fiftieth of a cycle at the initial speed, and no more than that fast now.
    assert found.attrs["mesh_cycles"] == pytest.approx(advance, abs=0.1)
    assert f"stopped after {found.attrs['mesh_cycles']:.4g} mesh cycles of the 100 asked for" in done.stderr
    assert found.sizes["time"] <= 10 * 100 * 50 + 1


def test_forces_are_in_newtons_where_lengths_are_known(tmp_path: Path) -> None:
    without = answered(tmp_path)["response"]["mesh_force"]
    known = answered(tmp_path, 'system.module="6.35 mm"')["response"]["mesh_force"]
    assert (without.attrs["units"], known.attrs["units"]) == ("N m", "N")
    np.testing.assert_allclose(known.values, without.values / 3.175e-3, rtol=1e-13)


def test_contact_ratio_and_angle_say_the_same(tmp_path: Path) -> None:
    ratio = 2 - 1.73 / tau
    text = (SYSTEM + RESPOND).replace("single_contact_angle: 1.73", f"contact_ratio: {ratio!r}")
    system = build(load(written(tmp_path, text)).system)
    assert system.numbers.single == pytest.approx(1.73, rel=1e-14)


def test_the_classical_formulation_is_hills_equation(tmp_path: Path) -> None:
    """Its growth rates are those of the same equation written as matrices."""
    pair = build(load(written(tmp_path, SYSTEM + RESPOND), ["system.formulation=classical"]).system)
    m2, w0 = 105879.3237402404, 14929.031330706157
    part = 1.73 / tau
    mean = part * 1430 + (1 - part) * 2780
    text = f"""
system:
  kind: matrices
  mass: [[{1 / m2!r}]]
  stiffness: [[0.0]]
  damping: [[{2 * 0.1 * w0 / m2!r}]]
  meshes:
    - {{direction: [1.0], mean_stiffness: {mean!r}, amplitude: 675.0, contact_ratio: {2 - part!r}, lag: {part!r}}}
sweep: {{mesh_frequency: [1.0]}}
methods: {{floquet: {{}}}}
"""
    other = build(load(written(tmp_path, text)).system)
    omega = np.linspace(10000.0, 36000.0, 14)
    np.testing.assert_allclose(
        solve(pair, omega).growth_rate, solve(other, omega).growth_rate, rtol=1e-9, atol=1e-8 * w0
    )
    assert pair.load.tolist() == [21.05]


def test_a_sweep_puts_the_formulations_side_by_side(tmp_path: Path) -> None:
    path, out = written(tmp_path, SYSTEM + SWEEP), tmp_path / "map.h5"
    succeeds("sweep", path, "-o", out, "-j", "1", "-q")
    parameters = plain(load(path).system)
    found = opened(out)["floquet"].to_dataset()
    assert found["formulation"].values.tolist() == ["energy_conserving", "classical", "rigid_kinematic"]
    omega = found["mesh_frequency"].values
    for formulation in ("energy_conserving", "rigid_kinematic"):
        for i, torque in enumerate(found["torque"].values):
            one = stability(build(parameters | {"formulation": formulation, "torque": torque}), omega)
            part = found.sel(formulation=formulation).isel(torque=i)
            np.testing.assert_allclose(part["growth_rate"].values, one.growth_rate[0], rtol=1e-9, atol=1e-6)
            np.testing.assert_array_equal(part["status"].values, one.status[0])
            np.testing.assert_allclose(part["exponent_real"].values, one.exponents[0].real, rtol=1e-9, atol=1e-6)
            np.testing.assert_allclose(part["holding_torque"].values, one.drive[0] * 2105, rtol=1e-9, atol=1e-12)
    hill = solve(build(parameters | {"formulation": "classical"}), omega)
    classical = found.sel(formulation="classical")
    for i in range(3):
        np.testing.assert_allclose(classical["growth_rate"].values[i], hill.growth_rate[0], rtol=1e-12)
    assert np.isnan(classical["speed_exponent"].values).all()
    assert {"no_periodic_orbit", "speed_unstable"} < set(found["status"].attrs["flag_meanings"].split())
    assert found["speed_exponent"].attrs["units"] == "1/s"


def test_the_contact_ratio_can_be_an_axis(tmp_path: Path) -> None:
    text = SYSTEM.replace("  single_contact_angle: 1.73\n", "") + (
        "sweep:\n  contact_ratio: [1.3, 1.7]\n  mesh_frequency: [30000.0, 32000.0]\nmethods:\n  floquet: {}\n"
    )
    out = tmp_path / "map.h5"
    succeeds("sweep", written(tmp_path, text), "-o", out, "-j", "1", "-q")
    with open_result(out) as tree:
        assert tree["floquet"]["growth_rate"].shape == (2, 2)


@pytest.mark.parametrize("method", ["perturbation", "boundaries", "uncoupled"])
def test_other_methods_take_the_classical_formulation(tmp_path: Path, method: str) -> None:
    sweep = f"sweep: {{mesh_frequency: {{start: 20000, stop: 36000, num: 5}}}}\nmethods: {{{method}: {{}}}}\n"
    classical = written(tmp_path, SYSTEM.replace("energy_conserving", "classical") + sweep)
    succeeds("sweep", classical, "-o", tmp_path / "o.h5", "-q")


def test_a_pair_of_gears_needs_its_numbers_for_other_formulations(tmp_path: Path) -> None:
    text = """
system:
  kind: gear_pair
  formulation: rigid_kinematic
  equivalent_mass: 1.0
  meshes: [{mean_stiffness: 1, epsilon: 0.1, contact_ratio: 1.5}]
"""
    found = problems(tmp_path, text)
    assert {"system.teeth", "system.inertias", "system.torque", "system.equivalent_mass"} < set(found)


def test_too_many_samples_are_refused(tmp_path: Path) -> None:
    out = tmp_path / "o.h5"
    assert "respond.cycles: 5e+08 samples would make a file of 32 GB, more than 1.3 GB" in refused(
        "respond", written(tmp_path, SYSTEM + RESPOND), "-o", out, "--set", "respond.cycles=1e7"
    )
    assert not out.exists()


def test_the_simple_pair_keeps_working(tmp_path: Path) -> None:
    text = """
system:
  kind: gear_pair
  formulation: classical
  equivalent_mass: 1.0
  meshes: [{mean_stiffness: 1, epsilon: 0.1, contact_ratio: 1.5}]
respond: {mesh_frequency: 1.0, cycles: 3, initial: {displacement: [0.1]}}
"""
    out = tmp_path / "o.h5"
    succeeds("respond", written(tmp_path, text), "-o", out)
    with open_result(out) as tree:
        assert "displacement" in tree["response"]


def test_info_says_whose_modes_and_tongues_it_shows(tmp_path: Path) -> None:
    path = written(tmp_path, SYSTEM + RESPOND)
    succeeds("check", path)
    done = succeeds("info", path)
    assert "energy_conserving; modes and tongues below are those of the classical one" in done.stdout
    assert "formulation" not in ran("info", path, "--set", "formulation=classical").stdout


def test_a_benchmark_knows_the_classical_formulation_only(tmp_path: Path) -> None:
    sweep = "sweep: {mesh_frequency: {start: 20000, stop: 36000, num: 5}}\nmethods: {floquet: {}}\n"
    assert "system.formulation" in refused("bench", written(tmp_path, SYSTEM + sweep), "-o", tmp_path / "b.h5")


def test_a_held_speed_gives_the_lines_of_the_reference(tmp_path: Path) -> None:
    """Whole periods of the orbit without a window: line n of phi at n times the mean mesh frequency."""
    (case,) = [c for c in REFERENCE["lines"] if c["omega_over_wd"] == 0.75852 and c["load"] == 0.02]
    speed = float(case["omega_over_wd"] * np.sqrt(1 - 0.05**2) * W0 / 24)
    text = SYSTEM.replace("torque: 21.05", "torque: 42.1").replace("damping_ratio: 0.1", "damping_ratio: 0.05") + (
        f"respond: {{speed: {speed!r}, cycles: 40, hold_speed: true, samples_per_cycle: 400, "
        "spectrum: {window: boxcar}}\n"
    )
    out = tmp_path / "o.h5"
    succeeds("respond", written(tmp_path, text), "-o", out)
    found = opened(out)["response"]
    assert found.attrs["holding_torque"] == pytest.approx(case["eta"] * 2105, rel=1e-9)
    np.testing.assert_allclose(np.diff(found["section_time"].values), tau / (24 * speed), rtol=1e-10)
    # Lines fall as 1/n^2: those beyond the 200th, folded back, are (8/400)^2 of the 8th.
    lines = np.sqrt(2 * found["power_spectral_density"].values * float(found["frequency"][1]))[40 * np.arange(1, 9)]
    np.testing.assert_allclose(lines / 0.02, case["energy_conserving"][1:9], rtol=1e-3)


def test_a_speed_without_an_orbit_cannot_be_held(tmp_path: Path) -> None:
    text = SYSTEM + f"respond: {{speed: {7750 / 24!r}, cycles: 3, hold_speed: true}}\n"
    out = tmp_path / "o.h5"
    assert "respond.hold_speed: no periodic orbit" in refused(
        "respond", written(tmp_path, text), "-o", out, "--set", "torque=168.4", "--set", "damping_ratio=0"
    )
    assert not out.exists()


@pytest.mark.parametrize("more", ["", "  hold_speed: true\n"])
def test_the_configuration_in_the_result_gives_the_same_result(tmp_path: Path, more: str) -> None:
    path = written(tmp_path, SYSTEM + 'respond:\n  speed: "600 rpm"\n  cycles: 3\n' + more)
    config = load(path)
    again = tmp_path / "again.yaml"
    again.write_text(config.resolved)
    assert load(again).digest == config.digest
    path = written(tmp_path, SYSTEM + SWEEP)
    again.write_text(load(path).resolved)
    assert load(again).digest == load(path).digest
