"""The commit that the version tells, from git or from a file that a build left."""

import runpy
import shutil
import subprocess
from pathlib import Path

import pytest
from scenes import ROOT, ran

from gearstab import version


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    package = tmp_path / "source" / "gearstab"
    package.mkdir(parents=True)
    shutil.copy(ROOT / "gearstab" / "version.py", package)
    return package.parent


def commit_of(folder: Path) -> str:
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
