"""Results of sweeps: dimensions as configured, values of every point as if it were computed alone."""

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scenes import TRAIN, opened, plain, scene_text, written

from gearstab.config import Assignment, Axis, load
from gearstab.floquet import solve
from gearstab.floquet.boundaries import boundaries
from gearstab.perturbation import first_order
from gearstab.sweep import Plan, plan, run
from gearstab.sweep.plan import chunk_shape
from gearstab.systems import build

Make = Callable[..., Plan]


@pytest.fixture
def make(tmp_path: Path) -> Make:
    """A plan from the text of ``sweep`` and ``methods``; ``wanted``: points of a block."""

    def from_text(text: str, *overrides: str) -> Plan:
        path = written(tmp_path, TRAIN + text, "train.yaml")
        return plan(load(path, overrides))

    return from_text


def divided(whole: Plan, points: int) -> Plan:
    """The same plan in blocks of at most so many points."""
    layouts = []
    for layout in whole.layouts:
        inner = layout.dims.index(whole.fast.name) if whole.fast and whole.fast.name in layout.dims else None
        layouts.append(replace(layout, chunk=chunk_shape(layout.shape, inner, points)))
    return replace(whole, layouts=tuple(layouts))


def computed(planned: Plan, folder: Path, name: str = "r") -> xr.DataTree:
    run(planned, folder / f"{name}.h5", jobs=1)
    return opened(folder / f"{name}.h5")


CASES = scene_text("sweep_cases")


def at(planned: Plan, phasing: float, epsilon: float, contact_ratio: float, stiffness: float) -> dict:
    """The parameters of a point of CASES, put together by hand."""
    parameters = plain(planned.config.system)
    first, second = (dict(mesh) for mesh in parameters["meshes"])
    first["epsilon"], second["contact_ratio"], second["phasing"] = epsilon, contact_ratio, phasing
    return parameters | {"meshes": [first, second], "input_shaft_stiffness": stiffness}


@pytest.fixture(scope="module")
def cases(tmp_path_factory: pytest.TempPathFactory) -> tuple[Plan, xr.DataTree]:
    folder = tmp_path_factory.mktemp("cases")
    (folder / "train.yaml").write_text(TRAIN + CASES)
    planned = divided(plan(load(folder / "train.yaml")), 8)
    return planned, computed(planned, folder)


def test_dimensions_are_named_and_ordered_as_the_sweep(cases: tuple[Plan, xr.DataTree]) -> None:
    _, tree = cases
    axes = ("phasing", "mesh_frequency", "case", "input_shaft_stiffness")
    rows = ("phasing", "case", "input_shaft_stiffness")
    assert tree["floquet"]["growth_rate"].dims == axes
    assert tree["floquet"]["exponent_real"].dims == (*axes, "exponent")
    assert tree["floquet"]["exponent_real"].shape == (2, 7, 2, 3, 6)
    for group in ("perturbation", "boundaries"):
        assert tree[group]["boundary_frequency"].dims == ("tongue", "side", *rows)
    assert tree["boundaries"]["contacts"].dims == rows
    assert list(tree["side"].values if "side" in tree else tree["boundaries"]["side"].values) == ["lower", "upper"]


def test_cases_have_labels_and_the_values_they_set(cases: tuple[Plan, xr.DataTree]) -> None:
    _, tree = cases
    unequal = tree["floquet"]["growth_rate"].sel(case="unequal")
    assert float(unequal["meshes.first.epsilon"]) == 0.4
    assert float(unequal["meshes.second.contact_ratio"]) == 1.8
    assert list(tree["case"].values) == ["equal", "unequal"]


@pytest.mark.parametrize("point", [(0, 0, 0), (0, 1, 2), (1, 0, 1), (1, 1, 0)])
def test_rows_are_those_of_single_systems(cases: tuple[Plan, xr.DataTree], point: tuple[int, int, int]) -> None:
    planned, tree = cases
    i, j, k = point
    epsilon, contact_ratio = [(0.2, 1.5), (0.4, 1.8)][j]
    system = build(at(planned, [0.0, 0.3][i], epsilon, contact_ratio, [0.5, 0.7, 0.9][k]))
    omega = np.linspace(0.6, 6.5, 7)
    alone = solve(system, omega, exponents=True)
    data = tree["floquet"].to_dataset().isel(phasing=i, case=j, input_shaft_stiffness=k)
    # The same operations on stacks of another shape: BLAS may sum in another order, hence not to the last bit.
    np.testing.assert_allclose(data["growth_rate"].values, alone.growth_rate[0], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(data["stable"].values, alone.stable[0])
    assert alone.exponents is not None
    np.testing.assert_allclose(data["exponent_real"].values, alone.exponents[0].real, rtol=0, atol=1e-10)
    tongues = first_order(system, 2)
    row = tree["perturbation"].to_dataset().isel(phasing=i, case=j, input_shaft_stiffness=k)
    assert tuple(row["label"].values) == tongues.label
    np.testing.assert_allclose(row["boundary_frequency"].values, tongues.boundary_frequency, rtol=1e-12)
    edges = boundaries(system, 0.6, 6.5, 1e-6, 1e-3)
    exact = tree["boundaries"].to_dataset().isel(phasing=i, case=j, input_shaft_stiffness=k)
    found = exact["boundary_frequency"].values
    found = found[np.isfinite(found[:, 0])]
    np.testing.assert_allclose(np.sort(found[:, 0]), np.sort(edges.lower), rtol=2e-6)
    np.testing.assert_allclose(np.sort(found[:, 1]), np.sort(edges.upper), rtol=2e-6)


def test_an_absorbed_tongue_points_to_the_one_that_holds_its_region(cases: tuple[Plan, xr.DataTree]) -> None:
    _, tree = cases
    data = tree["boundaries"].to_dataset().stack(row=("phasing", "case", "input_shaft_stiffness"))
    names = data["status"].attrs["flag_meanings"].split()
    absorbed = dict(zip(names, data["status"].attrs["flag_masks"], strict=True))["absorbed"]
    status, holder, edges = (data[name].values for name in ("status", "holder", "boundary_frequency"))
    tongues, rows = np.nonzero(holder >= 0)
    assert len(tongues)
    for tongue, row in zip(tongues, rows, strict=True):
        lower = edges[holder[tongue, row], 0, row]
        assert np.isfinite(lower)
        if status[tongue, row] & absorbed:
            assert holder[tongue, row] != tongue
            assert np.isnan(edges[tongue, 0, row])
        else:
            assert holder[tongue, row] == tongue


@pytest.mark.parametrize("points", [1, 5, 1000])
def test_the_division_does_not_matter(make: Make, cases: tuple[Plan, xr.DataTree], tmp_path: Path, points: int) -> None:
    _, tree = cases
    text = CASES[: CASES.index("  boundaries")]
    other = computed(divided(make(text), points), tmp_path)
    for group in ("floquet", "perturbation"):
        for name, values in other[group].data_vars.items():
            np.testing.assert_allclose(values, tree[group][name], rtol=1e-12, atol=1e-10, err_msg=str(name))


RATIOS = scene_text("sweep_ratios")


@pytest.mark.parametrize("points", [1, 1000])
def test_systems_of_different_structure_have_their_own_tongues(make: Make, tmp_path: Path, points: int) -> None:
    planned = divided(make(RATIOS), points)
    tree = computed(planned, tmp_path)
    data = tree["perturbation"].to_dataset()
    assert list(data["tooth_ratio"].values) == ["1", "1/2", "3/5"]
    for name in ("1", "1/2", "3/5"):
        system = build(plain(planned.config.system) | {"tooth_ratio": Fraction(name)})
        tongues = first_order(system, 2)
        alone = dict(zip(((t.label, t.frequency_ratio) for t in tongues.index), tongues.center_frequency, strict=True))
        row = data["center_frequency"].sel(tooth_ratio=name, epsilon=0.2)
        row = row[np.isfinite(row.values)]
        found = dict(zip(zip(row["label"].values, row["frequency_ratio"].values, strict=True), row.values, strict=True))
        assert {(str(label), float(ratio)) for label, ratio in found} == set(alone)
        assert all(found[key] == pytest.approx(alone[key], rel=1e-12) for key in found)
        # epsilon of both meshes is 0.2 on the axis and 0.3 in the base system.
        growth = solve(_with_epsilon(system, 0.2), np.linspace(1, 6, 5)).growth_rate[0]
        swept = tree["floquet"]["growth_rate"].sel(tooth_ratio=name, epsilon=0.2).values
        np.testing.assert_allclose(swept, growth, rtol=0, atol=1e-12)
    assert data.sizes["tongue"] > len(first_order(build(planned.config.system), 2).index)


def _with_epsilon(system, epsilon: float):
    return replace(system, meshes=tuple(replace(mesh, epsilon=np.asarray(epsilon)) for mesh in system.meshes))


def test_rows_may_have_their_own_mesh_frequency(make: Make, tmp_path: Path) -> None:
    text = "sweep: {epsilon: [0.1, 0.3], mesh_frequency: [2.0, 4.2, 5.4]}\nmethods: {floquet: {}}\n"
    config = make(text).config
    frequency = Assignment(("mesh_frequency",), np.array([2.0, 5.4]), name="mesh_frequency")
    stiffness = Assignment(("input_shaft_stiffness",), np.array([0.5, 0.8]), name="input_shaft_stiffness")
    case = Axis("case", 2, ["slow", "fast"], "1", "case", (frequency, stiffness))
    tree = computed(plan(replace(config, axes=(case, config.axes[0]))), tmp_path)
    assert tree["floquet"]["growth_rate"].dims == ("case", "epsilon")
    assert tree["floquet"]["growth_rate"].sel(case="fast")["mesh_frequency"] == 5.4
    system = build(plain(config.system) | {"input_shaft_stiffness": 0.8})
    alone = solve(_with_epsilon(system, 0.3), np.array([5.4])).growth_rate[0, 0]
    assert alone > 0.1
    assert float(tree["floquet"]["growth_rate"].sel(case="fast", epsilon=0.3)) == pytest.approx(alone, rel=1e-12)


def test_nothing_but_the_mesh_frequency_may_differ_from_row_to_row(make: Make, tmp_path: Path) -> None:
    config = make("sweep: {mesh_frequency: [2.0, 5.4]}\nmethods: {floquet: {}}\n").config
    axis = config.axes[0]
    both = replace(axis, assignments=(*axis.assignments, Assignment(("damping_ratio",), np.zeros(2))))
    one = computed(plan(replace(config, axes=(both,))), tmp_path, "one")
    two = computed(plan(config), tmp_path, "two")
    np.testing.assert_allclose(one["floquet"]["growth_rate"], two["floquet"]["growth_rate"], rtol=1e-12, atol=1e-13)


def test_a_parameter_without_effect_still_is_an_axis(make: Make, tmp_path: Path) -> None:
    sweep = "sweep: {damping_ratio: [0.0, 0.0, 0.0], mesh_frequency: [2.0, 5.4]}\n"
    tree = computed(make(sweep + "methods: {floquet: {}, perturbation: {}}\n"), tmp_path)
    growth = tree["floquet"]["growth_rate"]
    assert growth.shape == (3, 2)
    np.testing.assert_allclose(growth[0], growth[2], rtol=1e-12, atol=1e-13)
    assert tree["perturbation"]["half_width"].sizes["damping_ratio"] == 3


def test_the_mesh_frequency_alone(make: Make, tmp_path: Path) -> None:
    sweep = "sweep: {mesh_frequency: {start: 5.0, stop: 6.0, num: 11}}\n"
    tree = computed(make(sweep + "methods: {floquet: {}, perturbation: {}, boundaries: {}}\n"), tmp_path)
    edges = tree["boundaries"]["boundary_frequency"]
    assert edges.dims == ("tongue", "side")
    widest = edges[int(np.nanargmax(edges[:, 1] - edges[:, 0]))].values
    omega = tree["floquet"]["mesh_frequency"].values
    inside = (omega > widest[0]) & (omega < widest[1])
    assert np.all(tree["floquet"]["stable"].values[inside] == 0)
    assert inside.any()


@pytest.mark.parametrize("points", ["num: 1", "num: 3, spacing: log", "step: 0.7"])
def test_boundaries_over_the_whole_range_of_an_axis(make: Make, tmp_path: Path, points: str) -> None:
    """However many points the axis has, and wherever they lie."""
    sweep = f"sweep: {{mesh_frequency: {{start: 5.0, stop: 6.0, {points}}}}}\n"
    tree = computed(make(sweep + "methods: {boundaries: {tolerance: 1.0e-6}}\n"), tmp_path)
    plain = "sweep: {mesh_frequency: [6.0, 5.0]}\n"
    two = computed(make(plain + "methods: {boundaries: {tolerance: 1.0e-6}}\n"), tmp_path, "two")
    edges = tree["boundaries"]["boundary_frequency"]
    assert np.isfinite(edges).any()
    np.testing.assert_allclose(edges, two["boundaries"]["boundary_frequency"], rtol=1e-12)


def test_a_result_says_where_it_comes_from(cases: tuple[Plan, xr.DataTree], tmp_path: Path) -> None:
    planned, tree = cases
    again = written(tmp_path, tree.attrs["config"], "again.yaml")
    assert load(again).digest == planned.config.digest == tree.attrs["config_digest"]
    assert tree.attrs["kernel"] == "c"
    assert tree.attrs["Conventions"] == "CF-1.11"
    assert tree["perturbation"].attrs["harmonics"] == 2
    assert tree["boundaries"].attrs["width_floor"] == 1e-3


def test_modes_are_those_of_the_base_system(cases: tuple[Plan, xr.DataTree]) -> None:
    planned, tree = cases
    modes = tree["modes"].to_dataset()
    phi, system = modes["mode_shape"].values, planned.base
    np.testing.assert_allclose(phi @ system.mass @ phi.T, np.eye(3), atol=1e-13)
    stiffness = phi @ system.mean_stiffness_matrix() @ phi.T
    np.testing.assert_allclose(stiffness, np.diag(modes["natural_frequency"].values ** 2), atol=1e-13)
    deflection = phi @ np.array([mesh.direction for mesh in system.meshes]).T
    np.testing.assert_allclose(modes["mesh_deflection"].values, deflection, atol=1e-13)
    assert list(modes["mesh"].values) == ["first", "second"]
    assert set(modes["mode_type"].values) == {"elastic"}
