"""Results of ``gearstab design``: minima, verified; margins and sensitivities against computations of their own."""

from __future__ import annotations

import re
from fractions import Fraction
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scenes import TRAIN, opened, ran, read, refused, scene_text, succeeds, written

from gearstab.config import Config
from gearstab.design.judge import Judge
from gearstab.design.problem import DesignProblem
from gearstab.design.reasons import margins, sensitivities
from gearstab.design.regions import tongues, united
from gearstab.design.search import first, nondominated, thinned
from gearstab.errors import PlotError
from gearstab.floquet import solve
from gearstab.floquet.boundaries import boundaries
from gearstab.floquet.required_damping import required_damping
from gearstab.plots import draw
from gearstab.results import open_result
from gearstab.systems import build, section

RANGE = (4.8, 6.0)
FLOOR = 1e-6 * RANGE[1]
"""Regions narrower than this count as none."""
TWO = scene_text("design_two")


def width(c1: np.ndarray, h: np.ndarray) -> np.ndarray:
    """Unstable length of the range of Lin & Parker's train, from its matrices and the search for boundaries."""
    mesh = {"mean_stiffness": 1.0, "epsilon": 0.3, "contact_ratio": 1.5}
    meshes = [mesh | {"name": "first", "contact_ratio": c1}, mesh | {"name": "second", "phasing": h}]
    p = {"kind": "two_stage", "inertias": [1.0, 0.3, 4.0], "input_shaft_stiffness": 0.5, "tooth_ratio": Fraction(1)}
    found = boundaries(build(p | {"meshes": meshes}), *RANGE, 1e-11)
    return np.bincount(found.row, found.upper - found.lower, minlength=found.rows)


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of the design of a phasing and a contact ratio, by the command."""
    folder = tmp_path_factory.mktemp("two")
    done = succeeds("design", written(folder, TRAIN + TWO), "-o", folder / "out.h5")
    shown = ran("info", folder / "out.h5").stdout
    assert done.stdout.splitlines() == shown.splitlines()[1:-1]
    assert 5 <= len(done.stdout.splitlines()) <= 11
    return folder / "out.h5"


@pytest.fixture(scope="module")
def two(result: Path) -> xr.Dataset:
    """Contents of the result."""
    with xr.open_datatree(result, engine="h5netcdf") as tree:
        return tree["design"].to_dataset().load()


def test_the_rule_of_the_paper_comes_out(two: xr.Dataset) -> None:
    """Lin & Parker 2002, below (22): c1 - c2 + 2h = 1 where both meshes work against each other."""
    c1, h = two["optimum"].values
    assert c1 - 1.5 + 2 * h == pytest.approx(1.0, abs=0.01)
    assert "c1 - c2 + 2h = 1" in two.attrs["explanation"]
    assert "closes 2w3" in two.attrs["explanation"]


def test_the_optimum_is_a_minimum_of_its_neighbourhood(two: xr.Dataset) -> None:
    c1, h = two["optimum"].values
    best = width(np.array([c1]), np.array([h]))[0]
    assert float(two["objective_optimum"]) == pytest.approx(best, abs=FLOOR)
    assert float(two["objective_initial"]) == pytest.approx(width(np.array([1.5]), np.array([0.0]))[0], abs=1e-8)
    a, b = (part.ravel() for part in np.meshgrid(np.linspace(-0.05, 0.05, 17), np.linspace(-0.05, 0.05, 17)))
    around = width(np.clip(c1 + a, 1.2, 1.7), np.clip(h + b, 0.1, 0.9))
    assert around.min() >= best - FLOOR


def test_floquet_analysis_contradicts_nothing(two: xr.Dataset) -> None:
    assert two.attrs["verification_points"] == 2001
    assert two.attrs["verification_mismatches"] == 0


def test_margins_end_where_the_objective_is_degraded(two: xr.Dataset) -> None:
    design, low, high = (two[name].values for name in ("optimum", "lower_bound", "upper_bound"))
    best, start = float(two["objective_optimum"]), float(two["objective_initial"])
    most = 1.1 * best if best > 0 else 0.1 * start
    assert two.attrs["margin_objective"] == pytest.approx(most)
    for k in range(2):
        for sign, margin, bound in ((-1, "margin_lower", low), (1, "margin_upper", high)):
            room = float(two[margin][k])
            for part, degraded in ((0.999, False), (1.001, True)):
                moved = design.copy()
                moved[k] += sign * part * room
                if abs(room - abs(bound[k] - design[k])) > 1e-9:
                    value = width(moved[:1], moved[1:])[0]
                    assert (value > most * (1 - 1e-9)) == degraded, (k, margin)


def test_margins_of_a_phasing_go_on_at_the_other_bound(tmp_path: Path) -> None:
    """With c1 - c2 = 0.8 the region 2w3 closes at h = 0.1: from there down to 0.8 the bound 0 is nothing special."""
    found = []
    for low, high in ((0.0, 1.0), (-0.45, 0.5)):
        text = TWO.replace("[0.1, 0.9]", f"[{low}, {high}]")
        config = read(tmp_path, TRAIN + text, "meshes.second.contact_ratio=1.1")
        assert config.design is not None
        problem = DesignProblem(config, config.design)
        assert [variable.periodic for variable in problem.variables] == [False, high - low >= 1]
        judge, design = Judge(problem), np.array([1.7, 0.1])
        most = float(judge.worth(np.array([[1.7, low + (0.8 - low) % 1]])).objectives[0, 0])
        found.append(margins(problem, judge, first, design, most)[:, 1])
    # Upwards the bound of 0.5 comes first.
    assert found[1] == pytest.approx([found[0][0], 0.4], abs=1e-6)
    assert found[0][0] == pytest.approx(0.3, abs=1e-6)
    assert 0.4 < found[0][1] < 0.7


def test_figures_show_what_the_result_holds(result: Path, two: xr.Dataset) -> None:
    with open_result(result) as tree:
        _, found = draw(tree)
        assert len(found["lines"]) == 2
        assert found["lines"][1].get_ydata() == pytest.approx(two["speed_growth_rate"].values[:, 1])
        assert any("3" in name.get_text() for name in found["names"])
        _, found = draw(tree, "contour")
        assert [mark.get_xdata()[0] for mark in found["optimum"]] == [two["optimum"].values[0]]
        _, turned = draw(tree, "contour", x="meshes.second.phasing", y="meshes.first.contact_ratio")
        assert turned["optimum"][0].get_xdata()[0] == two["optimum"].values[1]
        _, found = draw(tree, "tornado")
        ends = sorted(bar.get_x() + bar.get_width() for bar in (*found["lower"], *found["higher"]))
        assert ends == pytest.approx(np.sort(two["step_objective"].values.ravel()))
        with pytest.raises(PlotError):
            draw(tree, "pareto")
        with pytest.raises(PlotError):
            draw(tree, "contour", x="epsilon")


def test_the_result_is_the_same_again(tmp_path: Path) -> None:
    text = TRAIN + TWO.replace("[0.1, 0.9]", "{values: [0.0, 0.25, 0.5]}").replace("[1.2, 1.7]", "{integers: [1, 2]}")
    found = []
    for k in range(2):
        succeeds("design", written(tmp_path, text), "-o", tmp_path / f"{k}.h5")
        with xr.open_datatree(tmp_path / f"{k}.h5", engine="h5netcdf") as tree:
            found.append(tree["design"].to_dataset().load())
    assert found[0].identical(found[1])
    # Everything stands in the table, the best first, and the objective there is that of a computation of its own.
    table = found[0]
    assert table.sizes["choice"] == 6
    objective = table["choice_objective"].values[:, 0]
    assert np.all(np.diff(objective) >= -1e-7)
    values = table["choice_value"].values
    assert objective == pytest.approx(width(values[:, 0], values[:, 1]), abs=1e-8)
    assert list(table["optimum"].values) == list(values[0])


@cache
def problem_of(folder: Path, text: str) -> tuple[Config, DesignProblem]:
    config = read(folder, TRAIN + text)
    assert config.design is not None
    return config, DesignProblem(config, config.design)


def test_the_objectives_slope_is_the_sum_of_the_edges(tmp_path: Path) -> None:
    _, problem = problem_of(tmp_path, TWO)
    design = np.array([1.4, 0.3])
    found = tongues(problem, [design])
    inside = found.distance[:, 0] == 0
    slope = (found.sensitivity[inside, 1, 0] - found.sensitivity[inside, 0, 0]).sum(axis=0)
    # Both are differences over steps of 5e-5 of edges that are right to 1e-10, from other points each.
    assert sensitivities(problem, Judge(problem), design)[0] == pytest.approx(slope, abs=1e-5)
    assert np.abs(slope).min() > 0.1


def test_a_worth_that_is_zero_is_told_apart_by_distance(tmp_path: Path) -> None:
    text = TWO.replace("[4.8, 6.0]", "[6.2, 6.4]")
    _, problem = problem_of(tmp_path, text)
    worth = Judge(problem).worth(np.array([[1.5, 0.5], [1.5, 0.9], [1.2, 0.1]]))
    assert np.all(worth.objectives == 0)
    scores = worth.score(lambda objectives: objectives[:, 0])
    assert len(set(scores)) == 3
    assert np.all(scores < 0)


def test_constraints_hold(tmp_path: Path) -> None:
    text = TWO.replace("[0.1, 0.9]", "{values: [0.0, 0.2, 0.4, 0.5]}").replace("[1.2, 1.7]", "{values: [1.3, 1.5]}")
    text += "  constraints: {required_damping: {max: 0.09}, meshes.first.contact_ratio: {min: 1.4}}\n"
    _, problem = problem_of(tmp_path, text)
    judge = Judge(problem)
    places = np.array([[a, b] for a in range(2) for b in range(4)], dtype=float)
    worth = judge.worth(places)
    # The second value of c1 alone, and phasings that need little damping: in phase 2w3 needs 0.09 and more.
    assert list(worth.violation > 0)[:4] == [True] * 4
    assert worth.violation[4] > 0
    assert worth.violation[7] == 0


def test_constraints_that_nothing_meets(tmp_path: Path) -> None:
    text = TWO.replace("[0.1, 0.9]", "{values: [0.0, 0.2]}").replace("[1.2, 1.7]", "{values: [1.3, 1.5]}")
    source = written(tmp_path, TRAIN + text + "  constraints: {growth_rate: {max: 1.0e-6}}\n")
    said = refused("design", source, "-o", tmp_path / "out.h5", "-q")
    assert said.startswith(f"{source}:")
    assert "design.constraints" in said
    assert not (tmp_path / "out.h5").exists()


def test_fronts_hold_what_nothing_dominates() -> None:
    objectives = np.array([[1.0, 5.0], [2.0, 3.0], [2.0, 3.0], [3.0, 4.0], [4.0, 1.0], [0.5, 6.0], [4.0, 2.0]])
    kept = nondominated(objectives)
    assert sorted(map(tuple, objectives[kept])) == [(0.5, 6.0), (1.0, 5.0), (2.0, 3.0), (4.0, 1.0)]
    designs = np.arange(len(objectives), dtype=float)[:, None]
    assert list(thinned(designs[kept], objectives[kept])[:, 0]) == [5, 0, 1, 4]


def test_a_pareto_front_by_the_command(tmp_path: Path) -> None:
    text = TWO.replace("[0.1, 0.9]", "{values: [0, 0.2, 0.4, 0.5, 0.7]}").replace("[1.2, 1.7]", "{values: [1.2, 1.5]}")
    text = text.replace("instability_width", "[instability_width, growth_rate]").replace("[4.8, 6.0]", "[2.5, 6.0]")
    succeeds("design", written(tmp_path, TRAIN + text), "-o", tmp_path / "front.h5")
    with xr.open_datatree(tmp_path / "front.h5", engine="h5netcdf") as tree:
        result = tree["design"].to_dataset().load()
        _, artists = draw(tree)
    assert len(artists["fronts"][0].get_xdata()) == result.sizes["design"]
    everything, front = result["choice_objective"].values, result["design_objective"].values
    assert len(everything) == 10
    for row in everything:
        better = np.all(front <= row, axis=1)
        assert better.any()
    assert result["objective_optimum"].dims == ("objective",)


def test_three_objectives(tmp_path: Path) -> None:
    """A front that is a surface: every pair of objectives, designs without a line between them."""
    text = TWO.replace("[0.1, 0.9]", "{values: [0, 0.4, 0.5]}").replace("[1.2, 1.7]", "{values: [1.2, 1.5]}")
    text = text.replace("instability_width", "[instability_width, growth_rate, required_damping]")
    succeeds("design", written(tmp_path, TRAIN + text), "-o", tmp_path / "front.h5")
    with xr.open_datatree(tmp_path / "front.h5", engine="h5netcdf") as tree:
        front, every = (tree["design"][name].values for name in ("design_objective", "choice_objective"))
        _, artists = draw(tree)
    assert every.shape == (6, 3)
    assert all(np.any(np.all(front <= row, axis=1)) for row in every)
    assert [line.get_linestyle() for line in artists["fronts"]] == ["None"] * 3
    assert all(len(line.get_xdata()) == len(front) for line in artists["fronts"])


@pytest.mark.parametrize(
    ("speeds", "unit", "one"),
    [
        ('input_speed: ["12000 rpm", "24000 rpm"]', "input speed {} rpm", 20 * 2 * np.pi / 60),
        ("input_speed: [1256.6, 2513.3]", "input speed {} rpm", 20 * 2 * np.pi / 60),
        ('mesh_frequency: ["4 kHz", "8 kHz"]', "mesh frequency {} kHz", 2000 * np.pi),
        ("mesh_frequency: [25133, 50265]", "mesh frequency {} rad/s", 1.0),
    ],
)
def test_regions_are_told_in_the_speed_of_the_range(speeds: str, unit: str, one: float, tmp_path: Path) -> None:
    """Edges of the result are mesh frequencies, 20 times the speed of a pinion of 20 teeth; units are those typed."""
    text = """
system:
  kind: gearbox
  gears: {module: "2 mm", pressure_angle: "20 deg", face_width: "20 mm"}
  rotors: [{name: motor, inertia: 0.01}, {name: pinion, teeth: 20}, {name: wheel, teeth: 60}]
  shafts: [{name: input, between: [motor, pinion], stiffness: 1.0e4}]
  meshes: [{name: first, gears: [pinion, wheel]}]
  input: {rotor: motor, torque: 20.0}
  outputs: [{rotor: wheel}]
design:
  range: {SPEEDS}
  variables: {rotors.motor.inertia: {values: [0.01, 0.02]}}
  minimise: instability_width
""".replace("SPEEDS", speeds)
    done = succeeds("design", written(tmp_path, text), "-o", tmp_path / "out.h5", "-q")
    found = re.search(r"(\S+), " + unit.format(r"(\S+) to (\S+)"), done.stdout)
    assert found
    with xr.open_datatree(tmp_path / "out.h5", engine="h5netcdf") as tree:
        result = tree["design"].to_dataset().load()
    k = list(result["label"].values).index(found[1])
    edges = result["region_frequency"].values[k, :, 1] / one
    assert [float(found[2]), float(found[3])] == pytest.approx(edges, rel=1e-5)


def test_growth_rates_are_the_largest_of_a_fine_raster(tmp_path: Path) -> None:
    _, problem = problem_of(tmp_path, TWO.replace("instability_width", "growth_rate").replace("[4.8", "[0.8"))
    rows = np.array([[1.5, 0.2], [1.3, 0.6]])
    found = Judge(problem).worth(rows).objectives[:, 0]
    for (c1, h), value in zip(rows, found, strict=True):
        p = problem.systems(np.array([[c1, h]]))
        raster = solve(build(p), np.linspace(0.8, 6.0, 20001)).growth_rate.max()
        assert raster <= value * (1 + 1e-6)
        assert value == pytest.approx(raster, rel=1e-3)


def test_intervals_are_united() -> None:
    nan = np.nan
    found = united(np.array([[3.0, 1.0, 1.5, nan, 1.2]]), np.array([[4.0, 2.0, 3.2, nan, 1.3]]))
    assert found.width(0.0, 10.0) == pytest.approx([3.0])
    assert found.width(1.8, 3.5) == pytest.approx([1.7])
    assert found.distance(5.0, 6.0) == pytest.approx([1.0])


@pytest.mark.parametrize(
    ("sun", "planet", "ring", "count", "fits"),
    [
        (24, 24, 72, 4, True),
        (24, 24, 71, 4, False),
        (23, 24, 71, 4, False),
        (20, 60, 140, 5, False),
        (20, 22, 64, 3, True),
    ],
)
def test_planets_that_can_be_assembled(sun: int, planet: int, ring: int, count: int, fits: bool) -> None:
    teeth = {"sun": sun, "planet": planet, "ring": ring}
    assert section({"kind": "planetary", "planets": count, "teeth": teeth}).assembled() == fits


WHIRLING = scene_text("design_whirling")


def test_a_system_that_whirls_is_judged_at_its_speeds(tmp_path: Path) -> None:
    """Against the part of the range that a raster of exact growth rates finds unstable."""
    config = read(tmp_path, WHIRLING)
    assert config.design is not None
    problem = DesignProblem(config, config.design)
    found = Judge(problem).worth(np.arange(3.0)[:, None]).objectives[:, 0]
    omega = np.linspace(2.0, 4.5, 20001)
    raster = []
    for ratio in (1.15, 1.3, 1.5):
        system = build(read(tmp_path, WHIRLING.replace("contact_ratio: 1.4", f"contact_ratio: {ratio}")).system)
        raster.append(2.5 * float((solve(system, omega).growth_rate[0] > 0).mean()))
    assert np.ptp(raster) > 0.1
    # Every edge lies between two points of the raster; there are fewer than ten.
    assert found == pytest.approx(raster, abs=10 * (omega[1] - omega[0]))


def test_a_system_that_whirls_has_a_best_design(tmp_path: Path) -> None:
    path = written(tmp_path, WHIRLING)
    succeeds("design", path, "-o", tmp_path / "design.h5")
    table = opened(tmp_path / "design.h5")["design"].to_dataset()
    assert float(table["objective_optimum"]) == pytest.approx(float(table["choice_objective"].min()), abs=1e-12)


@pytest.mark.parametrize("circulatory", [0.0, 0.02])
def test_the_damping_that_a_system_that_whirls_requires(tmp_path: Path, circulatory: float) -> None:
    """Against a raster; with a circulatory matrix some is required at every speed."""
    turning = f"circulatory: [[0, {circulatory}], [-{circulatory}, 0]], gyroscopic"
    text = WHIRLING.replace("instability_width", "required_damping").replace("gyroscopic", turning)
    config = read(tmp_path, text)
    assert config.design is not None
    found = Judge(DesignProblem(config, config.design)).worth(np.arange(3.0)[:, None]).objectives[:, 0]
    omega = np.linspace(2.0, 4.5, 4001)
    for value, ratio in zip(found, (1.15, 1.3, 1.5), strict=True):
        system = build(read(tmp_path, text.replace("contact_ratio: 1.4", f"contact_ratio: {ratio}")).system)
        raster = required_damping(system, omega).value[0]
        assert (raster.min() > 0) == (circulatory > 0)
        # The square root of a distance of half a step, relative to the width of a region, is missed at most.
        assert value >= raster.max() * (1 - 1e-6)
        assert value == pytest.approx(raster.max(), rel=1e-4)
