"""``gearstab diff``, and the commit that the version tells."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scenes import ROOT, TRAIN, ran, written

from gearstab import version

CONFIG = (
    TRAIN
    + """\
sweep:
  mesh_frequency: {start: 4.0, stop: 6.0, num: 41}
  epsilon: [0.1, 0.3]
methods: {floquet: {}, boundaries: {}}
"""
)


def swept(folder: Path, name: str, *overrides: str) -> Path:
    out = folder / f"{name}.h5"
    words = [word for text in overrides for word in ("--set", text)]
    assert ran("sweep", written(folder, CONFIG), "-o", out, "-q", *words).exit_code == 0
    return out


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("diff")
    # All stiffness 1 % larger: frequencies grow by sqrt(1.01).
    stiffer = [f"system.meshes.{k}.mean_stiffness=1.01" for k in (0, 1)] + ["system.input_shaft_stiffness=0.505"]
    return swept(folder, "a"), swept(folder, "b", *stiffer)


def test_a_result_is_the_same_as_itself(results: tuple[Path, Path]) -> None:
    found = ran("diff", results[0], results[0])
    assert found.exit_code == 0
    assert found.stdout == f"{results[0]} and {results[0]} are the same\n"


def test_what_changed_is_told(results: tuple[Path, Path]) -> None:
    found = ran("diff", *results, "--json")
    assert found.exit_code == 1
    told = json.loads(found.stdout)
    with h5py.File(results[0]) as a, h5py.File(results[1]) as b:
        stable = [file["floquet/stable"][:] for file in (a, b)]
        growth = [file["floquet/growth_rate"][:] for file in (a, b)]
    own = told["verdicts"]["floquet"]
    assert own["changed"] == np.sum(stable[0] != stable[1]) > 0
    assert own["to_unstable"] == np.sum((stable[0] == 1) & (stable[1] == 0))
    assert own["to_unstable"] + own["to_stable"] == own["changed"]
    largest = np.abs(growth[0] - growth[1]).max() / max(np.abs(item).max() for item in growth)
    assert told["variables"]["/floquet/growth_rate"] == largest
    # The smaller of two frequencies is the reference of the first file.
    moved = [item["largest_shift"] for item in told["edges"]["moved"] if item["label"] == "2w3"]
    assert_allclose(moved, np.sqrt(1.01) - 1, rtol=1e-6)
    text = ran("diff", *results).stdout
    assert "became unstable" in text
    assert "region 2w3" in text


def test_tolerances(results: tuple[Path, Path]) -> None:
    loose = ("--tolerance", "2", "--edges", "0.02", "--verdicts", "82")
    told = json.loads(ran("diff", *results, *loose, "--json").stdout)
    opened = told["edges"]["only_first"] + told["edges"]["only_second"]
    assert (not told["same"]) == bool(opened)
    for strict in (("--verdicts", "0"), ("--edges", "0.001"), ("--tolerance", "0.001")):
        assert ran("diff", *results, *loose, *strict).exit_code == 1


def test_other_axes_are_told(results: tuple[Path, Path], tmp_path: Path) -> None:
    other = swept(tmp_path, "c", "sweep.epsilon=[0.1, 0.31]")
    longer = swept(tmp_path, "d", "sweep.epsilon=[0.1, 0.2, 0.3]")
    assert "axis epsilon: other values" in ran("diff", results[0], other).stdout
    assert "axis epsilon: 2 values, 3 in the second" in ran("diff", results[0], longer).stdout


def test_a_file_that_cannot_be_read(results: tuple[Path, Path], tmp_path: Path) -> None:
    found = ran("diff", results[0], tmp_path / "none.h5")
    assert (found.exit_code, found.stderr.count("\n")) == (2, 1)


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    package = tmp_path / "source" / "gearstab"
    package.mkdir(parents=True)
    shutil.copy(ROOT / "gearstab" / "version.py", package)
    return package.parent


def commit_of(folder: Path) -> str:
    import runpy

    return str(runpy.run_path(str(folder / "gearstab" / "version.py"))["commit"]())


def git(folder: Path, *words: str) -> str:
    person = ("-c", "user.name=A", "-c", "user.email=a@b", "-c", "init.defaultBranch=main")
    return subprocess.run(["git", *person, *words], cwd=folder, check=True, capture_output=True, text=True).stdout


@pytest.mark.skipif(shutil.which("git") is None, reason="needs git to make a repository")
def test_the_commit_is_that_of_git(repository: Path, tmp_path: Path) -> None:
    assert commit_of(repository) == ""
    git(repository, "init", "-q")
    git(repository, "add", ".")
    git(repository, "commit", "-qm", "first")
    wanted = git(repository, "rev-parse", "HEAD")[: version.DIGITS]
    assert commit_of(repository) == wanted
    git(repository, "pack-refs", "--all")
    assert commit_of(repository) == wanted
    git(repository, "worktree", "add", "-q", str(tmp_path / "second"))
    assert commit_of(tmp_path / "second") == wanted
    git(repository, "checkout", "-q", "--detach")
    assert commit_of(repository) == wanted
    (repository / "gearstab" / version.BUILT).write_text("0123456789abcdef\n")
    assert commit_of(repository) == "0123456789ab"


def test_a_broken_repository_is_no_error(repository: Path) -> None:
    (repository / ".git").mkdir()
    for head in ("", "ref: refs/heads/main\n", "no commit\n"):
        (repository / ".git" / "HEAD").write_text(head)
        assert commit_of(repository) == ""


def test_the_version_tells_the_commit() -> None:
    found = ran("--version").stdout
    assert found.startswith(f"gearstab, version {version.__version__}")
    assert version.commit() in found
    assert ("commit" in found) == bool(version.commit())
