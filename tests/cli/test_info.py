"""``gearstab info``: what it prints, as a user sees it."""

import copy
import json
import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result
from numpy.testing import assert_allclose
from scenes import CONFIGS, CONFIGURATIONS, DATA, ran, scene_text, written
from tongues import train

from gearstab.config import Config, load
from gearstab.floquet import solve
from gearstab.floquet.boundaries import boundaries
from gearstab.info import configuration, table
from gearstab.mesh import Mesh
from gearstab.modal import mean_modes, mesh_energy_shares, modal_damping_ratios, mode_types
from gearstab.perturbation import first_order
from gearstab.system import GearSystem
from gearstab.systems import build
from gearstab.waveforms import Rectangular

REFERENCE = json.loads((DATA / "lin_parker_2002.json").read_text())

TWINS = scene_text("info_twins")


KNOWN: dict[tuple[str, tuple[str, ...], int | None], dict[str, Any]] = {}


@pytest.fixture(autouse=True)
def described_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Text and JSON of one configuration show one description, which takes seconds for some."""
    describe = configuration.describe

    def once(config: Config, harmonics: int | None = None) -> dict[str, Any]:
        key = config.source.read_text(), config.overrides, harmonics
        if key not in KNOWN:
            KNOWN[key] = describe(config, harmonics)
        return copy.deepcopy(KNOWN[key])

    monkeypatch.setattr(configuration, "describe", once)


def info(config: Path | str, *options: str) -> Result:
    return ran("info", config, *options)


def facts(config: Path | str, *options: str) -> dict:
    result = info(config, "--json", *options)
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


@pytest.fixture
def fig3(root: Path) -> Path:
    return root / "configs" / "lin_parker_2002" / "fig3.yaml"


def test_json_holds_the_reference_numbers(fig3: Path) -> None:
    found = facts(fig3)
    assert [mode["natural_frequency"] for mode in found["modes"]] == pytest.approx(REFERENCE["natural_frequencies"])
    first = [abs(mode["mesh_deflection"]["first"]) for mode in found["modes"]]
    assert first == pytest.approx(REFERENCE["mesh_deflection_abs"][0])
    assert found["common_period"] == {
        "in_periods_of_omega": 1.0,
        "mesh_cycles": {"first": 1, "second": 1},
        "segments": 2,
        "distinct_stiffness_states": 2,
    }
    wanted = {(t["p"], t["q"], t["harmonic"]): t for t in REFERENCE["first_order"][0]["tongues"]}
    assert len(found["tongues"]) == len(wanted) == 18
    epsilon = found["meshes"][0]["epsilon"]
    for tongue in found["tongues"]:
        reference = wanted[tongue["mode_p"], tongue["mode_q"], tongue["harmonic"]]
        half = epsilon * reference["half_width_per_eps"]
        assert tongue["center_frequency"] == pytest.approx(reference["center"])
        assert tongue["half_width"] == pytest.approx(half, abs=1e-14)
        edges = [reference["center"] - half, reference["center"] + half]
        assert tongue["boundary_frequency"] == pytest.approx(edges)
    centers = [tongue["center_frequency"] for tongue in found["tongues"]]
    assert centers == sorted(centers)


def test_text_names_every_tongue_and_mode(fig3: Path) -> None:
    result = info(fig3)
    assert result.exit_code == 0
    assert result.stderr == ""
    text = result.stdout
    assert "\x1b" not in text
    assert text.startswith("Instability regions of a three-gear train")
    for label in ("2w3", "w2+w3", "(w1+w2)/2", "2w1/3", "primary", "secondary", "higher combination", "first, second"):
        assert re.search(rf"(^|\s){re.escape(label)}(\s|$)", text, re.MULTILINE), label
    assert "2.71172" in text
    assert "not excited to first order" in text
    assert max(map(len, text.splitlines())) <= 140


def test_overrides_and_harmonics(fig3: Path) -> None:
    found = facts(fig3, "--set", "tooth_ratio=3/5", "--set", "system.meshes.0.epsilon=0.1", "--harmonics", "1")
    assert [mesh["frequency_ratio"] for mesh in found["meshes"]] == ["1", "5/3"]
    assert found["meshes"][0]["epsilon"] == 0.1
    assert found["harmonics"] == 1
    assert {tongue["label"] for tongue in found["tongues"]} >= {"2w3", "2w3 (second)"}
    assert found["common_period"]["mesh_cycles"] == {"first": 3, "second": 5}


def test_damping_and_closed_tongues(fig3: Path) -> None:
    found = facts(fig3, "--set", "damping_ratio=0.05")
    assert [mode["damping_ratio"] for mode in found["modes"]] == pytest.approx([0.05] * 3)
    closed = [tongue for tongue in found["tongues"] if tongue["boundary_frequency"] == [None, None]]
    assert 0 < len(closed) < len(found["tongues"])
    assert all(tongue["half_width"] == 0 for tongue in closed)
    text = info(fig3, "--set", "damping_ratio=0.05").stdout
    assert re.search(r"closed by damping, opens at epsilon x [\d.]+", text)


def test_one_damped_mode_of_two_has_no_boundary(fig3: Path) -> None:
    damping = "system.damping={modal: [0, 0, 0.05]}"
    tongue = next(t for t in facts(fig3, "--set", damping, "--set", "phasing=0.5")["tongues"] if t["label"] == "w2+w3")
    assert tongue["half_width"] == "infinite"
    assert "only one of the modes is damped" in info(fig3, "--set", damping, "--set", "phasing=0.5").stdout


def test_rigid_modes_are_said(fig3: Path) -> None:
    found = facts(fig3, "--set", "input_shaft_stiffness=0")
    assert [mode["type"] for mode in found["modes"]] == ["rigid-body", "elastic", "elastic"]
    assert {tongue["mode_p"] for tongue in found["tongues"]} == {2, 3}
    assert "Rigid-body modes take no part in stability: 1." in info(fig3, "--set", "input_shaft_stiffness=0").stdout


def test_equal_frequencies_and_decoupled_modes_are_said(tmp_path: Path) -> None:
    path = written(tmp_path, TWINS, "twins.yaml")
    assert facts(path)["equal_frequencies"] == []
    # Meshes to the ground: three oscillators, of which the outer two are alike and the first meets no mesh.
    text = TWINS.replace("[1, -1, 0]", "[0, 1, 0]").replace("[1, 0, -1]", "[0, 0, 1]")
    path.write_text(text)
    found = facts(path)
    assert found["equal_frequencies"] == [[2, 3]]
    assert [mode["type"] for mode in found["modes"]] == ["no mesh deflection", "elastic", "elastic"]
    labels = [tongue["label"] for tongue in found["tongues"]]
    assert "2w2" in labels
    assert "2w3" not in labels
    output = info(path).stdout
    assert "Modes 2, 3 have equal frequencies" in output
    assert "no mesh deflection: 1." in output


def test_a_mistake_is_one_line_and_exit_code_2(tmp_path: Path) -> None:
    path = written(tmp_path, TWINS.replace("contact_ratio: 1.4}", "contact_ratoi: 1.4}"), "twins.yaml")
    result = info(path)
    assert result.exit_code == 2
    assert result.stdout == ""
    assert "Traceback" not in result.stderr
    assert f"{path}:7" in result.stderr
    missing = info(tmp_path / "absent.yaml")
    assert missing.exit_code == 2
    assert len(missing.stderr.strip().splitlines()) == 1


LONG = {"drivetrains/helicopter", "parker_2009/contact_ratio", "parker_2009/gamma_sr", "drive_train", "waveforms/pairs"}
"""Dangerous speeds of these take seconds each, and others have all that they have."""


def named(path: Path) -> str:
    return path.relative_to(CONFIGS).with_suffix("").as_posix()


@pytest.mark.parametrize(
    "path",
    [pytest.param(p, id=named(p), marks=[pytest.mark.slow] * (named(p) in LONG)) for p in CONFIGURATIONS],
)
def test_every_configuration_of_the_repository(path: Path) -> None:
    result = info(path)
    assert result.exit_code == 0, result.output


# ---- modal facts


def test_strain_energy_is_that_of_the_stiffness_matrices() -> None:
    """phi_p^T (k_g g g^T) phi_p over phi_p^T K phi_p; without ground springs the meshes hold it all."""
    for k0 in (0.5, 0.0):
        system = train(input_shaft_stiffness=k0)
        modes = mean_modes(system)
        shares = mesh_energy_shares(system, modes)
        total = np.diag(modes.shapes.T @ system.mean_stiffness_matrix() @ modes.shapes)
        for i, mesh in enumerate(system.meshes):
            part = np.diag(modes.shapes.T @ (mesh.mean_stiffness * mesh.outer) @ modes.shapes)
            assert_allclose(shares[1:, i], part[1:] / total[1:], rtol=1e-12)
        if k0 == 0:
            assert_allclose(shares[1:].sum(axis=-1), 1, rtol=1e-12)
            assert np.isnan(shares[0]).all()


def test_damping_ratios_come_back() -> None:
    ratios = [0.01, 0.02, 0.07]
    system = train(damping={"modal": ratios})
    assert_allclose(modal_damping_ratios(system, mean_modes(system)), ratios, rtol=1e-12)
    assert_allclose(modal_damping_ratios(train(), mean_modes(train())), 0)


def test_mode_types_in_a_batch() -> None:
    mesh = Mesh("mesh", np.array([1.0, -1.0, 0.0]), np.asarray(1.0), np.asarray(0.1), Rectangular(1.5))
    ground = np.zeros((2, 3, 3))
    ground[:, 2, 2] = 5.0
    ground[1, 0, 0] = -0.3
    types = mode_types(mean_modes(GearSystem(np.eye(3), ground, (mesh,))))
    expected = [
        ["rigid-body", "elastic", "no mesh deflection"],
        ["negative stiffness", "elastic", "no mesh deflection"],
    ]
    assert types.tolist() == expected


def test_table_aligns_numbers_to_the_right() -> None:
    assert table(["a", "n"], [["x", "1"], ["long", "-"]]) == "a     n\n----  -\nx     1\nlong  -"
    assert table(["a", "size"], [["x", "1"], ["y", "22"]]).splitlines()[2:] == ["x     1", "y    22"]


def dangerous(config: Path | str, *options: str) -> tuple[dict, str]:
    """Facts and text of the dangerous speeds."""
    text = info(config, *options).stdout
    return facts(config, *options)["dangerous"], text[
        text.index("Dangerous speeds") : text.index("Instability tongues")
    ]


def test_dangerous_speeds_are_ranked_in_the_unit_of_the_sweep(root: Path) -> None:
    """A reducer without damping: speeds as typed, each region with its remedies, a dozen lines of them."""
    found, text = dangerous(root / "configs" / "reducer.yaml", "--set", "system.damping_ratio=0")
    assert found["range"] == pytest.approx([300, 6000])
    assert found["unit"] == "rpm"
    assert "input speed from 300 to 6000 rpm" in text
    assert len(found["open"]) == 12 < found["number_open"]
    shares = [region["share_of_range"] for region in found["open"]]
    assert shares == sorted(shares, reverse=True)
    assert found["scale"] == pytest.approx(20 * np.pi / 30)  # rad/s of the mesh per rpm of the input, 20 teeth
    first = found["open"][0]
    assert f"{first['boundary_frequency'][0] / found['scale']:.6g}" in text
    assert any(region["harmonic"] > 3 for region in found["open"])  # more than the three that are listed
    assert max(map(len, text.splitlines())) <= 140


def test_where_nothing_is_open_the_next_to_open_are_named(root: Path) -> None:
    found, text = dangerous(root / "configs" / "reducer.yaml")
    assert found["verified"]
    assert found["open"] == []
    assert "No region of instability is open there." in text
    for region in found["closest"]:
        assert region["threshold"] > 1
        assert region["closed_by"]["damping_ratio"] == pytest.approx(0.01 / region["threshold"])  # that of the system
    assert f"damping closes {found['number_closed_by_damping']} regions" in text


def test_a_phasing_that_info_names_does_what_it_says(fig3: Path) -> None:
    """Put back into the configuration it leaves the part of the exact width that it says, and far less than the other
    way round.
    """
    found, text = dangerous(fig3)
    advised = [region for region in found["open"] if "phasing" in region["closed_by"]]
    assert len(advised) >= 3

    def width(label: str, low: float, high: float, *options: str) -> float:
        """Width of the exact regions of a name, and of what others make unstable between two speeds."""
        edges = boundaries(build(load(fig3, options).system), 0.3, 7.0)
        return sum(
            upper - lower
            if label in [member.label for member in members]
            else max(min(upper, high) - max(lower, low), 0.0)
            for lower, upper, members in zip(edges.lower, edges.upper, edges.members, strict=True)
        )

    for region in advised:
        remedy, label = region["closed_by"]["phasing"], region["label"]
        assert (remedy["mesh"], remedy["key"]) == ("second", "phasing")
        assert remedy["leaves"] < 0.5
        low, high = region["boundary_frequency"]
        # Regions narrower than 1e-5 of a speed are not counted, and are less than 1e-3 of these widths.
        left = width(label, low, high, f"phasing={remedy['value']}") / width(label, low, high)
        assert left == pytest.approx(remedy["leaves"], abs=2e-3), label
        assert f"second {remedy['value']:.4g} ({100 * remedy['leaves']:.2g} %)" in text


def test_the_sense_of_an_advised_phasing(fig3: Path) -> None:
    """With contact ratios that differ the best phase is no half period, so that its opposite leaves far more."""
    options = ("--set", "meshes.0.contact_ratio=1.4", "--set", "meshes.1.contact_ratio=1.65")
    found, _ = dangerous(fig3, *options)
    remedy = next(r for r in found["open"] if r["label"] == "2w3")["closed_by"]["phasing"]
    config = load(fig3, options[1::2])
    low, high = next(r for r in found["open"] if r["label"] == "2w3")["boundary_frequency"]
    omega = np.linspace(low - 0.3, high + 0.3, 601)

    def unstable(phasing: float) -> float:
        changed = load(fig3, (*options[1::2], f"phasing={phasing}"))
        return float(np.mean(solve(build(changed.system), omega).growth_rate > 0))

    before = float(np.mean(solve(build(config.system), omega).growth_rate > 0))
    # 601 points tell a width of 1.2 to 0.2 %.
    assert unstable(remedy["value"]) / before == pytest.approx(remedy["leaves"], abs=0.005)
    assert unstable((-remedy["value"]) % 1.0) > 1.5 * unstable(remedy["value"])


def test_the_teeth_of_the_sun_that_exclude_a_region(tmp_path: Path) -> None:
    config = CONFIGS / "parker_2009" / "rigid_ring.yaml"
    found, text = dangerous(config, "--harmonics", "1")
    assert "sun's teeth" in text

    @cache
    def half_widths(z: int, planets: int) -> dict[str, float]:
        phases = [k * z / planets % 1 for k in range(planets)]
        found = first_order(build(load(config, [f"phases.sun={phases}"]).system), 1)
        return {label: float(half) for label, half in zip(found.label, found.half_width, strict=True)}

    seen = set()
    for region in found["open"]:
        remedy = region["closed_by"].get("sun_teeth_modulo")
        if remedy is None or region["harmonic"] > 1:
            continue
        planets = remedy["planets"]
        for z in range(planets):
            width = half_widths(z, planets)[region["label"]]
            assert (width < 1e-12) == (z in remedy["remainders"]), (region["label"], z)
        seen |= set(remedy["remainders"])
        if len(seen) > 1:
            break
    assert seen


def test_a_long_list_of_tongues_is_printed_on_request(root: Path) -> None:
    config = root / "configs" / "reducer.yaml"
    short, long = info(config).stdout, info(config, "--all").stdout
    assert "listed with --all or --json" in short
    assert "w5+w6" not in short
    assert "w5+w6" in long


def test_the_tongue_table_is_in_the_unit_of_the_sweep(root: Path) -> None:
    """Both tables name the same input speeds in rpm, whether rpm were typed or asked for; JSON keeps rad/s."""
    config = root / "configs" / "reducer.yaml"
    undamped = ("--set", "system.damping_ratio=0")
    tongue = next(t for t in facts(config, *undamped)["tongues"] if t["half_width"] > 0)
    listed = f"{tongue['center_frequency'] / (20 * np.pi / 30):.6g}"
    for more in ((), ("--unit", "rpm")):
        text = info(config, *undamped, "--all", *more).stdout
        title, _, *rows = text[text.index("Instability tongues") :].splitlines()
        assert title.endswith("by input speed")
        assert "centre (rpm)" in rows[0]
        assert any(row.startswith(tongue["label"]) and f" {listed} " in row for row in rows)
