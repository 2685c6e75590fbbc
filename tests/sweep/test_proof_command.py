"""Speeds that are proved stable, from the command to the file and the picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scenes import opened, scene_text, succeeds, written
from test_sweep import divided

from gearstab.cli.messages import percent, searched
from gearstab.config import load
from gearstab.floquet import solve
from gearstab.floquet.boundaries.damped import search
from gearstab.plots import draw
from gearstab.sweep import plan, run
from gearstab.sweep.storage import store
from gearstab.sweep.storage.merge import RegionSearches

TRAIN = scene_text("proof_command_train")


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("proof") / "train.yaml"
    path.write_text(TRAIN)
    return path


@pytest.fixture(scope="module")
def swept(config: Path) -> tuple[Path, str]:
    """(result file, what the command said)."""
    out = config.with_suffix(".h5")
    said = succeeds("sweep", config, "-o", out, "-j", "1")
    return out, said.output


def loaded(path: Path) -> xr.DataTree:
    return opened(path)


def test_the_last_line_says_what_is_proved(swept: tuple[Path, str]) -> None:
    last = swept[1].strip().splitlines()[-1]
    assert last.startswith("stable mesh frequencies: 99.99 % proved stable (in floating point)")


def test_the_file_holds_shares_and_stretches(swept: tuple[Path, str], config: Path) -> None:
    data = loaded(swept[0])["boundaries"].to_dataset()
    assert data["proved_frequency"].dims == ("stretch", "side", "epsilon")
    assert (data["proved_share"] > 0.9999).all()
    assert (data["proved_share"] + data["counted_share"] <= 1).all()
    regions = np.isfinite(data["boundary_frequency"]).all("side").sum("tongue").values
    ends = data["proved_frequency"].values
    # What is proved lies between regions, and where there is none it is everything.
    assert (np.isfinite(ends).all(axis=1).sum(axis=0) >= np.maximum(regions - 1, 1)).all()
    np.testing.assert_allclose(ends[0, :, 0], [1.0, 7.0], rtol=1e-12)
    assert regions[0] == 0
    assert regions[-1] > 3
    grid = loaded(swept[0])["floquet"]["stable"]
    for row in range(4):
        omega = grid["mesh_frequency"].values
        inside = ((omega[:, None] > ends[:, 0, row]) & (omega[:, None] < ends[:, 1, row])).any(axis=1)
        assert (grid.isel(epsilon=row).values[inside] == 1).all()
    # Stable points of the grid are proved, but for those beside edges.
    stable = int((grid == 1).sum())
    middle = np.isfinite(ends).all(axis=1)
    length = np.where(middle, ends[:, 1] - ends[:, 0], 0.0).sum()
    assert length == pytest.approx(stable / grid.size * 4 * 6.0, rel=0.05)


def test_the_division_into_blocks_does_not_matter(swept: tuple[Path, str], config: Path, tmp_path: Path) -> None:
    """Blocks whose rows have different numbers of stretches; the summary is the mean of all rows."""
    out = tmp_path / "divided.h5"
    summary = run(divided(plan(load(config)), 1), out, jobs=1)
    one, other = (loaded(path)["boundaries"].to_dataset() for path in (swept[0], out))
    assert summary.blocks > 4
    xr.testing.assert_allclose(one["proved_frequency"], other["proved_frequency"], rtol=1e-12)
    found = summary.searches["boundaries"]
    assert found.proved == pytest.approx(float(one["proved_share"].mean()), rel=1e-12)
    assert found.counted == pytest.approx(float(one["counted_share"].mean()), abs=1e-15)


def test_parts_written_to_disk_are_counted_too(config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "MOST_SECONDS", 0.0)
    found = run(divided(plan(load(config)), 1), tmp_path / "r.h5", jobs=1).searches["boundaries"]
    assert found.proved is not None
    assert found.proved > 0.9999


def test_without_damping_nothing_is_proved_and_the_command_says_no_word(config: Path, tmp_path: Path) -> None:
    out = tmp_path / "free.h5"
    arguments = ["sweep", str(config), "-o", str(out), "-j", "1", "--set", "system.damping_ratio=0"]
    said = succeeds(*arguments, "--set", "sweep.epsilon=[0.1, 0.2]")
    assert "proved" not in said.output
    data = loaded(out)["boundaries"].to_dataset()
    assert (data["proved_share"] == 0).all()
    np.testing.assert_allclose(data["counted_share"], 1.0, rtol=1e-12)
    assert np.isnan(data["proved_frequency"]).all()
    assert draw(loaded(out), "boundaries")[1]["cases"][0]["proved"] is None


def line(step: float, coarse: int, *shares: float) -> str:
    (found,) = searched({"boundaries": RegionSearches(20, step, coarse, *shares)})
    return found


def test_shares_are_rounded_down() -> None:
    assert percent(1.0) == "100 %"
    assert percent(0.999999) == "99.99 %"
    assert percent(0.87) == "87 %"
    assert "neither" not in line(0.0, 0, 0.99, 0.01)
    assert "9.01 % neither, beside edges" in line(0.0, 0, 0.9, 0.0099)
    assert "counted" not in line(0.0, 0, 0.9, 0.0)
    assert line(0.0043, 0, 0.9, 0.0).endswith(
        "10 % neither: sampled where two multipliers meet, to a step of 0.0043 of them"
    )
    assert "; those of 3 of 20 systems in equal steps only" in line(0.0043, 3, 0.9, 0.0)


LIGHT = scene_text("proof_command_light")


def test_searches_by_samples_say_their_step_and_how_many_were_coarse(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config, out = written(tmp_path, LIGHT, "light.yaml"), tmp_path / "light.h5"

    def told() -> tuple[xr.DataTree, dict[str, str]]:
        said = succeeds("sweep", config, "-o", out, "-j", "1", "--overwrite")
        lines = [line for line in said.output.splitlines() if "sampled where" in line]
        return loaded(out), dict(zip(("boundaries", "tongue_probability"), lines, strict=True))

    tree, lines = told()
    for name, line in lines.items():
        step = tree[name]["sampled_step"]
        assert line.endswith(f"sampled where two multipliers meet, to a step of {float(step.max()):.2g} of them")
        assert (tree[name]["coarse"] == 0).all()
    assert lines["tongue_probability"].startswith("tongue_probability: some mesh frequencies are neither")
    # No meeting is pursued, and samples are few.
    monkeypatch.setattr(search, "PURSUIT", 0.0)
    monkeypatch.setattr(search, "EQUAL", search.COARSEST)
    tree, lines = told()
    assert "; those in equal steps only" in lines["boundaries"]
    assert "; those of 16 of 16 systems in equal steps only" in lines["tongue_probability"]
    assert (tree["tongue_probability"]["coarse"] == 16).all()


def covered(tint: object, point: tuple[float, float]) -> bool:
    """Whether a polygon of the collection covers a point in its own coordinates."""
    return any(path.contains_point(point) for path in tint.get_paths())


@pytest.mark.parametrize("kind", ["map", "boundaries"])
def test_maps_tint_what_is_proved(swept: tuple[Path, str], kind: str) -> None:
    tree = loaded(swept[0])
    artists = draw(tree, kind)[1]
    tint = artists["proved"] if kind == "map" else artists["cases"][0]["proved"]
    growth = tree["floquet"]["growth_rate"]
    for row, epsilon in enumerate(growth["epsilon"].values):
        for omega in growth["mesh_frequency"].values[1:-1:7]:
            rate = float(solve_at(tree, row, float(omega)))
            if abs(rate) > 1e-4:
                assert covered(tint, (float(omega), float(epsilon))) == (rate < 0), (omega, epsilon)


def solve_at(tree: xr.DataTree, row: int, omega: float) -> float:
    return float(tree["floquet"]["growth_rate"].isel(epsilon=row).sel(mesh_frequency=omega))


def test_a_curve_tints_what_is_proved(swept: tuple[Path, str]) -> None:
    tree = loaded(swept[0])
    figure, artists = draw(tree, "curve", select={"epsilon": "0.3"})
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["unstable", "proved stable"]
    rates = tree["floquet"]["growth_rate"].sel(epsilon=0.3)
    for omega, rate in zip(rates["mesh_frequency"].values[1:-1:3], rates.values[1:-1:3], strict=True):
        if abs(rate) > 1e-4:
            assert covered(artists["proved"], (float(omega), 0.5)) == (rate < 0)


def test_the_reducer_is_proved_stable_throughout(root: Path) -> None:
    """163 segments per period; random speeds between the ends of the range agree."""
    planned = plan(load(root / "configs" / "reducer.yaml"))
    layout = next(layout for layout in planned.layouts if layout.method.name == "boundaries")
    ends = np.array(planned.mesh_frequency_range)
    values = layout.method.run(ends).values
    assert float(values["proved_share"][0]) == 1.0
    assert float(values["counted_share"][0]) == 0.0
    np.testing.assert_allclose(values["proved_frequency"][0, :, 0], ends, rtol=1e-12)
    omega = np.random.default_rng(1).uniform(*ends, 2000)
    assert (solve(planned.base, omega).growth_rate < 0).all()
