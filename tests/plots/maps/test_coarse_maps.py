"""Maps of more points than a picture shows: what reducing them block by block keeps."""

import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scenes import TRAIN

from gearstab.plots import draw
from gearstab.plots.axes import FigureAxis
from gearstab.plots.drawing import grid
from gearstab.plots.view import MapView

CELLS = 10
AXES = {
    "even": (np.linspace(1.0, 7.0, 64), np.linspace(0.0, 0.5, 45)),
    "descending": (np.linspace(7.0, 1.0, 64), np.linspace(0.0, 0.5, 45)),
    "uneven and geometric": (np.sort(np.random.default_rng(1).uniform(1, 7, 64)), np.geomspace(0.01, 0.5, 45)),
    "in no order": (np.random.default_rng(2).permutation(np.linspace(1, 7, 64)), np.linspace(0.0, 0.5, 45)),
    "one short": (np.linspace(1.0, 7.0, 64), np.array([0.1, 0.2, 0.3])),
}


def result(x: np.ndarray, y: np.ndarray, tiles: tuple[int, int, int]) -> xr.DataTree:
    """A result of three slices with single unstable points and single failed ones, stored in tiles."""
    rng = np.random.default_rng(3)
    shape = len(x), 3, len(y)
    stable = np.where(rng.random(shape) < 0.01, 0, 1).astype("i1")
    stable[rng.random(shape) < 0.02] = -1
    growth = np.where(stable == 0, rng.uniform(0.1, 1.0, shape), rng.choice([0.0, -1e-17], shape))
    growth[stable < 0] = np.nan
    status = np.where(rng.random(shape) < 0.01, 32, 0).astype("i2")
    dims = "mesh_frequency", "phasing", "epsilon"
    said = {"flag_meanings": "a b c d e not_converged", "flag_masks": np.array([1, 2, 4, 8, 16, 32], dtype="i2")}
    variables = {
        "growth_rate": (dims, growth, {"units": "1/s"}), "stable": (dims, stable), "status": (dims, status, said),
        "other": (dims, growth),
    }  # fmt: skip
    floquet = xr.Dataset(variables)
    for item in floquet.data_vars.values():
        item.encoding["chunksizes"] = tiles
    edges = xr.Dataset(
        {"boundary_frequency": (("tongue", "side", "phasing", "epsilon"), rng.random((2, 2, 3, len(y))))}
    )
    root = xr.Dataset(coords={"mesh_frequency": x, "phasing": [0.0, 0.2, 0.4], "epsilon": y})
    return xr.DataTree.from_dict({"/": root, "/floquet": floquet, "/boundaries": edges})


def cells_of(axis: np.ndarray) -> list[np.ndarray]:
    """The points of each cell, worked out one by one: those nearest in rank to one of evenly spaced ranks."""
    rank = np.empty(len(axis), dtype=int)
    rank[np.argsort(axis, kind="stable")] = np.arange(len(axis))
    count = min(len(axis), CELLS)
    middles = np.linspace(0, len(axis) - 1, count)
    nearest = [int(np.argmin(np.abs(middles - r))) for r in rank]
    return [np.flatnonzero(np.array(nearest) == k) for k in range(count)]


@pytest.fixture(autouse=True)
def few_cells(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(grid, "MOST_CELLS", CELLS)


@pytest.mark.parametrize("tiles", [(64, 3, 45), (7, 1, 11), (64, 1, 4)], ids=str)
@pytest.mark.parametrize("axes", AXES.values(), ids=list(AXES))
def test_a_cell_shows_the_worst_of_its_points(axes: tuple[np.ndarray, np.ndarray], tiles: tuple[int, int, int]) -> None:
    tree = result(*axes, tiles)
    view = MapView(FigureAxis("mesh_frequency", axes[0]), FigureAxis("epsilon", axes[1]), {"phasing": 1}, ())
    found, shown = grid.coarse(tree, view, "growth_rate", large=0)
    whole, reduced = tree["floquet"].isel(phasing=1), found["floquet"]
    assert "other" not in reduced
    for i, columns in enumerate(cells_of(axes[0])):
        for j, rows in enumerate(cells_of(axes[1])):
            cell, points = {"mesh_frequency": i, "epsilon": j}, {"mesh_frequency": columns, "epsilon": rows}
            stable = whole["stable"].isel(points).values
            expected = 0 if (stable == 0).any() else -1 if (stable < 0).any() else 1
            assert reduced["stable"].isel(cell).item() == expected
            growth = whole["growth_rate"].isel(points).values
            largest = np.nan if np.isnan(growth).all() else np.nanmax(growth)
            np.testing.assert_equal(reduced["growth_rate"].isel(cell).item(), largest)
            assert reduced["status"].isel(cell).item() == np.bitwise_or.reduce(
                whole["status"].isel(points).values, axis=None
            )
    # The frame stays as it is, and so does the spacing.
    for before, after in ((view.x, shown.x), (view.y, shown.y)):
        np.testing.assert_array_equal(after.ascending[[0, -1]], before.ascending[[0, -1]])
        assert (after.uniform, after.logarithmic) == (before.uniform, before.logarithmic)
    edges = found["boundaries"]["boundary_frequency"].sel(epsilon=float(axes[1].max()), method="nearest")
    at = int(np.argmax(axes[1]))
    np.testing.assert_array_equal(edges.values, tree["boundaries"]["boundary_frequency"].isel(epsilon=at).values)


def test_small_maps_are_drawn_as_they_are() -> None:
    tree = result(*AXES["even"], (64, 3, 45))
    view = MapView(FigureAxis("mesh_frequency", AXES["even"][0]), FigureAxis("epsilon", AXES["even"][1]), {}, ())
    assert grid.coarse(tree, view, "growth_rate") == (tree, view)


@pytest.mark.parametrize("kind", ["map", "slices"])
def test_a_large_map_shows_every_unstable_cell(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(grid.coarse, "__defaults__", (0,))
    x, y = AXES["even"]
    tree = result(x, y, (64, 1, 4))
    select: Mapping[str, str] = {"phasing": "0.2"} if kind == "map" else {}
    _, artists = draw(tree, kind, select=select)
    shown = artists["cells"] if kind == "map" else artists["panels"][1]["cells"]
    image = shown.get_array()
    unstable = tree["floquet"]["stable"].isel(phasing=1).values == 0
    expected = [[unstable[np.ix_(columns, rows)].any() for columns in cells_of(x)] for rows in cells_of(y)]
    assert not np.asarray(expected).all()
    # The image may repeat cells.
    steps = [n // CELLS for n in image.shape]
    np.testing.assert_array_equal(~np.ma.getmaskarray(image)[:: steps[0], :: steps[1]], expected)


MEMORY = """
import resource, sys
from gearstab.cli import main
try:
    main(sys.argv[1:])
finally:
    print("peak", resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere the unit is another")
def test_memory_does_not_grow_with_the_result(tmp_path: Path) -> None:
    config, out = tmp_path / "train.yaml", tmp_path / "map.h5"
    axes = "mesh_frequency: {start: 0.35, stop: 7, num: 8000}, epsilon: {start: 0, stop: 0.5, num: 4000}"
    config.write_text(TRAIN + f"sweep: {{{axes}}}\nmethods: {{floquet: {{}}}}\n")
    commands = [
        ["sweep", str(config), "-o", str(out), "-j", "2"],
        ["plot", str(out), "-o", str(tmp_path / "map.png")],
        ["plot", str(out), "-o", str(tmp_path / "curve.png"), "--select", "mesh_frequency=4"],
        ["export", str(out), "-o", str(tmp_path / "map.csv"), "--select", "mesh_frequency=4"],
    ]
    for words in commands:
        done = subprocess.run([sys.executable, "-c", MEMORY, *words], capture_output=True, text=True, check=False)
        peak = int(done.stdout.split("peak")[1]) * 1024
        # Growth rates alone take 256 MB, and a picture of all of them three GB.
        assert done.returncode == 0
        assert peak < 400e6, words[0]
