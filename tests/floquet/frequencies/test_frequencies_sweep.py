"""Many mesh frequencies and required damping as a user meets them: configuration, messages, result, figures."""

import importlib.util
import json
import re
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import xarray as xr
from click.testing import Result
from scenes import ran, refused, scene_text, succeeds

from gearstab.config import load
from gearstab.floquet import STATUS_FLAGS, frequencies, solve
from gearstab.floquet.frequencies import lyapunov
from gearstab.modal import mean_modes
from gearstab.plots import draw
from gearstab.systems import build

CONFIG = scene_text("frequencies_sweep")
RATIONAL, GOLDEN = 'frequency_ratio: "7/17"', "exact: false, frequency_ratio: 0.6180339887498949"


def written(folder: Path, ratio: str) -> Path:
    path = folder / "train.yaml"
    path.write_text(CONFIG.replace("RATIO", ratio))
    return path


def swept(path: Path, *sets: str) -> tuple[Result, xr.DataTree]:
    out = path.with_name(f"{len(list(path.parent.glob('*.h5')))}.h5")
    options = [part for text in sets for part in ("--set", text)]
    done = succeeds("sweep", path, "-o", out, "-j", "1", *options)
    with xr.open_datatree(out) as tree:
        return done, tree.load()


def test_auto_is_exact_and_silent_where_it_can(tmp_path: Path) -> None:
    done, tree = swept(written(tmp_path, RATIONAL))
    assert "note: methods" not in done.stderr
    floquet = tree["floquet"]
    assert floquet.attrs["frequencies_chosen"].startswith("common_period (a common period of 17 + 7 mesh cycles")
    assert set(floquet.data_vars) == {"growth_rate", "stable", "status"}


def test_auto_says_that_it_estimates(tmp_path: Path) -> None:
    done, tree = swept(written(tmp_path, GOLDEN))
    assert "note: methods.floquet.frequencies: lyapunov (the mesh frequencies have no common period)" in done.stderr
    floquet = tree["floquet"]
    assert floquet.attrs["lyapunov_cycles"] == 60
    assert floquet["growth_rate_interval"].dims == ("mesh_frequency", "epsilon")
    assert floquet["growth_rate_interval"].attrs["units"] == "1/s"
    assert np.all(floquet["growth_rate_interval"] > 0)
    assert np.all(floquet["status"] & STATUS_FLAGS["lyapunov"])
    masks = dict(
        zip(floquet["status"].attrs["flag_meanings"].split(), floquet["status"].attrs["flag_masks"], strict=True)
    )
    assert masks["undecided"] == STATUS_FLAGS["undecided"]


def test_estimates_of_a_sweep_hold_the_exact_growth(tmp_path: Path) -> None:
    path = written(tmp_path, RATIONAL)
    exact = swept(path)[1]["floquet"]["growth_rate"]
    found = swept(path, "methods.floquet.frequencies=lyapunov")[1]["floquet"]
    assert np.all(np.abs(found["growth_rate"] - exact) <= found["growth_rate_interval"])


def test_one_mesh_at_a_time(tmp_path: Path) -> None:
    path = written(tmp_path, GOLDEN)
    floquet = swept(path, "methods.floquet.frequencies=per_mesh")[1]["floquet"]
    each = floquet["growth_rate_mesh"]
    assert each.dims == ("mesh_frequency", "epsilon", "mesh")
    assert list(each["mesh"].values) == ["first", "second"]
    np.testing.assert_array_equal(each.max("mesh"), floquet["growth_rate"])
    # With the second mesh at its mean the first one is a train of one mesh frequency.
    still = swept(path, "meshes.second.epsilon=0", "sweep={mesh_frequency: [2.0, 5.5]}")[1]["floquet"]
    assert still.attrs["frequencies_chosen"] == "per_mesh (a single mesh frequency varies)"
    overrides = ("meshes.second.epsilon=0", "meshes.second.exact=true", "meshes.second.frequency_ratio=1")
    alone = build(load(path, overrides).system)
    np.testing.assert_allclose(still["growth_rate"], solve(alone, np.array([2.0, 5.5])).growth_rate[0], atol=1e-12)


@pytest.mark.parametrize("command", ["bench", "respond"])
def test_other_commands_need_a_common_period(tmp_path: Path, command: str) -> None:
    path = written(tmp_path, GOLDEN)
    if command == "respond":
        text = path.read_text().split("sweep:")[0]
        path.write_text(text + "respond: {mesh_frequency: 2.0, initial: {displacement: [1, 0, 0]}, cycles: 3}\n")
    assert "no common period" in refused(command, path, "-o", tmp_path / "out.h5")


def test_a_dry_run_tells_the_cost(tmp_path: Path) -> None:
    done = ran("sweep", written(tmp_path, RATIONAL), "--dry-run")
    assert "a common period of 17 + 7 mesh cycles with 46 segments), 4 distinct states" in done.stdout
    done = ran("sweep", written(tmp_path, GOLDEN), "--dry-run")
    # 60 cycles of the second mesh and 97.08 of the first, two segments each.
    assert "a window of 60 cycles of the slowest mesh, 314 segments" in done.stdout


def test_info_tells_the_way(tmp_path: Path) -> None:
    path = written(tmp_path, GOLDEN)
    facts = json.loads(ran("info", path, "--json").stdout)
    assert facts["common_period"] is None
    # The time is told by the dry run of a sweep, and by it alone.
    assert facts["frequencies"]["chosen"].startswith("lyapunov")
    assert list(facts["frequencies"]) == ["chosen"]
    assert {t["label"] for t in facts["tongues"]} >= {"2w3", "2w3 (second)"}
    text = ran("info", path).stdout
    assert "common period  none: a mesh frequency has an irrational ratio" in text


def test_required_damping_of_a_sweep(tmp_path: Path) -> None:
    path = written(tmp_path, 'frequency_ratio: "1"')
    _, tree = swept(path, "methods={required_damping: {}}")
    found = tree["required_damping"]
    assert found["required_damping"].attrs["units"] == "1"
    for i, omega in enumerate(found["mesh_frequency"].values):
        value = float(found["required_damping"][i, 1])
        for ratio, stable in ((0.99 * value, 0), (value, 1)):
            overrides = ("epsilon=0.3", f"damping_ratio={ratio!r}")
            verdict = solve(build(load(path, overrides).system), np.array([omega])).stable[0, 0]
            assert verdict == stable or value == 0
    assert np.any(found["required_damping"] > 0.01)


def test_a_factor_is_in_proportion_to_the_ratio(tmp_path: Path) -> None:
    path = written(tmp_path, GOLDEN)
    ratio = swept(path, "methods={required_damping: {}}")[1]["required_damping"]
    factor = swept(path, "methods={required_damping: {of: factor}}")[1]["required_damping"]
    assert factor.attrs["frequencies_chosen"] == "per_mesh"
    np.testing.assert_allclose(0.005 * factor["required_damping"], ratio["required_damping"], rtol=3e-6)
    assert "there is no damping to multiply" in refused(
        "sweep", path, "--set", "damping_ratio=0", "--set", "methods={required_damping: {of: factor}}"
    )


def test_figures_of_required_damping(tmp_path: Path) -> None:
    path = written(tmp_path, 'frequency_ratio: "1"')
    sweep = "sweep={mesh_frequency: {start: 4.5, stop: 6.5, num: 21}, epsilon: [0.1, 0.2, 0.3]}"
    _, tree = swept(path, sweep, "methods={required_damping: {largest: 0.05}, perturbation: {harmonics: 1}}")
    _, artists = draw(tree)
    shown = np.asarray(np.ma.filled(artists["cells"].get_array().astype(float), np.nan))
    values = tree["required_damping"]["required_damping"].values.T
    assert np.nanmax(shown) == np.nanmax(values) < 0.05
    assert artists["contours"] is not None
    assert artists["failed"] is not None  # more than 0.05 is required in the middle of the tongue
    _, curve = draw(tree, "curve", variable="required_damping", select={"epsilon": "0.1"})
    assert len(curve["lines"]) == 1


def train13(root: Path) -> ModuleType:
    """The script that writes the train of 13 rotors."""
    path = root / "scripts" / "many_frequencies" / "train13.py"
    spec = importlib.util.spec_from_file_location("train13", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_gearbox_is_the_one_of_the_numbers(root: Path) -> None:
    written_by = train13(root)
    assert written_by.TARGET.read_text() == written_by.text()
    system = build(load(written_by.TARGET).system)
    # Natural frequencies computed elsewhere from the same numbers.
    wanted = np.array(written_by.numbers()["check"]["natural_frequency_hz"])
    found = mean_modes(system).natural_frequency / (2 * np.pi)
    np.testing.assert_allclose(found[1:], wanted[1:], rtol=1e-8)
    assert [str(mesh.frequency_ratio) for mesh in system.meshes] == ["1", "7/17", "21/136", "147/2720", "147/2720"]


def test_the_whole_gearbox_against_other_programs(root: Path) -> None:
    # 33 coordinates and 5 % of the damping at 86.1, 86.2, 86.3, 86.4 turns of the input a second (14 teeth): growth
    # rates computed elsewhere by propagation over the common period, and by Floquet and Hill's method for mesh I alone.
    system = build(load(root / "configs" / "kuria_kihiu_2008" / "gearbox.yaml").system)
    assert system.damping is not None
    system = replace(system, damping=0.05 * system.damping, terms=())
    omega = 2 * np.pi * 14 * np.array([86.1, 86.2, 86.3, 86.4])
    exact = solve(system, omega).growth_rate[0]
    np.testing.assert_allclose(exact, [3.063, 3.354, -0.023, -0.023], atol=6e-4)  # given in three decimals
    single = frequencies.solve(system, omega, solve)
    assert single.by_mesh is not None
    # Tooth stiffnesses agree to 1e-4, which moves the tongue by as much of its frequency.
    np.testing.assert_allclose(single.by_mesh[0, :, 0], [-0.02, 3.4305, 3.7719, 0.4636], atol=2e-3)


def test_the_table_of_the_gearbox(root: Path) -> None:
    """Growth rates of docs/many_frequencies.md, of the train of 13 rotors with 5 % of its damping."""
    system = build(load(root / "configs" / "many_frequencies" / "train13.yaml").system)
    assert system.damping is not None
    system = replace(system, damping=0.05 * system.damping)
    document = (root / "docs" / "many_frequencies.md").read_text()
    number = r" (-?[\d.]+) "
    rows = re.findall(rf"^\|{number}\|{number}\|{number}\| [-IV]+ \|{number}\u00b1{number}\|$", document, re.MULTILINE)
    hertz, exact, single, estimate, half = np.array(rows, dtype=float).T
    assert len(rows) == 12
    omega = 2 * np.pi * hertz
    np.testing.assert_allclose(solve(system, omega).growth_rate[0], exact, atol=6e-4)  # printed to three decimals
    np.testing.assert_allclose(frequencies.solve(system, omega, solve).growth_rate[0], single, atol=6e-4)
    assert np.all(np.abs(estimate - exact) <= half)
    found = lyapunov.solve(system, omega[1:2], cycles=100)
    assert abs(found.growth_rate[0, 0] - exact[1]) <= found.interval[0, 0] < 1.0
