"""Motions with backlash after a long time, and how a configuration asks for them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import systems
from click.testing import CliRunner
from driven import integrated_with_backlash
from scenes import ROOT, ran, scene_text, succeeds

from gearstab.cli import group
from gearstab.config import ConfigError, load
from gearstab.errors import PlotError
from gearstab.floquet import solve
from gearstab.plots import draw
from gearstab.response.backlash import BACKLASH_FLAGS, BacklashResponse, backlash_response
from gearstab.response.backlash.motions import speed_cycles
from gearstab.response.command import effort
from gearstab.response.speeds import speed_response
from gearstab.results import open_result
from gearstab.system import GearSystem
from gearstab.systems import build

CONFIG = ROOT / "configs" / "response" / "backlash.yaml"


def pair(scale: float = 1.0) -> GearSystem:
    """At twice its natural frequency, in the middle of the principal instability region; lengths times ``scale``."""
    return build(systems.pair({"backlash": 2.0 * scale}, damping_ratio=0.05, load=[0.5 * scale]))


def loaded_a(phasing: float, damping: float, backlash: float) -> GearSystem:
    """Point A with backlash and a load."""
    return build(systems.point_a(phasing, {"backlash": backlash}, damping_ratio=damping, load=[0.0, 0.0, 0.5]))


def settled(system: GearSystem, omega: float, x: float, cycles: int = 120) -> BacklashResponse:
    period = 2 * np.pi / omega
    return backlash_response(
        system, omega, cycles * period, (np.array([x]), np.zeros(1)), 16, (cycles - 40) * period
    )  # fmt: skip


def test_a_tongue_ends_in_a_limit_cycle_of_half_the_mesh_frequency() -> None:
    # Until what is left of the transient, e^(-0.05 t), is 1e-13.
    found = settled(pair(), 2.0, 1.6, 240)
    assert found.growth_rate > 0.04
    assert found.cycle is not None
    assert found.cycle.period == 2
    assert 0 < found.cycle.contact_loss[0] < 1
    assert {"unstable", "separation"} <= set(found.findings)
    # Once around by DOP853: it closes, and its extremes, sampled, are those found between the samples.
    period = 2 * found.common_period
    last = np.array([found.displacement[-1, 0], found.velocity[-1, 0]])
    times = np.linspace(0.0, period, 4001)
    around, changes = integrated_with_backlash(pair(), np.array([[-1.0, 1.0]]), 2.0, last, times)
    np.testing.assert_allclose(around[-1], last, atol=1e-8)
    assert len(changes) == 2
    x = around[:, 0]
    np.testing.assert_allclose(found.cycle.peak_to_peak, np.ptp(x), rtol=1e-6)
    # Trapezoids over a closed cycle, whose third derivatives jump: (period/4000)^2.
    mean = x[:-1].mean()
    np.testing.assert_allclose(found.cycle.rms, np.sqrt(((x[:-1] - mean) ** 2).mean()), rtol=1e-6)
    (apart, _, _), (meets, _, _) = changes
    np.testing.assert_allclose(found.cycle.contact_loss, (meets - apart) / period, rtol=1e-7)


def test_its_size_goes_with_the_load_and_the_backlash() -> None:
    """The equation is homogeneous: load, backlash and initial state times 3 make the motion three times as large."""
    one, three = settled(pair(), 2.0, 1.6).cycle, settled(pair(3.0), 2.0, 4.8).cycle
    assert one is not None
    assert three is not None
    np.testing.assert_allclose(three.peak_to_peak, 3 * one.peak_to_peak, rtol=1e-9)
    np.testing.assert_allclose(three.contact_loss, one.contact_loss, rtol=1e-9)


def test_below_the_tongue_two_motions_coexist_and_above_only_one() -> None:
    """Free flight makes vibrations slower: the amplitude jumps up at the lower edge and persists below (softening)."""
    low, high, above = (settled(pair(), omega, x).cycle for omega, x in ((1.8, 1.5), (1.8, 3.0), (2.3, 3.0)))
    assert low is not None
    assert high is not None
    assert above is not None
    assert (low.period, high.period, above.period) == (1, 2, 1)
    assert low.contact_loss[0] == above.contact_loss[0] == 0.0
    assert high.peak_to_peak > 10 * low.peak_to_peak


def test_point_a_stays_bounded_with_damping_and_quiet_where_it_is_stable() -> None:
    duration = 120 * 2 * np.pi / 4.2
    unstable = backlash_response(loaded_a(0.0, 0.07, 10.0), 4.2, duration, None, 10)
    assert unstable.growth_rate > 0.05
    assert unstable.cycle is not None
    assert (unstable.cycle.contact_loss > 0.1).all()
    # From one half of the history to the other nothing grows; without loss of contact it would, by e^5.
    half = len(unstable.time) // 2
    first, second = unstable.mesh_deflection[half // 2 : half], unstable.mesh_deflection[half:]
    assert np.ptp(second) < 1.5 * np.ptp(first)
    stable = backlash_response(loaded_a(0.4, 0.07, 10.0), 4.2, duration, None, 10)
    assert stable.growth_rate < 0
    assert not stable.events


def test_much_larger_motions_than_the_backlash_grow_as_without_it() -> None:
    """Loss of contact cannot stop such growth: the rate is that of the linear system, by Floquet theory."""
    system, omega = loaded_a(0.0, 0.01, 2.0), 4.2
    period = 2 * np.pi / omega
    found = backlash_response(system, omega, 300 * period, (np.array([1.0, 1.0, 1.0]), np.zeros(3)), 4)
    size = np.abs(found.displacement[::4]).max(axis=1)
    rate = np.log(size[280] / size[200]) / (80 * period)
    expected = float(np.ravel(solve(system, np.array([omega])).growth_rate)[0])
    np.testing.assert_allclose(rate, expected, rtol=1e-9)


def test_a_run_up_and_a_run_down_show_different_motions() -> None:
    """Against motions from states of one's own choice, followed for twice as long."""
    omega = np.array([2.3, 2.0, 1.8])
    up, down = (speed_cycles(pair(), omega, down, 300, 250) for down in (False, True))
    sizes = [settled(pair(), w, x, 240).cycle for w, x in ((2.3, 1.6), (2.0, 1.6), (1.8, 1.5), (1.8, 3.0))]
    span = [float(cycle.peak_to_peak[0]) for cycle in sizes if cycle is not None]
    # What is left of the transients, e^(-0.05 t).
    np.testing.assert_allclose(up["transmission_error_peak_to_peak"][:, 0], span[:3], rtol=1e-6)
    np.testing.assert_allclose(down["transmission_error_peak_to_peak"][:, 0], [*span[:2], span[3]], rtol=1e-6)
    assert list(up["period"]) == [1, 2, 1]
    assert list(down["period"]) == [1, 2, 2]
    assert [bool(s & BACKLASH_FLAGS["separation"]) for s in down["status"]] == [False, True, True]
    assert [bool(s & BACKLASH_FLAGS["unstable"]) for s in down["status"]] == [False, True, False]
    np.testing.assert_allclose(up["dynamic_load_factor"], up["mesh_force_peak"] / 0.5, rtol=1e-12)


def test_under_a_large_load_the_response_over_speed_is_the_steady_state() -> None:
    """With a transmission error, so that something vibrates; two systems, each by itself."""
    mesh = {"name": "mesh", "mean_stiffness": 1.0, "epsilon": 0.2, "contact_ratio": 1.5, "backlash": 0.5}
    train = {"kind": "gear_pair", "equivalent_mass": 1.0, "damping_ratio": 0.1, "load": [5.0]}
    system = build(train | {"meshes": [mesh | {"transmission_error": {"sin": [0.1]}}]})
    omega = np.array([0.7, 1.3])
    found, expected = speed_cycles(system, omega, cycles=60), speed_response(system, omega)
    # e^(-0.1 t) after 30 cycles; a polynomial of degree four through every five samples gives extremes to 1e-6.
    for name in ("mesh_force_peak", "transmission_error_peak_to_peak", "transmission_error_rms", "dynamic_load_factor"):
        np.testing.assert_allclose(found[name], getattr(expected, name)[0], rtol=1e-5, err_msg=name)
    assert not found["contact_loss_ratio"].any()


def test_sweeps_follow_every_system_by_itself(tmp_path: Path) -> None:
    source, out = ROOT / "configs" / "response" / "backlash_speeds.yaml", tmp_path / "out.h5"
    changes = {
        "sweep.mesh_frequency": "[1.8, 2.0, 2.3]",
        "sweep.damping_ratio": "[0.05, 0.3]",
        "methods.response.cycles": "60",
        "methods.response.discard": "40",
    }
    options = [part for path, value in changes.items() for part in ("--set", f"{path}={value}")]
    succeeds("sweep", source, "-o", out, *options)
    with open_result(out) as tree:
        found = tree["response"].to_dataset()
        span = found["transmission_error_peak_to_peak"].transpose("damping_ratio", "mesh_frequency", "mesh").values
        expected = speed_cycles(pair(), np.array([1.8, 2.0, 2.3]), True, 60, 40)
        np.testing.assert_allclose(span[0], expected["transmission_error_peak_to_peak"], rtol=1e-9)
        # With so much damping it is stable, and never leaves its flank.
        assert not found["contact_loss_ratio"].sel(damping_ratio=0.3).values.any()
        _, artists = draw(tree, "speeds", select={"damping_ratio": "0.05"})
        assert np.isfinite(artists["lines"][0].get_ydata()).all()


def test_backlash_as_an_axis(tmp_path: Path) -> None:
    """None at one of its points: there the motion grows as that of the linear system, for 120 cycles."""
    source, out = ROOT / "configs" / "response" / "backlash_speeds.yaml", tmp_path / "out.h5"
    changes = [
        "sweep.mesh_frequency=[2.0]",
        "sweep.meshes.mesh.backlash=[0, 2]",
        "methods.response={cycles: 120, discard: 80}",
    ]
    options = [part for change in changes for part in ("--set", change)]
    succeeds("sweep", source, "-o", out, *options)
    with open_result(out) as tree:
        span = tree["response"]["transmission_error_peak_to_peak"].values.ravel()
        expected = settled(pair(), 2.0, 1.6).cycle
        assert expected is not None
        # From static equilibrium it takes longer to settle.
        np.testing.assert_allclose(span[1], expected.peak_to_peak[0], rtol=5e-3)
        assert span[0] > 10 * span[1]


def test_the_file_holds_events_and_the_limit_cycle(tmp_path: Path) -> None:
    out = tmp_path / "out.h5"
    done = succeeds("respond", CONFIG, "-o", out, "--set", "respond.cycles=140")
    assert "settled: period 2" in done.stderr
    expected = settled(pair(), 2.0, 1.6, 140)
    assert expected.cycle is not None
    with open_result(out) as tree:
        found = tree["response"]
        for name, value in (("peak_to_peak", expected.cycle.peak_to_peak), ("rms", expected.cycle.rms)):
            np.testing.assert_allclose(found[name], value, rtol=1e-9)
        np.testing.assert_allclose(found["contact_loss_ratio"], expected.cycle.contact_loss, rtol=1e-9)
        np.testing.assert_allclose(found["event_time"], [event.time for event in expected.events], rtol=1e-11)
        assert set(found["event_kind"].values) == {"separation", "drive_side_contact"}
        assert set(found["event_mesh"].values) == {"mesh"}
        assert found.attrs["period"] == 2
        assert found.attrs["settled_from"] == pytest.approx(100 * np.pi)
        np.testing.assert_array_equal(found["play"].values, [[-1.0, 1.0]])
        assert not found["mesh_force"].values[found["contact"].values == 0].any()
        for flag in ("unstable", "separation"):
            assert found["status"].values & BACKLASH_FLAGS[flag]
        assert "chatter" in found["status"].attrs["flag_meanings"]


def test_what_takes_long_is_said_beforehand(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A shaft ten thousand times as stiff makes a mode a hundred times as fast, and pieces as short."""
    monkeypatch.setattr(effort, "LONG", 1e-3)
    source = ROOT / "configs" / "response" / "backlash_point_a.yaml"

    def said(*options: str) -> str:
        out = str(tmp_path / "out.h5")
        options = ("respond.cycles=1", "respond.samples_per_cycle=4", *options)
        done = CliRunner().invoke(
            group, ["respond", str(source), "-o", out, *(p for o in options for p in ("--set", o))]
        )
        assert done.exit_code == 0, done.output
        return done.stderr

    assert "note: this takes" not in said()
    # w = sqrt(5e7) for 2 pi/4.2.
    told = said("system.input_shaft_stiffness=5e7")
    assert told.startswith("note: this takes some 0 seconds: the fastest mode vibrates 1.7e+03 times meanwhile\n")


def test_the_figure_shows_the_orbit_and_where_it_is_once_a_period(tmp_path: Path) -> None:
    out = tmp_path / "out.h5"
    succeeds("respond", CONFIG, "-o", out, "--set", "respond.cycles=140")
    with open_result(out) as tree:
        _, artists = draw(tree, "phase-plane")
        x, v = (tree["response"][name].values[:, 0] for name in ("mesh_deflection", "mesh_velocity"))
        late = tree["response"]["time"].values >= 100 * np.pi - 1e-9
        (plane,), (sections,), (history,) = (artists[name] for name in ("planes", "sections", "histories"))
        # Drawn in pieces, each of which begins where the one before ends.
        pieces = plane.get_segments()
        drawn = np.concatenate([pieces[0], *(piece[1:] for piece in pieces[1:])])
        np.testing.assert_array_equal(drawn, np.stack([x, v], axis=1)[late])
        # 40 periods, both ends included, and only two places, but for the rest of the transient.
        assert len(sections.get_xdata()) == 41
        assert len(np.unique(np.round(sections.get_xdata(), 3))) == 2
        assert np.ptp(history.get_xdata()) == pytest.approx(6 * np.pi)
        with pytest.raises(PlotError, match="no mesh 'second'"):
            draw(tree, "phase-plane", select={"mesh": "second"})
        with pytest.raises(PlotError, match="fixed panels"):
            draw(tree, "phase-plane", variable="energy")


SCENE = scene_text("backlash_cycles")


def test_only_backlash_has_something_to_discard(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    text = SCENE + "respond: {mesh_frequency: 2.0, cycles: 5, discard: 2}"
    path.write_text(text.replace(', backlash: "2 m"', ""))
    with pytest.raises(ConfigError, match="no mesh has backlash"):
        load(path)
    path.write_text(text)
    assert load(path).system["meshes"][0]["backlash"] == 2.0


def test_a_drive_side_needs_a_load(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    text = SCENE.replace("load: [0.5]", "load: [0.0]").replace('"2 m"', '"2 m", backlash_zero: drive_side')
    path.write_text(text + "respond: {mesh_frequency: 2.0, cycles: 5, initial: {velocity: [1.0]}}")
    done = ran("respond", path, "-o", tmp_path / "out.h5")
    assert done.exit_code != 0
    assert "carries no load" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_gearboxes_have_backlash_but_not_with_friction() -> None:
    source: Any = ROOT / "configs" / "kuria_kihiu_2008" / "gearbox.yaml"
    name = next(iter(load(source).system["meshes"]))["name"]
    system = build(load(source, [f"system.meshes.{name}.backlash=1.0e-4"]).system)
    assert float(system.meshes[0].backlash) == 1e-4
    with pytest.raises(ConfigError, match="is not available with friction"):
        load(source, [f"system.meshes.{name}.backlash=1.0e-4", f"system.meshes.{name}.friction={{coefficient: 0.1}}"])
