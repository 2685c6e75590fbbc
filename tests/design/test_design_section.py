"""The section ``design``: what is accepted, what it means, and a line for each mistake."""

from pathlib import Path

import numpy as np
import pytest
from scenes import TRAIN, ran, read, scene_text, written

from gearstab.config import ConfigError
from gearstab.design import check

SECTION = scene_text("design_section_section")
STAGE = scene_text("design_section_stage")


def test_forms_of_variables(tmp_path: Path) -> None:
    written(tmp_path, "label, inertias.0, inertias.1\nA, 1, 2\n\nB, 3, 4\n", "rows.csv")
    text = SECTION.replace("variables: {", "variables: {inertias.2: {integers: [2, 4]}, row: {catalogue: rows.csv}, ")
    design = read(tmp_path, TRAIN + text).design
    assert design is not None
    by_name = {v.name: v for v in design.variables}
    assert by_name["meshes.first.contact_ratio"].bounds == (1.1, 1.9)
    assert list(by_name["inertias.2"].axis.values) == [2, 3, 4]
    assert by_name["tooth_ratio"].axis.size == 2
    rows = by_name["row"]
    assert (rows.form, list(rows.axis.values)) == ("choices", ["A", "B"])
    assert [list(item.values) for item in rows.axis.assignments] == [[1, 3], [2, 4]]


def test_units_in_the_header_of_a_catalogue(tmp_path: Path) -> None:
    content = "label, inertias.0 [g], inertias.1, inertias.2 (mg)\nA, 1, 2, 5\nB, 2 kg, 4, 6\n"
    written(tmp_path, content, "rows.csv")
    design = read(tmp_path, TRAIN + SECTION.replace("variables: {", "variables: {row: {catalogue: rows.csv}, ")).design
    assert design is not None
    (rows,) = (v for v in design.variables if v.name == "row")
    values = [list(item.values) for item in rows.axis.assignments]
    np.testing.assert_allclose(values, [[1e-3, 2], [2, 4], [5e-6, 6e-6]], rtol=1e-14)


def test_the_resolved_configuration_says_the_same_without_the_file(tmp_path: Path) -> None:
    written(tmp_path, "inertias.0, inertias.1\n1, 2\n3, 4\n", "rows.csv")
    first = read(tmp_path, TRAIN + SECTION.replace("variables: {", "variables: {row: {catalogue: rows.csv}, "))
    (tmp_path / "rows.csv").unlink()
    again = read(tmp_path, first.resolved)
    assert again.resolved == first.resolved
    assert again.digest == first.digest


def test_units_of_ranges_bounds_and_limits(tmp_path: Path) -> None:
    section = """\
design:
  range: [{input_speed: ["600 rpm", "1200 rpm"]}, {input_speed: ["2000 rpm", "2400 rpm"], weight: 3}]
  variables: {gears.face_width: ["10 mm", "30 mm"]}
  minimise: {instability_width: 1, growth_rate: 0.5}
  constraints: {root_stress: {max: "300 MPa"}, gears.module: {min: "1 mm"}, rotors.a.teeth: {max: 40}}
"""
    design = read(tmp_path, STAGE + section).design
    assert design is not None
    assert design.ranges[0].low == pytest.approx(20 * np.pi)
    assert [item.weight for item in design.ranges] == [1, 3]
    assert design.variables[0].bounds == (0.01, 0.03)
    assert design.objectives == ({"instability_width": 1.0, "growth_rate": 0.5},)
    assert [item.high for item in design.limits] == [300e6, np.inf, 40]
    assert design.limits[1].low == 1e-3


def test_all_mistakes_at_once_and_exit_code_2(tmp_path: Path) -> None:
    text = SECTION.replace("[2.0, 6.0]", "[6.0, 2.0]").replace("[1.1, 1.9]", "[1.9]").replace(": instab", ": stab")
    path = written(tmp_path, TRAIN + text)
    for command in ("check", "design"):
        done = ran(command, path)
        assert (done.exit_code, done.stderr.count("\n")) == (2, 3)
        assert all(line.startswith(f"{path}:") for line in done.stderr.splitlines())


def test_what_the_system_cannot_give(tmp_path: Path) -> None:
    text = TRAIN + SECTION.replace(": instability_width", ": [load_factor, root_stress]")
    with pytest.raises(ConfigError) as caught:
        check(read(tmp_path, text))
    assert len(caught.value.problems) == 2


def test_too_many_combinations(tmp_path: Path) -> None:
    wide = "variables: {inertias.0: {integers: [1, 1000]}, inertias.1: {integers: [1, 1000]}, "
    with pytest.raises(ConfigError):
        check(read(tmp_path, TRAIN + SECTION.replace("variables: {", wide)))


def test_the_section_is_needed(tmp_path: Path) -> None:
    assert ran("design", written(tmp_path, TRAIN)).exit_code == 2
