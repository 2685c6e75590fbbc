"""Waveforms, periodic terms and irrational frequency ratios, from a configuration to a GearSystem."""

from fractions import Fraction
from pathlib import Path

import h5py
import numpy as np
import pytest
import scenes
from scenes import scene_text, table

from gearstab.config import ConfigError, Problem, load
from gearstab.systems import build
from gearstab.waveforms import WAVEFORMS, Constant, Fourier, Rectangular, Sampled, ToothPair, Trapezoidal

PAIR = scene_text("config_waveforms_pair")
LEVELS = "mean_stiffness: 2.0, epsilon: 0.1"


def written(folder: Path, mesh: str, axes: str = "") -> Path:
    text = PAIR.replace("mean_stiffness: 2.0, epsilon: 0.1, contact_ratio: 1.5", mesh)
    return scenes.written(folder, text.replace("methods:", f"{axes}methods:"))


def mesh_of(folder: Path, mesh: str):
    return build(load(written(folder, mesh)).system).meshes[0]


def errors(folder: Path, mesh: str, axes: str = "") -> list[Problem]:
    with pytest.raises(ConfigError) as caught:
        load(written(folder, mesh, axes))
    return caught.value.problems


KINDS = {
    "rectangular": ("contact_ratio: 1.4, waveform: {kind: rectangular}", Rectangular(1.4)),
    "trapezoidal": ("contact_ratio: 1.4, waveform: {kind: trapezoidal, ramp: 0.2}", Trapezoidal(1.4, 0.2)),
    "fourier": (
        "waveform: {kind: fourier, sin: [0.4, 0.1], cos: [0.2]}",
        Fourier(np.array([0.4, 0.1]), np.array([0.2, 0.0])),
    ),
    "sampled": (
        "waveform: {kind: sampled, phase: [0, 0.3, 0.6], stiffness: [1, 3, 2], interpolation: cubic}",
        Sampled(np.array([0, 0.3, 0.6]), np.array([1.0, 3.0, 2.0]), "cubic"),
    ),
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_waveform_is_that_of_its_section(kind, tmp_path) -> None:
    text, expected = KINDS[kind]
    mesh = mesh_of(tmp_path, f"{LEVELS}, {text}")
    x = np.linspace(-0.4, 1.3, 67)
    assert type(mesh.waveform) is type(expected) is WAVEFORMS[kind]
    np.testing.assert_array_equal(mesh.waveform.value(x), expected.value(x))
    assert (mesh.mean_stiffness, mesh.epsilon) == (2.0, 0.1)


def test_pairs_of_teeth(tmp_path) -> None:
    """k(t) of a parabolic pair, from its equation."""
    mesh = mesh_of(
        tmp_path, "contact_ratio: 1.7, waveform: {kind: pair, shape: parabolic, ends: 0.4, pair_stiffness: 5}"
    )
    assert isinstance(mesh.waveform, ToothPair)
    x = np.linspace(0, 0.999, 100)
    pair = sum(np.where(x + j < 1.7, 5 * (1 - 0.6 * (2 * (x + j) / 1.7 - 1) ** 2), 0.0) for j in (0, 1))
    found = mesh.mean_stiffness * (1 + 2 * mesh.epsilon * mesh.waveform.value(x))
    np.testing.assert_allclose(found, pair, rtol=1e-13)
    constant = mesh_of(tmp_path, "contact_ratio: 1.7, waveform: {kind: pair, shape: constant, pair_stiffness: 5}")
    assert float(constant.mean_stiffness) == pytest.approx(8.5)
    assert float(constant.epsilon) == pytest.approx(1 / 3.4)
    sampled = "waveform: {kind: pair, phase: [0, 0.5, 1], stiffness: [1, 2, 1]}"
    assert float(mesh_of(tmp_path, f"contact_ratio: 1.5, {sampled}").mean_stiffness) == pytest.approx(1.5 * 1.5)


def test_samples_give_what_the_mesh_does_not(tmp_path) -> None:
    text = "waveform: {kind: sampled, phase: [0, 0.5], stiffness: [1, 3]}"
    both = mesh_of(tmp_path, text)
    assert (float(both.mean_stiffness), float(both.epsilon)) == (2.0, 0.5)
    mean = mesh_of(tmp_path, f"mean_stiffness: 10, {text}")
    assert (float(mean.mean_stiffness), float(mean.epsilon)) == (10.0, 0.5)
    variation = mesh_of(tmp_path, f"epsilon: 0.1, {text}")
    assert (float(variation.mean_stiffness), float(variation.epsilon)) == (2.0, 0.1)
    amplitude = mesh_of(tmp_path, f"amplitude: 0.5, {text}")
    assert (float(amplitude.mean_stiffness), float(amplitude.epsilon)) == (2.0, 0.25)
    # The maximum is kept: k_g (1 + 2 epsilon/2) = 9.
    maximum = mesh_of(tmp_path, f"max_stiffness: 9, {text}")
    assert float(maximum.mean_stiffness) == pytest.approx(6.0)


def test_max_stiffness_keeps_the_maximum_of_a_series(tmp_path) -> None:
    mesh = mesh_of(tmp_path, "max_stiffness: 3.0, amplitude: 0.2, waveform: {kind: fourier, cos: [1.0, 0.5]}")
    # cos x + cos(2x)/2 has the maximum 3/2.
    assert float(mesh.mean_stiffness) == pytest.approx(3.0 - 2 * 0.2 * 1.5)


def test_max_stiffness_keeps_the_level_of_a_trapezoid(tmp_path) -> None:
    for ramp in (0.0, 0.2, 0.7):
        text = f"contact_ratio: 1.4, waveform: {{kind: trapezoidal, ramp: {ramp}}}"
        mesh = mesh_of(tmp_path, f"max_stiffness: 1.0, amplitude: 0.1, {text}")
        assert float(mesh.mean_stiffness) == pytest.approx(1 - 0.2 * 0.6)


AXES = table("waveforms")["axes"]


@pytest.mark.parametrize("name", AXES)
def test_numbers_of_a_waveform_are_axes(name, tmp_path) -> None:
    """A slab of the grid is its points one by one."""
    text, axis = AXES[name]["mesh"], AXES[name]["axis"]
    levels = LEVELS if name in ("trapezoidal", "fourier") else "max_stiffness: 5.0" if name == "sampled" else ""
    config = load(written(tmp_path, f"{levels}, {text}".strip(", "), f"  {axis}\n"))
    key = config.axes[1].name
    slab = build(config.at({key: np.arange(3)}))
    assert slab.batch == (3,)
    x = np.linspace(0, 1, 20)[:, None]
    values = slab.meshes[0].mean_stiffness * (1 + 2 * slab.meshes[0].epsilon * slab.meshes[0].waveform.value(x))
    for i in range(3):
        one = build(config.at({key: np.array([i])})).meshes[0]
        own = one.mean_stiffness * (1 + 2 * one.epsilon * one.waveform.value(x))
        np.testing.assert_allclose(values[:, i], own[:, 0], rtol=1e-13)


def test_the_short_name_contact_ratio_means_meshes_that_have_one(tmp_path) -> None:
    path = tmp_path / "case.yaml"
    path.write_text(
        "system:\n  kind: two_stage\n  inertias: [1.0, 0.3, 4.0]\n  input_shaft_stiffness: 0.5\n  meshes:\n"
        "    - {mean_stiffness: 1.0, epsilon: 0.1, waveform: {kind: fourier, sin: [0.5]}}\n"
        "    - {mean_stiffness: 1.0, epsilon: 0.1}\n"
        "sweep:\n  mesh_frequency: [1.0, 2.0]\n  contact_ratio: [1.2, 1.5]\nmethods: {floquet: {}}\n"
    )
    config = load(path)
    assert [item.path for item in config.axes[1].assignments] == [("meshes", 1, "contact_ratio")]
    assert load(path, ["contact_ratio=1.3"]).system["meshes"][1]["contact_ratio"] == 1.3
    remaining = ["system.meshes.1.waveform={kind: fourier, sin: [0.5]}"]
    with pytest.raises(ConfigError, match="no mesh has contact_ratio; their waveforms have none"):
        load(path, remaining)
    with pytest.raises(ConfigError, match="no mesh has contact_ratio"):
        load(path, [*remaining, "contact_ratio=1.3"])


def test_mesh_damping_that_follows_the_stiffness(tmp_path) -> None:
    text = f"{LEVELS}, contact_ratio: 1.4, waveform: {{kind: trapezoidal, ramp: 0.2}}, damping: 0.3"
    system = build(load(written(tmp_path, f"{text}, damping_follows_stiffness: true")).system)
    assert system.damping is None
    (term,) = system.terms
    (mesh,) = system.meshes
    x = np.linspace(0, 1, 30)
    stiffness = mesh.mean_stiffness * (1 + 2 * mesh.epsilon * mesh.waveform.value(x))
    np.testing.assert_allclose(term.damping.value(x), 0.3 * stiffness / mesh.mean_stiffness, rtol=1e-14)
    np.testing.assert_array_equal(term.left, mesh.direction)
    assert term.stiffness is None
    constant = build(load(written(tmp_path, text)).system)
    np.testing.assert_array_equal(constant.damping, [[0.3]])
    assert constant.terms == ()


PLANETARY = scene_text("config_waveforms_planetary")


def test_terms_of_a_planetary_gear_are_scaled_as_the_rest(tmp_path) -> None:
    si, scaled = (
        build(scenes.read(tmp_path, PLANETARY.replace("scaling: SI", f"scaling: {scaling}")).system)
        for scaling in ("SI", "dimensionless")
    )
    assert len(si.terms) == 3
    for one, other in zip(si.terms, scaled.terms, strict=True):
        expected = np.outer(one.left, one.right) * one.damping.value(0.3) / np.sqrt(4.0 * 25.0)
        np.testing.assert_allclose(np.outer(other.left, other.right) * other.damping.value(0.3), expected, rtol=1e-14)


def sampled(folder: Path, name: str, content: str | None = None):
    if content is not None:
        (folder / name).write_text(content)
    return mesh_of(folder, f"waveform: {{kind: sampled, file: {name}}}")


FILES = table("waveforms")["files"]


@pytest.mark.parametrize("name", FILES)
def test_samples_from_a_text_file(name, tmp_path) -> None:
    mesh = sampled(tmp_path, "k.csv", FILES[name])
    # A unit is a factor, which may round.
    np.testing.assert_allclose(mesh.waveform.phase, [0, 0.3, 0.6], rtol=1e-15)
    np.testing.assert_allclose(mesh.waveform.stiffness, [1, 3, 2], rtol=1e-15)


def test_the_drift_of_a_measured_table_is_told(tmp_path) -> None:
    def doubts(content: str) -> list[str]:
        (tmp_path / "k.csv").write_text(content)
        config = load(written(tmp_path, "waveform: {kind: sampled, file: k.csv}"))
        np.testing.assert_allclose(build(config.system).meshes[0].waveform.stiffness, [2e8, 3e8, 2.5e8], rtol=1e-12)
        return [str(doubt) for doubt in config.doubts if "waveform" in doubt.path]

    rows = "phase [deg],stiffness [N/um]\n216,250\n0,200\n108,300\n"
    assert doubts(rows) == doubts(rows + "360,200\n") == doubts(rows + "360,200.0001\n") == []
    (doubt,) = doubts(rows + "360,206\n")
    assert "system.meshes.0.waveform.file: the stiffness drifts from 2e+08 to 2.06e+08 N/m (2.9 %)" in doubt
    assert "the row that closes it is left out" in doubt


def test_an_angle_of_the_shaft_is_doubted(tmp_path) -> None:
    """A table over one tooth of 24, in degrees of the shaft, is no period of the mesh."""
    rows = "\n".join(f"{15 * k / 10},{2 + (k > 4)}e8" for k in range(10))
    (tmp_path / "k.csv").write_text(f"phase [deg],stiffness\n{rows}\n")
    config = load(written(tmp_path, "waveform: {kind: sampled, file: k.csv}"))
    (doubt,) = [str(doubt) for doubt in config.doubts if "waveform" in doubt.path]
    assert "all samples lie within 3.75 % of the mesh period, of which 360 deg are one, not a turn of a gear" in doubt


def test_samples_from_hdf5(tmp_path) -> None:
    with h5py.File(tmp_path / "k.h5", "w") as file:
        file["phase"] = np.array([0, 0.3, 0.6])
        file["stiffness"] = np.array([1, 3, 2])
        file["phase"].attrs["units"] = "1"
    np.testing.assert_array_equal(sampled(tmp_path, "k.h5").waveform.stiffness, [1, 3, 2])
    with h5py.File(tmp_path / "k.h5", "a") as file:
        file["stiffness"].attrs["units"] = np.bytes_("kN/m")
    np.testing.assert_array_equal(sampled(tmp_path, "k.h5").waveform.stiffness, [1e3, 3e3, 2e3])
    with h5py.File(tmp_path / "k.h5", "a") as file:
        file["stiffness"].attrs["units"] = "kg"
    (problem,) = errors(tmp_path, "waveform: {kind: sampled, file: k.h5}")
    assert "stiffness has the wrong dimension" in problem.message


def test_files_that_cannot_be_read(tmp_path) -> None:
    def found(name: str) -> str:
        (problem,) = errors(tmp_path, f"waveform: {{kind: sampled, file: {name}}}")
        return str(problem)

    assert "there is no such file" in found("none.csv")
    assert "is no .csv or .h5 file" in found("k.xlsx")
    (tmp_path / "folder.csv").mkdir()
    assert "is a folder" in found("folder.csv")
    (tmp_path / "latin.csv").write_bytes("Steifigkeit für x\n".encode("latin-1"))
    assert "is not UTF-8 text" in found("latin.csv")
    (tmp_path / "broken.h5").write_text("no HDF5")
    assert "cannot be read" in found("broken.h5")
    with h5py.File(tmp_path / "k.h5", "w") as file:
        file["phase"] = np.array([0, 0.3])
    assert "holds no stiffness" in found("k.h5")
    with h5py.File(tmp_path / "k.h5", "w") as file:
        file["phase"], file["stiffness"] = np.array([0, 0.3]), np.array([1.0, np.nan])
    assert "entry 1 of stiffness is not finite" in found("k.h5")
    with h5py.File(tmp_path / "k.h5", "w") as file:
        file["phase"], file["stiffness"] = np.array([0, 0.3]), np.array([[1.0, 2.0]])
    assert "stiffness (1, 2)" in found("k.h5")


def test_the_digest_is_that_of_the_content(tmp_path) -> None:
    def digest(name: str, content: str) -> str:
        (tmp_path / name).write_text(content)
        return load(written(tmp_path, f"waveform: {{kind: sampled, file: {name}}}")).digest

    first = digest("k.csv", "0,1\n0.5,3\n")
    assert digest("k.csv", "phase stiffness\n0 1\n0.5 3\n") == first
    assert digest("other.csv", "0,1\n0.5,3\n") == first
    assert digest("k.csv", "0,1\n0.5,3.0000001\n") != first


MATRICES = scene_text("config_waveforms_matrices")


def matrices(folder: Path, term: str, axes: str = "", mesh: str = "") -> Path:
    text = MATRICES.replace("{name: friction, left: [0.3, -0.1], right: [1, 1], stiffness: {mean: 0.05}}", term)
    text = text.replace("contact_ratio: 1.5}", f"contact_ratio: 1.5{mesh}}}")
    return scenes.written(folder, text.replace("methods:", f"{axes}methods:"))


def test_terms_of_matrices(tmp_path) -> None:
    term = (
        "{name: friction, left: [0.3, -0.1], right: [1, 1], frequency_ratio: 1/2, lag: 0.25, "
        "stiffness: {mean: 0.05, amplitude: 0.1, contact_ratio: 1.6}, damping: {mean: 0.2}}"
    )
    system = build(load(matrices(tmp_path, term)).system)
    (found,) = system.terms
    assert (found.name, found.frequency_ratio, float(found.lag)) == ("friction", Fraction(1, 2), 0.25)
    np.testing.assert_array_equal(found.left, [0.3, -0.1])
    # Rectangular without a waveform: d = 0.6.
    np.testing.assert_allclose(found.stiffness.value(np.array([0.1, 0.7])), [0.05 + 0.2 * 0.4, 0.05 - 0.2 * 0.6])
    assert isinstance(found.damping, Constant)
    assert float(found.damping.value(0.3)) == 0.2
    assert system.common_period()[0] == 2
    assert system.piecewise_constant


def test_terms_from_samples(tmp_path) -> None:
    (tmp_path / "k.csv").write_text("0,-1\n0.5,3\n")
    term = "{left: [1, 0], right: [0, 1], stiffness: {waveform: {kind: sampled, file: k.csv}}}"
    config = load(matrices(tmp_path, term))
    (found,) = build(config.system).terms
    np.testing.assert_allclose(found.stiffness.value(np.array([0.0, 0.25, 0.5])), [-1, 1, 3], atol=1e-15)
    assert list(config.contents) == ["terms.0.stiffness.waveform"]


def test_terms_are_axes(tmp_path) -> None:
    term = "{name: friction, left: [0.3, -0.1], right: [1, 1], stiffness: {mean: 0.05}}"
    config = load(
        matrices(tmp_path, term, "  terms.friction.stiffness.mean: [0.0, 0.1]\n  terms.0.left.1: [0.2, 0.3]\n")
    )
    names = [axis.name for axis in config.axes[1:]]
    system = build(config.at({name: np.arange(2) for name in names}))
    assert system.batch == (2,)
    np.testing.assert_allclose(system.terms[0].stiffness.value(0.0), [0.0, 0.1])
    np.testing.assert_allclose(system.terms[0].left, [[0.3, 0.2], [0.3, 0.3]])


TERM = "{left: [1, 0], right: [0, 1], damping: {mean: 1}}"


def test_irrational_frequency_ratios(tmp_path) -> None:
    path = matrices(tmp_path, TERM, mesh=", exact: false, frequency_ratio: 1.4142135623730951")
    config = load(path)
    system = build(config.system)
    assert system.meshes[0].frequency_ratio == 2**0.5
    assert isinstance(system.meshes[0].frequency_ratio, float)
    assert not system.commensurate
    # What was resolved is read as the same configuration.
    again = tmp_path / "again.yaml"
    again.write_text(config.resolved)
    assert load(again).digest == config.digest
    with pytest.raises(ConfigError, match="or exact: false if it stands for an irrational number"):
        load(path, ["system.meshes.0.exact=true"])
    with pytest.raises(ConfigError, match="must be > 0"):
        load(path, ["system.meshes.0.frequency_ratio=0"])
    exact = build(load(path, ["system.meshes.0.exact=true", "system.meshes.0.frequency_ratio=0.5"]).system)
    assert exact.meshes[0].frequency_ratio == Fraction(1, 2)


def test_irrational_frequency_ratios_are_axes(tmp_path) -> None:
    mesh = ", exact: false"
    config = load(matrices(tmp_path, TERM, "  meshes.a.frequency_ratio: {start: 1.1, stop: 1.3, num: 3}\n", mesh))
    axis = config.axes[1]
    assert axis.size == 3
    for i, expected in enumerate((1.1, 1.2, 1.3)):
        found = build(config.at({axis.name: np.array([i])})).meshes[0].frequency_ratio
        assert isinstance(found, float)
        assert found == pytest.approx(expected, rel=1e-15)
    with pytest.raises(ConfigError, match="is exact and has no range"):
        load(matrices(tmp_path, TERM, "  meshes.a.frequency_ratio: {start: 1.1, stop: 1.3, num: 3}\n"))
