"""Matrices from files and arrays as a system, with what is antisymmetric, with few modes, and as a file again."""

from pathlib import Path

import numpy as np
import pytest
from scenes import CONFIGS, written
from scipy import sparse
from scipy.io import loadmat, mmwrite
from scipy.linalg import eigvals
from systems import lone_pair

import gearstab as gs
from gearstab.config import ConfigError
from gearstab.errors import NotPossible, OutputError
from gearstab.floquet import solve

N = 8
MASS = np.diag(np.arange(1.0, N + 1))
SPRINGS = np.diff(np.eye(N), axis=0)
STIFFNESS = 100 * SPRINGS.T @ SPRINGS + np.eye(N)
DAMPING = 0.01 * MASS
DIRECTION = np.eye(N)[2] - 2 * np.eye(N)[5]
MESH = {"name": "mesh", "direction": DIRECTION, "mean_stiffness": 50.0, "epsilon": 0.3, "contact_ratio": 1.6}


def mean() -> np.ndarray:
    return STIFFNESS + 50 * np.outer(DIRECTION, DIRECTION)


def matrices(system: gs.system.GearSystem) -> list[np.ndarray]:
    return [system.mass, system.stiffness, system.damping, system.meshes[0].direction]


@pytest.mark.parametrize("how", ["arrays", "sparse", "market", "npz", "mat"])
def test_every_way_in_gives_the_same_system(how: str, tmp_path: Path) -> None:
    three = {"mass": MASS, "stiffness": STIFFNESS, "damping": DAMPING}
    given: dict[str, object] = dict(three)
    if how == "sparse":
        given = {name: sparse.csr_array(a) for name, a in three.items()}
    elif how == "market":
        given = {name: tmp_path / f"{name}.mtx" for name in three}
        for name, a in three.items():
            mmwrite(tmp_path / f"{name}.mtx", sparse.coo_array(a))
    elif how in ("npz", "mat"):
        given = {"mass": tmp_path / f"model.{how}"}
        gs.export_matrices(gs.build(gs.from_matrices(**three, meshes=[MESH])), tmp_path / f"model.{how}")
    found = gs.build(gs.from_matrices(**given, meshes=[MESH]))
    for mine, expected in zip(matrices(found), (MASS, STIFFNESS, DAMPING, DIRECTION), strict=True):
        np.testing.assert_allclose(mine, expected, rtol=1e-15, atol=1e-300)


def test_antisymmetric_parts_count() -> None:
    """Characteristic exponents at constant stiffness are those of the full matrices, by another solver."""
    rng = np.random.default_rng(5)
    skew = [np.triu(rng.normal(size=(N, N)), 1) for _ in range(2)]
    stiffness, damping = (a + s - s.T for a, s in zip((STIFFNESS, DAMPING), skew, strict=True))
    model = gs.from_matrices(MASS, stiffness, damping, meshes=[MESH | {"epsilon": 0.0}])
    found = gs.floquet(model, 40.0, exponents=True)
    full = stiffness + 50 * np.outer(DIRECTION, DIRECTION)
    inverse = np.linalg.inv(MASS)
    state = np.block([[np.zeros((N, N)), np.eye(N)], [-inverse @ full, -inverse @ damping]])
    # Real parts: imaginary ones are known up to multiples of the mesh frequency. 1e-8: Magnus steps to 1e-9.
    np.testing.assert_allclose(np.sort(found.exponent_real), np.sort(eigvals(state).real), atol=1e-8)


def test_few_modes_keep_frequencies_and_say_what_is_missing() -> None:
    whole = gs.from_matrices(MASS, STIFFNESS, DAMPING, meshes=[MESH])
    few = gs.from_matrices(MASS, STIFFNESS, DAMPING, meshes=[MESH], modes=5)
    frequencies = np.sqrt(np.sort(eigvals(np.linalg.solve(MASS, mean())).real))
    found = [mode["natural_frequency"] for mode in gs.info(few)["modes"]]
    np.testing.assert_allclose(found, frequencies[:5], rtol=1e-12)
    assert few.basis is not None
    np.testing.assert_allclose(few.basis.T @ MASS @ few.basis, np.eye(5), atol=1e-13)
    # The compliance of the mesh from the inverse matrix, and from the modes that are kept.
    compliance = DIRECTION @ np.linalg.solve(mean(), DIRECTION)
    kept = sum((few.basis.T @ DIRECTION) ** 2 / frequencies[:5] ** 2)
    assert f"5 of 8 modes are kept, up to {frequencies[4]:.6g} rad/s" in few.note
    assert f"{100 * (1 - kept / compliance):.2g} % at mesh" in few.note
    every = gs.from_matrices(MASS, STIFFNESS, meshes=[MESH], modes=N)
    assert every.note == "all 8 modes are kept: nothing is neglected"
    # The widest region is that of the whole model to a part of what is neglected.
    edges = [gs.boundaries(model, 5.0, 60.0) for model in (whole, few)]
    widths = [np.nanmax(np.ptp(edge.boundary_frequency, axis=1)) for edge in edges]
    assert widths[1] == pytest.approx(widths[0], rel=2 * (1 - kept / compliance))


WAVES = ("lin_parker_2002/fig3.yaml", "waveforms/trapezoidal.yaml", "waveforms/harmonics.yaml")


@pytest.mark.parametrize("name", WAVES)
def test_what_is_written_is_the_stiffness(name: str, tmp_path: Path) -> None:
    system = gs.build(CONFIGS / name)
    gs.export_matrices(system, tmp_path / "model.npz")
    with np.load(tmp_path / "model.npz", allow_pickle=False) as held:
        data = dict(held)
    assert list(data["mesh_name"]) == [mesh.name for mesh in system.meshes]
    x = np.random.default_rng(1).uniform(0.0, 1.0, 500)
    for k, mesh in enumerate(system.meshes):
        exact = mesh.mean_stiffness * (1 + 2 * mesh.epsilon * mesh.waveform.value(x - mesh.lag))
        read = np.interp(x, data["phase"][k], data["mesh_stiffness"][k])
        # Piecewise linear waves exactly, but beside a jump by the shift of its limits; smooth ones by h^2 k''/8.
        smooth = name.endswith("harmonics.yaml")
        np.testing.assert_allclose(read, exact, atol=2e-3 if smooth else 1e-6)
    np.testing.assert_array_equal(data["direction"], [mesh.direction for mesh in system.meshes])


BACK = [(name, "npz", 1e-12 if name.endswith("fig3.yaml") else 2e-8) for name in WAVES]
BACK += [("lin_parker_2002/fig3.yaml", "mat", 1e-12), ("matrices.yaml", "mat", 1e-12)]


@pytest.mark.parametrize(("name", "ending", "tolerance"), BACK)
def test_what_is_read_back_has_the_same_multipliers(name: str, ending: str, tolerance: float, tmp_path: Path) -> None:
    """Jumps at the same instants; other waves as far as 256 samples tell them, and solved to 1e-9."""
    system, path = gs.build(CONFIGS / name), tmp_path / f"model.{ending}"
    gs.export_matrices(system, path)
    frequency = np.array([1.3, 2.17, 4.6])
    found = [gs.floquet(m, frequency, exponents=True) for m in (system, gs.build(gs.from_matrices(path)))]
    for key in ("exponent_real", "exponent_imag"):
        np.testing.assert_allclose(found[1][key], found[0][key], atol=tolerance)


def test_constant_terms_are_part_of_the_matrices(tmp_path: Path) -> None:
    """Antisymmetric parts go out with their matrices, and become terms again."""
    skew = np.triu(np.random.default_rng(2).normal(size=(N, N)), 1)
    whole = gs.build(gs.from_matrices(MASS, STIFFNESS, DAMPING + skew - skew.T, meshes=[MESH]))
    gs.export_matrices(whole, tmp_path / "model.npz")
    with np.load(tmp_path / "model.npz") as held:
        np.testing.assert_allclose(held["damping"], DAMPING + skew - skew.T, atol=1e-13)
    found = [gs.floquet(m, 20.0).growth_rate for m in (whole, gs.build(gs.from_matrices(tmp_path / "model.npz")))]
    np.testing.assert_allclose(found[1], found[0], atol=1e-9)


def skewed() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(4)
    skew = [np.triu(rng.normal(size=(N, N)), 1) for _ in range(2)]
    return STIFFNESS + skew[0] - skew[0].T, DAMPING + skew[1] - skew[1].T


def scene(folder: Path, more: str = "", **held: np.ndarray) -> Path:
    """Return the path of a configuration whose file holds these matrices."""
    np.savez(folder / "model.npz", **held)
    path = written(
        folder,
        "system:\n  kind: matrices\n  file: model.npz\n  meshes: [{direction: {q3: 1, q6: -2}, mean_stiffness: 50, "
        f"epsilon: 0.3, contact_ratio: 1.6}}]\n{more}",
    )
    return path


@pytest.mark.parametrize("names", [("mass", "stiffness", "damping"), ("M", "K", "C")])
def test_a_file_in_a_configuration_is_read_as_from_matrices_does(names: tuple[str, ...], tmp_path: Path) -> None:
    stiffness, damping = skewed()
    path = scene(tmp_path, **dict(zip(names, (MASS, stiffness, damping), strict=True)))
    system = gs.build(path)
    whole = gs.from_matrices(MASS, stiffness, damping, meshes=[MESH])
    for mine, other in zip(matrices(system), matrices(gs.build(whole)), strict=True):
        np.testing.assert_array_equal(mine, other)
    for part, expected in (("stiffness", stiffness), ("damping", damping)):
        terms = [(getattr(term, part), np.outer(term.left, term.right)) for term in system.terms]
        total = getattr(system, part) + sum(a.value(np.zeros(())) * outer for a, outer in terms if a is not None)
        np.testing.assert_allclose(total, expected, atol=1e-12)
    found = [gs.floquet(m, 20.0).growth_rate for m in (path, whole)]
    np.testing.assert_array_equal(*found)


def test_what_a_file_of_matrices_may_not_hold(tmp_path: Path) -> None:
    stiffness, damping = skewed()

    def said(path: Path) -> str:
        with pytest.raises(ConfigError) as caught:
            gs.load(path)
        (problem,) = caught.value.problems
        return f"{problem.path}: {problem.message}"

    assert said(scene(tmp_path, M=MASS, mass=MASS, K=STIFFNESS)) == (
        "system.file: holds mass and M, which mean the same"
    )
    assert said(scene(tmp_path, K=STIFFNESS)) == "system.file: holds no mass"  # and none on the direction
    assert said(scene(tmp_path, M=stiffness, K=STIFFNESS)).startswith("system.file: mass is not symmetric")
    axes = "sweep: {mesh_frequency: [1, 2], damping.0.1: [0, 1]}\nmethods: {floquet: {}}\n"
    assert said(scene(tmp_path, axes, M=MASS, K=STIFFNESS, C=damping)) == (
        "sweep.damping.0.1: sets damping.matrix.0.1 and its transpose, which differ in the file"
    )


def test_axes_of_entries_whose_transpose_is_equal(tmp_path: Path) -> None:
    """The antisymmetric part stays what it is where an axis sets an entry of the diagonal."""
    stiffness, damping = skewed()
    axes = "sweep: {mesh_frequency: [20.0, 21.0], damping.1.1: [0.5, 2.0]}\nmethods: {floquet: {}}\n"
    growth = gs.sweep(scene(tmp_path, axes, M=MASS, K=stiffness, C=damping))["floquet"]["growth_rate"].values
    damping[1, 1] = 2.0
    alone = gs.floquet(gs.from_matrices(MASS, stiffness, damping, meshes=[MESH]), [20.0, 21.0]).growth_rate
    # Multipliers are right to 1e-9, and the two are computed in batches of different size.
    np.testing.assert_allclose(growth[:, 1], np.ravel(alone), rtol=1e-8)


def test_a_model_as_a_configuration(tmp_path: Path) -> None:
    stiffness, damping = skewed()
    model = gs.from_matrices(MASS, stiffness, damping, meshes=[MESH])
    gs.dump(model, tmp_path / "model.yaml")
    assert gs.load(tmp_path / "model.yaml").digest == gs.load(model).digest
    gs.dump(CONFIGS / "lin_parker_2002/fig3.yaml", tmp_path / "model.yaml")
    assert gs.load(tmp_path / "model.yaml").digest == gs.load(CONFIGS / "lin_parker_2002/fig3.yaml").digest
    with pytest.raises(OutputError, match=r"ends in \.yaml or \.yml, not in \.npz"):
        gs.dump(model, tmp_path / "model.npz")
    with pytest.raises(OutputError, match="is the input itself"):
        gs.dump(tmp_path / "model.yaml", tmp_path / "model.yaml")
    path = scene(tmp_path, M=MASS, K=stiffness)
    gs.dump(path, tmp_path / "again.yaml")
    assert gs.load(tmp_path / "again.yaml").digest == gs.load(path).digest
    (tmp_path / "other").mkdir()
    with pytest.raises(NotPossible, match="names files relative to"):
        gs.dump(path, tmp_path / "other" / "again.yaml")


def test_matlab_gets_names_as_cells(tmp_path: Path) -> None:
    gs.export_matrices(CONFIGS / "matrices.yaml", tmp_path / "model.mat")
    held = loadmat(tmp_path / "model.mat", simplify_cells=True)
    assert list(held["mesh_name"]) == ["input", "output"]
    assert held["coordinate"][0] == "motor"
    np.testing.assert_allclose(held["frequency_ratio"], [1.0, 1 / 3], rtol=1e-15)


def test_mistakes(tmp_path: Path) -> None:
    system = gs.build(CONFIGS / "gear_pair.yaml")
    with pytest.raises(OutputError, match=r"use .mat or .npz"):
        gs.export_matrices(system, tmp_path / "model.csv")
    with pytest.raises(NotPossible, match=r"a batch of systems of shape \(2,\)"):
        gs.export_matrices(gs.build(CONFIGS / "gear_pair.yaml", epsilon=[0.1, 0.2]), tmp_path / "model.mat")
    (tmp_path / "model.mat").mkdir()
    with pytest.raises(OutputError, match="is a folder"):
        gs.export_matrices(system, tmp_path / "model.mat")
    for wrong, message in (
        ({"stiffness": None}, "stiffness is missing"),
        ({"meshes": None}, "has no elastic mesh"),
        ({"meshes": [{"name": "a", "mean_stiffness": 1.0}]}, "mesh 'a' has no direction"),
        ({"meshes": [{"direction": DIRECTION, "mean_stiffness": 1.0}]}, "how the stiffness of mesh 'mesh1' varies"),
        ({"modes": 9}, "modes is 9, and the model has 8 coordinates"),
        ({"mass": np.zeros((2, 3))}, r"a matrix has the shape \(2, 3\)"),
    ):
        with pytest.raises(NotPossible, match=message):
            gs.from_matrices(**({"mass": MASS, "stiffness": STIFFNESS, "meshes": [MESH]} | wrong))


def test_rotations_go_with_the_modes_that_are_kept() -> None:
    """All modes kept: the same exponents in other coordinates."""
    mass, stiffness = np.diag([1.0, 2.0, 3.0]), np.diag([4.0, 5.0, 6.0])
    mesh = {"direction": [1.0, 1.0, -1.0], "mean_stiffness": 2.0, "epsilon": 0.2, "contact_ratio": 1.6}
    turning = {"speed_ratio": "1/3", "gyroscopic": [[0, 1.0, 0], [-1.0, 0, 0.5], [0, -0.5, 0]]}
    whole, kept = (gs.from_matrices(mass, stiffness, meshes=[mesh], modes=n, rotation=[turning]) for n in (None, 3))
    omega = np.array([1.0, 3.5])
    found, expected = (solve(gs.build(model), omega, exponents=True).exponents for model in (kept, whole))
    # Real parts are zero but for rounding, which must not decide their order.
    found, expected = (np.take_along_axis(e, np.argsort(e.imag, axis=-1), -1) for e in (found, expected))
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert not np.allclose(kept["rotation"][0]["gyroscopic"], turning["gyroscopic"])


def test_weak_teeth_name_the_mesh_that_they_are_part_of(tmp_path: Path) -> None:
    mesh = {"mean_stiffness": 4e8, "epsilon": 0.2, "contact_ratio": 1.5, "faults": [{"gear": "a", "factor": 0.7}]}
    for ending, whole in ((".npz", ""), (".mat", [])):
        path = tmp_path / f"weak{ending}"
        gs.export_matrices(gs.build(lone_pair(17, 1.0, mesh)), path)
        held = np.load(path) if ending == ".npz" else loadmat(path, squeeze_me=True)
        assert [part if len(part) else whole for part in held["part_of"].tolist()] == [whole, "mesh"]
        assert held["mean_stiffness"][0] > 0 > held["mean_stiffness"][1]
    sound = tmp_path / "sound.npz"
    gs.export_matrices(gs.build(lone_pair(17, 1.0, mesh | {"faults": []})), sound)
    assert "part_of" not in np.load(sound)
