"""Axes: every form of values, what names stand for, and the parameters at points of the grid."""

from fractions import Fraction
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from scenes import plain, read, scene_text, table

from gearstab.config import Axis, Config
from gearstab.systems import build

TRAIN = scene_text("config_axes_train")

MATRICES = scene_text("config_axes_matrices")

shared = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)


def axis(folder: Path, line: str, base: str = TRAIN) -> Axis:
    return read(folder, f"{base}sweep:\n  {line}\n").axes[0]


def paths(found: Axis) -> set[tuple[str | int, ...]]:
    return {a.path for a in found.assignments}


numbers = st.floats(-1e6, 1e6, allow_subnormal=False)


@shared
@given(start=numbers, stop=numbers, num=st.integers(1, 300))
@example(start=721028.1782383994, stop=-368640.0, num=252)
def test_range_by_number(tmp_path: Path, start: float, stop: float, num: int) -> None:
    found = axis(tmp_path, f"phasing: {{start: {start!r}, stop: {stop!r}, num: {num}}}")
    assert found.size == num == len(found.values)
    assert found.values[0] == start
    if num > 1:
        assert found.values[-1] == stop
        exact = [Fraction(start) + (Fraction(stop) - Fraction(start)) * i / (num - 1) for i in range(num)]
        # Each rounded once: difference, step and its multiple, relative to the range, and the sum to the larger end.
        error = 2**-53 * (3 * abs(stop - start) + max(abs(start), abs(stop))) * (1 + 1e-15) + 1e-300
        assert all(abs(Fraction(float(v)) - e) <= error for v, e in zip(found.values, exact, strict=True))


@shared
@given(first=st.integers(-500, 500), count=st.integers(0, 400), digits=st.integers(0, 6), up=st.booleans())
def test_range_by_step_hits_an_end_that_decimal_numbers_hit(
    tmp_path: Path, first: int, count: int, digits: int, up: bool
) -> None:
    unit = Fraction(1, 10**digits)
    step = unit if up else -unit
    start, stop = first * unit, first * unit + count * step
    spec = f"{{start: {float(start)!r}, stop: {float(stop)!r}, step: {float(step)!r}}}"
    found = axis(tmp_path, f"phasing: {spec}")
    assert found.size == count + 1
    assert found.values[-1] == float(stop)
    # start + i step in doubles: the step carries a relative rounding of 1.1e-16, the product and the sum one each.
    exact = np.array([float(start + i * step) for i in range(count + 1)])
    np.testing.assert_allclose(found.values, exact, rtol=0, atol=5e-16 * (np.max(np.abs(exact)) + count * float(unit)))


@shared
@given(step=st.floats(0.01, 0.5), length=st.floats(0.05, 3))
def test_range_by_step_never_passes_the_end(tmp_path: Path, step: float, length: float) -> None:
    found = axis(tmp_path, f"phasing: {{start: 1, stop: {1 + length!r}, step: {step!r}}}")
    assert found.values[0] == 1
    assert found.values[-1] <= 1 + length
    assert 1 + length - found.values[-1] < step
    assert np.all(np.diff(found.values) > 0)


@shared
@given(start=st.floats(1e-6, 1e6), stop=st.floats(1e-6, 1e6), num=st.integers(2, 100))
def test_log_range(tmp_path: Path, start: float, stop: float, num: int) -> None:
    found = axis(tmp_path, f"input_shaft_stiffness: {{start: {start!r}, stop: {stop!r}, num: {num}, spacing: log}}")
    assert (found.values[0], found.values[-1]) == (start, stop)
    ratios = found.values[1:] / found.values[:-1]
    # Powers carry a few roundings each.
    np.testing.assert_allclose(ratios, (stop / start) ** (1 / (num - 1)), rtol=1e-12)


def test_list_and_single_number(tmp_path: Path) -> None:
    assert axis(tmp_path, "phasing: [0.5, 0, 1e-2]").values.tolist() == [0.5, 0.0, 0.01]
    assert axis(tmp_path, "phasing: 0.25").values.tolist() == [0.25]


def test_large_range_costs_no_python_loop(tmp_path: Path) -> None:
    found = axis(tmp_path, "mesh_frequency: {start: 1, stop: 2, num: 3e6}")
    assert found.size == 3_000_000
    assert found.values[1] - found.values[0] == pytest.approx(1 / 2_999_999)


AXES = [pytest.param(scene["scene"], row, id=row["line"]) for scene in table("axes")["scene"] for row in scene["axes"]]


@pytest.mark.parametrize(("scene", "row"), AXES)
def test_what_an_axis_stands_for(tmp_path: Path, scene: str, row: dict[str, Any]) -> None:
    base = scene_text(scene).replace("  meshes:", "  allow_negative_stiffness: true\n  meshes:")
    found = axis(tmp_path, row["line"], base)
    places = [".".join(map(str, path)) for path in paths(found)]
    told = {"paths": sorted(places), "units": found.units, "words": found.long_name, "typed": found.typed_units}
    assert {name: told[name] for name in row.keys() & told.keys()} == {n: v for n, v in row.items() if n != "line"}


def test_damping_along_axes(tmp_path: Path) -> None:
    base = MATRICES.replace("  meshes:", "  damping: [[1, 0.5, 0], [0.5, 1, 2], [0, 2, 1]]\n  meshes:")
    symmetric = axis(tmp_path, "damping.0.1: [0, 1]", base)
    assert paths(symmetric) == {("damping", "matrix", 0, 1), ("damping", "matrix", 1, 0)}
    mirrored = {("damping", "matrix", 1, 2), ("damping", "matrix", 2, 1)}
    assert paths(axis(tmp_path, "damping.matrix.1.2: [0, 1]", base)) == mirrored
    for form, name in (("rayleigh: [0, 0]", "damping.rayleigh.1"), ("modal: [0, 0, 0]", "damping.modal.2")):
        base = TRAIN.replace("  meshes:", f"  damping: {{{form}}}\n  meshes:")
        assert paths(axis(tmp_path, f"{name}: [0, 1]", base)) == {("damping", *_parts(name.split(".")[1:]))}


def _parts(keys: list[str]) -> list[str | int]:
    return [int(key) if key.isdigit() else key for key in keys]


def test_exact_ratios_make_a_list(tmp_path: Path) -> None:
    found = axis(tmp_path, 'tooth_ratio: [1, 0.6, "17/7"]')
    assert found.values == ["1", "3/5", "17/7"]
    assert found.assignments[0].values == [Fraction(1), Fraction(3, 5), Fraction(17, 7)]
    assert found.assignments[0].structural


def test_a_mesh_that_gives_an_amplitude_has_no_epsilon(tmp_path: Path) -> None:
    base = TRAIN.replace("epsilon: 0.2", "amplitude: 0.2")
    assert paths(axis(tmp_path, "epsilon: [0.1]", base)) == {("meshes", 0, "epsilon")}
    assert paths(axis(tmp_path, "amplitude: [0.1]", base)) == {("meshes", 1, "amplitude")}


def test_tied_axes(tmp_path: Path) -> None:
    found = axis(tmp_path, "both: {targets: [inertias.0, inertias.2], values: [1, 2, 3]}")
    assert [(a.path, a.values.tolist()) for a in found.assignments] == [
        (("inertias", 0), [1, 2, 3]),
        (("inertias", 2), [1, 2, 3]),
    ]
    assert (found.units, found.values.tolist()) == ("kg", [1, 2, 3])
    ranged = axis(tmp_path, "both: {targets: [epsilon, damping_ratio], start: 0, stop: 0.2, num: 3}")
    assert {a.path for a in ranged.assignments} == {
        ("meshes", 0, "epsilon"),
        ("meshes", 1, "epsilon"),
        ("damping_ratio",),
    }
    own = axis(tmp_path, "c: {targets: [inertias.0, phasing], values: [[1, 2], {start: 0.5, stop: 0, num: 2}]}")
    assert [a.values.tolist() for a in own.assignments] == [[1, 2], [0.5, 0]]
    assert own.units == "1"


def test_case_axes(tmp_path: Path) -> None:
    text = "case: [{label: worst, meshes.first.contact_ratio: 1.2, phasing: 0}, {label: 2, epsilon: 0.1}]"
    found = axis(tmp_path, text)
    assert (found.values, found.size) == (["worst", "2"], 2)
    # A case that does not set what another sets keeps its base value.
    assert {a.path: a.values.tolist() for a in found.assignments} == {
        ("meshes", 0, "contact_ratio"): [1.2, 1.5],
        ("meshes", 1, "phasing"): [0.0, 0.1],
        ("meshes", 0, "epsilon"): [0.3, 0.1],
        ("meshes", 1, "epsilon"): [0.2, 0.1],
    }
    assert axis(tmp_path, "case: [{phasing: 0.5, epsilon: 0.1}]").values == ["phasing = 0.5, epsilon = 0.1"]


def test_cases_name_a_parameter_in_different_spellings(tmp_path: Path) -> None:
    text = (
        "case: [{label: worst, meshes.first.contact_ratio: 1.4, phasing: 0}, {label: better, contact_ratio: 1.3, "
        "meshes.second.phasing: 0.5}, {label: base, meshes.1.contact_ratio: 1.2}]"
    )
    found = axis(tmp_path, text)
    assert {a.path: a.values.tolist() for a in found.assignments} == {
        ("meshes", 0, "contact_ratio"): [1.4, 1.3, 1.5],
        ("meshes", 1, "contact_ratio"): [1.6, 1.3, 1.2],
        ("meshes", 1, "phasing"): [0.0, 0.5, 0.1],
    }
    assert len(found.assignments) == 3
    config = read(tmp_path, f"{TRAIN}sweep:\n  {text}\n")
    assert config.tree["sweep"]["case"] == [
        {"label": "worst", "meshes.first.contact_ratio": 1.4, "phasing": 0.0},
        {"label": "better", "contact_ratio": 1.3, "meshes.second.phasing": 0.5},
        {"label": "base", "meshes.1.contact_ratio": 1.2},
    ]
    assert read(tmp_path, config.resolved).digest == config.digest
    entries = axis(tmp_path, "case: [{label: a, mass.0.1: 0.2}, {label: b, mass.1.0: 0.3}]", MATRICES)
    assert {a.path: a.values.tolist() for a in entries.assignments} == {
        ("mass", 0, 1): [0.2, 0.3],
        ("mass", 1, 0): [0.2, 0.3],
    }


@pytest.mark.parametrize(
    ("base", "name", "value", "default"),
    [
        (TRAIN, "damping_ratio", 0.01, 0),
        (TRAIN.replace(", phasing: 0.1", ""), "phasing", 0.5, 0),
        (TRAIN, "meshes.first.damping", 0.2, 0),
        (TRAIN.replace("  tooth_ratio: 1\n", ""), "tooth_ratio", "3/5", 1),
        (MATRICES.replace("lag: 0.25, ", ""), "lag", 0.5, 0),
        (MATRICES.replace(', frequency_ratio: "1/2"', ""), "meshes.mesh2.frequency_ratio", "1/2", 1),
    ],
)
def test_cases_that_do_not_set_a_number_keep_its_default(
    tmp_path: Path, base: str, name: str, value: Any, default: float
) -> None:
    config = read(tmp_path, f"{base}sweep:\n  case: [{{label: a, {name}: {value}}}, {{label: b, epsilon: 0.1}}]\n")
    item = config.axes[0].assignments[0]
    assert item.path[-1] == name.rsplit(".", maxsplit=1)[-1]
    assert list(item.values) == [Fraction(value) if item.structural else value, default]
    again = read(tmp_path, config.resolved)
    assert list(again.axes[0].assignments[0].values) == list(item.values)
    assert again.digest == config.digest


def test_units_along_axes(tmp_path: Path) -> None:
    found = axis(tmp_path, 'mesh_frequency: {start: "60 rpm", stop: "2 Hz", num: 2}')
    np.testing.assert_allclose(found.values, [2 * np.pi, 4 * np.pi], rtol=1e-15)
    assert axis(tmp_path, 'input_shaft_stiffness: ["1 N/mm", 5]').values.tolist() == [1000.0, 5.0]
    stepped = axis(tmp_path, 'inertias.0: {start: "1 kg", stop: 2, step: "250 g"}')
    assert stepped.values.tolist() == [1, 1.25, 1.5, 1.75, 2]


def test_parameters_of_cases_know_the_unit_that_was_typed(tmp_path: Path) -> None:
    found = axis(tmp_path, 'case: [{label: slow, mesh_frequency: "60 rpm"}, {label: fast, mesh_frequency: "90 rpm"}]')
    assert found.mesh_frequency is not None
    assert found.mesh_frequency.typed_units == "rpm"


def test_base_values_come_from_the_axes(tmp_path: Path) -> None:
    text = TRAIN.replace("epsilon: 0.3, contact_ratio: 1.5", "").replace(", phasing: 0.1", "")
    sweep = "sweep:\n  epsilon: [0.1, 0.4]\n  contact_ratio: {start: 1.2, stop: 1.4, num: 3}\n  phasing: [0.3]\n"
    first, second = read(tmp_path, text + sweep).system["meshes"]
    assert (first["epsilon"], first["contact_ratio"]) == (0.1, 1.2)
    assert (second["epsilon"], second["contact_ratio"], second["phasing"]) == (0.2, 1.6, 0.3)


SWEEPS = {
    "train": (
        TRAIN,
        """
  epsilon: [0.0, 0.3]
  meshes.first.contact_ratio: [1.3, 2.4]
  inertias.1: {start: 0.3, stop: 0.6, num: 2}
  damping_ratio: [0.0, 0.05]
  meshes.second.damping: [0.0, 0.1]
  case: [{label: a, phasing: 0.1}, {label: b, input_shaft_stiffness: 2}]
""",
    ),
    "ratios": (TRAIN, '\n  tooth_ratio: [1, "3/5"]\n  phasing: [0, 0.5]\n'),
    "modal damping": (
        TRAIN.replace("  meshes:", "  damping: {modal: [0.01, 0.02, 0.03]}\n  meshes:"),
        "\n  damping.modal.2: [0, 0.1, 0.2]\n  input_shaft_stiffness: [0, 1]\n",
    ),
    "kept maximum": (
        TRAIN.replace("mean_stiffness: 1.2, epsilon", "max_stiffness: 1.2, amplitude"),
        "\n  amplitude: [0, 0.4]\n  contact_ratio: [1.5, 2]\n",
    ),
    "matrices": (
        MATRICES.replace("  meshes:", "  damping: {rayleigh: [0.1, 0.01]}\n  meshes:"),
        """
  mass.0.1: [0.1, 0.3]
  stiffness.1.1: [2, 3]
  meshes.0.direction.2: [0, 0.5]
  lag: [0, 0.25]
  damping.rayleigh.0: [0, 1]
""",
    ),
}


@pytest.mark.parametrize(("base", "sweep"), SWEEPS.values(), ids=SWEEPS)
def test_a_slab_of_the_grid_is_its_points(tmp_path: Path, base: str, sweep: str) -> None:
    """Parameters with arrays build the systems that each point builds by itself, with plain numbers put in by hand."""
    config = read(tmp_path, f"{base}sweep:{sweep}")
    structural = [any(a.structural for a in found.assignments) for found in config.axes]
    points = list(product(*[range(found.size) for found in config.axes]))
    groups: dict[tuple[int, ...], list[tuple[int, ...]]] = {}
    for point in points:
        groups.setdefault(tuple(i for i, s in zip(point, structural, strict=True) if s), []).append(point)
    for members in groups.values():
        index = np.array(members)
        selection = {found.name: index[:, k] for k, found in enumerate(config.axes)}
        slab = build(config.at(selection))
        for row, point in enumerate(members):
            single = build(by_hand(config, point))
            for name in ("mass", "stiffness", "damping"):
                expected = getattr(single, name)
                found = getattr(slab, name)
                if expected is None:
                    expected = np.zeros_like(single.mass)
                if found is None:
                    found = np.zeros_like(expected)
                # The same operations; only the order of sums inside matrix products may differ.
                np.testing.assert_allclose(_row(found, row, 2), expected, rtol=0, atol=1e-13)
            for mesh, alone in zip(slab.meshes, single.meshes, strict=True):
                assert mesh.frequency_ratio == alone.frequency_ratio
                np.testing.assert_array_equal(_row(mesh.direction, row, 1), alone.direction)
                for name in ("mean_stiffness", "epsilon", "lag", "lowest_stiffness"):
                    assert _row(getattr(mesh, name), row, 0) == pytest.approx(getattr(alone, name), rel=1e-15)


def _row(values: Any, row: int, dims: int) -> Any:
    return np.asarray(values)[row] if np.ndim(values) > dims else values


def by_hand(config: Config, point: tuple[int, ...]) -> dict[str, Any]:
    """The numbers of one point, each assignment written into a copy as plain data."""
    parameters = plain(config.system)
    for found, i in zip(config.axes, point, strict=True):
        for item in found.assignments:
            container: Any = parameters
            for part in item.path[:-1]:
                container = container[part]
            value = item.values[i]
            container[item.path[-1]] = value if isinstance(value, Fraction) else float(value)
    return parameters


def test_different_structures_are_not_built_together(tmp_path: Path) -> None:
    config = read(tmp_path, f"{TRAIN}sweep:\n  tooth_ratio: [1, 2]\n")
    assert config.at({"tooth_ratio": np.array([1, 1])})["tooth_ratio"] == Fraction(2)
    with pytest.raises(ValueError, match="must be constant over the rows"):
        config.at({"tooth_ratio": np.array([0, 1])})


def test_base_parameters_are_never_changed(tmp_path: Path) -> None:
    from copy import deepcopy

    config = read(tmp_path, f"{TRAIN}sweep:\n  epsilon: [0.1, 0.2]\n  inertias.0: [1, 2]\n")
    before = deepcopy(config.system)
    config.at({"epsilon": np.array([0, 1]), "inertias.0": np.array([1, 1])})
    assert config.system == before
