"""Contents of a right configuration: parameters, defaults, units, files of matrices, overrides, digest."""

import math
import subprocess
import sys
from fractions import Fraction
from pathlib import Path
from shutil import copy
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.sparse
from hypothesis import given
from random_documents import trees
from ruamel.yaml import YAML
from scenes import CONFIGURATIONS, read, scene_text, table

from gearstab.config import ConfigError, load
from gearstab.config.document.yaml import parse, write
from gearstab.modal import mean_modes
from gearstab.systems import build

PAIR = scene_text("config_pair")

FILE = scene_text("config_file")

MASS, STIFFNESS, DAMPING = (
    np.diag([2.0, 1.0]),
    np.array([[3.0, -1.0], [-1.0, 1.0]]),
    np.array([[0.1, 0.2], [0.2, 0.3]]),
)


def test_a_whole_configuration(root: Path) -> None:
    config = load(root / "configs" / "lin_parker_2002" / "fig3.yaml")
    assert (config.kind, config.title) == (
        "two_stage",
        "Instability regions of a three-gear train (Lin & Parker 2002, Fig. 3)",
    )
    assert [(a.name, a.size) for a in config.axes] == [("mesh_frequency", 1000), ("epsilon", 101)]
    assert config.methods.chosen == ("floquet", "perturbation", "boundaries")
    assert config.methods.floquet is not None
    assert (config.methods.floquet.exponents, config.methods.floquet.tolerance) == (False, 1e-9)
    assert config.methods.perturbation is not None
    assert (config.methods.perturbation.order, config.methods.perturbation.harmonics) == (1, 3)
    assert config.methods.boundaries is not None
    assert (config.methods.boundaries.tolerance, config.methods.boundaries.width_floor) == (1e-10, 1e-6)
    assert config.methods.uncoupled is None
    assert config.respond is None
    assert config.system["tooth_ratio"] == Fraction(1)
    # det(K - x M) = (1.5 - x) [(2 - 0.3 x) (1 - 4 x) - 1] - (1 - 4 x), multiplied out, with x = w^2.
    cubic = [-1.2, 10.1, -9.45, 0.5]
    frequencies = mean_modes(build(config.system)).natural_frequency
    np.testing.assert_allclose(frequencies, np.sort(np.sqrt(np.roots(cubic))), rtol=1e-12)


def test_a_response(tmp_path: Path) -> None:
    config = read(tmp_path, PAIR + "respond: {mesh_frequency: 60 rpm, cycles: 3, initial: {velocity: [1 mm/s]}}\n")
    assert config.respond is not None
    assert config.respond.mesh_frequency == pytest.approx(2 * math.pi, rel=1e-15)
    assert (config.respond.cycles, config.respond.duration, config.respond.samples_per_cycle) == (3, None, 200)
    assert (config.respond.initial.displacement, config.respond.initial.velocity) == ([0.0], [1e-3])
    assert (config.axes, config.methods.chosen) == ((), ())


def test_defaults(tmp_path: Path) -> None:
    config = read(tmp_path, PAIR)
    assert config.title == "case"
    system: Any = config.system
    assert system.damping_ratio == 0
    assert system.allow_negative_stiffness is False
    assert system.meshes[0].name == "mesh"
    assert system.meshes[0].waveform.kind == "rectangular"


def test_a_rotation_has_units_of_its_own(tmp_path: Path) -> None:
    text = """\
system:
  kind: matrices
  mass: [["2 kg m^2", 0], [0, "3000 g"]]
  stiffness: [["5 Nm/rad", "1 N"], [1, "2 N/mm"]]
  meshes: [{direction: ["25 mm", 1], mean_stiffness: "3 N/m", epsilon: 0.1, contact_ratio: 1.5}]
"""
    parameters = read(tmp_path, text).system
    assert parameters["mass"] == [[2, 0], [0, 3]]
    assert parameters["stiffness"] == [[5, 1], [1, 2000]]
    assert parameters["meshes"][0]["direction"] == [0.025, 1]


def test_libraries_that_nothing_asks_for_stay_out(tmp_path: Path, root: Path) -> None:
    program = (
        "import sys, gearstab.config\n"
        "assert 'pydantic' not in sys.modules and 'ruamel' not in sys.modules\n"
        f"gearstab.config.load({str(root / 'configs' / 'gear_pair.yaml')!r})\n"
        "found = {'pint', 'h5py', 'scipy', 'xarray', 'matplotlib'} & set(sys.modules)\n"
        "assert not found, found\n"
    )
    subprocess.run([sys.executable, "-W", "error", "-c", program], cwd=root, check=True)


def test_a_check_imports_what_the_configuration_needs(root: Path) -> None:
    """Half of the time of a short command is imports: no other kinds of systems, no sweep, nothing of other methods."""
    config = root / "configs" / "lin_parker_2002" / "fig3.yaml"
    program = (
        "import sys, numpy\n"
        "before = set(sys.modules)\n"  # NumPy 1 imports numpy.ma itself
        "from gearstab.cli import group\n"
        f"group.main(['check', {str(config)!r}], standalone_mode=False)\n"
        "libraries = {'pint', 'h5py', 'scipy', 'xarray', 'matplotlib', 'joblib', 'rich', 'numpy.ma'}\n"
        "rooms = {'design', 'gears', 'perturbation', 'plots', 'response', 'sweep', 'tolerance'}\n"
        "parts = {'floquet.boundaries', 'floquet.general', 'floquet.smooth', 'systems.gearbox', 'systems.planetary'}\n"
        "found = (libraries | {f'gearstab.{name}' for name in rooms | parts}) & (set(sys.modules) - before)\n"
        "assert not found, found\n"
    )
    subprocess.run([sys.executable, "-W", "error", "-c", program], cwd=root, check=True)


def save(path: Path, values: dict[str, np.ndarray]) -> None:
    if path.suffix == ".npz":
        np.savez(path, **values)
    elif path.suffix == ".h5":
        with h5py.File(path, "w") as file:
            for name, value in values.items():
                file[name] = value
    else:
        scipy.io.savemat(path, {name: scipy.sparse.csc_matrix(value) for name, value in values.items()})


@pytest.mark.parametrize("name", ["model.npz", "model.h5", "model.mat"])
def test_matrices_from_a_file(tmp_path: Path, name: str) -> None:
    save(tmp_path / name, {"mass": MASS, "stiffness": STIFFNESS, "damping": DAMPING})
    config = read(tmp_path, FILE.replace("model.npz", name))
    system = build(config.system)
    np.testing.assert_array_equal(system.mass, MASS)
    np.testing.assert_array_equal(system.stiffness, STIFFNESS)
    np.testing.assert_array_equal(system.damping, DAMPING)
    slab = build(config.at({"stiffness.0.1": np.array([1, 0, 1])}))
    np.testing.assert_array_equal(slab.stiffness[:, 0, 1], [-0.5, -1, -0.5])
    np.testing.assert_array_equal(slab.stiffness[:, 1, 0], [-0.5, -1, -0.5])
    np.testing.assert_array_equal(config.system["stiffness"], STIFFNESS)


def test_hdf5_of_matlab_is_transposed(tmp_path: Path) -> None:
    path = tmp_path / "model.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in {"mass": MASS, "stiffness": STIFFNESS, "damping": DAMPING}.items():
            file[name] = value.T
    config = read(tmp_path, FILE.replace("model.npz", "model.mat"))
    np.testing.assert_array_equal(config.system["damping"]["matrix"], DAMPING)


BAD_FILES = {
    "no such file": (None, "there is no such file", "relative to the folder"),
    "no stiffness": ({"mass": MASS, "k": STIFFNESS}, "holds no stiffness", "holds k, mass"),
    "not square": ({"mass": MASS[:1], "stiffness": STIFFNESS}, "mass has the shape (1, 2)", "square"),
    "sizes": ({"mass": np.eye(3), "stiffness": STIFFNESS}, "stiffness has the shape (2, 2), mass (3, 3)", "equal"),
    "complex": ({"mass": MASS * 1j, "stiffness": STIFFNESS}, "no real numbers but complex128", "real"),
    "NaN": ({"mass": MASS * np.nan, "stiffness": STIFFNESS}, "not finite", "finite"),
    "asymmetric": (
        {"mass": np.array([[2.0, 0.1], [0.2, 1.0]]), "stiffness": STIFFNESS},
        "mass is not symmetric: entry 0.1 is 0.1, entry 1.0 is 0.2",
        "make mass.0.1 and mass.1.0 equal",
    ),
    "a triangle": ({"mass": MASS, "stiffness": np.triu(STIFFNESS)}, "on one side of its diagonal alone", "both"),
    "asymmetric damping": (
        {"mass": MASS, "stiffness": STIFFNESS, "damping": np.triu(DAMPING)},
        "damping has entries on one side of its diagonal alone",
        "save both triangles",
    ),
    "indefinite": ({"mass": -MASS, "stiffness": STIFFNESS}, "mass is not positive definite", "positive"),
}


@pytest.mark.parametrize(("content", "message", "hint"), BAD_FILES.values(), ids=BAD_FILES)
def test_bad_file_of_matrices(tmp_path: Path, content: dict[str, np.ndarray] | None, message: str, hint: str) -> None:
    if content is not None:
        save(tmp_path / "model.npz", content)
    with pytest.raises(ConfigError) as caught:
        read(tmp_path, FILE)
    first = caught.value.problems[0]
    assert (first.line, first.path) == (3, "system.file")
    assert message in first.message
    assert hint in first.hint


def test_file_that_is_no_archive(tmp_path: Path) -> None:
    for name, message in (("model.npz", "cannot be read"), ("model.csv", "is no .npz, .h5 or .mat file")):
        (tmp_path / name).write_text("1, 2")
        with pytest.raises(ConfigError, match=message):
            read(tmp_path, FILE.replace("model.npz", name))


def test_overrides_of_axes(tmp_path: Path) -> None:
    text = (
        PAIR
        + "sweep: {mesh_frequency: [1, 2], meshes.mesh.epsilon: {start: 0, stop: 0.5, num: 3}}\nmethods: {floquet: }\n"
    )
    overrides = (
        "sweep.meshes.mesh.epsilon.num=6", "sweep.mesh_frequency={start: 1, stop: 3, step: 1}",
        "sweep.equivalent_mass=[1, 2]",
        "methods.floquet.exponents=true", "methods.boundaries.tolerance=1e-8",
    )  # fmt: skip
    config = read(tmp_path, text, *overrides)
    assert [(a.name, a.size) for a in config.axes] == [
        ("mesh_frequency", 3), ("meshes.mesh.epsilon", 6), ("equivalent_mass", 2),
    ]  # fmt: skip
    assert config.methods.floquet is not None
    assert config.methods.floquet.exponents
    assert config.methods.boundaries is not None
    assert config.methods.boundaries.tolerance == 1e-8


def test_resolved_configurations_are_the_same(tmp_path: Path, root: Path) -> None:
    found = CONFIGURATIONS
    assert found
    for source in found:
        config = load(source)
        for model in (*source.parent.glob("*.npz"), *source.parent.glob("*.csv")):  # named relative to it
            copy(model, tmp_path)
        again = read(tmp_path, config.resolved)
        assert again.digest == config.digest, source.name
        assert again.resolved == config.resolved
        assert again.title == config.title


def test_resolved_configuration_with_a_file(tmp_path: Path) -> None:
    save(tmp_path / "model.npz", {"mass": MASS, "stiffness": STIFFNESS})
    config = read(tmp_path, FILE)
    assert read(tmp_path, config.resolved).digest == config.digest
    save(tmp_path / "model.npz", {"mass": 2 * MASS, "stiffness": STIFFNESS})
    assert load(tmp_path / "case.yaml").digest != config.digest


SWEEP = scene_text("config_sweep")


@pytest.mark.parametrize(("old", "new"), table("changes")["same_digest"])
def test_digest_is_of_the_meaning(tmp_path: Path, old: str, new: str) -> None:
    assert read(tmp_path, SWEEP).digest == read(tmp_path, SWEEP.replace(old, new)).digest


@pytest.mark.parametrize(("old", "new"), table("changes")["another_digest"])
def test_digest_is_of_all_that_counts(tmp_path: Path, old: str, new: str) -> None:
    assert read(tmp_path, SWEEP).digest != read(tmp_path, SWEEP.replace(old, new)).digest


def test_anchors_and_merges(tmp_path: Path) -> None:
    text = """\
system:
  kind: matrices
  mass: [[1, 0], [0, 1]]
  stiffness: [[1, 0], [0, 1]]
  meshes:
    - &base {name: a, direction: [1, 1], mean_stiffness: 1, epsilon: 0.1, contact_ratio: 1.5}
    - {<<: *base, name: b, epsilon: 0.2}
"""
    first, second = read(tmp_path, text).system["meshes"]
    assert (first["name"], first["epsilon"], first["contact_ratio"]) == ("a", 0.1, 1.5)
    assert (second["name"], second["epsilon"], second["contact_ratio"]) == ("b", 0.2, 1.5)


@given(trees())
def test_what_is_written_is_read_back(tree: Any) -> None:
    text = write({"key": tree})
    assert parse(text, "x").data == {"key": tree}
    assert YAML(typ="safe", pure=True).load(text) == {"key": tree}


def test_numbers_of_yaml() -> None:
    text = "[1e-2, 1.0e-10, 1_000, 0o17, 0x1F, +.5, -1., 007, on, yes, 1:30, 2001-01-01, ~, .inf, '1', !!str 1]"
    expected = [0.01, 1e-10, 1000, 15, 31, 0.5, -1.0, 7, "on", "yes", "1:30", "2001-01-01", None, math.inf, "1", "1"]
    found = parse(text, "x").data
    assert found == expected
    assert [type(v) for v in found] == [type(v) for v in expected]
